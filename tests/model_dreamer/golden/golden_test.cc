// The whole update against PyTorch: forward values, losses and gradients of updates in a
// row (three, but one in the case of many starts), from the weights, batches and draws in
// *_input.json to what golden.py made of them in double (*_output.json); README.md remakes the
// data. The last gradient is compared in full; a third stands on two steps of Adam, the slow critic
// and both moving averages.
//
// Measure: a number differs relative to its golden value, an array by the norm of
// the difference relative to the golden array's norm; a gradient is one array a tensor.
// A mean of terms of either sign, which may nearly cancel, differs relative to the
// mean of their sizes.
// Tolerances: 1e-5 in float, some tens of roundings of 2^-24; 1e-9 in double, of
// which 5e-12 is the data's 12 digits. A step, the change of a tensor over all
// updates, is seen through the parameter, so each update may add half an ulp of it.
// DREAMSEARCH_SHOW_RESIDUALS=1 prints the largest residuals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "golden_data.h"

namespace dreamsearch::dreamer {
namespace {

Json ReadJson(const std::string& name) {
  const std::string path =
      std::string(DREAMSEARCH_SOURCE_DIR) + "/tests/model_dreamer/golden/" + name;
  std::ifstream file(path);
  if (!file) throw std::runtime_error("golden data expected in " + path);
  return Json::parse(file);
}

// A tensor of golden data, flat: row after row.
std::vector<double> Flat(const Json& tensor) {
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

// A dream's returns, tau-major in each block of starts, tau-major over all of them.
template <typename T>
std::vector<double> TauMajor(const std::vector<T>& returns, Index starts, Index horizon) {
  std::vector<double> values;
  for (Index tau = 0; tau < horizon; ++tau) {
    for (Index i = 0; i < starts; ++i) {
      const Index block = i / kStartsPerBlock * kStartsPerBlock;
      const Index count = std::min(kStartsPerBlock, starts - block);
      values.push_back(static_cast<double>(
          returns[static_cast<std::size_t>(block * horizon + tau * count + i - block)]));
    }
  }
  return values;
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

double Norm(const std::vector<double>& values) {
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

void CompareLosses(const std::string& update, const UpdateLosses& found, const Json& golden,
                   Comparison* comparison) {
  const struct {
    const char* name;
    double value;
  } losses[] = {
      {"observation_loss", found.fit.observation},
      {"reward_loss", found.fit.reward},
      {"continuation_loss", found.fit.continuation},
      {"kl", found.fit.kl},
      {"model_loss", found.fit.total},
      {"prior_std", found.fit.prior_std},
      {"posterior_std", found.fit.posterior_std},
      {"actor_loss", found.dream.actor},
      {"value_loss", found.dream.value},
      {"imagined_return", found.dream.imagined_return},
      {"value_mean", found.dream.value_mean},
      {"actor_entropy", found.dream.entropy},
      {"actor_std", found.dream.actor_std},
      {"model_gradient_norm", found.model_gradient_norm},
      {"actor_gradient_norm", found.actor_gradient_norm},
      {"value_gradient_norm", found.value_gradient_norm},
  };
  ASSERT_EQ(golden.at("losses").size(), std::size(losses));
  for (const auto& loss : losses) {
    const double value = golden.at("losses").at(loss.name);
    comparison->Number("losses", update + loss.name, loss.value, value,
                       golden.at("scales").value(loss.name, value));
  }
}

template <typename T>
void CompareUpdates(const std::string& name, double tolerance) {
  const Json input = ReadJson(name + "_input.json");
  const Json golden = ReadJson(name + "_output.json");
  const Index o = input.at("observation_size"), a = input.at("action_size");
  Learner<T> learner(SettingsFromJson(input.at("settings")), o, a, 1);
  ParameterGroup<T>* const groups[] = {&learner.world().group(), &learner.behaviour().actor(),
                                       &learner.behaviour().value()};
  std::size_t tensors = 0;
  for (ParameterGroup<T>* group : groups) {
    for (const Tensor& tensor : group->tensors()) {
      SetTensor(input.at("weights").at(tensor.name), tensor, group->values());
      ++tensors;
    }
  }
  EXPECT_EQ(tensors, input.at("weights").size());
  const ParameterGroup<T>& value = learner.behaviour().value();
  for (const Tensor& tensor : value.tensors()) {
    SetTensor(input.at("slow").at(tensor.name), tensor, learner.behaviour().slow().data());
  }
  learner.PackWeights();

  Comparison comparison(tolerance);
  const std::size_t updates = input.at("updates").size();
  ASSERT_EQ(golden.at("updates").size(), updates);
  for (std::size_t k = 0; k < updates; ++k) {
    const Json& in = input.at("updates")[k];
    const Json& out = golden.at("updates")[k];
    const std::string title = "update " + std::to_string(k + 1) + " ";
    const GoldenBatch batch(in, static_cast<std::uint64_t>(o), static_cast<std::uint64_t>(a));
    Status status = learner.Read(batch.view(), in.at("seed"));
    ASSERT_TRUE(status.ok()) << status.message;
    UpdateLosses losses;
    learner.Gradients(&losses);

    comparison.Array("forward", title + "posterior states", Flat(learner.world().states()),
                     Flat(out.at("posterior_states")));
    const auto starts = static_cast<Index>(in.at("starts").size());
    if (starts <= kStartsPerBlock) {
      const DreamStops<T> dream = learner.behaviour().Stops();
      comparison.Array("forward", title + "dream states",
                       {dream.states.begin(), dream.states.end()}, Flat(out.at("dream_states")));
      comparison.Array("forward", title + "dream weights",
                       {dream.weights.begin(), dream.weights.end()}, Flat(out.at("dream_weights")));
    }
    comparison.Array("forward", title + "returns",
                     TauMajor(learner.behaviour().returns(), starts, learner.settings().horizon),
                     Flat(out.at("returns")));
    CompareLosses(title, losses, out, &comparison);
    for (const ParameterGroup<T>* group : groups) {
      for (const Tensor& tensor : group->tensors()) {
        const std::vector<double> gradient = Flat(group->gradient(), tensor);
        const double norm = out.at("gradient_norms").at(tensor.name);
        comparison.Number("gradient norms", title + tensor.name, Norm(gradient), norm, norm);
        if (k + 1 < updates) continue;
        comparison.Array("gradients", title + tensor.name, gradient,
                         Flat(golden.at("gradients").at(tensor.name)));
      }
    }
    status = learner.CheckFinite(losses, k);
    ASSERT_TRUE(status.ok()) << status.message;
    learner.Apply(losses);
  }

  const double rounding =
      static_cast<double>(updates) * static_cast<double>(std::numeric_limits<T>::epsilon()) / 2;
  const auto compare_step = [&](const std::string& kind, const Tensor& tensor, const T* base,
                                const Json& start, double golden_norm) {
    const std::vector<double> before = Flat(start);
    std::vector<double> moved = Flat(base, tensor);
    for (std::size_t i = 0; i < moved.size(); ++i) moved[i] -= before[i];
    comparison.Number(kind, tensor.name, Norm(moved), golden_norm, golden_norm,
                      rounding * Norm(before));
  };
  for (const ParameterGroup<T>* group : groups) {
    for (const Tensor& tensor : group->tensors()) {
      compare_step("step norms", tensor, group->values(), input.at("weights").at(tensor.name),
                   golden.at("step_norms").at(tensor.name));
    }
  }
  for (const Tensor& tensor : value.tensors()) {
    compare_step("slow step norms", tensor, learner.behaviour().slow().data(),
                 input.at("slow").at(tensor.name), golden.at("slow_step_norms").at(tensor.name));
  }
  comparison.Show(name + (sizeof(T) == sizeof(float) ? ", float" : ", double"));
  EXPECT_GT(comparison.compared(), 100 * static_cast<int>(updates));
}

class Golden : public testing::TestWithParam<const char*> {};

// The largest difference of this machine's draws from the golden ones. The draws are
// made in float, and instruction sets round them differently.
double DrawResidual(const Json& input) {
  const Settings settings = SettingsFromJson(input.at("settings"));
  const Index a = input.at("action_size");
  double worst = 0;
  for (const Json& update : input.at("updates")) {
    const auto dreams = static_cast<Index>(update.at("starts").size()) * settings.horizon;
    const Index columns = update.at("sequences").get<Index>() * update.at("length").get<Index>();
    const struct {
      const char* name;
      std::uint64_t stream;
      Index count;
    } noises[] = {{"posterior_noise", kPosteriorStream, settings.stochastic * columns},
                  {"latent_noise", kLatentStream, settings.stochastic * dreams},
                  {"action_noise", kActionStream, a * dreams}};
    for (const auto& noise : noises) {
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

// Six ulp of a draw between 4 and 8.
TEST_P(Golden, DrawsAreTheLearners) {
  EXPECT_LT(DrawResidual(ReadJson(std::string(GetParam()) + "_input.json")), 3e-6);
}

TEST_P(Golden, UpdatesInFloatAgreeWithTorchToOneInAHundredThousand) {
  CompareUpdates<float>(GetParam(), 1e-5);
}

// Where the draws differ by a rounding, ten times that is allowed on top.
TEST_P(Golden, UpdatesInDoubleAgreeWithTorchToOneInABillion) {
  const double draws = DrawResidual(ReadJson(std::string(GetParam()) + "_input.json"));
  CompareUpdates<double>(GetParam(), 1e-9 + 10 * draws);
}

INSTANTIATE_TEST_SUITE_P(Cases, Golden, testing::ValuesIn(kGoldenCases),
                         [](const auto& row) { return std::string(row.param); });

}  // namespace
}  // namespace dreamsearch::dreamer
