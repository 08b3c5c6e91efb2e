// line_over_band.h - a line of statistics, and beneath it their intervals.
#pragma once

#include <optional>

#include "results/figures/figure.h"
#include "results/statistics/statistics.h"

namespace dreamsearch::results {

class LineOverBand {
 public:
  explicit LineOverBand(int style);

  // A point; without an interval the band has a gap there.
  void Add(double x, double y, const std::optional<Interval>& interval);
  // The band below everything that the panel has, the line on top.
  void AddTo(Panel* panel) const;

 private:
  Series line_, band_;
};

}  // namespace dreamsearch::results
