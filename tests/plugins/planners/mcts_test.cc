// mcts_test.cc - the tree searches of planner_mcts against closed forms.
// Over 400 lines: four searches share the scripted models and the reference search.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"

namespace dreamsearch {
namespace {

std::vector<Edge> Children(const std::vector<Edge>& tree, std::int64_t parent) {
  std::vector<Edge> children;
  for (const Edge& edge : tree) {
    if (edge.parent == parent) children.push_back(edge);
  }
  return children;
}

std::uint64_t VisitsBelow(const std::vector<Edge>& tree, std::int64_t parent) {
  std::uint64_t visits = 0;
  for (const Edge& edge : tree) {
    if (edge.parent == parent) visits += edge.visits;
  }
  return visits;
}

// Samples are 0.01, 0.02, 0.03, ... in the order they are asked for.
ScriptedModel Numbered(ScriptedModel model) {
  model.sample = [count = 0](const ScriptedState&, Random&, View<double> action) mutable {
    action[0] = 0.01 * ++count;
  };
  return model;
}

// Reward a, nothing after it. Simulation 1 adds a1 = 0.01 at the root; 2 finds
// n = 1 and one action, so it goes through a1 and adds 0.02 there; 3 finds n = 2,
// 1 < sqrt 2, and adds 0.03 at the root; 4 finds n = 3, 2 > sqrt 3, and selects:
//   extremes 0.01 and 0.03; exploration sqrt(3) / 2 * (1.25 + ln((3 + 19653) / 19652)) = 1.0827
//   0.01: Qbar 0 + 1.0827 / 3; 0.03: Qbar 1 + 1.0827 / 2
// so it goes through 0.03, which has no children, and adds 0.04 there.
TEST(MctsPw, VisitCountsOfTheFirstFourSimulations) {
  ScriptedModel model = Numbered(Bandit([](double a) { return a; }, 0));
  LoadedPlanner planner("mcts_pw", &model, {{"simulations", 4}, {"samples_ahead", 1}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  ASSERT_TRUE(decision.status.ok()) << decision.status.message;
  ASSERT_EQ(decision.tree.size(), 4u);
  const std::int64_t parents[] = {-1, 0, -1, 2};
  const std::uint64_t visits[] = {2, 1, 2, 1};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_DOUBLE_EQ(decision.tree[i].a[0], 0.01 * static_cast<double>(i + 1));
    EXPECT_EQ(decision.tree[i].parent, parents[i]);
    EXPECT_EQ(decision.tree[i].visits, visits[i]);
    EXPECT_DOUBLE_EQ(decision.tree[i].q, decision.tree[i].a[0]);
  }
  EXPECT_EQ(decision.result.depth, 2u);
  EXPECT_EQ(decision.result.nodes, 5u);
  EXPECT_EQ(decision.result.simulations, 4u);
  EXPECT_DOUBLE_EQ(decision.action[0], 0.03);
  EXPECT_DOUBLE_EQ(decision.result.value, 0.03);
  EXPECT_DOUBLE_EQ(planner.Metric(decision, "root_visit_entropy"), std::log(2));
  EXPECT_DOUBLE_EQ(planner.Metric(decision, "mode_distance"), 0.03);
  EXPECT_EQ(planner.Metric(decision, "root_children"), 2);
  EXPECT_DOUBLE_EQ(planner.Metric(decision, "mean_leaf_depth"), 1.5);
  EXPECT_NEAR(planner.Metric(decision, "q_gain"), 0.03 - (2 * 0.01 + 2 * 0.03) / 4, 1e-15);
}

// Two actions a node. Simulation 1 takes the first, 0.01 (all tie); 2 finds equal
// extremes, so exploration decides for the unvisited 0.02; then Qbar is 0 and 1:
//   3: exploration sqrt(2) / 2 * 1.25 = 0.884: 0 + 0.442 against 1 + 0.442, through 0.02,
//      whose own two actions are 0.03 and 0.04, and takes 0.03.
TEST(MctsFixed, VisitCountsOfTheFirstThreeSimulations) {
  ScriptedModel model = Numbered(Bandit([](double a) { return a; }, 0));
  LoadedPlanner planner("mcts_fixed", &model, {{"simulations", 3}, {"children", 2}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  ASSERT_EQ(decision.tree.size(), 4u);
  const std::int64_t parents[] = {-1, -1, 1, 1};
  const std::uint64_t visits[] = {1, 2, 1, 0};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(decision.tree[i].parent, parents[i]);
    EXPECT_EQ(decision.tree[i].visits, visits[i]);
    EXPECT_EQ(decision.tree[i].expanded, visits[i] > 0);
    EXPECT_EQ(decision.tree[i].prior, 0.5);
  }
}

// Reward 1 and value 0 everywhere, whatever is done: a return that stops at its leaf is its depth,
// so the action that was sampled first looks best. At equal depth they are worth the same.
TEST(Mcts, ReturnsOfEqualDepthDoNotFavourTheFirstAction) {
  for (const char* name : {"mcts_pw", "mcts_fixed", "mcts_gumbel"}) {
    for (const int batch : {1, 4}) {
      ScriptedModel model = Numbered(Bandit([](double) { return 1.0; }, 1));
      LoadedPlanner planner(name, &model,
                            {{"simulations", 40}, {"equal_depth", 30}, {"leaf_batch", batch}});
      const Decision decision = planner.Plan(AsLatents(kRoot));
      ASSERT_TRUE(decision.status.ok()) << decision.status.message;
      for (const Edge& edge : decision.tree) {
        if (edge.visits == 0) continue;
        std::uint64_t depth = 1;
        for (std::int64_t at = edge.parent; at >= 0;
             at = decision.tree[static_cast<std::size_t>(at)].parent) {
          ++depth;
        }
        EXPECT_DOUBLE_EQ(edge.q, static_cast<double>(30 - depth + 1)) << name << " " << batch;
      }
    }
  }
  ScriptedModel model = Numbered(Bandit([](double) { return 1.0; }, 1));
  const auto most = [&](int equal_depth) {
    LoadedPlanner planner("mcts_pw", &model, {{"simulations", 50}, {"equal_depth", equal_depth}});
    std::uint64_t visits = 0;
    for (const Edge& edge : Children(planner.Plan(AsLatents(kRoot)).tree, -1)) {
      visits = std::max(visits, edge.visits);
    }
    return visits;
  };
  EXPECT_GE(most(0), 40u);
  EXPECT_LE(most(60), 20u);
}

// The rollout follows the mode, here 0.5, and ends with the value: x' = x / 2 + a, reward x', value
// x.
TEST(Mcts, ALeafIsCarriedOnByTheActorsMode) {
  ScriptedModel model = Numbered(Bandit([](double) { return 0.0; }, 1));
  model.mode = [](const ScriptedState&, View<double> action) { action[0] = 0.5; };
  model.value = [](const ScriptedState& state) { return state.x[0]; };
  model.transition = [](const ScriptedState& state, ScriptedModel::Action a) {
    ScriptedTransition step;
    step.next.x[0] = 0.5 * state.x[0] + a[0];
    step.reward = step.next.x[0];
    step.discount = 0.5;
    return step;
  };
  LoadedPlanner planner("mcts_pw", &model, {{"simulations", 1}, {"equal_depth", 3}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  const double x1 = decision.tree[0].a[0], x2 = x1 / 2 + 0.5, x3 = x2 / 2 + 0.5;
  EXPECT_DOUBLE_EQ(decision.tree[0].value, x2 + 0.5 * x3 + 0.25 * x3);
  EXPECT_DOUBLE_EQ(decision.tree[0].q, x1 + 0.5 * decision.tree[0].value);
}

// Every edge's N is one more than the visits below it, every Q is the mean of the
// returns that its subtree implies.
TEST(Mcts, CountsAndValuesAreConsistent) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    ScriptedModel model = Bandit([](double a) { return std::sin(7 * a); }, 0.875);
    model.value = [](const ScriptedState& state) { return 3 * state.x[0]; };
    model.transition = [](const ScriptedState& state, ScriptedModel::Action a) {
      ScriptedTransition step;
      step.next.x[0] = 0.5 * state.x[0] + a[0];
      step.reward = std::sin(7 * a[0]);
      step.discount = 0.875;
      return step;
    };
    LoadedPlanner planner(name, &model, {{"simulations", 200}});
    const Decision decision = planner.Plan(AsLatents(kRoot));
    EXPECT_EQ(VisitsBelow(decision.tree, -1), 200u);
    for (std::size_t i = 0; i < decision.tree.size(); ++i) {
      const Edge& edge = decision.tree[i];
      if (edge.visits == 0) continue;
      const std::int64_t index = static_cast<std::int64_t>(i);
      EXPECT_EQ(edge.visits, 1 + VisitsBelow(decision.tree, index));
      double after = edge.value;
      for (const Edge& child : Children(decision.tree, index)) {
        after += static_cast<double>(child.visits) * child.q;
      }
      const double q = edge.reward + edge.discount * after / static_cast<double>(edge.visits);
      EXPECT_NEAR(edge.q, q, 1e-12);
    }
  }
}

TEST(MctsPw, ChildrenNeverExceedTheWideningRule) {
  for (const double constant : {0.5, 1.0, 3.0}) {
    for (const double exponent : {0.0, 0.25, 0.5, 0.75, 1.0}) {
      ScriptedModel model = Bandit([](double a) { return std::cos(3 * a); }, 0.9);
      LoadedPlanner planner(
          "mcts_pw", &model,
          {{"simulations", 300}, {"widening_constant", constant}, {"widening_exponent", exponent}});
      const Decision decision = planner.Plan(AsLatents(kRoot));
      for (std::int64_t node = -1; node < static_cast<std::int64_t>(decision.tree.size()); ++node) {
        const double n = static_cast<double>(VisitsBelow(decision.tree, node));
        if (n == 0) continue;
        const double children = static_cast<double>(Children(decision.tree, node).size());
        const double bound = std::ceil(constant * std::pow(n, exponent));
        EXPECT_LE(children, std::max(1.0, bound)) << "n " << n;
        // And the rule is used up: the last visit found enough of them, or added one.
        EXPECT_GE(children, std::floor(std::min(n, constant * std::pow(n - 1, exponent))))
            << "n " << n;
      }
    }
  }
}

// The actor is asked for four actions at a time; those that wait are used in order and
// belong to their node.
TEST(MctsPw, SamplesAheadWaitForTheirNode) {
  ScriptedModel model;
  model.transition = [](const ScriptedState& state, ScriptedModel::Action a) {
    ScriptedTransition step;
    step.next.x[0] = 10 * state.x[0] + a[0];
    step.reward = 1;
    step.discount = 0.9;
    return step;
  };
  // The action is the state it was sampled at, and the number of the sample.
  std::map<double, int> asked;
  model.sample = [&asked](const ScriptedState& state, Random&, View<double> action) {
    action[0] = state.x[0] + 0.001 * ++asked[state.x[0]];
  };
  LoadedPlanner planner("mcts_pw", &model, {{"simulations", 100}, {"samples_ahead", 4}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  const std::vector<Edge> root = Children(decision.tree, -1);
  ASSERT_EQ(root.size(), 10u);
  for (std::size_t i = 0; i < root.size(); ++i) {
    EXPECT_DOUBLE_EQ(root[i].a[0], 0.001 * static_cast<double>(i + 1));
  }
  EXPECT_EQ(asked[0], 12) << "three times four";
  for (const Edge& child : Children(decision.tree, 0)) {
    EXPECT_NEAR(child.a[0], 0.001, 0.0105) << "sampled at the state 0.001";
    EXPECT_GT(child.a[0], 0.001);
  }
}

TEST(MctsPw, ConstantAndExponentWidenTheRoot) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
  const auto root_children = [&model](double constant, double exponent) {
    LoadedPlanner planner(
        "mcts_pw", &model,
        {{"simulations", 100}, {"widening_constant", constant}, {"widening_exponent", exponent}});
    return Children(planner.Plan(AsLatents(kRoot)).tree, -1).size();
  };
  EXPECT_EQ(root_children(1, 0.5), 10u);
  EXPECT_EQ(root_children(2, 0.5), 20u);
  EXPECT_EQ(root_children(1, 0), 1u);
  // At n = 1 there is one action and 1 < 1 fails; from n = 2 on there is always room.
  EXPECT_EQ(root_children(1, 1), 99u);
}

// Actions of an actor that always proposes 2 (no action: uniform ones are told apart by it).
ScriptedModel ProposesTwo() {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
  model.sample = [](const ScriptedState&, Random&, View<double> action) { action[0] = 2; };
  return model;
}

TEST(MctsPw, TheRootsActionsCanAllBeThereFromTheStart) {
  for (const int batch : {1, 4}) {
    ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
    LoadedPlanner planner("mcts_pw", &model,
                          {{"simulations", 50}, {"root_actions", 20}, {"leaf_batch", batch}});
    const Decision decision = planner.Plan(AsLatents(kRoot));
    ASSERT_TRUE(decision.status.ok()) << decision.status.message;
    EXPECT_EQ(Children(decision.tree, -1).size(), 20u);
    EXPECT_EQ(VisitsBelow(decision.tree, -1), 50u);
    for (std::int64_t node = 0; node < static_cast<std::int64_t>(decision.tree.size()); ++node) {
      const double n = static_cast<double>(VisitsBelow(decision.tree, node));
      if (n == 0) continue;
      EXPECT_LE(static_cast<double>(Children(decision.tree, node).size()), std::ceil(std::sqrt(n)));
    }
  }
}

TEST(Mcts, AShareOfTheRootsActionsIsUniform) {
  std::size_t uniform = 0, all = 0;
  std::vector<double> drawn;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    ScriptedModel model = ProposesTwo();
    LoadedPlanner planner("mcts_fixed", &model,
                          {{"simulations", 30}, {"children", 25}, {"root_uniform", 0.25}});
    const Decision decision = planner.Plan(AsLatents(kRoot), {.seed = seed});
    for (const Edge& edge : decision.tree) {
      if (edge.parent >= 0) {
        EXPECT_EQ(edge.a[0], 2) << "below the root the actor is asked";
        continue;
      }
      ++all;
      if (edge.a[0] == 2) continue;
      ++uniform;
      drawn.push_back(edge.a[0]);
    }
  }
  ASSERT_EQ(all, 1000u);
  EXPECT_NEAR(static_cast<double>(uniform), 250, 55) << "four deviations of 13.7";
  std::sort(drawn.begin(), drawn.end());
  for (std::size_t i = 0; i < drawn.size(); ++i) {  // Kolmogorov and Smirnov, one in 100,000
    const double expected = -1 + 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(uniform);
    EXPECT_NEAR(drawn[i], expected, 2 * 2.5 / std::sqrt(static_cast<double>(uniform)));
  }
  for (const auto& [share, expected] : {std::pair(0.0, 0u), std::pair(1.0, 7u)}) {
    ScriptedModel model = ProposesTwo();
    LoadedPlanner planner("mcts_pw", &model, {{"simulations", 40}, {"root_uniform", share}});
    std::size_t found = 0;
    for (const Edge& edge : Children(planner.Plan(AsLatents(kRoot)).tree, -1)) {
      found += edge.a[0] != 2;
    }
    EXPECT_EQ(found, expected) << share;
  }
}

// Powers of two scale without rounding, so every comparison must come out equal.
TEST(Mcts, MinMaxNormalisationMakesTheScaleOfRewardsIrrelevant) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    const auto plan = [name](double scale) {
      ScriptedModel model = Bandit([scale](double a) { return scale * std::sin(5 * a); }, 0.9);
      model.value = [scale](const ScriptedState&) { return scale * 0.25; };
      LoadedPlanner planner(name, &model, {{"simulations", 300}});
      return planner.Plan(AsLatents(kRoot));
    };
    const Decision small = plan(1);
    for (const double scale : {0x1p-20, 1024.0}) {
      const Decision large = plan(scale);
      ASSERT_EQ(small.tree.size(), large.tree.size());
      for (std::size_t i = 0; i < small.tree.size(); ++i) {
        EXPECT_EQ(small.tree[i].visits, large.tree[i].visits);
        EXPECT_EQ(scale * small.tree[i].q, large.tree[i].q);
      }
    }
  }
}

// Of a uniformly random action on the bandit -(a - 0.5)^2: E (a - 0.5)^2 = 1/3 + 1/4.
constexpr double kRandomRegret = 7.0 / 12;

double MeanRegret(const char* name, const Settings& settings) {
  double regret = 0;
  constexpr int kDecisions = 200;
  for (std::uint64_t seed = 0; seed < kDecisions; ++seed) {
    ScriptedModel model = Bandit([](double a) { return -(a - 0.5) * (a - 0.5); }, 0.99);
    LoadedPlanner planner(name, &model, settings);
    const double a = planner.Plan(AsLatents(kRoot), {.seed = seed}).action[0];
    regret += (a - 0.5) * (a - 0.5);
  }
  return regret / kDecisions;
}

// Reward -(a - 0.5)^2, value 0, 50 simulations. A search that leaves out the edge's
// own reward knows nothing of the root's actions and does about as random; ours ends
// near the optimum.
TEST(Mcts, RewardsOnTheSearchPathDecide) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    const double with = MeanRegret(name, {});
    const double without = MeanRegret(name, {{"edge_reward", 0.0}});
    std::printf("%s: regret %.4f with the edge's reward, %.4f without (random: %.4f)\n", name, with,
                without, kRandomRegret);
    EXPECT_LT(with, kRandomRegret / 4);
    EXPECT_GT(without, kRandomRegret * 3 / 4);
  }
}

