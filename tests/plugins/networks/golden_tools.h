// golden_tools.h - what golden tests and the writers of their input share.
//
// A case is a preset with small sizes and a few settings changed. NAME_input.json holds it in
// full: settings by their public names, weights as the model exports them, batches and draws.
// NAME_output.json holds what a golden.py made of it. Over 400 lines: reading, writing and
// comparing go through the same list of fields.
//
// Measure: a number differs relative to its golden value, an array by the norm of
// the difference relative to the golden array's norm; a gradient is one array a tensor.
// A mean of terms of either sign, which may nearly cancel, differs relative to the
// mean of their sizes.
// Tolerances: 1e-5 in float, some tens of roundings of 2^-24; 1e-9 in double, of
// which 5e-12 is the data's 12 digits. A step, the change of a tensor over all
// updates, is seen through the parameter, so each update may add half an ulp of it.
// DREAMSEARCH_SHOW_RESIDUALS=1 prints the largest residuals.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "dreamsearch/model.h"
#include "dreamsearch/random.h"
#include "plugins/networks/layers.h"
#include "plugins/networks/noise.h"
#include "plugins/networks/presets.h"

namespace dreamsearch::networks {

using Json = nlohmann::json;

inline constexpr const char* kGoldenCases[] = {"paper", "fast", "lanes"};
inline constexpr Index kObservationSize = 3;
inline constexpr Index kActionSize = 2;

// What a case changes in its preset: sizes that are no multiple of a vector lane,
// and numbers that make every part of a loss count.
struct GoldenCase {
  const char* preset;
  Json changes;
  std::uint64_t length;  // of a sequence
  std::uint64_t sequences = 3;
  std::uint64_t updates = 3;  // the third sees every moving average move
};

inline Json ReadJson(const std::string& folder, const std::string& name) {
  const std::string path =
      std::string(DREAMSEARCH_SOURCE_DIR) + "/tests/plugins/" + folder + "/" + name;
  std::ifstream file(path);
  if (!file) throw std::runtime_error("golden data expected in " + path);
  return Json::parse(file);
}

// A tensor of golden data, flat: row after row.
inline std::vector<double> Flat(const Json& tensor) {
  std::vector<double> values;
  for (const Json& item : tensor) {
    const std::vector<double> row = item.is_array() ? Flat(item) : std::vector{item.get<double>()};
    values.insert(values.end(), row.begin(), row.end());
  }
  return values;
}

// A tensor of a group, flat as in the golden data; `base` is the group's values or gradient.
template <typename T>
std::vector<double> Flat(const T* base, const Tensor& tensor) {
  const Mat<const T> matrix(base + tensor.offset, tensor.rows, tensor.cols);
  std::vector<double> values;
  for (Index i = 0; i < tensor.rows; ++i) {
    for (Index j = 0; j < tensor.cols; ++j) values.push_back(static_cast<double>(matrix(i, j)));
  }
  return values;
}

template <typename T>
std::vector<double> Flat(const Mat<T>& matrix) {  // column after column
  return {matrix.data, matrix.data + matrix.size()};
}

template <typename T>
void SetTensor(const Json& golden, const Tensor& tensor, T* base) {
  const std::vector<double> values = Flat(golden);
  ASSERT_EQ(values.size(), static_cast<std::size_t>(tensor.rows * tensor.cols)) << tensor.name;
  const Mat<T> matrix(base + tensor.offset, tensor.rows, tensor.cols);
  for (Index i = 0; i < tensor.rows; ++i) {
    for (Index j = 0; j < tensor.cols; ++j) {
      matrix(i, j) = static_cast<T>(values[static_cast<std::size_t>(i * tensor.cols + j)]);
    }
  }
}

inline double Norm(const std::vector<double>& values) {
  double squares = 0;
  for (const double v : values) squares += v * v;
  return std::sqrt(squares);
}

// Compares, and keeps the largest residual of each kind.
class Comparison {
 public:
  explicit Comparison(double tolerance) : tolerance_(tolerance) {}

