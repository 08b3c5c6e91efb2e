// merge.h - the runs of several databases in one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "results/database/database.h"

namespace dreamsearch::results {

struct MergeResult {
  std::int64_t added = 0;     // runs that were not there
  std::int64_t replaced = 0;  // runs that were there, less far or losing to this one
  std::int64_t kept = 0;      // runs that were there, as far or further
  std::int64_t rows = 0;      // copied, of all that a run recorded
  std::vector<std::string> notes;
};

struct MergeSettings {
  // False leaves the rows of single decisions, nine tenths of a database, of finished runs out.
  // What is left verifies; only these rows cannot be compared with a repetition of the run.
  bool decisions = true;
};

// Adds the runs of `source` to `target`, each in one transaction, perhaps with others, and
// published curves. Of a run that both have, the one that got further stays: finished before
// unfinished, then by environment steps, then by heartbeat. Two runs of one key
// but different UUIDs are the same experiment done twice: one of them stays, by
// the same order and then the smaller UUID, so the outcome does not depend on the
// order of merging. Of one run twice, as far, that with its decisions stays. A run that goes on
// meanwhile is copied as it is at one moment. Of two published points of one key the lesser stays,
// with all that is said of it. Files stay where they are; their paths become absolute.
//   Failure 65  a task has other values in the two databases.
MergeResult Merge(Database* target, const std::string& source, const MergeSettings& settings = {});
// The same of one that is open.
MergeResult Merge(Database* target, Database* source, const MergeSettings& settings = {});

}  // namespace dreamsearch::results
