// bootstrap.h - what every bootstrap of statistics.h draws with.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "results/statistics/statistics.h"

namespace dreamsearch::results {

// SplitMix64 (Steele, Lea, Flood 2014).
class Generator {
 public:
  explicit Generator(std::uint64_t seed) : state_(seed) {}

  // Uniform in {0, ..., n - 1}, by multiply and shift; n < 2^32.
  std::uint32_t Below(std::uint32_t n) {
    std::uint64_t x = state_ += 0x9e3779b97f4a7c15ull;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
    x ^= x >> 31;
    return static_cast<std::uint32_t>(((x >> 32) * n) >> 32);
  }

 private:
  std::uint64_t state_;
};

inline bool HasInterval(const Scores& scores) {
  return !scores.empty() && std::all_of(scores.begin(), scores.end(), [](const auto& runs) {
    return runs.size() >= kIntervalRuns;
  });
}

// Of 95 %. Reorders the values.
inline Interval PercentileInterval(std::vector<double>* values) {
  const double lo = Quantile(values, 0.025);
  return {lo, Quantile(values, 0.975)};
}

}  // namespace dreamsearch::results
