// same_run.h - which of two records of one experiment stays, where databases are merged or read
// together.
#pragma once

#include <string>
#include <tuple>

#include "results/database/database.h"

namespace dreamsearch::results {

// What makes a run that trains one experiment: two records of equal keys but other UUIDs are
// the same experiment done twice.
using ExperimentKey = std::tuple<std::string, std::string, std::string, std::string, std::string,
                                 std::int64_t, std::int64_t>;
ExperimentKey KeyOf(const RunInfo& run);

// Whether `run` stays rather than `other`, a record of the same run or experiment: finished
// before unfinished, then the one that got further, then the later heartbeat, then the smaller
// UUID. The order of asking makes no difference.
bool StaysOver(const RunInfo& run, const RunInfo& other);

// "walker_walk, mcts_pw, seed 0 was run twice, as 1b2c and 3d4e; 1b2c stays."
std::string RunTwice(const RunInfo& run, const RunInfo& other);

}  // namespace dreamsearch::results
