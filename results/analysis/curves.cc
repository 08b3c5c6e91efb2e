#include "results/analysis/curves.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "results/analysis/common_steps.h"
#include "results/analysis/missing_runs.h"
#include "results/analysis/published.h"
#include "results/database/schema.h"
#include "results/system/error.h"
#include "results/text/names.h"
#include "results/upkeep/same_run.h"

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

// What a run has spent by an env_step, on the axis asked for. Empty: it was not recorded.
std::vector<std::pair<double, double>> Spent(Connection& db, std::int64_t run_id, CurveAxis axis) {
  std::vector<std::pair<double, double>> spent = {{0, 0}};
  // What the agent needed: neither evaluations nor recording.
  const auto time = [&](const std::string& amount) {
    return "SELECT env_step, " + amount +
           " FROM time_use WHERE run_id = ?1 AND activity NOT IN ('evaluation', 'recording')"
           " GROUP BY env_step ORDER BY env_step";
  };
  Statement rows = db.Prepare(axis == CurveAxis::kSeconds   ? time("sum(seconds)")
                              : axis == CurveAxis::kCompute ? time("sum(gflop) / 3600")
                                                            : "SELECT env_step,"
                                                              " sum(model_transitions) OVER"
                                                              " (ORDER BY episode) FROM episode"
                                                              " WHERE run_id = ?1 AND phase = 0"
                                                              " ORDER BY episode");
  rows.Bind(run_id);
  while (rows.Step()) {
    if (rows.IsNull(1)) return {};
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

// "seed 1", or "seeds 1, 2".
std::string SeedsNamed(const std::vector<std::string>& seeds) {
  return (seeds.size() == 1 ? "seed " : "seeds ") + JoinNames(seeds);
}

// Says what is missing at the line that lacks it; where a planner has no run on a task at all, at
// a line of that planner, or at any.
void AddMissing(const std::vector<std::unique_ptr<Database>>& databases, const RunFilter& filter,
                const std::vector<RunGroup>& groups, std::vector<Line>* lines) {
  if (lines->empty()) return;
  std::map<ExperimentKey, std::size_t> own;  // places of lines, by key with seed 0
  std::set<ExperimentKey> in_versions;       // keys with several lines
  std::map<std::tuple<std::string, std::string, std::string>, std::size_t> planners;
  std::set<std::string> studies, models;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    const RunInfo& run = groups[i].runs.front().run;
    ExperimentKey key = KeyOf(run);
    std::get<5>(key) = 0;
    if (!own.emplace(key, i).second) in_versions.insert(key);
    planners.emplace(std::tuple(run.study, run.planner, run.model), i);
    studies.insert(run.study);
    models.insert(run.model);
  }
  std::set<std::string> said;  // of planners without a run on a task
  struct Gap {
    Line* line;
    std::string where;  // task and planner
    std::vector<std::string> seeds;
  };
  std::vector<Gap> gaps;  // in the order of their first seeds
  for (const MissingRun& run : MissingRuns(databases, filter)) {
    if (!run.config_sha256.empty()) {
      const auto found = own.find(
          {run.study, run.task, run.planner, run.model, run.config_sha256, 0, run.action_repeat});
      Line* line = found == own.end() ? &lines->front() : &(*lines)[found->second];
      const bool one = found != own.end() && in_versions.count(found->first) == 0;
      const std::string where =
          run.task + ", " +
          (one ? line->label : run.planner + (run.settings.empty() ? "" : " ") + run.settings);
      auto gap = std::find_if(gaps.begin(), gaps.end(), [&](const Gap& other) {
        return other.line == line && other.where == where;
      });
      if (gap == gaps.end()) gap = gaps.insert(gap, {line, where, {}});
      gap->seeds.push_back(std::to_string(run.seed));
      continue;
    }
    std::string label = run.planner;
    if (models.size() > 1) label += " on " + run.model;
    if (studies.size() > 1) label += " (" + run.study + ")";
    const std::string sentence = run.task + ", " + label + ": every seed is missing.";
    if (!said.insert(sentence).second) continue;
    const auto line = planners.find({run.study, run.planner, run.model});
    (*lines)[line == planners.end() ? 0 : line->second].missing.push_back(sentence);
  }
  for (const Gap& gap : gaps) {
    gap.line->missing.push_back(gap.where + ": " + SeedsNamed(gap.seeds) +
                                (gap.seeds.size() == 1 ? " is missing." : " are missing."));
  }
}

bool Wanted(const std::vector<std::string>& methods, const std::string& method,
            const std::string& obs) {
  return std::any_of(methods.begin(), methods.end(), [&](const std::string& wanted) {
    return wanted == "all" || wanted == method || wanted == method + "/" + obs;
  });
}

// Published curves of the tasks that are drawn anyway. Of two points of one key the lesser
// counts, as if the databases had been merged.
void ReadPublished(const std::vector<std::unique_ptr<Database>>& databases,
                   const CurveRequest& request, const std::set<std::string>& tasks,
                   std::vector<Line>* lines) {
  if (request.axis != CurveAxis::kSteps) return;
  using Curves = std::map<std::int64_t, std::map<std::int64_t, double>>;  // by seed and step
  std::map<std::tuple<std::string, std::string, std::string, std::string>, Curves> found;
  std::set<std::pair<std::string, std::string>> sources;
  for (const auto& database : databases) {
    Statement rows = database->connection().Prepare(
        "SELECT source, method, obs, task, ifnull(seed, -1), env_steps, episode_return"
        " FROM published WHERE episode_return IS NOT NULL");
    while (rows.Step()) {
      const std::string source = rows.Text(0), method = rows.Text(1), obs = rows.Text(2),
                        task = rows.Text(3);
      if (!Wanted(request.published, method, obs) || (!tasks.empty() && tasks.count(task) == 0)) {
        continue;
      }
      sources.emplace(method + "/" + obs, source);
      const double value = rows.Real(6);
      const auto [point, added] =
          found[{source, method, obs, task}][rows.Int(4)].emplace(rows.Int(5), value);
      if (!added) point->second = std::min(point->second, value);
    }
  }
  for (auto& [key, curves] : found) {
    const auto& [source, method, obs, task] = key;
    Line& line = lines->emplace_back();
    line.task = task;
    line.published = true;
    // A mean over seeds is of use only where there are no seeds.
    if (curves.size() > 1) curves.erase(-1);
    line.label = method + (obs == kUnknownObs ? "" : " " + obs) + ", published";
    if (curves.count(-1) > 0) line.label += " mean over seeds";
    const auto same = std::count_if(sources.begin(), sources.end(), [&](const auto& other) {
      return other.first == method + "/" + obs;
    });
    if (same > 1) line.label += " by " + source;
    for (const auto& [seed, points] : curves) {
      RunCurve& run = line.runs.emplace_back();
      run.seed = seed;
      for (const auto& [step, value] : points) {
        if (!std::isfinite(value)) continue;
        run.env_step.push_back(step);
        run.x.push_back(static_cast<double>(step));
        run.value.push_back(value);
      }
      run.evaluated = run.env_step;
      run.env_steps_done = run.env_steps_target = points.rbegin()->first;
    }
  }
}

// As Line::acting.
std::string ActingOf(Connection* db, std::int64_t run_id, int phase) {
  if (phase == 2) return " actor";
  Statement searched = db->Prepare(
      "SELECT 1 FROM episode WHERE run_id = ?1 AND phase = ?2 AND model_transitions > 0 LIMIT 1");
  searched.Bind(run_id, phase);
  return searched.Step() ? " with search" : "";
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
    for (const auto& [run, database, phase, notes] : group.runs) {
      Connection& db = database->connection();
      line.twice.insert(line.twice.end(), notes.begin(), notes.end());
      if (line.acting.empty()) line.acting = ActingOf(&db, run.run_id, phase);
      RunCurve& curve = line.runs.emplace_back();
      curve.seed = run.seed;
      curve.uuid = run.uuid;
      curve.unfinished = Unfinished(run);
      curve.env_steps_done = run.env_steps_done;
      curve.env_steps_target = run.env_steps_target;
      Statement points =
          binned ? db.Prepare(
                       "SELECT env_step_bin * 10000, sum_return / nullif(n, 0) FROM curve_bin"
                       " WHERE run_id = ?1 AND phase = ?2 ORDER BY env_step_bin")
                 : db.Prepare(
                       "SELECT env_step, avg(episode_return) FROM episode WHERE run_id = ?1"
                       " AND phase = ?2 GROUP BY env_step ORDER BY env_step");
      points.Bind(run.run_id, phase);
      while (points.Step()) {
        curve.evaluated.push_back(points.Int(0));
        if (points.IsNull(1) || !std::isfinite(points.Real(1))) {
          curve.nonfinite.push_back(points.Int(0));
          continue;
        }
        curve.env_step.push_back(points.Int(0));
        curve.value.push_back(points.Real(1));
      }
      Smooth(&curve.value, request.smooth);
      if (request.axis == CurveAxis::kSteps) {
        curve.x.assign(curve.env_step.begin(), curve.env_step.end());
      } else {
        const auto spent = Spent(db, run.run_id, request.axis);
        if (spent.empty()) {
          line.missing.push_back(line.task + ", " + line.label + ": seed " +
                                 std::to_string(run.seed) +
                                 " is left out: its processor time was not recorded.");
          curve.env_step.clear();
          curve.value.clear();
        }
        for (const std::int64_t step : curve.env_step) {
          curve.x.push_back(Interpolate(spent, static_cast<double>(step)));
        }
      }
    }
  }
  AddMissing(databases, request.filter, groups, &lines);
  if (!request.published.empty()) {
    ReadPublished(databases, request, tasks, &lines);
    std::stable_sort(lines.begin(), lines.end(),
                     [](const Line& a, const Line& b) { return a.task < b.task; });
  }
  return lines;
}

