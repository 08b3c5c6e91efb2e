// coloured_noise.h - normal noise whose power falls with frequency f as 1 / f^beta.
//
// A sequence of H values is a random Fourier series (Timmer, Koenig 1995): independent normal
// amplitudes for frequency k / H, k = 0 to H / 2, with deviations k^(-beta / 2); the constant
// term has that of k = 1. Every value has mean 0 and variance 1; beta = 0 is white noise, 1 pink,
// 2 that of a random walk.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "dreamsearch/random.h"
#include "dreamsearch/view.h"

namespace dreamsearch {

class ColouredNoise {
 public:
  ColouredNoise(std::uint64_t horizon, double beta)
      : horizon_(horizon), factors_(horizon * horizon), normals_(horizon) {
    const auto deviation = [&](std::uint64_t k) {
      return std::pow(static_cast<double>(std::max<std::uint64_t>(k, 1)), -beta / 2);
    };
    // The series has one term of frequency 0, one of 1/2 if H is even, and else two.
    double variance = 0;
    for (std::uint64_t i = 0; i < horizon; ++i) {
      const std::uint64_t k = (i + 1) / 2;
      const bool single = k == 0 || 2 * k == horizon;
      const double amplitude = (single ? std::sqrt(0.5) : 1) * deviation(k);
      for (std::uint64_t t = 0; t < horizon; ++t) {
        const double angle =
            2 * M_PI * static_cast<double>(k * t % horizon) / static_cast<double>(horizon);
        const bool sine = i % 2 == 0 && !single;
        factors_[t * horizon + i] = amplitude * (sine ? std::sin(angle) : std::cos(angle));
      }
      variance += factors_[i] * factors_[i];  // of the first value, and so of every value
    }
    for (double& factor : factors_) factor /= std::sqrt(variance);
  }

  // Fills `noise`. [H]
  void Draw(Random* random, View<double> noise) noexcept {
    for (double& normal : normals_) normal = random->Normal();
    for (std::uint64_t t = 0; t < horizon_; ++t) {
      noise[t] = 0;
      for (std::uint64_t i = 0; i < horizon_; ++i) noise[t] += factor(t, i) * normals_[i];
    }
  }

  // Value t is the sum over i of factor(t, i) times the i-th normal draw.
  double factor(std::uint64_t t, std::uint64_t i) const noexcept {
    return factors_[t * horizon_ + i];
  }

 private:
  const std::uint64_t horizon_;  // H
  std::vector<double> factors_;  // [H, H]
  std::vector<double> normals_;  // [H]
};

}  // namespace dreamsearch
