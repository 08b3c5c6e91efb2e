// control_task.h - what all tasks of the suite have in common: the episode.
//
// A task says which model it runs on, how a random initial state is drawn, what
// is observed and what is rewarded. ControlTask does the rest as the suite does
// it: an episode is one reset and 1000 control steps, each of a fixed number of
// physics steps, and ends by the time limit alone.
//
// Freshness  After a step, positions, velocities and the sensors of these stages
//            belong to the new state. Acceleration-stage sensors (touch, force,
//            torque, accelerometer) are those of the last physics step's start.
// Control    The action is put into mjData.ctrl as it is. The engine clips a copy
//            of its own; rewards read the unclipped one.
// Errors     Inside, EngineError; across the plugin boundary, Status.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "dreamsearch/environment.h"
#include "plugins/mujoco/engine.h"
#include "plugins/mujoco/numpy_random.h"
#include "plugins/mujoco/renderer.h"
#include "plugins/mujoco/variation.h"

namespace dreamsearch::mujoco {

// A named part of the observation.
struct Part {
  std::string name;
  std::uint64_t size = 0;
};

struct TaskSettings {
  std::string name;  // "walker_walk"
  ModelPtr model;
  int substeps = 1;  // physics steps in a control step
  std::vector<Part> observation;
  std::vector<int> actuators = {};       // that actions drive, in their order; empty: all
  std::vector<double> action_low = {};   // of these; empty: the model's control ranges
  std::vector<double> action_high = {};  //
  std::map<std::string, std::string> made_of = {};  // EnvironmentSpec::ingredients
  std::uint32_t episode_steps = 1000;
  bool terminates = false;  // Terminated may be true
  double return_low = 0;
  double return_high = 1000;
};

class ControlTask : public Offers<Environment, StateSaving, Rendering> {
 public:
  explicit ControlTask(TaskSettings settings);
  virtual ~ControlTask() = default;
  ControlTask(const ControlTask&) = delete;
  ControlTask& operator=(const ControlTask&) = delete;

  const EnvironmentSpec& spec() const noexcept final { return spec_; }
  Status Reset(std::uint32_t seed, View<double> observation) noexcept final;
  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept final;
  std::uint64_t state_bytes() const noexcept final { return state_bytes_; }
  Status SaveState(View<std::byte> state) const noexcept final;
  Status RestoreState(View<const std::byte> state) noexcept final;
  Status Render(const RenderRequest& request, View<std::uint8_t> rgb) noexcept final;
  void Destroy() noexcept final { delete this; }

  // What observation and reward are at the state that mjData is in.
  // observation: [O]. Public for tests, which set states by hand.
  virtual void Observe(double* observation) const = 0;
  virtual double Reward() const = 0;

  // Whether the state that mjData is in is a terminal one.
  virtual bool Terminated() const { return false; }

  // Changes the world, once, before the first Reset and before any state is saved.
  //   EngineError  the engine refused.
  void Vary(const Variation& variation);

  mjModel* model() const { return model_.get(); }
  mjData* data() const { return data_.get(); }

  // Forward dynamics with actuation off, as resets use it.
  void ForwardWithoutActuation();

  // Takes mjData as it stands for the state of an episode `steps` steps old, so
  // that Step goes on from there. For tests.
  void AdoptPhysics(std::uint32_t steps);

 protected:
  const std::string& name() const { return name_; }
  // The id of the actuator of each action entry.
  const std::vector<int>& actuators() const { return actuators_; }

  // The task's own part of a reset: draws the initial state. mjData has just been
  // reset and run through ForwardWithoutActuation, which follows once more.
  virtual void DrawInitialState(NumpyRandom& random) = 0;

  // Sets what of mjData no saved state holds because no step changes it, where that is not what
  // mj_resetData sets. RestoreState calls it.
  virtual void SetConstants() {}

  // Counts the physics steps: mj_step2 first for Euler, so that an action acts on
  // what the last mj_step1 computed; mj_step1 last, so that all that depends on
  // position and velocity is fresh.
  void Advance(int physics_steps);

  // Declares model values that DrawInitialState writes and the future depends on;
  // they become part of the saved state.
  void DeclareWritten(mjtNum* values, int count);

  // Sets every limited hinge and slide uniformly within its range, unlimited
  // hinges uniformly within [-pi, pi] and the quaternion of free joints to four
  // uniform draws over their norm, in joint order. Unlimited slides and the
  // position of free joints stay.
  void RandomiseJoints(NumpyRandom& random);

  void ClearWarnings();

  // Ids and addresses by name.
  //   EngineError  the model has no such thing.
  int Id(mjtObj type, const char* name) const;
  int QposAddress(const char* joint) const;
  int DofAddress(const char* joint) const;
  const mjtNum* Sensor(const char* name) const;

 private:
  struct StateHeader;

  Status FirstWarning(const char* when) const;
  void LayOutState();
  void PackState();
  // Puts the action into mjData.ctrl, or the one of delay_steps before.
  void Control(View<const double> action);
  void ObserveWithNoise(std::uint32_t step, View<double> observation) const;
  Status Fail(const char* call, const char* what) noexcept;

  std::string name_;
  std::uint64_t task_hash_;
  ModelPtr model_;
  DataPtr data_;
  bool rk4_;
  int substeps_;
  std::vector<Part> parts_;
  std::vector<ObservationPart> observation_parts_;
  std::vector<int> actuators_;
  std::vector<double> action_low_;
  std::vector<double> action_high_;
  std::map<std::string, std::string> made_of_;
  std::vector<Ingredient> ingredients_;
  EnvironmentSpec spec_;
  std::uint64_t state_bytes_ = 0;
  std::vector<std::span<mjtNum>> written_;
  std::unique_ptr<Renderer> renderer_;  // from the first picture on

  bool running_ = false;
  std::uint32_t steps_ = 0;
  Variation variation_;
  std::uint32_t seed_ = 0;       // of the episode, for the noise
  std::vector<double> delayed_;  // [delay_steps x A] actions that have not acted, oldest first
  // The positions as they went into the last position stage, which normalises
  // quaternions in place: normalising once more may move their last bit.
  std::vector<mjtNum> qpos_before_;
  // The last good state, see LayOutState. Outlives a divergence.
  std::vector<double> packed_;
  std::uint32_t packed_steps_ = 0;
  bool packed_running_ = false;
};

// Euclidean norm of a quaternion, summed in the order of numpy's BLAS; the last
// bit decides where chaotic motions go.
double QuaternionNorm(const double* q);

// The first and third entry and so on of a body's rotation matrix, by name: the
// z axis of the body in world coordinates is (xz, yz, zz).
enum MatrixEntry { kXX = 0, kXY, kXZ, kYX, kYY, kYZ, kZX, kZY, kZZ };

}  // namespace dreamsearch::mujoco
