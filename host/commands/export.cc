#include <iostream>
#include <nlohmann/json.hpp>

#include "dreamsearch/version.h"
#include "host/acting/components.h"
#include "host/commands/commands.h"
#include "host/commands/options.h"
#include "host/commands/progress.h"
#include "host/commands/text_table.h"
#include "host/processes/question.h"
#include "host/processes/trained_run.h"
#include "host/saving/checkpoint.h"
#include "host/saving/safetensors.h"
#include "results/system/error.h"
#include "results/system/text.h"

namespace dreamsearch {

namespace po = boost::program_options;

namespace {

constexpr char kHelp[] =
    "runner export RUN [--db FILE] [--out FILE.safetensors]\n\n"
    "Writes the weights of a trained model, from the run's newest checkpoint, as a\n"
    "safetensors file: named float32 arrays, row-major, that Python and other programs\n"
    "read. The arrays are those the model names itself; they are listed on standard\n"
    "output with their shapes, slowest dimension first. The file's __metadata__ says\n"
    "which run, task, planner, model and configuration they come from. RUN is a number\n"
    "or the beginning of a UUID from `runner status`.\n\n"
    "Example\n"
    "  runner export 3 --out walker.safetensors\n"
    "  python3 -c 'from safetensors.numpy import load_file; load_file(\"walker.safetensors\")'\n\n"
    "Options";

std::string ShapeText(const nlohmann::json& shape) {
  std::string text = "[";
  for (const auto& extent : shape) {
    text += (text.size() > 1 ? ", " : "") + std::to_string(extent.get<std::uint64_t>());
  }
  return text + "]";
}

}  // namespace

int ExportCommand(const std::vector<std::string>& arguments) {
  std::string run, db = "results/dreamsearch.db", out;
  std::vector<std::string> plugin_path;
  po::options_description flags(kHelp);
  flags.add_options()("help", "show this help")("run", po::value(&run)->value_name("RUN"),
                                                "the trained run")(
      "db", po::value(&db)->value_name("FILE"), "results database (results/dreamsearch.db)")(
      "out", po::value(&out)->value_name("FILE"),
      "the file to write, or a folder for it (TASK_PLANNER_seedN.safetensors here)");
  flags.add(PluginPathFlag(&plugin_path));
  po::positional_options_description positional;
  positional.add("run", 1);
  const po::variables_map given = ParseFlags("runner export", arguments, flags, positional);
  if (given.count("help") != 0) {
    std::cout << flags;
    return 0;
  }
  if (run.empty()) {
    throw Failure(ExitCode::kUsage,
                  "runner export: expected a run, for example runner export 3; `runner "
                  "status` lists them");
  }
  const auto database = results::Database::OpenReadOnly(db);
  const TrainedRun trained = FindTrainedRun(database.get(), run, plugin_path);
  for (const std::string& warning : trained.warnings) std::cerr << "warning: " << warning << "\n";
  const RunSpec& spec = trained.spec;
  out = OutputPath(out, spec.environment.name() + "_" + spec.planner.name() + "_seed" +
                            std::to_string(spec.seed) + ".safetensors");
  const std::map<std::string, std::string> metadata = {
      {"run_uuid", trained.info.uuid},
      {"run_id", std::to_string(trained.info.run_id)},
      {"study", trained.info.study},
      {"env", spec.environment.name()},
      {"planner", spec.planner.name()},
      {"model", spec.model.name()},
      {"model_version", spec.model.info->version},
      {"seed", std::to_string(spec.seed)},
      {"env_step", std::to_string(trained.env_step)},
      {"config_sha256", trained.info.config_sha256},
      {"config", trained.info.config_json},
      {"dreamsearch", DREAMSEARCH_VERSION}};
  Question question;
  question.command = "export-model";
  question.who = RunName(trained);
  const nlohmann::json answer = Ask(question, {{"spec", ToJson(spec)},
                                               {"checkpoint", trained.checkpoint.string()},
                                               {"out", out},
                                               {"metadata", metadata}});
  TextTable table(0);
  table.Row({"tensor", "shape"});
  std::uint64_t numbers = 0;
  for (const nlohmann::json& tensor : answer.at("tensors")) {
    table.Row({tensor.at("name"), ShapeText(tensor.at("shape"))});
    numbers += tensor.at("size").get<std::uint64_t>();
  }
  table.Print(std::cout);
  std::cerr << "wrote " << out << ": " << answer.at("tensors").size() << " tensors, "
            << GroupDigits(numbers) << " numbers, " << FormatBytes(answer.at("bytes").get<double>())
            << ", of " << RunName(trained) << " after " << GroupDigits(trained.env_step)
            << " environment steps\n";
  return 0;
}

int ExportModelMain() {
  return AnswerMain([](const nlohmann::json& question) {
    const RunSpec spec = RunSpecFromJson(question.at("spec"));
    const Components components(spec);
    const EnvironmentPtr environment = components.MakeEnvironment();
    const EnvironmentPtr own_environment =
        spec.model.Has(kNeedsEnvironment) ? components.MakeEnvironment() : nullptr;
    const ModelPtr model = components.MakeModel(environment->spec(), 1, own_environment.get());
    LoadModel(Checkpoint(question.at("checkpoint").get<std::string>()), spec.model.name(),
              model.get());
    TensorCollector collector;
    ThrowUnlessOk(model->Export(&collector), "model '" + spec.model.name() + "' Export");
    if (collector.tensors().empty()) {
      throw Failure(ExitCode::kBadInput, "model '" + spec.model.name() +
                                             "' has no weights to export: it exports no "
                                             "tensor");
    }
    nlohmann::json answer;
    answer["bytes"] = WriteSafetensors(question.at("out").get<std::string>(), collector.tensors(),
                                       question.at("metadata"));
    for (const NamedTensor& tensor : collector.tensors()) {
      answer["tensors"].push_back(
          {{"name", tensor.name}, {"shape", tensor.shape}, {"size", tensor.values.size()}});
    }
    return answer;
  });
}

}  // namespace dreamsearch
