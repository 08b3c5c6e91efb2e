// lane.h - losses and gradients of an update, for a share of its sequences.
//
// With the networks of agent.h and B sequences of H + 1 observations, z_0 = h(o_0) and z_{t+1} =
// d(z_t, a_t):
//
//   model loss  sum_t rho^t / H ( w_c mean (z_{t+1} - h(o_{t+1}))^2 + w_r CE(R(z_t, a_t), r_t)
//                                 + w_q mean_k CE(Q_k(z_t, a_t), y_t) ) + w_e BCE(continuation)
//   y_t = r_t + gamma c_t ((1 - lambda) min_k Q'_k(h(o_{t+1}), a') + lambda y_{t+1}),
//                                       a' ~ pi(h(o_{t+1})),  c_t 0 at an end
//   actor loss  - sum_t rho^t / (H + 1) mean ( mean_k Q_k(z_t, a) / S + e A (- ln pi(a | z_t))
//                                              - w_p nll(z_t) )
//
// Where o_{t+1} was searched, the least Q' is mixed with the value that the search found, share
// w_v; nll of the candidates is that of search_targets.h, 0 where o_t was not searched.
//
// Means are over the batch; where an episode ends inside a sequence, the steps from there on
// count for nothing. The last step of a sequence has no y_{t+1}, and lambda there is 0. h(o_{t+1}),
// y_t and the actor's z_t are fixed; Q' are the slow critics, S the return scale before the update.
#pragma once

#include <array>
#include <iterator>
#include <vector>

#include "dreamsearch/model.h"
#include "plugins/model_tdmpc/agent.h"
#include "plugins/networks/search_targets.h"

namespace dreamsearch::tdmpc {

// What an update reports, the metrics of Train.
enum Loss : std::size_t {
  kConsistencyLoss,
  kRewardLoss,
  kValueLoss,
  kContinuationLoss,
  kModelLoss,
  kActorLoss,
  kModelNorm,
  kActorNorm,
  kTargetMean,
  kValueMean,
  kEntropy,
  kActorStd,
  kImitationLoss,
  kSearched,
  kLosses
};
using UpdateLosses = std::array<double, kLosses>;

inline constexpr MetricSpec kMetrics[] = {
    {"consistency_loss", "", "mean squared distance of imagined from encoded latents"},
    {"reward_loss", "nats", "cross-entropy of the predicted rewards"},
    {"value_loss", "nats", "cross-entropy of the critics' values, their mean"},
    {"continuation_loss", "nats",
     "cross-entropy of the predicted continuation; 0 until an episode ends early"},
    {"model_loss", "", "weighted sum of these losses"},
    {"actor_loss", "", "minus the weighted mean of scaled values and entropy bonus"},
    {"model_gradient_norm", "", "of all but the actor's gradient, before clipping"},
    {"actor_gradient_norm", "", "of the actor's gradient, before clipping"},
    {"target_mean", "", "mean target of the critics"},
    {"value_mean", "", "mean value of the imagined states"},
    {"actor_entropy", "nats", "mean of minus the log density of the actor's actions"},
    {"actor_std", "", "mean deviation of the actor before tanh"},
    {"imitation_loss", "nats", "of the search's candidates, mean over the states searched"},
    {"searched", "", "share of the actor's states that were searched"},
};
static_assert(std::size(kMetrics) == kLosses);

// What the losses treat as constants although it depends on the parameters, of an update in
// one lane. A finite difference is comparable with the gradient only if they stay.
template <typename T>
struct Stops {
  std::vector<T> encoded;  // [L, (H + 1) * B]
  std::vector<T> targets;  // [H * B]
};

// What an update is made from, the same for all lanes.
template <typename T>
struct Step {
  const Agent<T>* agent = nullptr;
  SequenceBatch batch;
  Index horizon = 0;         // H
  std::vector<Index> steps;  // [B]: of each sequence until its first episode's end
  double all_steps = 0;      // their sum
  bool ends_seen = false;    // the continuation is learnt
  const ObservationStatistics* statistics = nullptr;
  Standardisation standardisation;
  std::vector<Index> target_critics;       // whose least value is the target
  Buffer<T> target_noise, actor_noise;     // [A, H * B], [A, (H + 1) * B]
  double return_scale = 1;                 // S
  std::vector<T>* first_values = nullptr;  // [B], receives mean_k Q_k(z_0, a)
};

// A share of the sequences: memory, losses and gradients. Lanes share nothing that is
// written, so each may have a thread. Columns are time-major, t * count + i.
template <typename T>
struct Lane : Memory<T> {
  Index first = 0;  // sequence
  Index count = 0;
  UpdateLosses losses{};  // shares of the sums
  std::array<Buffer<T>, kGroups> gradients;
  // What a step from z_t, and z_t itself, count: rho^t, and nothing after an episode's end.
  Buffer<T> step_decay, latent_decay;  // [1, H * count], [1, (H + 1) * count]
  Buffer<T> observations, rewards, continues, encoded, next_inputs, noise, values, targets, weights,
      d_inputs, d_values, d_raw;
  Imitation<T> imitation;
};

// Leaves the lane's losses and gradients; kImitationLoss is still a sum.
template <typename T>
void LearnIn(const Step<T>& step, const Stops<T>* stops, Lane<T>* lane);

}  // namespace dreamsearch::tdmpc
