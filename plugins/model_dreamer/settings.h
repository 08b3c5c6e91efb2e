// settings.h - the declared parameters of the model and their resolved values.
//
// settings.cc declares each parameter once, with its default (the preset `fast`),
// its value under `paper`, range, unit, help and source. Settings holds the values
// of one model.
#pragma once

#include "dreamsearch/parameter.h"
#include "plugins/model_dreamer/matrix.h"

namespace dreamsearch::dreamer {

struct Settings {
  // Sizes.
  Index deterministic = 200;  // D
  Index stochastic = 30;      // Z
  Index hidden = 200;         // U
  Index encoder_layers = 3;
  Index decoder_layers = 2;
  Index reward_layers = 2;
  Index continuation_layers = 3;
  Index actor_layers = 4;
  Index value_layers = 3;
  bool layer_norm = false;

  // World model.
  bool normalise_observations = false;
  double observation_floor = 0.01;
  double observation_clip = 10;
  double observation_weight = 1;
  double reward_weight = 1;
  double kl_scale = 1;
  double kl_prior_factor = 1;
  double kl_posterior_factor = 1;
  double free_nats = 3;
  bool free_nats_per_step = false;
  double min_std = 0.1;
  bool continuation = false;
  double continuation_scale = 10;
  bool zero_heads = false;

  // Behaviour.
  Index horizon = 15;
  Index imagination_starts = 0;
  Index start_skip = 0;
  double discount = 0.99;
  double lambda = 0.95;
  double actor_mean_limit = 5;
  double actor_initial_std = 5;
  double actor_min_std = 1e-4;
  double entropy_scale = 0;
  bool percentile_return_scale = false;
  double return_scale_rate = 0.01;
  double value_scale = 1;
  double slow_critic_weight = 0;
  double slow_critic_rate = 0.02;

  // Optimiser.
  double model_learning_rate = 6e-4;
  double actor_learning_rate = 8e-5;
  double value_learning_rate = 8e-5;
  double adam_beta1 = 0.9;
  double adam_beta2 = 0.999;
  double adam_epsilon = 1e-7;
  double gradient_clip = 100;
  bool bfloat16 = false;
  bool bfloat16_planning = false;

  // What planners see.
  bool acting_latent_sample = true;
  bool imagined_latent_sample = false;

  Index state_size() const { return stochastic + deterministic; }
};

// Every parameter of the component.
View<const ParameterSpec> DeclaredParameters();

// The resolved values of a model.
Settings SettingsFrom(const Parameters& parameters);

// The values of a preset: "fast" or "paper".
Settings PresetSettings(const char* preset);

}  // namespace dreamsearch::dreamer
