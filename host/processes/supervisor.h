// supervisor.h - runs a sweep, one worker process a run.
//
// Without --jobs there are as many workers at once as the cores and the memory allow. A worker
// whose resident size is more than its limit is killed.
//
// The supervisor loads no plugin. It starts workers, tells how they get on, ends
// those that hang or overstay, and writes every run's final status. A worker that
// crashes, hangs or eats memory costs its run, never the sweep.
//
// Stopping any of kStopSignals: workers finish their decision or update, checkpoint and end; a
//          second one ends them at once (a second SIGINT in a job of Slurm, never SIGXCPU). Either
//          way every run can be resumed. A worker that was asked to end, by a
//          signal or its time limit, and does not within a minute (within
//          --hang-timeout if that is shorter) is killed. A signal that was ignored
//          when the program was started stays ignored.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "host/processes/worker.h"
#include "host/settings/run_options.h"
#include "host/training/run_loop.h"
#include "results/database/database.h"
#include "results/system/error.h"

namespace dreamsearch {

struct SweepJob {
  WorkerJob work;
  std::string label;               // "walker_walk mcts_pw seed 0"
  std::uint64_t memory_bytes = 0;  // what it will take; 0: unknown
};

struct SweepResult {
  // One a job, in their order; nullopt-like kQueued for those never started.
  std::vector<results::RunStatus> statuses;
  // 75 if stopped, 74 if a status could not be recorded, else the first that is not 0 in
  // the order of the jobs.
  int exit_status = 0;
};

// What is told about a run that is active.
struct ActiveLine {
  std::string label;  // "walker_walk mcts_pw seed 0"
  RunProgress progress;
  std::uint64_t env_steps_target = 0;
  double rate = 0;            // environment steps per second; 0: unknown
  std::uint32_t threads = 1;  // granted; the run takes them at its next piece of work
};

// Where a sweep tells how it gets on; the command draws it.
class SweepObserver {
 public:
  virtual ~SweepObserver() = default;
  // The active runs by their place among the jobs, and a line about the whole sweep.
  virtual void Show(const std::map<std::size_t, ActiveLine>& lines, const std::string& summary) = 0;
  // A message that stays.
  virtual void Say(const std::string& message) = 0;
};

// How long a run that was asked to end may take for its checkpoint.
double GraceSeconds(const ProcessOptions& options);

// The exit code stored with a run's failure.
int FailureCode(const results::RunInfo& run);

SweepResult RunSweep(results::Database* database, const ProcessOptions& options,
                     std::vector<SweepJob> jobs, SweepObserver* observer);

}  // namespace dreamsearch
