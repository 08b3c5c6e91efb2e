// Planners that ask one model together have the bits that each has alone.
// Over 400 lines: a scripted model, environment and planners of its own stand here too.
#include "host/acting/joint_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "dreamsearch/random.h"
#include "host/acting/activity_clock.h"
#include "host/acting/actor.h"
#include "host/acting/episode.h"
#include "host/acting/fiber.h"
#include "host/plugins/plugin_loader.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

constexpr std::uint64_t kActions = 2;

const PluginDescriptor& Plugin(const std::string& name) {
  return LoadPlugin(std::string(DREAMSEARCH_TEST_PLUGIN_DIR) + "/" + name + ".so");
}

std::vector<const ComponentDescriptor*> AllPlanners() {
  std::vector<const ComponentDescriptor*> planners;
  for (const char* plugin : {"planner_dreamer", "planner_random", "planner_rollout", "planner_mcts",
                             "planner_shooting"}) {
    for (const ComponentDescriptor& component : Plugin(plugin).components) {
      planners.push_back(&component);
    }
  }
  return planners;
}

const ComponentDescriptor& FindPlanner(const std::string& name) {
  for (const ComponentDescriptor* planner : AllPlanners()) {
    if (planner->name == name) return *planner;
  }
  throw std::runtime_error("no planner " + name);
}

// The declared defaults, but for numbers that `settings` names.
std::vector<ParameterValue> Resolve(const ComponentDescriptor& component,
                                    const std::map<std::string, double>& settings = {}) {
  std::vector<ParameterValue> values;
  for (const ParameterSpec& spec : component.parameters) {
    const auto set = settings.find(spec.name);
    values.push_back({spec.name, set != settings.end() ? set->second : spec.default_number,
                      spec.default_choice});
  }
  return values;
}

struct alignas(kLatentAlignment) State {
  double x[8] = {};
};

// A model whose every answer is a closed form of the row's own latent, action,
// observation and seed; counts what it is asked, and goes wrong where a test says so.
class Linear final : public Offers<Model, ValueSpread, ReturnGradient> {
 public:
  struct Count {
    std::uint64_t calls = 0, rows = 0, most_rows = 0;
    void Add(std::uint64_t n) {
      ++calls;
      rows += n;
      most_rows = std::max(most_rows, n);
    }
  };
  Count imagine, gradient, value, spread, mode, samples, observe;
  // Latents whose x[7] is this value as nothing; a request that holds one is refused.
  double poison = std::numeric_limits<double>::quiet_NaN();
  double busy_seconds = 0;  // that Imagine takes

