// line_statistics.h - the finished numbers of learning curves.
//
// Every statistic that a figure, a table or the report's page shows of a line is computed
// here, once; those three draw and print what they are given.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "results/analysis/curves.h"
#include "results/statistics/statistics.h"
#include "results/text/table.h"

namespace dreamsearch::results {

// A point of a line: at one of the common steps of its runs (common_steps.h), over those that
// have a value there.
struct LinePoint {
  double x = 0;  // mean over runs, on the axis the lines were read for
  std::int64_t env_step = 0;
  double mean = 0, interquartile_mean = 0;
  double lo = 0, hi = 0;  // minimum and maximum
  int n = 0;
  std::vector<double> values;  // by run, in the order of Line::runs
};
std::vector<LinePoint> Points(const Line& line);

// What is drawn of a line.
struct LineCurve {
  int n = 0;                      // runs with a point
  bool interpolated = false;      // the steps of its runs differ
  std::vector<LinePoint> points;  // where all n runs have one: a mean over fewer would jump
  // From the last of these points on, the runs that have gone further than others.
  std::vector<RunCurve> tails;
};
LineCurve CurveOf(const Line& line);

// What is drawn round the mean of kIntervalRuns runs or more. Fewer get points instead.
enum class CurveInterval { kMinMax, kT95, kNone };
// nullopt for fewer runs, and for kNone.
std::optional<Interval> IntervalOf(const LinePoint& point, CurveInterval interval);

// The mean over tasks of one label: points over seeds, in normalised scores. The
// interquartile mean is that over all seeds and tasks.
struct TaskMean {
  std::string label;
  bool published = false;
  std::string acting;             // as Line
  std::set<int> counts;           // runs, by task
  std::string left_out;           // why it has no points
  bool interpolated = false;      // as LineCurve
  std::vector<LinePoint> points;  // where every seed has every task
};
// In the order of OrderedLabels.
std::vector<TaskMean> MeansOverTasks(const std::vector<Line>& lines);

std::set<std::string> TasksOf(const std::vector<Line>& lines);
// The labels, each once: the planners in their order, then published lines. A label has
// one style in all figures, its place here.
std::vector<std::string> OrderedLabels(const std::vector<Line>& lines);

// By task: task, line, env_step, x, mean, lo, hi, n; also where only some runs have a
// value: before the last has begun, after the first has ended.
Table CurveTable(const std::vector<Line>& lines);
// Over tasks: line, env_step, x, mean, lo, hi, n, in normalised scores and n seeds.
Table OverTasksTable(const std::vector<Line>& lines);

}  // namespace dreamsearch::results
