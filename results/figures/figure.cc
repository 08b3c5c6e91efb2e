#include "results/figures/figure.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "results/database/sqlite.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/table.h"
#include "results/system/text.h"

namespace dreamsearch::results {
namespace {

struct Style {
  const char* colour;
  const char* dash;
  int marker;
};
// Okabe and Ito 2008, without its yellow, which vanishes on white, plus grey.
constexpr std::array<Style, kStyles> kStyleTable = {{
    {"#0072B2", "1", 7},
    {"#D55E00", "(14,4)", 5},
    {"#009E73", "(5,3)", 9},
    {"#CC79A7", "(14,4,3,4)", 13},
    {"#000000", "(2,3)", 4},
    {"#E69F00", "(20,6)", 11},
    {"#56B4E9", "(10,3,3,3,3,3)", 6},
    {"#777777", "(3,6)", 8},
}};
const Style& StyleOf(int style) {
  return kStyleTable[static_cast<std::size_t>(style) % kStyleTable.size()];
}

// A gnuplot string: single quotes expand nothing.
std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : Printable(text)) {
    if (c == '\'') quoted += '\'';
    quoted += c;
  }
  return quoted + "'";
}

// The same over several lines. Double quotes hold the line break and nothing else,
// for in them gnuplot expands much.
std::string Quoted(const std::vector<std::string>& lines) {
  std::string quoted;
  for (const std::string& line : lines) {
    quoted += (quoted.empty() ? "" : ".\"\\n\".") + Quoted(line);
  }
  return quoted;
}

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

// The text in lines of at most so many letters, of which all but the first are
// indented.
std::vector<std::string> Wrapped(const std::string& text, std::size_t letters,
                                 const std::string& indent = "") {
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

std::string Number(double value) { return std::isfinite(value) ? ExactText(value) : "NaN"; }

// 20k, 1.5M, 0.25.
std::string TickText(double value) {
  const double size = std::abs(value);
  char text[32];
  if (size >= 1e6) {
    std::snprintf(text, sizeof text, "%gM", value / 1e6);
  } else if (size >= 1e4) {
    std::snprintf(text, sizeof text, "%gk", value / 1e3);
  } else {
    std::snprintf(text, sizeof text, "%g", size < 1e-12 ? 0 : value);
  }
  return text;
}

// The smallest of 1, 2, 5 times a power of ten that gives at most `count` steps.
double NiceStep(double range, int count) {
  const double rough = range / count;
  const double power = std::pow(10, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough * 0.9999999) return factor * power;
  }
  return 10 * power;
}

struct Axis {
  double low = 0, high = 1;
  std::string tics;  // argument of `set xtics`
};

Axis LinearAxis(double low, double high, int ticks, bool open_low, bool open_high) {
  if (!(high > low)) high = low + (low == 0 ? 1 : std::abs(low));
  const double step = NiceStep(high - low, ticks);
  Axis axis;
  axis.low = open_low ? std::floor(low / step + 1e-9) * step : low;
  axis.high = open_high ? std::ceil(high / step - 1e-9) * step : high;
  axis.tics = "(";
  for (double tick = std::ceil(axis.low / step - 1e-9) * step; tick <= axis.high + step * 1e-6;
       tick += step) {
    if (axis.tics.size() > 1) axis.tics += ", ";
    axis.tics += Quoted(TickText(std::abs(tick) < step * 1e-6 ? 0 : tick)) + " " + Number(tick);
  }
  axis.tics += ")";
  return axis;
}

Axis LogAxis(double low, double high) {
  Axis axis;
  axis.low = std::max(low, high * 1e-6);
  axis.high = high;
  axis.tics = "(";
  const bool decades = high / axis.low > 1000;
  for (double power = std::pow(10, std::floor(std::log10(axis.low))); power <= high; power *= 10) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = power * factor;
      if (tick < axis.low * 0.999 || tick > high * 1.001 || (decades && factor > 1)) continue;
      axis.tics += (axis.tics.size() > 1 ? ", " : "") + Quoted(TickText(tick)) + " " + Number(tick);
    }
  }
  axis.tics += ")";
  return axis;
}

int ColumnsFor(std::size_t panels) {
  if (panels <= 3) return static_cast<int>(panels);
  if (panels == 4) return 2;
  if (panels <= 9) return 3;
  return 4;
}

