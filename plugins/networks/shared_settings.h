// shared_settings.h - the parameters that learned models declare alike: settings of a model derive
// from SharedSettings, and its table of parameters names these where they belong.
#pragma once

#include "dreamsearch/settings.h"

namespace dreamsearch::networks {

struct SharedSettings {
  double observation_floor{};
  double observation_clip{};
  double search_policy_weight{};
  bool bfloat16{};

  bool operator==(const SharedSettings&) const = default;
};

inline constexpr auto kObservationFloorParameter = Bind<&SharedSettings::observation_floor>(
    RealParameter("observation_floor", 0.01, 1e-8, 1e3, "",
                  "Least deviation that an observation is divided by. [ours]"));
inline constexpr auto kObservationClipParameter = Bind<&SharedSettings::observation_clip>(
    RealParameter("observation_clip", 10, 1, 1e6, "deviations",
                  "Standardised observations are clipped to plus and minus this. [ours]"));
inline constexpr auto kSearchPolicyWeightParameter = Bind<&SharedSettings::search_policy_weight>(
    RealParameter("search_policy_weight", 0.1, 0, 1e3, "",
                  "Factor of the actor's imitation of searches (run.search_targets). [ours]"));

// `fallback`: "float" or "bfloat16", what a model learns with unless told otherwise.
constexpr ParameterSpec PrecisionParameter(const char* fallback) {
  return ChoiceParameter("precision", fallback, "float,bfloat16",
                         "Factors of the training's matrix products: float, or rounded to bfloat16 "
                         "where the processor multiplies it (AVX-512 BF16, AMX), with float "
                         "weights and sums. [ours]");
}

}  // namespace dreamsearch::networks