  std::uint64_t latent_bytes() const noexcept override { return sizeof(State); }
  std::uint64_t action_size() const noexcept override { return kActions; }

  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    imagine.Add(request.latents.rows);
    const double until = ActivityClock::Now() + busy_seconds;
    while (ActivityClock::Now() < until) {
    }
    if (Status status = Refuses(request.latents); !status.ok()) return status;
    for (std::uint64_t i = 0; i < request.latents.rows; ++i) {
      State state = At(request.latents, i);
      Move(&state, request.actions.row(i), request.seeds[i]);
      Put(state, result.latents, i);
      result.rewards[i] = 1 - state.x[0] * state.x[0] - 0.1 * std::abs(state.x[1]);
      result.discounts[i] = 0.9;
    }
    return OkStatus();
  }
  // Sequences are worth the sum of their actions, each by its place, and of their seeds' last
  // digits.
  Status Gradient(const GradientRequest& request, const GradientResult& result) noexcept override {
    gradient.Add(request.latents.rows);
    const std::uint64_t steps = request.actions.rows / request.latents.rows;
    for (std::uint64_t i = 0; i < request.latents.rows; ++i) {
      const double start = At(request.latents, i).x[0] + request.deviations;
      result.returns[i] = request.least ? -start : start;
      for (std::uint64_t t = 0; t < steps; ++t) {
        const std::uint64_t row = i * steps + t;
        result.returns[i] += static_cast<double>(request.seeds[row] % 10);
        for (std::uint64_t j = 0; j < kActions; ++j) {
          result.returns[i] += static_cast<double>(t) * request.actions(row, j);
          result.gradients(row, j) = static_cast<double>(t) + start;
        }
      }
    }
    return OkStatus();
  }
  Status Value(ConstLatents latents, View<double> values) noexcept override {
    value.Add(latents.rows);
    if (Status status = Refuses(latents); !status.ok()) return status;
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      const State state = At(latents, i);
      values[i] = std::cos(state.x[0]) + state.x[1];
    }
    return OkStatus();
  }
  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept override {
    spread.Add(latents.rows);
    if (Status status = Refuses(latents); !status.ok()) return status;
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      const State state = At(latents, i);
      result.values[i] = std::cos(state.x[0]) + state.x[1];
      if (!result.deviations.empty()) result.deviations[i] = std::abs(state.x[2]);
      if (!result.least.empty()) result.least[i] = result.values[i] - std::abs(state.x[2]);
    }
    return OkStatus();
  }
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override {
    mode.Add(latents.rows);
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      for (std::uint64_t j = 0; j < kActions; ++j) {
        actions(i, j) = std::tanh(-At(latents, i).x[j]);
      }
    }
    return OkStatus();
  }
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override {
    samples.Add(latents.rows);
    const std::uint64_t each = actions.rows / latents.rows;
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      Random random(seeds[i]);
      for (std::uint64_t j = 0; j < each * kActions; ++j) {
        actions.data[i * each * kActions + j] =
            std::clamp(std::tanh(-At(latents, i).x[j % kActions]) + 0.5 * random.Normal(), -1., 1.);
      }
    }
    return OkStatus();
  }
  Status InitialLatent(Latents latents) noexcept override {
    std::memset(latents.data, 0, latents.size());
    return OkStatus();
  }
  Status Observe(const ObserveRequest& request, Latents latents) noexcept override {
    observe.Add(latents.rows);
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      State state = At(request.previous, i);
      Move(&state, request.actions.row(i), request.seeds[i]);
      for (std::uint64_t j = 0; j < request.observations.cols; ++j) {
        state.x[j] = 0.5 * state.x[j] + request.observations(i, j);
      }
      state.x[7] = request.observations(i, 2);
      Put(state, latents, i);
    }
    return OkStatus();
  }
  Status Train(const TrainRequest&, View<double>) noexcept override { return OkStatus(); }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  static State At(ConstLatents latents, std::uint64_t i) {
    State state;
    std::memcpy(&state, latents.row(i).data, sizeof state);
    return state;
  }
  static void Put(const State& state, Latents latents, std::uint64_t i) {
    std::memcpy(latents.row(i).data, &state, sizeof state);
  }
  static void Move(State* state, View<const double> action, std::uint64_t seed) {
    Random random(seed);
    state->x[0] = 0.9 * state->x[0] + 0.3 * action[0] + 0.05 * random.Normal();
    state->x[1] = 0.8 * state->x[1] + 0.2 * action[1];
    state->x[2] = random.Normal();
  }
  Status Refuses(ConstLatents latents) const {
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      if (At(latents, i).x[7] == poison) {
        return Error(StatusCode::kNotFinite, "poison %g", poison);
      }
    }
    return OkStatus();
  }
};

