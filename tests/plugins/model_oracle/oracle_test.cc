// oracle_test.cc - the simulator as a model: on a scripted environment, whose numbers
// are known, and on the tasks of env_dmc, bit for bit.
// Over 400 lines: the scripted environment stands here too.
#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "dreamsearch/planning.h"
#include "tests/plugins/planners/loaded_planner.h"
#include "tests/plugins/planners/scripted_model.h"
#include "tests/sdk/default_values.h"

namespace dreamsearch {
namespace {

// Environment step n (from 1) pays 2^n + action. The time limit is after
// `limit` steps; the state `terminal` ends the episode with discount 0; the state
// `warning` is one the simulator cannot reach.
class Counter final : public Offers<Environment, StateSaving> {
 public:
  struct State {
    double steps = 0;
    std::uint64_t running = 0;
  };

  Counter() {
    spec_.observation = {&part_, 1};
    spec_.observation_size = 1;
    spec_.action_size = 1;
    spec_.action_low = {&low_, 1};
    spec_.action_high = {&high_, 1};
    spec_.episode_steps = 10;
  }
  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t, View<double> observation) noexcept override {
    state = {0, 1};
    observation[0] = 0;
    return OkStatus();
  }
  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept override {
    ++steps_taken;
    if (state.running == 0) return Error(StatusCode::kFailedPrecondition, "no episode");
    state.steps += 1;
    if (state.steps == warning) {
      state.running = 0;
      return Error(StatusCode::kDiverged, "scripted warning");
    }
    observation[0] = 100 * state.steps;
    result->reward = std::exp2(state.steps) + action[0];
    result->last = state.steps == limit || state.steps == terminal;
    result->discount = state.steps == terminal ? 0 : 1;
    if (result->last) state.running = 0;
    return OkStatus();
  }
  std::uint64_t state_bytes() const noexcept override { return sizeof(State); }
  Status SaveState(View<std::byte> out) const noexcept override {
    std::memcpy(out.data, &state, sizeof state);
    return OkStatus();
  }
  Status RestoreState(View<const std::byte> in) noexcept override {
    ++restores;
    std::memcpy(&state, in.data, sizeof state);
    return OkStatus();
  }
  void Destroy() noexcept override {}

  State state;
  double limit = 10;
  double terminal = -1;
  double warning = -1;
  int restores = 0;
  int steps_taken = 0;

 private:
  EnvironmentSpec spec_;
  ObservationPart part_{"count", 1};
  double low_ = -4;
  double high_ = 8;
};

// A trained model whose latent holds the sum of all it observed and of all actions.
class Summing final : public Model {
 public:
  struct alignas(64) Latent {
    double observed = 0;
    double acted = 0;
  };
  std::uint64_t latent_bytes() const noexcept override { return sizeof(Latent); }
  std::uint64_t action_size() const noexcept override { return 1; }
  Status Imagine(const ImagineRequest&, const ImagineResult&) noexcept override {
    return Error(StatusCode::kInternal, "the trained model must not imagine");
  }
  Status Value(ConstLatents latents, View<double> values) noexcept override {
    for (std::uint64_t i = 0; i < latents.rows; ++i) values[i] = At(latents, i).observed;
    return OkStatus();
  }
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override {
    for (std::uint64_t i = 0; i < latents.rows; ++i) actions(i, 0) = At(latents, i).acted;
    return OkStatus();
  }
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t>,
                        MatrixView<double> actions) noexcept override {
    const std::uint64_t each = actions.rows / latents.rows;
    for (std::uint64_t i = 0; i < actions.rows; ++i) {
      actions(i, 0) = At(latents, i / each).acted + 0.125;
    }
    return OkStatus();
  }
  Status InitialLatent(Latents latents) noexcept override {
    const Latent initial{7, 0};
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      std::memcpy(latents.row(i).data, &initial, sizeof initial);
    }
    return OkStatus();
  }
  Status Observe(const ObserveRequest& request, Latents latents) noexcept override {
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      Latent latent = At(request.previous, i);
      latent.observed += request.observations(i, 0);
      latent.acted += request.actions(i, 0);
      std::memcpy(latents.row(i).data, &latent, sizeof latent);
    }
    return OkStatus();
  }
  Status Train(const TrainRequest&, View<double>) noexcept override { return OkStatus(); }
  void SetThreads(std::uint32_t count) noexcept override { threads = count; }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override {}

  std::uint32_t threads = 1;

 private:
  static Latent At(ConstLatents latents, std::uint64_t i) {
    Latent latent;
    std::memcpy(&latent, latents.row(i).data, sizeof latent);
    return latent;
  }
};

