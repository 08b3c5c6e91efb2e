// A model for MuJoCo 3 plays in a process in which the suite's engine plays too. Built where
// DREAMSEARCH_MUJOCO_WHEEL is set; mujoco3.sh does that.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "dreamsearch/plugin.h"
#include "tests/plugins/env_mjcf/model_files.h"
#include "tests/plugins/owned.h"
#include "tests/sdk/default_values.h"

namespace dreamsearch::mjcf {
namespace {

using Numbers = std::vector<double>;
using OwnedEnvironment = Owned<Environment>;

// `kv`, `actuatorfrcrange` and `gravcomp` are of MuJoCo 3.
constexpr char kRobot[] = R"(<mujoco model="robot">
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body name="arm" pos="0 0 1" gravcomp="1">
      <joint name="elbow" type="hinge" axis="0 1 0" actuatorfrcrange="-20 20" damping="0.1"/>
      <geom type="capsule" size="0.05" fromto="0 0 0 0.4 0 0" mass="1"/>
    </body>
    <body name="ball" pos="0.3 0 2"><freejoint/><geom size="0.1" mass="0.5"/></body>
  </worldbody>
  <actuator><position name="servo" joint="elbow" kp="50" kv="5" ctrlrange="-2 2"/></actuator>
</mujoco>)";

const ComponentDescriptor& Load(const std::string& plugin) {
  void* library =
      ::dlopen((DREAMSEARCH_TEST_PLUGIN_DIR "/" + plugin + ".so").c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) throw std::runtime_error(::dlerror());
  return reinterpret_cast<PluginEntry>(::dlsym(library, kPluginEntrySymbol))()->components[0];
}

struct Made {
  Status status;
  OwnedEnvironment environment;
};
Made Make(const ComponentDescriptor& component, const std::string& model) {
  std::vector<ParameterValue> values = DefaultValues(component);
  for (ParameterValue& value : values) {
    const std::string name = value.name;
    if (name == "model") value.choice = model.c_str();
    if (name == "reward") value.choice = "sum(positions)";
    if (name == "control_step") value.number = 0.02;
    if (name == "position_noise") value.number = 0.1;
  }
  EnvironmentContext context;
  context.parameters = {{values.data(), values.size()}};
  Environment* environment = nullptr;
  const Status status = component.create_environment(context, &environment);
  return {status, OwnedEnvironment(environment)};
}

double Step(Environment& environment, int i) {
  Numbers observation(environment.spec().observation_size), action(environment.spec().action_size);
  for (double& entry : action) entry = std::sin(i);
  StepResult result;
  const Status status = environment.Step({action.data(), action.size()},
                                         {observation.data(), observation.size()}, &result);
  EXPECT_TRUE(status.ok()) << status.message;
  return result.reward;
}
void Reset(Environment& environment) {
  Numbers observation(environment.spec().observation_size);
  const Status status = environment.Reset(3, {observation.data(), observation.size()});
  EXPECT_TRUE(status.ok()) << status.message;
}

std::string EngineOf(const Environment& environment) {
  for (const Ingredient& ingredient : environment.spec().ingredients) {
    if (std::strcmp(ingredient.name, "MuJoCo") == 0) return ingredient.value;
  }
  return "";
}

TEST(TwoEngines, AModelForMuJoCo3NeedsItsPluginAndTheOtherSaysSo) {
  const ModelFiles files;
  const std::string model = files.Write("robot.xml", kRobot);
  const Made refused = Make(Load("env_mjcf"), model);
  EXPECT_EQ(refused.status.code, StatusCode::kInvalidArgument);
  EXPECT_NE(std::string(refused.status.message).find("--env mjcf3:NAME"), std::string::npos)
      << refused.status.message;
  const Made made = Make(Load("env_mjcf3"), model);
  ASSERT_TRUE(made.status.ok()) << made.status.message;
  EXPECT_EQ(EngineOf(*made.environment).front(), '3');
}

TEST(TwoEngines, EachPlaysInOneProcessAsItPlaysAlone) {
  const ModelFiles files;
  const std::string robot = files.Write("robot.xml", kRobot), leg = files.Write("leg.xml", kLeg);
  const ComponentDescriptor &old = Load("env_mjcf"), &present = Load("env_mjcf3");
  EXPECT_STREQ(old.name, "mjcf");
  EXPECT_STREQ(present.name, "mjcf3");
  const auto play = [](Environment& environment) {
    Numbers rewards;
    Reset(environment);
    for (int i = 0; i < 300; ++i) rewards.push_back(Step(environment, i));
    return rewards;
  };
  const Made first = Make(old, leg), second = Make(present, robot);
  ASSERT_TRUE(first.status.ok() && second.status.ok())
      << first.status.message << second.status.message;
  EXPECT_NE(EngineOf(*first.environment), EngineOf(*second.environment));
  const Numbers alone = play(*first.environment), also_alone = play(*second.environment);
  Reset(*first.environment);
  Reset(*second.environment);
  for (int i = 0; i < 300; ++i) {
    ASSERT_EQ(Step(*first.environment, i), alone[static_cast<std::size_t>(i)]) << i;
    ASSERT_EQ(Step(*second.environment, i), also_alone[static_cast<std::size_t>(i)]) << i;
  }
}

TEST(TwoEngines, ASavedStateOfMuJoCo3GoesOnToTheBit) {
  const ModelFiles files;
  const std::string model = files.Write("robot.xml", kRobot);
  const Made played = Make(Load("env_mjcf3"), model), restored = Make(Load("env_mjcf3"), model);
  ASSERT_TRUE(played.status.ok()) << played.status.message;
  Environment& one = *played.environment;
  Reset(one);
  // Until after the ball has hit the arm and the floor.
  for (int i = 0; i < 60; ++i) Step(one, i);
  auto* saving = ExtensionOf<StateSaving>(&one);
  std::vector<std::byte> state(saving->state_bytes());
  for (int part = 0; part < 5; ++part) {
    ASSERT_TRUE(saving->SaveState({state.data(), state.size()}).ok());
    const Status status = ExtensionOf<StateSaving>(restored.environment.get())
                              ->RestoreState({state.data(), state.size()});
    ASSERT_TRUE(status.ok()) << status.message;
    for (int i = 0; i < 20; ++i) EXPECT_EQ(Step(one, i), Step(*restored.environment, i)) << part;
  }
}

}  // namespace
}  // namespace dreamsearch::mjcf
