// every_planner_test.cc - what planner.h promises, held against every planner of
// every built plugin.
// Over 400 lines: one law after the other, and the scripted models they are held with.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/plugins/planners/allocation_counter.h"
#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"

namespace dreamsearch {
namespace {

// Two action components, a state that drifts, a reward and a value that depend on
// it: nothing is degenerate.
ScriptedModel Drift() {
  ScriptedModel model;
  model.actions = 2;
  model.transition = [](const ScriptedState& state, ScriptedModel::Action a) {
    ScriptedTransition step;
    step.next.x[0] = 0.9 * state.x[0] + a[0];
    step.next.x[1] = 0.8 * state.x[1] - a[1];
    step.reward = std::cos(step.next.x[0]) - 0.1 * a[1] * a[1];
    step.discount = 0.97;
    return step;
  };
  model.value = [](const ScriptedState& state) { return std::cos(state.x[0] + state.x[1]); };
  model.mode = [](const ScriptedState& state, View<double> action) {
    action[0] = std::tanh(-state.x[0]);
    action[1] = 0.25;
  };
  model.sample = [](const ScriptedState& state, Random& random, View<double> action) {
    action[0] = std::tanh(-state.x[0] + 0.5 * random.Normal());
    action[1] = std::tanh(0.3 * random.Normal());
  };
  return model;
}

ScriptedState Start() {
  ScriptedState state;
  state.x[0] = 0.7;
  state.x[1] = -0.2;
  return state;
}

class EveryPlanner : public testing::TestWithParam<const ComponentDescriptor*> {
 protected:
  static bool Declares(const char* parameter) {
    const Records<ParameterSpec>& specs = GetParam()->parameters;
    return std::any_of(specs.begin(), specs.end(), [parameter](const ParameterSpec& spec) {
      return std::strcmp(spec.name, parameter) == 0;
    });
  }

  // More than the few sequences of the actor that a planner may do with by default: here the actor
  // is uniform, and nothing but their number finds what is good.
  static Settings ManySequences() {
    if (Declares("sequences")) return {{"sequences", 100}};
    return {};
  }
};

bool Searches(const ComponentDescriptor* component) { return (component->traits & kSearches) != 0; }

TEST_P(EveryPlanner, DeclaresItselfCompletely) {
  const ComponentDescriptor& component = *GetParam();
  EXPECT_EQ(component.kind, ComponentKind::kPlanner);
  EXPECT_NE(component.create_planner, nullptr);
  EXPECT_GT(std::strlen(component.summary), 0u);
  for (const ParameterSpec& spec : component.parameters) {
    EXPECT_GT(std::strlen(spec.help), 0u) << spec.name;
    if (spec.type == ParameterType::kInt || spec.type == ParameterType::kReal) {
      EXPECT_LE(spec.min, spec.default_number) << spec.name;
      EXPECT_GE(spec.max, spec.default_number) << spec.name;
    }
  }
  for (const MetricSpec& metric : component.metrics) EXPECT_GT(std::strlen(metric.help), 0u);
}

TEST_P(EveryPlanner, OffersTheExtensionsThatItDeclaresAndNoOthers) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  EXPECT_EQ(ExtensionOf<PolicyReporting>(planner.get()) != nullptr,
            (GetParam()->traits & kReportsPolicy) != 0);
  EXPECT_EQ(ExtensionOf<TreeReporting>(planner.get()) != nullptr, Searches(GetParam()));
  for (const char* name : {"", "policy", "policy/2", "render/1", "stranger.policy/1"}) {
    EXPECT_EQ(planner->Extension(name), nullptr) << name;
  }
}

TEST_P(EveryPlanner, ReturnsAFiniteActionInItsBounds) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  const ScriptedState root = Start();
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Decision decision =
        planner.Plan(AsLatents(root), {.explore = seed % 2 == 1, .seed = seed});
    ASSERT_TRUE(decision.status.ok()) << decision.status.message;
    for (const double a : decision.action) EXPECT_LE(std::abs(a), 1);
    for (const double metric : decision.metrics) EXPECT_TRUE(std::isfinite(metric));
    EXPECT_TRUE(std::isfinite(decision.result.value));
    EXPECT_GE(decision.result.nodes, 1u);
  }
}

