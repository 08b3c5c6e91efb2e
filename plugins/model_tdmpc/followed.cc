#include "plugins/model_tdmpc/followed.h"

#include <algorithm>
#include <cmath>

namespace dreamsearch::tdmpc {
namespace {

// To go on after a transition.
template <typename T>
double Chance(T logit) {
  return 1 / (1 + std::exp(-static_cast<double>(logit) - kFreshLogit));
}

}  // namespace

template <typename T>
void Followed<T>::Evaluate(const Agent<T>& agent, const Weights<T>& weights, const Mlp& head,
                           In<T> inputs, HeadTape* tape, Mat<T> numbers) {
  const Mat<T> logits = tape->probabilities.Shape(agent.settings.bins.count, inputs.cols);
  head.Reserve(inputs.cols, &tape->tape);
  head.Forward(weights, inputs, 0, &tape->tape, logits);
  TwoHotValue<T>(logits, agent.settings.bins, logits, numbers);
  Copy<T>(numbers, tape->numbers.Shape(1, inputs.cols));
}

template <typename T>
void Followed<T>::EvaluateBackward(const Agent<T>& agent, const Weights<T>& weights,
                                   const Mlp& head, In<T> inputs, const HeadTape& tape,
                                   In<T> d_numbers, Mat<T> d_inputs) {
  const Index bins = agent.settings.bins.count, n = inputs.cols;
  const Mat<T> d_logits = d_logits_.Shape(bins, n);
  TwoHotValueBackward<T>(Mat<T>(tape.probabilities.data(), bins, n),
                         Mat<T>(tape.numbers.data(), 1, n), d_numbers, agent.settings.bins,
                         d_logits);
  head.Backward(weights, inputs, 0, tape.tape, In<T>(d_logits), &scratch_, static_cast<T*>(nullptr),
                d_inputs);
}

template <typename T>
void Followed<T>::Forward(const Agent<T>& agent, In<T> latents, In<T> actions, Mat<T> rewards,
                          double* discounts, Mat<T> values) {
  const Index l = agent.l, a = agent.a, n = latents.cols, all = actions.cols;
  const Weights<T> model = agent.planning(kModel, &memory_);
  // The last columns are the last latents, and no action.
  const Mat<T> inputs = inputs_.Shape(l + a, all + n);
  Copy<T>(latents, inputs.Rows(0, l).Cols(0, n));
  Copy<T>(actions, inputs.Rows(l, a).Cols(0, all));
  agent.dynamics.Reserve(all, &dynamics_tape_);
  for (Index at = 0; at < all; at += n) {
    agent.dynamics.Forward(model, In<T>(inputs.Cols(at, n)), at, &dynamics_tape_, Mat<T>());
    Copy<T>(agent.dynamics.Last(dynamics_tape_).Cols(at, n), inputs.Rows(0, l).Cols(at + n, n));
  }
  Evaluate(agent, model, agent.reward, In<T>(inputs.Cols(0, all)), &reward_, rewards);
  std::fill(discounts, discounts + all, agent.settings.discount);
  if (agent.ends_seen != 0) {
    const Mat<T> logits = continuations_.Shape(1, all);
    agent.continuation.Reserve(all, &continuation_tape_);
    agent.continuation.Forward(model, In<T>(inputs.Rows(0, l).Cols(n, all)), 0, &continuation_tape_,
                               logits);
    for (Index j = 0; j < all; ++j) discounts[j] *= Chance(logits(0, j));
  }
  const Mat<T> last = last_inputs_.Shape(l + a, n);
  Copy<T>(inputs.Rows(0, l).Cols(all, n), last.Rows(0, l));
  agent.ActAt(agent.planning(kActor, &memory_), In<T>(last.Rows(0, l)), Mat<T>(), last, &memory_);
  if (critics_.size() != agent.critics.size()) {
    critics_ = std::vector<HeadTape>(agent.critics.size());
  }
  const Weights<T> critic = agent.planning(kCritic, &memory_);
  for (std::size_t k = 0; k < critics_.size(); ++k) {
    Evaluate(agent, critic, agent.critics[k], In<T>(last), &critics_[k],
             values.Rows(static_cast<Index>(k), 1));
  }
}

template <typename T>
void Followed<T>::Backward(const Agent<T>& agent, In<T> d_rewards, In<T> d_discounts,
                           In<T> d_values, Mat<T> d_actions) {
  const Index l = agent.l, a = agent.a, n = d_values.cols, all = d_actions.cols;
  const Weights<T> model = agent.planning(kModel, &memory_);
  const Weights<T> critic = agent.planning(kCritic, &memory_);
  const Mat<T> inputs(inputs_.data(), l + a, all + n);
  const Mat<T> d_inputs = d_inputs_.Shape(l + a, all + n);
  SetZero(d_inputs);

  // The values, through the actor's mode.
  const Mat<T> last(last_inputs_.data(), l + a, n);
  const Mat<T> d_last = d_last_inputs_.Shape(l + a, n);
  SetZero(d_last);
  for (std::size_t k = 0; k < critics_.size(); ++k) {
    EvaluateBackward(agent, critic, agent.critics[k], In<T>(last), critics_[k],
                     d_values.Rows(static_cast<Index>(k), 1), d_last);
  }
  const Mat<T> zeros = zeros_.Shape(a, n);  // no noise, and no weight of an entropy
  SetZero(zeros);
  const Mat<T> d_raw = d_raw_.Shape(2 * a, n);
  ActorBackward<T>(Mat<T>(memory_.squashed.data(), a, n), Mat<T>(memory_.std.data(), a, n),
                   Mat<T>(memory_.actions.data(), a, n), zeros, agent.shape, d_last.Rows(l, a),
                   zeros, Mat<T>(), d_raw);
  const Mat<T> d_latents = d_last.Rows(0, l);
  agent.actor.Backward(agent.planning(kActor, &memory_), In<T>(last.Rows(0, l)), 0,
                       memory_.actor_tape, In<T>(d_raw), &scratch_, static_cast<T*>(nullptr),
                       d_latents);
  Copy<T>(d_latents, d_inputs.Rows(0, l).Cols(all, n));

  EvaluateBackward(agent, model, agent.reward, In<T>(inputs.Cols(0, all)), reward_, d_rewards,
                   d_inputs.Cols(0, all));
  if (agent.ends_seen != 0) {
    const Mat<T> logits(continuations_.data(), 1, all);
    const Mat<T> d_logits = d_continuations_.Shape(1, all);
    for (Index j = 0; j < all; ++j) {
      const double chance = Chance(logits(0, j));
      d_logits(0, j) = static_cast<T>(static_cast<double>(d_discounts(0, j)) *
                                      agent.settings.discount * chance * (1 - chance));
    }
    agent.continuation.Backward(model, In<T>(inputs.Rows(0, l).Cols(n, all)), 0, continuation_tape_,
                                In<T>(d_logits), &scratch_, static_cast<T*>(nullptr),
                                d_inputs.Rows(0, l).Cols(n, all));
  }
  for (Index at = all - n; at >= 0; at -= n) {
    agent.dynamics.Backward(model, In<T>(inputs.Cols(at, n)), at, dynamics_tape_,
                            In<T>(d_inputs.Rows(0, l).Cols(at + n, n)), &scratch_,
                            static_cast<T*>(nullptr), d_inputs.Cols(at, n));
  }
  Copy<T>(d_inputs.Rows(l, a).Cols(0, all), d_actions);
}

template class Followed<float>;
template class Followed<double>;

}  // namespace dreamsearch::tdmpc