// With the printed equation an edge holds the value after its own reward.
TEST(Mcts, EdgeRewardFalseLeavesOutTheEdgesOwnReward) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.5);
  model.value = [](const ScriptedState&) { return 8.0; };
  LoadedPlanner planner("mcts_pw", &model, {{"simulations", 1}, {"edge_reward", 0.0}});
  EXPECT_EQ(planner.Plan(AsLatents(kRoot)).result.value, 8);
  LoadedPlanner with("mcts_pw", &model, {{"simulations", 1}});
  const Decision decision = with.Plan(AsLatents(kRoot));
  EXPECT_EQ(decision.result.value, decision.action[0] + 0.5 * 8);
}

TEST(Mcts, DiscountIsTheModelsOfEachTransition) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    // One action a node: a single path, on which the n-th transition pays 1 and is
    // discounted with 1 / n. The value is 0, so path k gives 1 + 1 (1 + 1/2 (1 + ...)).
    ScriptedModel model;
    model.transition = [](const ScriptedState& state, ScriptedModel::Action) {
      ScriptedTransition step;
      step.next.x[0] = state.x[0] + 1;
      step.reward = 1;
      step.discount = 1 / step.next.x[0];
      return step;
    };
    Settings settings = {{"simulations", 3}};
    if (std::string(name) == "mcts_pw") {
      settings.push_back({"widening_exponent", 0.0});
    } else {
      settings.push_back({"children", 1});
    }
    LoadedPlanner planner(name, &model, settings);
    const Decision decision = planner.Plan(AsLatents(kRoot));
    EXPECT_EQ(decision.result.depth, 3u);
    EXPECT_DOUBLE_EQ(decision.result.value, (1 + 2 + 2.5) / 3);
  }
}

