// settings.h - the declared parameters of the model and their resolved values.
//
// settings.cc declares each parameter once, with its default (the preset `fast`),
// its value under `paper`, range, unit, help and source. Settings holds the values
// of one model, and none before it is given them.
#pragma once

#include "dreamsearch/settings.h"
#include "plugins/networks/categorical.h"
#include "plugins/networks/presets.h"
#include "plugins/networks/shared_settings.h"

namespace dreamsearch::tdmpc {

// The model is written in terms of what learned models share.
using namespace networks;  // NOLINT(google-build-using-namespace)

struct Settings : SharedSettings {
  // Sizes.
  Index simplices{};
  Index latent{};  // L: kSimplex for each simplex
  Index encoder_width{};
  Index encoder_layers{};
  Index width{};
  Index layers{};
  Index critics{};  // K
  Index bin_count{};
  double bin_range{};
  Bins bins;  // from these two

  // Losses.
  bool normalise_observations{};
  double rho{};
  double consistency_weight{};
  double reward_weight{};
  double value_weight{};
  double continuation_weight{};
  double discount{};
  double lambda{};
  bool target_of_all{};
  double target_rate{};
  double min_log_std{};
  double max_log_std{};
  double entropy_scale{};
  double return_scale_rate{};
  double search_value_weight{};

  // Optimiser.
  double learning_rate{};
  double encoder_rate_factor{};
  double actor_learning_rate{};
  double adam_epsilon{};
  double actor_adam_epsilon{};
  double gradient_clip{};
  bool bfloat16_planning{};
};

// Every parameter of the component.
View<const ParameterSpec> DeclaredParameters();

// The resolved values of a model.
Settings SettingsFrom(const Parameters& parameters);

// The values of a preset: "fast" or "paper".
Settings PresetSettings(const char* preset);

}  // namespace dreamsearch::tdmpc
