// curve_figure.h - learning curves and the time of runs as pictures.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "results/analysis/curves.h"
#include "results/analysis/line_statistics.h"
#include "results/analysis/time_use.h"
#include "results/figures/figure.h"

namespace dreamsearch::results {

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
Figure TimeByPlanner(const std::vector<TimeUse>& uses);

// The name of an axis, with its unit.
std::string XLabel(CurveAxis axis);
// Where the x axis ends if published curves go on beyond our runs, as many do for millions of
// steps, and would squeeze them into the margin: a tenth past our longest run, so that points at
// its end are inside, or past the first published point if that comes later.
std::optional<double> EndOfOwnRuns(const std::vector<Line>& lines);

}  // namespace dreamsearch::results
