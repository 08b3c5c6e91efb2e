#include "plugins/env_mjcf/model_task.h"

#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "plugins/env_mjcf/model_folder.h"

namespace dreamsearch::mjcf {
namespace {

using mujoco::NumpyRandom;

// Adds the setting's name to what goes wrong with it.
template <typename Make>
auto Setting(const char* name, const Make& make) {
  try {
    return make();
  } catch (const ExpressionError& error) {
    throw ExpressionError(std::string(name) + ": " + error.what());
  }
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

int SubstepsOf(double control_step, double timestep) {
  if (control_step == 0) return 1;
  const double steps = std::round(control_step / timestep);
  if (steps < 1 || steps > 100000 || std::abs(steps * timestep - control_step) > 1e-9) {
    throw std::invalid_argument("control_step: expected a multiple of the model's time step of " +
                                Number(timestep) + " s, found " + Number(control_step));
  }
  return static_cast<int>(steps);
}

}  // namespace

struct ModelTask::Parsed {
  mujoco::TaskSettings task;
  std::vector<Named> observation;
  ExpressionPtr reward;
  std::vector<Condition> terminate;
  int keyframe = -1;

  explicit Parsed(const ModelTaskSettings& settings);
  void TakeActions(const ModelTaskSettings& settings);
};

ModelTask::Parsed::Parsed(const ModelTaskSettings& settings) {
  if (settings.model.empty()) {
    throw std::invalid_argument("expected the path of a model file in the setting 'model'");
  }
  if (settings.reward.empty()) {
    throw std::invalid_argument(
        "expected an expression in the setting 'reward', such as tolerance(body(torso).z, "
        "lower=1.2, margin=0.6)");
  }
  task.name = settings.name;
  FolderModel compiled = CompileInFolder(settings.model);
  task.model = std::move(compiled.model);
  task.made_of = std::move(compiled.files);
  task.made_of["MuJoCo"] = mj_versionString();
  const mjModel& model = *task.model;
  task.substeps = SubstepsOf(settings.control_step, model.opt.timestep);
  task.episode_steps = settings.episode_steps;
  task.return_low = task.return_high = 0;
  TakeActions(settings);
  observation = Setting("observation", [&] { return ParseList(settings.observation, model); });
  if (observation.empty()) {
    observation = ParseList(
        model.nsensordata > 0 ? "positions, velocities, sensors" : "positions, velocities", model);
  }
  for (const Named& part : observation) {
    task.observation.push_back({part.text, part.expression->size()});
  }
  reward = Setting("reward", [&] { return ParseNumber(settings.reward, model); });
  terminate = Setting("terminate", [&] { return ParseConditions(settings.terminate, model); });
  task.terminates = !terminate.empty();
  if (!settings.keyframe.empty()) {
    keyframe = Setting("keyframe", [&] { return ParseKeyframe(settings.keyframe, model); });
  }
  for (int i = 0; settings.randomise_joints && i < model.njnt; ++i) {
    if (model.jnt_type[i] != mjJNT_BALL) continue;
    throw std::invalid_argument(
        "randomise_joints: the model has a ball joint, which has no range to draw from; "
        "expected position_noise instead");
  }
}

void ModelTask::Parsed::TakeActions(const ModelTaskSettings& settings) {
  const mjModel& model = *task.model;
  if (model.nu == 0) throw std::invalid_argument("the model has no actuators");
  task.actuators = Setting("actuators", [&] { return ParseActuators(settings.actuators, model); });
  for (int i = 0; settings.actuators.empty() && i < model.nu; ++i) task.actuators.push_back(i);
  for (const int i : task.actuators) {
    double low = model.actuator_ctrlrange[2 * i];
    double high = model.actuator_ctrlrange[2 * i + 1];
    if (!model.actuator_ctrllimited[i] || !(low < high)) {
      low = settings.action_low;
      high = settings.action_high;
    }
    if (!(low < high)) {
      const char* name = mj_id2name(&model, mjOBJ_ACTUATOR, i);
      throw std::invalid_argument(
          "actuator " + (name == nullptr ? std::to_string(i) : "'" + std::string(name) + "'") +
          " has no control range; give it a ctrlrange in the model, or set "
          "action_low and action_high");
    }
    task.action_low.push_back(low);
    task.action_high.push_back(high);
  }
}

ModelTask::ModelTask(const ModelTaskSettings& settings) : ModelTask(settings, Parsed(settings)) {}

ModelTask::ModelTask(const ModelTaskSettings& settings, Parsed parsed)
    : ControlTask(std::move(parsed.task)),
      observation_(std::move(parsed.observation)),
      reward_(std::move(parsed.reward)),
      terminate_(std::move(parsed.terminate)),
      keyframe_(parsed.keyframe),
      randomise_joints_(settings.randomise_joints),
      position_noise_(settings.position_noise),
      velocity_noise_(settings.velocity_noise) {}

void ModelTask::Observe(double* out) const {
  for (const Named& part : observation_) {
    mju_copy(out, part.expression->Evaluate(*model(), *data()),
             static_cast<int>(part.expression->size()));
    out += part.expression->size();
  }
}

double ModelTask::Reward() const { return *reward_->Evaluate(*model(), *data()); }

bool ModelTask::Terminated() const {
  for (const Condition& condition : terminate_) {
    if (condition.Holds(*model(), *data())) return true;
  }
  return false;
}

void ModelTask::DrawInitialState(NumpyRandom& random) {
  if (keyframe_ >= 0) {
    mj_resetDataKeyframe(model(), data(), keyframe_);
    data()->time = 0;
  }
  if (randomise_joints_) RandomiseJoints(random);
  if (position_noise_ != 0) AddPositionNoise(random);
  if (velocity_noise_ != 0) {
    for (int i = 0; i < model()->nv; ++i) data()->qvel[i] += velocity_noise_ * random.Normal();
  }
}

// Controls of the actuators that no action drives, and mocap bodies.
void ModelTask::SetConstants() {
  const mjModel& m = *model();
  if (keyframe_ < 0) return;
  mju_copy(data()->ctrl, m.key_ctrl + keyframe_ * m.nu, m.nu);
  mju_copy(data()->mocap_pos, m.key_mpos + 3 * keyframe_ * m.nmocap, 3 * m.nmocap);
  mju_copy(data()->mocap_quat, m.key_mquat + 4 * keyframe_ * m.nmocap, 4 * m.nmocap);
}

// In joint order; a rotation of a free or ball joint is turned about three axes.
void ModelTask::AddPositionNoise(NumpyRandom& random) {
  const mjModel& m = *model();
  const auto turn = [&](mjtNum* quaternion) {
    mjtNum rotation[3];
    for (mjtNum& angle : rotation) angle = position_noise_ * random.Normal();
    mju_quatIntegrate(quaternion, rotation, 1);
  };
  for (int j = 0; j < m.njnt; ++j) {
    mjtNum* qpos = data()->qpos + m.jnt_qposadr[j];
    switch (m.jnt_type[j]) {
      case mjJNT_FREE:
        for (int i = 0; i < 3; ++i) qpos[i] += position_noise_ * random.Normal();
        turn(qpos + 3);
        break;
      case mjJNT_BALL:
        turn(qpos);
        break;
      default:
        *qpos += position_noise_ * random.Normal();
        if (m.jnt_limited[j]) {
          *qpos = mju_clip(*qpos, m.jnt_range[2 * j], m.jnt_range[2 * j + 1]);
        }
    }
  }
}

}  // namespace dreamsearch::mjcf