// Everything is laid out in points of 1/72 inch, the origin at the lower left.
class Script {
 public:
  explicit Script(const Figure& figure) : figure_(figure) { Lay(); }

  // format: svg, png or pdf.
  std::string Text(const std::string& format) {
    std::ostringstream out;
    out << "set encoding utf8\n";
    if (format == "svg") {
      // The terminal's units are pixels of 1/96 inch.
      out << "set terminal svg size " << Pixels(width_, 96) << "," << Pixels(height_, 96)
          << " noenhanced font 'DejaVu Sans,12' linewidth 1.2 background '#ffffff'\n";
    } else if (format == "png") {
      // 180 pixels an inch; the terminal takes font sizes for 96.
      out << "set terminal pngcairo size " << Pixels(width_, 180) << "," << Pixels(height_, 180)
          << " noenhanced font 'DejaVu Sans,9' fontscale 1.875 linewidth 2 pointscale 2"
             " background '#ffffff'\n";
    } else {
      out << "set terminal pdfcairo size " << Number(width_ / 72) << "in," << Number(height_ / 72)
          << "in noenhanced font 'DejaVu Sans,9' fontscale 1"
          << " background '#ffffff'\n";
    }
    out << "set output 'figure'\n"
           "set multiplot\n"
           "unset key\n"
           "set border 3 linecolor rgb '#444444' linewidth 0.8\n"
           "set tics nomirror out scale 0.5 textcolor rgb '#222222'\n"
           "set grid xtics ytics linetype 1 linecolor rgb '#dddddd' linewidth 0.5\n"
           "set style fill transparent solid 0.2 noborder\n";
    for (std::size_t i = 0; i < figure_.panels.size(); ++i) PlotPanel(i, &out);
    // Sizes in the SVG terminal's pixels or in points.
    PlotFrame(format == "svg" ? "10.5" : "8", &out);
    out << "unset multiplot\nunset output\n";
    return out.str();
  }

 private:
  static constexpr double kEm = 9;              // text size in points
  static constexpr double kLetter = 0.6 * kEm;  // width of a letter, rather too wide
  static constexpr double kLineHeight = 14;
  static constexpr double kPad = 8;
  static constexpr std::size_t kCategoryLetters = 26;  // of a line beside or below an axis

  static int Pixels(double points, double per_inch) {
    return static_cast<int>(std::lround(points / 72 * per_inch));
  }
  static double TextWidth(const std::vector<std::string>& lines) {
    std::size_t letters = 0;
    for (const std::string& line : lines) letters = std::max(letters, Width(line));
    return kLetter * static_cast<double>(letters);
  }
  static std::size_t Letters(double width) { return static_cast<std::size_t>(width / kLetter); }

