#include <algorithm>
#include <iostream>

#include "host/commands/commands.h"
#include "host/commands/options.h"
#include "host/commands/progress.h"
#include "host/processes/supervisor.h"
#include "host/processes/sweep.h"
#include "results/database/database.h"
#include "results/system/error.h"
#include "results/system/text.h"

namespace dreamsearch {

namespace po = boost::program_options;

int ResumeCommand(const std::vector<std::string>& arguments) {
  ProcessOptions options;
  std::string what = "all";
  bool force = false;
  po::options_description flags(
      "runner resume [RUN|STUDY|all] [options]\n\nGoes on with runs that were queued, interrupted "
      "or killed, or whose process died;\nwith --retry also with those that failed, crashed or "
      "diverged. RUN is a number or\nthe beginning of a UUID from `runner status`");
  flags.add_options()("help", "show this help")("what", po::value<std::string>(&what),
                                                "RUN, STUDY or all")(
      "force", po::bool_switch(&force),
      "go on under another instruction set, though the bits will differ");
  flags.add(ResumeFlags(&options));
  po::positional_options_description positional;
  positional.add("what", 1);
  const po::variables_map given = ParseFlags("runner resume", arguments, flags, positional);
  if (given.count("help") != 0) {
    std::cout << flags;
    return 0;
  }
  const auto database = results::Database::OpenExisting(options.db.string());
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
  int found = 0;    // by a dry run
  int refused = 0;  // exit status of the first run that was
  for (const results::RunInfo& run : runs) {
    const bool failed = results::HasFailed(run.status);
    if (run.status == results::RunStatus::kFinished || (failed && !options.retry)) continue;
    if (RunIsLocked(database->RunFolder(run))) {
      std::cerr << "left alone: run " << run.run_id << ": another process is working on it\n";
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
    jobs.push_back(std::move(job));
  }
  if (found > 0) {
    std::cerr << "nothing was run or written\n";
    return refused;
  }
  if (jobs.empty()) {
    std::cerr << (refused == 0 ? "nothing to resume in " : "nothing else to resume in ")
              << database->path() << "\n";
    return refused;
  }
  ProgressDisplay progress;
  const int status = RunSweep(database.get(), options, std::move(jobs), &progress).exit_status;
  const bool stopped = status == static_cast<int>(ExitCode::kInterrupted);
  return refused != 0 && !stopped ? refused : status;
}

}  // namespace dreamsearch
