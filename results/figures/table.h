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

// An output that the user named, there whole or not at all: written under another
// name, synced and renamed by Close. Not closed, it leaves nothing. Symbolic links are
// followed. What is there and no regular file (a pipe, a terminal) is written to as it
// is, never replaced. Throws Error 73, 74 or 77.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void Append(const std::string& bytes);
  void Close();

 private:
  void Flush();
  void RemoveTemporary();
  [[noreturn]] void Fail(const char* what);

  std::string path_;
  std::string temporary_;  // empty: written to path_ itself
  std::string buffer_;
  int file_ = -1;
};

void WriteFile(const std::string& path, const std::string& bytes);

// The bytes of a file. Throws Error 66, 74 or 77.
std::string ReadWholeFile(const std::string& path);

// One row as an object of one line, and as a line of CSV.
std::string JsonLine(const std::vector<std::string>& columns, const std::vector<Cell>& row);
std::string CsvLine(const std::vector<Cell>& row);
// The current row of a statement.
std::vector<Cell> ReadCells(const Statement& statement);

}  // namespace dreamsearch::results
