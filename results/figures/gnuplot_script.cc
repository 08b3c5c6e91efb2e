#include "results/figures/gnuplot_script.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "results/figures/axis.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

constexpr double kLineHeight = Layout::kLineHeight;
constexpr double kPad = Layout::kPad;
constexpr double kSample = Layout::kSample;

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

std::string Number(double value) { return std::isfinite(value) ? ExactText(value) : "NaN"; }

int Pixels(double points, double per_inch) {
  return static_cast<int>(std::lround(points / 72 * per_inch));
}

// gnuplot's numbers of these markers.
std::string PointType(const Style& style) {
  switch (style.marker) {
    case Marker::kCircle:
      return "7";
    case Marker::kSquare:
      return "5";
    case Marker::kTriangle:
      return "9";
    case Marker::kDiamond:
      return "13";
    case Marker::kOpenSquare:
      return "4";
    case Marker::kDownTriangle:
      return "11";
    case Marker::kOpenCircle:
      return "6";
    case Marker::kOpenTriangle:
      return "8";
  }
  return "7";
}

std::string DashType(const Style& style) {
  return *style.dash == '\0' ? "1" : "(" + std::string(style.dash) + ")";
}

// The argument of `set xtics`.
std::string Tics(const Axis& axis) {
  std::string tics = "(";
  for (const Tick& tick : axis.ticks) {
    tics += (tics.size() > 1 ? ", " : "") + Quoted(tick.text) + " " + Number(tick.at);
  }
  return tics + ")";
}

std::string Tics(const std::vector<std::vector<std::string>>& categories) {
  std::string tics = "(";
  for (std::size_t i = 0; i < categories.size(); ++i) {
    tics += (i > 0 ? ", " : "") + Quoted(categories[i]) + " " + std::to_string(i);
  }
  return tics + ")";
}

struct Range {
  double low = INFINITY, high = -INFINITY;

  void Cover(const std::vector<double>& values) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  bool empty() const { return !std::isfinite(low); }
};

// Where a panel's marks are.
struct Extent {
  explicit Extent(const Panel& panel) {
    for (const Series& series : panel.series) {
      const bool across = series.mark == Series::Mark::kInterval;
      x.Cover(series.x);
      y.Cover(series.y);
      (across ? x : y).Cover(series.lo);
      (across ? x : y).Cover(series.hi);
      for (const double value : series.x) {
        if (value > 0) smallest_x = std::min(smallest_x, value);
      }
    }
  }
  Range x, y;
  double smallest_x = INFINITY;  // of those above 0
};

// A band up to the end of the axis: gnuplot draws one that goes on beyond it with a wrong edge.
Series CutAt(const Series& band, double end) {
  const auto beyond = std::upper_bound(band.x.begin(), band.x.end(), end);
  if (beyond == band.x.begin() || beyond == band.x.end()) return band;
  const auto count = static_cast<std::size_t>(beyond - band.x.begin());
  Series cut = band;
  const double share = (end - band.x[count - 1]) / (band.x[count] - band.x[count - 1]);
  const auto cut_edge = [&](std::vector<double>* edge) {
    const double at_end = (*edge)[count - 1] + share * ((*edge)[count] - (*edge)[count - 1]);
    edge->resize(count);
    edge->push_back(at_end);
  };
  cut_edge(&cut.x);
  cut_edge(&cut.lo);
  cut_edge(&cut.hi);
  return cut;
}

class Script {
 public:
  Script(const Figure& figure, const Layout& layout, PictureFormat format)
      : figure_(figure), layout_(layout), format_(format) {}

  std::string Text() {
    out_ << "set encoding utf8\n";
    Terminal();
    out_ << "set output 'figure'\n"
            "set multiplot\n"
            "unset key\n"
            "set border 3 linecolor rgb '#444444' linewidth 0.8\n"
            "set tics nomirror out scale 0.5 textcolor rgb '#222222'\n"
            "set grid xtics ytics linetype 1 linecolor rgb '#dddddd' linewidth 0.5\n"
            "set style fill transparent solid 0.2 noborder\n";
    for (std::size_t i = 0; i < figure_.panels.size(); ++i) PlotPanel(i);
    PlotFrame();
    out_ << "unset multiplot\nunset output\n";
    return out_.str();
  }

