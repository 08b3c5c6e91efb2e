// behaviour.cc - over 400 lines: a dream and the way back through it share every buffer.
#include "plugins/model_dreamer/behaviour.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace dreamsearch::dreamer {
template <typename T>
void LambdaReturns(Index horizon, Index n, T lambda, const T* rewards, const T* discounts,
                   const T* values, T* returns) {
  for (Index tau = horizon; tau-- > 0;) {
    const T* later = tau + 1 == horizon ? values + horizon * n : returns + (tau + 1) * n;
    const T* v = values + (tau + 1) * n;
    for (Index i = 0; i < n; ++i) {
      returns[tau * n + i] = rewards[tau * n + i] +
                             discounts[tau * n + i] * ((T(1) - lambda) * v[i] + lambda * later[i]);
    }
  }
}

template <typename T>
void LambdaReturnsBackward(Index horizon, Index n, T lambda, const T* discounts, const T* values,
                           const T* returns, T* d_returns, T* d_rewards, T* d_discounts,
                           T* d_values) {
  std::fill(d_values, d_values + n, T(0));
  for (Index tau = 0; tau < horizon; ++tau) {
    const bool last = tau + 1 == horizon;
    const T* v = values + (tau + 1) * n;
    const T* later = last ? v : returns + (tau + 1) * n;
    for (Index i = 0; i < n; ++i) {
      const T d = d_returns[tau * n + i];
      const T through = discounts[tau * n + i] * d;
      d_rewards[tau * n + i] = d;
      d_discounts[tau * n + i] = d * ((T(1) - lambda) * v[i] + lambda * later[i]);
      d_values[(tau + 1) * n + i] = (last ? T(1) : T(1) - lambda) * through;
      if (!last) d_returns[(tau + 1) * n + i] += lambda * through;
    }
  }
}

template <typename T>
Behaviour<T>::Behaviour(const Settings& settings, Index action_size)
    : settings_(settings), a_(action_size) {
  const Index state = settings.state_size();
  actor_ =
      Mlp(&actor_group_, "actor", state, settings.hidden, settings.actor_layers, 2 * a_,
          settings.layer_norm, settings.zero_heads ? Initial::kGlorotHundredth : Initial::kGlorot);
  for (Index c = 0; c < settings.critics; ++c) {
    critics_.push_back(Mlp(&value_group_, c == 0 ? "value" : "value" + std::to_string(c), state,
                           settings.hidden, settings.value_layers, 1, settings.layer_norm,
                           settings.zero_heads ? Initial::kZero : Initial::kGlorot));
  }
  for (DreamLane<T>& lane : lane_) lane.value_tapes.resize(critics_.size());
  shape_.mean_limit = settings.actor_mean_limit;
  // softplus(offset) is the initial deviation: offset = ln(e^std - 1).
  shape_.std_offset = std::log(std::expm1(settings.actor_initial_std));
  shape_.min_std = settings.actor_min_std;
}

template <typename T>
void Behaviour<T>::Allocate(std::uint64_t actor_seed, std::uint64_t value_seed, Rounding rounding) {
  actor_group_.Allocate(actor_seed, rounding);
  value_group_.Allocate(value_seed, rounding);
  if (settings_.slow_critic_weight > 0) slow_.Allocate(value_group_, rounding.training);
  ResetSlow();
  if (settings_.averages_actor()) {
    acting_.Allocate(actor_group_, rounding.planning);
    acting_.Reset(actor_group_);
  }
}

template <typename T>
void Behaviour<T>::Pack() {
  actor_group_.Pack();
  value_group_.Pack();
  slow_.Pack();
  acting_.Pack();
}

template <typename T>
Index Behaviour<T>::BeginDream(const DreamInput<T>& input) {
  input_ = input;
  const auto starts = static_cast<Index>(input.starts.size);
  returns_.resize(static_cast<std::size_t>(starts * settings_.horizon));
  const Index blocks = (starts + kStartsPerBlock - 1) / kStartsPerBlock;
  lanes_ = std::min(blocks, kMaxLanes);
  for (Index i = 0; i < lanes_; ++i) {
    DreamLane<T>& lane = lane_[static_cast<std::size_t>(i)];
    lane.first = i * blocks / lanes_ * kStartsPerBlock;
    lane.count = std::min((i + 1) * blocks / lanes_ * kStartsPerBlock, starts) - lane.first;
    lane.dreamt.Reset();
    lane.learnt.Reset();
  }
  return lanes_;
}

