// Changed worlds against closed forms. The models are so small that semi-implicit Euler can be
// written down: after n physics steps of h seconds under acceleration a, v = n h a.
#include "plugins/mujoco/variation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "plugins/mujoco/control_task.h"

namespace dreamsearch::mujoco {
namespace {

constexpr double kStep = 0.002;

// A mass on a vertical rail with a motor, and a brick on a floor.
constexpr char kWorld[] = R"(<mujoco>
  <option timestep="0.002" gravity="0 0 -9.81"><flag energy="enable"/></option>
  <worldbody>
    <body name="mass" pos="0 0 5">
      <joint name="rail" type="slide" axis="0 0 1"/>
      <geom type="sphere" size="0.1" mass="2" contype="0" conaffinity="0"/>
    </body>
    <geom name="floor" type="plane" size="50 50 1" pos="0 2 0" friction="0.4 0.005 0.0001"/>
    <body name="brick" pos="0 2 0.1">
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 0 1"/>
      <geom name="brick" type="box" size="0.3 0.3 0.1" mass="1" friction="0.4 0.005 0.0001"/>
    </body>
  </worldbody>
  <actuator>
    <motor joint="rail" gear="1" ctrllimited="true" ctrlrange="-50 50"
           forcelimited="true" forcerange="-40 40"/>
  </actuator>
</mujoco>)";

class Rail final : public ControlTask {
 public:
  Rail()
      : ControlTask({.name = "rail",
                     .model = CopyOfCompiled("rail", kWorld, {}),
                     .substeps = 5,
                     .observation = {{"height", 1}, {"speed", 1}}}) {}

  void Observe(double* out) const override {
    out[0] = data()->qpos[0];
    out[1] = data()->qvel[0];
  }
  double Reward() const override { return data()->qpos[0]; }

 private:
  void DrawInitialState(NumpyRandom& random) override { data()->qpos[0] = random.Uniform(); }
};

class World {
 public:
  explicit World(const Variation& variation) : task_(new Rail) { task_->Vary(variation); }

  void Reset(std::uint32_t seed) {
    ASSERT_TRUE(task_->Reset(seed, {observation.data(), observation.size()}).ok());
  }
  void Step(double force) {
    StepResult result;
    ASSERT_TRUE(task_->Step({&force, 1}, {observation.data(), observation.size()}, &result).ok());
    reward = result.reward;
  }
  std::vector<std::byte> Save() const {
    std::vector<std::byte> state(task_->state_bytes());
    EXPECT_TRUE(task_->SaveState({state.data(), state.size()}).ok());
    return state;
  }
  void Restore(const std::vector<std::byte>& state) {
    ASSERT_TRUE(task_->RestoreState({state.data(), state.size()}).ok());
  }
  Rail& task() { return *task_; }

  std::vector<double> observation = {0, 0};
  double reward = 0;

 private:
  std::unique_ptr<Rail> task_;
};

// The mass's speed after 20 control steps of 5 physics steps each, from rest.
double SpeedAfterPushing(const Variation& variation, double force) {
  World world(variation);
  world.Reset(0);
  for (int i = 0; i < 20; ++i) world.Step(force);
  return world.observation[1];
}
constexpr double kSeconds = 20 * 5 * kStep;

TEST(Variation, FreeFallFollowsTheGravityScale) {
  for (const double scale : {0.0, 0.5, 1.0, 2.0, -1.0}) {
    EXPECT_NEAR(SpeedAfterPushing({.gravity_scale = scale}, 0), -9.81 * scale * kSeconds, 1e-12);
  }
}

TEST(Variation, AccelerationIsForceOverTheScaledMass) {
  for (const double scale : {0.5, 1.0, 3.0}) {
    EXPECT_NEAR(SpeedAfterPushing({.mass_scale = scale, .gravity_scale = 0}, 10),
                10 / (2 * scale) * kSeconds, 1e-12);
    // A falling body does not ask how heavy it is.
    EXPECT_NEAR(SpeedAfterPushing({.mass_scale = scale}, 0), -9.81 * kSeconds, 1e-12);
  }
}

TEST(Variation, ActuatorsPushWithTheScaledForceUpToTheScaledLimit) {
  for (const double scale : {0.0, 0.5, 1.0, 2.0}) {
    const Variation variation = {.gravity_scale = 0, .actuator_scale = scale};
    EXPECT_NEAR(SpeedAfterPushing(variation, 10), 10 * scale / 2 * kSeconds, 1e-12);
    EXPECT_NEAR(SpeedAfterPushing(variation, 50), 40 * scale / 2 * kSeconds, 1e-12);
  }
}

TEST(Variation, DerivedMassesAreTheCompilersOfTheHeavierModel) {
  std::string heavier = kWorld;
  heavier.replace(heavier.find("mass=\"2\""), 8, "mass=\"6\"");
  heavier.replace(heavier.find("mass=\"1\""), 8, "mass=\"3\"");
  const ModelPtr expected = CompileModel("heavier", heavier, {});
  World world({.mass_scale = 3});
  const mjModel* found = world.task().model();
  for (int i = 0; i < found->nbody; ++i) {
    EXPECT_NEAR(found->body_mass[i], expected->body_mass[i], 1e-12);
    EXPECT_NEAR(found->body_subtreemass[i], expected->body_subtreemass[i], 1e-12);
    EXPECT_NEAR(found->body_invweight0[2 * i], expected->body_invweight0[2 * i], 1e-12);
  }
  for (int i = 0; i < 3 * found->nbody; ++i) {
    EXPECT_NEAR(found->body_inertia[i], expected->body_inertia[i], 1e-12);
  }
  for (int i = 0; i < found->nv; ++i) {
    EXPECT_NEAR(found->dof_M0[i], expected->dof_M0[i], 1e-12);
  }
  EXPECT_NEAR(found->stat.meanmass, expected->stat.meanmass, 1e-12);
}

// While the brick slides, friction along the floor is mu times the floor's push N, and the integral
// of N - m g is what the brick's vertical momentum gains, however much it rattles:
// -dvx = mu (g T + dvz).
TEST(Variation, ASlidingBrickSlowsDownByTheScaledFriction) {
  for (const double scale : {0.5, 1.0, 2.0}) {
    World world({.friction_scale = scale});
    world.Reset(0);
    mjData* data = world.task().data();
    const int along = world.task().model()->jnt_dofadr[1];
    for (int i = 0; i < 50; ++i) world.Step(0);  // it settles
    data->qvel[along] = 4;
    world.task().AdoptPhysics(50);
    for (int i = 0; i < 2; ++i) world.Step(0);
    const double vx = data->qvel[along], vz = data->qvel[along + 1];
    for (int i = 0; i < 20; ++i) world.Step(0);
    ASSERT_GT(data->qvel[along], 0);
    EXPECT_NEAR(vx - data->qvel[along],
                0.4 * scale * (9.81 * kSeconds + data->qvel[along + 1] - vz), 1e-11)
        << scale;
  }
}

TEST(Variation, NoiseIsOnTheObservationAloneAndHasItsDeviation) {
  World plain({}), noisy({.observation_noise = 0.5});
  plain.Reset(3);
  noisy.Reset(3);
  double sum = 0, squares = 0;
  int count = 0;
  for (int i = 0; i < 900; ++i) {
    plain.Step(2);
    noisy.Step(2);
    ASSERT_EQ(plain.reward, noisy.reward);
    for (std::size_t k = 0; k < 2; ++k) {
      const double noise = noisy.observation[k] - plain.observation[k];
      sum += noise;
      squares += noise * noise;
      ++count;
    }
  }
  // Four standard errors of the mean, and of the deviation.
  EXPECT_NEAR(sum / count, 0, 4 * 0.5 / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count), 0.5, 4 * 0.5 / std::sqrt(2 * count));
}

