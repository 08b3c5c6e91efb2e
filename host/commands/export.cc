// runner export RUN - how do other programs get at a trained model, and at what it lived through?
#include <iostream>
#include <nlohmann/json.hpp>

#include "dreamsearch/version.h"
#include "host/acting/components.h"
#include "host/commands/commands.h"
#include "host/commands/progress.h"
#include "host/flags/flags.h"
#include "host/processes/child_request.h"
#include "host/saving/checkpoint.h"
#include "host/saving/safetensors.h"
#include "host/sweeps/sweep.h"
#include "host/sweeps/trained_run.h"
#include "host/training/episode_file.h"
#include "host/training/experiment.h"
#include "host/training/resumption.h"
#include "results/system/error.h"
#include "results/text/table.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::string ShapeText(const nlohmann::json& shape) {
  std::string text = "[";
  for (const auto& extent : shape) {
    text += (text.size() > 1 ? ", " : "") + std::to_string(extent.get<std::uint64_t>());
  }
  return text + "]";
}

struct Export {
  std::string run, db = kDefaultDatabase, out, episodes;
  TrustedCode trusted;

  CommandSpec Declare() {
    return {
        .name = "runner export",
        .summary = "writes the weights of a trained model, or the episodes it learned from",
        .examples = {"runner export 3 --out walker.safetensors",
                     "python3 -c 'from safetensors.numpy import load_file; "
                     "load_file(\"walker.safetensors\")'",
                     "runner export 3 --episodes walker.npz",
                     "python3 -c 'import numpy; print(numpy.load(\"walker.npz\")[\"rewards\"])'"},
        .about =
            "Python and other programs read the file: named float32 arrays, row-major. The "
            "weights come from the run's newest checkpoint; the model names the arrays. The "
            "command lists them on standard output with their shapes, slowest dimension "
            "first. The file's __metadata__ says which run, task, planner, model and "
            "configuration they come from.\n"
            "With --episodes the training episodes are written instead (with --out as well), "
            "from the newest checkpoint that holds the replay: of a finished run that is an "
            "earlier one, with all but its last action if it was begun with --keep-replay. "
            "NumPy's load reads the file: observations [R, O], actions [R, A] in [-1, 1], "
            "rewards [R] as float32, terminated [R] and truncated [R] as bool, episode [R] as "
            "int64. A row is what one decision led to; the first row of an episode is its "
            "first observation, with an action and a reward of zero.",
        .arguments = {RunArgument(&run)},
        .groups = {{"Where",
                    {DatabaseFlag(&db),
                     PluginPathFlag(&trusted.folders),
                     TrustModuleFlag(&trusted.modules),
                     {"out", "FILE", Text(&out).Default("TASK_PLANNER_seedN.safetensors"),
                      "write this file, or a file in this folder"},
                     {"episodes", "FILE", Text(&episodes),
                      "write the training episodes to this .npz file"}}}}};
  }
  int Run();

 private:
  void WriteEpisodes(results::Database* database) const;
};

void Export::WriteEpisodes(results::Database* database) const {
  const results::RunInfo info = database->GetRun(run);
  const RunSpec spec = RecordedSpec(database, info);
  const std::string name = "run " + std::to_string(info.run_id) + " (" + RunLabel(spec) + ")";
  if (spec.evaluation) {
    throw Failure(ExitCode::kUsage, name + " is an evaluation; expected a training");
  }
  const auto judge = [&](const Checkpoint& checkpoint) -> std::string {
    if (!Experiment::HasReplay(checkpoint)) return "holds no replay";
    return WhyUnfit(database, info, spec, checkpoint);
  };
  std::optional<CheckpointFolder::Loaded> loaded;
  std::string why = "it has no checkpoint yet";
  try {
    loaded = CheckpointFolder(database->RunFolder(info)).LoadNewest(judge);
  } catch (const Failure& error) {
    if (error.code() != ExitCode::kBadInput) throw;
    why = error.what();
  }
  if (!loaded) throw Failure(ExitCode::kNotFound, name + " kept no episodes: " + why);
  const results::ResumePoint point = Experiment::ResumePointOf(loaded->checkpoint);
  const std::unique_ptr<Replay> replay = Experiment::ReadReplay(loaded->checkpoint, spec);
  std::uint64_t finished = 0;
  for (const Replay::Episode& episode : replay->episodes()) finished += episode.finished;
  const auto first = static_cast<std::uint64_t>(point.training_episodes) - finished;
  const EpisodeFile file =
      dreamsearch::WriteEpisodes(*replay, first, std::filesystem::absolute(episodes));
  std::cerr << "wrote " << episodes << ": " << Counted(file.episodes, "episode") << " from "
            << first << " on, " << GroupDigits(file.rows) << " rows, "
            << FormatBytes(static_cast<double>(file.bytes)) << ", of " << name << " after "
            << GroupDigits(static_cast<std::uint64_t>(point.env_step)) << " environment steps\n";
}

