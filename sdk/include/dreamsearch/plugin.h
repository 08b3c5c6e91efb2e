// plugin.h - what a shared library exports to be a dreamsearch plugin.
//
// A library exports one C function, `dreamsearch_sdk_1` (named after the SDK's
// major version), that returns its PluginDescriptor. Everything else is hidden. The descriptor and
// all it points to are constant and live as long as the library, which the host keeps loaded until
// it exits.
//
//   const ComponentDescriptor kComponents[] = {{ .kind = ..., .name = ... }};
//   DREAMSEARCH_PLUGIN("my_planner", "1.0.0", kComponents)
#pragma once

#include <cstddef>
#include <cstdint>

#include "dreamsearch/environment.h"
#include "dreamsearch/model.h"
#include "dreamsearch/parameter.h"
#include "dreamsearch/planner.h"
#include "dreamsearch/status.h"
#include "dreamsearch/version.h"
#include "dreamsearch/view.h"

namespace dreamsearch {

enum class ComponentKind : std::uint32_t { kEnvironment = 1, kModel = 2, kPlanner = 3 };

inline const char* ComponentKindName(ComponentKind kind) noexcept {
  switch (kind) {
    case ComponentKind::kEnvironment:
      return "environment";
    case ComponentKind::kModel:
      return "model";
    case ComponentKind::kPlanner:
      return "planner";
  }
  return "unknown";
}

// What the host must know of a component to run it and to name what it did: bits of
// ComponentDescriptor::traits, joined with |. A bit that a component's kind does not have
// is refused.
enum Trait : std::uint32_t {
  // Planners. kSearches: looks ahead in the model; a planner without it may not call
  // Imagine. kActorAlone: chooses by the actor alone, exploration aside, so that its
  // episodes are those without search and are played once; excludes kSearches. A planner
  // with neither (random actions) is compared with the actor alone, as a search is.
  // kReportsPolicy: offers PolicyReporting. kNeedsGradients: plans only with a model that
  // gives gradients.
  kSearches = 1u << 0,
  kActorAlone = 1u << 1,
  // Models. kLearns: Train changes it; of a model without it Train is never called.
  // kNeedsEnvironment: see ModelContext::environment. kDefault: a command that names no
  // model takes this one; to train the one that learns, to play without a trained run the
  // one that does not. kLearnsFromSearch: Train uses the searches of a SequenceBatch.
  // kGivesGradients: offers ReturnGradient.
  kLearns = 1u << 2,
  kNeedsEnvironment = 1u << 3,
  kDefault = 1u << 4,
  kReportsPolicy = 1u << 5,
  kLearnsFromSearch = 1u << 6,
  kGivesGradients = 1u << 7,
  kNeedsGradients = 1u << 8,
};

// The bits that a component of that kind may have.
constexpr std::uint32_t TraitsOf(ComponentKind kind) noexcept {
  switch (kind) {
    case ComponentKind::kEnvironment:
      return 0;
    case ComponentKind::kModel:
      return kLearns | kNeedsEnvironment | kDefault | kLearnsFromSearch | kGivesGradients;
    case ComponentKind::kPlanner:
      return kSearches | kActorAlone | kReportsPolicy | kNeedsGradients;
  }
  return 0;
}

struct EnvironmentContext {
  Parameters parameters;
  std::uint32_t action_repeat = 1;  // environment steps a decision; the host repeats
  std::uint64_t struct_size = sizeof(EnvironmentContext);
};

struct ModelContext {
  Parameters parameters;
  std::uint64_t observation_size = 0;   // O
  std::uint64_t action_size = 0;        // A
  std::uint32_t action_repeat = 1;      // environment steps a decision
  std::uint32_t episode_decisions = 0;  // decisions in an episode
  bool terminates = false;              // of the environment's spec
  std::uint64_t seed = 0;               // initial parameters
  // Only for a model with kNeedsEnvironment: an environment of its own, which it
  // does not destroy and which outlives it; otherwise null.
  Environment* environment = nullptr;
  // Only for such a model, and only if the run names a trained run: that run's
  // model, for proposal and value; otherwise null. Outlives it.
  Model* trained_model = nullptr;
  std::uint64_t struct_size = sizeof(ModelContext);
};

struct PlannerContext {
  Parameters parameters;
  std::uint64_t action_size = 0;   // A
  std::uint64_t latent_bytes = 0;  // of the model it will plan with
  std::uint64_t struct_size = sizeof(PlannerContext);
};

// What a model or an environment asks of the host under a preset: the value of one of the host's
// own parameters, `run.*` (`runner describe run` lists them). It stands above what the host
// declares for the preset and below configuration file and command line; an environment's stands
// above a model's.
struct RunPreset {
  const char* name = nullptr;    // of the parameter: "batch_size"
  const char* preset = nullptr;  // "fast"
  double number = 0;
  // Later fields go here.
};

// Factories return an object that its Destroy() ends, or a failed Status that
// says what is wrong with the settings; *result is then null.
using EnvironmentFactory = Status (*)(const EnvironmentContext& context,
                                      Environment** result) noexcept;
using ModelFactory = Status (*)(const ModelContext& context, Model** result) noexcept;
using PlannerFactory = Status (*)(const PlannerContext& context, Planner** result) noexcept;

// One thing a plugin offers. Exactly the factory of its kind is set.
struct ComponentDescriptor {
  ComponentKind kind = ComponentKind::kEnvironment;
  std::uint32_t traits = 0;       // bits of Trait
  const char* name = nullptr;     // [a-z][a-z0-9_]*, unique among components of its kind
  const char* aliases = nullptr;  // other names, "one,two"; may be null
  const char* version = nullptr;  // of the component
  const char* summary = nullptr;  // one line
  Records<ParameterSpec> parameters{};
  Records<MetricSpec> metrics{};     // what Plan or Train reports
  Records<RunPreset> run_presets{};  // of models and environments
  // Environments that play many things: the text parameter that says which. The task is then
  // called NAME:TEXT, "gym:Hopper-v5", in command lines, databases and figures.
  const char* task_parameter = nullptr;
  EnvironmentFactory create_environment = nullptr;
  ModelFactory create_model = nullptr;
  PlannerFactory create_planner = nullptr;
  // Later fields go here.
};

inline constexpr std::uint64_t kPluginMagic = 0x6d61657264534e50ull;

// The first four fields keep their place in every version.
struct PluginDescriptor {
  std::uint64_t magic = kPluginMagic;
  std::uint32_t sdk_major = DREAMSEARCH_SDK_MAJOR;
  std::uint32_t sdk_minor = DREAMSEARCH_SDK_MINOR;
  std::uint64_t struct_size = sizeof(PluginDescriptor);
  const char* name = nullptr;
  const char* version = nullptr;
  Records<ComponentDescriptor> components;
  // Later fields go here.
};

using PluginEntry = const PluginDescriptor* (*)();

inline constexpr const char* kPluginEntrySymbol = "dreamsearch_sdk_1";

template <std::uint64_t N, typename T>
constexpr View<const T> ViewOf(const T (&array)[N]) noexcept {
  return {array, N};
}

}  // namespace dreamsearch

// Exports `components`, an array of ComponentDescriptor with static storage.
#define DREAMSEARCH_PLUGIN(plugin_name, plugin_version, plugin_components)                 \
  extern "C" __attribute__((visibility("default"))) const ::dreamsearch::PluginDescriptor* \
  dreamsearch_sdk_1() {                                                                    \
    static constexpr ::dreamsearch::PluginDescriptor descriptor = {                        \
        .name = plugin_name,                                                               \
        .version = plugin_version,                                                         \
        .components = ::dreamsearch::ViewOf(plugin_components)};                           \
    return &descriptor;                                                                    \
  }

#include "dreamsearch/layout.h"  // IWYU pragma: keep
