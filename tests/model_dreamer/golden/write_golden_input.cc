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
#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>

#include "golden_data.h"
#include "results/system/file.h"

namespace dreamsearch::dreamer {
namespace {

constexpr Index kObservationSize = 3;
constexpr Index kActionSize = 2;

// What a case changes in its preset: sizes that are no multiple of a vector lane,
// and figures that make every part of a loss count.
struct Case {
  const char* preset;
  Json changes;
  std::uint64_t sequences = 3;
  std::uint64_t length = 5;
  std::uint64_t updates = 3;  // the third sees both moving averages move
};

Case CaseOf(const std::string& name) {
  if (name == "paper") {
    return {"paper",
            {{"deterministic", 6},
             {"stochastic", 4},
             {"hidden", 10},
             {"horizon", 4},
             {"free_nats", 0.3}}};
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
           {"gradient_clip", 8}}};
}

// What an update in full precision does not depend on; the weights are given.
bool Neutral(const std::string& name) {
  return name == "zero_heads" || name == "acting_latent" || name == "imagined_latent" ||
         name == "precision" || name == "planning_precision";
}

Json ResolvedSettings(const Case& golden) {
  Json settings = Json::object();
  for (const ParameterSpec& spec : DeclaredParameters()) {
    if (Neutral(spec.name)) continue;
    const auto [parameter, number, choice] = ValueUnder(spec, golden.preset);
    switch (spec.type) {
      case ParameterType::kBool:
        settings[spec.name] = number != 0;
        break;
      case ParameterType::kInt:
        settings[spec.name] = static_cast<std::int64_t>(number);
        break;
      case ParameterType::kReal:
        settings[spec.name] = number;
        break;
      case ParameterType::kChoice:
        settings[spec.name] = choice;
        break;
    }
  }
  for (const auto& [name, value] : golden.changes.items()) settings.at(name) = value;
  return settings;
}

double Short(double x) { return std::round(x * 256) / 256; }

void Move(double* values, Index count, std::uint64_t seed) {
  Random random(seed);
  for (Index i = 0; i < count; ++i) values[i] = Short(values[i] + 0.15 * random.Normal());
}

// The tensors of an export as nested arrays, [out, in] as the README of the model says.
class JsonSink final : public TensorSink {
 public:
  Status Tensor(const char* name, View<const std::uint64_t> shape,
                View<const float> values) noexcept override {
    if (std::string(name).starts_with("observation_statistics.")) return OkStatus();
    Json& tensor = tensors[name] = Json::array();
    if (shape.size == 1) {
      for (const float v : values) tensor.push_back(v);
      return OkStatus();
    }
    for (std::uint64_t i = 0; i < shape[0]; ++i) {
      Json row = Json::array();
      for (std::uint64_t j = 0; j < shape[1]; ++j) row.push_back(values[i * shape[1] + j]);
      tensor.push_back(row);
    }
    return OkStatus();
  }
  Json tensors = Json::object();
};

Json Exported(const Learner<double>& learner) {
  JsonSink sink;
  const Status status = learner.Export(&sink);
  if (!status.ok()) throw std::runtime_error(status.message);
  return sink.tensors;
}

// Draws with some terminal states and, in every other sequence, an episode's start.
// The last observation component deviates less than the floor.
Json RandomUpdate(const Case& golden, std::uint64_t seed) {
  Random random(seed);
  Json observations, actions, rewards, discounts, is_first;
  for (std::uint64_t b = 0; b < golden.sequences; ++b) {
    for (std::uint64_t t = 0; t < golden.length; ++t) {
      const bool first = b % 2 == 0 && t == 0;
      for (Index i = 0; i < kObservationSize; ++i) {
        const double scale = i + 1 == kObservationSize ? 0.004 : 1 + static_cast<double>(i);
        observations.push_back(Short(0.5 + scale * random.Normal()));
      }
      for (Index i = 0; i < kActionSize; ++i) {
        actions.push_back(first ? 0.0 : Short(random.Uniform(-1, 1)));
      }
      rewards.push_back(first ? 0.0 : Short(random.Uniform(0, 2)));
      discounts.push_back(random.Below(8) == 0 ? 0 : 1);
      is_first.push_back(first ? 1 : 0);
    }
  }
  return {{"seed", seed},
          {"sequences", golden.sequences},
          {"length", golden.length},
          {"observations", observations},
          {"actions", actions},
          {"rewards", rewards},
          {"discounts", discounts},
          {"is_first", is_first}};
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

// Objects over several lines, arrays of numbers on one.
void Print(const Json& value, const std::string& indent, std::ostream* out) {
  const bool lines = value.is_object() || (value.is_array() && value.front().is_object());
  if (!lines) {
    *out << value.dump();
    return;
  }
  const std::string inner = indent + " ";
  const char* separator = "\n";
  *out << (value.is_object() ? "{" : "[");
  for (const auto& [name, item] : value.items()) {
    *out << separator << inner;
    if (value.is_object()) *out << '"' << name << "\": ";
    Print(item, inner, out);
    separator = ",\n";
  }
  *out << "\n" << indent << (value.is_object() ? "}" : "]");
}

void WriteFile(const Json& json, const std::string& path) {
  std::ofstream file(path);
  Print(json, "", &file);
  file << "\n";
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

void Write(const std::string& folder, const std::string& name) {
  Json json = {{"observation_size", kObservationSize}, {"action_size", kActionSize}};
  const Case golden = CaseOf(name);
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
    Json update = RandomUpdate(golden, 100 + k);
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
  json["settings"] = ResolvedSettings({preset, Json::object()});
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
  const bool preset = argc == 6 && std::string(argv[1]) == "--preset";
  if (argc != 2 && !preset) {
    std::fprintf(stderr,
                 "usage: write_golden_input FOLDER\n"
                 "       write_golden_input --preset PRESET OBSERVATIONS ACTIONS FILE\n");
    return 2;
  }
  try {
    if (preset) {
      dreamsearch::dreamer::WritePreset(argv[2], std::stol(argv[3]), std::stol(argv[4]), argv[5]);
      return 0;
    }
    for (const char* name : dreamsearch::dreamer::kGoldenCases) {
      dreamsearch::dreamer::Write(argv[1], name);
    }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "write_golden_input: %s\n", e.what());
    return 1;
  }
  return 0;
}