// Of a planner that reports it. The actions are among those it tried at the root.
TEST_P(EveryPlanner, ReportsTheHeaviestActionsOfAPolicy) {
  if ((GetParam()->traits & kReportsPolicy) == 0) GTEST_SKIP() << "reports no policy";
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  const ScriptedState root = Start();
  for (const bool explore : {false, true}) {
    for (const std::uint64_t size : {1, 3, 2000}) {
      ASSERT_TRUE(planner->BeginEpisode(&model).ok());
      const Decision decision =
          planner.Plan(AsLatents(root), {.explore = explore, .seed = 5, .policy = size});
      ASSERT_TRUE(decision.status.ok()) << decision.status.message;
      double sum = 0;
      for (std::uint64_t k = 0; k < size; ++k) {
        const double weight = decision.policy_weights[k];
        const std::vector<double>& action = decision.policy_actions[k];
        ASSERT_GE(weight, 0);
        EXPECT_LE(weight, k == 0 ? 1 + 1e-12 : decision.policy_weights[k - 1]);
        sum += weight;
        if (weight == 0) {
          EXPECT_EQ(action, std::vector<double>(action.size(), 0.0));
          continue;
        }
        for (const double a : action) EXPECT_LE(std::abs(a), 1);
        EXPECT_TRUE(
            std::any_of(decision.tree.begin(), decision.tree.end(),
                        [&](const Edge& edge) { return edge.parent == -1 && edge.a == action; }))
            << "action " << k << " was not tried";
      }
      EXPECT_NEAR(sum, 1, 1e-12);
    }
  }
}

// Fewer actions are the first of more, in the same proportions, and nothing else changes.
TEST_P(EveryPlanner, DecidesAlikeHoweverMuchOfItsPolicyIsAskedFor) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  const ScriptedState root = Start();
  std::vector<Decision> decisions;
  for (const std::uint64_t size : {0, 2, 2000}) {
    ASSERT_TRUE(planner->BeginEpisode(&model).ok());
    decisions.push_back(planner.Plan(AsLatents(root), {.explore = true, .policy = size}));
    ASSERT_TRUE(decisions.back().status.ok()) << decisions.back().status.message;
    EXPECT_EQ(decisions.back().action, decisions.front().action);
    EXPECT_EQ(decisions.back().metrics, decisions.front().metrics);
    EXPECT_EQ(decisions.back().result.value, decisions.front().result.value);
  }
  if ((GetParam()->traits & kReportsPolicy) == 0) return;
  const Decision &few = decisions[1], &all = decisions[2];
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(few.policy_actions[k], all.policy_actions[k]);
    EXPECT_NEAR(few.policy_weights[k] * all.policy_weights[0],
                all.policy_weights[k] * few.policy_weights[0], 1e-12);
  }
}

TEST_P(EveryPlanner, RefusesARoomForItsPolicyThatDoesNotFit) {
  if ((GetParam()->traits & kReportsPolicy) == 0) GTEST_SKIP() << "reports no policy";
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  ASSERT_TRUE(planner.Plan(AsLatents(Start())).status.ok());
  auto* policies = ExtensionOf<PolicyReporting>(planner.get());
  std::vector<double> actions(6), weights(3);
  for (const MatrixView<double> room :
       {MatrixView<double>{actions.data(), 2, 2}, MatrixView<double>{actions.data(), 3, 1}}) {
    EXPECT_EQ(policies->ReportPolicy(room, {weights.data(), 3}).code, StatusCode::kInvalidArgument);
  }
}

TEST_P(EveryPlanner, PicksTheKnownActionOfTheChain) {
  ScriptedModel model = Chain::Model(/*wrong_mode=*/Searches(GetParam()));
  LoadedPlanner planner(*GetParam(), &model, ManySequences());
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Decision decision = planner.Plan(AsLatents(ScriptedState{}), {.seed = seed});
    ASSERT_TRUE(decision.status.ok()) << decision.status.message;
    EXPECT_GT(decision.action[0], 0) << "seed " << seed;
  }
}

