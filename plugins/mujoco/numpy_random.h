// numpy_random.h - the random numbers of numpy's RandomState.
//
// The suite draws its initial states from one, so that equal seeds give equal
// episodes here and there. Checked against numpy 1.24.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

namespace dreamsearch::mujoco {

// RandomState(seed): Mersenne twister, 53-bit uniforms from two outputs, normals
// by the polar method (Marsaglia and Bray 1964), which makes two at a time.
class NumpyRandom {
 public:
  explicit NumpyRandom(std::uint32_t seed) : bits_(seed) {}

  // Uniform in [0, 1).
  double Uniform() {
    const std::uint32_t high = static_cast<std::uint32_t>(bits_()) >> 5;
    const std::uint32_t low = static_cast<std::uint32_t>(bits_()) >> 6;
    return (high * 67108864.0 + low) / 9007199254740992.0;
  }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }

  // Standard normal. Uniform draws in between leave the kept value alone.
  double Normal() {
    if (has_kept_) {
      has_kept_ = false;
      return kept_;
    }
    double x1, x2, w;
    do {
      x1 = 2.0 * Uniform() - 1.0;
      x2 = 2.0 * Uniform() - 1.0;
      w = x1 * x1 + x2 * x2;
    } while (w >= 1.0 || w == 0.0);
    const double f = std::sqrt(-2.0 * std::log(w) / w);
    kept_ = f * x1;
    has_kept_ = true;
    return f * x2;
  }

 private:
  std::mt19937 bits_;
  double kept_ = 0;
  bool has_kept_ = false;
};

}  // namespace dreamsearch::mujoco