TEST(Variation, NoiseIsThatOfTheSeedAndTheStep) {
  World first({.observation_noise = 1}), again({.observation_noise = 1});
  first.Reset(1);
  again.Reset(2);
  EXPECT_NE(first.observation, again.observation);
  again.Reset(1);
  EXPECT_EQ(first.observation, again.observation);
  const std::vector<double> at_reset = first.observation;
  first.Step(0);
  EXPECT_NE(first.observation, at_reset);
}

TEST(Variation, ADelayShiftsTheRewards) {
  constexpr std::uint32_t kDelay = 3;
  World now({}), late({.delay_steps = kDelay});
  now.Reset(5);
  late.Reset(5);
  std::vector<double> of_now, of_late;
  for (std::uint32_t i = 0; i < 40; ++i) {
    // What reaches the actuator is the same: nothing for three steps, then 10, 11, 12, ...
    now.Step(i < kDelay ? 0 : 10 + i - kDelay);
    late.Step(10 + i);
    ASSERT_EQ(now.reward, late.reward) << i;
    ASSERT_EQ(now.observation, late.observation) << i;
  }
}

TEST(Variation, ADelayOfDecisionsCountsEveryRepeat) {
  const ParameterValue values[] = {
      {"mass_scale", 1, nullptr},        {"friction_scale", 1, nullptr},
      {"gravity_scale", 1, nullptr},     {"actuator_scale", 1, nullptr},
      {"observation_noise", 0, nullptr}, {"action_delay", 2, nullptr}};
  EXPECT_EQ(Variation::From({{values, 6}}, 4).delay_steps, 8u);
  EXPECT_EQ(Variation::From({{values, 6}}, 1).delay_steps, 2u);
}

TEST(Variation, ARestoredStateHasItsDelayedActionsAndItsNoise) {
  const Variation variation = {.observation_noise = 0.1, .delay_steps = 3};
  World original(variation), copy(variation);
  original.Reset(8);
  copy.Reset(9);
  for (int i = 0; i < 20; ++i) {
    copy.Restore(original.Save());
    original.Step(i);
    copy.Step(i);
    ASSERT_EQ(original.observation, copy.observation) << i;
    ASSERT_EQ(original.reward, copy.reward) << i;
    ASSERT_EQ(original.Save(), copy.Save()) << i;
  }
}

TEST(Variation, OfNothingChangesNoBit) {
  World varied({});
  Rail plain;
  std::vector<double> observation(2);
  varied.Reset(4);
  ASSERT_TRUE(plain.Reset(4, {observation.data(), 2}).ok());
  for (int i = 0; i < 20; ++i) {
    const double force = i;
    StepResult result;
    ASSERT_TRUE(plain.Step({&force, 1}, {observation.data(), 2}, &result).ok());
    varied.Step(force);
    ASSERT_EQ(observation, varied.observation);
    std::vector<std::byte> state(plain.state_bytes());
    ASSERT_TRUE(plain.SaveState({state.data(), state.size()}).ok());
    ASSERT_EQ(state, varied.Save());
  }
}

}  // namespace
}  // namespace dreamsearch::mujoco