  void Lay() {
    const auto count = figure_.panels.size();
    columns_ = std::max(1, ColumnsFor(count));
    rows_ = static_cast<int>((count + static_cast<std::size_t>(columns_) - 1) /
                             static_cast<std::size_t>(columns_));
    rows_ = std::max(rows_, 1);
    const double panel_width = columns_ == 1   ? 380
                               : columns_ == 2 ? 250
                               : columns_ == 3 ? 190
                                               : 150;
    const double panel_height = columns_ == 1   ? 230
                                : columns_ == 2 ? 165
                                : columns_ == 3 ? 130
                                                : 105;
    left_ = 34;
    std::vector<std::string> numbered;
    for (const Panel& panel : figure_.panels) {
      auto& names = categories_.emplace_back();
      for (const std::string& name : panel.categories) {
        names.push_back(Wrapped(Printable(name), kCategoryLetters));
      }
      if (!HasBars(panel)) {
        for (const auto& name : names) left_ = std::max(left_, TextWidth(name) + 10);
        continue;
      }
      // Below bars there is room for one line, or else for a number that a note explains.
      const bool fit = std::all_of(names.begin(), names.end(),
                                   [](const auto& name) { return name.size() == 1; });
      for (std::size_t i = 0; i < names.size() && !fit; ++i) {
        names[i] = {std::to_string(i + 1)};
        numbered.push_back(names[i][0] + ": " + panel.categories[i]);
      }
    }
    tics_below_ = 16;
    for (std::size_t p = 0; p < count; ++p) {
      if (!figure_.panels[p].x_label.empty()) tics_below_ = 16 + kLineHeight;
      if (HasBars(figure_.panels[p])) tics_below_ = std::max(tics_below_, BarLabelHeight(p));
    }
    panel_width_ = panel_width;
    panel_height_ = panel_height;
    for (std::size_t p = 0; p < count; ++p) {
      if (categories_[p].empty() || HasBars(figure_.panels[p])) continue;
      std::size_t lines = 1;
      for (const auto& name : categories_[p]) lines = std::max(lines, name.size());
      const double row = 18.0 + 12.0 * static_cast<double>(lines - 1);
      panel_height_ =
          std::max(panel_height_ * 0.5, row * static_cast<double>(categories_[p].size()) + 12);
    }
    cell_width_ = left_ + panel_width_ + RightMargin();
    cell_height_ = panel_height_ + tics_below_ + kLineHeight + 13;
    y_label_width_ = figure_.y_label.empty() ? 0 : kLineHeight + 4;
    width_ = kPad + y_label_width_ + columns_ * cell_width_ + kPad;

    LayLegend();
    numbered.insert(numbered.end(), figure_.notes.begin(), figure_.notes.end());
    for (const std::string& note : numbered) {
      for (std::string& line :
           Wrapped(Printable(note), Letters(width_ - 2 * kPad) * 10 / 9, "  ")) {
        notes_.push_back(std::move(line));
      }
    }
    std::istringstream titles(figure_.title);
    std::string title;
    while (std::getline(titles, title)) {
      for (std::string& line : Wrapped(Printable(title), Letters(width_ - 2 * kPad))) {
        titles_.push_back(std::move(line));
      }
    }
    bottom_ = kPad + static_cast<double>(notes_.size()) * kLineHeight + legend_height_ +
              (figure_.x_label.empty() ? 0 : kLineHeight + 4) + 4;
    top_ =
        kPad + (titles_.empty() ? 0 : static_cast<double>(titles_.size()) * (kLineHeight + 2) + 4);
    height_ = bottom_ + rows_ * cell_height_ + top_;
  }

  static bool HasBars(const Panel& panel) {
    return std::any_of(panel.series.begin(), panel.series.end(),
                       [](const Series& s) { return s.mark == Series::Mark::kBar; });
  }
  // Names below bars are turned by 35 degrees.
  double BarLabelHeight(std::size_t panel) const {
    double longest = 0;
    for (const auto& name : categories_[panel]) longest = std::max(longest, TextWidth(name));
    return 14 + longest * 0.6;
  }

  // The last of the turned names reaches beyond its bar.
  double RightMargin() const {
    double margin = 12;
    for (std::size_t p = 0; p < figure_.panels.size(); ++p) {
      if (!HasBars(figure_.panels[p])) continue;
      const double place = panel_width_ / static_cast<double>(categories_[p].size());
      margin = std::max(margin, 0.82 * TextWidth(categories_[p].back()) - place / 2);
    }
    return margin;
  }

  void LayLegend() {
    const double room = width_ - 2 * kPad;
    double x = 0;
    std::size_t row = 0, lines = 0;  // where the row begins, and how many lines it has
    for (const LegendEntry& entry : figure_.legend) {
      LegendText text;
      text.lines = Wrapped(Printable(entry.text), Letters(room - kSample - 6));
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
      legend_.push_back(std::move(text));
    }
    legend_rows_ = static_cast<int>(row + lines);
    legend_height_ = legend_rows_ == 0 ? 0 : legend_rows_ * (kLineHeight + 1) + 5;
  }

  double ScreenX(double points) const { return points / width_; }
  double ScreenY(double points) const { return points / height_; }

