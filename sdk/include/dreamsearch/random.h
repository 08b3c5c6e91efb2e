// random.h - the random numbers of dreamsearch.
//
// Every call that draws is given a 64-bit seed and makes its generator from it,
// so no generator state hides in a component: equal seeds give equal draws,
// whatever ran before. The standard library's distributions differ between
// implementations; these do not.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "dreamsearch/view.h"

namespace dreamsearch {

// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): a bijection on 64 bits
// in which every input bit reaches every output bit.
constexpr std::uint64_t MixBits(std::uint64_t x) noexcept {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

inline constexpr std::uint64_t kGoldenGamma = 0x9e3779b97f4a7c15ull;

// A new seed from a seed and a stream number; chains to hash several numbers.
constexpr std::uint64_t DeriveSeed(std::uint64_t seed, std::uint64_t stream) noexcept {
  return MixBits(MixBits(seed + kGoldenGamma) ^ (stream * 0xd1342543de82ef95ull + kGoldenGamma));
}

// A seed for each row of a request from one: row i gets DeriveSeed(seed, i).
constexpr void FillSeeds(std::uint64_t seed, View<std::uint64_t> seeds) noexcept {
  for (std::uint64_t i = 0; i < seeds.size; ++i) seeds[i] = DeriveSeed(seed, i);
}

// SplitMix64. Counter-based: draw i is MixBits(seed + (i + 1) * kGoldenGamma),
// so that a vectorised kernel can make the same numbers in any order.
class Random {
 public:
  explicit constexpr Random(std::uint64_t seed) noexcept : state_(seed) {}

  constexpr std::uint64_t Next() noexcept { return MixBits(state_ += kGoldenGamma); }

  // Uniform in [0, 1), 53 bits.
  constexpr double Uniform() noexcept { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }
  constexpr double Uniform(double low, double high) noexcept {
    return low + (high - low) * Uniform();
  }

  // Uniform in {0, ..., n - 1}, n > 0 (Lemire's multiply-shift; the bias is
  // below n / 2^64).
  constexpr std::uint64_t Below(std::uint64_t n) noexcept {
    __extension__ using Wide = unsigned __int128;
    return static_cast<std::uint64_t>((static_cast<Wide>(Next()) * n) >> 64);
  }

  // Standard normal (Box and Muller 1958), two uniforms a draw, nothing kept.
  double Normal() noexcept {
    const double u = 1.0 - Uniform();  // (0, 1]
    const double v = Uniform();
    return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
  }

 private:
  std::uint64_t state_;
};

}  // namespace dreamsearch
