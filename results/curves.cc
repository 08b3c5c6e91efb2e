#include "results/curves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "results/schema.h"

namespace dreamsearch::results {
namespace {

// From this budget on curves are read from the bins, which answer at once for
// any number of runs; below it there would be too few bins to see a curve.
constexpr std::int64_t kBinnedBudget = 20 * kBinSteps;

constexpr std::array kPaperOrder = {"dreamer", "rollout", "mcts_pw", "mcts_fixed"};

std::size_t PaperRank(const std::string& planner) {
  return static_cast<std::size_t>(
      std::find(kPaperOrder.begin(), kPaperOrder.end(), planner) - kPaperOrder.begin());
}

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
          ? db.Prepare("SELECT env_step, sum(seconds) FROM time_use WHERE run_id = ?1 AND activity"
                       " NOT IN ('evaluation', 'recording') GROUP BY env_step ORDER BY env_step")
          : db.Prepare("SELECT env_step, sum(model_transitions) OVER (ORDER BY episode) FROM"
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

bool HasEpisodes(Connection& db, std::int64_t run_id, int phase) {
  Statement found =
      db.Prepare("SELECT 1 FROM episode WHERE run_id = ?1 AND phase = ?2 LIMIT 1");
  return found.Bind(run_id, phase).Step();
}

// "k=5" for the settings in which a configuration differs from some other one of
// the same planner and task.
std::map<std::int64_t, std::string> ConfigLabels(const std::map<std::int64_t, std::string>& configs) {
  std::map<std::int64_t, std::string> labels;
  if (configs.size() < 2) return labels;
  std::map<std::string, std::set<std::string>> values;
  std::map<std::int64_t, nlohmann::json> flat;
  for (const auto& [id, json] : configs) {
    const nlohmann::json parsed = nlohmann::json::parse(json, nullptr, false);
    flat[id] = parsed.is_structured() ? parsed.flatten() : nlohmann::json::object();
    for (const auto& [key, value] : flat[id].items()) values[key].insert(value.dump());
  }
  for (const auto& [id, settings] : flat) {
    std::string label;
    for (const auto& [key, seen] : values) {
      const bool everywhere = std::all_of(flat.begin(), flat.end(), [&key = key](const auto& other) {
        return other.second.contains(key);
      });
      if ((seen.size() < 2 && everywhere) || !settings.contains(key)) continue;
      std::string name = key.substr(1);
      std::replace(name.begin(), name.end(), '/', '.');
      label += (label.empty() ? "" : " ") + name + "=" + settings[key].dump();
    }
    labels[id] = label.empty() ? "config " + std::to_string(id) : label;
  }
  return labels;
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
      line.runs.push_back({.seed = seed, .status = RunStatus::kFinished});
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

CurvePhase ParseCurvePhase(const std::string& name) {
  if (name == "evaluation") return CurvePhase::kEvaluation;
  if (name == "training" || name == "0") return CurvePhase::kTraining;
  if (name == "search" || name == "1") return CurvePhase::kSearchEvaluation;
  if (name == "actor" || name == "2") return CurvePhase::kActorEvaluation;
  throw Error(kExitUsage, "no phase '" + name +
                              "'. Known: evaluation (search where there is one, else actor), "
                              "training (0), search (1), actor (2)");
}

CurveAxis ParseCurveAxis(const std::string& name) {
  if (name == "steps") return CurveAxis::kSteps;
  if (name == "seconds") return CurveAxis::kSeconds;
  if (name == "transitions") return CurveAxis::kTransitions;
  throw Error(kExitUsage, "no axis '" + name + "'. Known: steps, seconds, transitions");
}

int Line::n() const {
  return static_cast<int>(
      std::count_if(runs.begin(), runs.end(), [](const RunCurve& run) { return !run.x.empty(); }));
}

bool PlannerBefore(const std::string& a, const std::string& b) {
  return std::pair(PaperRank(a), a) < std::pair(PaperRank(b), b);
}

std::vector<Line> ReadLines(const std::vector<std::unique_ptr<Database>>& databases,
                            const CurveRequest& request) {
  struct Source {
    RunInfo run;
    Database* database;
  };
  std::vector<Source> sources;
  std::set<std::string> uuids;
  std::set<std::string> studies, models;
  std::set<std::int64_t> repeats;
  std::int64_t budget = 0;
  RunFilter filter = request.filter;
  filter.with_evaluations = false;
  for (const auto& database : databases) {
    for (RunInfo& run : database->ListRuns(filter)) {
      if (!uuids.insert(run.uuid).second) continue;
      studies.insert(run.study);
      models.insert(run.model);
      repeats.insert(run.action_repeat);
      budget = std::max(budget, run.env_steps_target);
      sources.push_back({std::move(run), database.get()});
    }
  }

  // Configurations are compared by content, so that databases agree on them.
  std::map<std::pair<std::string, std::string>, std::map<std::string, std::string>> contents;
  std::map<std::string, std::int64_t> config_number;
  for (const Source& source : sources) {
    contents[{source.run.task, source.run.planner}][source.run.config_sha256] =
        source.run.config_json;
    config_number.try_emplace(source.run.config_sha256,
                              static_cast<std::int64_t>(config_number.size()) + 1);
  }
  std::map<std::pair<std::string, std::string>, std::map<std::int64_t, std::string>> config_labels;
  for (const auto& [key, by_sha] : contents) {
    std::map<std::int64_t, std::string> by_number;
    for (const auto& [sha, json] : by_sha) by_number[config_number[sha]] = json;
    config_labels[key] = ConfigLabels(by_number);
  }

  std::map<std::tuple<std::string, std::size_t, std::string, std::string>, Line> lines;
  for (const Source& source : sources) {
    const RunInfo& run = source.run;
    Connection& db = source.database->connection();

    int phase = 0;
    if (request.phase == CurvePhase::kSearchEvaluation) phase = 1;
    if (request.phase == CurvePhase::kActorEvaluation) phase = 2;
    if (request.phase == CurvePhase::kEvaluation) phase = HasEpisodes(db, run.run_id, 1) ? 1 : 2;

    std::string label = run.planner;
    if (models.size() > 1) label += " on " + run.model;
    if (repeats.size() > 1) label += " repeat=" + std::to_string(run.action_repeat);
    const auto& labels = config_labels[{run.task, run.planner}];
    const auto own = labels.find(config_number[run.config_sha256]);
    if (own != labels.end()) label += " " + own->second;
    if (studies.size() > 1) label += " (" + run.study + ")";

    Line& line = lines[{run.task, PaperRank(run.planner), run.planner, label}];
    line.task = run.task;
    line.label = label;
    line.planner = run.planner;
    line.with_search = line.with_search || phase == 1;
    Statement range = db.Prepare("SELECT return_low, return_high FROM task WHERE name = ?1");
    if (range.Bind(run.task).Step()) {
      line.return_low = range.OptionalReal(0);
      line.return_high = range.OptionalReal(1);
    }

    RunCurve curve = {.seed = run.seed,
                      .uuid = run.uuid,
                      .status = run.status,
                      .env_steps_done = run.env_steps_done,
                      .env_steps_target = run.env_steps_target};
    Statement points =
        budget >= kBinnedBudget
            ? db.Prepare("SELECT env_step_bin * 10000, sum_return / n FROM curve_bin"
                         " WHERE run_id = ?1 AND phase = ?2 AND n > 0 ORDER BY env_step_bin")
            : db.Prepare("SELECT env_step, avg(episode_return) FROM episode WHERE run_id = ?1 AND"
                         " phase = ?2 GROUP BY env_step HAVING count(episode_return) > 0"
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
    line.runs.push_back(std::move(curve));
  }

  std::vector<Line> all;
  std::set<std::string> tasks(filter.tasks.begin(), filter.tasks.end());
  for (auto& [key, line] : lines) {
    std::stable_sort(line.runs.begin(), line.runs.end(),
                     [](const RunCurve& a, const RunCurve& b) { return a.seed < b.seed; });
    tasks.insert(line.task);
    all.push_back(std::move(line));
  }
  if (!request.published.empty()) {
    for (const auto& database : databases) {
      ReadPublished(database->connection(), request, tasks, &all);
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const Line& a, const Line& b) { return a.task < b.task; });
  }
  return all;
}

std::vector<LinePoint> Points(const Line& line) {
  std::map<std::int64_t, LinePoint> by_step;
  for (const RunCurve& run : line.runs) {
    for (std::size_t i = 0; i < run.x.size(); ++i) {
      LinePoint& point = by_step[run.env_step[i]];
      point.env_step = run.env_step[i];
      point.lo = point.n == 0 ? run.value[i] : std::min(point.lo, run.value[i]);
      point.hi = point.n == 0 ? run.value[i] : std::max(point.hi, run.value[i]);
      point.x += run.x[i];
      point.mean += run.value[i];
      ++point.n;
      point.values.push_back(run.value[i]);
    }
  }
  std::vector<LinePoint> points;
  for (auto& [step, point] : by_step) {
    point.x /= point.n;
    point.mean /= point.n;
    points.push_back(std::move(point));
  }
  return points;
}

}  // namespace dreamsearch::results
