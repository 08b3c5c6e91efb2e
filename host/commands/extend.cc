// runner extend RUN --steps N - how good does a finished agent become if it goes on?
#include <iostream>

#include "host/commands/commands.h"
#include "host/commands/progress.h"
#include "host/flags/flags.h"
#include "host/processes/supervisor.h"
#include "host/sweeps/extension.h"
#include "host/sweeps/probe.h"
#include "host/sweeps/run_file.h"
#include "host/sweeps/sweep.h"
#include "host/sweeps/working_database.h"
#include "host/training/resumption.h"
#include "results/database/database.h"
#include "results/system/error.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::uint64_t ParseSteps(const std::string& text) { return ParseWhole(text, 1, 1000000000000); }

bool HasCheckpoint(results::Database* database, const PlannedRun& plan) {
  if (plan.run_id == 0) return false;
  const results::RunInfo run = *database->GetRun(plan.run_id);
  return FindResumption(database, run, plan.spec, database->RunFolder(run),
                        CheckpointFolder::Extent::kOutline)
      .checkpoint.has_value();
}

struct Extend {
  std::string what;
  std::uint64_t steps = 0;
  ProcessOptions options;

  CommandSpec Declare() {
    return {.name = "runner extend",
            .summary = "goes on with a finished run, past its budget",
            .examples = {"runner --env walker_walk --planner dreamer --steps 100000 --keep-replay",
                         "runner extend 1 --steps 200000"},
            .about =
                "The run must have kept its replay: begin it with --keep-replay. The result is a "
                "run of its own, bit for bit the one that a command with that --steps and with the "
                "finished run's run.eval_every and run.replay_capacity gives, which is also its "
                "configuration; where they followed from the budget they stay as they were. So "
                "runs that are extended alike are compared with each other, and `results` keeps "
                "them apart from runs that had the larger budget from the start and other values "
                "of the two. The finished run stays as it is. The same command again resumes what "
                "is unfinished.",
            .arguments = {RunArgument(&what)},
            .groups = {{"How far",
                        {{"steps", "N", Parsed(&steps, ParseSteps).Required(),
                          "environment steps of the longer run, before action repeat, those of the "
                          "finished one included"},
                         TrustModuleFlag(&options.trusted_modules)}},
                       WorkFlags(&options),
                       {"What to record", RecordingFlags(&options)}}};
  }
  int Run(const Words& words);
};

int Extend::Run(const Words& words) {
  ProgressDisplay progress;
  WorkingDatabase working(options, /*exists=*/true, &progress);
  auto database = results::Database::OpenExisting(working.path());
  working.TakeToRead(what);
  const results::RunInfo run = database->GetRun(what);
  const RunSpec spec = TrustedSpec(database.get(), run, options.trusted());
  const std::string name = "run " + std::to_string(run.run_id) + " (" + RunLabel(spec) + ")";
  if (spec.evaluation) {
    throw Failure(ExitCode::kUsage, name + " is an evaluation; expected a training");
  }
  if (run.status != results::RunStatus::kFinished) {
    throw Failure(ExitCode::kUsage,
                  name + " is " + results::RunStatusName(run.status) + "; expected a finished run");
  }
  // Refused if a plugin or another thing that decides its results has changed.
  const SweepJob before = RecordedJob(database.get(), options, run);
  options.log_decisions = before.work.log_decisions;
  options.record_trees = before.work.record_trees;
  options.keep_replay = before.work.keep_replay;
  const RunSpec longer_spec = ExtendedSpec(spec, steps);

  const std::vector<PlannedRun> planned = PlanSweep(database.get(), options, {longer_spec});
  const PlannedRun& plan = planned.front();
  if (plan.action == SweepAction::kSkipFinished) {
    std::cerr << name << " has been extended so before: run " << plan.run_id << ", finished\n";
    return 0;
  }
  const int failed_before = SaySkipped(database.get(), planned);
  if (!IsWork(plan.action)) return failed_before != 0 ? failed_before : SweepStatus(planned, {});
  std::optional<Checkpoint> checkpoint;
  // One that has made no checkpoint may lack what it takes over.
  if (!HasCheckpoint(database.get(), plan)) {
    checkpoint = ExtensibleCheckpoint(database.get(), run, spec);
  }
  const results::TaskInfo task = ProbeRun(spec, ProbeDepth::kTask, options).task;
  std::vector<std::string> argv = {"runner", "extend"};
  argv.insert(argv.end(), words.begin(), words.end());
  std::vector<SweepJob> jobs = RecordSweep(database.get(), options, planned, {task}, argv);
  WorkerJob& work = jobs.front().work;
  std::cerr << name << " goes on to " << GroupDigits(longer_spec.steps())
            << " environment steps as run " << work.run_id
            << ", with run.eval_every = " << longer_spec.run.Integer("eval_every")
            << " and run.replay_capacity = " << longer_spec.run.Integer("replay_capacity") << "\n";
  if (checkpoint) {
    work.retries = before.work.retries;
    WriteRunFile(work);
    TakeOver(database.get(), run, spec, *checkpoint, *database->GetRun(work.run_id), longer_spec);
  }
  const int status =
      RunSweep(database.get(), options, std::move(jobs), working.observer()).exit_status;
  database.reset();
  working.Finish();
  return status;
}

}  // namespace

Command ExtendCommand() { return MakeCommand<Extend>(); }

}  // namespace dreamsearch
