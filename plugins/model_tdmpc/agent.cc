#include "plugins/model_tdmpc/agent.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "dreamsearch/random.h"

namespace dreamsearch::tdmpc {
namespace {

std::vector<HiddenLayer> Hidden(Index layers, Index width) {
  return std::vector<HiddenLayer>(static_cast<std::size_t>(layers),
                                  {width, Nonlinearity::kNormMish});
}
std::vector<HiddenLayer> HiddenAndLatent(Index layers, Index width, Index latent) {
  std::vector<HiddenLayer> hidden = Hidden(layers, width);
  hidden.push_back({latent, Nonlinearity::kNormSimNorm});
  return hidden;
}

}  // namespace

template <typename T>
Agent<T>::Agent(const Settings& chosen, Index observation_size, Index action_size,
                std::uint64_t seed)
    : settings(chosen), o(observation_size), a(action_size), l(chosen.latent) {
  shape.min_log_std = settings.min_log_std;
  shape.max_log_std = settings.max_log_std;
  constexpr Initial kDrawn = Initial::kNormalFiftieth;
  const Index in = l + a;
  const auto head = [&](Group group, const std::string& name, Index inputs, Index out,
                        Initial last) {
    return Mlp(&groups[group], name, inputs, Hidden(settings.layers, settings.width), out, kDrawn,
               last);
  };
  encoder =
      Mlp(&groups[kEncoder], "encoder", o,
          HiddenAndLatent(settings.encoder_layers, settings.encoder_width, l), 0, kDrawn, kDrawn);
  dynamics = Mlp(&groups[kModel], "dynamics", in,
                 HiddenAndLatent(settings.layers, settings.width, l), 0, kDrawn, kDrawn);
  reward = head(kModel, "reward", in, settings.bins.count, Initial::kZero);
  continuation = head(kModel, "continuation", l, 1, Initial::kZero);
  for (Index k = 0; k < settings.critics; ++k) {
    critics.push_back(
        head(kCritic, "critic" + std::to_string(k), in, settings.bins.count, Initial::kZero));
  }
  actor = head(kActor, "actor", l, 2 * a, kDrawn);
  Rounding rounding;
  if (std::is_same_v<T, float> && Bfloat16Available()) {
    rounding = {settings.bfloat16, settings.bfloat16_planning};
  }
  for (std::size_t g = 0; g < kGroups; ++g) groups[g].Allocate(DeriveSeed(seed, g), rounding);
  target.Allocate(groups[kCritic], rounding.training);
  target.Reset(groups[kCritic]);
  Pack();
}

template <typename T>
void Agent<T>::Pack() {
  for (ParameterGroup<T>& group : groups) group.Pack();
  target.Pack();
}

template <typename T>
void Agent<T>::ActAt(const Weights<T>& weights, In<T> latents, In<T> noise, Mat<T> inputs,
                     Memory<T>* memory) const {
  const Index n = latents.cols;
  const Mat<T> raw = memory->raw.Shape(2 * a, n);
  const Mat<T> actions = memory->actions.Shape(a, n);
  actor.Reserve(n, &memory->actor_tape);
  actor.Forward(weights, latents, 0, &memory->actor_tape, raw);
  ActorForward<T>(raw, noise, shape, memory->squashed.Shape(a, n), memory->std.Shape(a, n), actions,
                  noise ? memory->entropy.Shape(1, n) : Mat<T>());
  Copy<T>(actions, inputs.Rows(l, a));
}

template <typename T>
void Agent<T>::Evaluate(const Weights<T>& weights, const Mlp& head, In<T> inputs, Memory<T>* memory,
                        Mat<T> values) const {
  const Mat<T> logits = memory->logits.Shape(settings.bins.count, inputs.cols);
  head.Reserve(inputs.cols, &memory->head_tape);
  head.Forward(weights, inputs, 0, &memory->head_tape, logits);
  TwoHotValue<T>(logits, settings.bins, logits, values);
}

template <typename T>
void Agent<T>::Encode(In<T> standardised, Memory<T>* memory, Mat<T> latents) const {
  encoder.Reserve(latents.cols, &memory->encoder_tape);
  encoder.Forward(groups[kEncoder].exact(), standardised, 0, &memory->encoder_tape, Mat<T>());
  Copy<T>(encoder.Last(memory->encoder_tape), latents);
}

template <typename T>
void Agent<T>::Imagine(In<T> latents, In<T> actions, Memory<T>* memory, Mat<T> next, Mat<T> rewards,
                       double* discounts) const {
  const Index n = latents.cols;
  const Weights<T> model = planning(kModel, memory);
  const Mat<T> inputs = memory->inputs.Shape(l + a, n);
  Copy<T>(latents, inputs.Rows(0, l));
  Copy<T>(actions, inputs.Rows(l, a));
  dynamics.Reserve(n, &memory->dynamics_tape);
  dynamics.Forward(model, In<T>(inputs), 0, &memory->dynamics_tape, Mat<T>());
  Copy<T>(dynamics.Last(memory->dynamics_tape), next);
  Evaluate(model, reward, In<T>(inputs), memory, rewards);
  std::fill(discounts, discounts + n, settings.discount);
  if (ends_seen == 0) return;
  const Mat<T> logits = memory->logits.Shape(1, n);
  continuation.Reserve(n, &memory->head_tape);
  continuation.Forward(model, In<T>(next), 0, &memory->head_tape, logits);
  for (Index i = 0; i < n; ++i) {
    discounts[i] /= 1 + std::exp(-static_cast<double>(logits(0, i)) - kFreshLogit);
  }
}

template <typename T>
void Agent<T>::Values(In<T> latents, Memory<T>* memory, Mat<T> values) const {
  const Mat<T> inputs = memory->inputs.Shape(l + a, latents.cols);
  Copy<T>(latents, inputs.Rows(0, l));
  ActAt(planning(kActor, memory), latents, Mat<T>(), inputs, memory);
  for (std::size_t k = 0; k < critics.size(); ++k) {
    Evaluate(planning(kCritic, memory), critics[k], In<T>(inputs), memory,
             values.Rows(static_cast<Index>(k), 1));
  }
}

template <typename T>
void Agent<T>::Act(In<T> latents, Index each, In<T> noise, Memory<T>* memory,
                   Mat<T> actions) const {
  const Index n = latents.cols;
  const Mat<T> raw = memory->raw.Shape(2 * a, n);
  actor.Reserve(n, &memory->actor_tape);
  actor.Forward(planning(kActor, memory), latents, 0, &memory->actor_tape, raw);
  const Mat<T> repeated = memory->repeated.Shape(2 * a, n * each);
  for (Index j = 0; j < n * each; ++j) Copy<T>(raw.Cols(j / each, 1), repeated.Cols(j, 1));
  ActorForward<T>(repeated, noise, shape, memory->squashed.Shape(a, n * each),
                  memory->std.Shape(a, n * each), actions, Mat<T>());
}

template struct Agent<float>;
template struct Agent<double>;

}  // namespace dreamsearch::tdmpc
