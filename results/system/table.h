// table.h - a table of results, and the forms in which it is printed.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace dreamsearch::results {

// Nothing, a whole number, a number, or a text. A number that is not finite is
// nothing.
using Cell = std::variant<std::monostate, std::int64_t, double, std::string>;

enum class TableForm { kText, kMarkdown, kCsv, kJson };
// Throws Failure 2 for an unknown name. Known: text, markdown, csv, json.
TableForm ParseTableForm(const std::string& name);

struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<Cell>> rows;

  // Text and Markdown round numbers to 6 digits and show control characters
  // escaped, so that a name cannot steer a terminal; CSV (RFC 4180) and JSON (a
  // list of objects) keep every bit.
  std::string Print(TableForm form) const;
};

// One row as an object of one line, and as a line of CSV.
std::string JsonLine(const std::vector<std::string>& columns, const std::vector<Cell>& row);
std::string CsvLine(const std::vector<Cell>& row);

}  // namespace dreamsearch::results