  void PlotPanel(std::size_t index, std::ostringstream* out) const {
    const Panel& panel = figure_.panels[index];
    const int column = static_cast<int>(index) % columns_;
    const int row = static_cast<int>(index) / columns_;
    const double x0 = kPad + y_label_width_ + column * cell_width_ + left_;
    const double y0 = bottom_ + (rows_ - 1 - row) * cell_height_ + tics_below_;
    *out << "set lmargin at screen " << Number(ScreenX(x0)) << "\nset rmargin at screen "
         << Number(ScreenX(x0 + panel_width_)) << "\nset bmargin at screen " << Number(ScreenY(y0))
         << "\nset tmargin at screen " << Number(ScreenY(y0 + panel_height_)) << "\nset title "
         << Quoted(panel.title) << " offset 0,-0.6\n";
    if (panel.x_label.empty()) {
      *out << "unset xlabel\n";
    } else {
      *out << "set xlabel " << Quoted(panel.x_label) << " offset 0,0.6\n";
    }

    const bool bars = HasBars(panel);
    const bool categories = !panel.categories.empty();
    double x_low = INFINITY, x_high = -INFINITY, y_low = INFINITY, y_high = -INFINITY;
    const auto cover = [](double value, double* low, double* high) {
      if (!std::isfinite(value)) return;
      *low = std::min(*low, value);
      *high = std::max(*high, value);
    };
    for (const Series& series : panel.series) {
      const bool across = series.mark == Series::Mark::kInterval;
      for (const double x : series.x) cover(x, &x_low, &x_high);
      for (const double y : series.y) cover(y, &y_low, &y_high);
      for (const double v : series.lo)
        cover(v, across ? &x_low : &y_low, across ? &x_high : &y_high);
      for (const double v : series.hi)
        cover(v, across ? &x_low : &y_low, across ? &x_high : &y_high);
    }
    const bool empty = !std::isfinite(x_low) || (!categories && !std::isfinite(y_low));
    if (!std::isfinite(x_low)) x_low = 0, x_high = 1;
    if (!std::isfinite(y_low)) y_low = 0, y_high = 1;

    const int x_ticks = columns_ >= 3 ? 4 : 6;
    const int y_ticks = columns_ >= 3 ? 4 : 5;
    Axis x_axis, y_axis;
    if (bars) {
      x_axis.low = -0.6;
      x_axis.high = static_cast<double>(panel.categories.size()) - 0.4;
      x_axis.tics = CategoryTics(index) + " rotate by -35 left";
    } else if (figure_.x_log && x_high > 0) {
      double smallest = INFINITY;
      for (const Series& series : panel.series) {
        for (const double x : series.x) {
          if (x > 0) smallest = std::min(smallest, x);
        }
      }
      x_axis = LogAxis(std::isfinite(smallest) ? smallest : x_high / 10, x_high);
    } else {
      const double low = figure_.x_low.value_or(categories ? x_low - 0.05 * (x_high - x_low)
                                                           : std::min(0.0, x_low));
      x_axis = LinearAxis(low, figure_.x_high.value_or(x_high), x_ticks,
                          categories && !figure_.x_low, categories && !figure_.x_high);
    }
    if (categories && !bars) {
      y_axis.low = -0.6;
      y_axis.high = static_cast<double>(panel.categories.size()) - 0.4;
      y_axis.tics = CategoryTics(index);
    } else {
      y_axis =
          LinearAxis(figure_.y_low.value_or(std::min(0.0, y_low)), figure_.y_high.value_or(y_high),
                     y_ticks, !figure_.y_low, !figure_.y_high);
    }
    *out << (figure_.x_log && !bars ? "set logscale x\n" : "unset logscale x\n");
    *out << "set xrange [" << Number(x_axis.low) << ":" << Number(x_axis.high) << "]\nset yrange ["
         << Number(y_axis.low) << ":" << Number(y_axis.high) << "]\nset xtics " << x_axis.tics
         << (bars ? "" : " norotate") << " offset 0,0.3\nset ytics " << y_axis.tics
         << " offset 0.5,0\n";
    if (empty) {
      *out << "set label 1 'no data' at graph 0.5,0.5 center textcolor rgb '#777777'\n";
    } else {
      *out << "unset label 1\n";
    }

    std::vector<std::string> plots;
    for (std::size_t s = 0; s < panel.series.size(); ++s) {
      const Series& series = panel.series[s];
      if (series.x.empty()) continue;
      const std::string name = "$D" + std::to_string(index) + "_" + std::to_string(s);
      *out << name << " << EOD\n";
      for (std::size_t i = 0; i < series.x.size(); ++i) {
        *out << Number(series.x[i]) << " " << (series.y.empty() ? "0" : Number(series.y[i])) << " "
             << (series.lo.empty() ? "0" : Number(series.lo[i])) << " "
             << (series.hi.empty() ? "0" : Number(series.hi[i])) << "\n";
      }
      *out << "EOD\n";
      plots.push_back(name + " " + PlotStyle(series));
    }
    *out << "plot ";
    if (plots.empty()) *out << "NaN with lines";
    for (std::size_t i = 0; i < plots.size(); ++i) *out << (i > 0 ? ", " : "") << plots[i];
    *out << "\n";
  }

