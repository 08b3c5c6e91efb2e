#include "plugins/model_tdmpc/lane.h"

#include <algorithm>
#include <cmath>

namespace dreamsearch::tdmpc {
namespace {

template <typename T>
Mat<T> NoiseOf(const Step<T>& step, const Buffer<T>& drawn, Index steps, Lane<T>* lane) {
  const Index a = step.agent->a;
  const auto sequences = static_cast<Index>(step.batch.sequences);
  const Mat<T> whole(drawn.data(), a, steps * sequences);
  const Mat<T> own = lane->noise.Shape(a, steps * lane->count);
  for (Index t = 0; t < steps; ++t) {
    Copy<T>(whole.Cols(t * sequences + lane->first, lane->count),
            own.Cols(t * lane->count, lane->count));
  }
  return own;
}

// The batch's row of a time-major column.
template <typename T>
Index RowOf(const Step<T>& step, const Lane<T>& lane, Index column) {
  return (lane.first + column % lane.count) * (step.horizon + 1) + column / lane.count;
}

template <typename T>
void LearnModel(const Step<T>& step, const Stops<T>* stops, Lane<T>* lane) {
  const Agent<T>& agent = *step.agent;
  const Settings& settings = agent.settings;
  const Index a = agent.a, l = agent.l, horizon = step.horizon;
  UpdateLosses& losses = lane->losses;
  const Index b = lane->count, n = horizon * b;
  const double mean = 1 / std::max(step.all_steps, 1.0);
  const Weights<T> encoder = agent.training(kEncoder, lane), model = agent.training(kModel, lane);
  const Weights<T> critic = agent.training(kCritic, lane);
  const T* decay = lane->step_decay.data();

  // Every observation's latent, then the imagined ones.
  const Mat<T> observations(lane->observations.data(), agent.o, n + b);
  agent.encoder.Reserve(n + b, &lane->encoder_tape);
  agent.encoder.Forward(encoder, observations, 0, &lane->encoder_tape, Mat<T>());
  const Mat<T> encoded = lane->encoded.Shape(l, n + b);
  Copy<T>(agent.encoder.Last(lane->encoder_tape), encoded);
  const Mat<T> inputs(lane->inputs.data(), l + a, n + b);
  const Mat<T> latents = inputs.Rows(0, l);
  Copy<T>(encoded.Cols(0, b), latents.Cols(0, b));
  agent.dynamics.Reserve(n, &lane->dynamics_tape);
  for (Index at = 0; at < n; at += b) {
    agent.dynamics.Forward(model, In<T>(inputs.Cols(at, b)), at, &lane->dynamics_tape, Mat<T>());
    Copy<T>(agent.dynamics.Last(lane->dynamics_tape).Cols(at, b), latents.Cols(at + b, b));
  }
  if (stops != nullptr) std::copy(stops->encoded.begin(), stops->encoded.end(), encoded.data);

  // The critics' targets.
  const Mat<T> next_inputs = lane->next_inputs.Shape(l + a, n);
  Copy<T>(encoded.Cols(b, n), next_inputs.Rows(0, l));
  agent.ActAt(agent.training(kActor, lane), In<T>(encoded.Cols(b, n)),
              NoiseOf(step, step.target_noise, horizon, lane), next_inputs, lane);
  const Mat<T> values = lane->values.Shape(1, n);
  const Mat<T> targets = lane->targets.Shape(1, n);
  for (const Index k : step.target_critics) {
    agent.Evaluate(agent.target.weights(&lane->rounded_scratch),
                   agent.critics[static_cast<std::size_t>(k)], next_inputs, lane, values);
    // The present least first, so that NaN stays.
    for (Index j = 0; j < n; ++j) {
      const bool first = k == step.target_critics.front();
      targets(0, j) = !first && targets(0, j) < values(0, j) ? targets(0, j) : values(0, j);
    }
  }
  const T lambda = static_cast<T>(settings.lambda);
  for (Index j = n - 1; j >= 0; --j) {
    T value = WithSearchValue(step.batch, RowOf(step, *lane, b + j), settings.search_value_weight,
                              targets(0, j));
    if (lambda > 0 && j + b < n && decay[j + b] > 0) {
      value += lambda * (targets(0, j + b) - value);
    }
    targets(0, j) = lane->rewards.data()[j] +
                    static_cast<T>(settings.discount) * lane->continues.data()[j] * value;
  }
  for (Index j = 0; j < n; ++j) {
    if (decay[j] > 0) losses[kTargetMean] += mean * static_cast<double>(targets(0, j));
  }
  if (stops != nullptr) std::copy(stops->targets.begin(), stops->targets.end(), targets.data);

  // The losses, back to the latents.
  const Mat<T> d_inputs = lane->d_inputs.Shape(l + a, n + b);
  const Mat<T> d_latents = d_inputs.Rows(0, l);
  SetZero(d_inputs);
  const Mat<T> weights = lane->weights.Shape(1, n);
  const auto regress = [&](const Mlp& head, const Weights<T>& values_of, Group group, double factor,
                           In<T> numbers) {
    for (Index j = 0; j < n; ++j) {
      weights(0, j) = static_cast<T>(factor * mean) * decay[j];
    }
    const Mat<T> logits = lane->logits.Shape(settings.bins.count, n);
    head.Reserve(n, &lane->head_tape);
    head.Forward(values_of, In<T>(inputs.Cols(0, n)), 0, &lane->head_tape, logits);
    const double loss = TwoHotError<T>(logits, numbers, weights, settings.bins, logits);
    head.Backward(values_of, In<T>(inputs.Cols(0, n)), 0, lane->head_tape, In<T>(logits),
                  &lane->scratch, lane->gradients[group].data(), d_inputs.Cols(0, n));
    return factor > 0 ? loss / factor : 0;
  };
  losses[kRewardLoss] = regress(agent.reward, model, kModel, settings.reward_weight,
                                In<T>(lane->rewards.data(), 1, n));
  for (const Mlp& head : agent.critics) {
    const double share = 1 / static_cast<double>(agent.critics.size());
    losses[kValueLoss] +=
        share * regress(head, critic, kCritic, share * settings.value_weight, targets);
  }
  if (step.ends_seen) {
    const Mat<T> logits = lane->logits.Shape(1, n), d_logits = lane->d_values.Shape(1, n);
    const In<T> arrived = latents.Cols(b, n);
    agent.continuation.Reserve(n, &lane->head_tape);
    agent.continuation.Forward(model, arrived, 0, &lane->head_tape, logits);
    for (Index j = 0; j < n; ++j) logits(0, j) += static_cast<T>(kFreshLogit);
    SetZero(d_logits);
    for (Index j = 0; j < n; ++j) {
      if (decay[j] == 0) continue;
      losses[kContinuationLoss] +=
          mean * BernoulliError<T>(logits.Cols(j, 1), In<T>(lane->continues.data() + j, 1, 1),
                                   static_cast<T>(settings.continuation_weight * mean),
                                   d_logits.Cols(j, 1));
    }
    agent.continuation.Backward(model, arrived, 0, lane->head_tape, In<T>(d_logits), &lane->scratch,
                                lane->gradients[kModel].data(), d_latents.Cols(b, n));
  }

  // Back through time.
  for (Index at = n - b; at >= 0; at -= b) {
    const Mat<T> d_arrived = d_latents.Cols(at + b, b);
    for (Index j = 0; j < b; ++j) {
      const double weight = mean * static_cast<double>(decay[at + j]) / static_cast<double>(l);
      const T slope = static_cast<T>(2 * settings.consistency_weight * weight);
      T squares = 0;
      for (Index i = 0; i < l; ++i) {
        const T difference = latents(i, at + b + j) - encoded(i, at + b + j);
        squares += difference * difference;
        d_arrived(i, j) += slope * difference;
      }
      losses[kConsistencyLoss] += weight * static_cast<double>(squares);
    }
    agent.dynamics.Backward(model, In<T>(inputs.Cols(at, b)), at, lane->dynamics_tape,
                            In<T>(d_arrived), &lane->scratch, lane->gradients[kModel].data(),
                            d_inputs.Cols(at, b));
  }
  agent.encoder.Backward(encoder, In<T>(observations.Cols(0, b)), 0, lane->encoder_tape,
                         In<T>(d_latents.Cols(0, b)), &lane->scratch,
                         lane->gradients[kEncoder].data(), Mat<T>());
}

template <typename T>
void LearnActor(const Step<T>& step, Lane<T>* lane) {
  const Agent<T>& agent = *step.agent;
  const Settings& settings = agent.settings;
  const Index a = agent.a, l = agent.l, horizon = step.horizon;
  UpdateLosses& losses = lane->losses;
  const Index b = lane->count, n = (horizon + 1) * b;
  const double mean = 1 / (step.all_steps + static_cast<double>(step.batch.sequences));
  const Weights<T> actor = agent.training(kActor, lane), critic = agent.training(kCritic, lane);
  const Mat<T> inputs(lane->inputs.data(), l + a, n);
  const Mat<T> noise = NoiseOf(step, step.actor_noise, horizon + 1, lane);
  agent.ActAt(actor, In<T>(inputs.Rows(0, l)), noise, inputs, lane);
  const Mat<T> entropy(lane->entropy.data(), 1, n), std(lane->std.data(), a, n);
  const In<T> squashed(lane->squashed.data(), a, n);
  lane->imitation.Begin(step.batch, agent.shape, a, n);

  // The critics' mean value, and its gradient in the actions.
  const T* decay = lane->latent_decay.data();
  const double scale = 1 / step.return_scale;
  const double bonus = settings.entropy_scale * static_cast<double>(a);
  const double share = 1 / static_cast<double>(agent.critics.size());
  const Mat<T> weights = lane->weights.Shape(1, n);  // of the entropy
  const Mat<T> values = lane->values.Shape(1, n);
  const Mat<T> d_values = lane->d_values.Shape(1, n);
  const Mat<T> d_inputs = lane->d_inputs.Shape(l + a, n);
  SetZero(d_inputs);
  std::fill_n((*step.first_values).begin() + lane->first, b, T(0));
  for (Index j = 0; j < n; ++j) {
    const double weight = mean * static_cast<double>(decay[j]);
    weights(0, j) = static_cast<T>(-weight * bonus);
    d_values(0, j) = static_cast<T>(-weight * scale * share);
    if (decay[j] == 0) continue;
    losses[kActorLoss] -= weight * bonus * static_cast<double>(entropy(0, j));
    losses[kEntropy] += mean * static_cast<double>(entropy(0, j));
    for (Index i = 0; i < a; ++i) {
      losses[kActorStd] += mean * static_cast<double>(std(i, j)) / static_cast<double>(a);
    }
    const Index row = RowOf(step, *lane, j);
    if (!Searched(step.batch, row)) continue;
    const double factor = weight * settings.search_policy_weight;
    const double nll = lane->imitation.Add(row, factor, squashed, std, j);
    losses[kActorLoss] += factor * nll;
    losses[kImitationLoss] += mean * nll;
    losses[kSearched] += mean;
  }
  for (const Mlp& head : agent.critics) {
    agent.Evaluate(critic, head, In<T>(inputs), lane, values);
    const Mat<T> d_logits(lane->logits.data(), settings.bins.count, n);
    for (Index j = 0; j < n; ++j) {
      const double value = static_cast<double>(values(0, j));
      losses[kActorLoss] += static_cast<double>(d_values(0, j)) * value;
      if (decay[j] > 0) losses[kValueMean] += mean * share * value;
      if (j < b) {
        (*step.first_values)[static_cast<std::size_t>(lane->first + j)] +=
            static_cast<T>(share * value);
      }
    }
    TwoHotValueBackward<T>(d_logits, values, d_values, settings.bins, d_logits);
    head.Backward(critic, In<T>(inputs), 0, lane->head_tape, In<T>(d_logits), &lane->scratch,
                  static_cast<T*>(nullptr), d_inputs);
  }
  const Mat<T> d_raw = lane->d_raw.Shape(2 * a, n);
  ActorBackward<T>(squashed, std, In<T>(lane->actions.data(), a, n), noise, agent.shape,
                   d_inputs.Rows(l, a), weights, lane->imitation.gradient(), d_raw);
  agent.actor.Backward(actor, In<T>(inputs.Rows(0, l)), 0, lane->actor_tape, In<T>(d_raw),
                       &lane->scratch, lane->gradients[kActor].data(), Mat<T>());
}

}  // namespace

template <typename T>
void LearnIn(const Step<T>& step, const Stops<T>* stops, Lane<T>* lane) {
  const Agent<T>& agent = *step.agent;
  const Settings& settings = agent.settings;
  const Index a = agent.a, l = agent.l, horizon = step.horizon;
  lane->losses = UpdateLosses();
  for (std::size_t g = 0; g < kGroups; ++g) {
    SetZero(lane->gradients[g].Shape(agent.groups[g].size(), 1));
  }
  // Batch-major rows become time-major columns; what led to an observation belongs to the
  // decision before it.
  const Index b = lane->count, n = horizon * b;
  const Mat<T> observations = lane->observations.Shape(agent.o, n + b);
  const Mat<T> inputs = lane->inputs.Shape(l + a, n + b);
  const Mat<T> rewards = lane->rewards.Shape(1, n);
  const Mat<T> continues = lane->continues.Shape(1, n);
  const Mat<T> step_decay = lane->step_decay.Shape(1, n);
  const Mat<T> latent_decay = lane->latent_decay.Shape(1, n + b);
  for (Index i = 0; i < b; ++i) {
    const Index steps = step.steps[static_cast<std::size_t>(lane->first + i)];
    for (Index t = 0; t <= horizon; ++t) {
      const T decay = static_cast<T>(std::pow(settings.rho, t));
      latent_decay(0, t * b + i) = t <= steps ? decay : T(0);
      if (t < horizon) step_decay(0, t * b + i) = t < steps ? decay : T(0);
      const Index row = (lane->first + i) * (horizon + 1) + t;
      Standardise(*step.statistics, step.standardisation,
                  step.batch.observations.data + row * agent.o, observations.Cols(t * b + i, 1));
      if (t == 0) continue;
      const Index column = (t - 1) * b + i;
      for (Index k = 0; k < a; ++k) {
        inputs(l + k, column) = static_cast<T>(step.batch.actions.data[row * a + k]);
      }
      rewards(0, column) = static_cast<T>(step.batch.rewards.data[row]);
      continues(0, column) = static_cast<T>(step.batch.discounts.data[row]);
    }
  }
  LearnModel(step, stops, lane);
  LearnActor(step, lane);
}

template void LearnIn<float>(const Step<float>&, const Stops<float>*, Lane<float>*);
template void LearnIn<double>(const Step<double>&, const Stops<double>*, Lane<double>*);

}  // namespace dreamsearch::tdmpc