// The regret of the played action, in the mean over seeds: any search should be worth
// more than knowing the exact values of three random actions.
TEST_P(EveryPlanner, NearsTheOptimumOfTheLinearQuadraticProblem) {
  if (!Searches(GetParam())) GTEST_SKIP() << "does not search";
  ScriptedModel model = LinearQuadratic::Model();
  LoadedPlanner planner(*GetParam(), &model);
  ScriptedState root;
  root.x[0] = LinearQuadratic::kStart;
  const double best = -LinearQuadratic::K(LinearQuadratic::P()) * LinearQuadratic::kStart;
  ASSERT_GT(best, -1) << "the bounds would matter";
  constexpr int kDecisions = 50;
  double regret = 0;
  for (std::uint64_t seed = 0; seed < kDecisions; ++seed) {
    ASSERT_TRUE(planner->BeginEpisode(&model).ok());
    const Decision decision = planner.Plan(AsLatents(root), {.seed = seed, .tree = false});
    ASSERT_TRUE(decision.status.ok());
    regret +=
        (LinearQuadratic::Q(root.x[0], best) - LinearQuadratic::Q(root.x[0], decision.action[0])) /
        kDecisions;
  }
  const double bound = LinearQuadratic::BestOfRandomRegret(best, 3);
  std::printf("regret %.5f; of a random action %.5f, of the best of three %.5f\n", regret,
              LinearQuadratic::BestOfRandomRegret(best, 1), bound);
  EXPECT_GE(regret, 0);
  EXPECT_LT(regret, bound);
}

TEST_P(EveryPlanner, IsNotDeceivedByTheMeanOfRandomContinuations) {
  if (!Searches(GetParam())) GTEST_SKIP() << "does not search";
  ScriptedModel model = Deception();
  model.mode = [](const ScriptedState&, View<double> action) { action[0] = 0.5; };
  Settings settings = ManySequences();
  if (Declares("simulations")) settings.push_back({"simulations", 400});
  LoadedPlanner planner(*GetParam(), &model, settings);
  int right = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    ASSERT_TRUE(planner->BeginEpisode(&model).ok());
    const Decision decision =
        planner.Plan(AsLatents(ScriptedState{}), {.seed = seed, .tree = false});
    right += decision.action[0] > 0;
  }
  EXPECT_EQ(right, 20);
}

// A search whose values are mean + k deviations while exploring, or the least in evaluation, is
// the search of a model that has these as its values.
TEST_P(EveryPlanner, UsesTheSpreadOfValuesAsDeclared) {
  if (!Searches(GetParam())) GTEST_SKIP() << "asks for no values of imagined latents";
  ASSERT_TRUE(Declares("value_bonus") && Declares("value_in_evaluation"));
  const auto deviation = [](const ScriptedState& state) { return 0.5 + std::cos(5 * state.x[0]); };
  const ScriptedModel plain = Drift();
  const auto decide = [&](bool explore, double k, const Settings& chosen, bool spread) {
    ScriptedModel model = Drift();
    if (spread) {
      model.deviation = deviation;
    } else {
      model.value = [&, k](const ScriptedState& s) { return plain.value(s) + k * deviation(s); };
    }
    Settings settings = chosen;
    if (Declares("bootstrap")) settings.push_back({"bootstrap", true});
    LoadedPlanner planner(*GetParam(), &model, settings);
    return planner.Plan(AsLatents(Start()), {.explore = explore, .seed = 3});
  };
  // The scripted least is the mean less a deviation.
  const Settings both = {{"value_bonus", 2.0}, {"value_in_evaluation", "least"}};
  for (const bool explore : {true, false}) {
    const Decision used = decide(explore, 0, both, true);
    const Decision expected = decide(explore, explore ? 2 : -1, {}, false);
    EXPECT_EQ(used.action, expected.action) << explore;
    EXPECT_EQ(used.result.value, expected.result.value) << explore;
    const Decision unused = decide(explore, 0, {}, true), mean = decide(explore, 0, {}, false);
    EXPECT_EQ(unused.result.value, mean.result.value) << explore;
    EXPECT_NE(used.result.value, unused.result.value) << explore;
  }
}

