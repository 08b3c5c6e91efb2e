// plugin.cc - the components `gym` and `dm`: Python environments by their name.
#include "dreamsearch/plugin.h"

#include <exception>

#include "dreamsearch/settings.h"
#include "plugins/env_gym/python_environment.h"

namespace dreamsearch::gym {
namespace {

using Settings = PythonEnvironmentSettings;

constexpr auto kInterpreter = Bind<&Settings::interpreter>(
    TextParameter("python", "python3",
                  "The Python that has the environment's packages: a path, such as "
                  "/home/me/venv/bin/python, or a name in PATH."));
constexpr auto kArguments = Bind<&Settings::arguments>(
    TextParameter("arguments", "{}",
                  "Keyword arguments of the environment, a JSON object such as {\"g\": 9.8}."));
constexpr auto kEpisodeSteps = Bind<&Settings::episode_steps>(
    IntParameter("episode_steps", 0, 0, 1000000, "environment steps",
                 "Time limit of an episode; 0: the environment's own, or 1000 if it has none."));
constexpr auto kActionLow = Bind<&Settings::action_low>(
    RealParameter("action_low", 0, -1e6, 1e6, "",
                  "Least value of each action that the environment does not bound; used if it is "
                  "below action_high."));
constexpr auto kActionHigh = Bind<&Settings::action_high>(
    RealParameter("action_high", 0, -1e6, 1e6, "", "The largest value of such actions."));

// These environments repeat actions themselves where they want to.
constexpr RunPreset kRunPresets[] = {{"action_repeat", "fast", 1}, {"action_repeat", "paper", 1}};

constexpr auto kGymSettings = BindSettings<Settings>(
    Bind<&Settings::id>(TextParameter(
        "id", "",
        "What to play: a registered name such as Hopper-v5; or, with `module`, the name of a "
        "class there.")),
    Bind<&Settings::module>(PathParameter(
        "module", ".py",
        "A module that defines or registers `id`: the path of a .py file, or the dotted name of "
        "one that is installed; \"\" for what Gymnasium itself has registered.")),
    kInterpreter, kArguments, kEpisodeSteps, kActionLow, kActionHigh);

constexpr auto kSuiteSettings = BindSettings<Settings>(
    Bind<&Settings::id>(TextParameter("id", "", "The task: domain-task, such as walker-walk.")),
    kInterpreter, kArguments, kEpisodeSteps, kActionLow, kActionHigh);

template <typename Table>
Status Make(const char* kind, const Table& table, const EnvironmentContext& context,
            Environment** result) noexcept {
  *result = nullptr;
  Settings settings;
  try {
    settings = table.Read(context.parameters);
    settings.kind = kind;
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
  return Make("gym", kGymSettings, context, result);
}

Status MakeSuite(const EnvironmentContext& context, Environment** result) noexcept {
  return Make("dm", kSuiteSettings, context, result);
}

constexpr ComponentDescriptor kComponents[] = {
    {.kind = ComponentKind::kEnvironment,
     .name = "gym",
     .version = "1.0.0",
     .summary = "any environment of the Gymnasium interface, in a Python process",
     .parameters = kGymSettings.declared(),
     .run_presets = ViewOf(kRunPresets),
     .task_parameter = "id",
     .create_environment = MakeGym},
    {.kind = ComponentKind::kEnvironment,
     .name = "dm",
     .version = "1.0.0",
     .summary = "a task of Python's dm_control.suite, in a Python process",
     .parameters = kSuiteSettings.declared(),
     .run_presets = ViewOf(kRunPresets),
     .task_parameter = "id",
     .create_environment = MakeSuite},
};

}  // namespace
}  // namespace dreamsearch::gym

DREAMSEARCH_PLUGIN("env_gym", "1.0.0", dreamsearch::gym::kComponents)
