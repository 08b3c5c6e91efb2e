#include "results/figures/curve_figure.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "results/analysis/common_steps.h"
#include "results/database/schema.h"
#include "results/figures/line_over_band.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

constexpr std::size_t kGapsShown = 5;
constexpr char kCutNote[] = " Published curves go on beyond the axis.";

std::string SeedsText(const std::set<int>& counts) {
  if (counts.empty()) return "n = 0";
  const std::string low = std::to_string(*counts.begin());
  return "n = " + (counts.size() == 1 ? low : low + " to " + std::to_string(*counts.rbegin()));
}

// What the legend says of a line's evaluations, where a request takes either kind.
std::string ActingText(const std::string& acting, CurvePhase phase) {
  return phase == CurvePhase::kEvaluation ? acting : "";
}

std::string YLabel(const CurveRequest& request) {
  std::string label;
  switch (request.phase) {
    case CurvePhase::kEvaluation:
      label = "evaluation return";
      break;
    case CurvePhase::kTraining:
      label = "training return";
      break;
    case CurvePhase::kSearchEvaluation:
      label = "evaluation return with search";
      break;
    case CurvePhase::kActorEvaluation:
      label = "evaluation return of the actor alone";
      break;
  }
  if (request.smooth > 1) {
    label += ", smoothed over " + std::to_string(request.smooth) + " points";
  }
  return label;
}

// On a logarithmic axis they squeeze nothing, and are drawn whole.
void SetXAxis(const std::vector<Line>& lines, const CurveRequest& request, Figure* figure) {
  figure->x_label = XLabel(request.axis);
  figure->x_log = request.log_x;
  if (!request.log_x) figure->x_high = EndOfOwnRuns(lines);
}

// The style of each label: its place in OrderedLabels.
std::map<std::string, int> StylesOf(const std::vector<std::string>& labels) {
  std::map<std::string, int> styles;
  for (const std::string& label : labels) styles.emplace(label, static_cast<int>(styles.size()));
  return styles;
}

// What the notes explain.
struct Shown {
  int most_seeds = 0;  // of a line
  bool two_seeds = false, tails = false, interpolated = false;
};

void AddLine(const Line& line, int style, CurveInterval interval, Panel* panel, Shown* shown) {
  const LineCurve curve = CurveOf(line);
  shown->most_seeds = std::max(shown->most_seeds, curve.n);
  shown->two_seeds = shown->two_seeds || curve.n == 2;
  shown->tails = shown->tails || !curve.tails.empty();
  shown->interpolated = shown->interpolated || curve.interpolated;
  LineOverBand mean(style);
  Series dots = {.mark = Series::Mark::kPoints, .style = style};
  for (const LinePoint& point : curve.points) {
    mean.Add(point.x, point.mean, IntervalOf(point, interval));
    if (curve.n != 2) continue;
    for (const double value : point.values) {
      dots.x.push_back(point.x);
      dots.y.push_back(value);
    }
  }
  if (!dots.x.empty()) panel->series.push_back(dots);
  for (const RunCurve& tail : curve.tails) {
    panel->series.push_back(
        {.mark = Series::Mark::kThin, .style = style, .x = tail.x, .y = tail.value});
  }
  mean.AddTo(panel);
}

void AddGapNotes(const std::vector<Line>& lines, std::vector<std::string>* notes) {
  const std::vector<std::string> gaps = NotesOfRuns(lines);
  for (std::size_t i = 0; i < gaps.size() && i < kGapsShown; ++i) notes->push_back(gaps[i]);
  if (gaps.size() > kGapsShown) {
    notes->push_back("and " + std::to_string(gaps.size() - kGapsShown) +
                     " more notes of runs that are missing, did not finish or were run twice.");
  }
}

}  // namespace

std::string XLabel(CurveAxis axis) {
  switch (axis) {
    case CurveAxis::kSteps:
      return "environment steps (before action repeat)";
    case CurveAxis::kSeconds:
      return "seconds of a run, evaluation and recording left out";
    case CurveAxis::kTransitions:
      return "model transitions imagined by planning";
    case CurveAxis::kCompute:
      return "core-minutes at 60 GFLOP/s, evaluation and recording left out";
  }
  return "";
}

std::optional<double> EndOfOwnRuns(const std::vector<Line>& lines) {
  double own = 0, first_published = INFINITY, last_published = 0;
  for (const Line& line : lines) {
    for (const RunCurve& run : line.runs) {
      for (const double x : run.x) {
        if (!line.published) own = std::max(own, x);
        if (line.published && x > 0) first_published = std::min(first_published, x);
        if (line.published) last_published = std::max(last_published, x);
      }
    }
  }
  if (own == 0 || last_published == 0) return std::nullopt;
  const double end = 1.1 * std::max(own, first_published);
  if (last_published <= end) return std::nullopt;
  return end;
}

