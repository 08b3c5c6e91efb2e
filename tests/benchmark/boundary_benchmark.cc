// boundary_benchmark.cc - what the host adds to a decision: seeds, locations for crash reports,
// guards, checks of what plugins answered.
//
//     tests/bin/boundary_benchmark
//
// Bare calls a model, an environment that do nothing and the planner `dreamer` directly; Host calls
// them as a run does, with an action repeat of 2. The difference is the boundary's.
#include <benchmark/benchmark.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "host/acting/agent.h"
#include "host/acting/components.h"
#include "host/acting/episode.h"
#include "host/plugins/plugin_loader.h"

namespace dreamsearch {
namespace {

// Sizes of walker_walk.
constexpr std::uint64_t kObservations = 24;
constexpr std::uint64_t kActions = 6;
constexpr std::uint64_t kLatent = 10 * kLatentAlignment;
constexpr std::uint64_t kRepeat = 2;

class IdleModel final : public Model {
 public:
  std::uint64_t latent_bytes() const noexcept override { return kLatent; }
  std::uint64_t action_size() const noexcept override { return kActions; }
  Status Imagine(const ImagineRequest&, const ImagineResult&) noexcept override {
    return OkStatus();
  }
  Status Value(ConstLatents latents, View<double> values) noexcept override {
    for (std::uint64_t i = 0; i < latents.rows; ++i) values[i] = 0;
    return OkStatus();
  }
  Status ProposeMode(ConstLatents, MatrixView<double> actions) noexcept override {
    for (std::uint64_t i = 0; i < actions.rows * actions.cols; ++i) actions.data[i] = 0;
    return OkStatus();
  }
  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t>,
                        MatrixView<double> actions) noexcept override {
    return ProposeMode(latents, actions);
  }
  Status InitialLatent(Latents) noexcept override { return OkStatus(); }
  Status Observe(const ObserveRequest&, Latents) noexcept override { return OkStatus(); }
  Status Train(const TrainRequest&, View<double>) noexcept override { return OkStatus(); }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override {}
};

class IdleEnvironment final : public Environment {
 public:
  IdleEnvironment() {
    spec_.observation_size = kObservations;
    spec_.action_size = kActions;
    spec_.action_low = {low_.data(), kActions};
    spec_.action_high = {high_.data(), kActions};
  }
  const EnvironmentSpec& spec() const noexcept override { return spec_; }
  Status Reset(std::uint32_t, View<double>) noexcept override { return OkStatus(); }
  Status Step(View<const double>, View<double> observation, StepResult* result) noexcept override {
    for (std::uint64_t i = 0; i < observation.size; ++i) observation[i] = 0;
    result->reward = 1;
    return OkStatus();
  }
  void Destroy() noexcept override {}

 private:
  const std::vector<double> low_ = std::vector<double>(kActions, -1.0);
  const std::vector<double> high_ = std::vector<double>(kActions, 1.0);
  EnvironmentSpec spec_;
};

const ComponentDescriptor& DreamerPlanner() {
  static const PluginDescriptor& plugin =
      LoadPlugin(std::string(DREAMSEARCH_TEST_PLUGIN_DIR) + "/planner_dreamer.so");
  return FindComponent(plugin, ComponentKind::kPlanner, "dreamer");
}

struct World {
  IdleModel model;
  IdleEnvironment environment;
  PlannerPtr planner;
  World() {
    std::vector<ParameterValue> values;
    for (const ParameterSpec& spec : DreamerPlanner().parameters) {
      values.push_back({spec.name, spec.default_number, spec.default_choice});
    }
    Planner* made = nullptr;
    const Status status = DreamerPlanner().create_planner(
        {{{values.data(), values.size()}}, kActions, kLatent}, &made);
    if (!status.ok()) throw std::runtime_error(status.message);
    planner.reset(made);
  }
  std::vector<double> observation = std::vector<double>(kObservations);
  View<double> observed() { return {observation.data(), observation.size()}; }
};

void Host(benchmark::State& state) {
  World world;
  Agent::Parts parts;
  parts.model = &world.model;
  parts.model_name = "idle";
  parts.planner = world.planner.get();
  parts.planner_text = "planner 'dreamer'";
  for (const MetricSpec& metric : DreamerPlanner().metrics) {
    parts.metrics.push_back(metric.name);
  }
  parts.environment = &world.environment;
  Agent agent(parts);
  agent.BeginEpisode(EpisodePurpose::kTraining, 0);
  std::uint64_t step = 0;
  for (auto unused : state) {
    static_cast<void>(unused);
    agent.Decide(world.observed(), true, step);
    step += HoldAction(&world.environment, "idle", agent.action(), kRepeat, world.observed()).steps;
  }
}
BENCHMARK(Host);

void Bare(benchmark::State& state) {
  World world;
  alignas(kLatentAlignment) std::byte latents[2][kLatent] = {};
  double action[kActions] = {};
  std::vector<double> metrics(DreamerPlanner().metrics.size);
  bool ok = world.planner->BeginEpisode(&world.model).ok();
  PlanResult result;
  result.action = {action, kActions};
  result.metrics = {metrics.data(), metrics.size()};
  PlanRequest request;
  request.explore = true;
  ObserveRequest observe;
  observe.seeds = {&request.seed, 1};
  for (auto unused : state) {
    static_cast<void>(unused);
    observe.previous = {latents[request.decision % 2], 1, kLatent};
    observe.actions = {action, 1, kActions};
    observe.observations = {world.observation.data(), 1, kObservations};
    const Latents next = {latents[1 - request.decision % 2], 1, kLatent};
    ok = ok && world.model.Observe(observe, next).ok();
    request.root = next;
    ++request.seed;
    ok = ok && world.planner->Plan(request, &result).ok();
    ++request.decision;
    StepResult step;
    for (std::uint64_t i = 0; i < kRepeat; ++i) {
      ok = ok && world.environment.Step({action, kActions}, world.observed(), &step).ok();
    }
    if (!ok) {
      state.SkipWithError("a call failed");
      break;
    }
  }
}
BENCHMARK(Bare);

}  // namespace
}  // namespace dreamsearch

BENCHMARK_MAIN();
