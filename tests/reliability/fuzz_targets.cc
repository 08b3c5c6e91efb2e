// What each target of fuzz.cc reads.
#include <sys/wait.h>

#include <cstdio>
#include <iostream>
#include <iterator>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "host/flags/run_flags.h"
#include "host/plugins/descriptor_check.h"
#include "host/plugins/elf.h"
#include "host/plugins/received_plugin.h"
#include "host/saving/checkpoint.h"
#include "host/settings/run_parameters.h"
#include "host/settings/run_spec.h"
#include "host/sweeps/run_file.h"
#include "host/training/replay.h"
#include "plugins/env_mjcf/expression.h"
#include "results/analysis/published.h"
#include "results/command_line/flags_file.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/sha256.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"
#include "tests/reliability/fuzz.h"

namespace dreamsearch {
namespace {

// `call` may refuse with this code.
template <typename Call>
void MayRefuse(ExitCode code, const Call& call) {
  try {
    call();
  } catch (const Failure& error) {
    if (error.code() != code) throw;
    ++refusals;
  }
}

ResolvedValues DefaultRun() {
  ResolvedValues values;
  for (const ParameterSpec& spec : kRunParameters) {
    const ParameterInfo info = DescribeParameter(spec);
    values.values.push_back({info.name, info.type, info.default_number, info.default_choice, ""});
  }
  return values;
}

RunFile ExampleRunFile() {
  RunFile file;
  RunSpec& spec = file.spec;
  spec.study = "study";
  spec.preset = "fast";
  for (ResolvedComponent* component :
       {&spec.environment, &spec.model, &spec.planner, &spec.eval_planner}) {
    ComponentInfo info;
    info.name = "name";
    info.plugin.path = "/plugins/x.so";
    info.parameters.push_back(DescribeParameter(kRunParameters[0]));
    component->info = std::make_shared<const ComponentInfo>(info);
    component->parameters.values.push_back({"steps", ParameterType::kInt, 100, "", ""});
  }
  spec.run = DefaultRun();
  file.retries.push_back({});
  return file;
}

Target Configuration() {
  const std::string run_file = results::JsonText(results::FieldsToJson(ExampleRunFile()), 2);
  const std::string flags =
      "# a sweep\nenv = walker_walk\nplanner = cem\nseeds = 3\nset = run.steps=100\nsteps = 1000\n";
  std::vector<ParameterInfo> parameters;
  for (const ParameterSpec& spec : kRunParameters) parameters.push_back(DescribeParameter(spec));
  struct Command {
    RunOptions options;
    CommandSpec spec = RunFlags(&options);
  };
  const auto command = std::make_shared<Command>();
  return [=, path = MemoryPath()](Random* random) {
    MayRefuse(ExitCode::kBadInput,
              [&] { ReadFlagsFile(command->spec, path.Holding(Changed(flags, random))); });
    const std::string changed = Changed(run_file, random);
    const nlohmann::json stored = results::ParseJsonOrDiscard(changed);
    if (stored.is_structured()) results::JsonTextReplacing(stored.flatten());
    try {
      const auto file = results::FieldsFromJson<RunFile>(results::ParseJson(changed));
      CheckValues(file.spec.run, parameters, "run.");
      CheckValues(file.spec.model.parameters, {parameters[0]}, "model.");
      ConfigurationSha256(file.spec);
      ParameterStorage(file.spec.model.parameters);
    } catch (const nlohmann::json::exception&) {
      ++refusals;  // ReadRunFile makes a sentence of it
    }
  };
}

Target Descriptor() {
  static const ParameterSpec parameters[] = {IntParameter("k", 3, 1, 10, "", "Help."),
                                             TextParameter("t", "x", "Help.")};
  PluginDescription description;
  ComponentInfo component;
  component.name = "name";
  component.parameters.push_back(DescribeParameter(parameters[0]));
  description.components.push_back(component);
  const std::string text = results::JsonText(results::FieldsToJson(description));
  const std::string elf = ReadWholeFile(DREAMSEARCH_SMALL_LIBRARY);
  return [=, path = MemoryPath()](Random* random) {
    MayRefuse(ExitCode::kPluginRefused,
              [&] { CheckSharedLibrary(path.Holding(Changed(elf, random))); });
    try {
      results::FieldsFromJson<PluginDescription>(results::ParseJson(Changed(text, random)));
    } catch (const nlohmann::json::exception&) {
      ++refusals;
    }
    // A descriptor whose texts and numbers are odd, in memory that is there.
    std::vector<std::string> texts(8);
    for (std::string& one : texts) one = Changed("name,two", random).c_str();
    const auto text_or_null = [&] {
      return random->Below(8) == 0 ? nullptr : texts[random->Below(texts.size())].c_str();
    };
    const auto number = [&] {
      const double numbers[] = {0,      1,   -1,   1e300,
                                -1e300, 0.5, 1e18, std::numeric_limits<double>::quiet_NaN()};
      return numbers[random->Below(std::size(numbers))];
    };
    std::vector<ParameterSpec> specs(1 + random->Below(3), parameters[random->Below(2)]);
    for (ParameterSpec& spec : specs) {
      if (random->Below(3) == 0) spec.name = text_or_null();
      if (random->Below(3) == 0) spec.help = text_or_null();
      if (random->Below(3) == 0) spec.default_choice = text_or_null();
      if (random->Below(3) == 0) spec.default_number = number();
      if (random->Below(3) == 0) spec.min = number();
      if (random->Below(3) == 0) spec.max = number();
      if (random->Below(3) == 0) spec.type = static_cast<ParameterType>(random->Below(300));
    }
    ComponentDescriptor odd;
    odd.kind = static_cast<ComponentKind>(random->Below(5));
    odd.traits = static_cast<std::uint32_t>(random->Below(1u << 31));
    odd.name = text_or_null();
    odd.aliases = text_or_null();
    odd.version = text_or_null();
    odd.summary = text_or_null();
    odd.parameters = {specs.data(), specs.size()};
    odd.task_parameter = text_or_null();
    const std::uint64_t sizes[] = {0, 7, 64, UINT64_MAX, 1ull << 40};
    if (random->Below(8) == 0) odd.parameters.stride = sizes[random->Below(std::size(sizes))];
    PluginDescriptor plugin;
    if (random->Below(8) == 0) plugin.struct_size = sizes[random->Below(4)];
    plugin.sdk_minor = static_cast<std::uint32_t>(random->Below(3));
    plugin.name = text_or_null();
    plugin.version = text_or_null();
    plugin.components = {&odd, 1};
    const ReceivedPlugin received(&plugin, "/plugins/x.so");
    CheckDeclarations(received.plugin(), "/plugins/x.so");
  };
}

// A checkpoint of these parts with the checksums that belong to them, as checkpoint.h lays it out.
std::string Signed(const std::map<std::string, std::string>& parts) {
  std::string file;
  CheckpointWriter([&](std::string_view piece) { file.append(piece); });  // magic and build
  std::string list;
  StateWriter writer([&](std::string_view piece) { list.append(piece); });
  Sha256 frame;
  frame.Add(file);
  const std::uint64_t count = parts.size();
  writer("count", &count);
  for (const auto& [name, bytes] : parts) {
    const std::uint32_t version = 1;
    const std::uint64_t size = bytes.size();
    const std::string sha256 = Sha256Hex(bytes);
    writer("part", &name);
    writer("version", &version);
    writer("bytes", &size);
    writer("sha256", &sha256);
    file += bytes;
  }
  writer.Flush();
  frame.Add(list);
  const auto digest = frame.Finish();
  const std::uint64_t list_bytes = list.size();
  file += list;
  file.append(reinterpret_cast<const char*>(digest.data()), digest.size());
  file.append(reinterpret_cast<const char*>(&list_bytes), sizeof list_bytes);
  return file + "DSCKPEND";
}

Target CheckpointFile() {
  // The parts of a run's checkpoint, as bytes.
  Replay replay(3, 2, 64, 0);
  const double observation[] = {1, 2, 3}, action[] = {0.5, -0.5};
  for (int episode = 0; episode < 3; ++episode) {
    replay.BeginEpisode({observation, 3});
    for (int t = 0; t < 9; ++t) replay.Add({action, 2}, 1, 1, {observation, 3});
    replay.EndEpisode();
  }
  std::map<std::string, std::string> parts;
  const auto add = [&](const char* name, const std::function<void(StateWriter*)>& write) {
    std::string bytes;
    StateWriter writer([&](std::string_view piece) { bytes.append(piece); });
    write(&writer);
    writer.Flush();
    parts[name] = bytes;
  };
  CheckpointHeader header;
  header.run = "9b2f0c1e-0000-4000-8000-000000000000";
  header.plugins["x"] = std::string(64, 'a');
  add("header", [&](StateWriter* writer) { header.Fields(writer); });
  add("replay", [&](StateWriter* writer) { replay.Save(writer); });
  std::map<std::uint64_t, std::string> trees = {{1, "{}"}, {2, "{}"}};
  add("trees", [&](StateWriter* writer) { VisitMap(writer, "trees", &trees); });
  std::vector<std::string> names;
  for (const auto& [name, bytes] : parts) names.push_back(name);
  return [=, path = MemoryPath()](Random* random) {
    // Changed before the checksums are made: a damaged part is found by those alone.
    const std::string& which = names[random->Below(names.size())];
    std::map<std::string, std::string> changed = parts;
    changed[which] = Changed(changed[which], random);
    std::string file = Signed(changed);
    if (random->Below(8) == 0) file = Changed(file, random);
    const Checkpoint checkpoint(path.Holding(file));
    checkpoint.Verify();
    checkpoint.Value<CheckpointHeader>(kHeaderPart);
    checkpoint.Read({"replay", 1}, [&](StateReader* part) {
      const std::unique_ptr<Replay> read = Replay::Read(0, part);
      for (int i = 0; i < 4; ++i) {
        const SequenceBatch batch = read->Sample(2, 3, random->Below(1000));
        read->DecisionOf(random->Below(batch.sequences * batch.length));
      }
    });
    checkpoint.Read({"trees", 1}, [](StateReader* part) {
      std::map<std::uint64_t, std::string> read;
      VisitMap(part, "trees", &read);
    });
  };
}

Target Importer() {
  const std::string lists[] = {
      R"([{"task":"dmc_walker_walk","method":"d4pg","seed":"0","xs":[1,2],"ys":[3.5,4]}])",
      "step,reward,seed\n1000,3.5,0\n2000,4,1\n",
      "source,method,obs,task,env_steps,seed,episode_return,n_seeds,seed_sd\n"
      "a,b,pixels,walker_walk,1000,0,3.5,,\n"};
  return [=](Random* random) {
    const std::string& list = lists[random->Below(3)];
    results::ImportSettings settings;
    settings.source = "source";
    settings.method = "method";
    settings.steps_per_unit = random->Below(4) == 0 ? 1'000'000'000 : 1;
    const char* const paths[] = {"a.json", "a.csv", "walker-walk.csv", "a.json.gz"};
    results::ParsePublished(paths[random->Below(4)], Changed(list, random), settings);
  };
}

constexpr char kModel[] = R"(<mujoco model="m"><worldbody><body name="b" pos="0 0 1">
<joint name="hinge" type="hinge" axis="0 1 0"/><geom name="g" type="sphere" size="0.1"/>
<site name="s"/></body></worldbody><actuator><motor name="a" joint="hinge"/></actuator>
<sensor><jointpos name="p" joint="hinge"/></sensor></mujoco>)";

mjModel* Compiled(const std::string& path) {
  char error[1000];
  return mj_loadXML(path.c_str(), nullptr, error, sizeof error);
}

Target ModelFile() {
  const MemoryPath path;
  const std::shared_ptr<mjModel> model(Compiled(path.Holding(kModel)), mj_deleteModel);
  if (model == nullptr) std::abort();
  const std::shared_ptr<mjData> data(mj_makeData(model.get()), mj_deleteData);
  const std::string texts[] = {"tolerance(height(b), 1.2, inf, 0.6) * 2 - abs(p)",
                               "position, velocity, height(b)", "height(b) < 0.5, p > 1", "a, -a"};
  static std::uint64_t crashed = 0;
  static int turn = 0;
  return [=](Random* random) {
    const std::string text = Changed(texts[random->Below(std::size(texts))], random);
    const auto refuses = [](const auto& call) {
      try {
        call();
      } catch (const mjcf::ExpressionError&) {
        ++refusals;
      }
    };
    refuses([&] { mjcf::ParseNumber(text, *model)->Evaluate(*model, *data); });
    refuses([&] { mjcf::ParseList(text, *model); });
    refuses([&] { mjcf::ParseConditions(text, *model); });
    refuses([&] { mjcf::ParseActuators(text, *model); });
    // A process each: a thousand times as slow.
    if (++turn % 500 != 0) return;
    const std::string file = Changed(kModel, random);
    const pid_t child = ::fork();
    if (child == 0) {
      ::alarm(10);
      std::freopen("/dev/null", "w", stderr);
      mj_deleteModel(Compiled(path.Holding(file)));
      ::_exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    if (WIFSIGNALED(status) || WEXITSTATUS(status) != 0) {
      std::cerr << "MuJoCo's parser ended its process (status " << status << "), " << ++crashed
                << " so far, for: " << file.substr(0, 120) << "...\n";
    }
  };
}

}  // namespace

const std::map<std::string, Target (*)()>& Targets() {
  static const std::map<std::string, Target (*)()> targets = {{"configuration", Configuration},
                                                              {"descriptor", Descriptor},
                                                              {"checkpoint", CheckpointFile},
                                                              {"importer", Importer},
                                                              {"model_file", ModelFile}};
  return targets;
}

}  // namespace dreamsearch