  std::string CategoryTics(std::size_t panel) const {
    std::string tics = "(";
    for (std::size_t i = 0; i < categories_[panel].size(); ++i) {
      if (i > 0) tics += ", ";
      tics += Quoted(categories_[panel][i]) + " " + std::to_string(i);
    }
    return tics + ")";
  }

  std::string PlotStyle(const Series& series) const {
    const Style& style = StyleOf(series.style);
    const std::string colour = std::string("rgb '") + style.colour + "'";
    const std::string marker = std::to_string(style.marker);
    const double size = columns_ >= 3 ? 0.45 : 0.6;
    switch (series.mark) {
      case Series::Mark::kBand:
        return "using 1:3:4 with filledcurves fillcolor " + colour;
      case Series::Mark::kPoints:
        return "using 1:2 with points linecolor " + colour + " pointtype " + marker +
               " pointsize " + Number(size * 0.8);
      case Series::Mark::kThin:
        return "using 1:2 with lines linecolor " + colour + " linewidth 0.6";
      case Series::Mark::kInterval:
        return "using 1:2:3:4 with xerrorbars linecolor " + colour + " pointtype " + marker +
               " pointsize 0.7 linewidth 1.4";
      case Series::Mark::kBar:
        return "using 1:(($3+$4)/2):($1-0.35):($1+0.35):3:4 with boxxyerror fillcolor " + colour +
               " fillstyle solid 0.85 noborder";
      case Series::Mark::kLine:
        break;
    }
    const bool few = series.x.size() <= 30;
    return std::string("using 1:2 with ") + (few ? "linespoints" : "lines") + " linecolor " +
           colour + " dashtype " + style.dash + " linewidth 1.6" +
           (few ? " pointtype " + marker + " pointsize " + Number(size) : "");
  }

  // Title, axis names, legend and notes, in an empty plot over the whole page.
  void PlotFrame(const char* note_size, std::ostringstream* out) const {
    *out << "reset\nunset key\nunset border\nunset tics\nunset grid\nunset logscale\n"
            "set lmargin at screen 0\nset rmargin at screen 1\n"
            "set bmargin at screen 0\nset tmargin at screen 1\n"
            "set xrange [0:1]\nset yrange [0:1]\n";
    const auto label = [&](const std::string& text, double x, double y, const std::string& how) {
      *out << "set label " << Quoted(text) << " at screen " << Number(ScreenX(x)) << ","
           << Number(ScreenY(y)) << " " << how << "\n";
    };
    const double grid_middle = kPad + y_label_width_ + columns_ * cell_width_ / 2 + left_ / 2;
    for (std::size_t i = 0; i < titles_.size(); ++i) {
      label(titles_[i], width_ / 2,
            height_ - kPad - kLineHeight / 2 - static_cast<double>(i) * (kLineHeight + 2),
            "center");
    }
    if (!figure_.y_label.empty()) {
      label(figure_.y_label, kPad + kLineHeight / 2, bottom_ + rows_ * cell_height_ / 2,
            "center rotate by 90");
    }
    double y = kPad + kLineHeight / 2;
    for (auto note = notes_.rbegin(); note != notes_.rend(); ++note) {
      label(*note, kPad, y, std::string("left font ',") + note_size + "' textcolor rgb '#444444'");
      y += kLineHeight;
    }
    const double legend_bottom = kPad + static_cast<double>(notes_.size()) * kLineHeight + 4;
    for (std::size_t i = 0; i < figure_.legend.size(); ++i) {
      const LegendEntry& entry = figure_.legend[i];
      const Style& style = StyleOf(entry.style);
      const LegendText& text = legend_[i];
      const double x = kPad + text.x;
      const double line_y =
          legend_bottom + (legend_rows_ - 1 - text.row) * (kLineHeight + 1) + kLineHeight / 2;
      if (entry.band) {
        *out << "set object rectangle from screen " << Number(ScreenX(x)) << ","
             << Number(ScreenY(line_y - 4)) << " to screen " << Number(ScreenX(x + kSample)) << ","
             << Number(ScreenY(line_y + 4)) << " fillcolor rgb '" << style.colour
             << "' fillstyle solid 0.85 noborder\n";
      } else {
        *out << "set arrow from screen " << Number(ScreenX(x)) << "," << Number(ScreenY(line_y))
             << " to screen " << Number(ScreenX(x + kSample)) << "," << Number(ScreenY(line_y))
             << " nohead linecolor rgb '" << style.colour << "' dashtype " << style.dash
             << " linewidth 1.6\n";
        *out << "set label '' at screen " << Number(ScreenX(x + kSample / 2)) << ","
             << Number(ScreenY(line_y)) << " point pointtype " << style.marker
             << " pointsize 0.6 linecolor rgb '" << style.colour << "'\n";
      }
      for (std::size_t k = 0; k < text.lines.size(); ++k) {
        label(text.lines[k], x + kSample + 6, line_y - static_cast<double>(k) * (kLineHeight + 1),
              "left");
      }
    }
    if (!figure_.x_label.empty()) {
      label(figure_.x_label, grid_middle, legend_bottom + legend_height_ + kLineHeight / 2,
            "center");
    }
    *out << "plot NaN with lines\n";
  }

