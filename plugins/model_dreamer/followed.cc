#include "plugins/model_dreamer/followed.h"

#include <algorithm>
#include <cmath>

namespace dreamsearch::dreamer {
namespace {

template <typename T>
double Chance(T logit) {
  return 1 / (1 + std::exp(-static_cast<double>(logit)));
}

}  // namespace

template <typename T>
void Followed<T>::Forward(const Settings& settings, const WorldModel<T>& world,
                          const Behaviour<T>& behaviour, In<T> from, In<T> actions, In<T> noise,
                          Mat<T> rewards, double* discounts, Mat<T> values) {
  const Index n = from.cols, all = actions.cols;
  const Weights<T> weights = world.group().planning(&rounded_scratch_);
  const Mat<T> states = states_.Shape(from.rows, all + n);
  Copy<T>(from, states.Cols(0, n));
  world.Reserve(all, &transitions_);
  for (Index at = 0; at < all; at += n) {
    world.Step(weights, states.Cols(at, n), actions.Cols(at, n), noise ? noise.Cols(at, n) : noise,
               at, &transitions_, states.Cols(at + n, n));
  }
  const In<T> arrived = states.Cols(n, all);
  world.Reward(weights, arrived, &reward_tape_, rewards);
  std::fill(discounts, discounts + all, settings.discount);
  if (settings.continuation) {
    const Mat<T> logits = logits_.Shape(1, all);
    world.Continuation(weights, arrived, &continuation_tape_, logits);
    for (Index j = 0; j < all; ++j) discounts[j] = Chance(logits(0, j));
  }
  behaviour.Value(states.Cols(all, n), &value_tapes_, &rounded_scratch_, values);
}

template <typename T>
void Followed<T>::Backward(const Settings& settings, const WorldModel<T>& world,
                           const Behaviour<T>& behaviour, In<T> noise, In<T> d_rewards,
                           In<T> d_discounts, In<T> d_values, Mat<T> d_actions) {
  const Index n = d_values.cols, all = d_actions.cols, rows = settings.state_size();
  const Weights<T> weights = world.group().planning(&rounded_scratch_);
  const Mat<T> states(states_.data(), rows, all + n);
  const In<T> arrived = states.Cols(n, all);
  const Mat<T> d_states = d_states_.Shape(rows, all + n);
  SetZero(d_states);
  const Mat<T> d_arrived = d_states.Cols(n, all);
  world.RewardBackward(weights, arrived, reward_tape_, d_rewards, &scratch_, d_arrived);
  if (settings.continuation) {
    const Mat<T> logits(logits_.data(), 1, all);
    const Mat<T> d_logits = d_logits_.Shape(1, all);
    for (Index j = 0; j < all; ++j) {
      const double chance = Chance(logits(0, j));
      d_logits(0, j) =
          static_cast<T>(static_cast<double>(d_discounts(0, j)) * chance * (1 - chance));
    }
    world.ContinuationBackward(weights, arrived, continuation_tape_, d_logits, &scratch_,
                               d_arrived);
  }
  behaviour.ValueBackward(states.Cols(all, n), value_tapes_, d_values, &scratch_, &rounded_scratch_,
                          d_states.Cols(all, n));
  In<T> draws = noise;
  if (!draws) {  // the mean is what noise of 0 gives
    const Mat<T> zeros = zeros_.Shape(settings.stochastic, all);
    SetZero(zeros);
    draws = zeros;
  }
  for (Index at = all - n; at >= 0; at -= n) {
    world.StepBackward(weights, states.Cols(at, n), states.Cols(at + n, n), draws.Cols(at, n), at,
                       &transitions_, d_states.Cols(at + n, n),
                       at > 0 ? d_states.Cols(at, n) : Mat<T>(), d_actions.Cols(at, n));
  }
}

template class Followed<float>;
template class Followed<double>;

}  // namespace dreamsearch::dreamer
