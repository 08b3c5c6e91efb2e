// hoot_test.cc - hoot against closed forms.
#include <gtest/gtest.h>

#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"

namespace dreamsearch {
namespace {

// The first cut is across component 0, the next ones across component 1: of four
// actions no two share a quarter of the box.
TEST(Hoot, EachActionHasACellOfItsOwn) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    ScriptedModel model = Bandit([](double) { return 0.0; }, 0);
    model.actions = 2;
    LoadedPlanner planner("hoot", &model);
    const std::vector<Edge> edges = RootEdges(planner.Plan(AsLatents(kRoot), {.seed = seed}));
    ASSERT_GE(edges.size(), 4u);
    EXPECT_NE(edges[0].a[0] < 0, edges[1].a[0] < 0);
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < i; ++j) {
        EXPECT_FALSE((edges[i].a[0] < 0) == (edges[j].a[0] < 0) &&
                     (edges[i].a[1] < 0) == (edges[j].a[1] < 0));
      }
    }
  }
}

// A cell at depth h is halved after split_visits (h + 1) visits of its action: with 3
// the root's first action is alone for three simulations, and of two actions in the
// halves one has six before a third appears.
TEST(Hoot, CellsAreHalvedAfterTheirVisits) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.5);
  const auto edges = [&model](int simulations) {
    LoadedPlanner planner("hoot", &model, {{"split_visits", 3}, {"simulations", simulations}});
    return RootEdges(planner.Plan(AsLatents(kRoot)));
  };
  EXPECT_EQ(edges(3).size(), 1u);
  EXPECT_EQ(edges(4).size(), 2u);
  int simulations = 5;
  while (edges(simulations).size() == 2) ++simulations;
  const std::vector<Edge> before = edges(simulations - 1);
  EXPECT_EQ(std::max(before[0].visits, before[1].visits), 6u);
}

// U = Qbar + c sqrt(2 ln n / N) + nu rho^h: without c and nu only the mean counts, so
// that the better of the first two actions takes all that follow; with a large c the
// visits are even.
TEST(Hoot, ExplorationSpreadsTheVisits) {
  const auto visits = [](double c) {
    ScriptedModel model = Bandit([](double a) { return a; }, 0);
    LoadedPlanner planner(
        "hoot", &model,
        {{"exploration", c}, {"nu", 0.0}, {"split_visits", 1000}, {"simulations", 3000}});
    const std::vector<Edge> edges = RootEdges(planner.Plan(AsLatents(kRoot)));
    EXPECT_EQ(edges.size(), 2u);
    return edges[1].visits;
  };
  // The second action is made at simulation 1001, and is played on only if it is
  // the better one or explored for.
  const std::uint64_t greedy = visits(0), even = visits(1e4);
  EXPECT_TRUE(greedy == 1 || greedy == 2000) << greedy;
  EXPECT_NEAR(static_cast<double>(even), 1500, 10);
}

TEST(Hoot, NearsTheOptimumWithItsBudget) {
  ScriptedModel model = Bandit([](double a) { return -(a - 0.3) * (a - 0.3); }, 0);
  double worst = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    LoadedPlanner planner("hoot", &model, {{"simulations", 2000}});
    const double a = planner.Plan(AsLatents(kRoot), {.seed = seed, .tree = false}).action[0];
    worst = std::max(worst, std::abs(a - 0.3));
  }
  // A uniform sample of the about 60 actions that the root gets would be off by 0.09
  // once in 20 times (0.91^30); cells are finer where it pays.
  EXPECT_LT(worst, 0.05);
}

TEST(Hoot, NoiseIsOnThePlayedActionOnly) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
  LoadedPlanner planner("hoot", &model);
  const Decision still = planner.Plan(AsLatents(kRoot));
  const Decision noisy = planner.Plan(AsLatents(kRoot), {.explore = true});
  ASSERT_EQ(still.tree.size(), noisy.tree.size());
  for (std::size_t i = 0; i < still.tree.size(); ++i) EXPECT_EQ(still.tree[i].a, noisy.tree[i].a);
  EXPECT_NE(still.action, noisy.action);
}

}  // namespace
}  // namespace dreamsearch