  static constexpr double kSample = 26;

  // Where an entry begins: points from the left, lines from the top.
  struct LegendText {
    double x = 0;
    int row = 0;
    std::vector<std::string> lines;
  };

  const Figure& figure_;
  int columns_ = 1, rows_ = 1;
  double left_ = 0, tics_below_ = 0;
  double panel_width_ = 0, panel_height_ = 0, cell_width_ = 0, cell_height_ = 0;
  double y_label_width_ = 0, width_ = 0, height_ = 0, bottom_ = 0, top_ = 0;
  double legend_height_ = 0;
  int legend_rows_ = 0;
  std::vector<LegendText> legend_;
  std::vector<std::vector<std::vector<std::string>>> categories_;  // by panel: lines of each
  std::vector<std::string> notes_, titles_;
};

std::string Suffix(const std::string& path) {
  const std::string suffix = std::filesystem::path(path).extension().string();
  return suffix.empty() ? "" : suffix.substr(1);
}

std::string ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  return bytes.str();
}

// Runs a program in a folder; what it prints goes to the file `output` there. The
// wait status, or -1 with errno if it cannot be started.
int Run(const char* const* arguments, const std::string& folder, const char* output) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, output, O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  pid_t child = 0;
  const int error = posix_spawnp(&child, arguments[0], &actions, nullptr,
                                 const_cast<char* const*>(arguments), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    errno = error;
    return -1;
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

// The letter of UTF-8 at `*at`, which moves past it; 0 where there is none.
char32_t NextLetter(const std::string& text, std::size_t* at) {
  const auto first = static_cast<unsigned char>(text[(*at)++]);
  if (first < 0x80) return first;
  const int more = first >= 0xf0 && first < 0xf8   ? 3
                   : first >= 0xe0 && first < 0xf0 ? 2
                   : first >= 0xc2 && first < 0xe0 ? 1
                                                   : 0;
  if (more == 0) return 0;
  char32_t letter = first & (0x3f >> more);
  for (int i = 0; i < more; ++i) {
    if (*at >= text.size() || (static_cast<unsigned char>(text[*at]) & 0xc0) != 0x80) return 0;
    letter = letter << 6 | (static_cast<unsigned char>(text[(*at)++]) & 0x3f);
  }
  return letter;
}

// Ranges of letters that some font has. Pango uses fonts of these two formats.
std::vector<std::pair<unsigned long, unsigned long>> LettersOfFonts(const std::string& folder) {
  const char* arguments[] = {"fc-list", "-f", "%{fontformat} %{charset}\n", nullptr};
  std::vector<std::pair<unsigned long, unsigned long>> ranges = {{0, 0x7f}};
  if (Run(arguments, folder, "fonts") != 0) return ranges;
  std::istringstream lines(ReadFile(folder + "/fonts"));
  std::string line, format, range;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    words >> format;
    if (format != "TrueType" && format != "CFF") continue;
    while (words >> range) {
      char* end = nullptr;
      const unsigned long low = std::strtoul(range.c_str(), &end, 16);
      ranges.emplace_back(low, *end == '-' ? std::strtoul(end + 1, nullptr, 16) : low);
    }
  }
  return ranges;
}

