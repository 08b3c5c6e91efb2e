// Writes the input of golden.py for every case: write_tdmpc_golden_input FOLDER
//
// Weights are drawn as the learner draws them, moved off their initial values so that zero
// biases and heads hide nothing, and rounded to multiples of 2^-8: exact in float and in
// double, and short as text. The slow critics are moved once more.
#include <cstdio>
#include <stdexcept>
#include <string>

#include "tests/plugins/model_tdmpc/golden/golden_data.h"

namespace dreamsearch::tdmpc {
namespace {

constexpr std::uint64_t kLength = 4;

GoldenCase CaseOf(const std::string& name) {
  const Json small = {{"simplices", 1}, {"encoder_width", 5}, {"width", 6}, {"bins", 21}};
  if (name == "paper") {
    Json changes = small;
    changes.update({{"simplices", 2}, {"critics", 3}, {"bins", 31}, {"entropy_scale", 0.01}});
    return {"paper", changes, kLength};
  }
  // 35 sequences: three lanes of different sizes.
  if (name == "lanes") {
    Json changes = small;
    changes.update({{"layers", 1}});
    return {"fast", changes, 3, 35, 1};
  }
  Json changes = small;
  changes.update({{"encoder_layers", 2},
                  {"encoder_width", 11},
                  {"width", 10},
                  {"layers", 1},
                  {"critics", 3},
                  {"bin_range", 3},
                  {"target", "all"},
                  {"observation_clip", 1.2},
                  {"rho", 0.7},
                  {"consistency_weight", 3},
                  {"reward_weight", 0.8},
                  {"value_weight", 0.6},
                  {"continuation_weight", 0.4},
                  {"lambda", 0.8},
                  {"target_rate", 0.2},
                  {"min_log_std", -3},
                  {"max_log_std", 1},
                  {"entropy_scale", 0.05},
                  {"return_scale_rate", 0.3},
                  {"search_policy_weight", 0.7},
                  {"search_value_weight", 0.4},
                  {"gradient_clip", 0.5}});
  return {"fast", changes, kLength};
}

void Write(const std::string& folder, const std::string& name) {
  Json json = {{"observation_size", kObservationSize}, {"action_size", kActionSize}};
  const GoldenCase golden = CaseOf(name);
  json["settings"] =
      ResolvedSettings(DeclaredParameters(), golden.preset, kNeutral, golden.changes);
  const Settings settings = SettingsFromJson(json["settings"]);
  Learner<double> learner(settings, kObservationSize, kActionSize, 1);
  Agent<double>& agent = learner.agent();
  for (std::size_t g = 0; g < kGroups; ++g) {
    Move(agent.groups[g].values(), agent.groups[g].size(), 11 + g);
  }
  // Values that are apart, so that the return scale counts. In the other
  // cases float would lose too many digits.
  ParameterGroup<double>& critic = agent.groups[kCritic];
  for (Index i = 0; name == "paper" && i < critic.size(); ++i) critic.values()[i] *= 4;
  json["weights"] = Exported(learner);
  Move(critic.values(), critic.size(), 15);
  const Json moved = Exported(learner);
  for (const Tensor& tensor : critic.tensors()) json["target"][tensor.name] = moved[tensor.name];

  json["updates"] = Json::array();
  for (std::uint64_t k = 0; k < golden.updates; ++k) {
    Json update =
        RandomUpdate(golden.sequences, golden.length, kObservationSize, kActionSize, 100 + k);
    // Episodes end in the preset fast only, and not before the second update.
    const bool ends = std::string(golden.preset) == "fast" && k > 0;
    if (!ends) update["discounts"] = std::vector<int>(golden.sequences * golden.length, 1);
    if (ends) update["is_first"][6] = update["is_first"][11] = 1;  // inside two sequences
    if (std::string(golden.preset) == "fast") AddSearches(kActionSize, 200 + k, &update);
    const std::uint64_t seed = update.at("seed");
    const GoldenBatch batch(update, kObservationSize, kActionSize);
    const Status status = learner.Read(batch.view(), seed);
    if (!status.ok()) throw std::runtime_error(status.message);
    const auto sequences = static_cast<Index>(golden.sequences);
    const Index steps = static_cast<Index>(golden.length) - 1;
    update["target_noise"] = Draws(seed, kTargetStream, kActionSize * sequences * steps);
    update["actor_noise"] = Draws(seed, kActorStream, kActionSize * sequences * (steps + 1));
    update["target_critics"] = learner.target_critics();
    json["updates"].push_back(update);
  }
  WriteFile(json, folder + "/" + name + "_input.json");
}

}  // namespace
}  // namespace dreamsearch::tdmpc

int main(int argc, char** argv) {
  return dreamsearch::networks::WriteEveryCase("write_tdmpc_golden_input", argc, argv,
                                               dreamsearch::tdmpc::Write);
}
