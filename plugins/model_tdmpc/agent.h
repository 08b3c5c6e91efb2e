// agent.h - the networks of TD-MPC2 and what they give: latents, transitions, rewards, values,
// actions.
//
//   encoder       z = h(o)
//   dynamics      z' = d(z, a)
//   reward        R(z, a), a distribution over bins; so are the critics Q_k(z, a)
//   continuation  the chance to go on after arriving at z'
//   actor         pi(a | z): tanh of a Gaussian
//
// A latent is a row of small distributions (SimNorm). Columns are samples; `inputs` are
// columns [z; a].
#pragma once

#include <array>
#include <vector>

#include "plugins/model_tdmpc/settings.h"
#include "plugins/networks/learning.h"

namespace dreamsearch::tdmpc {

// The groups of parameters that are moved together.
enum Group : std::size_t { kEncoder, kModel, kCritic, kActor, kGroups };

// The memory of one thread's calls, and what their ways back need.
template <typename T>
struct Memory {
  MlpTape<T> encoder_tape, dynamics_tape, head_tape, actor_tape;
  MlpScratch<T> scratch;
  Bfloat16Scratch rounded_scratch;
  Buffer<T> inputs, raw, repeated, squashed, std, actions, entropy, logits;
};

// The continuation's logit where its network gives 0: until it has learnt better,
// everything goes on.
inline constexpr double kFreshLogit = 5;

template <typename T>
struct Agent {
  Agent(const Settings& settings, Index observation_size, Index action_size, std::uint64_t seed);

  // Lays the weights out for products, after parameters have changed.
  void Pack();

  Weights<T> training(Group which, Memory<T>* memory) const {
    return groups[which].training(&memory->rounded_scratch);
  }
  Weights<T> planning(Group which, Memory<T>* memory) const {
    return groups[which].planning(&memory->rounded_scratch);
  }

  // The actor's actions at latents, the mode where noise is empty, into the inputs' last rows.
  void ActAt(const Weights<T>& weights, In<T> latents, In<T> noise, Mat<T> inputs,
             Memory<T>* memory) const;
  // values = the number that a head's bins give at the inputs.
  void Evaluate(const Weights<T>& weights, const Mlp& head, In<T> inputs, Memory<T>* memory,
                Mat<T> values) const;

  // What planners ask, for n columns at once.
  void Encode(In<T> standardised, Memory<T>* memory, Mat<T> latents) const;
  void Imagine(In<T> latents, In<T> actions, Memory<T>* memory, Mat<T> next, Mat<T> rewards,
               double* discounts) const;
  // values: [K, n], at the actor's mode.
  void Values(In<T> latents, Memory<T>* memory, Mat<T> values) const;
  // The mode where noise is empty; else `each` actions a latent, [A, n * each].
  void Act(In<T> latents, Index each, In<T> noise, Memory<T>* memory, Mat<T> actions) const;

  const Settings settings;
  const Index o, a, l;  // sizes of observation, action, latent
  ActorShape shape;
  std::array<ParameterGroup<T>, kGroups> groups = {
      ParameterGroup<T>("encoder"), ParameterGroup<T>("model"), ParameterGroup<T>("critic"),
      ParameterGroup<T>("actor")};
  Mlp encoder, dynamics, reward, continuation, actor;
  std::vector<Mlp> critics;
  SlowCopy<T> target;           // of the critics
  std::uint64_t ends_seen = 0;  // 1: a batch had an episode that ended early
};

}  // namespace dreamsearch::tdmpc