 private:
  void Terminal() {
    const double width = layout_.width, height = layout_.height;
    switch (format_) {
      case PictureFormat::kSvg:
        // The terminal's units are pixels of 1/96 inch.
        out_ << "set terminal svg size " << Pixels(width, 96) << "," << Pixels(height, 96)
             << " noenhanced font 'DejaVu Sans,12' linewidth 1.2 background '#ffffff'\n";
        return;
      case PictureFormat::kPng:
        // 180 pixels an inch; the terminal takes font sizes for 96.
        out_ << "set terminal pngcairo size " << Pixels(width, 180) << "," << Pixels(height, 180)
             << " noenhanced font 'DejaVu Sans,9' fontscale 1.875 linewidth 2 pointscale 2"
                " background '#ffffff'\n";
        return;
      case PictureFormat::kPdf:
        out_ << "set terminal pdfcairo size " << Number(width / 72) << "in," << Number(height / 72)
             << "in noenhanced font 'DejaVu Sans,9' fontscale 1"
             << " background '#ffffff'\n";
    }
  }

  double ScreenX(double points) const { return points / layout_.width; }
  double ScreenY(double points) const { return points / layout_.height; }
  std::string Screen(double x, double y) const {
    return "screen " + Number(ScreenX(x)) + "," + Number(ScreenY(y));
  }

  void PlotPanel(std::size_t index) {
    const Panel& panel = figure_.panels[index];
    const double x0 = layout_.PanelX(index), y0 = layout_.PanelY(index);
    out_ << "set lmargin at screen " << Number(ScreenX(x0)) << "\nset rmargin at screen "
         << Number(ScreenX(x0 + layout_.panel_width)) << "\nset bmargin at screen "
         << Number(ScreenY(y0)) << "\nset tmargin at screen "
         << Number(ScreenY(y0 + layout_.panel_height)) << "\nset title " << Quoted(panel.title)
         << " offset 0,-0.6\n";
    if (panel.x_label.empty()) {
      out_ << "unset xlabel\n";
    } else {
      out_ << "set xlabel " << Quoted(panel.x_label) << " offset 0,0.6\n";
    }
    SetAxes(index);
    PlotSeries(index);
  }

  void SetAxes(std::size_t index) {
    const Panel& panel = figure_.panels[index];
    const bool bars = panel.HasBars();
    const bool categories = !panel.categories.empty();
    Extent extent(panel);
    const bool empty = extent.x.empty() || (!categories && extent.y.empty());
    if (extent.x.empty()) extent.x = {0, 1};
    if (extent.y.empty()) extent.y = {0, 1};
    const Range& x = extent.x;

    Axis x_axis, y_axis;
    std::string x_tics, y_tics;
    const double category_low = -0.6;
    const double category_high = static_cast<double>(panel.categories.size()) - 0.4;
    if (bars) {
      x_axis.low = category_low;
      x_axis.high = category_high;
      x_tics = Tics(layout_.categories[index]) + " rotate by -35 left";
    } else if (figure_.x_log && x.high > 0) {
      x_axis = LogAxis(std::isfinite(extent.smallest_x) ? extent.smallest_x : x.high / 10, x.high);
      x_tics = Tics(x_axis);
    } else {
      const double low = figure_.x_low.value_or(categories ? x.low - 0.05 * (x.high - x.low)
                                                           : std::min(0.0, x.low));
      x_axis = LinearAxis(low, figure_.x_high.value_or(x.high), layout_.columns >= 3 ? 4 : 6,
                          categories && !figure_.x_low, categories && !figure_.x_high);
      x_tics = Tics(x_axis);
    }
    if (categories && !bars) {
      y_axis.low = category_low;
      y_axis.high = category_high;
      y_tics = Tics(layout_.categories[index]);
    } else {
      y_axis = LinearAxis(figure_.y_low.value_or(std::min(0.0, extent.y.low)),
                          figure_.y_high.value_or(extent.y.high), layout_.columns >= 3 ? 4 : 5,
                          !figure_.y_low, !figure_.y_high);
      y_tics = Tics(y_axis);
    }
    out_ << (figure_.x_log && !bars ? "set logscale x\n" : "unset logscale x\n");
    out_ << "set xrange [" << Number(x_axis.low) << ":" << Number(x_axis.high) << "]\nset yrange ["
         << Number(y_axis.low) << ":" << Number(y_axis.high) << "]\nset xtics " << x_tics
         << (bars ? "" : " norotate") << " offset 0,0.3\nset ytics " << y_tics << " offset 0.5,0\n";
    if (empty) {
      out_ << "set label 1 'no data' at graph 0.5,0.5 center textcolor rgb '#777777'\n";
    } else {
      out_ << "unset label 1\n";
    }
  }