// A point that is pushed about; its episodes end after 4 to 9 steps if `uneven`, else
// after 6. It shows the episode's number, by its seed, as the third component.
class Push final : public Offers<Environment, StateSaving> {
 public:
  Push(bool uneven, std::map<std::uint32_t, double> numbers)
      : uneven_(uneven), numbers_(std::move(numbers)) {
    spec_.observation = {&part_, 1};
    spec_.observation_size = 3;
    spec_.action_size = kActions;
    spec_.action_low = {low_, kActions};
    spec_.action_high = {high_, kActions};
    spec_.control_seconds = 0.1;
    spec_.episode_steps = 9;
  }
  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t seed, View<double> observation) noexcept override {
    Random random(seed);
    state_ = {};
    state_.x = random.Uniform(-1, 1);
    state_.length = uneven_ ? 4 + static_cast<double>(random.Below(6)) : 6;
    const auto number = numbers_.find(seed);
    state_.number = number != numbers_.end() ? number->second : -1;
    Show(observation);
    return OkStatus();
  }
  Status Step(View<const double> action, View<double> observation,
              StepResult* result) noexcept override {
    state_.x += 0.2 * action[0];
    state_.y += 0.1 * action[1];
    state_.t += 1;
    result->reward = 1 - std::abs(state_.x) + state_.y;
    result->last = state_.t >= state_.length;
    Show(observation);
    return OkStatus();
  }
  std::uint64_t state_bytes() const noexcept override { return sizeof state_; }
  Status SaveState(View<std::byte> state) const noexcept override {
    std::memcpy(state.data, &state_, sizeof state_);
    return OkStatus();
  }
  Status RestoreState(View<const std::byte> state) noexcept override {
    std::memcpy(&state_, state.data, sizeof state_);
    return OkStatus();
  }
  void Destroy() noexcept override { delete this; }

 private:
  void Show(View<double> observation) const {
    observation[0] = state_.x;
    observation[1] = state_.y;
    observation[2] = state_.number;
  }
  struct {
    double x, y, t, length, number;
  } state_ = {};
  const bool uneven_;
  const std::map<std::uint32_t, double> numbers_;
  EnvironmentSpec spec_;
  ObservationPart part_{"point", 3};
  const double low_[kActions] = {-1, -1};
  const double high_[kActions] = {1, 1};
};

constexpr std::uint64_t kRunSeed = 5;

std::uint32_t SeedOf(std::uint64_t episode) {
  return static_cast<std::uint32_t>(
      SeedFor(kRunSeed, SeedUse::kEnvironment, EpisodePurpose::kEvaluation, episode, 0));
}

EnvironmentPtr MakePush(bool uneven) {
  std::map<std::uint32_t, double> numbers;
  for (std::uint64_t i = 0; i < 20; ++i) numbers[SeedOf(i)] = static_cast<double>(i);
  return EnvironmentPtr(new Push(uneven, std::move(numbers)));
}

// Fails in chosen episodes, which it knows by the root's x[7], at a chosen decision.
class Failing final : public Planner {
 public:
  explicit Failing(std::map<int, std::uint64_t> at) : at_(std::move(at)) {}
  Status BeginEpisode(LatentModel* model) noexcept override {
    model_ = model;
    return OkStatus();
  }
  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    State state;
    std::memcpy(&state, request.root.data, sizeof state);
    const auto found = at_.find(static_cast<int>(state.x[7]));
    if (found != at_.end() && found->second == request.decision) {
      return Error(StatusCode::kInternal, "episode %d fails", found->first);
    }
    result->value = 0;
    return model_->ProposeMode(request.root, {result->action.data, 1, kActions});
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  const std::map<int, std::uint64_t> at_;
  LatentModel* model_ = nullptr;
};

struct Played {
  std::map<std::uint64_t, results::EpisodeRow> rows;
  std::set<std::uint64_t> begun;
  EpisodeFaults faults;
  std::string Error() const {
    try {
      faults.RethrowFirst();
    } catch (const Failure& error) {
      return error.what();
    }
    return "";
  }
};

using MakePlanner = std::function<PlannerPtr()>;

PlannerPtr NewPlanner(const ComponentDescriptor& component, const Model& model) {
  std::vector<ParameterValue> values = Resolve(component, {{"simulations", 12},
                                                           {"candidates", 24},
                                                           {"elites", 6},
                                                           {"actor_candidates", 5},
                                                           {"uniform_candidates", 4},
                                                           {"iterations", 2}});
  for (ParameterValue& value : values) {
    if (std::string(value.name) == "continuation") value.choice = "sample";
  }
  Planner* planner = nullptr;
  const Status made = component.create_planner(
      {{{values.data(), values.size()}}, model.action_size(), model.latent_bytes()}, &planner);
  if (!made.ok()) throw std::runtime_error(made.message);
  return PlannerPtr(planner);
}

