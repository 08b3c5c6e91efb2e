#include "results/analysis/line_statistics.h"

#include <algorithm>
#include <map>

#include "results/analysis/common_steps.h"
#include "results/system/error.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

// 95 % confidence of the mean.
Interval StudentInterval(const LinePoint& point) {
  const double half =
      StudentQuantile(0.975, point.n - 1) * SampleOf(point.values).StandardError().value();
  return {point.mean - half, point.mean + half};
}

// At a step: x, and the normalised score of every seed and task.
struct ScoresAtStep {
  double x_sum = 0;
  int points = 0;
  std::map<std::int64_t, std::map<std::string, double>> by_seed;
};

// nullopt unless each of so many seeds has every task: nothing is averaged over fewer.
std::optional<LinePoint> MeanAt(const ScoresAtStep& here, std::size_t tasks, std::size_t seeds) {
  LinePoint point;
  std::vector<double> scores;
  for (const auto& [seed, by_task] : here.by_seed) {
    if (by_task.size() != tasks) continue;
    double sum = 0;
    for (const auto& [task, score] : by_task) {
      sum += score;
      scores.push_back(score);
    }
    point.values.push_back(sum / static_cast<double>(tasks));
    point.mean += point.values.back();
  }
  if (point.values.size() != seeds) return std::nullopt;
  point.x = here.x_sum / here.points;
  point.n = static_cast<int>(point.values.size());
  point.mean /= point.n;
  point.interquartile_mean = InterquartileMean({scores});
  point.lo = *std::min_element(point.values.begin(), point.values.end());
  point.hi = *std::max_element(point.values.begin(), point.values.end());
  return point;
}

// Why lines of one label have no mean over these tasks, where they have none.
std::string WhyNoMean(const std::vector<const Line*>& lines, const std::set<std::string>& tasks) {
  std::set<std::string> own_tasks;
  std::map<std::int64_t, std::size_t> tasks_of_seed;
  for (const Line* line : lines) {
    own_tasks.insert(line->task);
    // Published returns are of the same tasks, in the same range.
    if (!line->published && !(line->return_low && line->return_high)) {
      return "task " + line->task + " has no return range.";
    }
    for (const RunCurve& run : line->runs) {
      if (!run.x.empty()) ++tasks_of_seed[run.seed];
    }
  }
  const auto of_all = [&](std::size_t count) {
    return " has " + std::to_string(count) + " of the " + Counted(tasks.size(), "task") + ".";
  };
  if (own_tasks != tasks) return "it" + of_all(own_tasks.size());
  if (tasks_of_seed.empty()) return "it has no points.";
  for (const auto& [seed, count] : tasks_of_seed) {
    if (count == tasks.size()) continue;
    return (seed < 0 ? "its mean over seeds" : "seed " + std::to_string(seed)) + of_all(count);
  }
  return "";
}

TaskMean MeanOverTasks(const std::vector<Line>& lines, const std::string& label,
                       const std::set<std::string>& tasks) {
  TaskMean mean;
  mean.label = label;
  std::vector<const Line*> own;
  std::set<std::int64_t> seeds;
  for (const Line& line : lines) {
    if (line.label != label) continue;
    own.push_back(&line);
    mean.counts.insert(line.n());
    mean.published = line.published;
    if (mean.acting.empty()) mean.acting = line.acting;
    for (const RunCurve& run : line.runs) {
      if (!run.x.empty()) seeds.insert(run.seed);
    }
  }
  mean.left_out = WhyNoMean(own, tasks);
  const CommonSteps common = StepsOf(own);
  mean.interpolated = common.spacing() > 0;
  for (const std::int64_t step : common.steps()) {
    if (!mean.left_out.empty()) break;
    ScoresAtStep here;
    for (const Line* line : own) {
      const double low = line->return_low.value_or(0), high = line->return_high.value_or(1000);
      for (const RunCurve& run : line->runs) {
        const std::optional<ValueAtStep> at = common.ValueOf(run, step);
        if (!at) continue;
        here.x_sum += at->x;
        ++here.points;
        here.by_seed[run.seed][line->task] = (at->value - low) / (high - low);
      }
    }
    std::optional<LinePoint> point = MeanAt(here, tasks.size(), seeds.size());
    if (!point) continue;
    point->env_step = step;
    mean.points.push_back(std::move(*point));
  }
  if (mean.left_out.empty() && mean.points.empty()) {
    mean.left_out = "there is no step at which every seed has a value on every task.";
  }
  if (!mean.left_out.empty()) mean.left_out = label + " is left out: " + mean.left_out;
  return mean;
}

