// table.h - a table of results, and the forms in which it is printed.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace dreamsearch::results {

class Statement;

// Nothing, a whole number, a number, or a text. A number that is not finite is
// nothing.
using Cell = std::variant<std::monostate, std::int64_t, double, std::string>;

enum class TableForm { kText, kMarkdown, kCsv, kJson };
// Throws Error 2 for an unknown name. Known: text, markdown, csv, json.
TableForm ParseTableForm(const std::string& name);

struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<Cell>> rows;

  // Text and Markdown round numbers to 6 digits and show control characters
  // escaped, so that a name cannot steer a terminal; CSV (RFC 4180) and JSON (a
  // list of objects) keep every bit.
  std::string Print(TableForm form) const;
};

// The remaining rows of a statement.
Table ReadTable(Statement* statement);

// The shortest decimal text that reads back as the same number.
std::string ExactText(double value);
// A field of a CSV file, quoted where RFC 4180 asks for it.
std::string CsvField(const std::string& text);
// Control characters as \n, \t or \x1b.
std::string Printable(const std::string& text);
// 12,000.
std::string Grouped(std::int64_t value);
// Characters of UTF-8.
std::size_t Width(const std::string& text);

// Writes a file whole or not at all: under another name first, then renamed.
// Throws Error 73, 74 or 77.
void WriteFile(const std::string& path, const std::string& bytes);

}  // namespace dreamsearch::results
