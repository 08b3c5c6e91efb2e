// Whole tasks: the suite's, written with texts, and what settings do to an episode.
#include "plugins/env_mjcf/model_task.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <memory>
#include <numbers>

#include "dreamsearch/plugin.h"
#include "plugins/env_dmc/tasks.h"
#include "tests/plugins/env_mjcf/model_files.h"
#include "tests/sdk/default_values.h"

namespace dreamsearch::mjcf {
namespace {

using mujoco::ControlTask;
using TaskPtr = std::unique_ptr<ControlTask>;

class Player {
 public:
  explicit Player(TaskPtr made)
      : task(std::move(made)), observation(task->spec().observation_size) {}
  explicit Player(const ModelTaskSettings& settings)
      : Player(std::make_unique<ModelTask>(settings)) {}

  void Reset(std::uint32_t seed) {
    const Status status = task->Reset(seed, {observation.data(), observation.size()});
    ASSERT_TRUE(status.ok()) << status.message;
  }
  void Step(const std::vector<double>& action) {
    const Status status = task->Step({action.data(), action.size()},
                                     {observation.data(), observation.size()}, &result);
    ASSERT_TRUE(status.ok()) << status.message;
  }
  std::vector<std::byte> Save() const {
    std::vector<std::byte> state(task->state_bytes());
    EXPECT_TRUE(task->SaveState({state.data(), state.size()}).ok());
    return state;
  }

  TaskPtr task;
  std::vector<double> observation;
  StepResult result;
};

// Plays 1,000 steps of both from each seed: initial states, observations and rewards.
void ExpectEqualEpisodes(const std::vector<std::uint32_t>& seeds, Player* suite, Player* own) {
  for (const std::uint32_t seed : seeds) {
    suite->Reset(seed);
    own->Reset(seed);
    ASSERT_EQ(suite->observation, own->observation);
    mujoco::NumpyRandom random(seed);
    double sum = 0;
    for (int step = 0; step < 1000; ++step) {
      const std::vector<double> action = {random.Uniform(-1, 1)};
      suite->Step(action);
      own->Step(action);
      ASSERT_NEAR(suite->result.reward, own->result.reward, 1e-12) << "step " << step;
      ASSERT_EQ(suite->observation, own->observation) << "step " << step;
      ASSERT_EQ(suite->result.last, own->result.last) << "step " << step;
      sum += suite->result.reward;
    }
    EXPECT_GT(sum, 0);
  }
}

void WriteSuiteModels(const ModelFiles& files) {
  for (const char* name : {"scene.xml", "cartpole.xml", "pendulum.xml"}) {
    files.Write(name, dmc::ModelText(name));
  }
}

TEST(ModelTask, CartpoleSwingupWrittenInTextIsTheSuites) {
  const ModelFiles files;
  WriteSuiteModels(files);
  ModelTaskSettings settings;
  settings.model = files.Write("swingup.xml", R"(<mujoco><include file="cartpole.xml"/><keyframe>
    <key name="hanging" qpos="0 3.141592653589793"/></keyframe></mujoco>)");
  settings.keyframe = "hanging";
  settings.position_noise = settings.velocity_noise = 0.01;
  settings.observation = "position(slider), body(pole_1).zz, body(pole_1).xz, velocities";
  settings.reward =
      "(body(pole_1).zz + 1) / 2"
      " * (4 + tolerance(control(slide), margin=1, shape=quadratic, at_margin=0)) / 5"
      " * (1 + tolerance(velocity(hinge_1), margin=5)) / 2"
      " * (1 + tolerance(position(slider), margin=2)) / 2";
  Player suite(TaskPtr{dmc::MakeCartpoleSwingup()}), own(settings);
  ExpectEqualEpisodes({0, 7}, &suite, &own);
}

TEST(ModelTask, PendulumSwingupWrittenInTextIsTheSuites) {
  const ModelFiles files;
  WriteSuiteModels(files);
  ModelTaskSettings settings;
  settings.model = (files.folder() / "pendulum.xml").string();
  settings.randomise_joints = true;
  settings.observation = "body(pole).zz, body(pole).xz, velocity(hinge)";
  settings.reward = "tolerance(body(pole).zz, lower=0.9902680687415704, upper=1)";
  Player suite(TaskPtr{dmc::MakePendulumSwingup()}), own(settings);
  // There is a reward near the top alone: begin there.
  std::vector<std::uint32_t> seeds;
  for (std::uint32_t seed = 0; seeds.size() < 2; ++seed) {
    suite.Reset(seed);
    if (suite.observation[0] > 0.99) seeds.push_back(seed);
  }
  ExpectEqualEpisodes(seeds, &suite, &own);
}

// --- settings --------------------------------------------------------------------

class LegTask : public testing::Test {
 protected:
  LegTask() {
    settings_.name = "mjcf:leg";
    settings_.model = files_.Write("leg.xml", kLeg);
    settings_.reward = "body(torso).z";
  }
  std::string Error() {
    return MessageOf([&] { ModelTask{settings_}; });
  }

