#include "plugins/networks/noise.h"

#include <Eigen/Core>
#include <algorithm>
#include <numbers>

#include "dreamsearch/random.h"

namespace dreamsearch::networks {
namespace {

constexpr Index kPairs = 64;  // a block, small enough for the first-level cache

using Lane = Eigen::Array<float, kPairs, 1>;

}  // namespace

void FillNormal(std::uint64_t seed, float* draws, Index count) {
  Lane u, v, radius, even, odd;
  for (Index first = 0; first < count; first += 2 * kPairs) {
    const std::uint64_t base = seed + static_cast<std::uint64_t>(first / 2) * kGoldenGamma;
    for (Index i = 0; i < kPairs; ++i) {
      const std::uint64_t bits = MixBits(base + static_cast<std::uint64_t>(i + 1) * kGoldenGamma);
      // As signed 32-bit integers, which every vector unit converts.
      const auto high = static_cast<std::int32_t>(bits >> 40);
      const auto low = static_cast<std::int32_t>(bits);
      u[i] = static_cast<float>(high + 1) * 0x1.0p-24f;  // (0, 1], exact
      v[i] = static_cast<float>(low) * static_cast<float>(std::numbers::pi * 0x1.0p-31);
    }
    radius = (-2.0f * u.log()).sqrt();
    even = radius * v.cos();
    odd = radius * v.sin();
    const Index left = std::min(2 * kPairs, count - first);
    for (Index i = 0; i < left; ++i) draws[first + i] = i % 2 == 0 ? even[i / 2] : odd[i / 2];
  }
}

void FillNormal(std::uint64_t seed, double* draws, Index count) {
  float block[2 * kPairs];
  for (Index first = 0; first < count; first += 2 * kPairs) {
    const Index left = std::min(2 * kPairs, count - first);
    // The same numbers as in single precision.
    FillNormal(seed + static_cast<std::uint64_t>(first / 2) * kGoldenGamma, block, left);
    for (Index i = 0; i < left; ++i) draws[first + i] = block[i];
  }
}

}  // namespace dreamsearch::networks
