// The episode: its length, its refusals, and what the engine's complaints become.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>

#include "tests/plugins/env_dmc/episode_driver.h"

namespace dreamsearch::dmc {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Episode, LastsAThousandStepsAndEndsByTheTimeLimitAlone) {
  for (const char* name : {"cartpole_balance", "pendulum_swingup", "reacher_hard"}) {
    EpisodeDriver driver(name);
    ASSERT_TRUE(driver.Reset(0).ok());
    for (int step = 1; step <= 1000; ++step) {
      ASSERT_TRUE(driver.Step().ok());
      ASSERT_EQ(driver.result.discount, 1);
      ASSERT_EQ(driver.result.last, step == 1000);
    }
    EXPECT_EQ(driver.Step().code, StatusCode::kFailedPrecondition);
    EXPECT_TRUE(driver.Reset(0).ok());
    EXPECT_TRUE(driver.Step().ok());
  }
}

TEST(Episode, MustBegin) {
  EpisodeDriver driver("walker_walk");
  EXPECT_EQ(driver.Step().code, StatusCode::kFailedPrecondition);
}

TEST(Episode, AnActionThatIsNotANumberIsRefusedAndChangesNothing) {
  for (const TaskEntry& entry : kTasks) {
    SCOPED_TRACE(entry.name);
    EpisodeDriver driver(entry.name);
    EpisodeDriver other(entry.name);
    ASSERT_TRUE(driver.Reset(0).ok());
    ASSERT_TRUE(other.Reset(0).ok());
    const std::vector<std::byte> before = driver.Save();
    for (std::size_t i = 0; i < driver.action.size(); ++i) {
      for (const double bad : {std::nan(""), kInfinity, -kInfinity}) {
        driver.action[i] = bad;
        ASSERT_EQ(driver.Step().code, StatusCode::kInvalidArgument);
        driver.action[i] = 0;
      }
    }
    EXPECT_EQ(driver.Save(), before);
    ASSERT_TRUE(driver.Step().ok());
    ASSERT_TRUE(other.Step().ok());
    EXPECT_EQ(driver.observation, other.observation);
  }
}

// The engine clips what it applies; the reward reads the action as it came.
TEST(Episode, AHugeActionActsAsTheBoundButIsRewardedAsItIs) {
  for (const TaskEntry& entry : kTasks) {
    SCOPED_TRACE(entry.name);
    EpisodeDriver huge(entry.name);
    EpisodeDriver bound(entry.name);
    ASSERT_TRUE(huge.Reset(0).ok());
    ASSERT_TRUE(bound.Reset(0).ok());
    for (int step = 0; step < 5; ++step) {
      for (std::size_t i = 0; i < huge.action.size(); ++i) {
        huge.action[i] = (i + step) % 2 == 0 ? 1e300 : -1e300;
        bound.action[i] = (i + step) % 2 == 0 ? bound.task->spec().action_high[i]
                                              : bound.task->spec().action_low[i];
      }
      ASSERT_TRUE(huge.Step().ok());
      ASSERT_TRUE(bound.Step().ok());
      EXPECT_EQ(huge.observation, bound.observation);
      EXPECT_EQ(huge.task->data()->ctrl[0], huge.action[0]);
    }
  }
  EpisodeDriver half("hopper_stand");
  ASSERT_TRUE(half.Reset(0).ok());
  ASSERT_TRUE(half.Step().ok());
  for (int i = 0; i < half.task->model()->nq; ++i) half.task->data()->qpos[i] = 0;
  half.task->ForwardWithoutActuation();  // stands
  EXPECT_EQ(half.task->Reward(), 1);
  half.task->data()->ctrl[0] = 7;  // 1 - 7^2 would be negative; the term stops at 0
  EXPECT_DOUBLE_EQ(half.task->Reward(), (0.75 + 4) / 5);
}

TEST(Episode, WrongSizesAreRefused) {
  EpisodeDriver driver("walker_walk");
  std::vector<double> small(23);
  EXPECT_EQ(driver.task->Reset(0, {small.data(), small.size()}).code, StatusCode::kInvalidArgument);
  ASSERT_TRUE(driver.Reset(0).ok());
  driver.action.resize(5);
  const Status status = driver.Step();
  EXPECT_EQ(status.code, StatusCode::kInvalidArgument);
  EXPECT_NE(std::strstr(status.message, "expected 6"), nullptr) << status.message;
  EXPECT_NE(std::strstr(status.message, "got 5"), nullptr) << status.message;
}

