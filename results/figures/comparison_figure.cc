#include "results/figures/comparison_figure.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "results/analysis/curves.h"
#include "results/analysis/run_groups.h"
#include "results/analysis/statistics.h"

namespace dreamsearch::results {
namespace {

std::string IntervalNote(const Comparison& comparison) {
  return "Marker: statistic over " + std::to_string(comparison.tasks.size()) +
         (comparison.tasks.size() == 1 ? " task" : " tasks") +
         "; bar: 95 % interval of the stratified bootstrap.";
}

void AddNotes(const Comparison& comparison, Figure* figure) {
  constexpr std::size_t kShown = 5;
  for (std::size_t i = 0; i < comparison.notes.size() && i < kShown; ++i) {
    figure->notes.push_back(comparison.notes[i]);
  }
  if (comparison.notes.size() > kShown) {
    figure->notes.push_back("and " + std::to_string(comparison.notes.size() - kShown) +
                            " more notes; see `results compare`.");
  }
}

// One marker with its interval, or for fewer runs the marker alone.
Series IntervalAt(const Estimate& estimate, double y, int style) {
  return {.mark = estimate.interval ? Series::Mark::kInterval : Series::Mark::kPoints,
          .style = style,
          .x = {estimate.value},
          .y = {y},
          .lo = {estimate.interval ? estimate.interval->lo : estimate.value},
          .hi = {estimate.interval ? estimate.interval->hi : estimate.value}};
}

}  // namespace

Figure IntervalFigure(const Comparison& comparison) {
  Figure figure;
  figure.x_label = "normalised score";
  const std::size_t count = comparison.contenders.size();
  for (const auto& [name, estimate] : kAggregates) {
    Panel panel = {.title = name};
    for (std::size_t i = count; i-- > 0;) {
      panel.categories.push_back(ShortLabel(comparison.contenders[i].label));
    }
    for (std::size_t i = 0; i < count; ++i) {
      panel.series.push_back(IntervalAt(comparison.contenders[i].aggregates.*estimate,
                                        static_cast<double>(count - 1 - i), static_cast<int>(i)));
    }
    figure.panels.push_back(std::move(panel));
  }
  std::string runs = "Runs a task:";
  for (const Contender& contender : comparison.contenders) {
    runs += " " + contender.label + " " + RunsText(contender) + ";";
  }
  runs.back() = '.';
  figure.notes = {IntervalNote(comparison) + " A small optimality gap is good.", runs};
  AddNotes(comparison, &figure);
  return figure;
}

Figure ProfileFigure(const Comparison& comparison) {
  Figure figure;
  figure.x_label = "normalised score tau";
  figure.y_label = "share of runs with score > tau";
  figure.x_low = figure.y_low = 0;
  figure.x_high = figure.y_high = 1;
  Panel panel = {.title = "performance profiles"};
  for (std::size_t i = comparison.contenders.size(); i-- > 0;) {
    const Contender& contender = comparison.contenders[i];
    Series line = {.mark = Series::Mark::kLine, .style = static_cast<int>(i)};
    Series band = {.mark = Series::Mark::kBand, .style = static_cast<int>(i)};
    for (std::size_t k = 0; k < comparison.taus.size(); ++k) {
      line.x.push_back(comparison.taus[k]);
      line.y.push_back(contender.profile[k].value);
      if (!contender.profile[k].interval) continue;
      band.x.push_back(comparison.taus[k]);
      band.lo.push_back(contender.profile[k].interval->lo);
      band.hi.push_back(contender.profile[k].interval->hi);
    }
    if (!band.x.empty()) panel.series.insert(panel.series.begin(), band);
    panel.series.push_back(line);
    figure.legend.insert(
        figure.legend.begin(),
        {.text = contender.label + " (" + RunsText(contender) + ")", .style = static_cast<int>(i)});
  }
  figure.panels.push_back(std::move(panel));
  figure.notes = {"Over " + std::to_string(comparison.tasks.size()) +
                  (comparison.tasks.size() == 1 ? " task" : " tasks") +
                  "; n runs a task. Band: 95 % interval of the stratified bootstrap."};
  AddNotes(comparison, &figure);
  return figure;
}

Figure ImprovementFigure(const Comparison& comparison) {
  Figure figure;
  figure.x_label = "probability that a run of X scores higher than one of Y";
  figure.x_low = 0;
  figure.x_high = 1;
  Panel panel = {.title = "probability of improvement"};
  std::vector<std::pair<std::string, const Estimate*>> pairs;
  const std::size_t count = comparison.contenders.size();
  // Of the two directions of a pair the one of the planner listed later: the
  // newer idea over the older.
  for (std::size_t x = 1; x < count; ++x) {
    for (std::size_t y = 0; y < x; ++y) {
      pairs.emplace_back(ShortLabel(comparison.contenders[x].label) + " > " +
                             ShortLabel(comparison.contenders[y].label),
                         &comparison.improvement[x][y]);
    }
  }
  for (std::size_t i = pairs.size(); i-- > 0;) {
    panel.series.push_back(
        IntervalAt(*pairs[i].second, static_cast<double>(panel.categories.size()), 0));
    panel.categories.push_back(pairs[i].first);
  }
  // No difference.
  panel.series.push_back({.mark = Series::Mark::kThin,
                          .style = 7,
                          .x = {0.5, 0.5},
                          .y = {-0.6, static_cast<double>(panel.categories.size()) - 0.4}});
  figure.panels.push_back(std::move(panel));
  std::string runs = "Runs a task:";
  for (const Contender& contender : comparison.contenders) {
    runs += " " + contender.label + " " + RunsText(contender) + ";";
  }
  runs.back() = '.';
  figure.notes = {IntervalNote(comparison) + " 0.5: no difference.", runs};
  AddNotes(comparison, &figure);
  return figure;
}

Figure EfficiencyFigure(const std::vector<std::unique_ptr<Database>>& databases,
                        const ComparisonRequest& request) {
  const std::vector<Line> lines =
      ReadLines(databases, {.filter = request.filter, .phase = request.phase});
  const std::vector<RunGroup> groups = GroupRuns(databases, request.filter, request.phase);
  std::set<std::string> tasks;
  for (const Line& line : lines) tasks.insert(line.task);
  Figure figure;
  figure.x_label = "environment steps (before action repeat)";
  figure.y_label = "interquartile mean, normalised";
  Panel panel = {.title = "sample efficiency over " + std::to_string(tasks.size()) +
                          (tasks.size() == 1 ? " task" : " tasks")};
  const std::vector<std::string> labels = OrderedLabels(groups);
  for (std::size_t l = labels.size(); l-- > 0;) {
    std::map<std::int64_t, std::map<std::string, std::vector<double>>> at;
    std::map<std::string, std::size_t> expected;
    std::size_t least = SIZE_MAX, most = 0;
    bool ranged = true;
    for (const Line& line : lines) {
      if (line.label != labels[l]) continue;
      ranged = ranged && line.return_low && line.return_high;
      if (!ranged) break;
      const auto n = static_cast<std::size_t>(line.n());
      expected[line.task] = n;
      least = std::min(least, n);
      most = std::max(most, n);
      for (const LinePoint& point : Points(line)) {
        for (const double value : point.values) {
          at[point.env_step][line.task].push_back((value - *line.return_low) /
                                                  (*line.return_high - *line.return_low));
        }
      }
    }
    if (!ranged || expected.size() != tasks.size() || least == 0) {
      figure.notes.push_back(labels[l] + " is left out: it lacks a task or a range of returns.");
      continue;
    }
    Series line = {.mark = Series::Mark::kLine, .style = static_cast<int>(l)};
    Series band = {.mark = Series::Mark::kBand, .style = static_cast<int>(l)};
    for (const auto& [step, by_task] : at) {
      Scores scores;
      bool whole = by_task.size() == tasks.size();
      for (const auto& [task, runs] : by_task) {
        whole = whole && runs.size() == expected[task];
        scores.push_back(runs);
      }
      if (!whole) continue;
      const Estimate estimate = InterquartileMeanEstimate(
          scores, request.profile_repetitions,
          StreamSeed(request.seed, "efficiency " + labels[l] + std::to_string(step)));
      line.x.push_back(static_cast<double>(step));
      line.y.push_back(estimate.value);
      if (!estimate.interval) continue;
      band.x.push_back(static_cast<double>(step));
      band.lo.push_back(estimate.interval->lo);
      band.hi.push_back(estimate.interval->hi);
    }
    if (!band.x.empty()) panel.series.insert(panel.series.begin(), band);
    panel.series.push_back(line);
    figure.legend.insert(figure.legend.begin(),
                         {.text = labels[l] + " (n = " + std::to_string(least) +
                                  (least == most ? "" : " to " + std::to_string(most)) + ")",
                          .style = static_cast<int>(l)});
  }
  figure.panels.push_back(std::move(panel));
  figure.notes.insert(figure.notes.begin(),
                      "n runs a task. Drawn where every run has a point. Band: 95 % interval of "
                      "the stratified bootstrap; none with fewer than 3 runs on a task.");
  return figure;
}

}  // namespace dreamsearch::results
