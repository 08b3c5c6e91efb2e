#include "host/commands/text_table.h"

#include <algorithm>
#include <utility>

#include "results/system/text.h"

namespace dreamsearch {
void TextTable::Row(std::vector<std::string> cells) { lines_.push_back({std::move(cells), ""}); }

void TextTable::Note(std::string text) { lines_.push_back({{}, std::move(text)}); }

void TextTable::Print(std::ostream& out) const {
  std::vector<std::size_t> widths;
  for (const Line& line : lines_) {
    widths.resize(std::max(widths.size(), line.cells.size()));
    for (std::size_t i = 0; i < line.cells.size(); ++i) {
      widths[i] = std::max(widths[i], Width(line.cells[i]));
    }
  }
  for (const Line& line : lines_) {
    std::string text(indent_, ' ');
    for (std::size_t i = 0; i < line.cells.size(); ++i) {
      text += line.cells[i] + std::string(widths[i] - Width(line.cells[i]) + 2, ' ');
    }
    if (line.cells.empty()) text = line.note;
    text.erase(text.find_last_not_of(' ') + 1);
    out << text << '\n';
  }
}

}  // namespace dreamsearch