namespace {

// One point for so many of a run; none where one of them has no finite return.
RunCurve Thinned(const RunCurve& run, std::size_t group) {
  RunCurve thin = run;
  thin.x.clear();
  thin.env_step.clear();
  thin.value.clear();
  thin.nonfinite.clear();
  std::size_t point = 0;  // of run
  for (std::size_t i = 0; i < run.evaluated.size();) {
    const std::size_t count = i == 0 ? 1 : std::min(group, run.evaluated.size() - i);
    const std::int64_t last = run.evaluated[i + count - 1];
    i += count;
    double sum = 0;
    std::size_t finite = 0;
    for (; point < run.env_step.size() && run.env_step[point] <= last; ++point, ++finite) {
      sum += run.value[point];
    }
    if (finite < count) {
      thin.nonfinite.push_back(last);
      continue;
    }
    thin.env_step.push_back(last);
    thin.x.push_back(run.x[point - 1]);
    thin.value.push_back(sum / static_cast<double>(count));
  }
  return thin;
}

}  // namespace

std::size_t Thin(std::size_t most_points, std::vector<Line>* lines) {
  std::size_t most = 1;
  for (const Line& line : *lines) {
    if (line.published) continue;
    for (const RunCurve& run : line.runs) most = std::max(most, run.evaluated.size());
  }
  const std::size_t group = (most + most_points - 1) / most_points;
  if (group <= 1) return 1;
  for (Line& line : *lines) {
    if (line.published) continue;
    line.thinning = static_cast<std::int64_t>(group);
    if (StepsOf({&line}).spacing() > 0) continue;
    for (RunCurve& run : line.runs) run = Thinned(run, group);
  }
  return group;
}

