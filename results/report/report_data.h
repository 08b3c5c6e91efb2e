// report_data.h - the finished numbers that the report's page draws, as one JSON document.
//
// The page computes nothing: for whatever the reader chooses (planners, statistic, x axis,
// single runs) the series are here. Numbers are those of CurveTable, OverTasksTable and
// TimeTable, bit for bit. A document has
//
//   styles      colour, dash and marker, of which lines and activities name theirs
//   axes        key, name and title of each x axis
//   statistics  key and title of each statistic over seeds
//   lines       label and style; `published` where they are not of our runs
//   seeds       those of our runs, as texts: JavaScript rounds numbers above 2^53
//   x_end       where the axis of environment steps ends because published curves go on, or
//               null
//   charts      one a task, and last, if there is more than one task, that of the mean over
//               tasks: name, y_title and `curves`, each
//     line      its place in `lines`
//     n         seeds
//     interval  whether lo and hi are drawn as a band; of two seeds they are the two
//     env_step, x (by axis), mean, iqm, lo, hi   where every seed has a point
//     runs      of each seed: seed, x (by axis), y
//     tails     the runs that have gone further than others: x (by axis), y
//   time        `planners`, and `activities` with name, style and seconds for 1,000
//               environment steps by planner
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "results/analysis/curves.h"
#include "results/analysis/time_use.h"

namespace dreamsearch::results {

struct AxisLines {
  CurveAxis axis = CurveAxis::kSteps;
  std::string key;   // in the document: "transitions"
  std::string name;  // for the reader: "model transitions"
  std::vector<Line> lines;
};

// The lines of one request, read for each axis; environment steps come first.
nlohmann::ordered_json ReportData(const std::vector<AxisLines>& axes,
                                  const std::vector<TimeUse>& time);

}  // namespace dreamsearch::results
