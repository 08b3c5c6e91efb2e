// common_steps.h - the steps at which several runs are averaged.
//
// Runs that have points at the same steps are averaged at these: a mean has the bits of their
// values. Where steps differ, because episodes end early or a published list is uneven, runs are
// averaged on a grid: the whole multiples of a spacing, and the first and last step that all
// of them cover. The spacing is 1, 2 or 5 times a power of ten: the greatest that is not above
// the median distance between neighbouring points. Between two points of a run its value is
// interpolated linearly. It has none before its first and after its last point, nor beside an
// evaluation that was not finite.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "results/analysis/curves.h"

namespace dreamsearch::results {

struct ValueAtStep {
  double x = 0, value = 0;
};

class CommonSteps {
 public:
  // With thinning, a grid has only every so many of the multiples.
  explicit CommonSteps(const std::vector<const RunCurve*>& runs, std::int64_t thinning = 1);

  const std::vector<std::int64_t>& steps() const { return steps_; }  // increasing
  // Between the multiples on the grid; 0: the steps are the runs' own, and nothing is
  // interpolated.
  std::int64_t spacing() const { return spacing_; }
  std::optional<ValueAtStep> ValueOf(const RunCurve& run, std::int64_t env_step) const;

 private:
  std::vector<std::int64_t> steps_;
  std::int64_t spacing_ = 0;
};

// The steps of the runs of these lines.
CommonSteps StepsOf(const std::vector<const Line*>& lines);

// Says in a figure or on a page that lines were interpolated.
extern const char kInterpolatedNote[];

}  // namespace dreamsearch::results