std::vector<std::string> MissingOrUnfinished(const std::vector<Line>& lines) {
  std::vector<std::string> gaps;
  for (const Line& line : lines) {
    std::vector<std::pair<std::string, std::vector<std::string>>> seeds;  // by how far they got
    for (const RunCurve& run : line.runs) {
      if (run.unfinished.empty()) continue;
      auto alike = std::find_if(seeds.begin(), seeds.end(),
                                [&](const auto& other) { return other.first == run.unfinished; });
      if (alike == seeds.end()) alike = seeds.insert(alike, {run.unfinished, {}});
      alike->second.push_back(std::to_string(run.seed));
    }
    for (const auto& [unfinished, alike] : seeds) {
      gaps.push_back(line.task + ", " + line.label + ": " + SeedsNamed(alike) + " " + unfinished +
                     ".");
    }
    gaps.insert(gaps.end(), line.missing.begin(), line.missing.end());
  }
  return gaps;
}

std::vector<std::string> NotesOfRuns(const std::vector<Line>& lines) {
  std::vector<std::string> notes;
  for (const Line& line : lines) notes.insert(notes.end(), line.twice.begin(), line.twice.end());
  for (std::string& gap : MissingOrUnfinished(lines)) notes.push_back(std::move(gap));
  return notes;
}

}  // namespace dreamsearch::results
