// categorical.h - numbers as distributions over bins, and vectors as distributions.
//
// A number y is stored as a distribution over bins that lie linearly in symlog(y) =
// sign(y) ln(1 + |y|): its two neighbouring bins, each by its nearness (two-hot). A network
// gives logits; its number is symexp of the bins' mean (Bellemare et al. 2017; Hafner et
// al. 2023; Hansen et al. 2024). SimNorm makes a vector a row of small distributions
// (Lavoie et al. 2022).
//
// As in elementwise.h a column's result has the same bits whatever stands beside it, and
// NaN in an input is NaN in the output.
#pragma once

#include "plugins/networks/elementwise.h"
#include "plugins/networks/matrix.h"

namespace dreamsearch::networks {

// Softmax over every kSimplex rows that follow each other, in place; rows: a multiple of it.
inline constexpr Index kSimplex = 8;
template <typename T>
void SimNorm(Mat<T> x);

// d, the gradient of the output y, becomes that of the input, in place.
template <typename T>
void SimNormBackward(In<T> y, Mat<T> d);

// `count` bins at equal distances from `low` to `high`, in symlog space.
struct Bins {
  Index count = 101;
  double low = -10;
  double high = 10;
  double step() const { return (high - low) / static_cast<double>(count - 1); }
};

// logits: [count, n], targets and weights: [1, n]. Returns the sum of the weighted
// cross-entropies from the targets, NaN where a target is not finite; d: [count, n], its
// gradient; may be the logits.
template <typename T>
double TwoHotError(In<T> logits, In<T> targets, In<T> weights, const Bins& bins, Mat<T> d);

// values: [1, n]; probabilities: [count, n], receives the softmax, and may be the logits.
template <typename T>
void TwoHotValue(In<T> logits, const Bins& bins, Mat<T> probabilities, Mat<T> values);

// d: [count, n], the gradient of the logits, from that of the values; may be the
// probabilities.
template <typename T>
void TwoHotValueBackward(In<T> probabilities, In<T> values, In<T> d_values, const Bins& bins,
                         Mat<T> d);

}  // namespace dreamsearch::networks
