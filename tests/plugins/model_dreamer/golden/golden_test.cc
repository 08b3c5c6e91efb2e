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
#include <string>
#include <vector>

#include "tests/plugins/model_dreamer/golden/golden_data.h"

namespace dreamsearch::dreamer {
namespace {

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
  const Json input = ReadJson("model_dreamer/golden", name + "_input.json");
  const Json golden = ReadJson("model_dreamer/golden", name + "_output.json");
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

  const auto compare_step = [&](const std::string& kind, const Tensor& tensor, const T* base,
                                const Json& start, double golden_norm) {
    comparison.Step(kind, tensor.name, Flat(base, tensor), Flat(start), golden_norm,
                    static_cast<double>(updates) * RoundingOf<T>());
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
  EXPECT_LT(DrawResidual(ReadJson("model_dreamer/golden", std::string(GetParam()) + "_input.json")),
            3e-6);
}

TEST_P(Golden, UpdatesInFloatAgreeWithTorchToOneInAHundredThousand) {
  CompareUpdates<float>(GetParam(), 1e-5);
}

// Where the draws differ by a rounding, ten times that is allowed on top.
TEST_P(Golden, UpdatesInDoubleAgreeWithTorchToOneInABillion) {
  const double draws =
      DrawResidual(ReadJson("model_dreamer/golden", std::string(GetParam()) + "_input.json"));
  CompareUpdates<double>(GetParam(), 1e-9 + 10 * draws);
}

INSTANTIATE_TEST_SUITE_P(Cases, Golden, testing::ValuesIn(kGoldenCases),
                         [](const auto& row) { return std::string(row.param); });

}  // namespace
}  // namespace dreamsearch::dreamer