  // |found - golden| <= tolerance * scale + slack; NaN fails.
  void Number(const std::string& kind, const std::string& name, double found, double golden,
              double scale, double slack = 0) {
    Distance(kind, name, std::abs(found - golden), std::abs(scale), slack);
  }
  void Array(const std::string& kind, const std::string& name, const std::vector<double>& found,
             const std::vector<double>& golden) {
    ASSERT_EQ(found.size(), golden.size()) << kind << " " << name;
    std::vector<double> difference(found);
    for (std::size_t i = 0; i < found.size(); ++i) difference[i] -= golden[i];
    Distance(kind, name, Norm(difference), Norm(golden), 0);
  }
  // The step from `start` to `found`, seen through parameters that are rounded: `rounding` of
  // `start` may be missing.
  void Step(const std::string& kind, const std::string& name, std::vector<double> found,
            const std::vector<double>& start, double golden_norm, double rounding) {
    ASSERT_EQ(found.size(), start.size()) << kind << " " << name;
    for (std::size_t i = 0; i < found.size(); ++i) found[i] -= start[i];
    Number(kind, name, Norm(found), golden_norm, golden_norm, rounding * Norm(start));
  }
  int compared() const { return compared_; }
  void Show(const std::string& title) const {
    if (std::getenv("DREAMSEARCH_SHOW_RESIDUALS") == nullptr) return;
    for (const auto& [kind, residual] : worst_) {
      std::fprintf(stderr, "%-16s %-20s %.2e\n", title.c_str(), kind.c_str(), residual);
    }
  }

 private:
  void Distance(const std::string& kind, const std::string& name, double distance, double scale,
                double slack) {
    ++compared_;
    if (scale > 0) worst_[kind] = std::max(worst_[kind], distance / scale);
    EXPECT_LE(distance, tolerance_ * scale + slack)
        << kind << ": " << name << " is off by " << distance / scale << " of " << scale;
  }

