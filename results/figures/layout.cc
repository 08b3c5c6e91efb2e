#include "results/figures/layout.h"

#include <algorithm>
#include <cstring>
#include <sstream>

#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

constexpr double kEm = 9;                     // text size
constexpr double kLetter = 0.6 * kEm;         // width of a letter, rather too wide
constexpr std::size_t kCategoryLetters = 26;  // of a line beside or below an axis

// By columns of the grid.
constexpr double kPanelWidth[] = {380, 250, 190, 150};
constexpr double kPanelHeight[] = {230, 165, 130, 105};

int ColumnsFor(std::size_t panels) {
  if (panels <= 3) return static_cast<int>(panels);
  if (panels == 4) return 2;
  if (panels <= 9) return 3;
  return 4;
}

double TextWidth(const std::vector<std::string>& lines) {
  std::size_t letters = 0;
  for (const std::string& line : lines) letters = std::max(letters, Width(line));
  return kLetter * static_cast<double>(letters);
}

std::size_t LettersIn(double width) { return static_cast<std::size_t>(width / kLetter); }

// How many bytes of `word` go on a line of so many letters: up to a sign that joins
// its parts if there is one, so that names break between their parts.
std::size_t BreakOf(const std::string& word, std::size_t letters) {
  std::size_t end = 0, joint = 0, hyphen = 0, count = 0;
  while (end < word.size() && count < letters) {
    do {
      ++end;
    } while (end < word.size() && (static_cast<unsigned char>(word[end]) & 0xc0) == 0x80);
    ++count;
    if (std::strchr("./=", word[end - 1]) != nullptr) joint = end;
    if (word[end - 1] == '_') hyphen = end;
  }
  if (end == word.size()) return end;
  return joint > 0 ? joint : hyphen > 0 ? hyphen : end;
}

}  // namespace

std::vector<std::string> Wrapped(const std::string& text, std::size_t letters,
                                 const std::string& indent) {
  letters = std::max<std::size_t>(letters, 8);
  std::vector<std::string> lines;
  std::istringstream words(text);
  std::string line, word;
  bool begun = false;  // the line has a word
  const auto end_line = [&] {
    lines.push_back(line);
    line = indent;
    begun = false;
  };
  while (words >> word) {
    if (begun && Width(line) + 1 + Width(word) > letters) end_line();
    line += begun ? " " : "";
    begun = true;
    while (Width(line) + Width(word) > letters) {
      const std::size_t part = BreakOf(word, letters - Width(line));
      line += word.substr(0, part);
      word.erase(0, part);
      end_line();
    }
    line += word;
    begun = true;
  }
  if (begun || lines.empty()) lines.push_back(line);
  return lines;
}

Layout::Layout(const Figure& figure) {
  const auto count = figure.panels.size();
  columns = std::max(1, ColumnsFor(count));
  rows = std::max(1, static_cast<int>((count + static_cast<std::size_t>(columns) - 1) /
                                      static_cast<std::size_t>(columns)));
  std::vector<std::string> numbered = PlaceCategories(figure);
  SizePanels(figure);
  cell_width = left + panel_width + RightMargin(figure);
  cell_height = panel_height + ticks_below + kLineHeight + 13;
  y_label_width = figure.y_label.empty() ? 0 : kLineHeight + 4;
  width = kPad + y_label_width + columns * cell_width + kPad;

  PlaceLegend(figure);
  numbered.insert(numbered.end(), figure.notes.begin(), figure.notes.end());
  for (const std::string& note : numbered) {
    for (std::string& line : Wrapped(Printable(note), LettersIn(width - 2 * kPad) * 10 / 9, "  ")) {
      notes.push_back(std::move(line));
    }
  }
  std::istringstream text(figure.title);
  std::string title;
  while (std::getline(text, title)) {
    for (std::string& line : Wrapped(Printable(title), LettersIn(width - 2 * kPad))) {
      titles.push_back(std::move(line));
    }
  }
  bottom = kPad + static_cast<double>(notes.size()) * kLineHeight + legend_height +
           (figure.x_label.empty() ? 0 : kLineHeight + 4) + 4;
  const double top =
      kPad + (titles.empty() ? 0 : static_cast<double>(titles.size()) * (kLineHeight + 2) + 4);
  height = bottom + rows * cell_height + top;
}

