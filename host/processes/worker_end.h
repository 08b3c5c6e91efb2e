// worker_end.h - what became of a worker's run: its status, exit code and the sentence for
// people, from how the process ended and what the supervisor had done to it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "host/training/run_loop.h"
#include "results/database/database.h"
#include "results/system/error.h"

namespace dreamsearch {

// What a supervisor knows of a worker that has ended.
struct WorkerCourse {
  // Why it asked it to end with a checkpoint, and why it killed it, if it did.
  enum class Asked { kNo, kTimeLimit, kStop } asked = Asked::kNo;
  enum class Killed { kNo, kHang, kMemory, kOverdue, kStop } killed = Killed::kNo;
  RunStage stage = RunStage::kStarting;  // last reported
  bool done = false;                     // reported
  std::string error;                     // reported
  std::filesystem::path log;
  std::int64_t log_begin = 0;   // bytes that workers before it had written to the log
  double patience_seconds = 0;  // of processor time without progress
  double idle_seconds = 0;      // of wall time asleep, if it was killed for that
  double grace_seconds = 0;     // after it was asked to end
  double time_limit_seconds = 0;
  std::uint64_t memory_bytes = 0;  // resident, when it was killed for it
  std::uint64_t memory_limit_bytes = 0;
  bool memory_limit_given = false;  // with --memory-limit; otherwise a share of what was free
};

struct WorkerEnd {
  results::RunStatus status = results::RunStatus::kFailed;
  int exit_code = 0;
  std::string error;
};

// The status of a run that ended with this code: diverged; interrupted, so that the same command
// resumes it, if it was stopped or the machine is at fault; otherwise failed, which is the
// program's or a plugin's fault.
results::RunStatus StatusOf(ExitCode code);

WorkerEnd EndOf(const WorkerCourse& course, int wait_status);

}  // namespace dreamsearch