  double tolerance_;
  int compared_ = 0;
  std::map<std::string, double> worst_;
};

// Half an ulp of 1.
template <typename T>
double RoundingOf() {
  return static_cast<double>(std::numeric_limits<T>::epsilon()) / 2;
}

template <typename T>
using Groups = std::vector<ParameterGroup<T>*>;

// Sets every tensor of the groups; `weights` has no others.
template <typename T>
void SetWeights(const Json& weights, const Groups<T>& groups) {
  std::size_t tensors = 0;
  for (ParameterGroup<T>* group : groups) {
    for (const Tensor& tensor : group->tensors()) {
      SetTensor(weights.at(tensor.name), tensor, group->values());
      ++tensors;
    }
  }
  EXPECT_EQ(tensors, weights.size());
}

// Gradients against those of one update, `out`; in full where it is the last.
template <typename T>
void CompareGradients(const std::string& title, const Groups<T>& groups, const Json& out,
                      const Json* last, Comparison* comparison) {
  for (const ParameterGroup<T>* group : groups) {
    for (const Tensor& tensor : group->tensors()) {
      const std::vector<double> gradient = Flat(group->gradient(), tensor);
      const double norm = out.at("gradient_norms").at(tensor.name);
      comparison->Number("gradient norms", title + tensor.name, Norm(gradient), norm, norm);
      if (last == nullptr) continue;
      comparison->Array("gradients", title + tensor.name, gradient, Flat(last->at(tensor.name)));
    }
  }
}

// The steps of a group's tensors, or of a copy of them at `base`, over all updates.
template <typename T>
void CompareSteps(const std::string& kind, const ParameterGroup<T>& group, const T* base,
                  const Json& start, const Json& golden_norms, std::size_t updates,
                  Comparison* comparison) {
  for (const Tensor& tensor : group.tensors()) {
    comparison->Step(kind, tensor.name, Flat(base, tensor), Flat(start.at(tensor.name)),
                     golden_norms.at(tensor.name), static_cast<double>(updates) * RoundingOf<T>());
  }
}

inline std::vector<float> Draws(std::uint64_t update_seed, std::uint64_t stream, Index count) {
  std::vector<float> draws(static_cast<std::size_t>(count));
  FillNormal(DeriveSeed(update_seed, stream), draws.data(), count);
  return draws;
}

// The declared values of `preset`, with those that `values` names instead. Throws on a name
// that is not declared. `values` must stay.
inline std::vector<ParameterValue> ValuesFromJson(View<const ParameterSpec> specs,
                                                  const char* preset, const Json& values) {
  std::vector<ParameterValue> resolved;
  std::size_t named = 0;
  for (const ParameterSpec& spec : specs) {
    ParameterValue value = ValueUnder(spec, preset);
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
  return resolved;
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
        is_first(update.at("is_first")) {
    if (!update.contains("search_candidates")) return;
    search_candidates = update.at("search_candidates");
    search_actions = update.at("search_actions").get<std::vector<float>>();
    search_weights = update.at("search_weights").get<std::vector<float>>();
    search_values = update.at("search_values").get<std::vector<float>>();
  }

  SequenceBatch view() const {
    const std::uint64_t rows = sequences * length;
    return {sequences,
            length,
            {observations.data(), rows, observation_size},
            {actions.data(), rows, action_size},
            {rewards.data(), rewards.size()},
            {discounts.data(), discounts.size()},
            {is_first.data(), is_first.size()},
            search_candidates,
            {search_actions.data(), search_weights.size(), action_size},
            {search_weights.data(), search_weights.size()},
            {search_values.data(), search_values.size()}};
  }

  std::uint64_t sequences, length, observation_size, action_size;
  std::vector<float> observations, actions, rewards, discounts;
  std::vector<std::uint8_t> is_first;
  std::uint64_t search_candidates = 0;
  std::vector<float> search_actions, search_weights, search_values;
};

// Calls compare(title, in, out, last, batch) for each update; `last` holds the golden gradients
// of the last update and is null before it.
template <typename Compare>
void ForEachUpdate(const Json& input, const Json& golden, const Compare& compare) {
  const std::size_t updates = input.at("updates").size();
  ASSERT_EQ(golden.at("updates").size(), updates);
  for (std::size_t k = 0; k < updates; ++k) {
    const Json& in = input.at("updates")[k];
    const GoldenBatch batch(in, input.at("observation_size"), input.at("action_size"));
    compare("update " + std::to_string(k + 1) + " ", in, golden.at("updates")[k],
            k + 1 < updates ? nullptr : &golden.at("gradients"), batch);
    if (testing::Test::HasFatalFailure()) return;
  }
}

// The draws of one update that the data call `name`.
struct Noise {
  const char* name;
  std::uint64_t stream;
  Index count;
};

// The largest difference of this machine's draws from the golden ones. The draws are
// made in float, and instruction sets round them differently.
template <typename NoisesOf>
double DrawResidual(const Json& input, const NoisesOf& noises_of) {
  double worst = 0;
  for (const Json& update : input.at("updates")) {
    for (const Noise& noise : noises_of(update)) {
      const std::vector<double> golden = Flat(update.at(noise.name));
      const std::vector<float> draws = Draws(update.at("seed"), noise.stream, noise.count);
      EXPECT_EQ(golden.size(), draws.size()) << noise.name;
      for (std::size_t i = 0; i < std::min(golden.size(), draws.size()); ++i) {
        worst = std::max(worst, std::abs(golden[i] - static_cast<double>(draws[i])));
      }
    }
  }
  return worst;
}

// Every declared value of a preset by its public name, with the changes; without those that
// `neutral` names: what an update in full precision does not depend on.
inline Json ResolvedSettings(View<const ParameterSpec> specs, const char* preset,
                             const std::vector<std::string>& neutral, const Json& changes) {
  Json settings = Json::object();
  for (const ParameterSpec& spec : specs) {
    if (std::find(neutral.begin(), neutral.end(), spec.name) != neutral.end()) continue;
    const auto [parameter, number, choice] = ValueUnder(spec, preset);
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
      case ParameterType::kText:
      case ParameterType::kPath:
        settings[spec.name] = choice;
        break;
    }
  }
  for (const auto& [name, value] : changes.items()) settings.at(name) = value;
  return settings;
}

inline double Short(double x) { return std::round(x * 256) / 256; }

inline void Move(double* values, Index count, std::uint64_t seed) {
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

template <typename Learner>
Json Exported(const Learner& learner) {
  JsonSink sink;
  const Status status = learner.Export(&sink);
  if (!status.ok()) throw std::runtime_error(status.message);
  return sink.tensors;
}

// Calls write(FOLDER, NAME) for every case; what a writer's main returns.
template <typename Write>
int WriteEveryCase(const char* program, int argc, char** argv, const Write& write) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", program);
    return 2;
  }
  try {
    for (const char* name : kGoldenCases) write(argv[1], name);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", program, error.what());
    return 1;
  }
  return 0;
}