// Rewards are positive, so a first play of 0 makes every untried action look like
// the worst one: the search sinks along the few it has tried.
TEST(MctsFixed, FirstPlayOfTheParentsMeanTriesEveryRootAction) {
  const auto plan = [](const char* first_play) {
    ScriptedModel model = Bandit([](double a) { return 1 - (a - 0.5) * (a - 0.5) / 2.25; }, 0.99);
    LoadedPlanner planner("mcts_fixed", &model, {{"first_play", first_play}});
    return planner.Plan(AsLatents(kRoot));
  };
  const auto tried = [](const Decision& decision) {
    const std::vector<Edge> children = Children(decision.tree, -1);
    return std::count_if(children.begin(), children.end(),
                         [](const Edge& edge) { return edge.visits > 0; });
  };
  const Decision mean = plan("parent_mean");
  const Decision zero = plan("zero");
  EXPECT_EQ(tried(mean), 20);
  EXPECT_LT(tried(zero), 5);
  EXPECT_LT(mean.result.depth, 6u);
  EXPECT_GT(zero.result.depth, 20u);
}

// All returns are equal, so nothing but the order of creation decides.
TEST(Mcts, TiesGoToTheChildCreatedFirst) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    ScriptedModel model = Bandit([](double) { return 1.0; }, 0);
    LoadedPlanner planner(name, &model);
    const Decision decision = planner.Plan(AsLatents(kRoot));
    EXPECT_EQ(decision.action, decision.tree.front().a);
    const std::vector<Edge> children = Children(decision.tree, -1);
    for (std::size_t i = 1; i < children.size(); ++i) {
      EXPECT_GE(children[i - 1].visits, children[i].visits);
    }
  }
}

