#include "results/figures/curve_figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "results/system/error.h"
#include "results/system/text.h"

namespace dreamsearch::results {
namespace {

constexpr std::size_t kGapsShown = 5;
constexpr char kCutNote[] = " Published curves go on beyond the axis.";

// 97.5 % quantile of Student's t with n - 1 degrees of freedom, n from 2.
double StudentT(int n) {
  constexpr std::array kTable = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306,
                                 2.262,  2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
                                 2.110,  2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064,
                                 2.060,  2.056, 2.052, 2.048, 2.045, 2.042};
  return n - 2 < static_cast<int>(kTable.size()) ? kTable[static_cast<std::size_t>(n - 2)] : 1.96;
}

std::string Counted(std::set<int> counts) {
  if (counts.empty()) return "n = 0";
  const std::string low = std::to_string(*counts.begin());
  return "n = " + (counts.size() == 1 ? low : low + " to " + std::to_string(*counts.rbegin()));
}

std::string PhaseName(const Line& line, CurvePhase phase) {
  switch (phase) {
    case CurvePhase::kTraining:
      return "";
    case CurvePhase::kSearchEvaluation:
      return "";
    case CurvePhase::kActorEvaluation:
      return "";
    case CurvePhase::kEvaluation:
      break;
  }
  if (line.published) return "";
  return line.with_search ? " with search" : " actor";
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

std::string XLabel(CurveAxis axis) {
  switch (axis) {
    case CurveAxis::kSteps:
      return "environment steps (before action repeat)";
    case CurveAxis::kSeconds:
      return "seconds of a run, evaluation and recording left out";
    case CurveAxis::kTransitions:
      return "model transitions imagined by planning";
  }
  return "";
}

// Where the x axis ends if published curves go on beyond our runs, as many do for millions of
// steps, and would squeeze them into the margin: a tenth past our longest run, so that points at
// its end are inside, or past the first published point if that comes later.
std::optional<double> OwnEnd(const std::vector<Line>& lines) {
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

// On a logarithmic axis they squeeze nothing, and are drawn whole.
void SetXAxis(const std::vector<Line>& lines, const CurveRequest& request, Figure* figure) {
  figure->x_label = XLabel(request.axis);
  figure->x_log = request.log_x;
  if (!request.log_x) figure->x_high = OwnEnd(lines);
}

// Labels in the order of the planners, each with its style, equal in all panels.
std::map<std::string, int> StylesOf(const std::vector<Line>& lines,
                                    std::vector<std::string>* order) {
  std::vector<const Line*> sorted;
  for (const Line& line : lines) sorted.push_back(&line);
  std::stable_sort(sorted.begin(), sorted.end(), [](const Line* a, const Line* b) {
    if (a->published != b->published) return b->published;
    if (a->planner != b->planner) return PlannerBefore(a->planner, b->planner);
    return a->label < b->label;
  });
  std::map<std::string, int> styles;
  for (const Line* line : sorted) {
    if (styles.emplace(line->label, static_cast<int>(styles.size())).second) {
      order->push_back(line->label);
    }
  }
  return styles;
}

void AddLine(const Line& line, int style, CurveInterval interval, Panel* panel, int* most_shown) {
  const std::vector<LinePoint> points = Points(line);
  const int n = line.n();
  *most_shown = std::max(*most_shown, n);
  Series mean = {.mark = Series::Mark::kLine, .style = style};
  Series band = {.mark = Series::Mark::kBand, .style = style};
  Series dots = {.mark = Series::Mark::kPoints, .style = style};
  for (const LinePoint& point : points) {
    if (point.n < n) continue;
    mean.x.push_back(point.x);
    mean.y.push_back(point.mean);
    if (n >= 3 && interval != CurveInterval::kNone) {
      double lo = point.lo, hi = point.hi;
      if (interval == CurveInterval::kT95) {
        double squares = 0;
        for (const double v : point.values) squares += (v - point.mean) * (v - point.mean);
        const double half = StudentT(n) * std::sqrt(squares / (n - 1) / n);
        lo = point.mean - half;
        hi = point.mean + half;
      }
      band.x.push_back(point.x);
      band.lo.push_back(lo);
      band.hi.push_back(hi);
    }
    if (n == 2) {
      for (const double v : point.values) {
        dots.x.push_back(point.x);
        dots.y.push_back(v);
      }
    }
  }
  if (!band.x.empty()) panel->series.insert(panel->series.begin(), band);
  if (!dots.x.empty()) panel->series.push_back(dots);
  // Where only some of the runs have a point.
  const std::int64_t last_full = [&] {
    std::int64_t last = -1;
    for (const LinePoint& point : points) {
      if (point.n == n) last = point.env_step;
    }
    return last;
  }();
  for (const RunCurve& run : line.runs) {
    Series thin = {.mark = Series::Mark::kThin, .style = style};
    for (std::size_t i = 0; i < run.x.size(); ++i) {
      if (run.env_step[i] < last_full) continue;
      thin.x.push_back(run.x[i]);
      thin.y.push_back(run.value[i]);
    }
    if (thin.x.size() > 1) panel->series.push_back(thin);
  }
  panel->series.push_back(mean);
}

void AddGapNotes(const std::vector<Line>& lines, std::vector<std::string>* notes) {
  const std::vector<std::string> gaps = Gaps(lines);
  for (std::size_t i = 0; i < gaps.size() && i < kGapsShown; ++i) notes->push_back(gaps[i]);
  if (gaps.size() > kGapsShown) {
    notes->push_back("and " + std::to_string(gaps.size() - kGapsShown) +
                     " more runs that are missing or did not finish.");
  }
}

}  // namespace

CurveInterval ParseCurveInterval(const std::string& name) {
  if (name == "minmax") return CurveInterval::kMinMax;
  if (name == "t95") return CurveInterval::kT95;
  if (name == "none") return CurveInterval::kNone;
  throw Failure(ExitCode::kUsage, "no interval '" + name +
                                      "'. Known: minmax (minimum to maximum over seeds), t95 (95 % "
                                      "confidence of the mean, Student's t), none");
}

std::vector<std::string> Gaps(const std::vector<Line>& lines) {
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

Figure CurvesByTask(const std::vector<Line>& lines, const CurveRequest& request,
                    CurveInterval interval) {
  Figure figure;
  SetXAxis(lines, request, &figure);
  figure.y_label = YLabel(request);
  std::vector<std::string> order;
  std::map<std::string, int> styles = StylesOf(lines, &order);

  std::map<std::string, std::set<int>> counts;
  std::map<std::string, std::string> phases;
  std::map<std::string, std::size_t> panels;
  int most_shown = 0;
  bool two = false, uneven = false;
  for (const Line& line : lines) {
    if (panels.emplace(line.task, figure.panels.size()).second) {
      figure.panels.push_back({.title = line.task});
    }
    counts[line.label].insert(line.n());
    phases[line.label] = PhaseName(line, request.phase);
    two = two || line.n() == 2;
    for (const RunCurve& run : line.runs) {
      uneven = uneven || (!run.x.empty() && run.env_steps_done < run.env_steps_target);
    }
  }
  // The paper's planners last, on top.
  for (auto label = order.rbegin(); label != order.rend(); ++label) {
    for (const Line& line : lines) {
      if (line.label != *label) continue;
      AddLine(line, styles[line.label], interval, &figure.panels[panels[line.task]], &most_shown);
    }
  }
  for (const std::string& label : order) {
    figure.legend.push_back({.text = label + phases[label] + " (" + Counted(counts[label]) + ")",
                             .style = styles[label]});
  }

  std::string note = most_shown >= 2 ? "Line: mean over n seeds." : "Line: one seed.";
  if (most_shown >= 3 && interval == CurveInterval::kMinMax) {
    note += " Band: minimum to maximum over seeds.";
  }
  if (most_shown >= 3 && interval == CurveInterval::kT95) {
    note += " Band: 95 % confidence interval of the mean (Student's t).";
  }
  if (two) note += " Small markers: each of two seeds; fewer than 3 give no interval.";
  if (most_shown < 2) note += " Fewer than 3 seeds give no interval.";
  if (figure.x_high) note += kCutNote;
  if (uneven) note += " Thin: seeds that have gone further than others.";
  if (request.phase == CurvePhase::kEvaluation) {
    note += " With search: evaluated with the planner; actor: with the actor's mode action.";
  }
  figure.notes.push_back(note);
  AddGapNotes(lines, &figure.notes);
  return figure;
}

namespace {

// A line of the mean over tasks.
struct MeanLine {
  std::string label, phase;
  int style = 0;
  std::set<int> counts;           // runs, by task
  std::string left_out;           // why it has no points
  std::vector<LinePoint> points;  // over seeds
};

std::set<std::string> TasksOf(const std::vector<Line>& lines) {
  std::set<std::string> tasks;
  for (const Line& line : lines) tasks.insert(line.task);
  return tasks;
}

// In the order of the planners.
std::vector<MeanLine> MeansOverTasks(const std::vector<Line>& lines, CurvePhase phase) {
  std::vector<std::string> order;
  const std::map<std::string, int> styles = StylesOf(lines, &order);
  const std::set<std::string> tasks = TasksOf(lines);
  std::vector<MeanLine> means;
  for (const std::string& label : order) {
    MeanLine& mean = means.emplace_back();
    mean.label = label;
    mean.style = styles.at(label);
    // By env_step: x, and the normalised score of every task and seed.
    struct At {
      double x = 0;
      int points = 0;
      std::map<std::int64_t, std::map<std::string, double>> by_seed;
    };
    std::map<std::int64_t, At> at;
    std::set<std::string> own_tasks;
    std::set<std::int64_t> own_seeds;
    std::string without_range;
    for (const Line& line : lines) {
      if (line.label != label) continue;
      own_tasks.insert(line.task);
      mean.counts.insert(line.n());
      mean.phase = PhaseName(line, phase);
      // Published returns are of the same tasks, in the same range.
      if (!line.published && !(line.return_low && line.return_high)) without_range = line.task;
      const double low = line.return_low.value_or(0), high = line.return_high.value_or(1000);
      for (const RunCurve& run : line.runs) {
        if (!run.x.empty()) own_seeds.insert(run.seed);
        for (std::size_t i = 0; i < run.x.size(); ++i) {
          At& here = at[run.env_step[i]];
          here.x += run.x[i];
          ++here.points;
          here.by_seed[run.seed][line.task] = (run.value[i] - low) / (high - low);
        }
      }
    }
    if (own_tasks != tasks || !without_range.empty()) {
      mean.left_out =
          label + " is left out: " +
          (without_range.empty() ? "it has " + std::to_string(own_tasks.size()) + " of the " +
                                       std::to_string(tasks.size()) + " tasks."
                                 : "task " + without_range + " has no return range.");
      continue;
    }
    for (const auto& [step, here] : at) {
      // Only where every seed has every task: nothing is averaged over fewer.
      LinePoint point;
      for (const auto& [seed, scores] : here.by_seed) {
        if (scores.size() != tasks.size()) continue;
        double sum = 0;
        for (const auto& [task, score] : scores) sum += score;
        point.values.push_back(sum / static_cast<double>(tasks.size()));
        point.mean += point.values.back();
      }
      if (point.values.size() != own_seeds.size()) continue;
      point.env_step = step;
      point.x = here.x / here.points;
      point.n = static_cast<int>(point.values.size());
      point.mean /= point.n;
      point.lo = *std::min_element(point.values.begin(), point.values.end());
      point.hi = *std::max_element(point.values.begin(), point.values.end());
      mean.points.push_back(std::move(point));
    }
  }
  return means;
}

// The seconds of the runs of one label.
struct TimeUse {
  std::string label;
  std::map<std::string, double> seconds;  // by activity, summed over runs
  double env_steps = 0;
  std::int64_t runs = 0;

  double For1000Steps(const std::string& activity) const {
    const auto found = seconds.find(activity);
    return found == seconds.end() ? 0 : 1000 * found->second / env_steps;
  }
};
constexpr std::array kActivities = {"environment", "planning",  "learning",
                                    "evaluation",  "recording", "other"};

// In the order of the planners.
std::vector<TimeUse> TimeUses(const std::vector<std::unique_ptr<Database>>& databases,
                              const RunFilter& filter) {
  const std::vector<RunGroup> groups = GroupRuns(databases, filter, CurvePhase::kEvaluation);
  std::vector<TimeUse> uses;
  for (const std::string& label : OrderedLabels(groups)) {
    TimeUse use;
    use.label = label;
    for (const RunGroup& group : groups) {
      if (group.label != label) continue;
      for (const GroupedRun& item : group.runs) {
        Statement rows = item.database->connection().Prepare(
            "SELECT activity, seconds, env_step FROM time_use WHERE run_id = ?1 AND env_step ="
            " (SELECT max(env_step) FROM time_use WHERE run_id = ?1)");
        rows.Bind(item.run.run_id);
        double env_steps = 0;
        while (rows.Step()) {
          use.seconds[rows.Text(0)] += rows.Real(1);
          env_steps = rows.Real(2);
        }
        use.env_steps += env_steps;
        use.runs += env_steps > 0 ? 1 : 0;
      }
    }
    if (use.env_steps > 0) uses.push_back(std::move(use));
  }
  return uses;
}

}  // namespace

Figure CurvesOverTasks(const std::vector<Line>& lines, const CurveRequest& request) {
  Figure figure;
  SetXAxis(lines, request, &figure);
  figure.y_label = "mean over tasks, " + YLabel(request) + ", normalised";
  const std::size_t tasks = TasksOf(lines).size();
  Panel panel = {.title = "mean over " + std::to_string(tasks) + (tasks == 1 ? " task" : " tasks")};
  const std::vector<MeanLine> means = MeansOverTasks(lines, request.phase);
  // The paper's planners last, on top.
  for (auto line = means.rbegin(); line != means.rend(); ++line) {
    if (!line->left_out.empty()) {
      figure.notes.push_back(line->left_out);
      continue;
    }
    Series mean = {.mark = Series::Mark::kLine, .style = line->style};
    Series band = {.mark = Series::Mark::kBand, .style = line->style};
    for (const LinePoint& point : line->points) {
      mean.x.push_back(point.x);
      mean.y.push_back(point.mean);
      if (point.n < 3) continue;
      band.x.push_back(point.x);
      band.lo.push_back(point.lo);
      band.hi.push_back(point.hi);
    }
    if (!band.x.empty()) panel.series.insert(panel.series.begin(), band);
    panel.series.push_back(mean);
    figure.legend.insert(figure.legend.begin(),
                         {.text = line->label + line->phase + " (" + Counted(line->counts) + ")",
                          .style = line->style});
  }
  figure.panels.push_back(std::move(panel));
  std::string note =
      "Line: mean over seeds of the mean over tasks of (return - low) / (high - low). Band: "
      "minimum to maximum over seeds; fewer than 3 give none.";
  if (figure.x_high) note += kCutNote;
  figure.notes.insert(figure.notes.begin(), note);
  AddGapNotes(lines, &figure.notes);
  return figure;
}

Figure TimeByPlanner(const std::vector<std::unique_ptr<Database>>& databases,
                     const RunFilter& filter) {
  const std::vector<TimeUse> uses = TimeUses(databases, filter);
  Figure figure;
  figure.y_label = "seconds for 1,000 environment steps";
  Panel panel = {.title = "time by planner"};
  std::vector<double> floor(uses.size(), 0);
  for (std::size_t a = 0; a < kActivities.size(); ++a) {
    Series bar = {.mark = Series::Mark::kBar, .style = static_cast<int>(a)};
    double total = 0;
    for (std::size_t u = 0; u < uses.size(); ++u) {
      const double seconds = uses[u].For1000Steps(kActivities[a]);
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

Table OverTasksTable(const std::vector<Line>& lines) {
  Table table = {{"line", "env_step", "x", "mean", "lo", "hi", "n"}, {}};
  for (const MeanLine& line : MeansOverTasks(lines, CurvePhase::kEvaluation)) {
    for (const LinePoint& point : line.points) {
      table.rows.push_back({line.label, point.env_step, point.x, point.mean, point.lo, point.hi,
                            std::int64_t{point.n}});
    }
  }
  return table;
}

Table TimeTable(const std::vector<std::unique_ptr<Database>>& databases, const RunFilter& filter) {
  Table table = {{"line", "runs", "activity", "seconds_for_1000_env_steps"}, {}};
  for (const TimeUse& use : TimeUses(databases, filter)) {
    for (const char* activity : kActivities) {
      if (use.seconds.count(activity) == 0) continue;
      table.rows.push_back(
          {use.label, use.runs, std::string(activity), use.For1000Steps(activity)});
    }
  }
  return table;
}

Table CurveTable(const std::vector<Line>& lines) {
  Table table = {{"task", "line", "env_step", "x", "mean", "lo", "hi", "n"}, {}};
  for (const Line& line : lines) {
    for (const LinePoint& point : Points(line)) {
      table.rows.push_back({line.task, line.label, point.env_step, point.x, point.mean, point.lo,
                            point.hi, std::int64_t{point.n}});
    }
  }
  return table;
}

}  // namespace dreamsearch::results