template <typename T>
void Behaviour<T>::DreamIn(Index index, const WorldModel<T>& world) {
  DreamLane<T>& lane = lane_[static_cast<std::size_t>(index)];
  const ReachAtEnd dreamt(&lane.dreamt);
  SetZero(lane.actor_gradient.Shape(actor_group_.size(), 1));
  SetZero(lane.value_gradient.Shape(value_group_.size(), 1));
  lane.losses = DreamLosses();
  for (Index done = 0; done < lane.count; done += kStartsPerBlock) {
    if (done > 0) LearnFromBlock(&lane);
    lane.block_first = lane.first + done;
    lane.block_count = std::min(kStartsPerBlock, lane.count - done);
    DreamBlock(world, &lane);
  }
}

template <typename T>
void Behaviour<T>::LearnIn(Index index) {
  DreamLane<T>& lane = lane_[static_cast<std::size_t>(index)];
  const ReachAtEnd learnt(&lane.learnt);
  lane.dreamt.Await(1);
  LearnFromBlock(&lane);
}

template <typename T>
void Behaviour<T>::AddGradients(Buffer<T> DreamLane<T>::*gradient, ParameterGroup<T>* group) {
  for (Index i = 0; i < lanes_; ++i) {
    DreamLane<T>& lane = lane_[static_cast<std::size_t>(i)];
    lane.learnt.Await(1);
    Add<T>(Mat<const T>((lane.*gradient).data(), group->size(), 1),
           Mat<T>(group->gradient(), group->size(), 1));
  }
}

template <typename T>
void Behaviour<T>::AddActorGradients() {
  AddGradients(&DreamLane<T>::actor_gradient, &actor_group_);
}

template <typename T>
void Behaviour<T>::AddValueGradients() {
  AddGradients(&DreamLane<T>::value_gradient, &value_group_);
}

template <typename T>
void Behaviour<T>::EndDream(DreamLosses* losses) {
  *losses = DreamLosses();
  for (Index i = 0; i < lanes_; ++i) {
    const DreamLane<T>& lane = lane_[static_cast<std::size_t>(i)];
    losses->actor += lane.losses.actor;
    losses->value += lane.losses.value;
    losses->imagined_return += lane.losses.imagined_return;
    losses->value_mean += lane.losses.value_mean;
    losses->entropy += lane.losses.entropy;
    losses->actor_std += lane.losses.actor_std;
    losses->imitation += lane.losses.imitation;
    losses->searched += lane.losses.searched;
  }
  const auto starts = static_cast<double>(input_.starts.size);
  const double mean = 1.0 / (starts * static_cast<double>(settings_.horizon));
  losses->actor *= mean;
  losses->value *= mean;
  losses->imagined_return /= starts;
  losses->value_mean *= mean;
  losses->entropy *= mean;
  losses->actor_std *= mean;
  if (losses->searched > 0) losses->imitation /= losses->searched;
  losses->searched /= starts;
}

