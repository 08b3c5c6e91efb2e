// golden_data.h - what the golden test and the writer of its input share.
//
// A case is a preset with small sizes and a few settings changed. NAME_input.json
// holds it in full: settings by their public names, weights as the model exports
// them, batches, draws and starts. NAME_output.json holds what golden.py made of it.
#pragma once

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "dreamsearch/model.h"
#include "dreamsearch/random.h"
#include "plugins/model_dreamer/learner.h"
#include "plugins/networks/noise.h"

namespace dreamsearch::dreamer {

using Json = nlohmann::json;

inline constexpr const char* kGoldenCases[] = {"paper", "fast", "lanes"};

// The streams of an update's seed that learner.cc draws its noise from.
inline constexpr std::uint64_t kPosteriorStream = 1;
inline constexpr std::uint64_t kLatentStream = 3;
inline constexpr std::uint64_t kActionStream = 4;

inline std::vector<float> Draws(std::uint64_t update_seed, std::uint64_t stream, Index count) {
  std::vector<float> draws(static_cast<std::size_t>(count));
  FillNormal(DeriveSeed(update_seed, stream), draws.data(), count);
  return draws;
}

// A declared parameter that `values` does not name has its value of the preset
// paper, under which every addition to the method is off. Throws on a name that is
// not declared.
inline Settings SettingsFromJson(const Json& values) {
  std::vector<ParameterValue> resolved;
  std::size_t named = 0;
  for (const ParameterSpec& spec : DeclaredParameters()) {
    ParameterValue value = ValueUnder(spec, "paper");
    if (const auto found = values.find(spec.name); found != values.end()) {
      ++named;
      if (found->is_string()) {
        value.choice = found->get_ref<const std::string&>().c_str();
      } else {
        value.number = found->is_boolean() ? found->get<bool>() : found->get<double>();
      }
    }
    resolved.push_back(value);
  }
  if (named != values.size()) {
    throw std::runtime_error("golden data names " + std::to_string(values.size()) +
                             " parameters; declared are " + std::to_string(named) + " of them");
  }
  return SettingsFrom({{resolved.data(), resolved.size()}}, true);
}

// One update's batch, in the order of the SDK's SequenceBatch.
struct GoldenBatch {
  GoldenBatch(const Json& update, std::uint64_t o, std::uint64_t a)
      : sequences(update.at("sequences")),
        length(update.at("length")),
        observation_size(o),
        action_size(a),
        observations(update.at("observations")),
        actions(update.at("actions")),
        rewards(update.at("rewards")),
        discounts(update.at("discounts")),
        is_first(update.at("is_first")) {}

  SequenceBatch view() const {
    const std::uint64_t rows = sequences * length;
    return {sequences,
            length,
            {observations.data(), rows, observation_size},
            {actions.data(), rows, action_size},
            {rewards.data(), rewards.size()},
            {discounts.data(), discounts.size()},
            {is_first.data(), is_first.size()}};
  }

  std::uint64_t sequences, length, observation_size, action_size;
  std::vector<float> observations, actions, rewards, discounts;
  std::vector<std::uint8_t> is_first;
};

}  // namespace dreamsearch::dreamer
