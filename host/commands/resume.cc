// runner resume - what was interrupted, and how is it finished?
#include <algorithm>
#include <iostream>

#include "host/commands/commands.h"
#include "host/commands/progress.h"
#include "host/flags/flags.h"
#include "host/processes/supervisor.h"
#include "host/sweeps/probe.h"
#include "host/sweeps/sweep.h"
#include "host/sweeps/working_database.h"
#include "results/database/database.h"
#include "results/system/error.h"
#include "results/system/run_lock.h"
#include "results/text/text.h"

namespace dreamsearch {

namespace {

struct Resume {
  ProcessOptions options;
  std::string what = "all";
  bool force = false;

  CommandSpec Declare() {
    std::vector<Flag> runs = {
        RetryFlag(&options),
        {"force", "", Switch(&force),
         "resume under another instruction set, which gives slightly different numbers"},
        TrustModuleFlag(&options.trusted_modules),
        DryRunFlag(&options)};
    return {.name = "runner resume",
            .summary = "finishes runs that were queued, interrupted or killed",
            .examples = {"runner resume", "runner resume 3 --jobs 1"},
            .about =
                "Runs whose process died are resumed as well; with --retry also those that "
                "failed, crashed or diverged.",
            .arguments = {{"", "RUN|STUDY|all", Text(&what),
                           "a run's number or the beginning of its UUID, from `runner status`; a "
                           "study; or all"}},
            .groups = {WorkFlags(&options),
                       {"Runs that exist", std::move(runs)},
                       {"What to record", RecordingFlags(&options)}}};
  }
  int Run();
};

int Resume::Run() {
  ProgressDisplay progress;
  WorkingDatabase working(options, /*exists=*/true, &progress);
  auto database = results::Database::OpenExisting(working.path());
  std::vector<results::RunInfo> runs = database->ListRuns();
  bool one = false;  // named by itself
  if (what != "all") {
    const bool is_study =
        std::any_of(runs.begin(), runs.end(), [&](const auto& run) { return run.study == what; });
    if (is_study) {
      std::erase_if(runs, [&](const auto& run) { return run.study != what; });
    } else {
      runs = {database->GetRun(what)};
      one = true;
    }
  }
  std::vector<SweepJob> jobs;
  std::vector<RunSpec> specs;  // of the jobs
  int found = 0;               // by a dry run
  int refused = 0;             // exit status of the first run that was
  for (const results::RunInfo& run : runs) {
    const bool failed = results::HasFailed(run.status);
    if (run.status == results::RunStatus::kFinished || (failed && !options.retry)) continue;
    if (RunIsLocked(database->RunFolder(run))) {
      const std::string silent = SilentWorker(database.get(), run);
      if (!silent.empty() && refused == 0) refused = static_cast<int>(ExitCode::kInputOutput);
      std::cerr << "skipped: run " << run.run_id << ": "
                << (silent.empty() ? "another process is working on it" : silent) << "\n";
      continue;
    }
    SweepJob job;
    try {
      job = RecordedJob(database.get(), options, run);
    } catch (const Failure& error) {
      if (one) throw;
      std::cerr << "refused: " << error.what() << "\n";
      if (refused == 0) refused = error.exit_status();
      continue;
    }
    if (options.dry_run) {
      std::cout << "would resume run " << run.run_id << ": " << run.task << " " << run.planner
                << " seed " << run.seed << ", " << results::RunStatusName(run.status) << " at "
                << GroupDigits(static_cast<std::uint64_t>(run.env_steps_done)) << " of "
                << GroupDigits(static_cast<std::uint64_t>(run.env_steps_target)) << " steps\n";
      ++found;
      continue;
    }
    job.work.force = force;
    specs.push_back(job.work.spec);
    jobs.push_back(std::move(job));
  }
  if (found > 0) {
    std::cerr << "nothing was run or written\n";
    return refused;
  }
  if (jobs.empty()) {
    std::cerr << (refused == 0 ? "nothing to resume in " : "nothing else to resume in ")
              << working.Name() << "\n";
    return refused;
  }
  const std::uint64_t memory = MemoryOfRuns(specs, {}, options);
  for (SweepJob& job : jobs) job.memory_bytes = memory;
  const int status =
      RunSweep(database.get(), options, std::move(jobs), working.observer()).exit_status;
  database.reset();
  working.Finish();
  const bool stopped = status == static_cast<int>(ExitCode::kInterrupted);
  return refused != 0 && !stopped ? refused : status;
}

}  // namespace

Command ResumeCommand() { return MakeCommand<Resume>(); }

}  // namespace dreamsearch