TEST(Mcts, PlaysTheLargestQNotTheMostVisits) {
  // The exploration term is huge, so visits are even and Q alone can decide.
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    ScriptedModel model = Bandit([](double a) { return a; }, 0);
    LoadedPlanner planner(name, &model, {{"c1", 1e6}});
    const Decision decision = planner.Plan(AsLatents(kRoot));
    for (const Edge& edge : Children(decision.tree, -1)) {
      if (edge.visits > 0) {
        EXPECT_LE(edge.a[0], decision.action[0]);
      }
    }
  }
}

TEST(Mcts, ThePolicyIsTheRootsVisitShares) {
  for (const char* name : {"mcts_pw", "mcts_fixed", "hoot"}) {
    ScriptedModel model = LinearQuadratic::Model();
    LoadedPlanner planner(name, &model);
    ScriptedState root;
    root.x[0] = LinearQuadratic::kStart;
    const Decision decision = planner.Plan(AsLatents(root), {.policy = 100});
    ASSERT_TRUE(decision.status.ok()) << decision.status.message;
    std::size_t k = 0;
    for (const Edge& edge : decision.tree) {
      if (edge.parent != -1 || edge.visits == 0) continue;
      const auto found =
          std::find(decision.policy_actions.begin(), decision.policy_actions.end(), edge.a);
      ASSERT_NE(found, decision.policy_actions.end());
      EXPECT_NEAR(
          decision
              .policy_weights[static_cast<std::size_t>(found - decision.policy_actions.begin())],
          static_cast<double>(edge.visits) / 50, 1e-12);
      ++k;
    }
    ASSERT_GT(k, 1u) << name;
    EXPECT_EQ(decision.policy_weights[k], 0) << name;
  }
}

