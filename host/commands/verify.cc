// runner verify RUN - does a run give the same results again?
#include <iostream>

#include "host/commands/commands.h"
#include "host/commands/progress.h"
#include "host/flags/flags.h"
#include "host/processes/supervisor.h"
#include "host/sweeps/probe.h"
#include "host/sweeps/run_file.h"
#include "host/sweeps/sweep.h"
#include "host/training/build_and_host.h"
#include "results/system/error.h"
#include "results/system/sha256.h"
#include "results/system/temporary_folder.h"
#include "results/upkeep/verification.h"

namespace dreamsearch {
namespace {

struct Verify {
  std::string what;
  ProcessOptions options;
  bool force = false;

  CommandSpec Declare() {
    return {
        .name = "runner verify",
        .summary = "repeats a finished run and compares the results",
        .examples = {"runner verify 3"},
        .about =
            "Runs a training or an evaluation again from its stored settings and seeds, in a "
            "temporary database. That takes as long as the run took. The command says that both "
            "are equal, or where they first differ (exit status 78). Before that it checks that "
            "the stored episodes have the stored digest; `results verify` checks every stored "
            "row. A run gives the same results only on the same kind of machine with the same "
            "programs.",
        .arguments = {RunArgument(&what)},
        .groups = {{"What to compare",
                    {{"force", "", Switch(&force),
                      "compare although a plugin or the instruction set has changed"},
                     TrustModuleFlag(&options.trusted_modules)}},
                   LimitFlags(&options)}};
  }
  int Run();
};

int Verify::Run() {
  const auto database = results::Database::OpenReadOnly(options.db.string());
  const results::RunInfo run = database->GetRun(what);
  RunSpec spec = TrustedSpec(database.get(), run, options.trusted());
  const std::string name = "run " + std::to_string(run.run_id) + " (" + RunLabel(spec) + ")";
  if (run.status != results::RunStatus::kFinished) {
    throw Failure(ExitCode::kUsage,
                  name + " is " + results::RunStatusName(run.status) + "; expected a finished run");
  }
  if (database->ComputeResultDigest(run.run_id) != run.result_digest) {
    std::cout << "different: the stored episodes of " << name << " do not have its stored digest\n";
    return static_cast<int>(ExitCode::kVerificationFailed);
  }
  std::string changed = ChangedFile(spec);
  if (changed.empty()) changed = ChangedIngredient(spec, options);
  const std::string instruction_set = database->GetBuild(run.build_id).instruction_set;
  if (changed.empty() && instruction_set != InstructionSetInUse()) {
    changed = "the instruction set changed (" + instruction_set + " then, " +
              InstructionSetInUse() + " now)";
  }
  if (!changed.empty()) {
    if (!force) {
      throw Failure(ExitCode::kPluginRefused, name + " cannot be repeated as it was: " + changed +
                                                  ". Use --force to compare anyway");
    }
    std::cerr << "warning: " << name << " cannot be repeated as it was: " << changed << "\n";
    for (ResolvedComponent* component :
         {&spec.environment, &spec.model, &spec.planner, &spec.eval_planner}) {
      ComponentInfo info = *component->info;
      info.plugin.sha256 = Sha256HexOfFile(info.plugin.path);
      component->info = std::make_shared<const ComponentInfo>(std::move(info));
      DigestFilesAnew(&component->parameters);
    }
    spec.environment.ingredients.clear();
  }

  const std::filesystem::path agent = AgentCheckpoint(database.get(), spec);
  // The temporary database has no trained run to name.
  if (spec.evaluation) spec.evaluation->parent_run_id = 0;
  const ProbeResult probe = ProbeRun(spec, ProbeDepth::kTask, options);
  spec.environment.ingredients = probe.ingredients;
  const TemporaryFolder folder;
  const auto repeated = results::Database::OpenOrCreate(folder / "verify.db");
  PlannedRun planned;
  planned.spec = spec;
  std::vector<SweepJob> jobs =
      RecordSweep(repeated.get(), options, {planned}, {probe.task}, {"runner", "verify"});
  jobs.front().work.agent_checkpoint = agent;
  jobs.front().work.retries = ReadRunFile(database->RunFolder(run)).retries;
  const std::int64_t repeated_id = jobs.front().work.run_id;
  ProgressDisplay progress;
  const SweepResult result = RunSweep(repeated.get(), options, std::move(jobs), &progress);
  if (result.exit_status != 0) return result.exit_status;

  const results::RunInfo again = *repeated->GetRun(repeated_id);
  if (again.result_digest == run.result_digest) {
    std::cout << "equal: " << name << ", result digest " << run.result_digest << "\n";
    return 0;
  }
  std::cout << "different: " << name << ", stored result digest " << run.result_digest
            << ", repeated " << again.result_digest << "\n";
  for (const std::string& difference :
       results::CompareRuns(database.get(), run.run_id, repeated.get(), repeated_id)) {
    std::cout << "first differing " << difference << "\n";
  }
  return static_cast<int>(ExitCode::kVerificationFailed);
}

}  // namespace

Command VerifyCommand() { return MakeCommand<Verify>(); }

}  // namespace dreamsearch
