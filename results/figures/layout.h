// layout.h - where the parts of a figure are on its page.
//
// Units    points of 1/72 inch, the origin at the lower left.
// Text     a letter is taken to be rather too wide, so that what is laid out fits.
#pragma once

#include <string>
#include <vector>

#include "results/figures/figure.h"

namespace dreamsearch::results {

// The text in lines of at most so many letters, of which all but the first are
// indented. Names break between their parts.
std::vector<std::string> Wrapped(const std::string& text, std::size_t letters,
                                 const std::string& indent = "");

struct Layout {
  explicit Layout(const Figure& figure);

  static constexpr double kPad = 8;  // free at every edge
  static constexpr double kLineHeight = 14;
  static constexpr double kSample = 26;  // width of the legend's samples

  // Where a legend's entry begins: points from the left, lines from the top.
  struct LegendText {
    double x = 0;
    int row = 0;
    std::vector<std::string> lines;
  };

  double width = 0, height = 0;  // of the page
  int columns = 1, rows = 1;     // of the grid of panels
  double panel_width = 0, panel_height = 0;
  double cell_width = 0, cell_height = 0;  // a panel with its title, tick labels and margins
  double left = 0;                         // from a cell's left edge to its panel's
  double ticks_below = 0;                  // from a cell's lower edge to its panel's
  double y_label_width = 0;
  double bottom = 0;  // the lower edge of the grid
  double legend_height = 0;
  int legend_rows = 0;
  std::vector<LegendText> legend;  // by entry
  std::vector<std::string> notes, titles;
  std::vector<std::vector<std::vector<std::string>>> categories;  // by panel: lines of each

  // The lower left corner of a panel.
  double PanelX(std::size_t panel) const;
  double PanelY(std::size_t panel) const;

 private:
  // Room for the names beside or below the axes. Names that do not fit below bars become
  // numbers; returns the notes that explain those.
  std::vector<std::string> PlaceCategories(const Figure& figure);
  void SizePanels(const Figure& figure);
  void PlaceLegend(const Figure& figure);
  double BarLabelHeight(std::size_t panel) const;
  double RightMargin(const Figure& figure) const;
};

}  // namespace dreamsearch::results
