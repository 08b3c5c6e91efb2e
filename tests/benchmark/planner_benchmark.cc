// planner_benchmark.cc - what the planners cost by themselves: a model that is as
// good as free, so that the time is the search's own.
//
//     tests/bin/planner_benchmark --benchmark_filter=mcts
//
// items_per_second counts simulations (trajectories for the shooting planners).
#include <benchmark/benchmark.h>

#include "dreamsearch/random.h"
#include "tests/plugins/planners/loaded_planner.h"

namespace dreamsearch {
namespace {

// One action, a latent of one cache line that is not even written, a reward that
// depends on the action so that the search has something to decide.
class FreeModel final : public LatentModel {
 public:
  std::uint64_t latent_bytes() const noexcept override { return kLatentAlignment; }
  std::uint64_t action_size() const noexcept override { return 1; }
  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    for (std::uint64_t i = 0; i < request.latents.rows; ++i) {
      const double a = request.actions(i, 0);
      result.rewards[i] = 1 - (a - 0.5) * (a - 0.5);
      result.discounts[i] = 0.99;
    }
    return OkStatus();
  }
  Status Value(ConstLatents latents, View<double> values) noexcept override {
    for (std::uint64_t i = 0; i < latents.rows; ++i) values[i] = 0;
    return OkStatus();
  }
  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override {
    for (std::uint64_t i = 0; i < latents.rows; ++i) actions(i, 0) = 0;
    return OkStatus();
  }
  Status ProposeSamples(ConstLatents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override {
    const std::uint64_t each = actions.rows / seeds.size;
    for (std::uint64_t i = 0; i < seeds.size; ++i) {
      Random random(seeds[i]);
      for (std::uint64_t j = 0; j < each; ++j) actions(i * each + j, 0) = random.Uniform(-1, 1);
    }
    return OkStatus();
  }
};

void PlanFree(benchmark::State& state, const ComponentDescriptor* component,
              const Settings& settings) {
  FreeModel model;
  LoadedPlanner planner(*component, &model, settings);
  alignas(kLatentAlignment) std::byte root[kLatentAlignment] = {};
  double action = 0;
  std::vector<double> metrics(component->metrics.size);
  PlanResult result;
  result.action = {&action, 1};
  result.metrics = {metrics.data(), metrics.size()};
  PlanRequest request;
  request.root = {root, 1, sizeof root};
  std::uint64_t simulations = 0;
  for (auto unused : state) {
    static_cast<void>(unused);
    ++request.seed;
    if (!planner->Plan(request, &result).ok()) {
      state.SkipWithError("Plan failed");
      break;
    }
    simulations += result.simulations;
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(simulations));
  state.counters["depth"] = result.depth;
}

void Register() {
  for (const ComponentDescriptor* component : AllPlanners()) {
    bool tree_search = false;
    for (const ParameterSpec& spec : component->parameters) {
      tree_search |= std::strcmp(spec.name, "leaf_batch") == 0;
    }
    const std::string name = std::string("free/") + component->name;
    if (!tree_search) {
      benchmark::RegisterBenchmark(name.c_str(), PlanFree, component, Settings{});
      continue;
    }
    for (const int simulations : {50, 200, 1000}) {
      benchmark::RegisterBenchmark((name + "/" + std::to_string(simulations)).c_str(), PlanFree,
                                   component, Settings{{"simulations", simulations}});
    }
    benchmark::RegisterBenchmark((name + "/200/leaf_batch:8").c_str(), PlanFree, component,
                                 Settings{{"simulations", 200}, {"leaf_batch", 8}});
  }
}

}  // namespace
}  // namespace dreamsearch

int main(int argc, char** argv) {
  dreamsearch::Register();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