// Plays episodes [first, end) on that many seats; `make` is empty for the actor alone.
Played Play(Model* model, std::size_t seats, std::uint64_t first, std::uint64_t end,
            const MakePlanner& make, std::size_t metrics, bool needs_environment = false,
            bool uneven = true) {
  JointModel joint(model, seats);
  std::vector<EnvironmentPtr> environments;
  EpisodePlayers::Parts parts;
  for (std::size_t i = 0; i < seats; ++i) {
    environments.push_back(MakePush(uneven));
    parts.planners.push_back(make ? make() : MakeActor());
  }
  parts.model = &joint;
  parts.environments = environments;
  parts.agent.model_name = "linear";
  parts.agent.planner_text = "planner 'tested'";
  parts.agent.metrics.assign(metrics, "metric");
  parts.agent.model_needs_environment = needs_environment;
  parts.environment_name = "push";
  parts.run_seed = kRunSeed;
  EpisodePlayers players(std::move(parts));
  Played played;
  EpisodeCourse course;
  course.next = [&]() -> std::optional<std::uint64_t> {
    if (first == end || !played.faults.empty()) return std::nullopt;
    played.begun.insert(first);
    return first++;
  };
  course.go_on = [&](std::uint64_t index, std::uint64_t) { return played.faults.MayGoOn(index); };
  course.ended = [&](std::uint64_t index, const results::EpisodeRow& row) {
    played.rows[index] = row;
  };
  course.failed = [&](std::uint64_t index, std::exception_ptr error) {
    played.faults.Add(index, std::move(error));
  };
  players.Play(course, 0);
  return played;
}

void ExpectSameEpisodes(const Played& alone, const Played& together, const std::string& where) {
  EXPECT_EQ(together.Error(), "") << where;
  for (const auto& [index, row] : together.rows) {
    SCOPED_TRACE(where + ", episode " + std::to_string(index));
    const results::EpisodeRow& expected = alone.rows.at(index);
    EXPECT_EQ(row.digest, expected.digest);
    EXPECT_EQ(row.episode_return, expected.episode_return);
    EXPECT_EQ(row.length, expected.length);
    EXPECT_EQ(row.model_transitions, expected.model_transitions);
  }
}

constexpr std::uint64_t kEpisodes = 8;

// All planners of the build, and the actor alone.
void ExpectTheBitsTheyHaveAlone(Model* model, bool needs_environment,
                                const std::set<std::string>& names = {}) {
  std::vector<const ComponentDescriptor*> planners = AllPlanners();
  planners.push_back(nullptr);
  for (const ComponentDescriptor* planner : planners) {
    const std::string name = planner != nullptr ? planner->name : "actor";
    if (!names.empty() && names.count(name) == 0) continue;
    MakePlanner make;
    if (planner != nullptr) make = [&] { return NewPlanner(*planner, *model); };
    const std::size_t metrics = planner != nullptr ? planner->metrics.size : 0;
    Played alone;
    for (std::uint64_t i = 0; i < kEpisodes; ++i) {
      alone.rows.merge(Play(model, 1, i, i + 1, make, metrics, needs_environment).rows);
    }
    ASSERT_EQ(alone.rows.size(), kEpisodes);
    for (std::uint64_t together = 1; together <= kEpisodes; ++together) {
      const Played played = Play(model, together, 0, together, make, metrics, needs_environment);
      EXPECT_EQ(played.rows.size(), together);
      ExpectSameEpisodes(alone, played, name + ", " + std::to_string(together) + " together");
    }
    // Who ends early makes room for the next.
    const Played rolling = Play(model, 3, 0, kEpisodes, make, metrics, needs_environment);
    EXPECT_EQ(rolling.rows.size(), kEpisodes);
    ExpectSameEpisodes(alone, rolling, name + ", 8 on 3 seats");
  }
}

