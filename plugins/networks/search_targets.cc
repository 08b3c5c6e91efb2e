#include "plugins/networks/search_targets.h"

#include <cmath>
#include <numbers>

namespace dreamsearch::networks {

template <typename T>
void Imitation<T>::Begin(const SequenceBatch& batch, const ActorShape& shape, Index a, Index n) {
  batch_ = batch;
  mean_factor_ = shape.bounds_log_std() ? 1 : shape.mean_limit;
  gradient_ = batch.search_candidates == 0 ? Mat<T>() : memory_.Shape(2 * a, n);
  SetZero(gradient_);
}

template <typename T>
double Imitation<T>::Add(Index row, double factor, In<T> squashed, In<T> std, Index j) {
  const Index a = squashed.rows;
  const auto candidates = static_cast<Index>(batch_.search_candidates);
  const float* actions = batch_.search_actions.data + row * candidates * a;
  const float* weights = batch_.search_weights.data + row * candidates;
  const double components = static_cast<double>(a);
  const Mat<T> before_tanh = before_tanh_.Shape(candidates * a, 1);
  const T largest = static_cast<T>(kLargestCandidate);
  for (Index i = 0; i < candidates * a; ++i) {
    before_tanh(i, 0) = std::clamp(static_cast<T>(actions[i]), -largest, largest);
  }
  Atanh(before_tanh);
  double nll = 0;
  for (Index i = 0; i < a; ++i) {
    const double mean = mean_factor_ * static_cast<double>(squashed(i, j));
    const double deviation = static_cast<double>(std(i, j));
    const double variance = deviation * deviation + kCandidateNoise * kCandidateNoise;
    double total = 0, errors = 0, squares = 0;
    for (Index k = 0; k < candidates; ++k) {
      const auto weight = static_cast<double>(weights[k]);
      if (weight == 0) continue;
      const double error = mean - static_cast<double>(before_tanh(k * a + i, 0));
      total += weight;
      errors += weight * error;
      squares += weight * error * error;
    }
    nll +=
        (squares / variance + total * std::log(2 * std::numbers::pi * variance)) / (2 * components);
    gradient_(i, j) += static_cast<T>(factor / components * errors / variance);
    gradient_(a + i, j) +=
        static_cast<T>(factor / components * deviation * (total - squares / variance) / variance);
  }
  return nll;
}

template class Imitation<float>;
template class Imitation<double>;

}  // namespace dreamsearch::networks
