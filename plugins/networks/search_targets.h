// search_targets.h - what a learner takes from the searches of a batch (SequenceBatch).
//
// A row that was searched has candidates a_k with weights w_k that sum to 1, and a value. The
// actor imitates the candidates by their negative log likelihood before tanh, u_k = atanh(a_k):
//
//   nll = 1/A sum_i sum_k w_k ( (u_ki - m_i)^2 / (2 q_i) + ln(2 pi q_i) / 2 ),  q = s^2 + 0.1^2
//
// with m and s the mean and the deviation of the actor's Gaussian. (The density of the action
// itself differs by the slope of tanh at a_k, which no parameter changes.) Gradients are bounded:
// a_k is clipped to +-0.999, so that u_k lies within 3.8, and q is the variance of the Gaussian
// seen through noise of deviation 0.1, so that no deviation is too small to be moved: the slope
// in m is at most |u - m| / 0.1^2, that in s at most (u - m)^2 / 0.1^3.
#pragma once

#include <algorithm>

#include "dreamsearch/model.h"
#include "plugins/networks/elementwise.h"
#include "plugins/networks/matrix.h"

namespace dreamsearch::networks {

inline constexpr double kLargestCandidate = 0.999;
inline constexpr double kCandidateNoise = 0.1;

// Whether the row of the batch was searched.
inline bool Searched(const SequenceBatch& batch, Index row) {
  const auto k = batch.search_candidates;
  const float* weights = batch.search_weights.data + static_cast<std::uint64_t>(row) * k;
  return std::any_of(weights, weights + k, [](float weight) { return weight != 0; });
}

// A value of the row's state, with `share` of what its search found where there is one.
template <typename T>
T WithSearchValue(const SequenceBatch& batch, Index row, double share, T value) {
  if (share == 0 || !Searched(batch, row)) return value;
  const auto found = static_cast<T>(batch.search_values[static_cast<std::uint64_t>(row)]);
  return static_cast<T>(1 - share) * value + static_cast<T>(share) * found;
}

// The gradients of imitation in mean and deviation, for columns of the actor's outputs.
template <typename T>
class Imitation {
 public:
  // None yet, for n columns of actors with a action components.
  void Begin(const SequenceBatch& batch, const ActorShape& shape, Index a, Index n);
  // Adds `factor` times the nll of a searched row, which is that of column j of squashed and std
  // as ActorForward leaves them. Returns the nll.
  double Add(Index row, double factor, In<T> squashed, In<T> std, Index j);
  // [2 A, n], for ActorBackward; empty where the batch has no searches.
  In<T> gradient() const { return gradient_; }

 private:
  SequenceBatch batch_;
  double mean_factor_ = 1;  // of what ActorForward calls squashed
  Buffer<T> memory_, before_tanh_;
  Mat<T> gradient_;
};

}  // namespace dreamsearch::networks
