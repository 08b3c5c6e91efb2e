#include <gtest/gtest.h>

#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"

namespace dreamsearch {
namespace {

// The mode is 0.25, every sample is -0.5.
ScriptedModel ModeAndSample() {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.5);
  model.mode = [](const ScriptedState&, View<double> action) { action[0] = 0.25; };
  model.sample = [](const ScriptedState&, Random&, View<double> action) { action[0] = -0.5; };
  model.value = [](const ScriptedState&) { return 4.0; };
  return model;
}

TEST(Dreamer, PlaysTheModeAndReportsTheCritic) {
  ScriptedModel model = ModeAndSample();
  for (const char* noise_on : {"mode", "sample"}) {
    LoadedPlanner planner("dreamer", &model, {{"noise_on", noise_on}});
    const Decision decision = planner.Plan(AsLatents(ScriptedState{}));
    EXPECT_EQ(decision.action[0], 0.25);
    EXPECT_EQ(decision.result.value, 4.0);
    EXPECT_EQ(decision.result.simulations, 0u);
    EXPECT_EQ(decision.result.depth, 0u);
    EXPECT_EQ(planner.Metric(decision, "mode_distance"), 0);
  }
  EXPECT_EQ(model.transitions, 0u);
}

// Mean and standard deviation of many explored actions; 0.05 is narrow enough that
// clipping does not matter. Tolerances are five standard errors.
TEST(Dreamer, NoiseIsGaussianAroundModeOrSample) {
  constexpr int kDecisions = 4000;
  constexpr double kStd = 0.05;
  for (const bool on_sample : {false, true}) {
    ScriptedModel model = ModeAndSample();
    LoadedPlanner planner("dreamer", &model,
                          {{"noise_on", on_sample ? "sample" : "mode"}, {"noise_std", kStd}});
    double sum = 0, squares = 0;
    const double center = on_sample ? -0.5 : 0.25;
    for (int i = 0; i < kDecisions; ++i) {
      const Decision decision = planner.Plan(
          AsLatents(ScriptedState{}), {.explore = true, .seed = static_cast<std::uint64_t>(i)});
      const double offset = decision.action[0] - center;
      sum += offset;
      squares += offset * offset;
      EXPECT_DOUBLE_EQ(planner.Metric(decision, "mode_distance"),
                       std::abs(decision.action[0] - 0.25));
    }
    EXPECT_NEAR(sum / kDecisions, 0, 5 * kStd / std::sqrt(kDecisions));
    EXPECT_NEAR(std::sqrt(squares / kDecisions), kStd, 5 * kStd / std::sqrt(2.0 * kDecisions));
  }
}

TEST(Dreamer, NoiseIsClippedToTheBounds) {
  ScriptedModel model = ModeAndSample();
  LoadedPlanner planner("dreamer", &model, {{"noise_std", 10.0}});
  int at_a_bound = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const Decision decision =
        planner.Plan(AsLatents(ScriptedState{}), {.explore = true, .seed = seed});
    EXPECT_LE(std::abs(decision.action[0]), 1);
    at_a_bound += std::abs(decision.action[0]) == 1;
  }
  EXPECT_GT(at_a_bound, 80);
}

}  // namespace
}  // namespace dreamsearch