TEST_P(EveryPlanner, EqualSeedsGiveEqualDecisions) {
  ScriptedModel model = Drift();
  LoadedPlanner first(*GetParam(), &model);
  LoadedPlanner second(*GetParam(), &model);
  const ScriptedState root = Start();
  for (const bool explore : {false, true}) {
    // A decision in between must leave no trace.
    ASSERT_TRUE(second->BeginEpisode(&model).ok());
    ASSERT_TRUE(second.Plan(AsLatents(root), {.explore = explore, .seed = 99}).status.ok());
    ASSERT_TRUE(second->BeginEpisode(&model).ok());
    ASSERT_TRUE(first->BeginEpisode(&model).ok());
    const Decision a = first.Plan(AsLatents(root), {.explore = explore, .seed = 5});
    const Decision b = second.Plan(AsLatents(root), {.explore = explore, .seed = 5});
    EXPECT_EQ(a.action, b.action);
    EXPECT_EQ(a.metrics, b.metrics);
    EXPECT_EQ(a.result.value, b.result.value);
    EXPECT_EQ(a.result.nodes, b.result.nodes);
    EXPECT_EQ(a.result.depth, b.result.depth);
  }
}

TEST_P(EveryPlanner, DifferentSeedsExploreDifferently) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  const ScriptedState root = Start();
  const Decision a = planner.Plan(AsLatents(root), {.explore = true, .seed = 1});
  ASSERT_TRUE(planner->BeginEpisode(&model).ok());
  const Decision b = planner.Plan(AsLatents(root), {.explore = true, .seed = 2});
  EXPECT_NE(a.action, b.action);
}

TEST_P(EveryPlanner, AddsNoiseOnlyWhenExploring) {
  if (!Declares("noise_std")) GTEST_SKIP() << "has no noise of its own";
  ScriptedModel model = Drift();
  LoadedPlanner noisy(*GetParam(), &model);
  LoadedPlanner silent(*GetParam(), &model, {{"noise_std", 0.0}});
  const ScriptedState root = Start();
  const Decision a = noisy.Plan(AsLatents(root), {.explore = false, .seed = 3});
  const Decision b = silent.Plan(AsLatents(root), {.explore = false, .seed = 3});
  EXPECT_EQ(a.action, b.action);
  ASSERT_TRUE(noisy->BeginEpisode(&model).ok());
  ASSERT_TRUE(silent->BeginEpisode(&model).ok());
  const Decision c = noisy.Plan(AsLatents(root), {.explore = true, .seed = 3});
  const Decision d = silent.Plan(AsLatents(root), {.explore = true, .seed = 3});
  EXPECT_NE(c.action, d.action);
}

TEST_P(EveryPlanner, ReportsATreeWhoseParentsComeFirst) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  const Decision decision = planner.Plan(AsLatents(Start()));
  if (!Searches(GetParam())) {
    EXPECT_TRUE(decision.tree.empty());
    return;
  }
  ASSERT_FALSE(decision.tree.empty());
  std::vector<std::uint32_t> depth;
  std::uint32_t deepest = 0;
  for (std::size_t i = 0; i < decision.tree.size(); ++i) {
    const Edge& edge = decision.tree[i];
    ASSERT_LT(edge.parent, static_cast<std::int64_t>(i));
    depth.push_back(edge.parent < 0 ? 1 : depth[static_cast<std::size_t>(edge.parent)] + 1);
    if (edge.expanded) deepest = std::max(deepest, depth.back());
    if (edge.parent >= 0) {
      EXPECT_TRUE(decision.tree[static_cast<std::size_t>(edge.parent)].expanded);
    }
  }
  EXPECT_EQ(deepest, decision.result.depth);
}

TEST_P(EveryPlanner, ReportingTheTreeChangesNothing) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  const Decision with = planner.Plan(AsLatents(Start()), {.seed = 4, .tree = true});
  ASSERT_TRUE(planner->BeginEpisode(&model).ok());
  const Decision without = planner.Plan(AsLatents(Start()), {.seed = 4, .tree = false});
  EXPECT_EQ(with.action, without.action);
  EXPECT_TRUE(without.tree.empty());
}