TEST(Mcts, PuctScaleZeroIsGreedy) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0);
  LoadedPlanner planner("mcts_fixed", &model, {{"puct_scale", 0.0}, {"simulations", 30}});
  const std::vector<Edge> children = Children(planner.Plan(AsLatents(kRoot)).tree, -1);
  // One simulation finds the first action; its Q is also the mean of the root, so
  // that every other action ties with it and the first created is taken again.
  EXPECT_EQ(children.front().visits, 30u);
}

TEST(Mcts, NoiseIsOnEveryCandidateAndOnThePlayedAction) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
    model.sample = [](const ScriptedState&, Random&, View<double> action) { action[0] = 0.25; };
    LoadedPlanner planner(name, &model);
    const Decision still = planner.Plan(AsLatents(kRoot));
    for (const Edge& edge : still.tree) EXPECT_EQ(edge.a[0], 0.25);
    EXPECT_EQ(still.action[0], 0.25);
    const Decision noisy = planner.Plan(AsLatents(kRoot), {.explore = true});
    std::set<double> different;
    for (const Edge& edge : noisy.tree) {
      EXPECT_LE(std::abs(edge.a[0]), 1);
      different.insert(edge.a[0]);
      EXPECT_NE(edge.a[0], noisy.action[0]);
    }
    EXPECT_GT(different.size(), noisy.tree.size() / 2);
    EXPECT_EQ(different.count(0.25), 0u);
  }
}

