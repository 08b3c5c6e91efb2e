// The whole update against PyTorch: latents, targets, losses and gradients of updates in a row
// (three, but one in the case of several lanes), from the weights, batches and draws in
// *_input.json to what golden.py made of them in double (*_output.json); README.md remakes the
// data. The last gradient is compared in full; a third stands on two steps of Adam, the slow
// critics, the statistics and the return scale.
//
// Measures and tolerances are those of tests/plugins/model_dreamer/golden/golden_test.cc: 1e-5 in
// float, 1e-9 in double. DREAMSEARCH_SHOW_RESIDUALS=1 prints the largest residuals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/plugins/model_tdmpc/golden/golden_data.h"

namespace dreamsearch::tdmpc {
namespace {

Json Read(const std::string& name) { return ReadJson("model_tdmpc/golden", name); }

void CompareLosses(const std::string& update, const UpdateLosses& found, const Json& golden,
                   Comparison* comparison) {
  ASSERT_EQ(golden.at("losses").size(), found.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    const double value = golden.at("losses").at(kMetrics[k].name);
    comparison->Number("losses", update + kMetrics[k].name, found[k], value,
                       golden.at("scales").value(kMetrics[k].name, value));
  }
}

template <typename T>
void CompareUpdates(const std::string& name, double tolerance) {
  const Json input = Read(name + "_input.json");
  const Json golden = Read(name + "_output.json");
  const Index o = input.at("observation_size"), a = input.at("action_size");
  Learner<T> learner(SettingsFromJson(input.at("settings")), o, a, 1);
  Agent<T>& agent = learner.agent();
  std::size_t tensors = 0;
  for (ParameterGroup<T>& group : agent.groups) {
    for (const Tensor& tensor : group.tensors()) {
      SetTensor(input.at("weights").at(tensor.name), tensor, group.values());
      ++tensors;
    }
  }
  EXPECT_EQ(tensors, input.at("weights").size());
  const ParameterGroup<T>& critic = agent.groups[kCritic];
  for (const Tensor& tensor : critic.tensors()) {
    SetTensor(input.at("target").at(tensor.name), tensor, agent.target.values().data());
  }
  agent.Pack();

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
    EXPECT_EQ(learner.target_critics(), in.at("target_critics").template get<std::vector<Index>>());
    UpdateLosses losses{};
    learner.Gradients(&losses);

    if (batch.sequences <= static_cast<std::uint64_t>(Learner<T>::kSequencesPerLane)) {
      const Stops<T> stops = learner.stops();
      comparison.Array("forward", title + "latents", {stops.encoded.begin(), stops.encoded.end()},
                       Flat(out.at("latents")));
      comparison.Array("forward", title + "targets", {stops.targets.begin(), stops.targets.end()},
                       Flat(out.at("targets")));
    }
    CompareLosses(title, losses, out, &comparison);
    for (const ParameterGroup<T>& group : agent.groups) {
      for (const Tensor& tensor : group.tensors()) {
        const std::vector<double> gradient = Flat(group.gradient(), tensor);
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
    const double range = out.at("return_range");
    comparison.Number("forward", title + "return range", learner.return_scale().range, range,
                      range);
  }

  const double rounding = static_cast<double>(updates) * RoundingOf<T>();
  for (const ParameterGroup<T>& group : agent.groups) {
    for (const Tensor& tensor : group.tensors()) {
      comparison.Step("step norms", tensor.name, Flat(group.values(), tensor),
                      Flat(input.at("weights").at(tensor.name)),
                      golden.at("step_norms").at(tensor.name), rounding);
    }
  }
  for (const Tensor& tensor : critic.tensors()) {
    comparison.Step("target step norms", tensor.name,
                    Flat(const_cast<const T*>(agent.target.values().data()), tensor),
                    Flat(input.at("target").at(tensor.name)),
                    golden.at("target_step_norms").at(tensor.name), rounding);
  }
  comparison.Show(name + (sizeof(T) == sizeof(float) ? ", float" : ", double"));
  EXPECT_GT(comparison.compared(), 80 * static_cast<int>(updates));
}

class Golden : public testing::TestWithParam<const char*> {};

// The largest difference of this machine's draws from the golden ones. The draws are
// made in float, and instruction sets round them differently.
double DrawResidual(const Json& input) {
  double worst = 0;
  for (const Json& update : input.at("updates")) {
    const struct {
      const char* name;
      std::uint64_t stream;
    } noises[] = {{"target_noise", kTargetStream}, {"actor_noise", kActorStream}};
    for (const auto& noise : noises) {
      const std::vector<double> golden = Flat(update.at(noise.name));
      const std::vector<float> draws =
          Draws(update.at("seed"), noise.stream, static_cast<Index>(golden.size()));
      for (std::size_t i = 0; i < golden.size(); ++i) {
        worst = std::max(worst, std::abs(golden[i] - static_cast<double>(draws[i])));
      }
    }
  }
  return worst;
}

// Six ulp of a draw between 4 and 8.
TEST_P(Golden, DrawsAreTheLearners) {
  EXPECT_LT(DrawResidual(Read(std::string(GetParam()) + "_input.json")), 3e-6);
}

TEST_P(Golden, UpdatesInFloatAgreeWithTorchToOneInAHundredThousand) {
  CompareUpdates<float>(GetParam(), 1e-5);
}

// Where the draws differ by a rounding, ten times that is allowed on top.
TEST_P(Golden, UpdatesInDoubleAgreeWithTorchToOneInABillion) {
  const double draws = DrawResidual(Read(std::string(GetParam()) + "_input.json"));
  CompareUpdates<double>(GetParam(), 1e-9 + 10 * draws);
}

INSTANTIATE_TEST_SUITE_P(Cases, Golden, testing::ValuesIn(kGoldenCases),
                         [](const auto& row) { return std::string(row.param); });

}  // namespace
}  // namespace dreamsearch::tdmpc