template <typename T>
void Behaviour<T>::DreamBlock(const WorldModel<T>& world, DreamLane<T>* lane) {
  const DreamInput<T>& input = input_;
  DreamLosses* losses = &lane->losses;
  const Index first = lane->block_first;
  const Index m = lane->block_count;
  const Index horizon = settings_.horizon;
  const Index n = horizon * m;  // decisions of the block, tau-major
  const auto starts = static_cast<Index>(input.starts.size);
  const T mean = T(1) / static_cast<T>(starts * horizon);
  const auto latent_noise = [&](Index tau) {
    return input.latent_noise.Cols(tau * starts + first, m);
  };
  const Mat<T> action_noise = lane->action_noise.Shape(a_, n);
  for (Index tau = 0; tau < horizon; ++tau) {
    Copy<T>(input.action_noise.Cols(tau * starts + first, m), action_noise.Cols(tau * m, m));
  }
  const Weights<T> actor = actor_group_.training(&lane->rounded_scratch);
  const Weights<T> value = value_group_.training(&lane->rounded_scratch);
  const Weights<T> model = world.group().training(&lane->rounded_scratch);

  // Forward.
  const Mat<T> states = lane->states.Shape(settings_.state_size(), n + m);
  const Mat<T> raw = lane->raw.Shape(2 * a_, n);
  const Mat<T> squashed = lane->squashed.Shape(a_, n);
  const Mat<T> std = lane->std.Shape(a_, n);
  const Mat<T> actions = lane->actions.Shape(a_, n);
  const Mat<T> entropy = lane->entropy.Shape(1, n);
  actor_.Reserve(n, &lane->actor_tape);
  world.Reserve(n, &lane->transitions);
  const Index* columns = input.starts.data + first;
  input.known->Await(columns[m - 1] + 1);
  for (Index i = 0; i < m; ++i) {
    Copy<T>(input.states.Cols(columns[i], 1), states.Cols(i, 1));
  }
  for (Index tau = 0; tau < horizon; ++tau) {
    const Index at = tau * m;
    const Mat<T> now = states.Cols(at, m);
    const In<T> seen = input.stops == nullptr
                           ? In<T>(now)
                           : In<T>(input.stops->states.data() + at * now.rows, now.rows, m);
    actor_.Forward(actor, seen, at, &lane->actor_tape, raw.Cols(at, m));
    ActorForward<T>(raw.Cols(at, m), action_noise.Cols(at, m), shape_, squashed.Cols(at, m),
                    std.Cols(at, m), actions.Cols(at, m), entropy.Cols(at, m));
    world.Step(model, now, actions.Cols(at, m), latent_noise(tau), at, &lane->transitions,
               states.Cols(at + m, m));
  }
  const Mat<T> arrived = states.Cols(m, n);
  const Mat<T> rewards = lane->rewards.Shape(1, n);
  world.Reward(model, arrived, &lane->reward_tape, rewards);
  const Mat<T> discounts = lane->discounts.Shape(1, n);
  if (settings_.continuation) {
    const Mat<T> logits = lane->logits.Shape(1, n);
    world.Continuation(model, arrived, &lane->continuation_tape, logits);
    Sigmoid<T>(logits, discounts);
  } else {
    std::fill(discounts.data, discounts.data + n, static_cast<T>(settings_.discount));
  }
  const Mat<T> outputs = lane->outputs.Shape(settings_.critics, n + m);
  for (std::size_t c = 0; c < critics_.size(); ++c) {
    critics_[c].Reserve(n + m, &lane->value_tapes[c]);
    critics_[c].Forward(value, In<T>(states), 0, &lane->value_tapes[c],
                        outputs.Rows(static_cast<Index>(c), 1));
  }
  const T scale = static_cast<T>(settings_.value_scale);
  const Mat<T> values = lane->values.Shape(1, n + m);
  for (Index j = 0; j < n + m; ++j) values(0, j) = scale * OfCritics(outputs.col(j));
  T* returns = returns_.data() + first * horizon;
  const T lambda = static_cast<T>(settings_.lambda);
  LambdaReturns(horizon, m, lambda, rewards.data, discounts.data, values.data, returns);
  const Mat<T> weights = lane->weights.Shape(1, n);
  std::fill(weights.data, weights.data + m, T(1));
  for (Index j = m; j < n; ++j) weights(0, j) = weights(0, j - m) * discounts(0, j - m);
  if (input.stops != nullptr) {
    std::copy(input.stops->weights.begin(), input.stops->weights.end(), weights.data);
  }

  // Back through critic, reward model and dynamics to the actions.
  const T inverse_scale = static_cast<T>(1 / input.return_scale);
  const T bonus = static_cast<T>(settings_.entropy_scale);
  const Mat<T> d_returns = lane->d_returns.Shape(1, n);
  const Mat<T> entropy_weights = lane->entropy_weights.Shape(1, n);
  for (Index j = 0; j < n; ++j) {
    const T w = weights(0, j);
    losses->actor -= static_cast<double>(w * (returns[j] * inverse_scale + bonus * entropy(0, j)));
    d_returns(0, j) = -w * mean * inverse_scale;
    entropy_weights(0, j) = -w * mean * bonus;
    losses->value_mean += static_cast<double>(values(0, j));
    losses->entropy += static_cast<double>(entropy(0, j));
  }
  lane->imitation.Begin(input.batch, shape_, a_, n);
  for (Index j = 0; j < m; ++j) {
    const Index row = RowOf(first + j);
    if (!Searched(input.batch, row)) continue;
    const double factor = settings_.search_policy_weight * static_cast<double>(horizon);
    const double nll = lane->imitation.Add(row, factor * static_cast<double>(mean), In<T>(squashed),
                                           In<T>(std), j);
    losses->actor += factor * nll;  // a sum over H decisions
    losses->imitation += nll;
    losses->searched += 1;
  }
  for (Index j = 0; j < m; ++j) losses->imagined_return += static_cast<double>(returns[j]);
  for (Index j = 0; j < n; ++j) {
    T column = 0;
    for (Index i = 0; i < a_; ++i) column += std(i, j);
    losses->actor_std += static_cast<double>(column / static_cast<T>(a_));
  }
  const Mat<T> d_rewards = lane->d_rewards.Shape(1, n);
  const Mat<T> d_discounts = lane->d_discounts.Shape(1, n);
  const Mat<T> d_values = lane->d_values.Shape(1, n + m);
  LambdaReturnsBackward(horizon, m, lambda, discounts.data, values.data, returns, d_returns.data,
                        d_rewards.data, d_discounts.data, d_values.data);
  for (Index j = 0; j < n + m; ++j) d_values(0, j) *= scale;
  const Mat<T> d_outputs = lane->d_outputs.Shape(settings_.critics, n);
  for (Index j = 0; j < n; ++j) {
    ToCritics(outputs.col(m + j), d_values(0, m + j), d_outputs.col(j));
  }
  const Mat<T> d_states = lane->d_states.Shape(settings_.state_size(), n + m);
  SetZero(d_states);
  const Mat<T> d_arrived = d_states.Cols(m, n);
  world.RewardBackward(model, arrived, lane->reward_tape, d_rewards, &lane->scratch, d_arrived);
  if (settings_.continuation) {
    for (Index j = 0; j < n; ++j) d_discounts(0, j) *= discounts(0, j) * (T(1) - discounts(0, j));
    world.ContinuationBackward(model, arrived, lane->continuation_tape, d_discounts, &lane->scratch,
                               d_arrived);
  }
  for (std::size_t c = 0; c < critics_.size(); ++c) {
    critics_[c].Backward(value, In<T>(arrived), m, lane->value_tapes[c],
                         In<T>(d_outputs.Rows(static_cast<Index>(c), 1)), &lane->scratch,
                         static_cast<T*>(nullptr), d_arrived);
  }
  const Mat<T> d_actions = lane->d_actions.Shape(a_, n);
  for (Index tau = horizon; tau-- > 0;) {
    const Index at = tau * m;
    world.StepBackward(model, states.Cols(at, m), states.Cols(at + m, m), latent_noise(tau), at,
                       &lane->transitions, d_states.Cols(at + m, m),
                       tau > 0 ? d_states.Cols(at, m) : Mat<T>(), d_actions.Cols(at, m));
  }
}