int Export::Run() {
  const auto database = results::Database::OpenReadOnly(db);
  if (!episodes.empty()) {
    WriteEpisodes(database.get());
    if (out.empty()) return 0;
  }
  const TrainedRun trained = FindTrainedRun(database.get(), run, trusted);
  for (const std::string& warning : trained.warnings) std::cerr << "warning: " << warning << "\n";
  const RunSpec& spec = trained.spec;
  out = OutputPath(out, spec.environment.task() + "_" + spec.planner.name() + "_seed" +
                            std::to_string(spec.seed) + ".safetensors");
  const std::map<std::string, std::string> metadata = {
      {"run_uuid", trained.info.uuid},
      {"run_id", std::to_string(trained.info.run_id)},
      {"study", trained.info.study},
      {"env", spec.environment.task()},
      {"planner", spec.planner.name()},
      {"model", spec.model.name()},
      {"model_version", spec.model.info->version},
      {"seed", std::to_string(spec.seed)},
      {"env_step", std::to_string(trained.env_step)},
      {"config_sha256", trained.info.config_sha256},
      {"config", trained.info.config_json},
      {"dreamsearch", DREAMSEARCH_VERSION}};
  ChildRequest request;
  request.command = "export-model";
  request.who = RunName(trained);
  const nlohmann::json answer = AskChild(request, {{"spec", ToJson(spec)},
                                                   {"checkpoint", trained.checkpoint.string()},
                                                   {"out", out},
                                                   {"metadata", metadata}});
  results::Table table = {{"tensor", "shape"}, {}};
  std::uint64_t numbers = 0;
  for (const nlohmann::json& tensor : answer.at("tensors")) {
    table.rows.push_back({tensor.at("name").get<std::string>(), ShapeText(tensor.at("shape"))});
    numbers += tensor.at("size").get<std::uint64_t>();
  }
  std::cout << table.Print(results::TableForm::kText);
  std::cerr << "wrote " << out << ": " << answer.at("tensors").size() << " tensors, "
            << GroupDigits(numbers) << " numbers, " << FormatBytes(answer.at("bytes").get<double>())
            << ", of " << RunName(trained) << " after " << GroupDigits(trained.env_step)
            << " environment steps\n";
  return 0;
}

}  // namespace

Command ExportCommand() { return MakeCommand<Export>(); }

int ExportModelMain() {
  return AnswerMain([](const nlohmann::json& request) {
    const RunSpec spec = RunSpecFromJson(request.at("spec"));
    const Components components(spec);
    const EnvironmentPtr environment = components.MakeEnvironment();
    const EnvironmentPtr own_environment =
        spec.model.Has(kNeedsEnvironment) ? components.MakeEnvironment() : nullptr;
    const ModelPtr model = components.MakeModel(environment->spec(), 1, own_environment.get());
    LoadModel(Checkpoint(request.at("checkpoint").get<std::string>()), spec.model.name(),
              model.get());
    TensorCollector collector;
    if (auto* exporting = ExtensionOf<TensorExport>(model.get())) {
      ThrowUnlessOk(exporting->Export(&collector), "model '" + spec.model.name() + "' Export");
    }
    if (collector.tensors().empty()) {
      throw Failure(ExitCode::kBadInput, "model '" + spec.model.name() +
                                             "' has no weights to export: it exports no "
                                             "tensor");
    }
    nlohmann::json answer;
    answer["bytes"] = WriteSafetensors(request.at("out").get<std::string>(), collector.tensors(),
                                       request.at("metadata"));
    for (const NamedTensor& tensor : collector.tensors()) {
      answer["tensors"].push_back(
          {{"name", tensor.name}, {"shape", tensor.shape}, {"size", tensor.values.size()}});
    }
    return answer;
  });
}

}  // namespace dreamsearch
