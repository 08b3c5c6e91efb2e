// figure.h - pictures of results.
//
// A figure is a grid of panels with one legend and notes below them, nothing on
// top of anything else. Lines are told apart by colour, dash and marker, so a
// colour-blind reader or a grey print loses nothing (palette: Okabe and Ito 2008).
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace dreamsearch::results {

enum class Marker {
  kCircle,
  kSquare,
  kTriangle,
  kDiamond,
  kOpenSquare,
  kDownTriangle,
  kOpenCircle,
  kOpenTriangle
};
const char* MarkerName(Marker marker);  // "circle", "open square", ...

// How a series looks; equal in every panel, and on the report's page.
struct Style {
  const char* colour;  // #rrggbb
  const char* dash;    // lengths of stroke and gap in turn, "14,4"; empty: solid
  Marker marker;
};
// 64 styles. From the ninth on colours come again, with other dashes and markers.
Style StyleOf(int style);

struct Series {
  enum class Mark {
    kLine,      // through (x, y), with markers where there are few points
    kBand,      // from lo to hi along x
    kPoints,    // small markers at (x, y)
    kThin,      // a thin line through (x, y)
    kInterval,  // from lo to hi along the x axis at height y, and a marker at x
    kBar,       // a box from lo to hi at place x
  };
  Mark mark = Mark::kLine;
  int style = 0;
  std::vector<double> x, y, lo, hi;
};

struct Panel {
  std::string title;
  std::vector<Series> series;  // drawn in this order
  std::string x_label;         // of this panel alone
  // Names of y = 0, 1, 2, ... (or of x for bars), in place of numbers.
  std::vector<std::string> categories;

  bool HasBars() const;
};

struct LegendEntry {
  std::string text;
  int style = 0;
  bool band = false;  // show a filled box, for bars
};

struct Figure {
  std::string title;
  std::vector<Panel> panels;
  std::vector<LegendEntry> legend;
  std::vector<std::string> notes;
  std::string x_label, y_label;  // of all panels
  bool x_log = false;
  // Fixed ends of the axes; otherwise from the data, with 0 included.
  std::optional<double> x_low, x_high, y_low, y_high;
};

// Draws into a file; its suffix, .svg, .png or .pdf, decides the format. Failure 2
// for another suffix, 66 if gnuplot is not installed, 73, 74 or 77 if the file
// cannot be written.
void Draw(const Figure& figure, const std::string& path);
// True if the suffix is one that Draw knows.
bool IsPicturePath(const std::string& path);

// The bytes of an SVG picture.
std::string DrawSvg(const Figure& figure);

}  // namespace dreamsearch::results