template <typename T>
void Behaviour<T>::LearnFromBlock(DreamLane<T>* lane) {
  const DreamInput<T>& input = input_;
  const Index horizon = settings_.horizon;
  const Index n = horizon * lane->block_count;
  const T mean = T(1) / static_cast<T>(static_cast<Index>(input.starts.size) * horizon);
  const auto left = [&](Buffer<T>& buffer, Index rows) { return Mat<T>(buffer.data(), rows, n); };
  const In<T> states = left(lane->states, settings_.state_size());

  // The actor.
  const Mat<T> d_raw = lane->d_raw.Shape(2 * a_, n);
  ActorBackward<T>(left(lane->squashed, a_), left(lane->std, a_), left(lane->actions, a_),
                   left(lane->action_noise, a_), shape_, left(lane->d_actions, a_),
                   left(lane->entropy_weights, 1), lane->imitation.gradient(), d_raw);
  actor_.Backward(actor_group_.training(&lane->rounded_scratch), states, 0, lane->actor_tape,
                  In<T>(d_raw), &lane->scratch, lane->actor_gradient.data(), Mat<T>());

  // The critics.
  const Mat<T> weights = left(lane->weights, 1);
  const Mat<T> outputs = left(lane->outputs, settings_.critics);
  const T* targets = input.stops != nullptr ? input.stops->targets.data()
                                            : returns_.data() + lane->block_first * horizon;
  const T scale = static_cast<T>(settings_.value_scale);
  const T slow_weight = static_cast<T>(settings_.slow_critic_weight);
  const T share = T(1) / static_cast<T>(settings_.critics);
  const Mat<T> slow = lane->slow_outputs.Shape(1, n);
  const Mat<T> d_output = left(lane->d_values, 1);
  for (std::size_t c = 0; c < critics_.size(); ++c) {
    const Mlp& critic = critics_[c];
    const Mat<T> output = outputs.Rows(static_cast<Index>(c), 1);
    if (slow_weight > 0) {
      critic.Reserve(n, &lane->slow_tape);
      critic.Forward(slow_.weights(&lane->rounded_scratch), states, 0, &lane->slow_tape, slow);
    }
    for (Index j = 0; j < n; ++j) {
      const T target = j < lane->block_count
                           ? WithSearchValue(input.batch, RowOf(lane->block_first + j),
                                             settings_.search_value_weight, targets[j])
                           : targets[j];
      const T error = output(0, j) - target / scale;
      const T drift = slow_weight > 0 ? output(0, j) - slow(0, j) : T(0);
      const T w = share * weights(0, j);
      lane->losses.value +=
          static_cast<double>(w * T(0.5) * (error * error + slow_weight * drift * drift));
      d_output(0, j) = w * mean * (error + slow_weight * drift);
    }
    critic.Backward(value_group_.training(&lane->rounded_scratch), states, 0, lane->value_tapes[c],
                    In<T>(d_output), &lane->scratch, lane->value_gradient.data(), Mat<T>());
  }
}