TEST(EpisodePlayers, EveryEpisodeHasTheBitsItHasAlone) {
  Linear model;
  ExpectTheBitsTheyHaveAlone(&model, false);
  EXPECT_GT(model.imagine.most_rows, 8u);
}

TEST(EpisodePlayers, EveryEpisodeHasTheBitsItHasAloneWithTheOracle) {
  Linear trained_model;
  const ComponentDescriptor& component = Plugin("model_oracle").components[0];
  for (const bool with_trained_model : {false, true}) {
    const EnvironmentPtr own = MakePush(true);
    const std::vector<ParameterValue> values = Resolve(component);
    ModelContext context;
    context.parameters = {{values.data(), values.size()}};
    context.observation_size = 3;
    context.action_size = kActions;
    context.environment = own.get();
    context.trained_model = with_trained_model ? &trained_model : nullptr;
    Model* made = nullptr;
    ASSERT_TRUE(component.create_model(context, &made).ok());
    const ModelPtr oracle(made);
    ExpectTheBitsTheyHaveAlone(oracle.get(), true);
  }
}

TEST(EpisodePlayers, EveryEpisodeHasTheBitsItHasAloneWithDreamer) {
  const PluginDescriptor& plugin = Plugin("model_dreamer");
  const std::vector<ParameterValue> values = Resolve(plugin.components[0]);
  ModelContext context;
  context.parameters = {{values.data(), values.size()}};
  context.observation_size = 3;
  context.action_size = kActions;
  context.seed = 1;
  Model* made = nullptr;
  ASSERT_TRUE(plugin.components[0].create_model(context, &made).ok());
  const ModelPtr dreamer(made);
  ExpectTheBitsTheyHaveAlone(dreamer.get(), false, {"actor", "mcts_pw", "mppi"});
}

TEST(EpisodePlayers, TheActorAloneCostsOneRequestOfAKindADecision) {
  for (std::uint64_t together = 1; together <= kEpisodes; ++together) {
    Linear model;
    const Played played = Play(&model, together, 0, together, {}, 0, false, false);
    EXPECT_EQ(played.rows.size(), together);
    for (const Linear::Count& count : {model.observe, model.mode, model.value}) {
      EXPECT_EQ(count.calls, 6u) << together;
      EXPECT_EQ(count.rows, 6 * together);
    }
  }
}

TEST(EpisodePlayers, TheLeavesOfAllTreesGoInOneRequest) {
  Linear model;
  const ComponentDescriptor& planner = FindPlanner("mcts_pw");
  Play(
      &model, kEpisodes, 0, kEpisodes, [&] { return NewPlanner(planner, model); },
      planner.metrics.size, false, false);
  EXPECT_EQ(model.imagine.rows, 6 * 12 * kEpisodes);
  EXPECT_EQ(model.imagine.calls, 6 * 12u);
  EXPECT_EQ(model.value.calls, 6 * 12u);
}

TEST(EpisodePlayers, TheFaultOfTheFirstEpisodeIsMetHoweverManyArePlayedTogether) {
  Linear model;
  // Episode 5 fails first, at its first decision; 3 a little later; 6 is never met.
  const MakePlanner make = [] { return PlannerPtr(new Failing({{5, 0}, {3, 2}, {6, 1}})); };
  for (std::size_t seats = 1; seats <= kEpisodes; ++seats) {
    SCOPED_TRACE(seats);
    const Played played = Play(&model, seats, 0, kEpisodes, make, 0, false, false);
    EXPECT_NE(played.Error().find("planner 'tested' Plan"), std::string::npos) << played.Error();
    EXPECT_NE(played.Error().find("episode 3 fails"), std::string::npos) << played.Error();
    EXPECT_EQ(played.faults.FirstOr(99), 3u);
    for (const std::uint64_t before : {0u, 1u, 2u}) EXPECT_EQ(played.rows.count(before), 1u);
  }
}