class LoadedOracle {
 public:
  explicit LoadedOracle(Environment* environment, const Settings& settings = {},
                        std::uint32_t action_repeat = 1, Model* trained_model = nullptr) {
    const ComponentDescriptor& component = LoadPlugin("model_oracle").components[0];
    const std::vector<ParameterValue> values = Resolve(component, settings);
    ModelContext context;
    context.parameters = {{values.data(), values.size()}};
    context.action_size = environment != nullptr ? environment->spec().action_size : 1;
    context.observation_size = environment != nullptr ? environment->spec().observation_size : 1;
    context.action_repeat = action_repeat;
    context.environment = environment;
    context.trained_model = trained_model;
    status = component.create_model(context, &model_);
    if (model_ != nullptr) {
      latents_ = LatentBuffer(kLatents, model_->latent_bytes());
      for (std::uint64_t i = 0; i < kLatents; ++i) {
        std::memset(latents_.row(i).data, 0xee, model_->latent_bytes());
      }
    }
  }
  ~LoadedOracle() {
    if (model_ != nullptr) model_->Destroy();
  }

  Model* operator->() { return model_; }
  Model* get() { return model_; }
  Latents latent(std::uint64_t i) { return latents_.row(i); }

  // Latent i becomes what Observe makes of a state and an episode's beginning.
  void Observe(std::uint64_t i, View<const std::byte> state, View<const double> observation) {
    const std::vector<double> zero(model_->action_size());
    ASSERT_TRUE(model_->InitialLatent(latent(kLatents - 1)).ok());
    ObserveRequest request;
    request.previous = latent(kLatents - 1);
    request.actions = {zero.data(), 1, zero.size()};
    request.observations = {observation.data, 1, observation.size};
    request.environment_states = {state.data, 1, state.size};
    const std::uint64_t seed = 1;
    request.seeds = {&seed, 1};
    const Status observed = model_->Observe(request, latent(i));
    ASSERT_TRUE(observed.ok()) << observed.message;
  }

  struct Transition {
    double reward = -7;
    double discount = -7;
  };
  Transition Imagine(std::uint64_t from, const std::vector<double>& action, std::uint64_t to) {
    Transition transition;
    const std::uint64_t seed = 1;
    const Status imagined =
        model_->Imagine({latent(from), {action.data(), 1, action.size()}, {&seed, 1}},
                        {latent(to), {&transition.reward, 1}, {&transition.discount, 1}});
    if (!imagined.ok()) throw std::runtime_error(imagined.message);
    return transition;
  }

  static constexpr std::uint64_t kLatents = 64;
  Status status;

 private:
  Model* model_ = nullptr;
  LatentBuffer latents_;
};

View<const std::byte> AsBytes(const Counter::State& state) {
  return {reinterpret_cast<const std::byte*>(&state), sizeof state};
}

// --- closed forms ---

TEST(Oracle, SumsTheRewardsOfTheActionRepeatInTheEnvironmentsBounds) {
  Counter environment;
  LoadedOracle oracle(&environment, {{"discount", 0.75}}, 3);
  const double zero = 0;
  oracle.Observe(0, AsBytes({0, 1}), {&zero, 1});
  // 0.5 of [-1, 1] is 5 of [-4, 8].
  const auto step = oracle.Imagine(0, {0.5}, 1);
  EXPECT_EQ(step.reward, 2 + 4 + 8 + 3 * 5.0);
  EXPECT_EQ(step.discount, 0.75) << "one discount a decision";
  const auto next = oracle.Imagine(1, {-1}, 2);
  EXPECT_EQ(next.reward, 16 + 32 + 64 - 3 * 4.0);
}

