// followed.h - sequences of actions through the frozen world model, and the way back to them.
//
// For the gradient of an imagined return (ReturnGradient of the SDK). Columns are time-major:
// column t * n + i is transition t of sequence i. Computes with the planning weights.
#pragma once

#include <vector>

#include "plugins/model_dreamer/behaviour.h"
#include "plugins/model_dreamer/world_model.h"

namespace dreamsearch::dreamer {

template <typename T>
class Followed {
 public:
  // states: [Z + D, n]; actions: [A, H * n]; noise: [Z, H * n], or empty for the prior's mean;
  // rewards: [1, H * n]; discounts: [H * n]; values: [C, n], of the last states.
  void Forward(const Settings& settings, const WorldModel<T>& world, const Behaviour<T>& behaviour,
               In<T> states, In<T> actions, In<T> noise, Mat<T> rewards, double* discounts,
               Mat<T> values);

  // From the gradients of the last Forward's results; d_actions is set. Networks and noise are
  // those of that Forward.
  void Backward(const Settings& settings, const WorldModel<T>& world, const Behaviour<T>& behaviour,
                In<T> noise, In<T> d_rewards, In<T> d_discounts, In<T> d_values, Mat<T> d_actions);

 private:
  TransitionTape<T> transitions_;
  MlpTape<T> reward_tape_, continuation_tape_;
  std::vector<MlpTape<T>> value_tapes_;  // of each critic
  MlpScratch<T> scratch_;
  Bfloat16Scratch rounded_scratch_;
  Buffer<T> states_, logits_, zeros_, d_states_, d_logits_;
};

}  // namespace dreamsearch::dreamer
