#include "plugins/networks/categorical.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "plugins/networks/categorical.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "plugins/networks/dispatch.h"
#include "plugins/networks/vector-inl.h"

#ifndef DREAMSEARCH_NETWORKS_CATEGORICAL_KERNELS
#define DREAMSEARCH_NETWORKS_CATEGORICAL_KERNELS

// Every function of categorical.h; see dispatch.h.
#define DREAMSEARCH_CATEGORICAL(KERNEL)                                                            \
  KERNEL(void, SimNorm, (Mat<T> x), (x))                                                           \
  KERNEL(void, SimNormBackward, (In<T> y, Mat<T> d), (y, d))                                       \
  KERNEL(double, TwoHotError,                                                                      \
         (In<T> logits, In<T> targets, In<T> weights, const Bins& bins, Mat<T> d),                 \
         (logits, targets, weights, bins, d))                                                      \
  KERNEL(void, TwoHotValue, (In<T> logits, const Bins& bins, Mat<T> probabilities, Mat<T> values), \
         (logits, bins, probabilities, values))                                                    \
  KERNEL(void, TwoHotValueBackward,                                                                \
         (In<T> probabilities, In<T> values, In<T> d_values, const Bins& bins, Mat<T> d),          \
         (probabilities, values, d_values, bins, d))

namespace dreamsearch::networks {

DREAMSEARCH_KERNEL_TABLE(CategoricalKernels, DREAMSEARCH_CATEGORICAL)

}  // namespace dreamsearch::networks
#endif

