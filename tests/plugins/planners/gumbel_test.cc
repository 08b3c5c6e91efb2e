// gumbel_test.cc - mcts_gumbel against closed forms.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"

namespace dreamsearch {
namespace {

// Samples are 0.01, 0.02, 0.03, ... in the order they are asked for.
ScriptedModel Numbered() {
  ScriptedModel model = Bandit([](double a) { return a; }, 0);
  model.sample = [count = 0](const ScriptedState&, Random&, View<double> action) mutable {
    action[0] = 0.01 * ++count;
  };
  return model;
}

// 16 simulations, 4 actions, 2 phases: 16 / (2 * 4) = 2 visits for each of the four,
// then 16 / (2 * 2) = 4 more for each of the better two.
TEST(Gumbel, SequentialHalvingSpendsVisitsOnTheBetterHalf) {
  ScriptedModel model = Numbered();
  LoadedPlanner planner("mcts_gumbel", &model,
                        {{"simulations", 16}, {"root_actions", 4}, {"children", 2}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  ASSERT_TRUE(decision.status.ok()) << decision.status.message;
  const std::vector<Edge> edges = RootEdges(decision);
  ASSERT_EQ(edges.size(), 4u);
  const std::uint64_t visits[] = {2, 2, 6, 6};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(edges[i].visits, visits[i]);
  EXPECT_DOUBLE_EQ(decision.action[0], 0.04);
  EXPECT_DOUBLE_EQ(decision.result.value, 0.04);
}

// Whatever the numbers, the simulations are all spent and no visit count differs by
// more than a phase's from what halving allows: counts never grow with the rank.
// ln of the weights is linear in Q, with the slope of sigma: the noise of the root has no part.
TEST(Gumbel, ThePolicyIsTheSoftmaxOfTheRootsQs) {
  ScriptedModel model = Numbered();
  LoadedPlanner planner("mcts_gumbel", &model,
                        {{"simulations", 16}, {"root_actions", 4}, {"children", 2}});
  const Decision decision = planner.Plan(AsLatents(kRoot), {.policy = 4});
  ASSERT_TRUE(decision.status.ok()) << decision.status.message;
  double low = 1, high = -1;
  for (const Edge& edge : decision.tree) {
    if (edge.visits == 0) continue;
    low = std::min(low, edge.q);
    high = std::max(high, edge.q);
  }
  // 6 visits of the better two.
  const double slope = (50 + 6) * 0.1 / (high - low);
  for (std::size_t k = 1; k < 4; ++k) {
    const double step = decision.policy_actions[k - 1][0] - decision.policy_actions[k][0];
    EXPECT_NEAR(step, 0.01, 1e-12);
    EXPECT_NEAR(std::log(decision.policy_weights[k - 1] / decision.policy_weights[k]), slope * step,
                1e-9);
  }
}

TEST(Gumbel, AnyBudgetIsSpentInFull) {
  for (const int simulations : {1, 2, 3, 7, 50, 113}) {
    for (const int actions : {1, 2, 3, 5, 16, 200}) {
      ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
      LoadedPlanner planner("mcts_gumbel", &model,
                            {{"simulations", simulations}, {"root_actions", actions}});
      const Decision decision = planner.Plan(AsLatents(kRoot));
      ASSERT_TRUE(decision.status.ok());
      const std::vector<Edge> edges = RootEdges(decision);
      EXPECT_EQ(edges.size(), static_cast<std::size_t>(std::min(simulations, actions)));
      std::uint64_t visits = 0, most = 0;
      for (const Edge& edge : edges) {
        visits += edge.visits;
        most = std::max(most, edge.visits);
      }
      EXPECT_EQ(visits, static_cast<std::uint64_t>(simulations));
      for (const Edge& edge : edges) {
        EXPECT_GE(edge.visits, 1u);
        if (edge.a == decision.action) {
          EXPECT_EQ(edge.visits, most);
        }
      }
    }
  }
}

// With c_scale 0 values do not count; then the largest g decides, that of the first
// sample: the search plays a sample of the actor.
TEST(Gumbel, WithoutValuesItPlaysASampleOfTheActor) {
  ScriptedModel model = Numbered();
  LoadedPlanner planner("mcts_gumbel", &model, {{"c_scale", 0.0}, {"noise_std", 0.0}});
  EXPECT_DOUBLE_EQ(planner.Plan(AsLatents(kRoot), {.explore = true}).action[0], 0.01);
}

// The values decide the more, the larger they are against the Gumbel noise.
TEST(Gumbel, NoiseIsForExplorationOnly) {
  const auto mean_action = [](bool explore, double gumbel_scale) {
    double mean = 0;
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      ScriptedModel model = Numbered();
      LoadedPlanner planner("mcts_gumbel", &model,
                            {{"gumbel_scale", gumbel_scale}, {"noise_std", 0.0}});
      mean += planner.Plan(AsLatents(kRoot), {.explore = explore, .seed = seed}).action[0] / 100;
    }
    return mean;
  };
  EXPECT_DOUBLE_EQ(mean_action(false, 100), 0.16);
  EXPECT_LT(mean_action(true, 100), 0.08);
  EXPECT_GT(mean_action(true, 0.1), 0.15);
}

// Below the root pi' decides: with c_scale 0 it is uniform, and visits are even.
TEST(Gumbel, UniformImprovedPolicyVisitsEvenly) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
  LoadedPlanner planner(
      "mcts_gumbel", &model,
      {{"simulations", 41}, {"root_actions", 1}, {"children", 8}, {"c_scale", 0.0}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  int children = 0;
  for (const Edge& edge : decision.tree) {
    if (edge.parent != 0) continue;
    ++children;
    EXPECT_EQ(edge.visits, 5u);
  }
  EXPECT_EQ(children, 8);
}

TEST(Gumbel, LeafBatchSpendsTheSameSimulations) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
  LoadedPlanner planner("mcts_gumbel", &model, {{"leaf_batch", 8}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  ASSERT_TRUE(decision.status.ok());
  EXPECT_EQ(model.transitions, 50u);
  EXPECT_LE(model.imagine_calls, 20u) << "at best 7";
}

}  // namespace
}  // namespace dreamsearch