TEST(Mcts, AsksForOneTransitionASimulation) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
    LoadedPlanner planner(name, &model);
    ASSERT_TRUE(planner.Plan(AsLatents(kRoot)).status.ok());
    EXPECT_EQ(model.transitions, 50u);
    EXPECT_EQ(model.values_asked, 50u);
    EXPECT_EQ(model.imagine_calls, 50u);
  }
}

// --- leaf batches ---

TEST(LeafBatch, MakesFewerCallsForTheSameSimulations) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    ScriptedModel model = Bandit([](double a) { return std::cos(3 * a); }, 0.9);
    LoadedPlanner planner(name, &model, {{"leaf_batch", 8}, {"simulations", 200}});
    const Decision decision = planner.Plan(AsLatents(kRoot));
    ASSERT_TRUE(decision.status.ok());
    EXPECT_EQ(model.transitions, 200u);
    EXPECT_EQ(VisitsBelow(decision.tree, -1), 200u);
    EXPECT_LE(model.imagine_calls, 60u) << "at best 25";
  }
}

TEST(LeafBatch, StillFindsTheOptimum) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    EXPECT_LT(MeanRegret(name, {{"leaf_batch", 8}}), kRandomRegret / 4);
  }
}

TEST(LeafBatch, NeverBreaksTheWideningRule) {
  ScriptedModel model = Bandit([](double a) { return std::cos(3 * a); }, 0.9);
  LoadedPlanner planner("mcts_pw", &model, {{"leaf_batch", 16}, {"simulations", 300}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  for (std::int64_t node = -1; node < static_cast<std::int64_t>(decision.tree.size()); ++node) {
    const double n = static_cast<double>(VisitsBelow(decision.tree, node));
    if (n > 0) {
      EXPECT_LE(Children(decision.tree, node).size(), std::ceil(std::sqrt(n)));
    }
  }
}

// --- tree reuse ---

// The second decision starts from the chosen action's subtree: its visits count,
// its edges are found again, and only the rest is searched.
TEST(TreeReuse, KeepsTheChosenSubtree) {
  for (const char* name : {"mcts_pw", "mcts_fixed"}) {
    ScriptedModel model = Bandit([](double a) { return std::cos(3 * a); }, 0.9);
    LoadedPlanner planner(name, &model, {{"reuse_tree", 1.0}, {"simulations", 100}});
    const Decision first = planner.Plan(AsLatents(kRoot), {.seed = 1});
    const auto chosen = std::find_if(first.tree.begin(), first.tree.end(), [&](const Edge& edge) {
      return edge.parent == -1 && edge.a == first.action;
    });
    const std::int64_t chosen_index = chosen - first.tree.begin();
    const std::vector<Edge> kept = Children(first.tree, chosen_index);
    const std::uint64_t kept_visits = chosen->visits - 1;
    model.transitions = 0;

    const Decision second = planner.Plan(AsLatents(kRoot), {.seed = 2});
    EXPECT_EQ(second.result.simulations, 100 - kept_visits);
    EXPECT_EQ(model.transitions, 100 - kept_visits);
    EXPECT_EQ(VisitsBelow(second.tree, -1), 100u);
    const std::vector<Edge> children = Children(second.tree, -1);
    ASSERT_GE(children.size(), kept.size());
    for (std::size_t i = 0; i < kept.size(); ++i) {
      EXPECT_EQ(children[i].a, kept[i].a);
      EXPECT_GE(children[i].visits, kept[i].visits);
    }
    for (std::size_t i = 0; i < second.tree.size(); ++i) {
      const Edge& edge = second.tree[i];
      if (edge.visits == 0) continue;
      EXPECT_EQ(edge.visits, 1 + VisitsBelow(second.tree, static_cast<std::int64_t>(i)));
    }
  }
}

TEST(TreeReuse, StartsAnewAfterNoiseOrAtAnEpisodesStart) {
  ScriptedModel model = Bandit([](double a) { return std::cos(3 * a); }, 0.9);
  LoadedPlanner planner("mcts_pw", &model, {{"reuse_tree", 1.0}});
  ASSERT_TRUE(planner.Plan(AsLatents(kRoot), {.explore = true}).status.ok());
  EXPECT_EQ(planner.Plan(AsLatents(kRoot)).result.simulations, 50u);
  ASSERT_TRUE(planner->BeginEpisode(&model).ok());
  EXPECT_EQ(planner.Plan(AsLatents(kRoot)).result.simulations, 50u);
  EXPECT_LT(planner.Plan(AsLatents(kRoot)).result.simulations, 50u);
}

TEST(TreeReuse, NeverOutgrowsTheTree) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
  struct Case {
    const char *name, *root_option;
    double root;
    std::size_t most_edges;
  };
  for (const Case& c :
       {Case{"mcts_pw", "root_actions", 0, 50}, Case{"mcts_pw", "root_actions", 30, 80},
        Case{"mcts_fixed", "root_uniform", 0, 1000}}) {
    LoadedPlanner planner(c.name, &model,
                          {{"reuse_tree", 1.0}, {"puct_scale", 0.0}, {c.root_option, c.root}});
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
      const Decision decision = planner.Plan(AsLatents(kRoot), {.seed = seed});
      ASSERT_TRUE(decision.status.ok());
      ASSERT_LE(decision.result.nodes, 51u);
      ASSERT_LE(decision.tree.size(), c.most_edges);
      ASSERT_GE(decision.result.simulations, 1u);
    }
  }
}