TEST_P(EveryPlanner, AllocatesNothingAfterWarmUp) {
  const std::uint64_t before_creation = AllocationCount();
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  ASSERT_GT(AllocationCount(), before_creation) << "the counter does not see plugins";
  const ScriptedState root = Start();
  std::vector<double> action(model.actions), metrics(GetParam()->metrics.size);
  PlanResult result;
  result.action = {action.data(), action.size()};
  result.metrics = {metrics.data(), metrics.size()};
  PlanRequest request;
  request.root = AsLatents(root);
  ASSERT_TRUE(planner->Plan(request, &result).ok());
  const std::uint64_t before = AllocationCount();
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    request.seed = seed;
    request.decision = seed;
    request.explore = seed >= 5;
    ASSERT_TRUE(planner->Plan(request, &result).ok());
  }
  ASSERT_TRUE(planner->BeginEpisode(&model).ok());
  ASSERT_TRUE(planner->Plan(request, &result).ok());
  EXPECT_EQ(AllocationCount(), before);
}

// Decisions after a Save and a Load into a new planner equal those without.
TEST_P(EveryPlanner, GoesOnAfterSaveAndLoad) {
  std::vector<Settings> variants = {{}};
  if (Declares("reuse_tree")) variants.push_back({{"reuse_tree", 1.0}});
  for (const Settings& settings : variants) {
    ScriptedModel model = Drift();
    LoadedPlanner whole(*GetParam(), &model, settings);
    const ScriptedState root = Start();
    ASSERT_TRUE(whole.Plan(AsLatents(root), {.seed = 1}).status.ok());
    Bytes saved;
    ASSERT_TRUE(whole->Save(&saved).ok());
    LoadedPlanner resumed(*GetParam(), &model, settings);
    ASSERT_TRUE(resumed->Load(&saved).ok());
    EXPECT_EQ(saved.at, saved.buffer.size());
    for (std::uint64_t seed = 2; seed < 5; ++seed) {
      const Decision a = whole.Plan(AsLatents(root), {.explore = seed == 3, .seed = seed});
      const Decision b = resumed.Plan(AsLatents(root), {.explore = seed == 3, .seed = seed});
      EXPECT_EQ(a.action, b.action);
      EXPECT_EQ(a.metrics, b.metrics);
    }
  }
}

TEST_P(EveryPlanner, RefusesCutSavedBytes) {
  Settings settings;
  if (Declares("reuse_tree")) settings.push_back({"reuse_tree", 1.0});
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model, settings);
  ASSERT_TRUE(planner.Plan(AsLatents(Start())).status.ok());
  Bytes saved;
  ASSERT_TRUE(planner->Save(&saved).ok());
  for (std::size_t length = 0; length < saved.buffer.size(); length += 7) {
    Bytes cut;
    cut.buffer.assign(saved.buffer.begin(),
                      saved.buffer.begin() + static_cast<std::ptrdiff_t>(length));
    LoadedPlanner other(*GetParam(), &model, settings);
    EXPECT_EQ(other->Load(&cut).code, StatusCode::kDataLoss) << "cut to " << length;
  }
}

TEST_P(EveryPlanner, RefusesToPlanBeforeAnEpisode) {
  const std::vector<ParameterValue> values = Resolve(*GetParam(), {});
  Planner* planner = nullptr;
  ASSERT_TRUE(
      GetParam()
          ->create_planner({{{values.data(), values.size()}}, 1, sizeof(ScriptedState)}, &planner)
          .ok());
  PlanRequest request;
  PlanResult result;
  EXPECT_EQ(planner->Plan(request, &result).code, StatusCode::kFailedPrecondition);
  planner->Destroy();
}

// And says which extension it misses; one that needs none plans.
TEST_P(EveryPlanner, RefusesAModelWithoutGradientsIfAndOnlyIfItDeclaresThatItNeedsThem) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  ScriptedModel rigid = Drift();
  rigid.gives_gradients = false;
  const Status status = planner->BeginEpisode(&rigid);
  if ((GetParam()->traits & kNeedsGradients) == 0) {
    ASSERT_TRUE(status.ok()) << status.message;
    EXPECT_TRUE(planner.Plan(AsLatents(Start())).status.ok());
    return;
  }
  EXPECT_EQ(status.code, StatusCode::kFailedPrecondition);
  EXPECT_NE(std::string(status.message).find(ReturnGradient::kName), std::string::npos);
  // The episode before goes on.
  EXPECT_TRUE(planner.Plan(AsLatents(Start())).status.ok());
}

