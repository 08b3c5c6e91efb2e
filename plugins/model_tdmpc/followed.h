// followed.h - sequences of actions through the frozen networks, and the way back to them.
//
// For the gradient of an imagined return (ReturnGradient of the SDK). Columns are time-major:
// column t * n + i is transition t of sequence i. Computes with the planning weights; the value
// of a last latent is the critics' at the actor's mode, and the way back goes through both.
#pragma once

#include <vector>

#include "plugins/model_tdmpc/agent.h"

namespace dreamsearch::tdmpc {

template <typename T>
class Followed {
 public:
  // latents: [L, n]; actions: [A, H * n]; rewards: [1, H * n]; discounts: [H * n]; values: [K, n].
  void Forward(const Agent<T>& agent, In<T> latents, In<T> actions, Mat<T> rewards,
               double* discounts, Mat<T> values);

  // From the gradients of the last Forward's results; d_actions is set. The networks are those of
  // that Forward.
  void Backward(const Agent<T>& agent, In<T> d_rewards, In<T> d_discounts, In<T> d_values,
                Mat<T> d_actions);

 private:
  // A head whose number the bins give.
  struct HeadTape {
    MlpTape<T> tape;
    Buffer<T> probabilities, numbers;
  };

  void Evaluate(const Agent<T>& agent, const Weights<T>& weights, const Mlp& head, In<T> inputs,
                HeadTape* tape, Mat<T> numbers);
  // d_inputs += the way back from d_numbers.
  void EvaluateBackward(const Agent<T>& agent, const Weights<T>& weights, const Mlp& head,
                        In<T> inputs, const HeadTape& tape, In<T> d_numbers, Mat<T> d_inputs);

  Memory<T> memory_;  // the actor's mode, the rounding's scratch
  MlpTape<T> dynamics_tape_, continuation_tape_;
  HeadTape reward_;
  std::vector<HeadTape> critics_;
  MlpScratch<T> scratch_;
  // [L + A, H * n] and what follows; [L + A, n] at the last latents.
  Buffer<T> inputs_, last_inputs_, d_inputs_, d_last_inputs_;
  Buffer<T> continuations_, d_continuations_, d_logits_, zeros_, d_raw_;
};

}  // namespace dreamsearch::tdmpc
