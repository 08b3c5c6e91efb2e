// Saving and restoring: the very bits, or a clear refusal.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/plugins/env_dmc/episode_driver.h"

namespace dreamsearch::dmc {
namespace {

// Before each of 60 steps the state goes to a second instance, which was never
// reset, and takes the same step there. Observation, reward and the state that
// follows must have the same bits. Free joints are where it fails when a
// quaternion is normalised once too often.
TEST(State, RestoreThenStepEqualsStep) {
  for (const TaskEntry& entry : kTasks) {
    SCOPED_TRACE(entry.name);
    EpisodeDriver original(entry.name);
    EpisodeDriver copy(entry.name);
    NumpyRandom random(99);
    ASSERT_TRUE(original.Reset(11).ok());
    for (int step = 0; step < 60; ++step) {
      const std::vector<std::byte> before = original.Save();
      ASSERT_TRUE(copy.Restore(before).ok());
      ASSERT_EQ(copy.Save(), before) << "step " << step;
      original.DrawAction(random);
      copy.action = original.action;
      ASSERT_TRUE(original.Step().ok());
      ASSERT_TRUE(copy.Step().ok());
      ASSERT_EQ(original.observation, copy.observation) << "step " << step;
      ASSERT_EQ(original.result.reward, copy.result.reward) << "step " << step;
      ASSERT_EQ(original.Save(), copy.Save()) << "step " << step;
    }
  }
}

TEST(State, BranchesFromOneStateDoNotTouchEachOther) {
  for (const char* name : {"walker_walk", "cartpole_swingup", "quadruped_run", "hopper_hop"}) {
    SCOPED_TRACE(name);
    EpisodeDriver driver(name);
    NumpyRandom random(5);
    ASSERT_TRUE(driver.Reset(1).ok());
    for (int step = 0; step < 20; ++step) {
      driver.DrawAction(random);
      ASSERT_TRUE(driver.Step().ok());
    }
    const std::vector<std::byte> root = driver.Save();
    std::vector<double> rewards;
    for (int round = 0; round < 2; ++round) {
      NumpyRandom branch_random(6);
      std::vector<double> found;
      for (int branch = 0; branch < 10; ++branch) {
        ASSERT_TRUE(driver.Restore(root).ok());
        for (int step = 0; step < 5; ++step) {
          driver.DrawAction(branch_random);
          ASSERT_TRUE(driver.Step().ok());
          found.push_back(driver.result.reward);
        }
      }
      if (round == 0) rewards = found;
      EXPECT_EQ(rewards, found);
    }
  }
}

TEST(State, KeepsTheStepCountAndTheEndOfTheEpisode) {
  EpisodeDriver driver("pendulum_swingup");
  ASSERT_TRUE(driver.Reset(0).ok());
  for (int step = 0; step < 999; ++step) ASSERT_TRUE(driver.Step().ok());
  EXPECT_FALSE(driver.result.last);
  const std::vector<std::byte> before_last = driver.Save();
  ASSERT_TRUE(driver.Step().ok());
  EXPECT_TRUE(driver.result.last);
  const std::vector<std::byte> over = driver.Save();

  EpisodeDriver other("pendulum_swingup");
  ASSERT_TRUE(other.Restore(before_last).ok());
  ASSERT_TRUE(other.Step().ok());
  EXPECT_TRUE(other.result.last);
  ASSERT_TRUE(other.Restore(over).ok());
  EXPECT_EQ(other.Step().code, StatusCode::kFailedPrecondition);
}

TEST(State, EveryDamagedByteIsFoundAndNothingChanges) {
  EpisodeDriver driver("reacher_easy");
  ASSERT_TRUE(driver.Reset(3).ok());
  const std::vector<std::byte> good = driver.Save();
  ASSERT_TRUE(driver.Step().ok());
  const std::vector<std::byte> now = driver.Save();
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (const int bit : {0, 7}) {
      std::vector<std::byte> bad = good;
      bad[i] ^= std::byte(1 << bit);
      ASSERT_EQ(driver.Restore(bad).code, StatusCode::kDataLoss) << "byte " << i;
    }
  }
  std::vector<std::byte> shorter(good.begin(), good.end() - 1);
  EXPECT_EQ(driver.Restore(shorter).code, StatusCode::kDataLoss);
  EXPECT_EQ(driver.Restore({}).code, StatusCode::kDataLoss);
  EXPECT_EQ(driver.Save(), now);
}

TEST(State, OfAnotherTaskIsRefused) {
  EpisodeDriver walk("walker_walk");
  EpisodeDriver run("walker_run");
  ASSERT_TRUE(walk.Reset(0).ok());
  ASSERT_TRUE(run.Reset(1).ok());
  const std::vector<std::byte> now = run.Save();
  ASSERT_EQ(walk.Save().size(), now.size());
  const Status status = run.Restore(walk.Save());
  EXPECT_EQ(status.code, StatusCode::kDataLoss);
  EXPECT_NE(std::strstr(status.message, "walker_run"), nullptr) << status.message;
  EXPECT_EQ(run.Save(), now);
}

TEST(State, SizeIsConstantAndChecked) {
  for (const TaskEntry& entry : kTasks) {
    EpisodeDriver driver(entry.name);
    const std::uint64_t size = driver.task->state_bytes();
    ASSERT_TRUE(driver.Reset(0).ok());
    EXPECT_EQ(driver.task->state_bytes(), size);
    std::vector<std::byte> small(size - 1);
    EXPECT_EQ(driver.task->SaveState({small.data(), small.size()}).code,
              StatusCode::kInvalidArgument);
  }
}

TEST(State, AfterADivergenceIsTheOneThatLedToIt) {
  EpisodeDriver driver("walker_walk");
  ASSERT_TRUE(driver.Reset(0).ok());
  ASSERT_TRUE(driver.Step().ok());
  MakeDiverge(driver.task.get(), 41);
  const std::vector<std::byte> before = driver.Save();
  const Status status = driver.Step();
  ASSERT_EQ(status.code, StatusCode::kDiverged);
  EXPECT_EQ(driver.Save(), before);
  EXPECT_EQ(driver.Step().code, StatusCode::kFailedPrecondition);

  // The dump and the action replay it on another instance.
  EpisodeDriver replay("walker_walk");
  ASSERT_TRUE(replay.Restore(before).ok());
  const Status again = replay.Step();
  EXPECT_EQ(again.code, StatusCode::kDiverged);
  EXPECT_STREQ(again.message, status.message);
}

TEST(Reset, ForgetsAllThatHappenedBefore) {
  for (const TaskEntry& entry : kTasks) {
    SCOPED_TRACE(entry.name);
    EpisodeDriver fresh(entry.name);
    EpisodeDriver used(entry.name);
    ASSERT_TRUE(used.Reset(1).ok());
    NumpyRandom random(2);
    for (int step = 0; step < 10; ++step) {
      used.DrawAction(random);
      ASSERT_TRUE(used.Step().ok());
    }
    MakeDiverge(used.task.get(), 10);
    used.Step().ok();  // most tasks diverge; either way the next reset must not care
    ASSERT_TRUE(fresh.Reset(5).ok());
    ASSERT_TRUE(used.Reset(5).ok());
    ASSERT_EQ(fresh.observation, used.observation);
    ASSERT_EQ(fresh.Save(), used.Save());
    for (int step = 0; step < 10; ++step) {
      fresh.DrawAction(random);
      used.action = fresh.action;
      ASSERT_TRUE(fresh.Step().ok());
      ASSERT_TRUE(used.Step().ok());
      ASSERT_EQ(fresh.observation, used.observation);
      ASSERT_EQ(fresh.result.reward, used.result.reward);
    }
  }
}

}  // namespace
}  // namespace dreamsearch::dmc
