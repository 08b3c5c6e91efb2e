// Time of an update of the model dreamer and of its parts, and of what planners ask,
// for both presets on a task of walker's size (24 observations, 6 actions).
//
//   model_dreamer_benchmark --benchmark_filter=Update
// What is counted stands in laps.h.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "plugins/model_dreamer/dreamer.h"
#include "tests/benchmark/laps.h"
#include "tests/benchmark/transition.h"
#include "tests/plugins/networks/batches.h"
#include "tests/plugins/owned.h"

namespace dreamsearch::dreamer {
namespace {

constexpr Index kObservations = 24;
constexpr Index kActions = 6;

// Multiply-adds of one column through each network.
struct Work {
  explicit Work(const Settings& s) {
    const double u = static_cast<double>(s.hidden), d = static_cast<double>(s.deterministic);
    const double z = static_cast<double>(s.stochastic), o = kObservations, a = kActions;
    const auto mlp = [&](double in, Index layers, double out) {
      return in * u + u * u * static_cast<double>(layers - 1) + u * out;
    };
    encoder = o * u + u * u * static_cast<double>(s.encoder_layers - 1);
    dynamics = (z + a) * u + 3 * d * (u + d) + d * u + u * 2 * z;
    posterior = (d + u) * u + u * 2 * z;
    decoder = mlp(z + d, s.decoder_layers, o);
    reward = mlp(z + d, s.reward_layers, 1);
    actor = mlp(z + d, s.actor_layers, 2 * a);
    value = mlp(z + d, s.value_layers, 1);
    slow = s.slow_critic_weight > 0 ? value : 0;
  }
  // Forward, gradient of the input and of the weights.
  double fit() const { return 3 * (encoder + dynamics + posterior + decoder + reward); }
  // Forward; back to the actions and into the actor; the value's own regression.
  double dream() const {
    return (dynamics + reward + value + actor) + (dynamics + reward + value + 2 * actor) +
           2 * value + slow;
  }
  double encoder, dynamics, posterior, decoder, reward, actor, value, slow;
};

struct Setup {
  explicit Setup(const std::string& preset, const char* precision)
      : settings(PresetSettings(preset.c_str())),
        batch(preset == "paper" ? RandomBatch(50, 50, kObservations, kActions, 3)
                                : RandomBatch(16, 32, kObservations, kActions, 3)) {
    settings.bfloat16 = std::string(precision) == "bfloat16";
    settings.bfloat16_planning = settings.bfloat16;
    std::fill(batch.discounts.begin(), batch.discounts.end(), 1.0f);
    columns = static_cast<double>(batch.sequences * batch.length);
    const double eligible =
        columns - static_cast<double>(settings.start_skip) * static_cast<double>(batch.sequences);
    starts = settings.imagination_starts == 0
                 ? eligible
                 : std::min(eligible, static_cast<double>(settings.imagination_starts));
  }
  double fit_flops() const { return 2 * Work(settings).fit() * columns; }
  double dream_flops() const {
    return 2 * Work(settings).dream() * starts * static_cast<double>(settings.horizon);
  }
  Settings settings;
  OwnedBatch batch;
  double columns = 0;
  double starts = 0;
};

void Update(benchmark::State& state, const char* preset, const char* precision, Index threads = 1) {
  const Setup setup(preset, precision);
  Learner<float> learner(setup.settings, kObservations, kActions, 1);
  learner.SetThreads(threads);
  UpdateLosses losses;
  std::uint64_t update = 0;
  const Lap lap(threads == 1 ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC);
  for (auto _ : state) {
    const SequenceBatch batch = setup.batch.view();
    const Status status = learner.Update({&batch, update, update, 0}, &losses);
    if (!status.ok()) state.SkipWithError(status.message);
    ++update;
  }
  Report(state, setup.fit_flops() + setup.dream_flops(), lap.Each(state));
}
BENCHMARK_CAPTURE(Update, fast_bfloat16, "fast", "bfloat16")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Update, fast_bfloat16_2_threads, "fast", "bfloat16", 2)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(Update, fast_float, "fast", "float")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Update, paper_bfloat16, "paper", "bfloat16")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Update, paper_bfloat16_2_threads, "paper", "bfloat16", 2)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(Update, paper_float, "paper", "float")->Unit(benchmark::kMillisecond);

// The parts of an update, in order: reading and drawing, the world model's fit, the
// dream, the step of the three groups. Milliseconds of each; operations, rate and share
// of the two that are products.
void Parts(benchmark::State& state, const char* preset, const char* precision) {
  const Setup setup(preset, precision);
  Learner<float> learner(setup.settings, kObservations, kActions, 1);
  UpdateLosses losses;
  std::uint64_t update = 0;
  double seconds[4] = {};
  double begin = 0;
  const auto lap = [&](int part) {
    const double now = Now();
    seconds[part] += now - begin;
    begin = now;
  };
  for (auto _ : state) {
    begin = Now();
    const Status status = learner.Read(setup.batch.view(), update++);
    if (!status.ok()) state.SkipWithError(status.message);
    lap(0);
    learner.FitGradients(&losses);
    lap(1);
    learner.DreamGradients(&losses);
    lap(2);
    learner.Apply(losses);
    lap(3);
  }
  const double each = 1.0 / static_cast<double>(update);
  const char* const names[] = {"read_ms", "fit_ms", "dream_ms", "apply_ms"};
  for (int part = 0; part < 4; ++part) state.counters[names[part]] = 1e3 * seconds[part] * each;
  Report(state, setup.fit_flops(), seconds[1] * each, "fit_");
  Report(state, setup.dream_flops(), seconds[2] * each, "dream_");
}
BENCHMARK_CAPTURE(Parts, fast_bfloat16, "fast", "bfloat16")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Parts, fast_float, "fast", "float")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Parts, paper_bfloat16, "paper", "bfloat16")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Parts, paper_float, "paper", "float")->Unit(benchmark::kMillisecond);

void Transition(benchmark::State& state, const char* preset, const char* precision) {
  const Setup setup(preset, precision);
  const Owned<Model> model(new Dreamer(setup.settings, kObservations, kActions, 1));
  const double seconds = TimeTransitions(state, model.get());
  const Work work(setup.settings);
  Report(state,
         2 * static_cast<double>(state.range(0)) *
             (work.dynamics + work.reward + work.value + work.actor),
         seconds);
}
// One leaf, the trees of an evaluation or of a batch of leaves, a node's children, candidates.
void RowsOfARequest(benchmark::internal::Benchmark* transition) {
  for (const int rows : {1, 5, 8, 20, 150}) transition->Arg(rows);
  transition->Unit(benchmark::kMicrosecond);
}
BENCHMARK_CAPTURE(Transition, fast_bfloat16, "fast", "bfloat16")->Apply(RowsOfARequest);
BENCHMARK_CAPTURE(Transition, fast_float, "fast", "float")->Apply(RowsOfARequest);
BENCHMARK_CAPTURE(Transition, paper_bfloat16, "paper", "bfloat16")->Apply(RowsOfARequest);
BENCHMARK_CAPTURE(Transition, paper_float, "paper", "float")->Apply(RowsOfARequest);

}  // namespace
}  // namespace dreamsearch::dreamer

int main(int argc, char** argv) { return dreamsearch::RunBenchmarks(argc, argv); }