// Runs in an empty folder, where nothing must be written.
class EngineComplaint : public testing::Test {
 protected:
  EngineComplaint()
      : before_(std::filesystem::current_path()),
        folder_(std::filesystem::path(testing::TempDir()) /
                ("env_dmc_engine_complaint_" + std::to_string(::getpid()))) {
    std::filesystem::create_directory(folder_);
    std::filesystem::current_path(folder_);
  }
  ~EngineComplaint() override {
    EXPECT_TRUE(std::filesystem::is_empty(folder_)) << "something was written";
    std::filesystem::current_path(before_);
    std::filesystem::remove_all(folder_);
  }

  static void ExpectDiverged(const Status& status, const char* what) {
    EXPECT_EQ(status.code, StatusCode::kDiverged);
    EXPECT_NE(std::strstr(status.message, what), nullptr) << status.message;
  }

 private:
  std::filesystem::path before_;
  std::filesystem::path folder_;
};

TEST_F(EngineComplaint, BadAccelerationIsADivergenceWithTaskAndStep) {
  EpisodeDriver driver("walker_walk");
  ASSERT_TRUE(driver.Reset(0).ok());
  for (int step = 0; step < 6; ++step) ASSERT_TRUE(driver.Step().ok());
  driver.task->data()->qfrc_applied[2] = 1e300;
  const Status status = driver.Step();
  ExpectDiverged(status, "walker_walk");
  ExpectDiverged(status, "step 7");
  ExpectDiverged(status, "QACC");
  EXPECT_EQ(driver.Step().code, StatusCode::kFailedPrecondition);
  EXPECT_TRUE(driver.Reset(0).ok());
  EXPECT_TRUE(driver.Step().ok());
}

TEST_F(EngineComplaint, BadPositionOrVelocityIsADivergence) {
  EpisodeDriver driver("cartpole_swingup");
  ASSERT_TRUE(driver.Reset(0).ok());
  driver.task->data()->qpos[0] = 1e12;
  ExpectDiverged(driver.Step(), "QPOS");
  ASSERT_TRUE(driver.Reset(0).ok());
  driver.task->data()->qvel[1] = std::nan("");
  ExpectDiverged(driver.Step(), "QVEL");
}

TEST_F(EngineComplaint, FullBuffersAreADivergence) {
  EpisodeDriver driver("cheetah_run");
  ASSERT_TRUE(driver.Reset(0).ok());
  ASSERT_GT(driver.task->data()->ncon, 1);
  driver.task->model()->nconmax = 1;
  ExpectDiverged(driver.Step(), "contact");
}

TEST_F(EngineComplaint, AWarningDuringAResetIsADivergence) {
  EpisodeDriver driver("cheetah_run");
  driver.task->model()->nconmax = 1;
  ExpectDiverged(driver.Reset(0), "cheetah_run");
}

TEST_F(EngineComplaint, OldWarningsDoNotCount) {
  EpisodeDriver driver("walker_walk");
  ASSERT_TRUE(driver.Reset(0).ok());
  driver.task->data()->warning[mjWARN_INERTIA].number = 3;
  EXPECT_TRUE(driver.Step().ok());
}

// The cheetah meets the error in a physics step, the quadruped, always
// constrained, in a forward pass with actuation off.
TEST_F(EngineComplaint, AnErrorNeitherExitsNorWaits) {
  for (const char* name : {"cheetah_run", "quadruped_walk"}) {
    SCOPED_TRACE(name);
    EpisodeDriver driver(name);
    EpisodeDriver sound(name);
    ASSERT_TRUE(driver.Reset(0).ok());
    const int solver = driver.task->model()->opt.solver;
    driver.task->model()->opt.solver = 99;
    const Status status = driver.Reset(4);
    EXPECT_EQ(status.code, StatusCode::kInternal);
    EXPECT_NE(std::strstr(status.message, name), nullptr) << status.message;
    EXPECT_NE(std::strstr(status.message, "99"), nullptr) << status.message;
    // The instance recovers, actuation and all.
    driver.task->model()->opt.solver = solver;
    ASSERT_TRUE(driver.Reset(4).ok());
    ASSERT_TRUE(sound.Reset(4).ok());
    driver.action[0] = sound.action[0] = 1;
    ASSERT_TRUE(driver.Step().ok());
    ASSERT_TRUE(sound.Step().ok());
    EXPECT_EQ(driver.observation, sound.observation);
  }
}

}  // namespace
}  // namespace dreamsearch::dmc