TEST(EpisodePlayers, ARequestThatTheModelRefusesIsTheFaultOfItsOwnEpisodeAlone) {
  Linear model;
  const ComponentDescriptor& planner = FindPlanner("mcts_pw");
  const MakePlanner make = [&] { return NewPlanner(planner, model); };
  const Played healthy = Play(&model, 1, 0, 4, make, planner.metrics.size);
  model.poison = 4;
  const Played played = Play(&model, kEpisodes, 0, kEpisodes, make, planner.metrics.size);
  EXPECT_EQ(played.faults.FirstOr(99), 4u);
  EXPECT_NE(played.Error().find("poison 4"), std::string::npos) << played.Error();
  ASSERT_EQ(played.rows.size(), 4u) << "the episodes before it are played to their end";
  for (const auto& [index, row] : played.rows) {
    EXPECT_EQ(row.digest, healthy.rows.at(index).digest) << index;
  }
}

TEST(EpisodePlayers, AnEpisodeBrokenOffLeavesTheOthersAsTheyAre) {
  Linear model;
  const Played whole = Play(&model, 4, 0, 4, {}, 0);
  JointModel joint(&model, 4);
  std::vector<EnvironmentPtr> environments;
  EpisodePlayers::Parts parts;
  for (int i = 0; i < 4; ++i) {
    environments.push_back(MakePush(true));
    parts.planners.push_back(MakeActor());
  }
  parts.model = &joint;
  parts.environments = environments;
  parts.run_seed = kRunSeed;
  EpisodePlayers players(std::move(parts));
  // Twice with the same players: the second time nothing is left of the first.
  for (int turn = 0; turn < 2; ++turn) {
    std::uint64_t taken = 0;
    std::map<std::uint64_t, results::EpisodeRow> rows;
    EpisodeCourse course;
    course.next = [&]() -> std::optional<std::uint64_t> {
      if (taken == 4) return std::nullopt;
      return taken++;
    };
    course.go_on = [&](std::uint64_t index, std::uint64_t t) {
      return turn == 1 || index != 2 || t < 3;
    };
    course.ended = [&](std::uint64_t index, const results::EpisodeRow& row) { rows[index] = row; };
    course.failed = [](std::uint64_t, const std::exception_ptr&) { ADD_FAILURE(); };
    players.Play(course, 0);
    EXPECT_EQ(rows.count(2), turn == 1 ? 1u : 0u);
    for (const auto& [index, row] : rows) EXPECT_EQ(row.digest, whole.rows.at(index).digest);
  }
}

// --- the model asked jointly ---

