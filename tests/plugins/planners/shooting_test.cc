// shooting_test.cc - the planners over whole action sequences, against closed forms.
#include <gtest/gtest.h>

#include <algorithm>

#include "plugins/planner_shooting/coloured_noise.h"
#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"

namespace dreamsearch {
namespace {

constexpr const char* kShooters[] = {"random_shooting", "cem", "icem", "mppi"};

// As Counter, but every state is worth 1000.
ScriptedModel FlatCounter(double discount) {
  ScriptedModel model = Counter(discount);
  model.value = [](const ScriptedState&) { return 1000.0; };
  return model;
}

TEST(Shooting, HorizonCountsTransitionsAndDiscountsAreTheModels) {
  for (const char* name : kShooters) {
    for (const bool bootstrap : {false, true}) {
      for (const int horizon : {1, 4}) {
        ScriptedModel model = FlatCounter(0.5);
        LoadedPlanner planner(name, &model, {{"horizon", horizon}, {"bootstrap", bootstrap}});
        const Decision decision = planner.Plan(AsLatents(kRoot));
        // 2 + 4/2 + 8/4 + ... is 2 a transition.
        const double expected = 2 * horizon + (bootstrap ? 1000 * std::exp2(-horizon) : 0);
        EXPECT_NEAR(decision.result.value, expected, 1e-12 * expected) << name;
        EXPECT_EQ(decision.result.depth, static_cast<std::uint32_t>(horizon));
      }
    }
  }
}

TEST(Shooting, AllSequencesAdvanceAsOneBatch) {
  ScriptedModel model = FlatCounter(1);
  LoadedPlanner random("random_shooting", &model);
  ASSERT_TRUE(random.Plan(AsLatents(kRoot)).status.ok());
  EXPECT_EQ(model.imagine_calls, 12u);
  EXPECT_EQ(model.transitions, 12000u);
  LoadedPlanner cem("cem", &model);
  model.imagine_calls = model.transitions = 0;
  EXPECT_EQ(cem.Plan(AsLatents(kRoot)).result.simulations, 10000u);
  EXPECT_EQ(model.imagine_calls, 120u);
  EXPECT_EQ(model.transitions, 120000u);
  LoadedPlanner icem("icem", &model);
  model.imagine_calls = model.transitions = 0;
  // 128, then 1.25 and 1.25^2 times fewer.
  EXPECT_EQ(icem.Plan(AsLatents(kRoot)).result.simulations, 128u + 102 + 81);
  EXPECT_EQ(model.imagine_calls, 36u);
  EXPECT_EQ(model.transitions, 12u * (128 + 102 + 81));
  LoadedPlanner mppi("mppi", &model);
  model.imagine_calls = model.transitions = 0;
  EXPECT_EQ(mppi.Plan(AsLatents(kRoot)).result.simulations, 6 * 512u);
  // Six iterations of three transitions, and two to follow the actor.
  EXPECT_EQ(model.imagine_calls, 20u);
  EXPECT_EQ(model.transitions, 6u * 3 * 512 + 2 * 24);
}

TEST(RandomShooting, PlaysTheFirstActionOfTheBestSequence) {
  ScriptedModel model = Bandit([](double a) { return -(a - 0.5) * (a - 0.5); }, 0.9);
  LoadedPlanner planner("random_shooting", &model, {{"candidates", 50}, {"horizon", 3}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  ASSERT_EQ(decision.tree.size(), 150u);
  std::size_t best = 0;
  double best_return = -1e300;
  for (std::size_t i = 0; i < 50; ++i) {
    double sum = 0;
    for (std::size_t t = 0; t < 3; ++t) {
      const double a = decision.tree[t * 50 + i].a[0];
      sum -= std::pow(0.9, t) * (a - 0.5) * (a - 0.5);
    }
    EXPECT_NEAR(decision.tree[i].q, sum, 1e-12);
    if (sum > best_return) {
      best_return = sum;
      best = i;
    }
  }
  EXPECT_EQ(decision.action, decision.tree[best].a);
  EXPECT_NEAR(decision.result.value, best_return, 1e-12);
}

// One iteration from N(0, 1): the played mean is that of the best candidates.
TEST(Cem, RefitsToTheElites) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0);
  LoadedPlanner planner("cem", &model,
                        {{"candidates", 40}, {"elites", 10}, {"iterations", 1}, {"horizon", 2}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  std::vector<double> first;
  for (std::size_t i = 0; i < 40; ++i) first.push_back(decision.tree[i].a[0]);
  std::sort(first.rbegin(), first.rend());
  double mean = 0, variance = 0;
  for (std::size_t i = 0; i < 10; ++i) mean += first[i] / 10;
  for (std::size_t i = 0; i < 10; ++i) variance += (first[i] - mean) * (first[i] - mean) / 10;
  EXPECT_NEAR(decision.action[0], mean, 1e-12);
  EXPECT_NEAR(decision.result.value, mean, 1e-12);
  EXPECT_NEAR(planner.Metric(decision, "plan_std"), std::sqrt(variance), 1e-12);
}

// 10 refits to the best tenth shrink the deviation by about 5 each (the density
// near the optimum is flat, so a tenth of the candidates span a tenth of it).
// What they play without exploring is the mean of the policy that they report.
TEST(Shooting, ThePolicyHasTheMeanThatIsPlayed) {
  for (const char* name : {"cem", "mppi"}) {
    ScriptedModel model = LinearQuadratic::Model();
    Settings settings = {{"candidates", 40}, {"elites", 10}};
    if (name == std::string("mppi")) settings.push_back({"play", "mean"});
    LoadedPlanner planner(name, &model, settings);
    ScriptedState root;
    root.x[0] = LinearQuadratic::kStart;
    const Decision decision = planner.Plan(AsLatents(root), {.policy = 12});
    ASSERT_TRUE(decision.status.ok()) << decision.status.message;
    double mean = 0;
    for (std::size_t k = 0; k < 12; ++k) {
      mean += decision.policy_weights[k] * decision.policy_actions[k][0];
      EXPECT_EQ(decision.policy_weights[k] > 0, k < 10) << name;
    }
    EXPECT_NEAR(mean, decision.action[0], 1e-12) << name;
  }
}

TEST(Shooting, BestSingleActionsAreTheirWholePolicy) {
  for (const char* name : {"random_shooting", "icem", "rollout"}) {
    ScriptedModel model = LinearQuadratic::Model();
    LoadedPlanner planner(name, &model);
    const Decision decision = planner.Plan(AsLatents(kRoot), {.policy = 3});
    ASSERT_TRUE(decision.status.ok()) << decision.status.message;
    EXPECT_EQ(decision.policy_actions[0], decision.action) << name;
    EXPECT_EQ(decision.policy_weights, (std::vector<double>{1, 0, 0})) << name;
  }
}

TEST(Cem, ConvergesOnAQuadratic) {
  for (const double optimum : {-0.9, 0.0, 0.5}) {
    ScriptedModel model =
        Bandit([optimum](double a) { return -(a - optimum) * (a - optimum); }, 0.99);
    LoadedPlanner planner("cem", &model, {{"horizon", 2}});
    EXPECT_NEAR(planner.Plan(AsLatents(kRoot)).action[0], optimum, 1e-3);
  }
}

// One iteration: mean and deviation are weighted with exp(t (R - best)).
TEST(Mppi, WeighsTheElites) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0);
  LoadedPlanner planner("mppi", &model,
                        {{"candidates", 40},
                         {"actor_candidates", 8},
                         {"elites", 10},
                         {"iterations", 1},
                         {"temperature", 3.0},
                         {"play", "mean"}});
  const Decision decision = planner.Plan(AsLatents(kRoot));
  std::vector<double> first;
  for (std::size_t i = 0; i < 40; ++i) first.push_back(decision.tree[i].a[0]);
  std::sort(first.rbegin(), first.rend());
  double weights = 0, mean = 0, variance = 0;
  for (std::size_t i = 0; i < 10; ++i) weights += std::exp(3 * (first[i] - first[0]));
  for (std::size_t i = 0; i < 10; ++i) {
    mean += first[i] * std::exp(3 * (first[i] - first[0])) / weights;
  }
  for (std::size_t i = 0; i < 10; ++i) {
    variance +=
        (first[i] - mean) * (first[i] - mean) * std::exp(3 * (first[i] - first[0])) / weights;
  }
  EXPECT_NEAR(decision.action[0], mean, 1e-12);
  EXPECT_NEAR(decision.result.value, mean, 1e-12);
  EXPECT_NEAR(planner.Metric(decision, "plan_std"), std::max(0.05, std::sqrt(variance)), 1e-12);
}

TEST(Mppi, DeviationStaysInItsBounds) {
  ScriptedModel model = Bandit([](double a) { return 1e6 * a; }, 0);
  LoadedPlanner narrow("mppi", &model, {{"min_std", 0.125}});
  EXPECT_EQ(narrow.Metric(narrow.Plan(AsLatents(kRoot)), "plan_std"), 0.125);
  LoadedPlanner wide("mppi", &model, {{"min_std", 0.0}, {"max_std", 0.01}, {"temperature", 0.0}});
  EXPECT_LE(wide.Metric(wide.Plan(AsLatents(kRoot)), "plan_std"), 0.01);
}

TEST(Mppi, SomeCandidatesFollowTheActor) {
  ScriptedModel model = FlatCounter(1);
  // The actor's sample names the state it was drawn at.
  model.sample = [](const ScriptedState& state, Random&, View<double> action) {
    action[0] = 0.125 * (state.x[0] + 1);
  };
  LoadedPlanner planner("mppi", &model);
  const Decision decision = planner.Plan(AsLatents(kRoot));
  for (std::size_t t = 0; t < 3; ++t) {
    for (std::size_t i = 0; i < 512; ++i) {
      EXPECT_EQ(decision.tree[t * 512 + i].a[0] == 0.125 * static_cast<double>(t + 1), i < 24);
    }
  }
}

// A search so narrow that the played action tells where it started. With one action
// the mean of the best eighth of N(0, d^2) is 1.65 d (d = 1e-3), and less where three
// actions share the choice: a plan made anew stays below 2 d, one that an action
// gains from three times over while it moves up does not.
TEST(Mppi, StartsFromTheLastPlanShiftedByOne) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
  const Settings settings = {{"max_std", 1e-3},
                             {"min_std", 0.0},
                             {"iterations", 1},
                             {"actor_candidates", 0},
                             {"play", "mean"}};
  const auto drift = [&](Settings more) {
    more.insert(more.end(), settings.begin(), settings.end());
    LoadedPlanner planner("mppi", &model, more);
    std::vector<double> actions;
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
      actions.push_back(planner.Plan(AsLatents(kRoot), {.seed = seed}).action[0]);
    }
    return actions;
  };
  const std::vector<double> warm = drift({{"horizon", 3}});
  EXPECT_LT(warm[0], 2e-3);
  EXPECT_GT(warm[1], warm[0]);
  EXPECT_GT(warm[2], 2e-3);
  for (const double a : drift({{"horizon", 3}, {"warm_start", false}})) EXPECT_LT(a, 2e-3);
  for (const double a : drift({{"horizon", 1}})) EXPECT_LT(a, 2e-3) << "nothing is left to shift";
}

