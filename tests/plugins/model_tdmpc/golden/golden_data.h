// golden_data.h - what the golden test and the writer of its input share.
#pragma once

#include <string>
#include <vector>

#include "plugins/model_tdmpc/learner.h"
#include "tests/plugins/networks/golden_tools.h"

namespace dreamsearch::tdmpc {

// The streams of an update's seed that learner.cc draws its noise from.
inline constexpr std::uint64_t kTargetStream = 1;
inline constexpr std::uint64_t kActorStream = 2;

// What golden.py need not know: the weights are given.
inline const std::vector<std::string> kNeutral = {"precision", "planning_precision"};

inline Settings SettingsFromJson(const Json& values) {
  const std::vector<ParameterValue> resolved =
      ValuesFromJson(DeclaredParameters(), "paper", values);
  return SettingsFrom({{resolved.data(), resolved.size()}});
}

}  // namespace dreamsearch::tdmpc
