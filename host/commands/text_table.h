// text_table.h - aligned columns for a terminal.
#pragma once

#include <cstddef>
#include <ostream>
#include <string>
#include <vector>

namespace dreamsearch {

// Rows of cells; every column is as wide as its widest cell (in characters of
// UTF-8), columns are two spaces apart, and no line ends in spaces.
class TextTable {
 public:
  explicit TextTable(std::size_t indent) : indent_(indent) {}

  void Row(std::vector<std::string> cells);
  // A line below the last row that belongs to no column.
  void Note(std::string text);
  void Print(std::ostream& out) const;

 private:
  struct Line {
    std::vector<std::string> cells;
    std::string note;
  };

  std::size_t indent_;
  std::vector<Line> lines_;
};

}  // namespace dreamsearch