TEST(Mppi, ForgetsThePlanAtAnEpisodesStart) {
  ScriptedModel model = Bandit([](double a) { return a; }, 0.9);
  LoadedPlanner planner("mppi", &model, {{"max_std", 0.1}});
  const Decision first = planner.Plan(AsLatents(kRoot), {.seed = 1});
  const Decision second = planner.Plan(AsLatents(kRoot), {.seed = 1});
  EXPECT_NE(first.action, second.action);
  ASSERT_TRUE(planner->BeginEpisode(&model).ok());
  EXPECT_EQ(planner.Plan(AsLatents(kRoot), {.seed = 1}).action, first.action);
}

TEST(Mppi, NoiseOnlyWhenExploringAndAsWideAsThePlan) {
  ScriptedModel model = Bandit([](double a) { return -a * a; }, 0);
  LoadedPlanner planner("mppi", &model, {{"min_std", 0.2}, {"max_std", 0.2}, {"play", "mean"}});
  double squares = 0;
  constexpr int kDecisions = 400;
  for (std::uint64_t seed = 0; seed < kDecisions; ++seed) {
    ASSERT_TRUE(planner->BeginEpisode(&model).ok());
    const double still = planner.Plan(AsLatents(kRoot), {.seed = seed, .tree = false}).action[0];
    ASSERT_TRUE(planner->BeginEpisode(&model).ok());
    const double noisy =
        planner.Plan(AsLatents(kRoot), {.explore = true, .seed = seed, .tree = false}).action[0];
    squares += (noisy - still) * (noisy - still) / kDecisions;
  }
  // Five standard errors.
  EXPECT_NEAR(std::sqrt(squares), 0.2, 5 * 0.2 / std::sqrt(2.0 * kDecisions));
}

