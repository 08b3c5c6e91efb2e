#include "plugins/networks/noise.h"

#include <algorithm>
#include <numbers>

#include "dreamsearch/random.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "plugins/networks/noise.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "plugins/networks/dispatch.h"
#include "plugins/networks/vector-inl.h"

#ifndef DREAMSEARCH_NETWORKS_NOISE_KERNEL
#define DREAMSEARCH_NETWORKS_NOISE_KERNEL
namespace dreamsearch::networks {

constexpr Index kPairs = 64;  // a block, small enough for the first-level cache

// even, odd = sqrt(-2 ln u) (cos, sin)(v) for `pairs` of them; all [kPairs], aligned.
using PolarKernel = void (*)(const float* u, const float* v, Index pairs, float* even, float* odd);

}  // namespace dreamsearch::networks
#endif

HWY_BEFORE_NAMESPACE();
namespace dreamsearch::networks {
namespace HWY_NAMESPACE {

void Polar(const float* u, const float* v, Index pairs, float* even, float* odd) {
  const Tag<float> d;
  for (Index i = 0; i < pairs; i += static_cast<Index>(HWY_LANES(float))) {
    const auto log = hn::Log(d, hn::Load(d, u + i));
    const auto radius = hn::Sqrt(hn::Mul(hn::Set(d, -2.0f), log));
    const auto angle = hn::Load(d, v + i);
    hn::Store(hn::Mul(radius, hn::Cos(d, angle)), d, even + i);
    hn::Store(hn::Mul(radius, hn::Sin(d, angle)), d, odd + i);
  }
}
PolarKernel PolarOf() { return &Polar; }

}  // namespace HWY_NAMESPACE
}  // namespace dreamsearch::networks
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dreamsearch::networks {

void FillNormal(std::uint64_t seed, float* draws, Index count) {
  static const PolarKernel polar = DREAMSEARCH_CHOOSE(PolarOf);
  alignas(64) float u[kPairs] = {}, v[kPairs] = {}, even[kPairs], odd[kPairs];
  for (Index first = 0; first < count; first += 2 * kPairs) {
    const Index left = std::min(2 * kPairs, count - first);
    const Index pairs = (left + 1) / 2;
    const std::uint64_t base = seed + static_cast<std::uint64_t>(first / 2) * kGoldenGamma;
    for (Index i = 0; i < pairs; ++i) {
      const std::uint64_t bits = MixBits(base + static_cast<std::uint64_t>(i + 1) * kGoldenGamma);
      // As signed 32-bit integers, which every vector unit converts.
      const auto high = static_cast<std::int32_t>(bits >> 40);
      const auto low = static_cast<std::int32_t>(bits);
      u[i] = static_cast<float>(high + 1) * 0x1.0p-24f;  // (0, 1], exact
      v[i] = static_cast<float>(low) * static_cast<float>(std::numbers::pi * 0x1.0p-31);
    }
    polar(u, v, pairs, even, odd);
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
#endif  // HWY_ONCE
