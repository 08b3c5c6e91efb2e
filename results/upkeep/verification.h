// verification.h - are the stored rows those that were written?
#pragma once

#include <string>
#include <vector>

#include "results/database/database.h"

namespace dreamsearch::results {

// What does not fit, one line each; nothing if all is well. Looks at the file's
// structure (SQLite's integrity and foreign key checks), and for every run that
// the filter lets through at the digests of its rows, its bins, its result digest,
// its configuration's SHA-256 and, once it has ended, the digest of its record; and for
// holes, which no digest of what is there can show: decisions, episodes or segments that
// do not go on where the one before ended. Reads one consistent state, also while runs are
// being written.
std::vector<std::string> Verify(Database* database, const RunFilter& filter);

// Which of a run's digests its rows do not have.
std::vector<std::string> WhyNotAsWritten(Database* database, const RunInfo& run);

// Where a run and its repetition first differ, one line for the decisions and one for
// the episodes, in the order of environment steps; nothing if they agree. Compares
// all that seeds decide, bit for bit, and no times; no decisions if `stored` has none of the run
// (MergeSettings). Either may be in a file of its own.
std::vector<std::string> CompareRuns(Database* stored, std::int64_t stored_run, Database* repeated,
                                     std::int64_t repeated_run);

}  // namespace dreamsearch::results