  ModelFiles files_;
  ModelTaskSettings settings_;
};

TEST_F(LegTask, SpecSaysWhatWasSet) {
  settings_.observation = "position(hip), site(toe), sensor(turning)";
  settings_.control_step = 0.02;
  settings_.episode_steps = 50;
  settings_.terminate = "body(torso).z < 1";
  const ModelTask task(settings_);
  const EnvironmentSpec& spec = task.spec();
  EXPECT_EQ(spec.observation_size, 7u);
  EXPECT_STREQ(spec.observation[1].name, "site(toe)");
  EXPECT_EQ(spec.observation[1].size, 3u);
  EXPECT_EQ(spec.substeps, 4u);
  EXPECT_DOUBLE_EQ(spec.control_seconds, 0.02);
  EXPECT_EQ(spec.episode_steps, 50u);
  EXPECT_TRUE(spec.terminates);
  EXPECT_EQ(spec.action_size, 2u);
  EXPECT_EQ(spec.action_low[0], -20);
  EXPECT_EQ(spec.action_high[0], 30);
}

TEST_F(LegTask, WithoutAnObservationSeesPositionsVelocitiesAndSensors) {
  const ModelTask task(settings_);
  EXPECT_EQ(
      task.spec().observation_size,
      static_cast<std::uint64_t>(task.model()->nq + task.model()->nv + task.model()->nsensordata));
}

TEST_F(LegTask, ActionsDriveTheNamedActuatorsAndOthersKeepTheKeyframesControl) {
  settings_.keyframe = "raised";
  settings_.actuators = "swing";
  settings_.observation = "controls";
  Player player(settings_), restored(settings_);
  ASSERT_EQ(player.task->spec().action_size, 1u);
  player.Reset(0);
  const std::vector<std::byte> state = player.Save();
  player.Step({-0.5});
  EXPECT_EQ(player.observation, (std::vector<double>{5, -0.5}));
  ASSERT_TRUE(restored.task->RestoreState({state.data(), state.size()}).ok());
  restored.Step({-0.5});
  EXPECT_EQ(restored.observation, player.observation);
  EXPECT_EQ(restored.result.reward, player.result.reward);
}

TEST_F(LegTask, EpisodesBeginInTheKeyframe) {
  settings_.keyframe = "raised";
  settings_.observation = "position(rail), position(hip), time";
  Player player(settings_);
  player.Reset(0);
  EXPECT_EQ(player.observation, (std::vector<double>{0.3, 0.1, 0}));
}

TEST_F(LegTask, ResetNoiseIsThatOfTheSeedAndKeepsLimits) {
  settings_.position_noise = 0.4;
  settings_.velocity_noise = 0.1;
  settings_.observation = "positions, velocities";
  Player first(settings_), second(settings_);
  first.Reset(3);
  second.Reset(4);
  EXPECT_NE(first.observation, second.observation);
  second.Reset(3);
  EXPECT_EQ(first.observation, second.observation);
  double squares = 0, lowest = 0, highest = 0;
  constexpr int kSeeds = 1000;
  for (std::uint32_t seed = 0; seed < kSeeds; ++seed) {
    first.Reset(seed);
    lowest = std::min(lowest, first.observation[0]);
    highest = std::max(highest, first.observation[0]);
    squares += first.observation[1] * first.observation[1];
    const double* q = first.observation.data() + 2;  // the ankle's quaternion
    EXPECT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1, 1e-9);
  }
  EXPECT_EQ(lowest, -0.5);
  EXPECT_EQ(highest, 0.5);
  // Four standard errors of a deviation.
  EXPECT_NEAR(std::sqrt(squares / kSeeds), 0.4, 4 * 0.4 / std::sqrt(2.0 * kSeeds));
}

TEST_F(LegTask, EndsInATerminalStateWhereAConditionHolds) {
  settings_.observation = "body(torso).z";
  settings_.terminate = "body(torso).z > 5, body(torso).z < 1.9";
  Player player(settings_);
  player.Reset(0);
  int steps = 0;
  do {
    EXPECT_EQ(player.result.discount, 1);
    player.Step({0, 0});
    ++steps;
    ASSERT_LT(steps, 1000);
  } while (!player.result.last);
  EXPECT_EQ(player.result.discount, 0);
  EXPECT_LT(player.observation[0], 1.9);
  // Free fall: after n steps of h, g h h n (n + 1) / 2, for the first time more than 0.1 m.
  EXPECT_EQ(steps, 29);
  double action[2] = {0, 0};
  StepResult result;
  EXPECT_EQ(player.task->Step({action, 2}, {player.observation.data(), 1}, &result).code,
            StatusCode::kFailedPrecondition);
}

TEST_F(LegTask, TheTimeLimitIsNoTerminalState) {
  settings_.episode_steps = 3;
  Player player(settings_);
  player.Reset(0);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(player.result.last, false);
    player.Step({0, 0});
  }
  EXPECT_TRUE(player.result.last);
  EXPECT_EQ(player.result.discount, 1);
}

