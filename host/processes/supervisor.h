// supervisor.h - runs a sweep, one worker process a run.
//
// The supervisor loads no plugin. It starts workers, shows their progress, ends
// those that hang or overstay, and writes every run's final status. A worker that
// crashes, hangs or eats memory costs its run, never the sweep.
//
// Stopping SIGINT, SIGTERM, SIGUSR1 or SIGHUP: workers finish their decision or
//          update, checkpoint and end; a second one ends them at once. Either
//          way every run can be resumed. A worker that was asked to end, by a
//          signal or its time limit, and does not within a minute (within
//          --hang-timeout if that is shorter) is killed.
#pragma once

#include <string>
#include <vector>

#include "host/system/error.h"
#include "results/database/database.h"
#include "host/settings/run_options.h"
#include "host/processes/worker.h"

namespace dreamsearch {

struct SweepJob {
  WorkerJob work;
  std::string label;  // "walker_walk mcts_pw seed 0"
};

struct SweepResult {
  // One a job, in their order; nullopt-like kQueued for those never started.
  std::vector<results::RunStatus> statuses;
  // 75 if stopped, 74 if a status could not be recorded, else the first that is not 0 in
  // the order of the jobs.
  int exit_status = 0;
};

// The exit code stored with a run's failure.
int FailureCode(const results::RunInfo& run);

SweepResult RunSweep(results::Database* database, const ProcessOptions& options,
                     std::vector<SweepJob> jobs);

}  // namespace dreamsearch
