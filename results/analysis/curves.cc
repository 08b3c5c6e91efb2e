#include "results/analysis/curves.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "results/database/schema.h"
#include "results/system/error.h"

namespace dreamsearch::results {
namespace {

// From this budget on curves are read from the bins, which answer at once for
// any number of runs; below it there would be too few bins to see a curve.
constexpr std::int64_t kBinnedBudget = 20 * kBinSteps;

// Piecewise linear through (x, y), held at its ends; x increases.
double Interpolate(const std::vector<std::pair<double, double>>& table, double x) {
  if (table.empty()) return std::nan("");
  if (x <= table.front().first) return table.front().second;
  if (x >= table.back().first) return table.back().second;
  const auto above = std::lower_bound(table.begin(), table.end(), std::pair(x, -double{INFINITY}));
  const auto below = above - 1;
  const double share = (x - below->first) / (above->first - below->first);
  return below->second + share * (above->second - below->second);
}

// What a run has spent by an env_step, on the axis asked for.
std::vector<std::pair<double, double>> Spent(Connection& db, std::int64_t run_id, CurveAxis axis) {
  std::vector<std::pair<double, double>> spent = {{0, 0}};
  Statement rows =
      axis == CurveAxis::kSeconds
          // What the agent needed: neither evaluations nor recording.
          ? db.Prepare(
                "SELECT env_step, sum(seconds) FROM time_use WHERE run_id = ?1 AND activity"
                " NOT IN ('evaluation', 'recording') GROUP BY env_step ORDER BY env_step")
          : db.Prepare(
                "SELECT env_step, sum(model_transitions) OVER (ORDER BY episode) FROM"
                " episode WHERE run_id = ?1 AND phase = 0 ORDER BY episode");
  rows.Bind(run_id);
  while (rows.Step()) {
    const double step = rows.Real(0);
    if (step <= spent.back().first) {
      spent.back().second = rows.Real(1);
    } else {
      spent.emplace_back(step, rows.Real(1));
    }
  }
  return spent;
}

void Smooth(std::vector<double>* values, int points) {
  if (points <= 1) return;
  const std::vector<double> raw = *values;
  const auto size = static_cast<std::int64_t>(raw.size());
  for (std::int64_t i = 0; i < size; ++i) {
    // As many on either side, fewer near the ends.
    const std::int64_t reach = std::min({std::int64_t{points / 2}, i, size - 1 - i});
    double sum = 0;
    for (std::int64_t j = i - reach; j <= i + reach; ++j) sum += raw[static_cast<std::size_t>(j)];
    (*values)[static_cast<std::size_t>(i)] = sum / static_cast<double>(2 * reach + 1);
  }
}

bool Wanted(const std::vector<std::string>& methods, const std::string& method,
            const std::string& obs) {
  return std::any_of(methods.begin(), methods.end(), [&](const std::string& wanted) {
    return wanted == "all" || wanted == method || wanted == method + "/" + obs;
  });
}

// Published curves of the tasks that are drawn anyway.
void ReadPublished(Connection& db, const CurveRequest& request, const std::set<std::string>& tasks,
                   std::vector<Line>* lines) {
  Statement rows = db.Prepare(
      "SELECT p.source, p.method, p.obs, p.task, p.env_steps, p.seed, p.episode_return"
      " FROM published p WHERE p.episode_return IS NOT NULL AND (p.seed IS NOT NULL OR NOT EXISTS"
      " (SELECT 1 FROM published q WHERE q.source = p.source AND q.method = p.method AND"
      " q.obs = p.obs AND q.task = p.task AND q.seed IS NOT NULL))"
      " ORDER BY p.source, p.method, p.obs, p.task, p.seed, p.env_steps");
  std::map<std::tuple<std::string, std::string, std::string, std::string>, Line> found;
  std::set<std::pair<std::string, std::string>> sources;
  while (rows.Step()) {
    const std::string source = rows.Text(0), method = rows.Text(1), obs = rows.Text(2),
                      task = rows.Text(3);
    if (!Wanted(request.published, method, obs) || (!tasks.empty() && tasks.count(task) == 0)) {
      continue;
    }
    sources.emplace(method + "/" + obs, source);
    Line& line = found[{source, method, obs, task}];
    line.task = task;
    line.published = true;
    line.label = method + " " + obs + ", published";
    const std::int64_t seed = rows.OptionalInt(5).value_or(-1);
    if (line.runs.empty() || line.runs.back().seed != seed) {
      line.runs.push_back({.seed = seed});
    }
    RunCurve& run = line.runs.back();
    run.env_step.push_back(rows.Int(4));
    run.x.push_back(rows.Real(4));
    run.value.push_back(rows.Real(6));
    run.env_steps_done = run.env_steps_target = rows.Int(4);
  }
  for (auto& [key, line] : found) {
    const auto& [source, method, obs, task] = key;
    const auto same = std::count_if(sources.begin(), sources.end(), [&](const auto& other) {
      return other.first == method + "/" + obs;
    });
    if (same > 1) line.label += " by " + source;
    if (request.axis == CurveAxis::kSteps) lines->push_back(std::move(line));
  }
}

}  // namespace

int Line::n() const {
  return static_cast<int>(
      std::count_if(runs.begin(), runs.end(), [](const RunCurve& run) { return !run.x.empty(); }));
}

std::vector<Line> ReadLines(const std::vector<std::unique_ptr<Database>>& databases,
                            const CurveRequest& request) {
  const std::vector<RunGroup> groups = GroupRuns(databases, request.filter, request.phase);
  std::int64_t budget = 0;
  for (const RunGroup& group : groups) {
    for (const GroupedRun& run : group.runs) budget = std::max(budget, run.run.env_steps_target);
  }
  const bool binned = budget >= kBinnedBudget;

  std::vector<Line> lines;
  std::set<std::string> tasks(request.filter.tasks.begin(), request.filter.tasks.end());
  for (const RunGroup& group : groups) {
    tasks.insert(group.task);
    Line& line = lines.emplace_back();
    line.task = group.task;
    line.label = group.label;
    line.planner = group.planner;
    line.planner_rank = group.planner_rank;
    line.binned = binned;
    line.return_low = group.return_low;
    line.return_high = group.return_high;
    for (const auto& [run, database, phase] : group.runs) {
      Connection& db = database->connection();
      line.with_search = line.with_search || phase == 1;
      RunCurve& curve = line.runs.emplace_back();
      curve.seed = run.seed;
      curve.uuid = run.uuid;
      curve.unfinished = Unfinished(run);
      curve.env_steps_done = run.env_steps_done;
      curve.env_steps_target = run.env_steps_target;
      Statement points =
          binned ? db.Prepare(
                       "SELECT env_step_bin * 10000, sum_return / n FROM curve_bin"
                       " WHERE run_id = ?1 AND phase = ?2 AND n > 0 ORDER BY env_step_bin")
                 : db.Prepare(
                       "SELECT env_step, avg(episode_return) FROM episode WHERE run_id = ?1"
                       " AND phase = ?2 GROUP BY env_step HAVING count(episode_return) > 0"
                       " ORDER BY env_step");
      points.Bind(run.run_id, phase);
      while (points.Step()) {
        curve.env_step.push_back(points.Int(0));
        curve.value.push_back(points.Real(1));
      }
      Smooth(&curve.value, request.smooth);
      if (request.axis == CurveAxis::kSteps) {
        curve.x.assign(curve.env_step.begin(), curve.env_step.end());
      } else {
        const auto spent = Spent(db, run.run_id, request.axis);
        for (const std::int64_t step : curve.env_step) {
          curve.x.push_back(Interpolate(spent, static_cast<double>(step)));
        }
      }
    }
  }
  if (!request.published.empty()) {
    for (const auto& database : databases) {
      ReadPublished(database->connection(), request, tasks, &lines);
    }
    std::stable_sort(lines.begin(), lines.end(),
                     [](const Line& a, const Line& b) { return a.task < b.task; });
  }
  return lines;
}

namespace {

// One point for so many of a run.
RunCurve Thinned(const RunCurve& run, std::size_t group) {
  RunCurve thin = run;
  thin.x.clear();
  thin.env_step.clear();
  thin.value.clear();
  for (std::size_t i = 0; i < run.env_step.size();) {
    const std::size_t count = i == 0 ? 1 : std::min(group, run.env_step.size() - i);
    double sum = 0;
    for (std::size_t k = i; k < i + count; ++k) sum += run.value[k];
    thin.env_step.push_back(run.env_step[i + count - 1]);
    thin.x.push_back(run.x[i + count - 1]);
    thin.value.push_back(sum / static_cast<double>(count));
    i += count;
  }
  return thin;
}

}  // namespace

std::size_t Thin(std::size_t most_points, std::vector<Line>* lines) {
  std::size_t most = 1;
  for (const Line& line : *lines) {
    if (line.published) continue;
    for (const RunCurve& run : line.runs) most = std::max(most, run.env_step.size());
  }
  const std::size_t group = (most + most_points - 1) / most_points;
  if (group <= 1) return 1;
  for (Line& line : *lines) {
    if (line.published) continue;
    for (RunCurve& run : line.runs) run = Thinned(run, group);
  }
  return group;
}

std::vector<std::string> MissingOrUnfinished(const std::vector<Line>& lines) {
  std::map<std::string, std::set<std::int64_t>> seeds;  // of a task
  for (const Line& line : lines) {
    if (line.published) continue;
    for (const RunCurve& run : line.runs) seeds[line.task].insert(run.seed);
  }
  std::vector<std::string> gaps;
  for (const Line& line : lines) {
    if (line.published) continue;
    std::set<std::int64_t> there;
    for (const RunCurve& run : line.runs) {
      there.insert(run.seed);
      if (run.unfinished.empty()) continue;
      gaps.push_back(line.task + ", " + line.label + ": " + run.unfinished + ".");
    }
    for (const std::int64_t seed : seeds[line.task]) {
      if (there.count(seed) > 0) continue;
      gaps.push_back(line.task + ", " + line.label + ": seed " + std::to_string(seed) +
                     " is missing.");
    }
  }
  return gaps;
}

}  // namespace dreamsearch::results
