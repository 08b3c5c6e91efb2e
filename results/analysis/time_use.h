// time_use.h - where the wall time of runs goes.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "results/database/database.h"
#include "results/text/table.h"

namespace dreamsearch::results {

// The seconds of the runs of one label (RunGroup::label), evaluations of trained runs left
// out.
struct TimeUse {
  std::string label;
  std::map<std::string, double> seconds;  // by activity, summed over runs
  double env_steps = 0;
  std::int64_t runs = 0;

  // 0 for an activity that was not recorded.
  double SecondsFor1000Steps(const std::string& activity) const;
};

// Labels with recorded time alone, in the order of the planners.
std::vector<TimeUse> ReadTimeUse(const std::vector<std::unique_ptr<Database>>& databases,
                                 const RunFilter& filter);

// line, runs, activity, seconds_for_1000_env_steps.
Table TimeTable(const std::vector<TimeUse>& uses);

}  // namespace dreamsearch::results
