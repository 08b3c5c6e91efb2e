// Three tasks, three models and three planners that only declare; `dreamer` is both
// a model and a planner, as in the real plugins.
#include "dreamsearch/plugin.h"

namespace dreamsearch {
namespace {

Status NoEnvironment(const EnvironmentContext&, Environment** result) noexcept {
  *result = nullptr;
  return Error(StatusCode::kUnimplemented, "declares only");
}
Status NoModel(const ModelContext&, Model** result) noexcept {
  *result = nullptr;
  return Error(StatusCode::kUnimplemented, "declares only");
}
Status NoPlanner(const PlannerContext&, Planner** result) noexcept {
  *result = nullptr;
  return Error(StatusCode::kUnimplemented, "declares only");
}

constexpr ParameterSpec kTask[] = {BoolParameter("sparse", false, "Sparse reward.")};
constexpr ParameterSpec kModel[] = {
    RealParameter("learning_rate", 6e-4, 0, 1, "", "Of Adam.").Preset("fast", 1e-3),
    IntParameter("starts", 2500, 1, 100000, "latents", "Imagined from.").Preset("fast", 256),
    RealParameter("noise", 0.1, 0, 1, "", "Shared with the planner of this name.")};
constexpr ParameterSpec kActor[] = {
    RealParameter("noise", 0.3, 0, 10, "", "Exploration noise."),
    ChoiceParameter("noise_on", "mode", "mode,sample", "What it is added to.")};
constexpr ParameterSpec kSearch[] = {
    RealParameter("noise", 0.3, 0, 10, "", "Exploration noise.").Preset("paper", 0.25),
    IntParameter("simulations", 50, 1, 1000000, "simulations", "A decision's.").Preset("fast", 40),
    ChoiceParameter("first_play", "parent", "parent,zero", "An unvisited edge's Q.")
        .Preset("fast", "zero")};
constexpr ParameterSpec kBridge[] = {
    TextParameter("id", "none", "What to play."), PathParameter("model", "", "A file."),
    PathParameter("module", ".py,.pyc", "A file or a name."),
    RealParameter("gravity", 1, 0, 10, "", "A changed world.").Variation(),
    RealParameter("size", 1, 0, 10, "", "Another task.")};
constexpr ParameterSpec kCem[] = {IntParameter("candidates", 1000, 1, 100000, "", "Sequences.")};

constexpr RunPreset kWishes[] = {{"batch_size", "fast", 256},
                                 {"sequence_length", "fast", 4},
                                 {"batch_size", "paper", 128},
                                 {"action_repeat", "paper", 4}};
constexpr RunPreset kHabits[] = {{"action_repeat", "fast", 1}, {"action_repeat", "paper", 1}};
constexpr RunPreset kUnknown[] = {{"batch_sise", "fast", 256}};
constexpr RunPreset kTooLarge[] = {{"batch_size", "paper", 5000}};

constexpr ComponentDescriptor ModelOf(const char* name, View<const RunPreset> run_presets) {
  return {.kind = ComponentKind::kModel,
          .traits = kLearns,
          .name = name,
          .version = "1",
          .summary = "A model.",
          .run_presets = run_presets,
          .create_model = NoModel};
}
constexpr ComponentDescriptor Task(const char* name, const char* aliases,
                                   View<const ParameterSpec> parameters = ViewOf(kTask),
                                   const char* task_parameter = nullptr,
                                   View<const RunPreset> run_presets = {}) {
  return {.kind = ComponentKind::kEnvironment,
          .name = name,
          .aliases = aliases,
          .version = "1",
          .summary = "A task.",
          .parameters = parameters,
          .run_presets = run_presets,
          .task_parameter = task_parameter,
          .create_environment = NoEnvironment};
}
constexpr ComponentDescriptor PlannerOf(const char* name, View<const ParameterSpec> parameters) {
  return {.kind = ComponentKind::kPlanner,
          .name = name,
          .version = "1",
          .summary = "A planner.",
          .parameters = parameters,
          .create_planner = NoPlanner};
}

constexpr ComponentDescriptor kComponents[] = {
    Task("walker_walk", nullptr),
    Task("cup_catch", "ball_in_cup_catch"),
    Task("bridge", nullptr, ViewOf(kBridge), "id", ViewOf(kHabits)),
    {.kind = ComponentKind::kModel,
     .traits = kLearns | kDefault,
     .name = "dreamer",
     .version = "1",
     .summary = "A model.",
     .parameters = ViewOf(kModel),
     .create_model = NoModel},
    {.kind = ComponentKind::kModel,
     .traits = kNeedsEnvironment | kDefault,
     .name = "oracle",
     .version = "1",
     .summary = "A model.",
     .create_model = NoModel},
    {.kind = ComponentKind::kModel,
     .traits = kLearns,
     .name = "another",
     .version = "1",
     .summary = "A model that must be named.",
     .create_model = NoModel},
    ModelOf("wishing", ViewOf(kWishes)),
    ModelOf("misspelling", ViewOf(kUnknown)),
    ModelOf("exaggerating", ViewOf(kTooLarge)),
    PlannerOf("dreamer", ViewOf(kActor)),
    PlannerOf("mcts_pw", ViewOf(kSearch)),
    PlannerOf("cem", ViewOf(kCem))};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("settings_plugin", "1.0.0", dreamsearch::kComponents)