TEST(Oracle, NothingMovesAfterTheTimeLimit) {
  Counter environment;
  LoadedOracle oracle(&environment, {}, 2);
  const double zero = 0;
  oracle.Observe(0, AsBytes({7, 1}), {&zero, 1});
  oracle.Imagine(0, {0.0}, 1);
  // The limit cuts the repeat short.
  const auto last = oracle.Imagine(1, {-1.0 / 3}, 2);
  EXPECT_NEAR(last.reward, 1024, 1e-12);
  EXPECT_EQ(last.discount, 0.99) << "a time limit is not terminal";
  const int steps = environment.steps_taken;
  const auto after = oracle.Imagine(2, {1.0}, 3);
  EXPECT_EQ(after.reward, 0);
  EXPECT_EQ(after.discount, 0);
  EXPECT_EQ(environment.steps_taken, steps);
  EXPECT_EQ(std::memcmp(oracle.latent(2).data, oracle.latent(3).data, oracle->latent_bytes()), 0);
}

TEST(Oracle, ATerminalStateHasDiscountZero) {
  Counter environment;
  environment.terminal = 2;
  LoadedOracle oracle(&environment, {}, 4);
  const double zero = 0;
  oracle.Observe(0, AsBytes({0, 1}), {&zero, 1});
  const auto step = oracle.Imagine(0, {-1.0 / 3}, 1);
  EXPECT_NEAR(step.reward, 2 + 4, 1e-12);
  EXPECT_EQ(step.discount, 0);
}

TEST(Oracle, ASimulatorsWarningIsTheEndAndTheOracleGoesOn) {
  Counter environment;
  environment.warning = 2;
  LoadedOracle oracle(&environment, {}, 2);
  const double zero = 0;
  oracle.Observe(0, AsBytes({0, 1}), {&zero, 1});
  const auto step = oracle.Imagine(0, {-1.0 / 3}, 1);
  EXPECT_NEAR(step.reward, 2, 1e-12);
  EXPECT_EQ(step.discount, 0);
  EXPECT_EQ(oracle.Imagine(1, {1.0}, 2).reward, 0);
  oracle.Observe(0, AsBytes({4, 1}), {&zero, 1});
  EXPECT_NEAR(oracle.Imagine(0, {-1.0 / 3}, 1).reward, 32 + 64, 1e-12);
}

TEST(Oracle, RestoresOnlyWhereTheSimulatorIsNotAlready) {
  Counter environment;
  LoadedOracle oracle(&environment);
  const double zero = 0;
  oracle.Observe(0, AsBytes({0, 1}), {&zero, 1});
  for (std::uint64_t i = 0; i < 5; ++i) oracle.Imagine(i, {0.5}, i + 1);
  EXPECT_EQ(environment.restores, 1);
  oracle.Imagine(2, {0.5}, 6);
  EXPECT_EQ(environment.restores, 2);
}

TEST(Oracle, WithoutATrainedModelItKnowsNoActorAndNoCritic) {
  Counter environment;
  const double zero = 0;
  {
    LoadedOracle oracle(&environment);
    oracle.Observe(0, AsBytes({0, 1}), {&zero, 1});
    double value = -7, mode = -7;
    ASSERT_TRUE(oracle->Value(oracle.latent(0), {&value, 1}).ok());
    ASSERT_TRUE(oracle->ProposeMode(oracle.latent(0), {&mode, 1, 1}).ok());
    EXPECT_EQ(value, 0);
    EXPECT_EQ(mode, 0);
  }
  constexpr int kSamples = 20000;
  for (const bool gaussian : {false, true}) {
    LoadedOracle oracle(&environment,
                        {{"proposal", gaussian ? "gaussian" : "uniform"}, {"proposal_std", 0.1}});
    oracle.Observe(0, AsBytes({0, 1}), {&zero, 1});
    std::vector<double> samples(kSamples);
    const std::uint64_t seed = 3;
    ASSERT_TRUE(
        oracle->ProposeSamples(oracle.latent(0), {&seed, 1}, {samples.data(), samples.size(), 1})
            .ok());
    double mean = 0, squares = 0;
    for (const double a : samples) {
      mean += a / kSamples;
      squares += a * a / kSamples;
    }
    // Five standard errors.
    const double std = gaussian ? 0.1 : 1 / std::sqrt(3.0);
    EXPECT_NEAR(mean, 0, 5 * std / std::sqrt(kSamples));
    EXPECT_NEAR(std::sqrt(squares), std, 5 * std / std::sqrt(2.0 * kSamples));
  }
}

