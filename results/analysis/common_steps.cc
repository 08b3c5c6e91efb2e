#include "results/analysis/common_steps.h"

#include <algorithm>
#include <limits>
#include <set>

namespace dreamsearch::results {
namespace {

// Whether each run was evaluated at all of these steps that lie between its own first and last.
bool Agree(const std::vector<const RunCurve*>& runs, const std::set<std::int64_t>& all) {
  return std::all_of(runs.begin(), runs.end(), [&](const RunCurve* run) {
    if (run->evaluated.empty()) return true;
    const auto covered = std::distance(all.lower_bound(run->evaluated.front()),
                                       all.upper_bound(run->evaluated.back()));
    return covered == static_cast<std::ptrdiff_t>(run->evaluated.size());
  });
}

// 1, 2 or 5 times a power of ten; `length` is at least 1.
std::int64_t RoundedDown(std::int64_t length) {
  std::int64_t power = 1;
  while (power <= length / 10) power *= 10;
  for (const std::int64_t factor : {5, 2}) {
    if (factor <= length / power) return factor * power;
  }
  return power;
}

std::int64_t MedianDistance(const std::vector<const RunCurve*>& runs) {
  std::vector<std::int64_t> distances;
  for (const RunCurve* run : runs) {
    for (std::size_t i = 1; i < run->evaluated.size(); ++i) {
      distances.push_back(run->evaluated[i] - run->evaluated[i - 1]);
    }
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace

const char kInterpolatedNote[] =
    "Where the steps of seeds differ, a mean is over values interpolated linearly between a "
    "seed's neighbouring points, never beyond its first or last.";

CommonSteps::CommonSteps(const std::vector<const RunCurve*>& runs, std::int64_t thinning) {
  std::set<std::int64_t> own, evaluated;
  std::int64_t begin = 0, end = std::numeric_limits<std::int64_t>::max();  // what all cover
  for (const RunCurve* run : runs) {
    evaluated.insert(run->evaluated.begin(), run->evaluated.end());
    if (run->env_step.empty()) continue;
    own.insert(run->env_step.begin(), run->env_step.end());
    begin = std::max(begin, run->env_step.front());
    end = std::min(end, run->env_step.back());
  }
  if (own.empty() || Agree(runs, evaluated)) {
    steps_.assign(own.begin(), own.end());
    return;
  }
  const std::int64_t first = *own.begin(), last = *own.rbegin();
  // A few points close together must not fill a long range with a fine grid.
  const std::int64_t fair = (last - first) / static_cast<std::int64_t>(evaluated.size());
  spacing_ = thinning * RoundedDown(std::max({MedianDistance(runs), fair, std::int64_t{1}}));
  std::set<std::int64_t> steps = {first, last};
  if (begin <= end) steps.insert({begin, end});
  for (std::int64_t step = (first / spacing_ + 1) * spacing_; step < last; step += spacing_) {
    steps.insert(step);
  }
  steps_.assign(steps.begin(), steps.end());
}

std::optional<ValueAtStep> CommonSteps::ValueOf(const RunCurve& run, std::int64_t env_step) const {
  const auto above = std::lower_bound(run.env_step.begin(), run.env_step.end(), env_step);
  if (above == run.env_step.end()) return std::nullopt;
  const auto i = static_cast<std::size_t>(above - run.env_step.begin());
  if (*above == env_step) return ValueAtStep{run.x[i], run.value[i]};
  if (spacing_ == 0 || i == 0) return std::nullopt;
  const std::int64_t below = run.env_step[i - 1];
  const auto hole = std::lower_bound(run.nonfinite.begin(), run.nonfinite.end(), below);
  if (hole != run.nonfinite.end() && *hole < *above) return std::nullopt;
  const double share = static_cast<double>(env_step - below) / static_cast<double>(*above - below);
  const auto between = [&](const std::vector<double>& of) {
    return of[i - 1] + (of[i] - of[i - 1]) * share;
  };
  // An axis of steps has the step itself, not what rounding makes of it.
  const bool x_is_step =
      run.x[i - 1] == static_cast<double>(below) && run.x[i] == static_cast<double>(*above);
  return ValueAtStep{x_is_step ? static_cast<double>(env_step) : between(run.x),
                     between(run.value)};
}

CommonSteps StepsOf(const std::vector<const Line*>& lines) {
  std::vector<const RunCurve*> runs;
  std::int64_t thinning = 1;
  for (const Line* line : lines) {
    thinning = std::max(thinning, line->thinning);
    for (const RunCurve& run : line->runs) runs.push_back(&run);
  }
  return CommonSteps(runs, thinning);
}

}  // namespace dreamsearch::results