TEST(JointModel, AnswersEachSeatWithItsOwnRows) {
  Linear model;
  JointModel joint(&model, 3);
  std::vector<std::vector<double>> answers(3), expected(3);
  const auto ask = [](Model* asked, std::uint64_t rows, std::vector<double>* out) {
    std::vector<State> states(rows), next(rows);
    for (std::uint64_t i = 0; i < rows; ++i) states[i].x[0] = 0.1 * static_cast<double>(rows + i);
    std::vector<double> actions(rows * kActions, 0.25), numbers(7 * rows);
    std::vector<std::uint64_t> seeds(rows);
    FillSeeds(rows, {seeds.data(), rows});
    const ConstLatents from{reinterpret_cast<const std::byte*>(states.data()), rows, sizeof(State)};
    const Latents to{reinterpret_cast<std::byte*>(next.data()), rows, sizeof(State)};
    const auto room = [&](std::uint64_t i) {
      return View<double>{numbers.data() + i * rows, rows};
    };
    ASSERT_TRUE(asked
                    ->Imagine({from, {actions.data(), rows, kActions}, {seeds.data(), rows}},
                              {to, room(0), room(1)})
                    .ok());
    std::vector<double> proposals(2 * rows * kActions);
    ASSERT_TRUE(
        asked->ProposeSamples(to, {seeds.data(), rows}, {proposals.data(), 2 * rows, kActions})
            .ok());
    ASSERT_TRUE(asked->Value(to, room(2)).ok());
    auto* spread = ExtensionOf<ValueSpread>(asked);
    // The first asks for the deviations alone, the others for all there is.
    const View<double> least = rows == 1 ? View<double>() : room(4);
    ASSERT_TRUE(spread->Spread(to, {room(5), room(3), least}).ok());
    // Sequences of three actions: the first asks for the least value, the others for the mean.
    std::vector<double> sequences(3 * rows * kActions), gradients(3 * rows * kActions);
    for (std::size_t i = 0; i < sequences.size(); ++i) sequences[i] = 0.01 * static_cast<double>(i);
    std::vector<std::uint64_t> own_seeds(3 * rows);
    FillSeeds(rows + 100, {own_seeds.data(), own_seeds.size()});
    GradientRequest request{
        to, {sequences.data(), 3 * rows, kActions}, {own_seeds.data(), own_seeds.size()}};
    request.least = rows == 1;
    ASSERT_TRUE(ExtensionOf<ReturnGradient>(asked)
                    ->Gradient(request, {room(6), {gradients.data(), 3 * rows, kActions}})
                    .ok());
    *out = numbers;
    out->insert(out->end(), proposals.begin(), proposals.end());
    out->insert(out->end(), gradients.begin(), gradients.end());
  };
  joint.Run([&](std::size_t i) { ask(joint.seat(i), i + 1, &answers[i]); });
  EXPECT_EQ(model.imagine.calls, 1u);
  EXPECT_EQ(model.value.calls, 1u);
  EXPECT_EQ(model.spread.calls, 2u) << "with and without the least";
  EXPECT_EQ(model.gradient.calls, 2u) << "by the least value and by the mean";
  EXPECT_EQ(model.samples.calls, 1u);
  for (std::size_t i = 0; i < 3; ++i) {
    ask(joint.seat(i), i + 1, &expected[i]);  // outside of Run it is the model itself
    EXPECT_EQ(answers[i], expected[i]) << i;
  }
}

TEST(JointModel, JoinsNoMoreRowsThanItSays) {
  Linear model;
  JointModel joint(&model, 4);
  constexpr std::uint64_t kRows = JointModel::kMostRows / 2;
  joint.Run([&](std::size_t i) {
    std::vector<State> states(i == 0 ? 3 * kRows : kRows);
    std::vector<double> values(states.size());
    ASSERT_TRUE(joint.seat(i)
                    ->Value({reinterpret_cast<const std::byte*>(states.data()), states.size(),
                             sizeof(State)},
                            {values.data(), values.size()})
                    .ok());
  });
  EXPECT_EQ(model.value.calls, 3u) << "one that is larger alone, two together, one left";
  EXPECT_EQ(model.value.rows, 6 * kRows);
}

TEST(JointModel, TheSharesOfTimeAddUp) {
  Linear model;
  model.busy_seconds = 0.01;
  JointModel joint(&model, 4);
  const double begin = ActivityClock::Now();
  joint.Run([&](std::size_t i) {
    for (std::size_t k = 0; k <= i; ++k) {
      State from, to;
      const double action[kActions] = {};
      double reward, discount;
      const std::uint64_t seed = k;
      ASSERT_TRUE(
          joint.seat(i)
              ->Imagine(
                  {{reinterpret_cast<const std::byte*>(&from), 1, sizeof from},
                   {action, 1, kActions},
                   {&seed, 1}},
                  {{reinterpret_cast<std::byte*>(&to), 1, sizeof to}, {&reward, 1}, {&discount, 1}})
              .ok());
    }
  });
  const double wall = ActivityClock::Now() - begin;
  // The k-th call serves 4 - k seats, which bear equal parts of it; other work on the processor can
  // only add to what a seat has.
  double sum = 0, least = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    least += model.busy_seconds / (4 - static_cast<double>(i));
    EXPECT_GE(joint.Seconds(i), least);
    sum += joint.Seconds(i);
  }
  EXPECT_EQ(model.imagine.calls, 4u);
  EXPECT_GE(sum, 4 * model.busy_seconds);
  EXPECT_LE(sum, wall);
}

