// The whole update against PyTorch: latents, targets, losses and gradients of updates in a row
// (three, but one in the case of several lanes), from the weights, batches and draws in
// *_input.json to what golden.py made of them in double (*_output.json); README.md remakes the
// data. The last gradient is compared in full; a third stands on two steps of Adam, the slow
// critics, the statistics and the return scale.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/plugins/model_tdmpc/golden/golden_data.h"
#include "tests/plugins/networks/golden_promises.h"

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
  Learner<T> learner(SettingsFromJson(input.at("settings")), input.at("observation_size"),
                     input.at("action_size"), 1);
  Agent<T>& agent = learner.agent();
  networks::Groups<T> groups;
  for (ParameterGroup<T>& group : agent.groups) groups.push_back(&group);
  networks::SetWeights(input.at("weights"), groups);
  const ParameterGroup<T>& critic = agent.groups[kCritic];
  for (const Tensor& tensor : critic.tensors()) {
    SetTensor(input.at("target").at(tensor.name), tensor, agent.target.values().data());
  }
  agent.Pack();

  Comparison comparison(tolerance);
  std::size_t updates = 0;
  ForEachUpdate(
      input, golden,
      [&](const std::string& title, const Json& in, const Json& out, const Json* last,
          const GoldenBatch& batch) {
        Status status = learner.Read(batch.view(), in.at("seed"));
        ASSERT_TRUE(status.ok()) << status.message;
        EXPECT_EQ(learner.target_critics(),
                  in.at("target_critics").template get<std::vector<Index>>());
        UpdateLosses losses{};
        learner.Gradients(&losses);

        if (batch.sequences <= static_cast<std::uint64_t>(Learner<T>::kSequencesPerLane)) {
          const Stops<T> stops = learner.stops();
          comparison.Array("forward", title + "latents",
                           {stops.encoded.begin(), stops.encoded.end()}, Flat(out.at("latents")));
          comparison.Array("forward", title + "targets",
                           {stops.targets.begin(), stops.targets.end()}, Flat(out.at("targets")));
        }
        CompareLosses(title, losses, out, &comparison);
        CompareGradients(title, groups, out, last, &comparison);
        status = learner.CheckFinite(losses, updates);
        ASSERT_TRUE(status.ok()) << status.message;
        learner.Apply(losses);
        const double range = out.at("return_range");
        comparison.Number("forward", title + "return range", learner.return_scale().range, range,
                          range);
        ++updates;
      });

  for (const ParameterGroup<T>* group : groups) {
    CompareSteps<T>("step norms", *group, group->values(), input.at("weights"),
                    golden.at("step_norms"), updates, &comparison);
  }
  CompareSteps<T>("target step norms", critic, agent.target.values().data(), input.at("target"),
                  golden.at("target_step_norms"), updates, &comparison);
  comparison.Show(name + (sizeof(T) == sizeof(float) ? ", float" : ", double"));
  EXPECT_GT(comparison.compared(), 80 * static_cast<int>(updates));
}

double DrawResidual(const Json& input) {
  const Index a = input.at("action_size");
  return networks::DrawResidual(input, [&](const Json& update) {
    const Index sequences = update.at("sequences"), length = update.at("length");
    return std::vector<networks::Noise>{
        {"target_noise", kTargetStream, a * sequences * (length - 1)},
        {"actor_noise", kActorStream, a * sequences * length}};
  });
}

struct TdmpcUpdates {
  static constexpr const char* kFolder = "model_tdmpc/golden";
  template <typename T>
  static void CompareUpdates(const std::string& name, double tolerance) {
    tdmpc::CompareUpdates<T>(name, tolerance);
  }
  static double DrawResidual(const Json& input) { return tdmpc::DrawResidual(input); }
  static Json DeclaredSettings() {
    return networks::ResolvedSettings(DeclaredParameters(), "fast", kNeutral, Json::object());
  }
};

}  // namespace
}  // namespace dreamsearch::tdmpc

namespace dreamsearch::networks {
INSTANTIATE_TYPED_TEST_SUITE_P(Tdmpc, GoldenPromises, tdmpc::TdmpcUpdates);
}  // namespace dreamsearch::networks
