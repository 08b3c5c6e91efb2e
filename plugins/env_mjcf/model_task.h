// model_task.h - a task made of the user's own model and a few texts.
#pragma once

#include <string>
#include <vector>

#include "plugins/env_mjcf/expression.h"
#include "plugins/mujoco/control_task.h"

namespace dreamsearch::mjcf {

// README.md says what each means.
struct ModelTaskSettings {
  std::string name;   // of the task, for messages
  std::string model;  // path
  std::string actuators;
  std::string observation;
  std::string reward;
  std::string terminate;
  std::string keyframe;
  bool randomise_joints = false;
  double position_noise = 0;
  double velocity_noise = 0;
  double control_step = 0;  // seconds; 0: the model's time step
  std::uint32_t episode_steps = 1000;
  double action_low = 0;   // of actuators that the model does not bound, where it is
  double action_high = 0;  //   below action_high
};

class ModelTask final : public mujoco::ControlTask {
 public:
  // What is wrong with model or settings is thrown, each with the name of the setting:
  // mujoco::EngineError, ExpressionError, std::invalid_argument.
  explicit ModelTask(const ModelTaskSettings& settings);

  void Observe(double* observation) const override;
  double Reward() const override;
  bool Terminated() const override;

 private:
  struct Parsed;

  explicit ModelTask(const ModelTaskSettings& settings, Parsed parsed);
  void DrawInitialState(mujoco::NumpyRandom& random) override;
  void SetConstants() override;
  void AddPositionNoise(mujoco::NumpyRandom& random);

  std::vector<Named> observation_;
  ExpressionPtr reward_;
  std::vector<Condition> terminate_;
  int keyframe_;  // -1: none
  bool randomise_joints_;
  double position_noise_;
  double velocity_noise_;
};

}  // namespace dreamsearch::mjcf