TEST_F(LegTask, RestoreThenStepEqualsStep) {
  settings_.keyframe = "raised";
  settings_.position_noise = settings_.velocity_noise = 0.3;
  settings_.control_step = 0.01;
  settings_.observation = "positions, velocities, sensors, body('left foot'), controls, time";
  Player original(settings_), copy(settings_);
  original.Reset(5);
  mujoco::NumpyRandom random(6);
  for (int step = 0; step < 60; ++step) {
    const std::vector<std::byte> before = original.Save();
    ASSERT_TRUE(copy.task->RestoreState({before.data(), before.size()}).ok());
    ASSERT_EQ(copy.Save(), before);
    const std::vector<double> action = {random.Uniform(-20, 30), random.Uniform(-1, 1)};
    original.Step(action);
    copy.Step(action);
    ASSERT_EQ(original.observation, copy.observation) << "step " << step;
    ASSERT_EQ(original.result.reward, copy.result.reward) << "step " << step;
    ASSERT_EQ(original.Save(), copy.Save()) << "step " << step;
  }
}

TEST_F(LegTask, SaysWhichSettingIsWrongAndWhatThereIs) {
  const ModelTaskSettings good = settings_;
  const auto expect = [&](const std::string& part) {
    EXPECT_NE(Error().find(part), std::string::npos) << Error();
    settings_ = good;
  };
  settings_.model = "";
  expect("expected the path of a model file in the setting 'model'");
  settings_.reward = "";
  expect("expected an expression in the setting 'reward'");
  settings_.reward = "position(hipp)";
  expect("reward: the model has no joint 'hipp'; it has: rail, hip, ankle, root");
  settings_.reward = "site(toe)";
  expect("reward: expected one number, found 3");
  settings_.observation = "position(hip),, 1";
  expect("observation: expected a number, a quantity or a function, found ', 1'");
  settings_.terminate = "position(hip) = 1";
  expect("terminate: expected < or >, found '= 1'");
  settings_.actuators = "lift, swung";
  expect("actuators: the model has no actuator 'swung'; it has: lift, swing");
  settings_.actuators = "lift, lift";
  expect("actuators: actuator 'lift' is named twice");
  settings_.keyframe = "lying";
  expect("keyframe: the model has no keyframe 'lying'; it has: raised");
  settings_.control_step = 0.012;
  expect("control_step: expected a multiple of the model's time step of 0.005 s, found 0.012");
  settings_.randomise_joints = true;
  expect("randomise_joints: the model has a ball joint");
}

