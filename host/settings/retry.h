// retry.h - where `--retry` gives a run other seeds, so that it does not diverge at the same step.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "dreamsearch/random.h"

namespace dreamsearch {

// A retry of a diverged run, kept in its run.json. Training episodes from `episode` on have seeds
// into which `number` is mixed. A checkpoint in the middle of an episode is before that: of its
// episode the decisions from `env_step` on have such seeds.
struct Retry {
  std::uint64_t number = 0;  // 1 is the first
  std::uint64_t episode = 0;
  std::uint64_t env_step = std::numeric_limits<std::uint64_t>::max();

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("number", &number);
    (*archive)("episode", &episode);
    (*archive)("env_step", &env_step);
  }
};

// What stands for the run's seed in a training episode: at the decision that is made at an
// environment step, or, without one, at the episode's reset.
inline std::uint64_t SeedWithRetries(std::uint64_t run_seed, const std::vector<Retry>& retries,
                                     std::uint64_t episode,
                                     std::optional<std::uint64_t> env_step) noexcept {
  constexpr std::uint64_t kRetryStream = 0x7265747279;  // no SeedUse
  std::uint64_t number = 0;
  for (const Retry& retry : retries) {
    const bool within = episode + 1 == retry.episode && env_step && *env_step >= retry.env_step;
    if (episode >= retry.episode || within) number = retry.number;
  }
  return number == 0 ? run_seed : DeriveSeed(DeriveSeed(run_seed, kRetryStream), number);
}

}  // namespace dreamsearch
