// runner export RUN - how do other programs get at a trained model?
#include <iostream>
#include <nlohmann/json.hpp>

#include "dreamsearch/version.h"
#include "host/acting/components.h"
#include "host/commands/commands.h"
#include "host/commands/flags.h"
#include "host/commands/progress.h"
#include "host/processes/child_request.h"
#include "host/saving/checkpoint.h"
#include "host/saving/safetensors.h"
#include "host/sweeps/trained_run.h"
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
  std::string run, db = kDefaultDatabase, out;
  std::vector<std::string> plugin_path;

  CommandSpec Declare() {
    return {.name = "runner export",
            .summary = "writes the weights of a trained model as a safetensors file",
            .examples = {"runner export 3 --out walker.safetensors",
                         "python3 -c 'from safetensors.numpy import load_file; "
                         "load_file(\"walker.safetensors\")'"},
            .about =
                "Python and other programs read the file: named float32 arrays, row-major. The "
                "weights come from the run's newest checkpoint; the model names the arrays. The "
                "command lists them on standard output with their shapes, slowest dimension "
                "first. The file's __metadata__ says which run, task, planner, model and "
                "configuration they come from.",
            .arguments = {RunArgument(&run)},
            .groups = {{"Where",
                        {DatabaseFlag(&db),
                         PluginPathFlag(&plugin_path),
                         {"out", "FILE", Text(&out).Default("TASK_PLANNER_seedN.safetensors"),
                          "write this file, or a file in this folder"}}}}};
  }
  int Run();
};

int Export::Run() {
  const auto database = results::Database::OpenReadOnly(db);
  const TrainedRun trained = FindTrainedRun(database.get(), run, plugin_path);
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
    ThrowUnlessOk(model->Export(&collector), "model '" + spec.model.name() + "' Export");
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
