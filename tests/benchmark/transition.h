// transition.h - what planners ask of a model, timed.
#pragma once

#include <benchmark/benchmark.h>

#include <cstdint>
#include <vector>

#include "dreamsearch/model.h"
#include "dreamsearch/random.h"
#include "plugins/networks/matrix.h"
#include "tests/benchmark/laps.h"

namespace dreamsearch {

// Runs one transition with its value and one proposed action a latent, at state.range(0)
// latents; returns the seconds of an iteration.
inline double TimeTransitions(benchmark::State& state, Model* model) {
  const auto rows = static_cast<std::uint64_t>(state.range(0));
  const std::uint64_t bytes = model->latent_bytes(), size = model->action_size();
  networks::Buffer<float> memory;
  const auto floats = static_cast<networks::Index>(rows * bytes / sizeof(float));
  memory.Reserve(2 * floats);
  const Latents from{reinterpret_cast<std::byte*>(memory.data()), rows, bytes};
  const Latents to{reinterpret_cast<std::byte*>(memory.data() + floats), rows, bytes};
  std::vector<double> actions(rows * size, 0.1), rewards(rows), discounts(rows), values(rows);
  std::vector<std::uint64_t> row_seeds(rows);
  const View<const std::uint64_t> seeds{row_seeds.data(), rows};
  std::uint64_t seed = 0;
  const Lap lap;
  for (auto _ : state) {
    FillSeeds(++seed, {row_seeds.data(), rows});
    bool ok = model
                  ->Imagine({from, {actions.data(), rows, size}, seeds},
                            {to, {rewards.data(), rows}, {discounts.data(), rows}})
                  .ok();
    ok &= model->Value(to, {values.data(), rows}).ok();
    ok &= model->ProposeSamples(to, seeds, {actions.data(), rows, size}).ok();
    if (!ok) state.SkipWithError("a call failed");
  }
  return lap.Each(state);
}

}  // namespace dreamsearch