TEST(Oracle, TheTrainedModelsLatentFollowsWhatTheSimulatorShows) {
  Counter environment;
  Summing trained_model;
  LoadedOracle oracle(&environment, {}, 1, &trained_model);
  const double first = 1;
  oracle.Observe(0, AsBytes({0, 1}), {&first, 1});
  oracle.Imagine(0, {0.25}, 1);
  oracle.Imagine(1, {0.5}, 2);
  double value = 0, mode = 0, samples[2] = {};
  ASSERT_TRUE(oracle->Value(oracle.latent(2), {&value, 1}).ok());
  ASSERT_TRUE(oracle->ProposeMode(oracle.latent(2), {&mode, 1, 1}).ok());
  const std::uint64_t seed = 1;
  ASSERT_TRUE(oracle->ProposeSamples(oracle.latent(2), {&seed, 1}, {samples, 2, 1}).ok());
  EXPECT_EQ(value, 7 + 1 + 100 + 200);
  EXPECT_EQ(mode, 0.75);
  EXPECT_EQ(samples[0], 0.875);
  EXPECT_EQ(samples[1], 0.875);

  LoadedOracle plain(&environment, {{"proposal", "uniform"}, {"value", "zero"}}, 1, &trained_model);
  plain.Observe(0, AsBytes({0, 1}), {&first, 1});
  ASSERT_TRUE(plain->Value(plain.latent(0), {&value, 1}).ok());
  EXPECT_EQ(value, 0);
}

TEST(Oracle, ABatchEqualsItsRows) {
  Counter environment;
  Summing trained_model;
  LoadedOracle oracle(&environment, {}, 2, &trained_model);
  const double first = 1;
  for (std::uint64_t i = 0; i < 3; ++i) {
    oracle.Observe(i, AsBytes({static_cast<double>(2 * i), 1}), {&first, 1});
  }
  const std::vector<double> actions = {0.5, -0.5, 1};
  const std::uint64_t seeds[] = {1, 1, 1};
  double rewards[3], discounts[3];
  ASSERT_TRUE(
      oracle
          ->Imagine(
              {{oracle.latent(0).data, 3, oracle->latent_bytes()},
               {actions.data(), 3, 1},
               {seeds, 3}},
              {{oracle.latent(10).data, 3, oracle->latent_bytes()}, {rewards, 3}, {discounts, 3}})
          .ok());
  for (std::uint64_t i = 0; i < 3; ++i) {
    const auto alone = oracle.Imagine(i, {actions[i]}, 20);
    EXPECT_EQ(alone.reward, rewards[i]);
    EXPECT_EQ(alone.discount, discounts[i]);
    EXPECT_EQ(
        std::memcmp(oracle.latent(20).data, oracle.latent(10 + i).data, oracle->latent_bytes()), 0);
  }
}

// The law of rows where nothing moves any more: such a row shows the trained model nothing,
// least of all what the simulator showed for the row before it.
TEST(Oracle, ARowThatIsOverKeepsTheTrainedModelsLatentWhateverStandsBeforeIt) {
  Counter environment;
  Summing trained_model;
  LoadedOracle oracle(&environment, {}, 1, &trained_model);
  const double first = 1;
  oracle.Observe(0, AsBytes({0, 1}), {&first, 1});
  oracle.Observe(1, AsBytes({9, 1}), {&first, 1});  // one step from its end
  oracle.Imagine(1, {0.5}, 2);                      // over
  const std::vector<double> actions = {0.25, 0.5};
  const std::uint64_t seeds[] = {1, 2};
  double rewards[2], discounts[2];
  std::memcpy(oracle.latent(3).data, oracle.latent(0).data, oracle->latent_bytes());
  std::memcpy(oracle.latent(4).data, oracle.latent(2).data, oracle->latent_bytes());
  ASSERT_TRUE(
      oracle
          ->Imagine(
              {{oracle.latent(3).data, 2, oracle->latent_bytes()},
               {actions.data(), 2, 1},
               {seeds, 2}},
              {{oracle.latent(10).data, 2, oracle->latent_bytes()}, {rewards, 2}, {discounts, 2}})
          .ok());
  EXPECT_EQ(rewards[1], 0);
  EXPECT_EQ(discounts[1], 0);
  EXPECT_EQ(std::memcmp(oracle.latent(11).data, oracle.latent(2).data, oracle->latent_bytes()), 0);
  EXPECT_NE(std::memcmp(oracle.latent(10).data, oracle.latent(0).data, oracle->latent_bytes()), 0);
}