// A letter that no font has comes out of gnuplot's cairo terminals as a box larger
// than the picture; the sign for such a letter takes its place.
std::string Drawable(const std::string& script, const std::string& folder) {
  const auto ascii = [](char c) { return static_cast<unsigned char>(c) < 0x80; };
  if (std::all_of(script.begin(), script.end(), ascii)) return script;
  const auto ranges = LettersOfFonts(folder);
  const auto known = [&ranges](char32_t letter) {
    return std::any_of(ranges.begin(), ranges.end(), [letter](const auto& range) {
      return range.first <= letter && letter <= range.second;
    });
  };
  std::string text;
  for (std::size_t at = 0; at < script.size();) {
    const std::size_t begin = at;
    const char32_t letter = NextLetter(script, &at);
    if (letter != 0 && (letter < 0x80 || known(letter))) {
      text.append(script, begin, at - begin);
    } else {
      text += known(0xfffd) ? "\xEF\xBF\xBD" : "?";
    }
  }
  return text;
}

// Runs gnuplot on the script in a folder of its own, so that no name of the
// user's gets into the script, and gives the bytes it made.
std::string RunGnuplot(const std::string& script, bool with_fonts) {
  std::string folder =
      (std::filesystem::temp_directory_path() / "dreamsearch-figure-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) {
    throw Failure(ExitCode::kCannotCreate,
                  folder + ": no temporary folder: " + std::strerror(errno));
  }
  struct Remove {
    std::string folder;
    ~Remove() {
      std::error_code ignored;
      std::filesystem::remove_all(folder, ignored);
    }
  } const remove{folder};
  std::ofstream(folder + "/script") << (with_fonts ? Drawable(script, folder) : script);

  // -d: the user's own settings file would change the picture.
  const char* arguments[] = {"gnuplot", "-d", "script", nullptr};
  const int status = Run(arguments, folder, "messages");
  if (status == -1) {
    throw Failure(ExitCode::kNotFound,
                  std::string("gnuplot, which draws the pictures, cannot be started: ") +
                      std::strerror(errno) + ". Install the package gnuplot-nox.");
  }
  std::string bytes = ReadFile(folder + "/figure");
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || bytes.empty()) {
    throw Failure(ExitCode::kInternal,
                  "gnuplot drew no picture: " + ReadFile(folder + "/messages"));
  }
  return bytes;
}

// gnuplot leaves a group of its own for every change of pen; most are empty, and
// they are half of a large picture. Its <title> would show when hovering.
std::string WithoutEmptyGroups(const std::string& svg) {
  std::string kept;
  std::size_t at = 0;
  while (at < svg.size()) {
    const std::size_t end = std::min(svg.find('\n', at), svg.size() - 1) + 1;
    if (svg.compare(at, 9, "<g fill=\"") == 0 && svg.compare(end, 5, "</g>\n") == 0 &&
        svg[end - 2] == '>') {
      at = end + 5;
      continue;
    }
    if (svg.compare(at, end - at, "<title>Gnuplot</title>\n") != 0) kept.append(svg, at, end - at);
    at = end;
  }
  return kept;
}

std::string Picture(const Figure& figure, const std::string& format) {
  // Whoever shows an SVG picture has fonts of its own.
  const std::string bytes = RunGnuplot(Script(figure).Text(format), format != "svg");
  return format == "svg" ? WithoutEmptyGroups(bytes) : bytes;
}

}  // namespace

bool IsPicturePath(const std::string& path) {
  const std::string suffix = Suffix(path);
  return suffix == "svg" || suffix == "png" || suffix == "pdf";
}

void Draw(const Figure& figure, const std::string& path) {
  if (!IsPicturePath(path)) {
    throw Failure(
        ExitCode::kUsage,
        AbsolutePath(path) + ": expected a picture's suffix, one of .svg, " + ".png, .pdf");
  }
  WriteFile(path, Picture(figure, Suffix(path)));
}

std::string DrawSvg(const Figure& figure) { return Picture(figure, "svg"); }

}  // namespace dreamsearch::results
