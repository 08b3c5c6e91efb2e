// The real packages through the bridge: what their own pages say of the environments.
// Skipped where install_worlds.sh could not install them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "plugins/env_gym/python_environment.h"
#include "tests/plugins/owned.h"

namespace dreamsearch::gym {
namespace {

using Numbers = std::vector<double>;

using OwnedEnvironment = Owned<Environment>;

class RealWorldsTest : public testing::Test {
 protected:
  void SetUp() override {
    ::signal(SIGPIPE, SIG_IGN);  // as the host's processes do
    if (!std::filesystem::exists(DREAMSEARCH_WORLDS "/complete")) {
      GTEST_SKIP() << "no virtual environment in " DREAMSEARCH_WORLDS;
    }
  }

  static OwnedEnvironment Make(const std::string& kind, const std::string& id,
                               const std::string& module = "") {
    PythonEnvironmentSettings settings;
    settings.kind = kind;
    settings.interpreter = DREAMSEARCH_WORLDS "/bin/python";
    settings.id = id;
    settings.module = module;
    settings.arguments = "{}";
    return OwnedEnvironment(new PythonEnvironment(settings));
  }
};

struct Episode {
  Numbers rewards;
  StepResult last;
};

// With the action at the given place between its bounds.
Episode Play(Environment& environment, double place, std::uint32_t seed = 0) {
  const EnvironmentSpec& spec = environment.spec();
  Numbers observation(spec.observation_size), action(spec.action_size);
  const View<double> into{observation.data(), observation.size()};
  for (std::size_t i = 0; i < action.size(); ++i) {
    action[i] = spec.action_low[i] + place * (spec.action_high[i] - spec.action_low[i]);
  }
  Episode episode;
  EXPECT_TRUE(environment.Reset(seed, into).ok());
  while (!episode.last.last && episode.rewards.size() <= spec.episode_steps) {
    const Status status = environment.Step({action.data(), action.size()}, into, &episode.last);
    EXPECT_TRUE(status.ok()) << status.message;
    if (!status.ok()) break;
    episode.rewards.push_back(episode.last.reward);
  }
  return episode;
}

TEST_F(RealWorldsTest, PendulumHasItsRewardsItsTorqueAndItsTimeLimit) {
  const OwnedEnvironment pendulum = Make("gym", "Pendulum-v1");
  EXPECT_EQ(pendulum->spec().observation_size, 3u);
  EXPECT_EQ(pendulum->spec().action_low[0], -2);
  EXPECT_EQ(pendulum->spec().action_high[0], 2);
  const Episode episode = Play(*pendulum, 0.5);
  EXPECT_EQ(episode.rewards.size(), 200u);
  EXPECT_EQ(episode.last.discount, 1);
  EXPECT_GE(*std::min_element(episode.rewards.begin(), episode.rewards.end()), -16.2736044);
  EXPECT_LE(*std::max_element(episode.rewards.begin(), episode.rewards.end()), 0);
}

TEST_F(RealWorldsTest, WhatAModuleRegistersWithGymnasiumPlays) {
  const std::string module = testing::TempDir() + "/registers_a_world.py";
  std::ofstream(module) << "import gymnasium\n"
                           "gymnasium.register('Short-v3', max_episode_steps=20, entry_point="
                           "'gymnasium.envs.classic_control:PendulumEnv')\n";
  EXPECT_EQ(Play(*Make("gym", "Short-v3", module), 0.5).rewards.size(), 20u);
  std::filesystem::remove(module);
}

TEST_F(RealWorldsTest, WhatFallsEndsEarlyAndTerminally) {
  for (const char* id : {"Hopper-v5", "InvertedPendulum-v5"}) {
    SCOPED_TRACE(id);
    const OwnedEnvironment environment = Make("gym", id);
    const Episode episode = Play(*environment, 1);
    EXPECT_EQ(environment->spec().episode_steps, 1000u);
    EXPECT_LT(episode.rewards.size(), 300u);
    EXPECT_EQ(episode.last.discount, 0);
  }
}

TEST_F(RealWorldsTest, SizesAreThoseOfTheSpaces) {
  const struct {
    const char* id;
    std::uint64_t observation, action;
  } kSizes[] = {
      {"HalfCheetah-v5", 17, 6}, {"Humanoid-v5", 348, 17}, {"MountainCarContinuous-v0", 2, 1}};
  for (const auto& expected : kSizes) {
    SCOPED_TRACE(expected.id);
    const OwnedEnvironment environment = Make("gym", expected.id);
    EXPECT_EQ(environment->spec().observation_size, expected.observation);
    EXPECT_EQ(environment->spec().action_size, expected.action);
    EXPECT_EQ(Play(*environment, 0.5, 3).rewards, Play(*environment, 0.5, 3).rewards);
  }
}

TEST_F(RealWorldsTest, ATaskOfTheControlSuitePlays) {
  const OwnedEnvironment walker = Make("dm", "walker-walk");
  ASSERT_EQ(walker->spec().observation.size, 3u);
  EXPECT_STREQ(walker->spec().observation[0].name, "orientations");
  EXPECT_EQ(walker->spec().observation_size, 24u);
  EXPECT_EQ(walker->spec().episode_steps, 1000u);
  const Episode episode = Play(*walker, 0.5, 1);
  EXPECT_EQ(episode.rewards.size(), 1000u);
  EXPECT_EQ(episode.last.discount, 1);
  EXPECT_EQ(episode.rewards, Play(*walker, 0.5, 1).rewards);
}

}  // namespace
}  // namespace dreamsearch::gym
