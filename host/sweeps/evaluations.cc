#include "host/sweeps/evaluations.h"

#include <utility>

#include "results/system/error.h"
#include "results/text/names.h"

namespace dreamsearch {

std::vector<RunSpec> EvaluationsOf(const TrainedRun& trained, RunOptions options) {
  const RunSpec& spec = trained.spec;
  options.environments = {spec.environment.task()};
  options.seeds = {spec.seed};
  options.study = trained.info.study;
  if (options.preset.empty()) options.preset = spec.preset;
  if (options.models.empty()) options.models = {spec.model.name()};
  std::vector<RunSpec> evaluations = ResolveMatrix(options, trained.catalogue, &spec);
  for (RunSpec& evaluation : evaluations) {
    EvaluationSpec& what = evaluation.evaluation.emplace();
    what.parent_run_id = trained.info.run_id;
    what.parent_uuid = trained.info.uuid;
    what.env_step = trained.env_step;
    what.agent_sha256 = trained.agent_sha256;
    if (evaluation.model.name() == spec.model.name()) continue;
    if (!evaluation.model.Has(kNeedsEnvironment)) {
      throw Failure(
          ExitCode::kUsage,
          "--model: '" + evaluation.model.name() + "' cannot take the agent of " +
              RunName(trained) + ", whose model is " + spec.model.name() +
              ". Expected that, or a model on true dynamics: " +
              JoinNames(trained.catalogue.NamesOf(ComponentKind::kModel, kNeedsEnvironment)));
    }
    if (spec.model.Has(kNeedsEnvironment)) {
      throw Failure(ExitCode::kUsage, "--model: " + RunName(trained) +
                                          " trained no actor and critic for '" +
                                          evaluation.model.name() + "': its own model is '" +
                                          spec.model.name() + "'");
    }
    what.trained_model = spec.model;
  }
  return evaluations;
}

std::vector<RunSpec> EvaluationsWithoutTraining(const RunOptions& options,
                                                const Catalogue& catalogue) {
  std::vector<RunSpec> evaluations = ResolveMatrix(options, catalogue);
  for (RunSpec& evaluation : evaluations) {
    if (evaluation.model.Has(kLearns)) {
      throw Failure(ExitCode::kUsage,
                    "--model: '" + evaluation.model.name() +
                        "' learns, so it needs a trained run: runner eval RUN --planner ...; "
                        "without one expected a model that does not, " +
                        catalogue.DefaultModel(false)->name + " unless named");
    }
    evaluation.evaluation.emplace();
  }
  return evaluations;
}

}  // namespace dreamsearch
