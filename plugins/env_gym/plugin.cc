// plugin.cc - the components `gym` and `dm`: Python environments by their name.
#include "dreamsearch/plugin.h"

#include <exception>

#include "plugins/env_gym/python_environment.h"

namespace dreamsearch::gym {
namespace {

constexpr ParameterSpec Interpreter() {
  return TextParameter("python", "python3",
                       "The Python that has the environment's packages: a path, such as "
                       "/home/me/venv/bin/python, or a name in PATH.");
}
constexpr ParameterSpec Arguments() {
  return TextParameter("arguments", "{}",
                       "Keyword arguments of the environment, a JSON object such as "
                       "{\"g\": 9.8}.");
}
constexpr ParameterSpec EpisodeSteps() {
  return IntParameter("episode_steps", 0, 0, 1000000, "environment steps",
                      "Time limit of an episode; 0: the environment's own, or 1000 if it has "
                      "none.");
}

constexpr ParameterSpec ActionLow() {
  return RealParameter("action_low", 0, -1e6, 1e6, "",
                       "Least value of each action that the environment does not bound; used if "
                       "it is below action_high.");
}
constexpr ParameterSpec ActionHigh() {
  return RealParameter("action_high", 0, -1e6, 1e6, "", "The largest value of such actions.");
}

// These environments repeat actions themselves where they want to.
constexpr RunPreset kRunPresets[] = {{"action_repeat", "fast", 1}, {"action_repeat", "paper", 1}};

constexpr ParameterSpec kGymParameters[] = {
    TextParameter("id", "",
                  "What to play: a registered name such as Hopper-v5; or, with `module`, the name "
                  "of a class there."),
    PathParameter("module", ".py",
                  "A module that defines the class `id`: the path of a .py file, or a dotted "
                  "name; \"\" for what is registered with Gymnasium."),
    Interpreter(),
    Arguments(),
    EpisodeSteps(),
    ActionLow(),
    ActionHigh(),
};

constexpr ParameterSpec kSuiteParameters[] = {
    TextParameter("id", "", "The task: domain-task, such as walker-walk."),
    Interpreter(),
    Arguments(),
    EpisodeSteps(),
    ActionLow(),
    ActionHigh(),
};

Status Make(PythonEnvironmentSettings settings, const Parameters& parameters,
            Environment** result) noexcept {
  *result = nullptr;
  try {
    settings.id = parameters.GetText("id");
    settings.interpreter = parameters.GetText("python");
    settings.arguments = parameters.GetText("arguments");
    settings.episode_steps = static_cast<std::uint32_t>(parameters.GetInt("episode_steps"));
    settings.action_low = parameters.GetReal("action_low");
    settings.action_high = parameters.GetReal("action_high");
    if (settings.id.empty()) {
      return Error(StatusCode::kInvalidArgument,
                   "expected the environment's name in the setting 'id', found nothing");
    }
    *result = new PythonEnvironment(settings);
    return OkStatus();
  } catch (const std::exception& error) {
    return Error(StatusCode::kInvalidArgument, "%s: %s", settings.id.c_str(), error.what());
  }
}

Status MakeGym(const EnvironmentContext& context, Environment** result) noexcept {
  const Parameters& parameters = context.parameters;
  PythonEnvironmentSettings settings;
  settings.kind = "gym";
  settings.module = parameters.GetText("module");
  return Make(std::move(settings), parameters, result);
}

Status MakeSuite(const EnvironmentContext& context, Environment** result) noexcept {
  PythonEnvironmentSettings settings;
  settings.kind = "dm";
  return Make(std::move(settings), context.parameters, result);
}

constexpr ComponentDescriptor kComponents[] = {
    {.kind = ComponentKind::kEnvironment,
     .name = "gym",
     .version = "1.0.0",
     .summary = "any environment of the Gymnasium interface, in a Python process",
     .parameters = ViewOf(kGymParameters),
     .run_presets = ViewOf(kRunPresets),
     .task_parameter = "id",
     .create_environment = MakeGym},
    {.kind = ComponentKind::kEnvironment,
     .name = "dm",
     .version = "1.0.0",
     .summary = "a task of Python's dm_control.suite, in a Python process",
     .parameters = ViewOf(kSuiteParameters),
     .run_presets = ViewOf(kRunPresets),
     .task_parameter = "id",
     .create_environment = MakeSuite},
};

}  // namespace
}  // namespace dreamsearch::gym

DREAMSEARCH_PLUGIN("env_gym", "1.0.0", dreamsearch::gym::kComponents)
