#include "results/analysis/efficiency.h"

#include <algorithm>
#include <map>

#include "results/analysis/line_statistics.h"

namespace dreamsearch::results {
namespace {

EfficiencyCurve CurveOfLabel(const std::vector<Line>& lines, const std::string& label,
                             std::size_t tasks, const ComparisonRequest& request) {
  EfficiencyCurve curve;
  curve.label = label;
  curve.fewest_runs = SIZE_MAX;
  std::map<std::int64_t, std::map<std::string, std::vector<double>>> at;  // env_step, task
  std::map<std::string, std::size_t> expected;                            // runs of a task
  bool ranged = true;
  for (const Line& line : lines) {
    if (line.label != label) continue;
    ranged = ranged && line.return_low && line.return_high;
    if (!ranged) break;
    const auto n = static_cast<std::size_t>(line.n());
    expected[line.task] = n;
    curve.fewest_runs = std::min(curve.fewest_runs, n);
    curve.most_runs = std::max(curve.most_runs, n);
    for (const LinePoint& point : Points(line)) {
      for (const double value : point.values) {
        at[point.env_step][line.task].push_back((value - *line.return_low) /
                                                (*line.return_high - *line.return_low));
      }
    }
  }
  if (!ranged || expected.size() != tasks || curve.fewest_runs == 0) {
    curve.left_out =
        label + " is left out: it does not have every task, or a task has no range of returns.";
    return curve;
  }
  for (const auto& [env_step, by_task] : at) {
    Scores scores;
    bool whole = by_task.size() == tasks;
    for (const auto& [task, runs] : by_task) {
      whole = whole && runs.size() == expected[task];
      scores.push_back(runs);
    }
    if (!whole) continue;
    curve.points.push_back({env_step, InterquartileMeanEstimate(
                                          scores, request.profile_repetitions,
                                          StreamSeed(request.seed, "efficiency " + label +
                                                                       std::to_string(env_step)))});
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
