#include "plugins/model_dreamer/dreamer.h"

#include <algorithm>
#include <cmath>

namespace dreamsearch::dreamer {
namespace {

constexpr MetricSpec kMetrics[] = {
    {"observation_loss", "",
     "half the squared error of the predicted (standardised) observation, a step"},
    {"reward_loss", "", "half the squared error of the predicted reward, a step"},
    {"continuation_loss", "nats", "cross-entropy of the predicted continuation, a step"},
    {"kl", "nats", "divergence of the posterior from the prior, a step, before free nats"},
    {"model_loss", "", "weighted sum of the world model's losses"},
    {"actor_loss", "", "minus the weighted mean of scaled returns and entropy bonus"},
    {"value_loss", "",
     "weighted mean of half the squared error and the slow critic's part, in units of value_scale"},
    {"model_gradient_norm", "", "of the world model's gradient, before clipping"},
    {"actor_gradient_norm", "", "of the actor's gradient, before clipping"},
    {"value_gradient_norm", "", "of the value's gradient, before clipping"},
    {"imagined_return", "", "mean lambda-return of the dreams' first states"},
    {"value_mean", "", "mean value of the dreamt states"},
    {"actor_entropy", "nats", "mean of minus the log density of the dreamt actions"},
    {"actor_std", "", "mean deviation of the actor before tanh"},
    {"prior_std", "", "mean deviation of the prior"},
    {"posterior_std", "", "mean deviation of the posterior"},
    {"imitation_loss", "nats", "of the search's candidates, mean over the starts searched"},
    {"searched", "", "share of the dreams' starts that were searched"},
};
constexpr std::size_t kMetricCount = sizeof kMetrics / sizeof *kMetrics;

}  // namespace

View<const MetricSpec> DeclaredMetrics() { return {kMetrics, kMetricCount}; }

Dreamer::Dreamer(const Settings& settings, Index observation_size, Index action_size,
                 std::uint64_t seed)
    : FloatModel({.state = settings.state_size(),
                  .observation = observation_size,
                  .action = action_size,
                  .critics = settings.critics,
                  .metrics = kMetricCount,
                  .step_noise = settings.imagined_latent_mean ? 0 : settings.stochastic,
                  .belief_noise = settings.acting_latent_mean ? 0 : settings.stochastic}),
      learner_(settings, observation_size, action_size, seed) {}

void Dreamer::Step(In<float> states, In<float> actions, In<float> noise, Mat<float> next,
                   Mat<float> rewards, double* discounts) {
  const Settings& settings = learner_.settings();
  const Index n = states.cols;
  WorldModel<float>& world = learner_.world();
  const Weights<float> weights = world.group().planning(&rounded_scratch_);
  world.Reserve(n, &transitions_);
  world.Step(weights, states, actions, noise, 0, &transitions_, next);
  world.Reward(weights, next, &head_tape_, rewards);
  if (!settings.continuation) {
    std::fill(discounts, discounts + n, settings.discount);
    return;
  }
  const Mat<float> logits = logits_.Shape(1, n);
  world.Continuation(weights, next, &continuation_tape_, logits);
  for (Index i = 0; i < n; ++i) {
    discounts[i] = 1 / (1 + std::exp(-static_cast<double>(logits(0, i))));
  }
}

void Dreamer::Values(In<float> states, Mat<float> values) {
  learner_.behaviour().Value(states, values);
}

void Dreamer::Act(In<float> states, Index each, In<float> noise, Mat<float> actions) {
  if (noise) {
    learner_.behaviour().Sample(states, each, noise, actions);
  } else {
    learner_.behaviour().Act(states, noise, actions);
  }
}

void Dreamer::Believe(In<float> previous, In<float> actions, const double* observations,
                      In<float> noise, Mat<float> next) {
  const Mat<float> standardised = observations_.Shape(learner_.observation_size(), previous.cols);
  learner_.StandardiseNow(observations, standardised);
  WorldModel<float>& world = learner_.world();
  world.Observe(world.group().exact(), previous, actions, standardised, noise, next);
}

void Dreamer::Follow(In<float> states, In<float> actions, In<float> noise, Mat<float> rewards,
                     double* discounts, Mat<float> values) {
  followed_noise_ = noise;
  followed_.Forward(learner_.settings(), learner_.world(), learner_.behaviour(), states, actions,
                    noise, rewards, discounts, values);
}

void Dreamer::FollowBackward(In<float> d_rewards, In<float> d_discounts, In<float> d_values,
                             Mat<float> d_actions) {
  followed_.Backward(learner_.settings(), learner_.world(), learner_.behaviour(), followed_noise_,
                     d_rewards, d_discounts, d_values, d_actions);
}

Status Dreamer::Update(const TrainRequest& request, double* metrics) {
  UpdateLosses losses;
  const Status status = learner_.Update(request, &losses);
  if (!status.ok()) return status;
  const double values[kMetricCount] = {losses.fit.observation,
                                       losses.fit.reward,
                                       losses.fit.continuation,
                                       losses.fit.kl,
                                       losses.fit.total,
                                       losses.dream.actor,
                                       losses.dream.value,
                                       losses.model_gradient_norm,
                                       losses.actor_gradient_norm,
                                       losses.value_gradient_norm,
                                       losses.dream.imagined_return,
                                       losses.dream.value_mean,
                                       losses.dream.entropy,
                                       losses.dream.actor_std,
                                       losses.fit.prior_std,
                                       losses.fit.posterior_std,
                                       losses.dream.imitation,
                                       losses.dream.searched};
  std::copy(values, values + kMetricCount, metrics);
  return status;
}

Status CreateDreamer(const ModelContext& context, Model** result) noexcept {
  *result = nullptr;
  if (Status status = CheckTask("dreamer", context); !status.ok()) return status;
  return Guarded("dreamer", [&] {
    *result = new Dreamer(SettingsFrom(context.parameters, context.terminates),
                          static_cast<Index>(context.observation_size),
                          static_cast<Index>(context.action_size), context.seed);
    return OkStatus();
  });
}

}  // namespace dreamsearch::dreamer