TEST_P(EveryPlanner, RefusesAModelOfOtherSizes) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  ScriptedModel other = Drift();
  other.actions = 3;
  EXPECT_EQ(planner->BeginEpisode(&other).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(planner->BeginEpisode(nullptr).code, StatusCode::kInvalidArgument);
  // The episode before goes on.
  EXPECT_TRUE(planner.Plan(AsLatents(Start())).status.ok());
}

TEST_P(EveryPlanner, RefusesViewsOfWrongSizes) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  const ScriptedState root = Start();
  std::vector<double> action(3), metrics(GetParam()->metrics.size + 1);
  PlanRequest good_request;
  good_request.root = AsLatents(root);
  PlanResult good_result;
  good_result.action = {action.data(), 2};
  good_result.metrics = {metrics.data(), GetParam()->metrics.size};
  ASSERT_TRUE(planner->Plan(good_request, &good_result).ok());

  PlanRequest request = good_request;
  request.root.rows = 2;
  EXPECT_EQ(planner->Plan(request, &good_result).code, StatusCode::kInvalidArgument);
  request = good_request;
  request.root.cols = 32;
  EXPECT_EQ(planner->Plan(request, &good_result).code, StatusCode::kInvalidArgument);
  PlanResult long_action = good_result;
  long_action.action.size = 3;
  EXPECT_EQ(planner->Plan(good_request, &long_action).code, StatusCode::kInvalidArgument);
  PlanResult more_metrics = good_result;
  ++more_metrics.metrics.size;
  EXPECT_EQ(planner->Plan(good_request, &more_metrics).code, StatusCode::kInvalidArgument);
  EXPECT_EQ(planner->Plan(good_request, nullptr).code, StatusCode::kInvalidArgument);
}

TEST_P(EveryPlanner, PassesOnAnErrorOfTheModelAndLeavesTheResultUnset) {
  ScriptedModel model = Drift();
  LoadedPlanner planner(*GetParam(), &model);
  const ScriptedState root = Start();
  model.fail_after = UINT64_MAX;
  ASSERT_TRUE(planner.Plan(AsLatents(root), {.explore = true}).status.ok());
  const std::uint64_t all_calls = model.calls;
  ASSERT_GT(all_calls, 0u);
  const std::uint64_t stride = std::max<std::uint64_t>(1, all_calls / 50);
  for (std::uint64_t ok_calls = 0; ok_calls < all_calls; ok_calls += stride) {
    ASSERT_TRUE(planner->BeginEpisode(&model).ok());
    model.calls = 0;
    model.fail_after = ok_calls;
    const Decision decision = planner.Plan(AsLatents(root), {.explore = true});
    EXPECT_EQ(decision.status.code, StatusCode::kInternal);
    EXPECT_STREQ(decision.status.message, "scripted failure");
    for (const double a : decision.action) EXPECT_EQ(a, -7);
    for (const double metric : decision.metrics) EXPECT_EQ(metric, -7);
    EXPECT_EQ(decision.result.value, 0);
    EXPECT_TRUE(decision.tree.empty());
  }
  // And the planner is still of use.
  model.fail_after.reset();
  EXPECT_TRUE(planner.Plan(AsLatents(root)).status.ok());
}

TEST_P(EveryPlanner, ReportsNumbersThatAreNotFinite) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    {
      ScriptedModel model = Drift();
      model.value = [bad](const ScriptedState&) { return bad; };
      model.transition = [bad](const ScriptedState& state, ScriptedModel::Action) {
        return ScriptedTransition{state, bad, 1};
      };
      LoadedPlanner planner(*GetParam(), &model);
      EXPECT_EQ(planner.Plan(AsLatents(Start())).status.code, StatusCode::kNotFinite);
    }
    ScriptedModel model = Drift();
    model.mode = [bad](const ScriptedState&, View<double> action) { action[0] = action[1] = bad; };
    model.sample = [bad](const ScriptedState&, Random&, View<double> action) {
      action[0] = action[1] = bad;
    };
    LoadedPlanner planner(*GetParam(), &model);
    EXPECT_EQ(planner.Plan(AsLatents(Start())).status.code, StatusCode::kNotFinite);
  }
}

INSTANTIATE_TEST_SUITE_P(Planners, EveryPlanner, testing::ValuesIn(AllPlanners()),
                         [](const auto& test) { return std::string(test.param->name); });

}  // namespace
}  // namespace dreamsearch
