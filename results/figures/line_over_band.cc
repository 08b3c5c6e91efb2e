#include "results/figures/line_over_band.h"

namespace dreamsearch::results {

LineOverBand::LineOverBand(int style)
    : line_{.mark = Series::Mark::kLine, .style = style},
      band_{.mark = Series::Mark::kBand, .style = style} {}

void LineOverBand::Add(double x, double y, const std::optional<Interval>& interval) {
  line_.x.push_back(x);
  line_.y.push_back(y);
  if (!interval) return;
  band_.x.push_back(x);
  band_.lo.push_back(interval->lo);
  band_.hi.push_back(interval->hi);
}

void LineOverBand::AddTo(Panel* panel) const {
  if (!band_.x.empty()) panel->series.insert(panel->series.begin(), band_);
  panel->series.push_back(line_);
}

}  // namespace dreamsearch::results
