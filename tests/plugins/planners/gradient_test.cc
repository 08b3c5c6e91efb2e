// gradient_test.cc - the planner `gradient` against closed forms.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"

namespace dreamsearch {
namespace {

using Lq = LinearQuadratic;

// The linear-quadratic problem whose actor always samples `action`.
ScriptedModel LqFrom(double action) {
  ScriptedModel model = Lq::Model();
  model.sample = [action](const ScriptedState&, Random&, View<double> a) { a[0] = action; };
  return model;
}

ScriptedState At(double x) {
  ScriptedState state;
  state.x[0] = x;
  return state;
}

double Best(double x) { return -Lq::K(Lq::P()) * x; }

// dQ / da at (s, a).
double Slope(double s, double a) {
  return -2 * ((1 + Lq::kDiscount * Lq::P()) * (s + Lq::kGain * a) * Lq::kGain + Lq::kEffort * a);
}

TEST(Gradient, OneStepMovesTheActorsActionByTheStepSizeTimesTheSlopeOfQ) {
  for (const double start : {0.6, -0.3}) {
    ScriptedModel model = LqFrom(start);
    LoadedPlanner planner("gradient", &model,
                          {{"sequences", 1}, {"horizon", 1}, {"step_size", 0.25}});
    const Decision decision = planner.Plan(AsLatents(At(Lq::kStart)));
    ASSERT_TRUE(decision.status.ok()) << decision.status.message;
    const double moved = start + 0.25 * Slope(Lq::kStart, start);
    // Central differences of a parabola err by rounding alone, eps / 1e-5.
    EXPECT_NEAR(decision.action[0], moved, 1e-9);
    EXPECT_NEAR(decision.result.value, Lq::Q(Lq::kStart, moved), 1e-9);
    EXPECT_NEAR(planner.Metric(decision, "return_gain"),
                Lq::Q(Lq::kStart, moved) - Lq::Q(Lq::kStart, start), 1e-9);
    EXPECT_NEAR(planner.Metric(decision, "gradient_norm"), std::abs(Slope(Lq::kStart, start)),
                1e-9);
    EXPECT_NEAR(planner.Metric(decision, "mode_distance"), std::abs(moved), 1e-9);
  }
}

TEST(Gradient, ManyStepsReachTheOptimalActionWhateverTheHorizon) {
  for (const int horizon : {1, 2, 5}) {
    ScriptedModel model = LqFrom(0.8);
    LoadedPlanner planner("gradient", &model,
                          {{"sequences", 1}, {"horizon", horizon}, {"iterations", 1000}});
    const Decision decision = planner.Plan(AsLatents(At(Lq::kStart)));
    EXPECT_NEAR(decision.action[0], Best(Lq::kStart), 1e-6) << horizon;
    EXPECT_NEAR(decision.result.value, -Lq::P() * Lq::kStart * Lq::kStart, 1e-9) << horizon;
  }
}

TEST(Gradient, WithoutStepsItPlaysTheBestOfTheActorsSequences) {
  ScriptedModel model = Lq::Model();
  LoadedPlanner planner("gradient", &model, {{"sequences", 20}, {"horizon", 1}, {"iterations", 0}});
  const Decision decision = planner.Plan(AsLatents(At(Lq::kStart)));
  ASSERT_EQ(decision.tree.size(), 20u);
  double best = decision.tree[0].a[0];
  for (const Edge& edge : decision.tree) {
    EXPECT_NEAR(edge.q, Lq::Q(Lq::kStart, edge.a[0]), 1e-12);
    if (Lq::Q(Lq::kStart, edge.a[0]) > Lq::Q(Lq::kStart, best)) best = edge.a[0];
  }
  EXPECT_EQ(decision.action[0], best);
  EXPECT_EQ(planner.Metric(decision, "return_gain"), 0);
  EXPECT_EQ(model.gradients_asked, 0u);
}

TEST(Gradient, StopsAtTheBoundsOfActions) {
  ScriptedModel model = LqFrom(0.9);
  LoadedPlanner planner("gradient", &model,
                        {{"sequences", 1}, {"horizon", 1}, {"step_size", 1000}});
  EXPECT_EQ(planner.Plan(AsLatents(At(Lq::kStart))).action[0], -1);
}

// The step went too far: the return that chooses is the one of the moved actions.
TEST(Gradient, ChoosesByTheReturnAfterTheStep) {
  ScriptedModel model = Lq::Model();
  int asked = 0;
  model.sample = [&asked](const ScriptedState&, Random&, View<double> a) {
    a[0] = asked++ == 0 ? Best(Lq::kStart) : 0.9;  // the first sequence cannot be improved
  };
  LoadedPlanner planner("gradient", &model,
                        {{"sequences", 2}, {"horizon", 1}, {"step_size", 1000}});
  const Decision decision = planner.Plan(AsLatents(At(Lq::kStart)));
  EXPECT_NEAR(decision.action[0], Best(Lq::kStart), 1e-4);
}

TEST(Gradient, CostsWhatItsPageSays) {
  ScriptedModel model = Lq::Model();
  LoadedPlanner planner("gradient", &model);
  const Decision decision = planner.Plan(AsLatents(At(Lq::kStart)));
  ASSERT_TRUE(decision.status.ok());
  EXPECT_EQ(model.gradients_asked, 15u);
  EXPECT_EQ(model.transitions, 25u);
  EXPECT_EQ(decision.result.simulations, 5u);
  EXPECT_EQ(decision.result.nodes, 16u);
  EXPECT_EQ(decision.result.depth, 3u);
}

}  // namespace
}  // namespace dreamsearch