// Draws with some terminal states and, in every other sequence, an episode's start.
// The last observation component deviates less than the floor.
inline Json RandomUpdate(std::uint64_t sequences, std::uint64_t length, Index observation_size,
                         Index action_size, std::uint64_t seed) {
  Random random(seed);
  Json observations, actions, rewards, discounts, is_first;
  for (std::uint64_t b = 0; b < sequences; ++b) {
    for (std::uint64_t t = 0; t < length; ++t) {
      const bool first = b % 2 == 0 && t == 0;
      for (Index i = 0; i < observation_size; ++i) {
        const double scale = i + 1 == observation_size ? 0.004 : 1 + static_cast<double>(i);
        observations.push_back(Short(0.5 + scale * random.Normal()));
      }
      for (Index i = 0; i < action_size; ++i) {
        actions.push_back(first ? 0.0 : Short(random.Uniform(-1, 1)));
      }
      rewards.push_back(first ? 0.0 : Short(random.Uniform(0, 2)));
      discounts.push_back(random.Below(8) == 0 ? 0 : 1);
      is_first.push_back(first ? 1 : 0);
    }
  }
  return {{"seed", seed},           {"sequences", sequences},
          {"length", length},       {"observations", observations},
          {"actions", actions},     {"rewards", rewards},
          {"discounts", discounts}, {"is_first", is_first}};
}

// Searches of an update's rows with three candidates, some of them at the bounds or without
// weight. Every fourth row or so was not searched.
inline void AddSearches(Index action_size, std::uint64_t seed, Json* update) {
  constexpr std::uint64_t kParts = 16;
  Random random(seed);
  Json actions, weights, values;
  for (std::size_t row = 0; row < update->at("rewards").size(); ++row) {
    const bool searched = random.Below(4) != 0;
    const std::uint64_t first = random.Below(kParts), second = random.Below(kParts + 1 - first);
    for (const std::uint64_t part : {first, second, kParts - first - second}) {
      weights.push_back(searched ? static_cast<double>(part) / kParts : 0.0);
      for (Index i = 0; i < action_size; ++i) {
        actions.push_back(std::clamp(Short(random.Uniform(-1.1, 1.1)), -1.0, 1.0));
      }
    }
    values.push_back(searched ? Short(random.Uniform(-2, 6)) : 0.0);
  }
  update->update({{"search_candidates", 3},
                  {"search_actions", actions},
                  {"search_weights", weights},
                  {"search_values", values}});
}

// Objects over several lines, arrays of numbers on one.
inline void Print(const Json& value, const std::string& indent, std::ostream* out) {
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

inline void WriteFile(const Json& json, const std::string& path) {
  std::ofstream file(path);
  Print(json, "", &file);
  file << "\n";
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

}  // namespace dreamsearch::networks
