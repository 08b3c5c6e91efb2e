// table.h - a table of results, and the forms in which it is printed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <variant>
#include <vector>

namespace dreamsearch::results {

// Nothing, a whole number, a number, or a text. A number that is not finite is
// nothing.
using Cell = std::variant<std::monostate, std::int64_t, double, std::string>;

bool IsNumber(const Cell& cell);

enum class TableForm { kText, kMarkdown, kCsv, kJson };

struct Table {
  std::vector<std::string> columns;  // empty: no line of headings
  std::vector<std::vector<Cell>> rows;
  std::map<std::size_t, std::string> notes = {};  // text form: lines below a row

  // Columns are two spaces apart, those of numbers aligned to the right; with `indent`
  // every line of the text form begins with so many spaces. Text and Markdown round numbers to 6
  // digits and show control characters escaped, so that a name cannot steer a terminal; CSV (RFC
  // 4180) and JSON (a list of objects) keep every bit.
  //   Failure 2  JSON, and two columns have one name: an object has room for one.
  std::string Print(TableForm form, std::size_t indent = 0) const;
};

// Failure 2 if two columns have one name, asking for another.
void CheckNamesDiffer(const std::vector<std::string>& columns);

// One row as an object of one line, and as a line of CSV. The names of the columns differ.
std::string JsonLine(const std::vector<std::string>& columns, const std::vector<Cell>& row);
std::string CsvLine(const std::vector<Cell>& row);

}  // namespace dreamsearch::results
