// Writes the input of golden.py for every case: write_golden_input FOLDER
//
//     write_golden_input --preset PRESET OBSERVATIONS ACTIONS FILE
//
// writes a preset as declared, for a task of that size: settings and initial weights,
// no updates (tests/benchmark/peers.sh times updates of it in PyTorch).
//
// Weights are drawn as the learner draws them, moved off their initial values so
// that zero biases and heads hide nothing, and rounded to multiples of 2^-8: exact
// in float and in double, and short as text. The slow critic is moved once more.
#include <algorithm>
#include <cstdio>
#include <stdexcept>
#include <string>

#include "tests/plugins/model_dreamer/golden/golden_data.h"

namespace dreamsearch::dreamer {
namespace {

constexpr std::uint64_t kLength = 5;

GoldenCase CaseOf(const std::string& name) {
  if (name == "paper") {
    return {"paper",
            {{"deterministic", 6},
             {"stochastic", 4},
             {"hidden", 10},
             {"horizon", 4},
             {"free_nats", 0.3}},
            kLength};
  }
  // 225 starts: lanes of one and of two blocks, and a block of one start.
  if (name == "lanes") {
    return {"fast",
            {{"deterministic", 3},
             {"stochastic", 2},
             {"hidden", 5},
             {"encoder_layers", 1},
             {"decoder_layers", 1},
             {"reward_layers", 1},
             {"actor_layers", 1},
             {"value_layers", 1},
             {"horizon", 2},
             {"imagination_starts", 0},
             {"start_skip", 0}},
            15,
            15,
            1};
  }
  return {"fast",
          {{"deterministic", 7},
           {"stochastic", 3},
           {"hidden", 18},
           {"encoder_layers", 1},
           {"decoder_layers", 1},
           {"reward_layers", 1},
           {"continuation_layers", 1},
           {"actor_layers", 2},
           {"value_layers", 1},
           {"norm", "layer"},
           {"horizon", 4},
           {"imagination_starts", 5},
           {"start_skip", 1},
           {"continuation", true},
           {"observation_clip", 1.5},
           {"kl_scale", 0.8},
           {"free_nats", 2.2},
           {"kl_prior_factor", 0.6},
           {"entropy_scale", 0.05},
           {"return_scale_rate", 0.3},
           {"slow_critic_weight", 0.7},
           {"slow_critic_rate", 0.2},
           {"search_policy_weight", 0.7},
           {"search_value_weight", 0.4},
           {"gradient_clip", 8}},
          kLength};
}

Json ResolvedSettings(const GoldenCase& golden) {
  return networks::ResolvedSettings(DeclaredParameters(), golden.preset, kNeutral, golden.changes);
}

// The posterior columns that the learner's dreams began from: all, or found by their values.
Json Starts(const Learner<double>& learner) {
  const Mat<double> posterior = learner.world().states();
  if (learner.settings().imagination_starts == 0 && learner.settings().start_skip == 0) {
    Json all = Json::array();
    for (Index j = 0; j < posterior.cols; ++j) all.push_back(j);
    return all;
  }
  const std::vector<double> dreamt = learner.behaviour().Stops().states;
  const auto horizon = static_cast<std::size_t>(learner.settings().horizon);
  const auto size = static_cast<std::size_t>(posterior.rows);
  const std::size_t count = dreamt.size() / horizon / size;
  Json starts = Json::array();
  for (std::size_t k = 0; k < count; ++k) {
    for (Index j = 0; j < posterior.cols; ++j) {
      const double* column = posterior.col(j);
      if (std::equal(column, column + posterior.rows,
                     dreamt.begin() + static_cast<std::ptrdiff_t>(k * size))) {
        starts.push_back(j);
      }
    }
  }
  if (starts.size() != count) throw std::runtime_error("a start that is no posterior state");
  return starts;
}

void Write(const std::string& folder, const std::string& name) {
  Json json = {{"observation_size", kObservationSize}, {"action_size", kActionSize}};
  const GoldenCase golden = CaseOf(name);
  json["settings"] = ResolvedSettings(golden);
  const Settings settings = SettingsFromJson(json["settings"]);
  Learner<double> learner(settings, kObservationSize, kActionSize, 1);
  ParameterGroup<double>& value = learner.behaviour().value();
  Move(learner.world().group().values(), learner.world().group().size(), 11);
  Move(learner.behaviour().actor().values(), learner.behaviour().actor().size(), 12);
  Move(value.values(), value.size(), 13);
  json["weights"] = Exported(learner);
  Move(value.values(), value.size(), 14);
  const Json moved = Exported(learner);
  for (const Tensor& tensor : value.tensors()) json["slow"][tensor.name] = moved[tensor.name];
  learner.PackWeights();

  json["updates"] = Json::array();
  for (std::uint64_t k = 0; k < golden.updates; ++k) {
    Json update =
        RandomUpdate(golden.sequences, golden.length, kObservationSize, kActionSize, 100 + k);
    if (std::string(golden.preset) == "fast") AddSearches(kActionSize, 200 + k, &update);
    const std::uint64_t seed = update.at("seed");
    const GoldenBatch batch(update, kObservationSize, kActionSize);
    const Status status = learner.Read(batch.view(), seed);
    if (!status.ok()) throw std::runtime_error(status.message);
    UpdateLosses losses;
    learner.Gradients(&losses);
    update["starts"] = Starts(learner);
    const auto dreams = static_cast<Index>(update["starts"].size()) * settings.horizon;
    const auto columns = static_cast<Index>(golden.sequences * golden.length);
    update["posterior_noise"] = Draws(seed, kPosteriorStream, settings.stochastic * columns);
    update["latent_noise"] = Draws(seed, kLatentStream, settings.stochastic * dreams);
    update["action_noise"] = Draws(seed, kActionStream, kActionSize * dreams);
    json["updates"].push_back(update);
  }
  WriteFile(json, folder + "/" + name + "_input.json");
}

void WritePreset(const char* preset, Index observation_size, Index action_size,
                 const std::string& path) {
  if (std::string(preset) != "fast" && std::string(preset) != "paper") {
    throw std::runtime_error("expected the preset fast or paper, found " + std::string(preset));
  }
  Json json = {{"observation_size", observation_size}, {"action_size", action_size}};
  json["settings"] = ResolvedSettings({preset, Json::object(), kLength});
  Learner<double> learner(SettingsFromJson(json["settings"]), observation_size, action_size, 1);
  json["weights"] = Exported(learner);
  for (const Tensor& tensor : learner.behaviour().value().tensors()) {
    json["slow"][tensor.name] = json["weights"][tensor.name];
  }
  WriteFile(json, path);
}

}  // namespace
}  // namespace dreamsearch::dreamer

int main(int argc, char** argv) {
  if (argc != 6 || std::string(argv[1]) != "--preset") {
    return dreamsearch::networks::WriteEveryCase("write_golden_input", argc, argv,
                                                 dreamsearch::dreamer::Write);
  }
  try {
    dreamsearch::dreamer::WritePreset(argv[2], std::stol(argv[3]), std::stol(argv[4]), argv[5]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "write_golden_input: %s\n", e.what());
    return 1;
  }
  return 0;
}
