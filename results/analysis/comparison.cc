#include "results/analysis/comparison.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "results/analysis/curves.h"
#include "results/system/digest.h"
#include "results/system/error.h"
#include "results/text/json_text.h"
#include "results/text/text.h"

namespace dreamsearch::results {

// A stream of its own for each thing estimated, so that one more planner does not
// change the intervals of the others.
std::uint64_t StreamSeed(std::uint64_t seed, const std::string& name) {
  RollingDigest digest(seed);
  for (const char c : name) digest.AddBits(static_cast<unsigned char>(c));
  return digest.state();
}

std::string RunsText(std::size_t fewest, std::size_t most) {
  return "n = " + std::to_string(fewest) + (fewest == most ? "" : " to " + std::to_string(most));
}

std::string RunsText(const Contender& contender) {
  std::size_t least = SIZE_MAX, most = 0;
  for (const auto& runs : contender.scores) {
    least = std::min(least, runs.size());
    most = std::max(most, runs.size());
  }
  return RunsText(least, most);
}

namespace {

Contrasts ContrastsOf(const Contender& x, const Contender& y, const ComparisonRequest& request) {
  const auto seed = [&](const char* name) {
    return StreamSeed(request.seed, name + (" " + x.label) + " over " + y.label);
  };
  const auto estimate = [&](Contrast contrast, const Scores& of_x, const Scores& of_y,
                            const char* name) {
    return ContrastEstimate(contrast, of_x, of_y, request.profile_repetitions, seed(name));
  };
  Contrasts contrasts;
  contrasts.improvement = Improvement(x.scores, y.scores, request.repetitions, seed("improvement"));
  contrasts.difference = estimate(MeanDifference, x.scores, y.scores, "difference");
  contrasts.spread_difference =
      SpreadDifference(x.scores, y.scores, request.profile_repetitions, seed("spread"));
  if (!x.costs.empty() && !y.costs.empty()) {
    contrasts.cost_ratio = estimate(MeanRatio, x.costs, y.costs, "cost");
  }
  return contrasts;
}

}  // namespace

std::string Contrasts::Verdict() const {
  if (!difference.interval) return "too few runs";
  const auto [lo, hi] = *difference.interval;
  if (-kMatch <= lo && hi <= kMatch) return "they match";
  if (lo > 0) return "X is better";
  if (hi < 0) return "X is worse";
  return "cannot tell";
}

Comparison Compare(const std::vector<std::unique_ptr<Database>>& databases,
                   const ComparisonRequest& request) {
  const std::vector<RunGroup> groups = GroupRuns(databases, request.filter, request.phase);
  if (groups.empty()) throw Failure(ExitCode::kNotFound, NothingToGroup(databases, request.filter));
  Comparison comparison;
  std::map<std::string, std::map<std::string, std::vector<double>>> scores, costs;  // label, task
  std::set<std::string> without_costs;
  std::set<std::string> all_tasks;
  for (const RunGroup& group : groups) {
    all_tasks.insert(group.task);
    if (!(group.return_low && group.return_high)) {
      comparison.notes.push_back(group.task +
                                 " has no range of returns and so no normalised score; " +
                                 group.label + " is left out there.");
      continue;
    }
    for (const auto& [run, database, phase, notes] : group.runs) {
      comparison.notes.insert(comparison.notes.end(), notes.begin(), notes.end());
      const std::int64_t at = request.at > 0 ? request.at : run.env_steps_target;
      Statement score = database->connection().Prepare(
          "SELECT avg(episode_return), count(*), count(episode_return) FROM episode WHERE"
          " run_id = ?1 AND phase = ?2 AND env_step <= ?3 AND 10 * env_step > 9 * ?3");
      score.Bind(run.run_id, phase, at).Step();
      if (score.IsNull(0)) {
        const std::string unfinished = Unfinished(run);
        comparison.notes.push_back(
            group.task + ", " + group.label + ": " + "seed " + std::to_string(run.seed) +
            (unfinished.empty() ? "" : " ") + unfinished +
            "; it has no score, because there is no evaluation in the last tenth before step " +
            GroupDigits(at) + ".");
        continue;
      }
      if (score.Int(2) < score.Int(1)) {
        comparison.notes.push_back(group.task + ", " + group.label + ": the score of seed " +
                                   std::to_string(run.seed) + " is without " +
                                   std::to_string(score.Int(1) - score.Int(2)) + " of its " +
                                   Counted(static_cast<std::uint64_t>(score.Int(1)), "episode") +
                                   ", whose return was not finite.");
      }
      Statement cost = database->connection().Prepare(
          "SELECT sum(gflop) / 3600, count(*) - count(gflop) FROM time_use WHERE run_id = ?1 AND"
          " activity NOT IN ('evaluation', 'recording') AND env_step ="
          " (SELECT max(env_step) FROM time_use WHERE run_id = ?1 AND env_step <= ?2)");
      cost.Bind(run.run_id, at).Step();
      if (cost.IsNull(0) || cost.Int(1) > 0 || !(cost.Real(0) > 0)) {
        without_costs.insert(group.label);
      } else {
        costs[group.label][group.task].push_back(cost.Real(0));
      }
      scores[group.label][group.task].push_back((score.Real(0) - *group.return_low) /
                                                (*group.return_high - *group.return_low));
    }
  }
  // Only tasks that everyone has: nothing is compared on other tasks than others.
  std::vector<std::string> labels = OrderedLabels(groups);
  labels.erase(
      std::remove_if(labels.begin(), labels.end(),
                     [&](const std::string& label) {
                       if (scores.count(label) > 0) return false;
                       comparison.notes.push_back(label + " is left out: it has no score.");
                       return true;
                     }),
      labels.end());
  for (const std::string& task : all_tasks) {
    std::string lacking;
    for (const std::string& label : labels) {
      if (scores[label].count(task) == 0) lacking += (lacking.empty() ? "" : ", ") + label;
    }
    if (lacking.empty() && !labels.empty()) {
      comparison.tasks.push_back(task);
    } else if (!labels.empty()) {
      comparison.notes.push_back(task + " is left out: no score of " + lacking + ".");
    }
  }
  if (comparison.tasks.empty()) {
    std::string why;
    for (const std::string& note : comparison.notes) why += "\n  " + note;
    throw Failure(ExitCode::kNotFound, (databases.empty() ? "" : databases.front()->path()) +
                                           ": no task has a score of every planner." + why);
  }

  for (int i = 0; i <= 100; ++i) comparison.taus.push_back(i / 100.0);
  for (const std::string& label : labels) {
    Contender& contender = comparison.contenders.emplace_back();
    contender.label = label;
    for (const std::string& task : comparison.tasks) {
      contender.scores.push_back(scores[label][task]);
      if (without_costs.count(label) == 0) contender.costs.push_back(costs[label][task]);
    }
    contender.aggregates = Aggregate(contender.scores, request.repetitions,
                                     StreamSeed(request.seed, "aggregates " + label));
    contender.spread = SpreadEstimate(contender.scores, request.profile_repetitions,
                                      StreamSeed(request.seed, "spread " + label));
    contender.profile = Profile(contender.scores, comparison.taus, request.profile_repetitions,
                                StreamSeed(request.seed, "profile " + label));
    const double distinct = DistinctResamples(contender.scores);
    std::string few;
    for (std::size_t t = 0; t < comparison.tasks.size(); ++t) {
      if (contender.scores[t].size() < kIntervalRuns)
        few += (few.empty() ? "" : ", ") + comparison.tasks[t];
    }
    if (!few.empty()) {
      comparison.notes.push_back(label + ": no interval, because it has fewer than 3 runs on " +
                                 few + ".");
    } else if (distinct < 1000) {
      comparison.notes.push_back(label + ": there are only " +
                                 GroupDigits(static_cast<std::int64_t>(distinct)) +
                                 " distinct resamples, so its intervals are coarse; see the single "
                                 "scores.");
    }
  }
  for (const Contender& x : comparison.contenders) {
    std::vector<Contrasts>& row = comparison.contrasts.emplace_back();
    for (const Contender& y : comparison.contenders) {
      row.push_back(&x == &y ? Contrasts{} : ContrastsOf(x, y, request));
    }
  }
  return comparison;
}

namespace {

// The first ten, by seed.
std::string SingleRuns(const std::vector<double>& runs) {
  std::string text;
  for (std::size_t i = 0; i < runs.size() && i < 10; ++i) {
    text += (i > 0 ? " " : "") + FormatNumber("%.3f", runs[i]);
  }
  return text + (runs.size() > 10 ? " ..." : "");
}

}  // namespace

Table ScoreTable(const Comparison& comparison) {
  Table table = {{"task", "planner", "n", "score", "least", "greatest", "single runs"}, {}};
  for (std::size_t t = 0; t < comparison.tasks.size(); ++t) {
    for (const Contender& contender : comparison.contenders) {
      const std::vector<double>& runs = contender.scores[t];
      table.rows.push_back({comparison.tasks[t], contender.label,
                            static_cast<std::int64_t>(runs.size()), MeanScore({runs}),
                            *std::min_element(runs.begin(), runs.end()),
                            *std::max_element(runs.begin(), runs.end()), SingleRuns(runs)});
    }
  }
  return table;
}

namespace {

void AddEstimate(const Estimate& estimate, std::vector<Cell>* row) {
  row->push_back(std::isfinite(estimate.value) ? Cell(estimate.value) : Cell());
  row->push_back(estimate.interval ? Cell(estimate.interval->lo) : Cell());
  row->push_back(estimate.interval ? Cell(estimate.interval->hi) : Cell());
}

}  // namespace

const NamedAggregate kAggregates[4] = {{"mean", &Aggregates::mean},
                                       {"median", &Aggregates::median},
                                       {"interquartile mean", &Aggregates::interquartile_mean},
                                       {"optimality gap", &Aggregates::optimality_gap}};

Table AggregateTable(const Comparison& comparison) {
  Table table = {{"statistic", "planner", "runs a task", "value", "95 % from", "to"}, {}};
  for (const auto& [name, estimate] : kAggregates) {
    for (const Contender& contender : comparison.contenders) {
      auto& row = table.rows.emplace_back();
      row = {std::string(name), contender.label, RunsText(contender).substr(4)};
      AddEstimate(contender.aggregates.*estimate, &row);
    }
  }
  for (const Contender& contender : comparison.contenders) {
    auto& row = table.rows.emplace_back();
    row = {std::string("spread over seeds"), contender.label, RunsText(contender).substr(4)};
    AddEstimate(contender.spread, &row);
  }
  return table;
}

Table ImprovementTable(const Comparison& comparison) {
  Table table = {{"X", "Y", "P(X > Y)", "95 % from", "to"}, {}};
  for (std::size_t x = 0; x < comparison.contenders.size(); ++x) {
    for (std::size_t y = 0; y < comparison.contenders.size(); ++y) {
      if (x == y) continue;
      auto& row = table.rows.emplace_back();
      row = {comparison.contenders[x].label, comparison.contenders[y].label};
      AddEstimate(comparison.contrasts[x][y].improvement, &row);
    }
  }
  return table;
}

Table ContrastTable(const Comparison& comparison) {
  Table table = {{"X", "Y", "X against Y", "value", "95 % from", "to", "so"}, {}};
  for (std::size_t x = 0; x < comparison.contenders.size(); ++x) {
    for (std::size_t y = x + 1; y < comparison.contenders.size(); ++y) {
      const Contrasts& contrasts = comparison.contrasts[x][y];
      const auto add = [&](const char* name, const Estimate& estimate, const std::string& verdict) {
        auto& row = table.rows.emplace_back();
        row = {comparison.contenders[x].label, comparison.contenders[y].label, std::string(name)};
        AddEstimate(estimate, &row);
        row.emplace_back(verdict);
      };
      add("difference of scores", contrasts.difference, contrasts.Verdict());
      add("difference of spreads", contrasts.spread_difference, "");
      if (contrasts.cost_ratio) add("ratio of costs", *contrasts.cost_ratio, "");
    }
  }
  return table;
}

std::string ComparisonJson(const Comparison& comparison, const ComparisonRequest& request) {
  using nlohmann::ordered_json;
  const auto number = [](const Estimate& estimate) {
    ordered_json json = {{"value", nullptr}, {"lo", nullptr}, {"hi", nullptr}};
    if (std::isfinite(estimate.value)) json["value"] = estimate.value;
    if (estimate.interval) {
      json["lo"] = estimate.interval->lo;
      json["hi"] = estimate.interval->hi;
    }
    return json;
  };
  ordered_json json;
  json["at"] = request.at;
  json["bootstrap_seed"] = request.seed;
  json["repetitions"] = request.repetitions;
  json["profile_repetitions"] = request.profile_repetitions;
  json["tasks"] = comparison.tasks;
  json["notes"] = comparison.notes;
  json["taus"] = comparison.taus;
  json["planners"] = ordered_json::array();
  for (const Contender& contender : comparison.contenders) {
    ordered_json item;
    item["planner"] = contender.label;
    for (std::size_t t = 0; t < comparison.tasks.size(); ++t) {
      item["scores"][comparison.tasks[t]] = contender.scores[t];
    }
    for (const auto& [name, estimate] : kAggregates) {
      item[name] = number(contender.aggregates.*estimate);
    }
    item["spread"] = number(contender.spread);
    for (std::size_t t = 0; t < contender.costs.size(); ++t) {
      item["core_minutes"][comparison.tasks[t]] = contender.costs[t];
    }
    item["profile"] = ordered_json::array();
    for (const Estimate& estimate : contender.profile) item["profile"].push_back(number(estimate));
    json["planners"].push_back(std::move(item));
  }
  json["improvement"] = ordered_json::array();
  json["contrasts"] = ordered_json::array();
  for (std::size_t x = 0; x < comparison.contenders.size(); ++x) {
    for (std::size_t y = 0; y < comparison.contenders.size(); ++y) {
      if (x == y) continue;
      const Contrasts& contrasts = comparison.contrasts[x][y];
      ordered_json item = {{"x", comparison.contenders[x].label},
                           {"y", comparison.contenders[y].label}};
      ordered_json contrast = item;
      item.update(number(contrasts.improvement));
      json["improvement"].push_back(std::move(item));
      contrast["difference"] = number(contrasts.difference);
      contrast["spread_difference"] = number(contrasts.spread_difference);
      contrast["cost_ratio"] =
          contrasts.cost_ratio ? number(*contrasts.cost_ratio) : ordered_json();
      contrast["verdict"] = contrasts.Verdict();
      json["contrasts"].push_back(std::move(contrast));
    }
  }
  return JsonTextReplacing(json, 2) + "\n";
}

}  // namespace dreamsearch::results
