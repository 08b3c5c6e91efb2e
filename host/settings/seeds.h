// seeds.h - where every random number of a run comes from.
//
// Each call that draws gets a seed hashed from the run's seed and from what the
// call is for, so that no draw depends on what else was drawn, and a run stopped
// anywhere goes on with the very numbers it would have used.
#pragma once

#include <cstdint>

#include "dreamsearch/random.h"

namespace dreamsearch {

// What a seed is for. The numbers are part of every result: never reorder them.
enum class SeedUse : std::uint64_t {
  kEnvironment = 1,   // Environment::Reset of an episode
  kParameters = 2,    // a model's initial parameters
  kRandomAction = 3,  // the uniform actions of the prefill
  kObserve = 4,       // Model::Observe of a decision
  kPlan = 5,          // Planner::Plan of a decision
  kReplay = 6,        // which sequences an update trains on
  kTrain = 7,         // the draws inside an update
  kReanalyse = 8,     // which states an update plans anew, and what that draws
  kHold = 9,          // at which decisions exploration draws anew
};

enum class EpisodePurpose : std::uint64_t { kTraining = 0, kEvaluation = 1 };

// The seed of one call. Evaluation episode i has the same seeds at every
// evaluation and under every planner: `episode` counts within the evaluation.
constexpr std::uint64_t SeedFor(std::uint64_t run_seed, SeedUse use, EpisodePurpose phase,
                                std::uint64_t episode, std::uint64_t decision) noexcept {
  std::uint64_t seed = DeriveSeed(run_seed, static_cast<std::uint64_t>(use));
  seed = DeriveSeed(seed, static_cast<std::uint64_t>(phase));
  seed = DeriveSeed(seed, episode);
  return DeriveSeed(seed, decision);
}

// The decision whose draws a decision of exploration has, itself or an earlier one of the episode:
// each after the first draws anew with probability 1 / hold, so that the same draws serve `hold`
// decisions on average.
constexpr std::uint64_t HeldDecision(std::uint64_t run_seed, EpisodePurpose phase,
                                     std::uint64_t episode, std::uint64_t decision,
                                     std::uint64_t hold) noexcept {
  if (hold <= 1) return decision;
  const auto draws_anew = [&](std::uint64_t at) {
    Random random(SeedFor(run_seed, SeedUse::kHold, phase, episode, at));
    return random.Uniform() * static_cast<double>(hold) < 1;
  };
  while (decision > 0 && !draws_anew(decision)) --decision;
  return decision;
}

}  // namespace dreamsearch
