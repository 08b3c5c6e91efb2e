#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"

namespace dreamsearch {
namespace {

TEST(Rollout, DepthCountsTransitionsNotStates) {
  for (const int depth : {1, 2, 10}) {
    ScriptedModel model = Counter(1);
    LoadedPlanner planner("rollout", &model, {{"depth", depth}, {"lambda", 1.0}});
    const Decision decision = planner.Plan(AsLatents(ScriptedState{}));
    // 2 + 4 + ... + 2^depth, then the value of the state counted `depth`.
    EXPECT_EQ(decision.result.value, std::exp2(depth + 1) - 2 + 1000 + depth);
    EXPECT_EQ(decision.result.depth, static_cast<std::uint32_t>(depth));
    EXPECT_EQ(model.transitions, 150u * static_cast<std::uint64_t>(depth));
    EXPECT_EQ(decision.result.simulations, 150u);
    EXPECT_EQ(decision.result.nodes, 150u * static_cast<std::uint32_t>(depth) + 1);
  }
}

TEST(Rollout, AllTrajectoriesAdvanceAsOneBatch) {
  ScriptedModel model = Counter(1);
  LoadedPlanner planner("rollout", &model);
  ASSERT_TRUE(planner.Plan(AsLatents(ScriptedState{})).status.ok());
  EXPECT_EQ(model.imagine_calls, 10u);
}

// The lambda-return as the mix of n-step returns that defines it (Sutton and Barto
// 2018, eq. 12.3), which the recursion must equal up to rounding.
TEST(Rollout, LambdaReturnIsTheMixOfNStepReturns) {
  constexpr int kDepth = 6;
  constexpr double kDiscount = 0.9;
  for (const double lambda : {0.0, 0.3, 0.95, 1.0}) {
    ScriptedModel model = Counter(kDiscount);
    LoadedPlanner planner("rollout", &model, {{"depth", kDepth}, {"lambda", lambda}});
    double expected = 0, rewards = 0;
    for (int n = 1; n <= kDepth; ++n) {
      rewards += std::pow(kDiscount, n - 1) * std::exp2(n);
      const double n_step = rewards + std::pow(kDiscount, n) * (1000 + n);
      expected += std::pow(lambda, n - 1) * (n < kDepth ? 1 - lambda : 1) * n_step;
    }
    const Decision decision = planner.Plan(AsLatents(ScriptedState{}));
    EXPECT_NEAR(decision.result.value, expected, 1e-12 * expected) << "lambda " << lambda;
  }
}

TEST(Rollout, DiscountIsTheModelsOfEachTransition) {
  ScriptedModel model = Counter(1);
  // Transition n is followed with chance 1 / n.
  model.transition = [](const ScriptedState& state, ScriptedModel::Action) {
    ScriptedTransition step;
    step.next.x[0] = state.x[0] + 1;
    step.reward = 1;
    step.discount = 1 / step.next.x[0];
    return step;
  };
  model.value = [](const ScriptedState&) { return 0.0; };
  LoadedPlanner planner("rollout", &model, {{"depth", 4}, {"lambda", 1.0}});
  const Decision decision = planner.Plan(AsLatents(ScriptedState{}));
  EXPECT_DOUBLE_EQ(decision.result.value, 1 + 1.0 * (1 + 0.5 * (1 + 1.0 / 3)));
}

// A candidate worth +1 at once against what it is worth in the critic's eyes.
TEST(Rollout, TheCandidatesOwnRewardCounts) {
  ScriptedModel model = Bandit([](double a) { return -(a - 0.5) * (a - 0.5); }, 0.99);
  LoadedPlanner planner("rollout", &model);
  const Decision decision = planner.Plan(AsLatents(ScriptedState{}));
  // The nearest of 150 candidates with uniform density 1/2; beyond 0.1 lies a
  // chance of 0.9^150 = 1e-7.
  EXPECT_NEAR(decision.action[0], 0.5, 0.1);
  const auto nearest = std::min_element(
      decision.tree.begin(), decision.tree.begin() + 150,
      [](const Edge& a, const Edge& b) { return std::abs(a.a[0] - 0.5) < std::abs(b.a[0] - 0.5); });
  EXPECT_EQ(decision.action, nearest->a);
}

TEST(Rollout, CandidatesAreActorSamplesThenUniform) {
  ScriptedModel model = Counter(1);
  model.sample = [](const ScriptedState&, Random&, View<double> action) { action[0] = 0.125; };
  LoadedPlanner planner("rollout", &model,
                        {{"actor_candidates", 7}, {"uniform_candidates", 40}, {"depth", 2}});
  const Decision decision = planner.Plan(AsLatents(ScriptedState{}));
  ASSERT_EQ(decision.tree.size(), 2u * 47u);
  double low = 1, high = -1;
  for (std::size_t i = 0; i < 47; ++i) {
    const double a = decision.tree[i].a[0];
    EXPECT_EQ(decision.tree[i].parent, -1);
    EXPECT_EQ(a == 0.125, i < 7);
    if (i >= 7) {
      low = std::min(low, a);
      high = std::max(high, a);
    }
  }
  // 40 uniforms all above -0.5, or all below 0.5: 0.75^40 = 1e-5 each.
  EXPECT_LT(low, -0.5);
  EXPECT_GT(high, 0.5);
  EXPECT_EQ(model.samples_asked, 7u);
}

TEST(Rollout, ContinuationIsTheModeOrASampleAndNeverNoisy) {
  for (const bool sampled : {false, true}) {
    ScriptedModel model = Counter(1);
    model.mode = [](const ScriptedState&, View<double> action) { action[0] = 0.25; };
    model.sample = [](const ScriptedState&, Random&, View<double> action) { action[0] = -0.5; };
    LoadedPlanner planner("rollout", &model,
                          {{"actor_candidates", 3},
                           {"uniform_candidates", 0},
                           {"depth", 4},
                           {"continuation", sampled ? "sample" : "mode"}});
    const Decision decision = planner.Plan(AsLatents(ScriptedState{}), {.explore = true});
    ASSERT_EQ(decision.tree.size(), 12u);
    for (std::size_t i = 0; i < 12; ++i) {
      if (i < 3) {
        EXPECT_NE(decision.tree[i].a[0], -0.5) << "a candidate without noise";
      } else {
        EXPECT_EQ(decision.tree[i].a[0], sampled ? -0.5 : 0.25);
      }
    }
  }
}

TEST(Rollout, TiesGoToTheFirstCandidate) {
  ScriptedModel model = Counter(1);
  LoadedPlanner planner("rollout", &model);
  const Decision decision = planner.Plan(AsLatents(ScriptedState{}));
  EXPECT_EQ(decision.action, decision.tree.front().a);
}

// With the exact critic and the optimal continuation every lambda-return of a
// candidate is its exact Q, whatever lambda and depth.
TEST(Rollout, ExactCriticGivesExactValues) {
  for (const double lambda : {0.0, 0.5, 1.0}) {
    for (const int depth : {1, 2, 5}) {
      ScriptedModel model = Chain::Model(/*wrong_mode=*/false);
      LoadedPlanner planner("rollout", &model, {{"lambda", lambda}, {"depth", depth}});
      const Decision decision = planner.Plan(AsLatents(ScriptedState{}));
      EXPECT_NEAR(decision.result.value, 8.1, 1e-12);
      for (std::size_t i = 0; i < 150; ++i) {
        EXPECT_NEAR(decision.tree[i].q, decision.tree[i].a[0] > 0 ? 8.1 : 1, 1e-12);
      }
    }
  }
}

TEST(Rollout, RefusesNoCandidates) {
  ScriptedModel model = Counter(1);
  EXPECT_THROW(
      LoadedPlanner("rollout", &model, {{"actor_candidates", 0}, {"uniform_candidates", 0}}),
      std::runtime_error);
}

}  // namespace
}  // namespace dreamsearch
