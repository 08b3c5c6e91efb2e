// episode_driver.h - runs a task step by step and keeps what it said.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "plugins/mujoco/numpy_random.h"
#include "tests/plugins/env_dmc/reference_data.h"

namespace dreamsearch::dmc {

class EpisodeDriver {
 public:
  explicit EpisodeDriver(const std::string& name)
      : task(MakeTask(name)),
        observation(task->spec().observation_size),
        action(task->spec().action_size) {}

  Status Reset(std::uint32_t seed) {
    return task->Reset(seed, {observation.data(), observation.size()});
  }

  // A step with `action` as it stands.
  Status Step() {
    return task->Step({action.data(), action.size()}, {observation.data(), observation.size()},
                      &result);
  }

  void DrawAction(NumpyRandom& random) {
    for (std::size_t i = 0; i < action.size(); ++i) {
      action[i] = random.Uniform(task->spec().action_low[i], task->spec().action_high[i]);
    }
  }

  std::vector<std::byte> Save() {
    std::vector<std::byte> state(task->state_bytes());
    EXPECT_TRUE(task->SaveState({state.data(), state.size()}).ok());
    return state;
  }
  Status Restore(const std::vector<std::byte>& state) {
    return task->RestoreState({state.data(), state.size()});
  }

  TaskPtr task;
  std::vector<double> observation;
  std::vector<double> action;
  StepResult result;
};

// Puts the task into a state that the next step cannot survive: joint speeds just
// below what the engine takes for a bad number.
inline void MakeDiverge(ControlTask* task, std::uint32_t steps) {
  for (int i = 0; i < task->model()->nv; ++i) task->data()->qvel[i] = 9e9;
  task->AdoptPhysics(steps);
}

}  // namespace dreamsearch::dmc
