// The library as a host sees it.
#include "dreamsearch/plugin.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <set>
#include <sstream>

#include "tests/plugins/env_dmc/episode_driver.h"
#include "tests/sdk/default_values.h"

namespace dreamsearch::dmc {
namespace {

const PluginDescriptor* LoadPlugin() {
  void* library = dlopen(DREAMSEARCH_TEST_PLUGIN_DIR "/env_dmc.so", RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) throw std::runtime_error(dlerror());
  return reinterpret_cast<PluginEntry>(dlsym(library, kPluginEntrySymbol))();
}

TEST(Plugin, OffersThePapersTasksAndTheFurtherOnes) {
  const std::string names =
      "acrobot_swingup cartpole_balance cartpole_balance_sparse cartpole_swingup "
      "cartpole_swingup_sparse cheetah_run cup_catch finger_spin finger_turn_easy finger_turn_hard "
      "hopper_hop hopper_stand pendulum_swingup quadruped_run quadruped_walk reacher_easy "
      "reacher_hard walker_run walker_stand walker_walk "
      "acrobot_swingup_sparse fish_upright fish_swim humanoid_stand humanoid_walk humanoid_run "
      "manipulator_bring_ball point_mass_easy swimmer_swimmer6 swimmer_swimmer15";
  std::istringstream stream(names);
  std::set<std::string> expected, found;
  for (std::string name; stream >> name;) expected.insert(name);
  const PluginDescriptor* plugin = LoadPlugin();
  EXPECT_EQ(plugin->magic, kPluginMagic);
  EXPECT_EQ(plugin->sdk_minor, std::uint32_t{DREAMSEARCH_SDK_MINOR});
  EXPECT_STREQ(plugin->name, "env_dmc");
  for (const ComponentDescriptor& component : plugin->components) {
    EXPECT_EQ(component.kind, ComponentKind::kEnvironment);
    EXPECT_TRUE(found.insert(component.name).second) << component.name;
    EXPECT_GT(std::string(component.summary).size(), 10u);
    if (found.contains("cup_catch") && std::string(component.name) == "cup_catch") {
      EXPECT_STREQ(component.aliases, "ball_in_cup_catch");
    }
  }
  EXPECT_EQ(found, expected);
}

TEST(Plugin, EnvironmentsBehaveAsTheTasksInside) {
  for (const ComponentDescriptor& component : LoadPlugin()->components) {
    SCOPED_TRACE(component.name);
    const std::vector<ParameterValue> values = DefaultValues(component);
    EnvironmentContext context;
    context.parameters = {{values.data(), values.size()}};
    Environment* environment = nullptr;
    const Status created = component.create_environment(context, &environment);
    ASSERT_TRUE(created.ok()) << created.message;
    EpisodeDriver inside(component.name);
    std::vector<double> observation(environment->spec().observation_size);
    const View<double> view{observation.data(), observation.size()};
    NumpyRandom random(0);
    ASSERT_TRUE(environment->Reset(2, view).ok());
    ASSERT_TRUE(inside.Reset(2).ok());
    ASSERT_EQ(observation, inside.observation);
    for (int step = 0; step < 5; ++step) {
      inside.DrawAction(random);
      StepResult result;
      ASSERT_TRUE(
          environment->Step({inside.action.data(), inside.action.size()}, view, &result).ok());
      ASSERT_TRUE(inside.Step().ok());
      ASSERT_EQ(observation, inside.observation);
      ASSERT_EQ(result.reward, inside.result.reward);
    }
    EXPECT_EQ(ExtensionOf<Rendering>(environment)->Render({}, {}).code,
              StatusCode::kInvalidArgument);
    environment->Destroy();
  }
}

TEST(Plugin, ExportsItsEntryAlone) {
  void* library = dlopen(DREAMSEARCH_TEST_PLUGIN_DIR "/env_dmc.so", RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr);
  EXPECT_NE(dlsym(library, kPluginEntrySymbol), nullptr);
  EXPECT_EQ(dlsym(library, "_ZN11dreamsearch3dmc13MakeWalkerRunEv"), nullptr);
}

}  // namespace
}  // namespace dreamsearch::dmc