TEST(Oracle, PassesTheNumberOfThreadsToTheTrainedModel) {
  Counter environment;
  Summing trained_model;
  LoadedOracle oracle(&environment, {}, 1, &trained_model);
  EXPECT_EQ(trained_model.threads, 1u);
  oracle->SetThreads(3);
  EXPECT_EQ(trained_model.threads, 3u);
}

TEST(Oracle, SaysWhatItCannotDo) {
  Counter environment;
  EXPECT_EQ(LoadedOracle(nullptr).status.code, StatusCode::kInvalidArgument);
  EXPECT_EQ(LoadedOracle(&environment, {{"value", "critic"}}).status.code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(LoadedOracle(&environment, {{"proposal", "actor"}}).status.code,
            StatusCode::kInvalidArgument);
  LoadedOracle oracle(&environment);
  EXPECT_EQ(oracle->Train({}, {}).code, StatusCode::kUnimplemented);
  const double zero = 0;
  ObserveRequest request;
  request.previous = oracle.latent(0);
  request.actions = {&zero, 1, 1};
  request.observations = {&zero, 1, 1};
  EXPECT_EQ(oracle->Observe(request, oracle.latent(1)).code, StatusCode::kInvalidArgument)
      << "no environment state";
}

// --- the tasks of env_dmc ---

class EveryTask : public testing::TestWithParam<const ComponentDescriptor*> {
 protected:
  static Environment* Make() {
    const std::vector<ParameterValue> values = DefaultValues(*GetParam());
    EnvironmentContext context;
    context.parameters = {{values.data(), values.size()}};
    Environment* environment = nullptr;
    const Status made = GetParam()->create_environment(context, &environment);
    if (!made.ok()) throw std::runtime_error(made.message);
    return environment;
  }
};

// A tree of transitions, each node's children imagined after all the others of its
// level, so that the simulator is hardly ever where it should be; against an
// environment that is stepped from the start down every branch.
TEST_P(EveryTask, ImagineEqualsSteppingBitForBit) {
  constexpr std::uint32_t kRepeat = 2;
  constexpr std::uint32_t kSeed = 3;
  constexpr std::uint64_t kBranches = 2, kLevels = 4;
  Environment* real = Make();
  Environment* own = Make();
  {
    LoadedOracle oracle(own, {}, kRepeat);
    const EnvironmentSpec& spec = real->spec();
    std::vector<double> observation(spec.observation_size), bounded(spec.action_size);
    auto* saving = ExtensionOf<StateSaving>(real);
    std::vector<std::byte> state(saving->state_bytes());
    const View<double> observed{observation.data(), observation.size()};

    // The actions and latents of a complete binary tree; node i hangs on (i - 1) / 2.
    const std::uint64_t nodes = (std::uint64_t{1} << kLevels) - 1;
    std::vector<std::vector<double>> actions(nodes, std::vector<double>(spec.action_size));
    Random random(11);
    for (auto& action : actions) {
      for (double& a : action) a = random.Uniform(-1, 1);
    }
    // The root lies some steps into the episode.
    const auto go_to_root = [&] {
      ASSERT_TRUE(real->Reset(kSeed, observed).ok());
      StepResult step;
      for (int i = 0; i < 20; ++i) {
        ToEnvironmentBounds(spec, {actions[0].data(), spec.action_size},
                            {bounded.data(), bounded.size()});
        ASSERT_TRUE(real->Step({bounded.data(), bounded.size()}, observed, &step).ok());
      }
    };
    go_to_root();
    ASSERT_TRUE(saving->SaveState({state.data(), state.size()}).ok());
    oracle.Observe(0, {state.data(), state.size()}, observed);
    std::vector<double> rewards(nodes);
    for (std::uint64_t node = 1; node < nodes; ++node) {
      rewards[node] = oracle.Imagine((node - 1) / kBranches, actions[node], node).reward;
    }
    for (std::uint64_t leaf = nodes / 2; leaf < nodes; ++leaf) {
      std::vector<std::uint64_t> path;
      for (std::uint64_t node = leaf; node != 0; node = (node - 1) / kBranches) {
        path.insert(path.begin(), node);
      }
      go_to_root();
      for (const std::uint64_t node : path) {
        double reward = 0;
        for (std::uint32_t i = 0; i < kRepeat; ++i) {
          ToEnvironmentBounds(spec, {actions[node].data(), spec.action_size},
                              {bounded.data(), bounded.size()});
          StepResult step;
          ASSERT_TRUE(real->Step({bounded.data(), bounded.size()}, observed, &step).ok());
          reward += step.reward;
        }
        ASSERT_EQ(reward, rewards[node]) << "node " << node;
        ASSERT_TRUE(saving->SaveState({state.data(), state.size()}).ok());
        ASSERT_EQ(std::memcmp(state.data(), oracle.latent(node).data + 8, state.size()), 0);
      }
    }
  }
  real->Destroy();
  own->Destroy();
}

// Every planner runs on the oracle unchanged, but for those that need what it does not offer.
TEST_P(EveryTask, EveryPlannerPlansOnItOrSaysWhatItMisses) {
  Environment* real = Make();
  Environment* own = Make();
  {
    LoadedOracle oracle(own, {}, 2);
    const EnvironmentSpec& spec = real->spec();
    std::vector<double> observation(spec.observation_size);
    auto* saving = ExtensionOf<StateSaving>(real);
    std::vector<std::byte> state(saving->state_bytes());
    ASSERT_TRUE(real->Reset(1, {observation.data(), observation.size()}).ok());
    ASSERT_TRUE(saving->SaveState({state.data(), state.size()}).ok());
    oracle.Observe(0, {state.data(), state.size()}, {observation.data(), observation.size()});
    for (const ComponentDescriptor* component : AllPlanners()) {
      // Budgets that any simulator gets through at once.
      Settings settings;
      for (const ParameterSpec& parameter : component->parameters) {
        const std::string name = parameter.name;
        if (name == "simulations") settings.push_back({"simulations", 8});
        if (name == "candidates") settings.push_back({"candidates", 8});
        if (name == "elites") settings.push_back({"elites", 4});
        if (name == "actor_candidates") settings.push_back({"actor_candidates", 4});
        if (name == "uniform_candidates") settings.push_back({"uniform_candidates", 4});
        if (name == "sequences") settings.push_back({"sequences", 4});
        if (name == "iterations") settings.push_back({"iterations", 2});
        if (name == "horizon") settings.push_back({"horizon", 3});
        if (name == "depth") settings.push_back({"depth", 3});
      }
      if ((component->traits & kNeedsGradients) != 0 &&
          ExtensionOf<ReturnGradient>(oracle.get()) == nullptr) {
        EXPECT_THROW(LoadedPlanner(*component, oracle.get(), settings), std::runtime_error);
        continue;
      }
      LoadedPlanner planner(*component, oracle.get(), settings);
      const Decision decision = planner.Plan(oracle.latent(0));
      ASSERT_TRUE(decision.status.ok()) << component->name << ": " << decision.status.message;
      for (const double a : decision.action) EXPECT_LE(std::abs(a), 1);
    }
  }
  real->Destroy();
  own->Destroy();
}

std::vector<const ComponentDescriptor*> AllTasks() {
  std::vector<const ComponentDescriptor*> tasks;
  for (const ComponentDescriptor& component : LoadPlugin("env_dmc").components) {
    if (component.kind == ComponentKind::kEnvironment) tasks.push_back(&component);
  }
  return tasks;
}

INSTANTIATE_TEST_SUITE_P(Tasks, EveryTask, testing::ValuesIn(AllTasks()),
                         [](const auto& test) { return std::string(test.param->name); });

}  // namespace
}  // namespace dreamsearch
