// Time of an update of the model tdmpc, and of what planners ask, for both presets on a task of
// walker's size (24 observations, 6 actions). What is counted stands in laps.h.
//
//   model_tdmpc_benchmark --benchmark_filter=Update
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "plugins/model_tdmpc/tdmpc.h"
#include "tests/benchmark/laps.h"
#include "tests/benchmark/transition.h"
#include "tests/plugins/networks/batches.h"
#include "tests/plugins/owned.h"

namespace dreamsearch::tdmpc {
namespace {

constexpr Index kObservations = 24;
constexpr Index kActions = 6;
constexpr Index kSequences = 256;
constexpr Index kLength = 4;

// Multiply-adds of one column through each network.
struct Work {
  explicit Work(const Settings& s) {
    const auto d = [](Index x) { return static_cast<double>(x); };
    const double u = d(s.width), l = d(s.latent), bins = d(s.bins.count);
    const double hidden = u * u * (d(s.layers) - 1);
    const double in = (l + kActions) * u + hidden;
    encoder = kObservations * d(s.encoder_width) +
              d(s.encoder_width) * d(s.encoder_width) * (d(s.encoder_layers) - 1) +
              d(s.encoder_width) * l;
    dynamics = in + u * l;
    reward = critic = in + u * bins;
    actor = l * u + hidden + u * 2 * kActions;
    critics = d(s.critics);
  }
  // Forward, gradient of the input and of the weights: three times forward.
  double update() const {
    const double b = kSequences, steps = kLength - 1;
    const double model =
        b * (steps + 3) * encoder + 3 * b * steps * (dynamics + reward + critics * critic);
    const double targets = b * steps * (actor + std::min(critics, 2.0) * critic);
    return model + targets + b * (steps + 1) * (3 * actor + 2 * critics * critic);
  }
  double encoder, dynamics, reward, critic, actor, critics;
};

void Update(benchmark::State& state, const char* preset, bool bfloat16 = false, Index threads = 1) {
  Settings settings = PresetSettings(preset);
  settings.bfloat16 = bfloat16;
  Learner<float> learner(settings, kObservations, kActions, 1);
  learner.SetThreads(threads);
  OwnedBatch batch = RandomBatch(kSequences, kLength, kObservations, kActions, 3);
  std::fill(batch.discounts.begin(), batch.discounts.end(), 1.0f);
  UpdateLosses losses{};
  std::uint64_t update = 0;
  const Lap lap(threads == 1 ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC);
  for (auto _ : state) {
    const SequenceBatch view = batch.view();
    const Status status = learner.Update({&view, update, update, 0}, &losses);
    if (!status.ok()) state.SkipWithError(status.message);
    ++update;
  }
  Report(state, 2 * Work(settings).update(), lap.Each(state));
}
BENCHMARK_CAPTURE(Update, fast, "fast")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Update, fast_2_threads, "fast", false, 2)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(Update, fast_bfloat16, "fast", true)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Update, paper, "paper")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Update, paper_bfloat16, "paper", true)->Unit(benchmark::kMillisecond);

void Transition(benchmark::State& state, const char* preset) {
  const Settings settings = PresetSettings(preset);
  const Owned<Model> model(new Tdmpc(settings, kObservations, kActions, 1));
  const double seconds = TimeTransitions(state, model.get());
  const Work work(settings);
  const double each = work.dynamics + work.reward + work.critics * work.critic + 2 * work.actor;
  Report(state, 2 * static_cast<double>(state.range(0)) * each, seconds);
}
BENCHMARK_CAPTURE(Transition, fast, "fast")
    ->Arg(1)
    ->Arg(64)
    ->Arg(512)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(Transition, paper, "paper")
    ->Arg(1)
    ->Arg(64)
    ->Arg(512)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace dreamsearch::tdmpc

int main(int argc, char** argv) { return dreamsearch::RunBenchmarks(argc, argv); }