// Where all sequences are elites and all are kept, later refits see the first one's again.
TEST(Icem, KeptElitesCompeteAgain) {
  ScriptedModel model = Bandit([](double a) { return std::cos(20 * a) - a * a; }, 0.9);
  const auto value = [&](int iterations, double keep) {
    LoadedPlanner icem(
        "icem", &model,
        {{"candidates", 4}, {"elites", 4}, {"keep_elites", keep}, {"iterations", iterations}});
    return icem.Plan(AsLatents(kRoot), {.seed = 3}).result.value;
  };
  EXPECT_EQ(value(2, 1.0), value(3, 1.0));
  EXPECT_EQ(value(2, 1.0), value(6, 1.0));
  EXPECT_NE(value(2, 0.0), value(3, 0.0));
}

// The best sequence of the first decision, shifted, is among those of the second: it loses its
// first action, at most 1, and gains one of at least -1.
TEST(Icem, KeepsShiftedElitesForTheNextDecision) {
  ScriptedModel model = Bandit([](double a) { return a; }, 1);
  LoadedPlanner icem("icem", &model,
                     {{"candidates", 64}, {"horizon", 6}, {"iterations", 6}, {"beta", 0.0}});
  const Decision first = icem.Plan(AsLatents(kRoot), {.seed = 1});
  LoadedPlanner fresh("icem", &model,
                      {{"candidates", 64}, {"horizon", 6}, {"iterations", 1}, {"beta", 0.0}});
  LoadedPlanner warm("icem", &model,
                     {{"candidates", 64}, {"horizon", 6}, {"iterations", 1}, {"beta", 0.0}});
  ASSERT_TRUE(warm.Plan(AsLatents(kRoot), {.seed = 1}).status.ok());
  EXPECT_GT(warm.Plan(AsLatents(kRoot), {.seed = 2}).result.value,
            fresh.Plan(AsLatents(kRoot), {.seed = 2}).result.value);
  EXPECT_GT(icem.Plan(AsLatents(kRoot), {.seed = 2}).result.value, first.result.value - 2);
}

