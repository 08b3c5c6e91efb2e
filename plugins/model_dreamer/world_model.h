// world_model.h - the recurrent state-space model: encoder, dynamics, heads.
//
// A state is one column [z; h]: the stochastic latent (Z rows), then the
// deterministic one (D rows).
//
//   x = act(W [z; a] + b)     h' = GRU(x, h)
//   prior      p(z' | h')    = N(mean, std) of prior(h')
//   posterior  q(z' | h', e) = N(mean, std) of out(act(W [h'; e] + b)), e = encoder(o)
//
// act is ELU, after layer normalisation if the settings ask for it.
#pragma once

#include "plugins/model_dreamer/settings.h"
#include "plugins/networks/layers.h"
#include "plugins/networks/task_threads.h"

namespace dreamsearch::dreamer {

// B sequences of T steps, time-major: column t * B + b. A sequence may run over the end of an
// episode; the next one begins from the zero state.
template <typename T>
struct Sequences {
  Index count = 0;            // B
  Index length = 0;           // T
  Mat<const T> observations;  // [O, T * B], standardised
  Mat<const T> actions;       // [A, T * B], the one before the observation
  Mat<const T> rewards;       // [1, T * B]
  Mat<const T> continues;     // [1, T * B], gamma * (not terminal)
  Mat<const T> noise;         // [Z, T * B], the posterior's
  View<const Index> firsts;   // columns after the first B that begin an episode, ascending
};

// Losses per step of the batch, before their weights.
struct FitLosses {
  double observation = 0;   // 0.5 |o - prediction|^2, summed over components
  double reward = 0;        // 0.5 (r - prediction)^2
  double continuation = 0;  // cross-entropy
  double kl = 0;            // KL(q || p), before the free nats
  double total = 0;         // the weighted sum whose gradient is taken
  double prior_std = 0;     // means over the latent
  double posterior_std = 0;
};

// What a transition needs on its way and nobody reads afterwards.
template <typename T>
struct TransitionScratch {
  Buffer<T> gru_in, gru_rec, d_in, d_rec, d_prev, d_x, d_raw;
  MlpScratch<T> mlp;
};

// What imagined transitions keep for their way back. Threads that imagine at the same
// time have one each.
template <typename T>
struct TransitionTape {
  ActivationTape<T> input;  // x [U, n]
  Mat<T> gates;             // [4D, n]
  MlpTape<T> prior;
  Mat<T> prior_raw;  // [2Z, n]
  Mat<T> prior_std;  // [Z, n]

  ActivationBuffers<T> input_buffers;
  Buffer<T> gates_buffer, raw_buffer, std_buffer;
  TransitionScratch<T> scratch;
};

template <typename T>
class WorldModel {
 public:
  WorldModel(const Settings& settings, Index observation_size, Index action_size);

  ParameterGroup<T>& group() { return group_; }
  const ParameterGroup<T>& group() const { return group_; }

  // A fit in two halves: Unroll takes the posterior over the batch from zero states and
  // tells how many of its states are `known`; Fit adds the gradient of losses->total to the
  // group's. Dreams may run beside both.
  void Unroll(const Sequences<T>& batch, Progress* known);
  void Fit(const Sequences<T>& batch, FitLosses* losses);
  // Where Unroll is going to leave its states, and the last Unroll's: [Z + D, T * B].
  Mat<const T> ReserveStates(const Sequences<T>& batch);
  Mat<T> states() const { return states_; }

  void Reserve(Index columns, TransitionTape<T>* tape) const;

  // The calls below compute with `weights`: of group(), exact() or any other.

  // next = one step of the prior from `state` under `action`; the mean where
  // noise is empty. Uses the tape's columns from `first` on.
  void Step(const Weights<T>& weights, In<T> state, In<T> action, In<T> noise, Index first,
            TransitionTape<T>* tape, Mat<T> next) const;

  // From d_next, which is overwritten: d_action is set, d_state (unless empty) is
  // added to. The group is frozen.
  void StepBackward(const Weights<T>& weights, In<T> state, In<T> next, In<T> noise, Index first,
                    TransitionTape<T>* tape, Mat<T> d_next, Mat<T> d_state, Mat<T> d_action) const;

  // The posterior after `action` from `previous` and the observation; its mean
  // where noise is empty.
  void Observe(const Weights<T>& weights, In<T> previous, In<T> action, In<T> observation,
               In<T> noise, Mat<T> next);

  // The heads at each state; reward and logit: [1, n]. The tape's columns from 0.
  void Reward(const Weights<T>& weights, In<T> states, MlpTape<T>* tape, Mat<T> reward) const;
  void Continuation(const Weights<T>& weights, In<T> states, MlpTape<T>* tape, Mat<T> logit) const;
  // d_states += the way back through a head, the group frozen.
  void RewardBackward(const Weights<T>& weights, In<T> states, const MlpTape<T>& tape,
                      In<T> d_reward, MlpScratch<T>* scratch, Mat<T> d_states) const;
  void ContinuationBackward(const Weights<T>& weights, In<T> states, const MlpTape<T>& tape,
                            In<T> d_logit, MlpScratch<T>* scratch, Mat<T> d_states) const;

 private:
  Mat<T> Stochastic(Mat<T> state) const { return state.Rows(0, z_); }
  Mat<T> Deterministic(Mat<T> state) const { return state.Rows(z_, d_); }
  In<T> ReadStochastic(In<T> state) const { return state.Rows(0, z_); }
  In<T> ReadDeterministic(In<T> state) const { return state.Rows(z_, d_); }

  // h' into next's deterministic rows, from x's pre-activation W_a a + b in
  // input.output; `start` says that the state before is zero.
  void Recur(const Weights<T>& weights, In<T> state, bool start, const ActivationTape<T>& input,
             Mat<T> gates, TransitionScratch<T>* scratch, Mat<T> next) const;

  Settings settings_;
  Index o_, a_, z_, d_, u_;
  T min_std_;

  ParameterGroup<T> group_{"world model"};
  Mlp encoder_;
  Affine recur_;
  Activation recur_activation_;
  Affine gru_input_, gru_recurrent_;
  Mlp prior_;
  Affine posterior_hidden_;
  Activation posterior_activation_;
  Affine posterior_out_;
  Mlp decoder_, reward_, continuation_;

  // The states before each step: of all_states_, or a copy where an episode begins inside a
  // sequence. Of that copy, the columns of step t.
  Mat<T> BeforeOf(const Sequences<T>& batch);
  // Zero states before the episodes that begin at step t.
  void ForgetBefore(const Sequences<T>& batch, Index t, Mat<T> before) const;

  // The memory of Unroll and Fit; Observe uses the forward part with one column a row.
  Mat<T> all_states_;  // the zero states before the first step, then states_
  Mat<T> states_;
  Buffer<T> states_buffer_, before_, kept_, gates_, posterior_raw_, posterior_std_, prior_raw_,
      prior_std_, prior_mean_, observation_, reward_out_, continuation_out_, d_observation_,
      d_reward_, d_continuation_, kl_, kl_weight_, d_states_, d_posterior_, d_prior_,
      d_posterior_hidden_, d_input_, d_recurrent_, d_recur_, d_embedding_;
  ActivationBuffers<T> recur_buffers_, posterior_buffers_;
  MlpTape<T> encoder_tape_, prior_tape_, decoder_tape_, reward_tape_, continuation_tape_;
  TransitionScratch<T> scratch_;
  Bfloat16Scratch rounded_scratch_;
};

}  // namespace dreamsearch::dreamer