template <typename T>
T Behaviour<T>::OfCritics(const T* outputs) const {
  const Index c = settings_.critics;
  if (c == 1) return outputs[0];
  if (settings_.least_of_critics) return outputs[LeastOf(outputs)];
  T sum = 0;
  for (Index k = 0; k < c; ++k) sum += outputs[k];
  return sum / static_cast<T>(c);
}

template <typename T>
void Behaviour<T>::ToCritics(const T* outputs, T d_value, T* d_outputs) const {
  const Index c = settings_.critics;
  if (settings_.least_of_critics) {
    std::fill(d_outputs, d_outputs + c, T(0));
    d_outputs[LeastOf(outputs)] = d_value;
  } else {
    std::fill(d_outputs, d_outputs + c, d_value / static_cast<T>(c));
  }
}

template <typename T>
Index Behaviour<T>::LeastOf(const T* outputs) const {
  Index least = 0;
  for (Index k = 1; k < settings_.critics; ++k) {
    if (outputs[k] < outputs[least] || std::isnan(outputs[k])) least = k;
  }
  return least;
}

template <typename T>
DreamStops<T> Behaviour<T>::Stops() const {
  const DreamLane<T>& lane = lane_[0];
  const Index n = lane.count * settings_.horizon;
  return {{lane.states.data(), lane.states.data() + n * settings_.state_size()},
          {lane.weights.data(), lane.weights.data() + n},
          returns_};
}

