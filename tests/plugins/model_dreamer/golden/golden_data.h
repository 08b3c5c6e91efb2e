// golden_data.h - what the golden test and the writer of its input share.
#pragma once

#include <string>
#include <vector>

#include "plugins/model_dreamer/learner.h"
#include "tests/plugins/networks/golden_tools.h"

namespace dreamsearch::dreamer {

// The streams of an update's seed that learner.cc draws its noise from.
inline constexpr std::uint64_t kPosteriorStream = 1;
inline constexpr std::uint64_t kLatentStream = 3;
inline constexpr std::uint64_t kActionStream = 4;

// What golden.py need not know: the weights are given, and one critic is trained.
inline const std::vector<std::string> kNeutral = {
    "zero_heads",         "acting_latent", "imagined_latent", "precision",
    "planning_precision", "critics",       "value_in_dreams", "actor_average"};

// A declared parameter that `values` does not name has its value of the preset
// paper, under which every addition to the method is off. Throws on a name that is
// not declared.
inline Settings SettingsFromJson(const Json& values) {
  const std::vector<ParameterValue> resolved =
      ValuesFromJson(DeclaredParameters(), "paper", values);
  return SettingsFrom({{resolved.data(), resolved.size()}}, true);
}

}  // namespace dreamsearch::dreamer