Figure CurvesByTask(const std::vector<Line>& lines, const CurveRequest& request,
                    CurveInterval interval) {
  Figure figure;
  SetXAxis(lines, request, &figure);
  figure.y_label = YLabel(request);
  const std::vector<std::string> order = OrderedLabels(lines);
  std::map<std::string, int> styles = StylesOf(order);

  std::map<std::string, std::set<int>> counts;
  std::map<std::string, std::string> phases;
  std::map<std::string, std::size_t> panels;
  Shown shown;
  for (const Line& line : lines) {
    if (panels.emplace(line.task, figure.panels.size()).second) {
      figure.panels.push_back({.title = line.task});
    }
    counts[line.label].insert(line.n());
    phases[line.label] = ActingText(line.acting, request.phase);
  }
  // The first planner last, on top.
  for (auto label = order.rbegin(); label != order.rend(); ++label) {
    for (const Line& line : lines) {
      if (line.label != *label) continue;
      AddLine(line, styles[line.label], interval, &figure.panels[panels[line.task]], &shown);
    }
  }
  for (const std::string& label : order) {
    figure.legend.push_back({.text = label + phases[label] + " (" + SeedsText(counts[label]) + ")",
                             .style = styles[label]});
  }

  std::string note = shown.most_seeds >= 2 ? "Line: mean over n seeds." : "Line: one seed.";
  if (shown.most_seeds >= kIntervalRuns && interval == CurveInterval::kMinMax) {
    note += " Band: minimum to maximum over seeds.";
  }
  if (shown.most_seeds >= kIntervalRuns && interval == CurveInterval::kT95) {
    note += " Band: 95 % confidence interval of the mean (Student's t).";
  }
  if (shown.two_seeds) note += " Small markers: each of two seeds; fewer than 3 give no interval.";
  if (shown.most_seeds < 2) note += " Fewer than 3 seeds give no interval.";
  if (figure.x_high) note += kCutNote;
  if (shown.tails) note += " Thin: seeds that have gone further than others.";
  if (request.phase == CurvePhase::kEvaluation) {
    note += " With search: evaluated with the planner; actor: with the actor's mode action.";
  }
  figure.notes.push_back(note);
  if (shown.interpolated) figure.notes.push_back(kInterpolatedNote);
  AddGapNotes(lines, &figure.notes);
  return figure;
}

Figure CurvesOverTasks(const std::vector<Line>& lines, const CurveRequest& request) {
  Figure figure;
  SetXAxis(lines, request, &figure);
  figure.y_label = "mean over tasks, " + YLabel(request) + ", normalised";
  Panel panel = {.title = "mean over " + Counted(TasksOf(lines).size(), "task")};
  const std::vector<TaskMean> means = MeansOverTasks(lines);
  bool interpolated = false;
  // The first planner last, on top.
  for (std::size_t i = means.size(); i-- > 0;) {
    const TaskMean& mean = means[i];
    if (!mean.left_out.empty()) {
      figure.notes.push_back(mean.left_out);
      continue;
    }
    interpolated = interpolated || mean.interpolated;
    const int style = static_cast<int>(i);
    LineOverBand line(style);
    for (const LinePoint& point : mean.points) {
      line.Add(point.x, point.mean, IntervalOf(point, CurveInterval::kMinMax));
    }
    line.AddTo(&panel);
    figure.legend.insert(figure.legend.begin(),
                         {.text = mean.label + ActingText(mean.acting, request.phase) + " (" +
                                  SeedsText(mean.counts) + ")",
                          .style = style});
  }
  figure.panels.push_back(std::move(panel));
  std::string note =
      "Line: mean over seeds of the mean over tasks of (return - low) / (high - low). Band: "
      "minimum to maximum over seeds; fewer than 3 give none.";
  if (figure.x_high) note += kCutNote;
  figure.notes.insert(figure.notes.begin(), note);
  if (interpolated) figure.notes.push_back(kInterpolatedNote);
  AddGapNotes(lines, &figure.notes);
  return figure;
}

Figure TimeByPlanner(const std::vector<TimeUse>& uses) {
  Figure figure;
  figure.y_label = "seconds for 1,000 environment steps";
  Panel panel = {.title = "time by planner"};
  std::vector<double> floor(uses.size(), 0);
  for (std::size_t a = 0; a < kActivities.size(); ++a) {
    Series bar = {.mark = Series::Mark::kBar, .style = static_cast<int>(a)};
    double total = 0;
    for (std::size_t u = 0; u < uses.size(); ++u) {
      const double seconds = uses[u].SecondsFor1000Steps(kActivities[a]);
      bar.x.push_back(static_cast<double>(u));
      bar.lo.push_back(floor[u]);
      bar.hi.push_back(floor[u] += seconds);
      total += seconds;
    }
    if (total <= 0) continue;
    panel.series.push_back(bar);
    figure.legend.push_back({.text = kActivities[a], .style = static_cast<int>(a), .band = true});
  }
  for (const TimeUse& use : uses) {
    panel.categories.push_back(use.label + " (n = " + std::to_string(use.runs) + ")");
  }
  figure.panels.push_back(std::move(panel));
  figure.notes.push_back(
      "Wall seconds of all runs of a planner over their environment steps; n "
      "runs. Planning includes the posterior update.");
  return figure;
}

}  // namespace dreamsearch::results
