// tolerance.h - the suite's soft indicator function.
//
// A Tolerance is 1 inside [low, high] and falls to 0 outside, in a shape and
// over a margin of one's choice (Tassa et al. 2018, "DeepMind Control Suite").
#pragma once

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace dreamsearch::mujoco {

enum class Falloff {
  kGaussian,
  kHyperbolic,
  kLongTail,
  kReciprocal,
  kCosine,
  kLinear,
  kQuadratic,
  kTanhSquared
};

class Tolerance {
 public:
  // `value` is what the function takes one margin outside the bounds; with
  // margin 0 it is 0 everywhere outside. high may be infinite.
  //   std::invalid_argument  low > high, margin < 0, or value not in (0, 1), where
  //                          0 too is allowed for cosine, linear and quadratic.
  Tolerance(double low, double high, double margin = 0, Falloff falloff = Falloff::kGaussian,
            double value = 0.1)
      : low_(low), high_(high), margin_(margin), falloff_(falloff) {
    if (!(low <= high)) throw std::invalid_argument("tolerance: low must not exceed high");
    if (!(margin >= 0)) throw std::invalid_argument("tolerance: margin must not be negative");
    const bool zero_allowed = falloff == Falloff::kCosine || falloff == Falloff::kLinear ||
                              falloff == Falloff::kQuadratic;
    if (!((zero_allowed ? value >= 0 : value > 0) && value < 1)) {
      throw std::invalid_argument("tolerance: value at the margin must be in (0, 1)");
    }
    switch (falloff) {
      case Falloff::kGaussian:
        scale_ = std::sqrt(-2 * std::log(value));
        break;
      case Falloff::kHyperbolic:
        scale_ = std::acosh(1 / value);
        break;
      case Falloff::kLongTail:
        scale_ = std::sqrt(1 / value - 1);
        break;
      case Falloff::kReciprocal:
        scale_ = 1 / value - 1;
        break;
      case Falloff::kCosine:
        scale_ = std::acos(2 * value - 1) / std::numbers::pi;
        break;
      case Falloff::kLinear:
        scale_ = 1 - value;
        break;
      case Falloff::kQuadratic:
        scale_ = std::sqrt(1 - value);
        break;
      case Falloff::kTanhSquared:
        scale_ = std::atanh(std::sqrt(1 - value));
        break;
    }
  }

  double operator()(double x) const noexcept {
    if (low_ <= x && x <= high_) return 1;
    if (margin_ == 0) return 0;
    const double s = (x < low_ ? low_ - x : x - high_) / margin_ * scale_;
    switch (falloff_) {
      case Falloff::kGaussian: {
        const double exponent = -0.5 * (s * s);
        // exp is 0 from here on too, but slow to find out.
        return exponent < -745.2 ? 0 : std::exp(exponent);
      }
      case Falloff::kHyperbolic:
        return 1 / std::cosh(s);
      case Falloff::kLongTail:
        return 1 / (s * s + 1);
      case Falloff::kReciprocal:
        return 1 / (std::abs(s) + 1);
      case Falloff::kCosine:
        return std::abs(s) < 1 ? (1 + std::cos(std::numbers::pi * s)) / 2 : 0;
      case Falloff::kLinear:
        return std::abs(s) < 1 ? 1 - s : 0;
      case Falloff::kQuadratic:
        return std::abs(s) < 1 ? 1 - s * s : 0;
      case Falloff::kTanhSquared: {
        const double t = std::tanh(s);
        return 1 - t * t;
      }
    }
    return 0;
  }

 private:
  double low_;
  double high_;
  double margin_;
  double scale_ = 0;
  Falloff falloff_;
};

}  // namespace dreamsearch::mujoco
