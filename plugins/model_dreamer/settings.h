// settings.h - the declared parameters of the model and their resolved values.
//
// settings.cc declares each parameter once, with its default (the preset `fast`),
// its value under `paper`, range, unit, help and source. Settings holds the values
// of one model, and none before it is given them.
#pragma once

#include "dreamsearch/settings.h"
#include "plugins/networks/matrix.h"
#include "plugins/networks/presets.h"
#include "plugins/networks/shared_settings.h"

namespace dreamsearch::dreamer {

// The model is written in terms of what learned models share.
using namespace networks;  // NOLINT(google-build-using-namespace)

struct Settings : SharedSettings {
  // Sizes.
  Index deterministic{};  // D
  Index stochastic{};     // Z
  Index hidden{};         // U
  Index encoder_layers{};
  Index decoder_layers{};
  Index reward_layers{};
  Index continuation_layers{};
  Index actor_layers{};
  Index value_layers{};
  Index critics{};  // C
  bool layer_norm{};

  // World model.
  bool normalise_observations{};
  double observation_weight{};
  double reward_weight{};
  double kl_scale{};
  double kl_prior_factor{};
  double kl_posterior_factor{};
  double free_nats{};
  bool free_nats_per_step{};
  double min_std{};
  bool continuation{};
  double continuation_scale{};
  bool zero_heads{};

  // Behaviour.
  Index horizon{};
  Index imagination_starts{};
  Index start_skip{};
  double discount{};
  double lambda{};
  double actor_mean_limit{};
  double actor_initial_std{};
  double actor_min_std{};
  double entropy_scale{};
  bool percentile_return_scale{};
  double return_scale_rate{};
  double value_scale{};
  bool least_of_critics{};
  double slow_critic_weight{};
  double slow_critic_rate{};
  double search_value_weight{};

  // Optimiser.
  double model_learning_rate{};
  double actor_learning_rate{};
  double value_learning_rate{};
  double adam_beta1{};
  double adam_beta2{};
  double adam_epsilon{};
  double gradient_clip{};
  bool bfloat16_planning{};

  // What planners see.
  bool acting_latent_mean{};
  bool imagined_latent_mean{};
  double actor_average{};

  bool averages_actor() const { return actor_average < 1; }
  Index state_size() const { return stochastic + deterministic; }
  bool operator==(const Settings&) const = default;
};

// Every parameter of the component.
View<const ParameterSpec> DeclaredParameters();

// The resolved values of a model of a task that has terminal states or has none.
Settings SettingsFrom(const Parameters& parameters, bool terminates);

// The values of a preset, "fast" or "paper", for a task without terminal states.
Settings PresetSettings(const char* preset);

}  // namespace dreamsearch::dreamer
