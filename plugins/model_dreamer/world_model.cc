#include "plugins/model_dreamer/world_model.h"

#include <algorithm>
#include <cmath>

namespace dreamsearch::dreamer {
namespace {

template <typename T>
double Mean(Mat<T> m) {
  double total = 0;
  for (Index j = 0; j < m.cols; ++j) {
    T column = 0;
    for (Index i = 0; i < m.rows; ++i) column += m(i, j);
    total += static_cast<double>(column);
  }
  return total / static_cast<double>(m.size());
}

// Of batch.firsts those of step t.
template <typename T>
View<const Index> FirstsOf(const Sequences<T>& batch, Index t) {
  const Index* begin = std::lower_bound(batch.firsts.begin(), batch.firsts.end(), t * batch.count);
  const Index* end = std::lower_bound(begin, batch.firsts.end(), (t + 1) * batch.count);
  return {begin, static_cast<std::uint64_t>(end - begin)};
}

}  // namespace

template <typename T>
WorldModel<T>::WorldModel(const Settings& settings, Index observation_size, Index action_size)
    : settings_(settings),
      o_(observation_size),
      a_(action_size),
      z_(settings.stochastic),
      d_(settings.deterministic),
      u_(settings.hidden),
      min_std_(static_cast<T>(settings.min_std)) {
  const bool norm = settings.layer_norm;
  const Index state = settings.state_size();
  const Initial head = settings.zero_heads ? Initial::kZero : Initial::kGlorot;
  encoder_ = Mlp(&group_, "encoder", o_, u_, settings.encoder_layers, 0, norm);
  recur_ = Affine(&group_, "recurrence", {z_, a_}, u_);
  recur_activation_ = Activation(&group_, "recurrence", u_, norm);
  gru_input_ = Affine(&group_, "gru.input", {u_}, 3 * d_, Initial::kGlorot, 3);
  gru_recurrent_ = Affine(&group_, "gru.recurrent", {d_}, 3 * d_, Initial::kOrthogonal, 3);
  prior_ = Mlp(&group_, "prior", d_, u_, 1, 2 * z_, norm);
  posterior_hidden_ = Affine(&group_, "posterior.0", {d_, u_}, u_);
  posterior_activation_ = Activation(&group_, "posterior.0", u_, norm);
  posterior_out_ = Affine(&group_, "posterior.out", {u_}, 2 * z_);
  decoder_ = Mlp(&group_, "observation", state, u_, settings.decoder_layers, o_, norm);
  reward_ = Mlp(&group_, "reward", state, u_, settings.reward_layers, 1, norm, head);
  if (settings.continuation) {
    continuation_ =
        Mlp(&group_, "continuation", state, u_, settings.continuation_layers, 1, norm, head);
  }
}

template <typename T>
void WorldModel<T>::Recur(const Weights<T>& p, In<T> state, bool start,
                          const ActivationTape<T>& input, Mat<T> gates,
                          TransitionScratch<T>* scratch, Mat<T> next) const {
  const Index n = next.cols;
  if (!start) recur_.Add(p, 0, ReadStochastic(state), input.output);
  recur_activation_.Forward(p, input);
  const Mat<T> in = scratch->gru_in.Shape(3 * d_, n);
  const Mat<T> rec = scratch->gru_rec.Shape(3 * d_, n);
  gru_input_.Forward(p, input.output, in);
  if (start) {
    gru_recurrent_.Start(p, rec);
  } else {
    gru_recurrent_.Forward(p, ReadDeterministic(state), rec);
  }
  GruForward<T>(in, rec, ReadDeterministic(state), gates, Deterministic(next));
}

template <typename T>
Mat<const T> WorldModel<T>::ReserveStates(const Sequences<T>& batch) {
  const Index b = batch.count;
  const Index n = b * batch.length;
  all_states_ = states_buffer_.Shape(z_ + d_, b + n);
  states_ = all_states_.Cols(b, n);
  return states_;
}

template <typename T>
Mat<T> WorldModel<T>::BeforeOf(const Sequences<T>& batch) {
  const Index n = batch.count * batch.length;
  return batch.firsts.empty() ? all_states_.Cols(0, n) : before_.Shape(z_ + d_, n);
}

template <typename T>
void WorldModel<T>::ForgetBefore(const Sequences<T>& batch, Index t, Mat<T> before) const {
  if (batch.firsts.empty()) return;
  const Index b = batch.count;
  Copy<T>(all_states_.Cols(t * b, b), before.Cols(t * b, b));
  for (const Index column : FirstsOf(batch, t)) SetZero(before.Cols(column, 1));
}

template <typename T>
void WorldModel<T>::Unroll(const Sequences<T>& batch, Progress* known) {
  const ReachAtEnd all_known(known, batch.count * batch.length);
  const Weights<T> p = group_.training(&rounded_scratch_);
  const Index b = batch.count;
  const Index steps = batch.length;
  const Index n = b * steps;
  const bool norm = settings_.layer_norm;

  // What does not depend on the state, for all steps at once.
  encoder_.Reserve(n, &encoder_tape_);
  encoder_.Forward(p, batch.observations, 0, &encoder_tape_, Mat<T>());
  const Mat<T> embedding = encoder_.Last(encoder_tape_);
  const ActivationTape<T> x = recur_buffers_.Shape(u_, n, norm);
  recur_.Start(p, x.output);
  recur_.Add(p, 1, batch.actions, x.output);
  const ActivationTape<T> hidden = posterior_buffers_.Shape(u_, n, norm);
  posterior_hidden_.Start(p, hidden.output);
  posterior_hidden_.Add(p, 1, In<T>(embedding), hidden.output);

  // The recurrence.
  ReserveStates(batch);
  const Mat<T> all = all_states_;
  SetZero(all.Cols(0, b));
  const Mat<T> before = BeforeOf(batch);
  const Mat<T> gates = gates_.Shape(4 * d_, n);
  const Mat<T> q_raw = posterior_raw_.Shape(2 * z_, n);
  const Mat<T> q_std = posterior_std_.Shape(z_, n);
  for (Index t = 0; t < steps; ++t) {
    const Mat<T> next = all.Cols((t + 1) * b, b);
    ForgetBefore(batch, t, before);
    Recur(p, before.Cols(t * b, b), t == 0, x.Cols(t * b, b), gates.Cols(t * b, b), &scratch_,
          next);
    const ActivationTape<T> now = hidden.Cols(t * b, b);
    posterior_hidden_.Add(p, 0, In<T>(Deterministic(next)), now.output);
    posterior_activation_.Forward(p, now);
    posterior_out_.Forward(p, In<T>(now.output), q_raw.Cols(t * b, b));
    GaussianForward<T>(q_raw.Cols(t * b, b), batch.noise.Cols(t * b, b), min_std_,
                       q_std.Cols(t * b, b), Stochastic(next));
    known->Reach((t + 1) * b);
  }
}

template <typename T>
void WorldModel<T>::Fit(const Sequences<T>& batch, FitLosses* losses) {
  const Weights<T> p = group_.training(&rounded_scratch_);
  T* g = group_.gradient();
  const Index b = batch.count;
  const Index steps = batch.length;
  const Index n = b * steps;
  const T mean = T(1) / static_cast<T>(n);
  const bool norm = settings_.layer_norm;

  // What Unroll left.
  const Mat<T> before = BeforeOf(batch);
  const Mat<T> embedding = encoder_.Last(encoder_tape_);
  const ActivationTape<T> x = recur_buffers_.Shape(u_, n, norm);
  const ActivationTape<T> hidden = posterior_buffers_.Shape(u_, n, norm);
  const Mat<T> gates = gates_.Shape(4 * d_, n);
  const Mat<T> q_raw = posterior_raw_.Shape(2 * z_, n);
  const Mat<T> q_std = posterior_std_.Shape(z_, n);

  // Prior and heads.
  const Mat<T> p_raw = prior_raw_.Shape(2 * z_, n);
  const Mat<T> p_std = prior_std_.Shape(z_, n);
  prior_.Reserve(n, &prior_tape_);
  prior_.Forward(p, ReadDeterministic(states_), 0, &prior_tape_, p_raw);
  GaussianForward<T>(p_raw, Mat<T>(), min_std_, p_std, prior_mean_.Shape(z_, n));

  const Mat<T> d_states = d_states_.Shape(z_ + d_, n);
  SetZero(d_states);
  const auto fit_head = [&](const Mlp& head, MlpTape<T>* tape, Mat<T> out, Mat<T> d_out,
                            auto&& error) {
    head.Reserve(n, tape);
    head.Forward(p, In<T>(states_), 0, tape, out);
    const double loss = error(out, d_out) / static_cast<double>(n);
    head.Backward(p, In<T>(states_), 0, *tape, In<T>(d_out), &scratch_.mlp, g, d_states);
    return loss;
  };
  losses->observation =
      fit_head(decoder_, &decoder_tape_, observation_.Shape(o_, n), d_observation_.Shape(o_, n),
               [&](Mat<T> out, Mat<T> d) {
                 return SquaredError<T>(out, batch.observations,
                                        static_cast<T>(settings_.observation_weight) * mean, d);
               });
  losses->reward =
      fit_head(reward_, &reward_tape_, reward_out_.Shape(1, n), d_reward_.Shape(1, n),
               [&](Mat<T> out, Mat<T> d) {
                 return SquaredError<T>(out, batch.rewards,
                                        static_cast<T>(settings_.reward_weight) * mean, d);
               });
  losses->continuation = 0;
  if (settings_.continuation) {
    losses->continuation =
        fit_head(continuation_, &continuation_tape_, continuation_out_.Shape(1, n),
                 d_continuation_.Shape(1, n), [&](Mat<T> out, Mat<T> d) {
                   return BernoulliError<T>(out, batch.continues,
                                            static_cast<T>(settings_.continuation_scale) * mean, d);
                 });
  }

  // The divergence.
  const Mat<T> kl = kl_.Shape(1, n);
  GaussianKl<T>(q_raw, q_std, p_raw, p_std, kl);
  losses->kl = Mean(kl);
  const Mat<T> weight = kl_weight_.Shape(1, n);
  const T free = static_cast<T>(settings_.free_nats);
  double charged = 0;
  for (Index j = 0; j < n; ++j) {
    const T measured = settings_.free_nats_per_step ? kl(0, j) : static_cast<T>(losses->kl);
    weight(0, j) = measured > free ? static_cast<T>(settings_.kl_scale) * mean : T(0);
    // The measured value first: max then passes NaN on.
    charged += static_cast<double>(measured > free || std::isnan(measured) ? measured : free);
  }
  charged /= static_cast<double>(n);
  losses->total = settings_.observation_weight * losses->observation +
                  settings_.reward_weight * losses->reward +
                  settings_.continuation_scale * losses->continuation +
                  settings_.kl_scale * charged;
  losses->prior_std = Mean(p_std);
  losses->posterior_std = Mean(q_std);
  const Mat<T> d_q = d_posterior_.Shape(2 * z_, n);
  const Mat<T> d_p = d_prior_.Shape(2 * z_, n);
  GaussianKlBackward<T>(q_raw, q_std, p_raw, p_std, min_std_, weight,
                        static_cast<T>(settings_.kl_posterior_factor),
                        static_cast<T>(settings_.kl_prior_factor), d_q, d_p);
  prior_.Backward(p, ReadDeterministic(states_), 0, prior_tape_, In<T>(d_p), &scratch_.mlp, g,
                  Deterministic(d_states));

  // Back through time.
  const Mat<T> d_hidden = d_posterior_hidden_.Shape(u_, n);
  const Mat<T> d_in = d_input_.Shape(3 * d_, n);
  const Mat<T> d_rec = d_recurrent_.Shape(3 * d_, n);
  const Mat<T> d_x = d_recur_.Shape(u_, n);
  const Mat<T> d_prev = scratch_.d_prev.Shape(d_, b);
  for (Index t = steps; t-- > 0;) {
    const Mat<T> d_now = d_states.Cols(t * b, b);
    GaussianBackward<T>(q_std.Cols(t * b, b), batch.noise.Cols(t * b, b), min_std_,
                        Stochastic(d_now), d_q.Cols(t * b, b));
    const Mat<T> dh = d_hidden.Cols(t * b, b);
    posterior_out_.SetTransposed(p, 0, In<T>(d_q.Cols(t * b, b)), dh);
    posterior_activation_.Backward(p, hidden.Cols(t * b, b), dh, g);
    posterior_hidden_.AddTransposed(p, 0, In<T>(dh), Deterministic(d_now));
    GruBackward<T>(gates.Cols(t * b, b), Deterministic(before.Cols(t * b, b)), Deterministic(d_now),
                   d_in.Cols(t * b, b), d_rec.Cols(t * b, b), d_prev);
    const Mat<T> dx = d_x.Cols(t * b, b);
    gru_input_.SetTransposed(p, 0, In<T>(d_in.Cols(t * b, b)), dx);
    recur_activation_.Backward(p, x.Cols(t * b, b), dx, g);
    if (t == 0) break;
    const Mat<T> d_before = d_states.Cols((t - 1) * b, b);
    // What begins an episode says nothing of the state that it does not come from.
    const View<const Index> firsts = FirstsOf(batch, t);
    const Mat<T> kept = kept_.Shape(z_ + d_, static_cast<Index>(firsts.size));
    for (Index i = 0; i < kept.cols; ++i) {
      Copy<T>(d_before.Cols(firsts[i] - t * b, 1), kept.Cols(i, 1));
    }
    Add<T>(d_prev, Deterministic(d_before));
    gru_recurrent_.AddTransposed(p, 0, In<T>(d_rec.Cols(t * b, b)), Deterministic(d_before));
    recur_.AddTransposed(p, 0, In<T>(dx), Stochastic(d_before));
    for (Index i = 0; i < kept.cols; ++i) {
      Copy<T>(kept.Cols(i, 1), d_before.Cols(firsts[i] - t * b, 1));
    }
  }

  // The weights' gradients, for all steps at once.
  posterior_out_.AddGradient<T>(p, hidden.output, d_q, g);
  posterior_hidden_.AddOuter<T>(p, 0, ReadDeterministic(states_), d_hidden, g);
  posterior_hidden_.AddOuter<T>(p, 1, embedding, d_hidden, g);
  posterior_hidden_.AddBias<T>(d_hidden, g);
  gru_input_.AddGradient<T>(p, x.output, d_in, g);
  gru_recurrent_.AddGradient<T>(p, Deterministic(before), d_rec, g);
  recur_.AddOuter<T>(p, 0, ReadStochastic(before), d_x, g);
  recur_.AddOuter<T>(p, 1, batch.actions, d_x, g);
  recur_.AddBias<T>(d_x, g);
  const Mat<T> d_embedding = d_embedding_.Shape(u_, n);
  posterior_hidden_.SetTransposed(p, 1, In<T>(d_hidden), d_embedding);
  encoder_.Backward(p, batch.observations, 0, encoder_tape_, In<T>(d_embedding), &scratch_.mlp, g,
                    Mat<T>());
}

template <typename T>
void WorldModel<T>::Reserve(Index columns, TransitionTape<T>* tape) const {
  tape->input = tape->input_buffers.Shape(u_, columns, settings_.layer_norm);
  tape->gates = tape->gates_buffer.Shape(4 * d_, columns);
  tape->prior_raw = tape->raw_buffer.Shape(2 * z_, columns);
  tape->prior_std = tape->std_buffer.Shape(z_, columns);
  prior_.Reserve(columns, &tape->prior);
}

template <typename T>
void WorldModel<T>::Step(const Weights<T>& p, In<T> state, In<T> action, In<T> noise, Index first,
                         TransitionTape<T>* tape, Mat<T> next) const {
  const Index n = state.cols;
  const ActivationTape<T> input = tape->input.Cols(first, n);
  recur_.Start(p, input.output);
  recur_.Add(p, 1, action, input.output);
  Recur(p, state, false, input, tape->gates.Cols(first, n), &tape->scratch, next);
  const Mat<T> raw = tape->prior_raw.Cols(first, n);
  prior_.Forward(p, In<T>(Deterministic(next)), first, &tape->prior, raw);
  GaussianForward<T>(raw, noise, min_std_, tape->prior_std.Cols(first, n), Stochastic(next));
}

template <typename T>
void WorldModel<T>::StepBackward(const Weights<T>& p, In<T> state, In<T> next, In<T> noise,
                                 Index first, TransitionTape<T>* tape, Mat<T> d_next,
                                 Mat<T> d_state, Mat<T> d_action) const {
  TransitionScratch<T>* scratch = &tape->scratch;
  const Index n = state.cols;
  const Mat<T> d_raw = scratch->d_raw.Shape(2 * z_, n);
  SetZero(d_raw);
  GaussianBackward<T>(tape->prior_std.Cols(first, n), noise, min_std_, Stochastic(d_next), d_raw);
  prior_.Backward(p, ReadDeterministic(next), first, tape->prior, In<T>(d_raw), &scratch->mlp,
                  static_cast<T*>(nullptr), Deterministic(d_next));
  const Mat<T> d_in = scratch->d_in.Shape(3 * d_, n);
  const Mat<T> d_rec = scratch->d_rec.Shape(3 * d_, n);
  const Mat<T> d_prev = scratch->d_prev.Shape(d_, n);
  GruBackward<T>(tape->gates.Cols(first, n), ReadDeterministic(state), Deterministic(d_next), d_in,
                 d_rec, d_prev);
  const Mat<T> d_x = scratch->d_x.Shape(u_, n);
  gru_input_.SetTransposed(p, 0, In<T>(d_in), d_x);
  recur_activation_.Backward(p, tape->input.Cols(first, n), d_x, static_cast<T*>(nullptr));
  recur_.SetTransposed(p, 1, In<T>(d_x), d_action);
  if (!d_state) return;
  Add<T>(d_prev, Deterministic(d_state));
  gru_recurrent_.AddTransposed(p, 0, In<T>(d_rec), Deterministic(d_state));
  recur_.AddTransposed(p, 0, In<T>(d_x), Stochastic(d_state));
}

template <typename T>
void WorldModel<T>::Observe(const Weights<T>& p, In<T> previous, In<T> action, In<T> observation,
                            In<T> noise, Mat<T> next) {
  const Index n = previous.cols;
  const bool norm = settings_.layer_norm;
  encoder_.Reserve(n, &encoder_tape_);
  encoder_.Forward(p, observation, 0, &encoder_tape_, Mat<T>());
  const ActivationTape<T> x = recur_buffers_.Shape(u_, n, norm);
  recur_.Start(p, x.output);
  recur_.Add(p, 1, action, x.output);
  Recur(p, previous, false, x, gates_.Shape(4 * d_, n), &scratch_, next);
  const ActivationTape<T> hidden = posterior_buffers_.Shape(u_, n, norm);
  posterior_hidden_.Start(p, hidden.output);
  posterior_hidden_.Add(p, 0, In<T>(Deterministic(next)), hidden.output);
  posterior_hidden_.Add(p, 1, In<T>(encoder_.Last(encoder_tape_)), hidden.output);
  posterior_activation_.Forward(p, hidden);
  const Mat<T> raw = posterior_raw_.Shape(2 * z_, n);
  posterior_out_.Forward(p, In<T>(hidden.output), raw);
  GaussianForward<T>(raw, noise, min_std_, posterior_std_.Shape(z_, n), Stochastic(next));
}

template <typename T>
void WorldModel<T>::Reward(const Weights<T>& p, In<T> states, MlpTape<T>* tape,
                           Mat<T> reward) const {
  reward_.Reserve(states.cols, tape);
  reward_.Forward(p, states, 0, tape, reward);
}

template <typename T>
void WorldModel<T>::Continuation(const Weights<T>& p, In<T> states, MlpTape<T>* tape,
                                 Mat<T> logit) const {
  continuation_.Reserve(states.cols, tape);
  continuation_.Forward(p, states, 0, tape, logit);
}

template <typename T>
void WorldModel<T>::RewardBackward(const Weights<T>& p, In<T> states, const MlpTape<T>& tape,
                                   In<T> d_reward, MlpScratch<T>* scratch, Mat<T> d_states) const {
  reward_.Backward(p, states, 0, tape, d_reward, scratch, static_cast<T*>(nullptr), d_states);
}

template <typename T>
void WorldModel<T>::ContinuationBackward(const Weights<T>& p, In<T> states, const MlpTape<T>& tape,
                                         In<T> d_logit, MlpScratch<T>* scratch,
                                         Mat<T> d_states) const {
  continuation_.Backward(p, states, 0, tape, d_logit, scratch, static_cast<T*>(nullptr), d_states);
}

template class WorldModel<float>;
template class WorldModel<double>;

}  // namespace dreamsearch::dreamer
