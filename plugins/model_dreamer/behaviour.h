// behaviour.h - the actor and the critics, and the dreams that train them.
//
// From every start, H transitions are imagined with the prior and sampled
// actions. With d_tau the discount of arriving at s_tau (gamma, or the
// continuation model's mean), v_c(s) the value of critic c of C, v(s) their mean or least, and
// V_H = v(s_H):
//
//   V_tau = r(s_{tau+1}) + d_{tau+1} ((1 - lambda) v(s_{tau+1}) + lambda V_{tau+1})
//   w_tau = d_1 ... d_tau
//   actor loss  - mean( w_tau (V_tau / S + entropy_scale * (- ln pi(a_tau))) )
//   value loss  mean( w_tau 0.5 (((v_c(s_tau) - V_tau) / value_scale)^2 +
//                                slow_critic_weight ((v_c(s_tau) - v_c'(s_tau)) / value_scale)^2) )
//
// Where a start was searched (SequenceBatch), the actor loss also has search_policy_weight times
// the mean over starts of the candidates' nll at s_0 (search_targets.h), and V_0 in the value loss
// is mixed with the value that the search found, share search_value_weight.
//
// The mean is over starts and tau = 0 .. H - 1, and over critics. S is the return scale. The
// actor's input is gradient-stopped; its gradient comes through the actions, back through the
// frozen world model and critics; V_tau and the slow critics v_c' are fixed in the value loss. v(s)
// leaves out the reward for arriving at s.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "plugins/model_dreamer/settings.h"
#include "plugins/model_dreamer/world_model.h"
#include "plugins/networks/layers.h"
#include "plugins/networks/learning.h"
#include "plugins/networks/search_targets.h"
#include "plugins/networks/task_threads.h"

namespace dreamsearch::dreamer {

// Starts dreamt of at once: enough columns for fast products, few enough that what a
// block leaves for its way back is still in the cache then (7 MB with the paper's sizes).
inline constexpr Index kStartsPerBlock = 32;
inline constexpr Index kMaxLanes = 6;

// lambda-returns of n dreams at once. rewards, discounts: [H, n] of arriving at
// s_1 .. s_H; values: [H + 1, n] of s_0 .. s_H; returns: [H, n]; all tau-major
// (tau * n + i).
template <typename T>
void LambdaReturns(Index horizon, Index n, T lambda, const T* rewards, const T* discounts,
                   const T* values, T* returns);

// From d_returns [H, n], which is overwritten: d_rewards, d_discounts [H, n],
// d_values [H + 1, n].
template <typename T>
void LambdaReturnsBackward(Index horizon, Index n, T lambda, const T* discounts, const T* values,
                           const T* returns, T* d_returns, T* d_rewards, T* d_discounts,
                           T* d_values);

struct DreamLosses {
  double actor = 0;
  double value = 0;            // with the slow critic's part
  double imagined_return = 0;  // mean of V_0
  double value_mean = 0;       // mean of v(s_tau)
  double entropy = 0;          // mean of - ln pi(a_tau)
  double actor_std = 0;        // mean before tanh
  double imitation = 0;        // mean nll of the starts that were searched
  double searched = 0;         // share of these
};

// What the losses treat as constants although it depends on the parameters: the
// actor's inputs, the weights w_tau and the value's targets V_tau, of one block.
// A finite difference is comparable with the gradient only if they stay what they
// were, so a dream can be given those of an earlier one.
template <typename T>
struct DreamStops {
  std::vector<T> states;   // [H * m, Z + D]
  std::vector<T> weights;  // [H * m]
  std::vector<T> targets;  // [H * m]
};

// Starts and draws of a dream; the noise of start i at tau is column tau * K + i.
template <typename T>
struct DreamInput {
  Mat<const T> states;                   // [Z + D, n]
  View<const Index> starts;              // [K], columns of states, ascending
  Progress* known = nullptr;             // how many of those columns are known yet
  Mat<const T> latent_noise;             // [Z, K * H]
  Mat<const T> action_noise;             // [A, K * H]
  double return_scale = 1;               // S
  SequenceBatch batch;                   // whose columns the states are, time-major
  const DreamStops<T>* stops = nullptr;  // hold these fixed; of a dream in one block
};

// A share of a dream's starts: the memory to dream of them, their losses and their
// gradients. Lanes share nothing that is written, so each may have a thread.
template <typename T>
struct DreamLane {
  Index first = 0;  // start
  Index count = 0;
  Index block_first = 0;  // the starts that the buffers are about
  Index block_count = 0;
  Progress dreamt, learnt;  // reach 1
  DreamLosses losses;       // sums
  Buffer<T> actor_gradient, value_gradient;

  TransitionTape<T> transitions;
  MlpTape<T> actor_tape, slow_tape, reward_tape, continuation_tape;
  std::vector<MlpTape<T>> value_tapes;  // of each critic
  MlpScratch<T> scratch;
  Bfloat16Scratch rounded_scratch;
  Buffer<T> states, action_noise, raw, squashed, std, actions, entropy, rewards, logits, discounts,
      values, outputs, d_outputs, slow_outputs, weights, d_states, d_returns, d_rewards,
      d_discounts, d_values, d_actions, d_raw, entropy_weights;
  Imitation<T> imitation;
};

template <typename T>
class Behaviour {
 public:
  Behaviour(const Settings& settings, Index action_size);

