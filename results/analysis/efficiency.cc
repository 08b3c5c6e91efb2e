#include "results/analysis/efficiency.h"

#include <algorithm>

#include "results/analysis/common_steps.h"
#include "results/analysis/line_statistics.h"

namespace dreamsearch::results {
namespace {

EfficiencyCurve CurveOfLabel(const std::vector<Line>& lines, const std::string& label,
                             std::size_t tasks, const ComparisonRequest& request) {
  EfficiencyCurve curve;
  curve.label = label;
  curve.fewest_runs = SIZE_MAX;
  std::vector<const Line*> own;
  bool ranged = true;
  for (const Line& line : lines) {
    if (line.label != label) continue;
    own.push_back(&line);
    ranged = ranged && line.return_low && line.return_high;
    const auto n = static_cast<std::size_t>(line.n());
    curve.fewest_runs = std::min(curve.fewest_runs, n);
    curve.most_runs = std::max(curve.most_runs, n);
  }
  if (!ranged || own.size() != tasks || curve.fewest_runs == 0) {
    curve.left_out =
        label + " is left out: it does not have every task, or a task has no range of returns.";
    return curve;
  }
  const CommonSteps common = StepsOf(own);
  curve.interpolated = common.spacing() > 0;
  for (const std::int64_t env_step : common.steps()) {
    Scores scores;
    bool whole = true;
    for (const Line* line : own) {
      auto& runs = scores.emplace_back();
      for (const RunCurve& run : line->runs) {
        const std::optional<ValueAtStep> at = common.ValueOf(run, env_step);
        if (!at) continue;
        runs.push_back((at->value - *line->return_low) / (*line->return_high - *line->return_low));
      }
      whole = whole && runs.size() == static_cast<std::size_t>(line->n());
    }
    if (!whole) continue;
    curve.points.push_back({env_step, InterquartileMeanEstimate(
                                          scores, request.profile_repetitions,
                                          StreamSeed(request.seed, "efficiency " + label +
                                                                       std::to_string(env_step)))});
  }
  if (curve.points.empty()) {
    curve.left_out =
        label + " is left out: there is no step at which every run has a value on every task.";
  }
  return curve;
}

}  // namespace

Efficiency ComputeEfficiency(const std::vector<std::unique_ptr<Database>>& databases,
                             const ComparisonRequest& request) {
  const std::vector<Line> lines =
      ReadLines(databases, {.filter = request.filter, .phase = request.phase});
  Efficiency efficiency;
  efficiency.tasks = TasksOf(lines).size();
  for (const std::string& label : OrderedLabels(lines)) {
    efficiency.curves.push_back(CurveOfLabel(lines, label, efficiency.tasks, request));
  }
  return efficiency;
}

}  // namespace dreamsearch::results