template <typename T>
void Behaviour<T>::Value(In<T> states, Mat<T> values) {
  for (std::size_t c = 0; c < critics_.size(); ++c) {
    critics_[c].Reserve(states.cols, &value_tape_);
    critics_[c].Forward(value_group_.planning(&rounded_scratch_), states, 0, &value_tape_,
                        values.Rows(static_cast<Index>(c), 1));
  }
  ScaleValues(values);
}

template <typename T>
void Behaviour<T>::Value(In<T> states, std::vector<MlpTape<T>>* tapes, Bfloat16Scratch* rounded,
                         Mat<T> values) const {
  if (tapes->size() != critics_.size()) *tapes = std::vector<MlpTape<T>>(critics_.size());
  for (std::size_t c = 0; c < critics_.size(); ++c) {
    MlpTape<T>* tape = &(*tapes)[c];
    critics_[c].Reserve(states.cols, tape);
    critics_[c].Forward(value_group_.planning(rounded), states, 0, tape,
                        values.Rows(static_cast<Index>(c), 1));
  }
  ScaleValues(values);
}

template <typename T>
void Behaviour<T>::ScaleValues(Mat<T> values) const {
  const T scale = static_cast<T>(settings_.value_scale);
  for (Index j = 0; j < values.cols; ++j) {
    for (Index c = 0; c < values.rows; ++c) values(c, j) *= scale;
  }
}

template <typename T>
void Behaviour<T>::ValueBackward(In<T> states, const std::vector<MlpTape<T>>& tapes, In<T> d_values,
                                 MlpScratch<T>* scratch, Bfloat16Scratch* rounded,
                                 Mat<T> d_states) const {
  const Index n = states.cols;
  const Mat<T> d_outputs(scratch->out.Reserve(n), 1, n);
  const T scale = static_cast<T>(settings_.value_scale);
  for (std::size_t c = 0; c < critics_.size(); ++c) {
    for (Index j = 0; j < n; ++j) d_outputs(0, j) = scale * d_values(static_cast<Index>(c), j);
    critics_[c].Backward(value_group_.planning(rounded), states, 0, tapes[c], In<T>(d_outputs),
                         scratch, static_cast<T*>(nullptr), d_states);
  }
}

template <typename T>
void Behaviour<T>::Act(In<T> states, In<T> noise, Mat<T> actions) {
  const Index n = states.cols;
  const Mat<T> raw = raw_.Shape(2 * a_, n);
  actor_.Reserve(n, &actor_tape_);
  actor_.Forward(settings_.averages_actor() && !noise ? acting_.weights(&rounded_scratch_)
                                                      : actor_group_.planning(&rounded_scratch_),
                 states, 0, &actor_tape_, raw);
  ActorForward<T>(raw, noise, shape_, squashed_.Shape(a_, n), std_.Shape(a_, n), actions, Mat<T>());
}

template <typename T>
void Behaviour<T>::Sample(In<T> states, Index count, In<T> noise, Mat<T> actions) {
  const Index n = states.cols;
  const Mat<T> raw = raw_.Shape(2 * a_, n);
  actor_.Reserve(n, &actor_tape_);
  actor_.Forward(actor_group_.planning(&rounded_scratch_), states, 0, &actor_tape_, raw);
  const Mat<T> repeated = repeated_.Shape(2 * a_, n * count);
  for (Index i = 0; i < n; ++i) {
    for (Index k = 0; k < count; ++k) Copy<T>(raw.Cols(i, 1), repeated.Cols(i * count + k, 1));
  }
  ActorForward<T>(repeated, noise, shape_, squashed_.Shape(a_, n * count),
                  std_.Shape(a_, n * count), actions, Mat<T>());
}

#define DREAMER_INSTANTIATE(T)                                                                  \
  template void LambdaReturns<T>(Index, Index, T, const T*, const T*, const T*, T*);            \
  template void LambdaReturnsBackward<T>(Index, Index, T, const T*, const T*, const T*, T*, T*, \
                                         T*, T*);                                               \
  template class Behaviour<T>;
DREAMER_INSTANTIATE(float)
DREAMER_INSTANTIATE(double)
#undef DREAMER_INSTANTIATE

}  // namespace dreamsearch::dreamer