  ParameterGroup<T>& actor() { return actor_group_; }
  ParameterGroup<T>& value() { return value_group_; }
  const ParameterGroup<T>& actor() const { return actor_group_; }
  const ParameterGroup<T>& value() const { return value_group_; }

  // The slow critics' parameters, as many as value().
  std::vector<T>& slow() { return slow_.values(); }
  const std::vector<T>& slow() const { return slow_.values(); }
  void ResetSlow() { slow_.Reset(value_group_); }
  void UpdateSlow() { slow_.Follow(value_group_, settings_.slow_critic_rate); }

  // Of the actor's parameters those that give the mode: their moving average. Null: they do.
  std::vector<T>* acting() { return settings_.averages_actor() ? &acting_.values() : nullptr; }
  // After the update-th update; the first is 1. A plain mean until it has as many updates as the
  // moving one remembers.
  void UpdateActing(std::uint64_t update) {
    if (!settings_.averages_actor()) return;
    acting_.Follow(actor_group_,
                   std::max(settings_.actor_average, 1 / static_cast<double>(update)));
  }

  // Makes both groups' parameters; see ParameterGroup::Allocate.
  void Allocate(std::uint64_t actor_seed, std::uint64_t value_seed, Rounding rounding);
  // Lays the weights out anew, the copies' too; after any of them has changed.
  void Pack();

  // A dream, in lanes that depend on the number of starts alone: BeginDream shares the
  // starts out and returns how many lanes there are; DreamIn dreams in one of them and
  // learns from all but its last block, LearnIn from that one. AddActorGradients and
  // AddValueGradients add the lanes' gradients to the groups', in their order. Each may
  // have a thread of its own and waits for what it needs, so they are to be begun in this
  // order, for every lane. EndDream follows when all have ended; `input` lives until then.
  Index BeginDream(const DreamInput<T>& input);
  void DreamIn(Index lane, const WorldModel<T>& world);
  void LearnIn(Index lane);
  void AddActorGradients();
  void AddValueGradients();
  void EndDream(DreamLosses* losses);
  // V_tau of the last dream, [K * H]; tau-major in each block of kStartsPerBlock starts.
  const std::vector<T>& returns() const { return returns_; }

  // The constants of a dream in one block.
  DreamStops<T> Stops() const;

  // values: [C, n], in the units of rewards.
  void Value(In<T> states, Mat<T> values);
  // The same with tapes and scratch of the caller's, and from d_values back: d_states is added to.
  void Value(In<T> states, std::vector<MlpTape<T>>* tapes, Bfloat16Scratch* rounded,
             Mat<T> values) const;
  void ValueBackward(In<T> states, const std::vector<MlpTape<T>>& tapes, In<T> d_values,
                     MlpScratch<T>* scratch, Bfloat16Scratch* rounded, Mat<T> d_states) const;
  // actions: [A, n]; the mode where noise is empty.
  void Act(In<T> states, In<T> noise, Mat<T> actions);
  // actions: [A, n * count], those of state i in columns i * count on.
  void Sample(In<T> states, Index count, In<T> noise, Mat<T> actions);

 private:
  // The batch's row of a start.
  Index RowOf(Index start) const {
    const Index column = input_.starts.data[start];
    const auto sequences = static_cast<Index>(input_.batch.sequences);
    return column % sequences * static_cast<Index>(input_.batch.length) + column / sequences;
  }
  // Dreams of the lane's block, and takes the returns' gradient back to the actions.
  void DreamBlock(const WorldModel<T>& world, DreamLane<T>* lane);
  // Both losses' gradients in the weights, from what DreamBlock left.
  void LearnFromBlock(DreamLane<T>* lane);
  // From the critics' outputs to the units of rewards.
  void ScaleValues(Mat<T> values) const;
  // v of one state, from the outputs of its critics [C], and back.
  T OfCritics(const T* outputs) const;
  void ToCritics(const T* outputs, T d_value, T* d_outputs) const;
  Index LeastOf(const T* outputs) const;
  // group's gradient += the lanes'.
  void AddGradients(Buffer<T> DreamLane<T>::*gradient, ParameterGroup<T>* group);

  Settings settings_;
  Index a_;
  ActorShape shape_;
  ParameterGroup<T> actor_group_{"actor"};
  ParameterGroup<T> value_group_{"value"};
  Mlp actor_;
  std::vector<Mlp> critics_;
  SlowCopy<T> slow_, acting_;
  std::vector<T> returns_;

  DreamInput<T> input_;
  Index lanes_ = 0;  // in use
  std::array<DreamLane<T>, kMaxLanes> lane_;

  // What planners ask for.
  MlpTape<T> actor_tape_, value_tape_;
  Bfloat16Scratch rounded_scratch_;
  Buffer<T> raw_, repeated_, squashed_, std_;
};

}  // namespace dreamsearch::dreamer