HWY_BEFORE_NAMESPACE();
namespace dreamsearch::networks {
namespace HWY_NAMESPACE {
namespace {

template <typename T>
constexpr Index kLanes = static_cast<Index>(HWY_LANES(T));

// out = exp(x - largest); the largest of x is returned. A NaN is never the largest, and
// stays one in `out`.
template <typename T>
HWY_INLINE T Exponentials(const T* x, Index rows, T* out) {
  const Tag<T> d;
  T largest = x[0];
  if (rows >= kLanes<T>) {
    auto most = hn::LoadU(d, x);
    for (Index i = 0; i + kLanes<T> <= rows; i += kLanes<T>)
      most = hn::Max(hn::LoadU(d, x + i), most);
    largest = hn::GetLane(hn::MaxOfLanes(d, most));
  }
  for (Index i = rows / kLanes<T> * kLanes<T>; i < rows; ++i) largest = std::max(largest, x[i]);
  const Vector<T> shift = hn::Set(d, largest);
  for (Index i = 0; i < rows; i += kLanes<T>) {
    StoreUpTo(Exp(hn::Sub(LoadUpTo(d, x + i, rows - i), shift)), d, out + i, rows - i);
  }
  return largest;
}

// The sum of values[i], and that of values[i] * i: over whole registers, then the rest.
template <typename T>
HWY_INLINE T SumOfRows(const T* values, Index rows) {
  const Tag<T> d;
  Vector<T> sum = Constant<T>(0);
  for (Index i = 0; i < rows; i += kLanes<T>) {
    sum = hn::Add(sum, LoadUpTo(d, values + i, rows - i));
  }
  return SumOf<T>(sum);
}
template <typename T>
HWY_INLINE T SumOfPlaces(const T* values, Index rows) {
  const Tag<T> d;
  Vector<T> sum = Constant<T>(0);
  for (Index i = 0; i < rows; i += kLanes<T>) {
    const Vector<T> place = hn::Iota(d, static_cast<T>(i));
    sum = hn::MulAdd(place, LoadUpTo(d, values + i, rows - i), sum);
  }
  return SumOf<T>(sum);
}

// out = factor * x.
template <typename T>
HWY_INLINE void Scale(const T* x, T factor, Index rows, T* out) {
  const Tag<T> d;
  const Vector<T> f = hn::Set(d, factor);
  for (Index i = 0; i < rows; i += kLanes<T>) {
    StoreUpTo(hn::Mul(f, LoadUpTo(d, x + i, rows - i)), d, out + i, rows - i);
  }
}

template <typename T>
void SimNorm(Mat<T> x) {
  const Tag<T> d;
  for (Index j = 0; j < x.cols; ++j) {
    T* column = x.col(j);
    for (Index i = 0; i < x.rows; i += kSimplex) {
      T largest = column[i];
      for (Index k = 1; k < kSimplex; ++k) {
        largest = column[i + k] > largest ? column[i + k] : largest;
      }
      for (Index k = 0; k < kSimplex; ++k) column[i + k] -= largest;
    }
    for (Index i = 0; i < x.rows; i += kLanes<T>) {
      StoreUpTo(Exp(LoadUpTo(d, column + i, x.rows - i)), d, column + i, x.rows - i);
    }
    for (Index i = 0; i < x.rows; i += kSimplex) {
      T sum = 0;
      for (Index k = 0; k < kSimplex; ++k) sum += column[i + k];
      const T inverse = T(1) / sum;
      for (Index k = 0; k < kSimplex; ++k) column[i + k] *= inverse;
    }
  }
}

template <typename T>
void SimNormBackward(In<T> y, Mat<T> d) {
  for (Index j = 0; j < d.cols; ++j) {
    T* gradient = d.col(j);
    const T* output = y.col(j);
    for (Index i = 0; i < d.rows; i += kSimplex) {
      T along = 0;
      for (Index k = 0; k < kSimplex; ++k) along += output[i + k] * gradient[i + k];
      for (Index k = 0; k < kSimplex; ++k) {
        gradient[i + k] = output[i + k] * (gradient[i + k] - along);
      }
    }
  }
}

template <typename T>
double TwoHotError(In<T> logits, In<T> targets, In<T> weights, const Bins& bins, Mat<T> d) {
  double total = 0;
  for (Index j = 0; j < logits.cols; ++j) {
    T* gradient = d.col(j);
    const T* column = logits.col(j);
    const T weight = weights(0, j);
    const double target = static_cast<double>(targets(0, j));
    if (!std::isfinite(target)) {
      total += target - target;  // NaN
      std::fill(gradient, gradient + d.rows, static_cast<T>(target - target));
      continue;
    }
    const double place =
        (std::clamp(std::copysign(std::log1p(std::abs(target)), target), bins.low, bins.high) -
         bins.low) /
        bins.step();
    const Index below = std::min(static_cast<Index>(place), bins.count - 2);
    const double above = place - static_cast<double>(below);
    const double expected = (1 - above) * static_cast<double>(column[below]) +
                            above * static_cast<double>(column[below + 1]);
    const T largest = Exponentials(column, d.rows, gradient);
    const T sum = SumOfRows(gradient, d.rows);
    Scale(gradient, weight / sum, d.rows, gradient);
    const double log_sum = static_cast<double>(largest) + std::log(static_cast<double>(sum));
    total += static_cast<double>(weight) * (log_sum - expected);
    gradient[below] -= weight * static_cast<T>(1 - above);
    gradient[below + 1] -= weight * static_cast<T>(above);
  }
  return total;
}

template <typename T>
void TwoHotValue(In<T> logits, const Bins& bins, Mat<T> probabilities, Mat<T> values) {
  for (Index j = 0; j < logits.cols; ++j) {
    T* column = probabilities.col(j);
    Exponentials(logits.col(j), logits.rows, column);
    Scale(column, T(1) / SumOfRows(column, logits.rows), logits.rows, column);
    const double mean =
        bins.low + bins.step() * static_cast<double>(SumOfPlaces(column, logits.rows));
    values(0, j) = static_cast<T>(std::copysign(std::expm1(std::abs(mean)), mean));
  }
}

template <typename T>
void TwoHotValueBackward(In<T> probabilities, In<T> values, In<T> d_values, const Bins& bins,
                         Mat<T> d) {
  const Tag<T> tag;
  for (Index j = 0; j < d.cols; ++j) {
    const double value = static_cast<double>(values(0, j));
    const double mean = std::copysign(std::log1p(std::abs(value)), value);
    // d symexp(m) / dm = 1 + |symexp(m)|; a logit's share is p (bin - mean).
    const Vector<T> factor =
        hn::Set(tag, d_values(0, j) * static_cast<T>(bins.step() * (1 + std::abs(value))));
    const Vector<T> centre = hn::Set(tag, static_cast<T>((mean - bins.low) / bins.step()));
    for (Index i = 0; i < d.rows; i += kLanes<T>) {
      const Vector<T> p = LoadUpTo(tag, probabilities.col(j) + i, d.rows - i);
      const Vector<T> offset = hn::Sub(hn::Iota(tag, static_cast<T>(i)), centre);
      StoreUpTo(hn::Mul(hn::Mul(factor, p), offset), tag, d.col(j) + i, d.rows - i);
    }
  }
}

DREAMSEARCH_KERNELS_OF_SET(CategoricalKernels, DREAMSEARCH_CATEGORICAL)

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace dreamsearch::networks
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dreamsearch::networks {
DREAMSEARCH_FORWARD_KERNELS(CategoricalKernels, DREAMSEARCH_CATEGORICAL)
}  // namespace dreamsearch::networks
#endif  // HWY_ONCE