// From the covariance of the values that the noise's factors give.
TEST(ColouredNoise, HasVarianceOneAndFallsWithFrequencyAsDeclared) {
  for (const std::uint64_t horizon : {1, 2, 5, 12, 30}) {
    for (const double beta : {0.0, 1.0, 2.5}) {
      const ColouredNoise noise(horizon, beta);
      const auto covariance = [&](std::uint64_t t, std::uint64_t u) {
        double sum = 0;
        for (std::uint64_t i = 0; i < horizon; ++i) sum += noise.factor(t, i) * noise.factor(u, i);
        return sum;
      };
      std::vector<double> power(horizon / 2 + 1);
      for (std::uint64_t t = 0; t < horizon; ++t) {
        EXPECT_NEAR(covariance(t, t), 1, 1e-12);
        if (t > 0 && beta == 0) {
          EXPECT_NEAR(covariance(0, t), 0, 1e-12);
        }
        for (std::uint64_t k = 0; k < power.size(); ++k) {
          power[k] += covariance(0, t) * std::cos(2 * M_PI * static_cast<double>(k * t) /
                                                  static_cast<double>(horizon));
        }
      }
      for (std::uint64_t k = 2; k < power.size(); ++k) {
        EXPECT_NEAR(power[k] / power[1], std::pow(static_cast<double>(k), -beta), 1e-9);
      }
    }
  }
}

// Elites that are all at the bound, in numbers whose weights add up to more than one.
TEST(Shooting, MeansStayInsideTheBounds) {
  ScriptedModel model;
  model.transition = [](const ScriptedState& state, ScriptedModel::Action action) {
    ScriptedTransition step;
    step.next = state;
    for (std::uint64_t j = 0; j < action.size; ++j) step.reward += action[j];
    return step;
  };
  for (int elites = 2; elites <= 64; ++elites) {
    LoadedPlanner cem("cem", &model,
                      {{"candidates", 1000}, {"elites", elites}, {"initial_std", 10.0}});
    LoadedPlanner mppi("mppi", &model, {{"elites", elites}, {"max_std", 10.0}, {"play", "mean"}});
    for (LoadedPlanner* planner : {&cem, &mppi}) {
      const Decision decision = planner->Plan(AsLatents(kRoot));
      ASSERT_TRUE(decision.status.ok());
      for (const double a : decision.action) {
        EXPECT_LE(a, 1.0);
        EXPECT_GT(a, 0.9);
      }
    }
  }
}

TEST(Shooting, RefusesSettingsThatDoNotGoTogether) {
  ScriptedModel model = FlatCounter(1);
  EXPECT_THROW(LoadedPlanner("cem", &model, {{"candidates", 10}, {"elites", 11}}),
               std::runtime_error);
  EXPECT_THROW(LoadedPlanner("icem", &model, {{"candidates", 10}, {"elites", 11}}),
               std::runtime_error);
  EXPECT_THROW(LoadedPlanner("mppi", &model, {{"candidates", 70}, {"actor_candidates", 71}}),
               std::runtime_error);
  EXPECT_THROW(LoadedPlanner("mppi", &model, {{"min_std", 3.0}}), std::runtime_error);
}

}  // namespace
}  // namespace dreamsearch