  void PlotSeries(std::size_t index) {
    const Panel& panel = figure_.panels[index];
    std::string plots;
    for (std::size_t s = 0; s < panel.series.size(); ++s) {
      Series series = panel.series[s];
      if (series.x.empty()) continue;
      if (series.mark == Series::Mark::kBand && figure_.x_high) {
        series = CutAt(series, *figure_.x_high);
      }
      const std::string name = "$D" + std::to_string(index) + "_" + std::to_string(s);
      out_ << name << " << EOD\n";
      for (std::size_t i = 0; i < series.x.size(); ++i) {
        out_ << Number(series.x[i]) << " " << (series.y.empty() ? "0" : Number(series.y[i])) << " "
             << (series.lo.empty() ? "0" : Number(series.lo[i])) << " "
             << (series.hi.empty() ? "0" : Number(series.hi[i])) << "\n";
      }
      out_ << "EOD\n";
      plots += (plots.empty() ? "" : ", ") + name + " " + PlotStyle(series);
    }
    out_ << "plot " << (plots.empty() ? "NaN with lines" : plots) << "\n";
  }

  std::string PlotStyle(const Series& series) const {
    const Style style = StyleOf(series.style);
    const std::string colour = std::string("rgb '") + style.colour + "'";
    const std::string marker = PointType(style);
    const double size = layout_.columns >= 3 ? 0.45 : 0.6;
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
           colour + " dashtype " + DashType(style) + " linewidth 1.6" +
           (few ? " pointtype " + marker + " pointsize " + Number(size) : "");
  }

  void Label(const std::string& text, double x, double y, const std::string& how) {
    out_ << "set label " << Quoted(text) << " at " << Screen(x, y) << " " << how << "\n";
  }

  // Title, axis names, legend and notes, in an empty plot over the whole page.
  void PlotFrame() {
    out_ << "reset\nunset key\nunset border\nunset tics\nunset grid\nunset logscale\n"
            "set lmargin at screen 0\nset rmargin at screen 1\n"
            "set bmargin at screen 0\nset tmargin at screen 1\n"
            "set xrange [0:1]\nset yrange [0:1]\n";
    for (std::size_t i = 0; i < layout_.titles.size(); ++i) {
      Label(layout_.titles[i], layout_.width / 2,
            layout_.height - kPad - kLineHeight / 2 - static_cast<double>(i) * (kLineHeight + 2),
            "center");
    }
    if (!figure_.y_label.empty()) {
      Label(figure_.y_label, kPad + kLineHeight / 2,
            layout_.bottom + layout_.rows * layout_.cell_height / 2, "center rotate by 90");
    }
    // Sizes in the SVG terminal's pixels or in points.
    const std::string note_size = format_ == PictureFormat::kSvg ? "10.5" : "8";
    double y = kPad + kLineHeight / 2;
    for (auto note = layout_.notes.rbegin(); note != layout_.notes.rend(); ++note) {
      Label(*note, kPad, y, "left font '," + note_size + "' textcolor rgb '#444444'");
      y += kLineHeight;
    }
    const double legend_bottom = kPad + static_cast<double>(layout_.notes.size()) * kLineHeight + 4;
    for (std::size_t i = 0; i < figure_.legend.size(); ++i) LegendSample(i, legend_bottom);
    if (!figure_.x_label.empty()) {
      const double middle = kPad + layout_.y_label_width +
                            layout_.columns * layout_.cell_width / 2 + layout_.left / 2;
      Label(figure_.x_label, middle, legend_bottom + layout_.legend_height + kLineHeight / 2,
            "center");
    }
    out_ << "plot NaN with lines\n";
  }

  void LegendSample(std::size_t index, double legend_bottom) {
    const LegendEntry& entry = figure_.legend[index];
    const Style style = StyleOf(entry.style);
    const Layout::LegendText& text = layout_.legend[index];
    const double x = kPad + text.x;
    const double y =
        legend_bottom + (layout_.legend_rows - 1 - text.row) * (kLineHeight + 1) + kLineHeight / 2;
    if (entry.band) {
      out_ << "set object rectangle from " << Screen(x, y - 4) << " to "
           << Screen(x + kSample, y + 4) << " fillcolor rgb '" << style.colour
           << "' fillstyle solid 0.85 noborder\n";
    } else {
      out_ << "set arrow from " << Screen(x, y) << " to " << Screen(x + kSample, y)
           << " nohead linecolor rgb '" << style.colour << "' dashtype " << DashType(style)
           << " linewidth 1.6\n";
      out_ << "set label '' at " << Screen(x + kSample / 2, y) << " point pointtype "
           << PointType(style) << " pointsize 0.6 linecolor rgb '" << style.colour << "'\n";
    }
    for (std::size_t k = 0; k < text.lines.size(); ++k) {
      Label(text.lines[k], x + kSample + 6, y - static_cast<double>(k) * (kLineHeight + 1), "left");
    }
  }

  const Figure& figure_;
  const Layout& layout_;
  const PictureFormat format_;
  std::ostringstream out_;
};

}  // namespace

std::string GnuplotScript(const Figure& figure, const Layout& layout, PictureFormat format) {
  return Script(figure, layout, format).Text();
}

}  // namespace dreamsearch::results
