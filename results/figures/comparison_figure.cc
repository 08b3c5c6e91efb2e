#include "results/figures/comparison_figure.h"

#include <string>
#include <utility>
#include <vector>

#include "results/analysis/common_steps.h"
#include "results/analysis/run_groups.h"
#include "results/figures/line_over_band.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

std::string IntervalNote(const Comparison& comparison) {
  return "Marker: statistic over " + Counted(comparison.tasks.size(), "task") +
         "; bar: 95 % interval of the stratified bootstrap.";
}

std::string RunsNote(const Comparison& comparison) {
  std::string note = "Runs a task:";
  for (const Contender& contender : comparison.contenders) {
    note += " " + contender.label + " " + RunsText(contender) + ";";
  }
  note.back() = '.';
  return note;
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
  figure.notes = {IntervalNote(comparison) + " A small optimality gap is good.",
                  RunsNote(comparison)};
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
    LineOverBand line(static_cast<int>(i));
    for (std::size_t k = 0; k < comparison.taus.size(); ++k) {
      line.Add(comparison.taus[k], contender.profile[k].value, contender.profile[k].interval);
    }
    line.AddTo(&panel);
    figure.legend.insert(
        figure.legend.begin(),
        {.text = contender.label + " (" + RunsText(contender) + ")", .style = static_cast<int>(i)});
  }
  figure.panels.push_back(std::move(panel));
  figure.notes = {"Over " + Counted(comparison.tasks.size(), "task") +
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
                         &comparison.contrasts[x][y].improvement);
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
  figure.notes = {IntervalNote(comparison) + " 0.5: no difference.", RunsNote(comparison)};
  AddNotes(comparison, &figure);
  return figure;
}

Figure EfficiencyFigure(const Efficiency& efficiency) {
  Figure figure;
  figure.x_label = "environment steps (before action repeat)";
  figure.y_label = "interquartile mean, normalised";
  Panel panel = {.title = "sample efficiency over " + Counted(efficiency.tasks, "task")};
  bool interpolated = false;
  for (std::size_t i = efficiency.curves.size(); i-- > 0;) {
    const EfficiencyCurve& curve = efficiency.curves[i];
    interpolated = interpolated || curve.interpolated;
    if (!curve.left_out.empty()) {
      figure.notes.push_back(curve.left_out);
      continue;
    }
    LineOverBand line(static_cast<int>(i));
    for (const auto& [env_step, estimate] : curve.points) {
      line.Add(static_cast<double>(env_step), estimate.value, estimate.interval);
    }
    line.AddTo(&panel);
    figure.legend.insert(
        figure.legend.begin(),
        {.text = curve.label + " (" + RunsText(curve.fewest_runs, curve.most_runs) + ")",
         .style = static_cast<int>(i)});
  }
  figure.panels.push_back(std::move(panel));
  figure.notes.insert(figure.notes.begin(),
                      "n runs a task. Drawn where every run has a point. Band: 95 % interval of "
                      "the stratified bootstrap; none with fewer than 3 runs on a task.");
  if (interpolated) figure.notes.push_back(kInterpolatedNote);
  return figure;
}

}  // namespace dreamsearch::results