TEST(ModelTaskActions, AreBoundedByTheModelOrBySettings) {
  const ModelFiles files;
  ModelTaskSettings settings;
  settings.reward = "1";
  settings.model = files.Write("model.xml", R"(<mujoco><worldbody><body><joint name="j"/>
    <geom size="1"/></body></worldbody><actuator><motor name="push" joint="j"/></actuator></mujoco>)");
  EXPECT_NE(MessageOf([&] { ModelTask{settings}; }).find("actuator 'push' has no control range"),
            std::string::npos);
  settings.action_low = -3;
  settings.action_high = 2;
  EXPECT_EQ(ModelTask(settings).spec().action_high[0], 2);
  settings.model =
      files.Write("still.xml", "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>");
  EXPECT_NE(MessageOf([&] { ModelTask{settings}; }).find("has no actuators"), std::string::npos);
}

// --- the library -----------------------------------------------------------------

TEST(MjcfPlugin, MakesTheTaskOfItsParametersInAChangedWorld) {
  void* library = dlopen(DREAMSEARCH_TEST_PLUGIN_DIR "/env_mjcf.so", RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr) << dlerror();
  const auto* plugin = reinterpret_cast<PluginEntry>(dlsym(library, kPluginEntrySymbol))();
  const ComponentDescriptor& component = plugin->components[0];
  EXPECT_STREQ(component.name, "mjcf");
  EXPECT_STREQ(component.task_parameter, "task");
  const ModelFiles files;
  const std::string model = files.Write("leg.xml", kLeg);
  std::vector<ParameterValue> values = DefaultValues(component);
  for (ParameterValue& value : values) {
    const std::string name = value.name;
    if (name == "task") value.choice = "leg";
    if (name == "model") value.choice = model.c_str();
    if (name == "reward") value.choice = "velocity(rail)";
    if (name == "gravity_scale") value.number = 0.5;
  }
  EnvironmentContext context;
  context.parameters = {{values.data(), values.size()}};
  Environment* environment = nullptr;
  const Status made = component.create_environment(context, &environment);
  ASSERT_TRUE(made.ok()) << made.message;
  std::vector<double> observation(environment->spec().observation_size);
  ASSERT_TRUE(environment->Reset(0, {observation.data(), observation.size()}).ok());
  const double action[2] = {0, 0};
  StepResult result;
  ASSERT_TRUE(
      environment->Step({action, 2}, {observation.data(), observation.size()}, &result).ok());
  EXPECT_NEAR(result.reward, -0.5 * 9.81 * 0.005, 1e-9);
  environment->Destroy();

  for (ParameterValue& value : values) {
    if (std::string(value.name) == "reward") value.choice = "velocity(rial)";
  }
  const Status refused = component.create_environment(context, &environment);
  EXPECT_EQ(refused.code, StatusCode::kInvalidArgument);
  EXPECT_NE(std::string(refused.message).find("no joint 'rial'"), std::string::npos);
}

}  // namespace
}  // namespace dreamsearch::mjcf
