// plugin.cc - the component `mjcf`, or on MuJoCo 3 `mjcf3`: the user's own model as a task.
#include "dreamsearch/plugin.h"

#include <algorithm>
#include <array>
#include <exception>
#include <memory>

#include "plugins/env_mjcf/model_task.h"
#include "plugins/mujoco/variation.h"

namespace dreamsearch::mjcf {
namespace {

constexpr auto kTaskSettings = BindSettings<ModelTaskSettings>(
    Bind<&ModelTaskSettings::name>(TextParameter(
        "task", "", "What the task is called, as in " DREAMSEARCH_MJCF_COMPONENT ":NAME.")),
    Bind<&ModelTaskSettings::model>(PathParameter(
        "model", "",
        "The model, an MJCF or URDF file. It may include files and name assets in its "
        "own folder and below.")),
    Bind<&ModelTaskSettings::actuators>(TextParameter(
        "actuators", "",
        "The actuators that actions drive, by name, separated by commas; \"\" for all. "
        "Others keep the keyframe's control, or 0.")),
    Bind<&ModelTaskSettings::observation>(
        TextParameter("observation", "",
                      "What is observed: expressions separated by commas, such as position(hip), "
                      "sensor(gyro), body(torso).z; \"\" for positions, velocities, sensors.")),
    Bind<&ModelTaskSettings::reward>(TextParameter(
        "reward", "",
        "The reward of a control step: an expression, such as tolerance(body(torso).z, "
        "lower=1.2, margin=0.6) * tolerance(control(knee), margin=1).")),
    Bind<&ModelTaskSettings::terminate>(TextParameter(
        "terminate", "",
        "Conditions separated by commas, such as body(torso).z < 0.8; where one holds, "
        "the episode ends in a terminal state.")),
    Bind<&ModelTaskSettings::keyframe>(
        TextParameter("keyframe", "",
                      "The model's keyframe that episodes begin in; \"\" for its reference pose.")),
    Bind<&ModelTaskSettings::randomise_joints>(BoolParameter(
        "randomise_joints", false,
        "Begin with every limited joint uniformly within its range and every unlimited "
        "hinge at any angle.")),
    Bind<&ModelTaskSettings::position_noise>(RealParameter(
        "position_noise", 0, 0, 100, "rad, m",
        "Standard deviation of normal noise on every joint's first position; limits are "
        "kept.")),
    Bind<&ModelTaskSettings::velocity_noise>(
        RealParameter("velocity_noise", 0, 0, 1000, "rad/s, m/s",
                      "Standard deviation of normal noise on every joint's first velocity.")),
    Bind<&ModelTaskSettings::control_step>(RealParameter(
        "control_step", 0, 0, 10, "s",
        "Simulated time of a control step, a multiple of the model's time step; 0: that "
        "time step.")),
    Bind<&ModelTaskSettings::episode_steps>(IntParameter(
        "episode_steps", 1000, 1, 1000000, "control steps", "Time limit of an episode.")),
    Bind<&ModelTaskSettings::action_low>(RealParameter(
        "action_low", 0, -1e6, 1e6, "",
        "Least control of actuators that the model does not bound; used if it is below "
        "action_high.")),
    Bind<&ModelTaskSettings::action_high>(
        RealParameter("action_high", 0, -1e6, 1e6, "", "The largest control of such actuators.")));

constexpr auto Joined() {
  constexpr View<const ParameterSpec> kTask = kTaskSettings.declared();
  constexpr View<const ParameterSpec> kVariation = mujoco::kVariationSettings.declared();
  std::array<ParameterSpec, kTask.size + kVariation.size> all{};
  std::copy_n(kVariation.data, kVariation.size, std::copy_n(kTask.data, kTask.size, all.begin()));
  return all;
}
constexpr auto kParameters = Joined();

Status Make(const EnvironmentContext& context, Environment** result) noexcept {
  *result = nullptr;
  try {
    ModelTaskSettings settings = kTaskSettings.Read(context.parameters);
    const std::string component = DREAMSEARCH_MJCF_COMPONENT;
    settings.name = settings.name.empty() ? component : component + ":" + settings.name;
    auto task = std::make_unique<ModelTask>(settings);
    task->Vary(mujoco::Variation::From(context.parameters, context.action_repeat));
    *result = task.release();
    return OkStatus();
  } catch (const std::exception& error) {
    return Error(StatusCode::kInvalidArgument, "%s", error.what());
  }
}

constexpr ComponentDescriptor kComponents[] = {
    {.kind = ComponentKind::kEnvironment,
     .name = DREAMSEARCH_MJCF_COMPONENT,
     .version = "1.0.0",
     .summary = mjVERSION_HEADER < 300
                    ? "your own MuJoCo model as a task, by parameters alone"
                    : "your own model for MuJoCo 3 as a task, by parameters alone",
     .parameters = {kParameters.data(), kParameters.size()},
     .task_parameter = "task",
     .create_environment = Make},
};

}  // namespace
}  // namespace dreamsearch::mjcf

DREAMSEARCH_PLUGIN(DREAMSEARCH_MJCF_PLUGIN, "1.0.0", dreamsearch::mjcf::kComponents)
