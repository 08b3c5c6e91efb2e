// Pictures of the suite's tasks: the right way up, not mirrored, and without a trace in the
// physics.
#include <gtest/gtest.h>

#include "tests/plugins/env_dmc/episode_driver.h"

namespace dreamsearch::dmc {
namespace {

constexpr std::uint32_t kWidth = 160, kHeight = 120;

std::vector<std::uint8_t> PictureOf(ControlTask* task, std::uint32_t camera = 0) {
  std::vector<std::uint8_t> rgb(kWidth * kHeight * 3);
  const Status status = task->Render({kWidth, kHeight, camera}, {rgb.data(), rgb.size()});
  EXPECT_TRUE(status.ok()) << status.message;
  return rgb;
}

// Where the body's own material, a light brown, is in the picture: its mean column and row.
struct Place {
  double x = 0, y = 0;
  int pixels = 0;
};
Place BrownOf(const std::vector<std::uint8_t>& rgb) {
  Place place;
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      const std::uint8_t* pixel = rgb.data() + (y * kWidth + x) * 3;
      if (pixel[0] < 120 || pixel[0] < pixel[2] + 50) continue;
      place.x += x;
      place.y += y;
      ++place.pixels;
    }
  }
  place.x /= std::max(place.pixels, 1);
  place.y /= std::max(place.pixels, 1);
  return place;
}

// The first joint is the cart's slide along x, which the camera sees to its right; the second the
// pole's hinge, upright at 0.
Place CartAndPole(double slide, double hinge) {
  EpisodeDriver driver("cartpole_swingup");
  EXPECT_TRUE(driver.Reset(0).ok());
  driver.task->data()->qpos[0] = slide;
  driver.task->data()->qpos[1] = hinge;
  driver.task->AdoptPhysics(0);
  return BrownOf(PictureOf(driver.task.get()));
}

TEST(Render, AnUprightPoleStandsAboveAHangingOne) {
  const Place up = CartAndPole(0, 0), down = CartAndPole(0, 3.14159);
  ASSERT_GT(up.pixels, 20);
  ASSERT_GT(down.pixels, 20);
  EXPECT_LT(up.y, down.y - 10);
  EXPECT_NEAR(up.x, kWidth / 2.0, 3);
}

TEST(Render, WhatMovesToTheRightIsSeenFurtherRight) {
  EXPECT_GT(CartAndPole(0.8, 0).x, CartAndPole(0, 0).x + 10);
  EXPECT_LT(CartAndPole(-0.8, 0).x, CartAndPole(0, 0).x - 10);
}

TEST(Render, APictureLeavesNoTraceInTheEpisode) {
  for (const char* name : {"walker_walk", "quadruped_run", "acrobot_swingup"}) {
    EpisodeDriver watched(name), alone(name);
    ASSERT_TRUE(watched.Reset(7).ok());
    ASSERT_TRUE(alone.Reset(7).ok());
    NumpyRandom first(1), second(1);
    for (int step = 0; step < 20; ++step) {
      watched.DrawAction(first);
      alone.DrawAction(second);
      PictureOf(watched.task.get());
      ASSERT_TRUE(watched.Step().ok());
      ASSERT_TRUE(alone.Step().ok());
      ASSERT_EQ(watched.observation, alone.observation) << name << ", step " << step;
      ASSERT_EQ(watched.result.reward, alone.result.reward);
    }
    EXPECT_EQ(watched.Save(), alone.Save());
  }
}

TEST(Render, EqualStatesHaveEqualPicturesInEverySize) {
  EpisodeDriver driver("cheetah_run");
  ASSERT_TRUE(driver.Reset(3).ok());
  const auto picture = PictureOf(driver.task.get());
  EXPECT_GT(BrownOf(picture).pixels, 50);
  std::vector<std::uint8_t> large(640 * 480 * 3);
  ASSERT_TRUE(driver.task->Render({640, 480, 0}, {large.data(), large.size()}).ok());
  EXPECT_EQ(PictureOf(driver.task.get()), picture);
}

TEST(Render, WrongRequestsAreRefusedWithWhatIsKnown) {
  EpisodeDriver driver("walker_walk");
  ASSERT_TRUE(driver.Reset(0).ok());
  std::vector<std::uint8_t> rgb(kWidth * kHeight * 3);
  const View<std::uint8_t> view{rgb.data(), rgb.size()};
  EXPECT_EQ(driver.task->Render({kWidth, kHeight + 1, 0}, view).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(driver.task->Render({0, 0, 0}, {rgb.data(), 0}).code, StatusCode::kInvalidArgument);
  const Status camera = driver.task->Render({kWidth, kHeight, 9}, view);
  EXPECT_EQ(camera.code, StatusCode::kFailedPrecondition);
  EXPECT_NE(std::string(camera.message).find("0 side, 1 back"), std::string::npos)
      << camera.message;
}

// Every task has a camera that sees its body.
TEST(Render, EveryTaskShowsSomething) {
  for (const TaskEntry& entry : kTasks) {
    const std::string name = entry.name;
    EpisodeDriver driver(name);
    ASSERT_TRUE(driver.Reset(0).ok());
    const auto picture = PictureOf(driver.task.get());
    EXPECT_GT(BrownOf(picture).pixels, 15) << name;
  }
}

}  // namespace
}  // namespace dreamsearch::dmc
