// run_state.h - how far a submitted run is, by its database and the queue.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "host/clusters/slurm.h"
#include "host/clusters/submission.h"

namespace dreamsearch {

enum class RunState {
  kQueued,   // its job waits, or it waits for its turn in a job that runs
  kRunning,  // its job runs, or its process on this machine does
  kFinished,
  kFailed,   // also crashed and diverged
  kMissing,  // not finished, and no job has it
};

struct RunCondition {
  RunState state = RunState::kMissing;
  std::int64_t steps = 0;
  std::string node;  // where it is worked on, or was last
  std::string job;   // "12_3"
  std::string note;  // why it waits, failed or is missing

  // "finished", "queued in Slurm".
  std::string name() const;
};

// `queue` is null if Slurm was not asked. Ask it before the databases are read: a run that ends
// meanwhile is then finished, not missing.
RunCondition ConditionOf(const std::filesystem::path& folder, const SubmittedRun& run,
                         const Queue* queue);

}  // namespace dreamsearch