// --- golden trees ---

// A whole search in words, one line an edge, indented by depth, against a file.
// DREAMSEARCH_REMAKE_GOLDEN=1 rewrites the files.
class Golden : public testing::TestWithParam<const char*> {};

void Print(const std::vector<Edge>& tree, std::int64_t parent, int depth, std::ostream& out) {
  for (std::size_t i = 0; i < tree.size(); ++i) {
    if (tree[i].parent != parent) continue;
    const Edge& edge = tree[i];
    char line[200];
    if (edge.expanded) {
      std::snprintf(line, sizeof line, "%*sa %+.6f  N %llu  Q %+.6f  r %+.6f  v %+.6f", 2 * depth,
                    "", edge.a[0], static_cast<unsigned long long>(edge.visits), edge.q,
                    edge.reward, edge.value);
    } else {
      std::snprintf(line, sizeof line, "%*sa %+.6f  not tried", 2 * depth, "", edge.a[0]);
    }
    out << line << "\n";
    Print(tree, static_cast<std::int64_t>(i), depth + 1, out);
  }
}

TEST_P(Golden, TreeIsAsRecorded) {
  // A pendulum of one state, pushed by the action and paid for standing up.
  ScriptedModel model;
  model.transition = [](const ScriptedState& state, ScriptedModel::Action a) {
    ScriptedTransition step;
    step.next.x[1] = 0.9 * state.x[1] + 0.5 * a[0] - 0.3 * std::sin(state.x[0]);
    step.next.x[0] = state.x[0] + step.next.x[1];
    step.reward = 0.5 - 0.5 * std::cos(step.next.x[0]);
    step.discount = 0.9;
    return step;
  };
  model.value = [](const ScriptedState& state) { return 1 - std::cos(state.x[0]); };
  Settings settings = {{"simulations", 16}};
  const std::string name = GetParam();
  if (name == "mcts_fixed" || name == "mcts_gumbel") settings.push_back({"children", 4});
  if (name == "mcts_gumbel") settings.push_back({"root_actions", 4});
  LoadedPlanner planner(GetParam(), &model, settings);
  const Decision decision = planner.Plan(AsLatents(kRoot), {.seed = 7});
  std::ostringstream text;
  char line[100];
  std::snprintf(line, sizeof line, "plays %+.6f  value %+.6f  nodes %u  depth %u",
                decision.action[0], decision.result.value, decision.result.nodes,
                decision.result.depth);
  text << GetParam() << ", 16 simulations, seed 7: " << line << "\n";
  Print(decision.tree, -1, 0, text);

  const std::string path = std::string(DREAMSEARCH_GOLDEN_DIR) + "/" + GetParam() + ".txt";
  if (std::getenv("DREAMSEARCH_REMAKE_GOLDEN") != nullptr) {
    std::ofstream(path) << text.str();
    GTEST_SKIP() << "remade " << path;
  }
  std::ifstream file(path);
  ASSERT_TRUE(file) << path << " is missing; DREAMSEARCH_REMAKE_GOLDEN=1 makes it";
  std::ostringstream recorded;
  recorded << file.rdbuf();
  EXPECT_EQ(text.str(), recorded.str())
      << "DREAMSEARCH_REMAKE_GOLDEN=1 rewrites the file if the change is wanted";
}

INSTANTIATE_TEST_SUITE_P(Mcts, Golden,
                         testing::Values("mcts_pw", "mcts_fixed", "mcts_gumbel", "hoot"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace dreamsearch
