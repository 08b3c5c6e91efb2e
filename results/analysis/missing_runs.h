// missing_runs.h - which runs a study lacks.
//
// A study has every seed that occurs in it, for every line (planner, model, configuration,
// action repeat) on every task where that line has a run; and for every planner and model on
// every task of the study. The view v_matrix says the same of one database.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "results/analysis/run_groups.h"

namespace dreamsearch::results {

struct MissingRun {
  std::string study, task, planner, model;
  // Of the line that lacks the seed; empty where planner and model have no run on the task.
  std::string config_sha256;
  std::int64_t action_repeat = 0;
  // SettingLabels, without versions: whichever made a seed, it is there. And the action repeat
  // where a planner's differ.
  std::string settings;
  std::int64_t seed = 0;
};

// What is missing in the databases together. The filter chooses among what is missing: a seed
// is missed although only planners that are not chosen have it.
std::vector<MissingRun> MissingRuns(const std::vector<std::unique_ptr<Database>>& databases,
                                    const RunFilter& filter);

}  // namespace dreamsearch::results