std::vector<LinePoint> PointsAt(const CommonSteps& common, const Line& line) {
  std::vector<LinePoint> points;
  for (const std::int64_t step : common.steps()) {
    LinePoint point;
    point.env_step = step;
    for (const RunCurve& run : line.runs) {
      const std::optional<ValueAtStep> at = common.ValueOf(run, step);
      if (!at) continue;
      point.lo = point.n == 0 ? at->value : std::min(point.lo, at->value);
      point.hi = point.n == 0 ? at->value : std::max(point.hi, at->value);
      point.x += at->x;
      point.mean += at->value;
      ++point.n;
      point.values.push_back(at->value);
    }
    if (point.n == 0) continue;
    point.x /= point.n;
    point.mean /= point.n;
    point.interquartile_mean = InterquartileMean({point.values});
    points.push_back(std::move(point));
  }
  return points;
}

// What a run has from a step on, the value at that step included.
RunCurve Tail(const CommonSteps& common, const RunCurve& run, std::int64_t from) {
  RunCurve tail = run;
  const auto first =
      std::lower_bound(run.env_step.begin(), run.env_step.end(), from) - run.env_step.begin();
  tail.x.erase(tail.x.begin(), tail.x.begin() + first);
  tail.env_step.erase(tail.env_step.begin(), tail.env_step.begin() + first);
  tail.value.erase(tail.value.begin(), tail.value.begin() + first);
  const std::optional<ValueAtStep> at = common.ValueOf(run, from);
  if (at && !tail.env_step.empty() && tail.env_step.front() != from) {
    tail.x.insert(tail.x.begin(), at->x);
    tail.env_step.insert(tail.env_step.begin(), from);
    tail.value.insert(tail.value.begin(), at->value);
  }
  return tail;
}

}  // namespace

std::vector<LinePoint> Points(const Line& line) { return PointsAt(StepsOf({&line}), line); }

LineCurve CurveOf(const Line& line) {
  const CommonSteps common = StepsOf({&line});
  LineCurve curve;
  curve.n = line.n();
  curve.interpolated = common.spacing() > 0;
  for (LinePoint& point : PointsAt(common, line)) {
    if (point.n == curve.n) curve.points.push_back(std::move(point));
  }
  const std::int64_t last = curve.points.empty() ? -1 : curve.points.back().env_step;
  for (const RunCurve& run : line.runs) {
    RunCurve tail = Tail(common, run, last);
    if (tail.x.size() > 1) curve.tails.push_back(std::move(tail));
  }
  return curve;
}

std::optional<Interval> IntervalOf(const LinePoint& point, CurveInterval interval) {
  if (point.n < kIntervalRuns || interval == CurveInterval::kNone) return std::nullopt;
  if (interval == CurveInterval::kT95) return StudentInterval(point);
  return Interval{point.lo, point.hi};
}

std::set<std::string> TasksOf(const std::vector<Line>& lines) {
  std::set<std::string> tasks;
  for (const Line& line : lines) tasks.insert(line.task);
  return tasks;
}

std::vector<std::string> OrderedLabels(const std::vector<Line>& lines) {
  std::vector<const Line*> sorted;
  for (const Line& line : lines) sorted.push_back(&line);
  std::stable_sort(sorted.begin(), sorted.end(), [](const Line* a, const Line* b) {
    if (a->published != b->published) return b->published;
    if (a->planner_rank != b->planner_rank) return a->planner_rank < b->planner_rank;
    return a->label < b->label;
  });
  std::vector<std::string> labels;
  std::set<std::string> known;
  for (const Line* line : sorted) {
    if (known.insert(line->label).second) labels.push_back(line->label);
  }
  return labels;
}

std::vector<TaskMean> MeansOverTasks(const std::vector<Line>& lines) {
  const std::set<std::string> tasks = TasksOf(lines);
  std::vector<TaskMean> means;
  for (const std::string& label : OrderedLabels(lines)) {
    means.push_back(MeanOverTasks(lines, label, tasks));
  }
  return means;
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

Table OverTasksTable(const std::vector<Line>& lines) {
  Table table = {{"line", "env_step", "x", "mean", "lo", "hi", "n"}, {}};
  for (const TaskMean& mean : MeansOverTasks(lines)) {
    for (const LinePoint& point : mean.points) {
      table.rows.push_back({mean.label, point.env_step, point.x, point.mean, point.lo, point.hi,
                            std::int64_t{point.n}});
    }
  }
  return table;
}

}  // namespace dreamsearch::results