std::vector<std::string> Layout::PlaceCategories(const Figure& figure) {
  left = 34;
  std::vector<std::string> numbered;
  for (const Panel& panel : figure.panels) {
    auto& names = categories.emplace_back();
    for (const std::string& name : panel.categories) {
      names.push_back(Wrapped(Printable(name), kCategoryLetters));
    }
    if (!panel.HasBars()) {
      for (const auto& name : names) left = std::max(left, TextWidth(name) + 10);
      continue;
    }
    // Below bars there is room for one line, or else for a number that a note explains.
    const bool fit =
        std::all_of(names.begin(), names.end(), [](const auto& name) { return name.size() == 1; });
    for (std::size_t i = 0; i < names.size() && !fit; ++i) {
      names[i] = {std::to_string(i + 1)};
      numbered.push_back(names[i][0] + ": " + panel.categories[i]);
    }
  }
  ticks_below = 16;
  for (std::size_t p = 0; p < figure.panels.size(); ++p) {
    if (!figure.panels[p].x_label.empty()) ticks_below = 16 + kLineHeight;
    if (figure.panels[p].HasBars()) ticks_below = std::max(ticks_below, BarLabelHeight(p));
  }
  return numbered;
}

void Layout::SizePanels(const Figure& figure) {
  panel_width = kPanelWidth[columns - 1];
  panel_height = kPanelHeight[columns - 1];
  for (std::size_t p = 0; p < figure.panels.size(); ++p) {
    if (categories[p].empty() || figure.panels[p].HasBars()) continue;
    std::size_t lines = 1;
    for (const auto& name : categories[p]) lines = std::max(lines, name.size());
    const double row = 18.0 + 12.0 * static_cast<double>(lines - 1);
    panel_height =
        std::max(panel_height * 0.5, row * static_cast<double>(categories[p].size()) + 12);
  }
}

// Names below bars are turned by 35 degrees.
double Layout::BarLabelHeight(std::size_t panel) const {
  double longest = 0;
  for (const auto& name : categories[panel]) longest = std::max(longest, TextWidth(name));
  return 14 + longest * 0.6;
}

// The last of the turned names reaches beyond its bar.
double Layout::RightMargin(const Figure& figure) const {
  double margin = 12;
  for (std::size_t p = 0; p < figure.panels.size(); ++p) {
    if (!figure.panels[p].HasBars()) continue;
    const double place = panel_width / static_cast<double>(categories[p].size());
    margin = std::max(margin, 0.82 * TextWidth(categories[p].back()) - place / 2);
  }
  return margin;
}

void Layout::PlaceLegend(const Figure& figure) {
  const double room = width - 2 * kPad;
  double x = 0;
  std::size_t row = 0, lines = 0;  // where the row begins, and how many lines it has
  for (const LegendEntry& entry : figure.legend) {
    LegendText text;
    text.lines = Wrapped(Printable(entry.text), LettersIn(room - kSample - 6));
    const double need = kSample + 6 + TextWidth(text.lines) + 14;
    // The space after an entry may be beyond the edge.
    if (x > 0 && x + need - 14 > room) {
      x = 0;
      row += lines;
      lines = 0;
    }
    text.x = x;
    text.row = static_cast<int>(row);
    x += need;
    lines = std::max(lines, text.lines.size());
    legend.push_back(std::move(text));
  }
  legend_rows = static_cast<int>(row + lines);
  legend_height = legend_rows == 0 ? 0 : legend_rows * (kLineHeight + 1) + 5;
}

double Layout::PanelX(std::size_t panel) const {
  const int column = static_cast<int>(panel) % columns;
  return kPad + y_label_width + column * cell_width + left;
}

double Layout::PanelY(std::size_t panel) const {
  const int row = static_cast<int>(panel) / columns;
  return bottom + (rows - 1 - row) * cell_height + ticks_below;
}

}  // namespace dreamsearch::results