// --- fibers ---

struct Counting {
  Fiber fiber;
  int step = 0;
};

TEST(Fiber, KeepsItsLocalsWhileItPauses) {
  Counting counting;
  counting.fiber.Start(
      [](void* context) noexcept {
        auto* self = static_cast<Counting*>(context);
        for (int local = 1; local <= 3; ++local) {
          self->step = local;
          self->fiber.Pause();
        }
      },
      &counting);
  for (int expected = 1; expected <= 3; ++expected) {
    EXPECT_FALSE(counting.fiber.ended());
    EXPECT_EQ(counting.step, expected);
    counting.fiber.Resume();
  }
  EXPECT_TRUE(counting.fiber.ended());
}

TEST(Fiber, ExceptionsUnderWayAreItsOwn) {
  Counting counting[2];
  for (Counting& one : counting) {
    one.fiber.Start(
        [](void* context) noexcept {
          auto* self = static_cast<Counting*>(context);
          try {
            throw std::runtime_error(self->step == 0 ? "first" : "second");
          } catch (const std::runtime_error&) {
            self->fiber.Pause();  // inside the handler
            try {
              throw;  // the one that this fiber caught
            } catch (const std::runtime_error& error) {
              self->step = std::string(error.what()) == "first" ? 10 : 20;
            }
          }
        },
        &one);
    counting[1].step = 1;
  }
  EXPECT_EQ(std::uncaught_exceptions(), 0);
  EXPECT_EQ(std::current_exception(), nullptr);
  counting[0].fiber.Resume();
  counting[1].fiber.Resume();
  EXPECT_EQ(counting[0].step, 10);
  EXPECT_EQ(counting[1].step, 20);
}

// Scopes of several stacks end in another order than they began in.
TEST(Fiber, TheCallUnderWayIsItsOwn) {
  Counting counting[2];
  const CallScope outer({"model", "outer", "Train"});
  for (Counting& one : counting) {
    one.fiber.Start(
        [](void* context) noexcept {
          auto* self = static_cast<Counting*>(context);
          self->step = call_site.name == nullptr ? 1 : 0;
          const CallScope scope({"", "a planner", "Plan"});
          self->fiber.Pause();
          self->step += std::string(call_site.name) == "a planner" ? 1 : 0;
        },
        &one);
    EXPECT_STREQ(call_site.name, "outer");
  }
  for (Counting& one : counting) {
    one.fiber.Resume();
    EXPECT_STREQ(call_site.name, "outer");
    EXPECT_EQ(one.step, 2);
  }
}

int Descend(int depth) {
  volatile char frame[1024];
  frame[0] = static_cast<char>(depth);
  return depth == 0 ? frame[0] : Descend(depth - 1) + frame[0] - static_cast<char>(depth);
}

void RunDeep(int depth) {
  struct Deep {
    Fiber fiber;
    int depth;
    int result;
  } deep{{}, depth, -1};
  deep.fiber.Start(
      [](void* context) noexcept {
        auto* self = static_cast<Deep*>(context);
        self->result = Descend(self->depth);
      },
      &deep);
  EXPECT_EQ(deep.result, 0);
}

TEST(FiberDeathTest, HasAStackAsLargeAsItSaysAndOneThatOverflowsEndsTheProcess) {
  RunDeep(static_cast<int>(Fiber::kStackBytes / 2 / 1100));
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_DEATH(RunDeep(static_cast<int>(Fiber::kStackBytes / 1024 + 100)), "");
}

}  // namespace
}  // namespace dreamsearch
