#include "host/sweeps/trained_run.h"

#include <algorithm>
#include <set>

#include "host/acting/components.h"
#include "host/saving/checkpoint.h"
#include "host/sweeps/recorded_code.h"
#include "host/sweeps/sweep.h"
#include "host/training/experiment.h"
#include "host/training/resumption.h"
#include "results/system/error.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {

std::string RunName(const TrainedRun& run) {
  return "run " + std::to_string(run.info.run_id) + " (" + RunLabel(run.spec) + ")";
}

TrainedRun FindTrainedRun(results::Database* database, const std::string& run,
                          const TrustedCode& trusted) {
  TrainedRun found;
  found.info = database->GetRun(run);
  if (found.info.parent_run_id) {
    throw Failure(ExitCode::kUsage,
                  "run " + std::to_string(found.info.run_id) +
                      " is an evaluation and trained nothing; the trained run is " +
                      std::to_string(*found.info.parent_run_id));
  }
  found.spec = RecordedSpec(database, found.info);
  if (found.spec.evaluation) {
    throw Failure(ExitCode::kUsage, "run " + std::to_string(found.info.run_id) +
                                        " is an evaluation of an untrained model; " +
                                        CommandOn("runner status", database->path()) +
                                        " lists the trained runs");
  }
  const std::string name = RunName(found);
  const std::string folder = database->RunFolder(found.info);
  std::optional<CheckpointFolder::Loaded> loaded;
  try {
    loaded = CheckpointFolder(folder).LoadNewest([&](const Checkpoint& checkpoint) {
      return WhyUnfit(database, found.info, found.spec, checkpoint);
    });
  } catch (const Failure& error) {
    throw Failure(error.code(), name + ": " + error.what());
  }
  if (!loaded) {
    throw Failure(ExitCode::kNotFound, name + " has no checkpoint yet (it is " +
                                           results::RunStatusName(found.info.status) + ") in " +
                                           folder);
  }
  found.checkpoint = loaded->checkpoint.path();
  for (const CheckpointFolder::Skipped& skipped : loaded->skipped) {
    found.warnings.push_back(skipped.why);
  }
  found.env_step =
      static_cast<std::uint64_t>(Experiment::ResumePointOf(loaded->checkpoint).env_step);
  found.agent_sha256 = ModelSha256(loaded->checkpoint);

  TrustRecordedCode(trusted, name + " of " + database->path(), &found.spec);
  found.catalogue = Catalogue::Scan(PluginFolders(trusted.folders));
  found.ingredients = found.spec.environment.ingredients;
  std::set<std::string> changed;
  for (ResolvedComponent* component : {&found.spec.environment, &found.spec.model,
                                       &found.spec.planner, &found.spec.eval_planner}) {
    const PluginInfo then = component->info->plugin;
    *component = Rebased(*component, found.spec.preset, found.catalogue);
    const PluginInfo& now = component->info->plugin;
    const std::string change = PluginChange(now, then.sha256);
    if (!change.empty() && changed.insert(now.name).second) {
      found.warnings.push_back(name + " was trained with another plugin: " + change);
    }
    const std::string file = DigestFilesAnew(&component->parameters);
    if (!file.empty() && changed.insert(file).second) {
      found.warnings.push_back(name + " was trained with another file: " + file);
    }
  }
  return found;
}

}  // namespace dreamsearch
