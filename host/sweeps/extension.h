// extension.h - a finished run as the beginning of a longer one.
//
// The longer run is a row of its own, with the configuration that a run of that budget has if it
// is given the eval_every and the replay_capacity that the finished one had: both may follow from
// the budget. It takes over what the finished run did up to a checkpoint that holds the replay and
// was made before anything that only the budget's end caused (a shortened last action, the last
// evaluation). So it has the bits of a run that had that budget from the start. The finished run
// stays as it is.
#pragma once

#include <cstdint>

#include "host/saving/checkpoint.h"
#include "host/settings/run_spec.h"
#include "results/database/database.h"

namespace dreamsearch {

// What the run is with that budget.
//   kUsage  the budget is not larger, or no multiple of the action repeat.
RunSpec ExtendedSpec(const RunSpec& spec, std::uint64_t steps);

// The newest checkpoint of a finished run from which it can go on.
//   kNotFound  there is none; the message says how it would have been kept.
Checkpoint ExtensibleCheckpoint(results::Database* database, const results::RunInfo& run,
                                const RunSpec& spec);

// Gives `longer`, which has no rows yet, what the run did up to the checkpoint, and a copy of that.
void TakeOver(results::Database* database, const results::RunInfo& run, const RunSpec& spec,
              const Checkpoint& checkpoint, const results::RunInfo& longer,
              const RunSpec& longer_spec);

}  // namespace dreamsearch
