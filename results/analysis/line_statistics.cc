#include "results/analysis/line_statistics.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "results/system/error.h"

namespace dreamsearch::results {
namespace {

// 95 % confidence of the mean.
Interval StudentInterval(const LinePoint& point) {
  double squares = 0;
  for (const double v : point.values) squares += (v - point.mean) * (v - point.mean);
  const double half =
      StudentQuantile(0.975, point.n - 1) * std::sqrt(squares / (point.n - 1) / point.n);
  return {point.mean - half, point.mean + half};
}

// By env_step: x, and the normalised score of every seed and task.
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

TaskMean MeanOverTasks(const std::vector<Line>& lines, const std::string& label,
                       const std::set<std::string>& tasks) {
  TaskMean mean;
  mean.label = label;
  std::map<std::int64_t, ScoresAtStep> at;
  std::set<std::string> own_tasks;
  std::set<std::int64_t> own_seeds;
  std::string without_range;
  for (const Line& line : lines) {
    if (line.label != label) continue;
    own_tasks.insert(line.task);
    mean.counts.insert(line.n());
    mean.published = line.published;
    mean.with_search = line.with_search;
    // Published returns are of the same tasks, in the same range.
    if (!line.published && !(line.return_low && line.return_high)) without_range = line.task;
    const double low = line.return_low.value_or(0), high = line.return_high.value_or(1000);
    for (const RunCurve& run : line.runs) {
      if (!run.x.empty()) own_seeds.insert(run.seed);
      for (std::size_t i = 0; i < run.x.size(); ++i) {
        ScoresAtStep& here = at[run.env_step[i]];
        here.x_sum += run.x[i];
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
    return mean;
  }
  for (const auto& [env_step, here] : at) {
    std::optional<LinePoint> point = MeanAt(here, tasks.size(), own_seeds.size());
    if (!point) continue;
    point->env_step = env_step;
    mean.points.push_back(std::move(*point));
  }
  return mean;
}

}  // namespace

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
  for (auto& [env_step, point] : by_step) {
    point.x /= point.n;
    point.mean /= point.n;
    point.interquartile_mean = InterquartileMean({point.values});
    points.push_back(std::move(point));
  }
  return points;
}

LineCurve CurveOf(const Line& line) {
  LineCurve curve;
  curve.n = line.n();
  for (LinePoint& point : Points(line)) {
    if (point.n == curve.n) curve.points.push_back(std::move(point));
  }
  const std::int64_t last = curve.points.empty() ? -1 : curve.points.back().env_step;
  for (const RunCurve& run : line.runs) {
    RunCurve tail = run;
    const auto first =
        std::lower_bound(run.env_step.begin(), run.env_step.end(), last) - run.env_step.begin();
    tail.x.erase(tail.x.begin(), tail.x.begin() + first);
    tail.env_step.erase(tail.env_step.begin(), tail.env_step.begin() + first);
    tail.value.erase(tail.value.begin(), tail.value.begin() + first);
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
