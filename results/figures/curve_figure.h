// curve_figure.h - learning curves as a picture and as a table.
#pragma once

#include <string>
#include <vector>

#include "results/analysis/curves.h"
#include "results/figures/figure.h"
#include "results/system/table.h"

namespace dreamsearch::results {

// What is drawn round the mean of three or more runs. Fewer get points instead.
enum class CurveInterval { kMinMax, kT95, kNone };
CurveInterval ParseCurveInterval(const std::string& name);  // Error 2 for an unknown name

// A panel a task, a line a planner; the legend says how many seeds. The bold line
// is the mean where every run of the line has a point; where some have stopped
// earlier, the others go on as thin lines of their own. Runs that are missing or
// did not finish are named in the notes.
Figure CurvesByTask(const std::vector<Line>& lines, const CurveRequest& request,
                    CurveInterval interval);

// One panel: the mean over tasks of the normalised score, for the planners that
// have every task, with the minimum and maximum over seeds.
Figure CurvesOverTasks(const std::vector<Line>& lines, const CurveRequest& request);

// One panel: seconds of a run by planner (and what tells its runs apart) and activity,
// stacked.
Figure TimeByPlanner(const std::vector<std::unique_ptr<Database>>& databases,
                     const RunFilter& filter);

// The numbers of the three figures.
// By task: task, line, env_step, x, mean, lo, hi, n; also where only some runs have a
// point.
Table CurveTable(const std::vector<Line>& lines);
// Over tasks: line, env_step, x, mean, lo, hi, n, in normalised scores and n seeds.
Table OverTasksTable(const std::vector<Line>& lines);
// Time: line, runs, activity, seconds for 1,000 environment steps.
Table TimeTable(const std::vector<std::unique_ptr<Database>>& databases, const RunFilter& filter);

// "walker_walk, mcts_pw: seed 2 failed at 12,000 of 60,000 steps" for every run
// that did not finish, and every seed that others of the task have and this line
// lacks.
std::vector<std::string> Gaps(const std::vector<Line>& lines);

}  // namespace dreamsearch::results
