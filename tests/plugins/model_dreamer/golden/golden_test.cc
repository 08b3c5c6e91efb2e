// The whole update against PyTorch: forward values, losses and gradients of updates in a
// row (three, but one in the case of many starts), from the weights, batches and draws in
// *_input.json to what golden.py made of them in double (*_output.json); README.md remakes the
// data. The last gradient is compared in full; a third stands on two steps of Adam, the slow critic
// and both moving averages.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/plugins/model_dreamer/golden/golden_data.h"
#include "tests/plugins/networks/golden_promises.h"

namespace dreamsearch::dreamer {
namespace {

Json Read(const std::string& name) { return ReadJson("model_dreamer/golden", name); }

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
      {"imitation_loss", found.dream.imitation},
      {"searched", found.dream.searched},
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
  const Json input = Read(name + "_input.json");
  const Json golden = Read(name + "_output.json");
  Learner<T> learner(SettingsFromJson(input.at("settings")), input.at("observation_size"),
                     input.at("action_size"), 1);
  Behaviour<T>& behaviour = learner.behaviour();
  const networks::Groups<T> groups = {&learner.world().group(), &behaviour.actor(),
                                      &behaviour.value()};
  networks::SetWeights(input.at("weights"), groups);
  const ParameterGroup<T>& value = behaviour.value();
  for (const Tensor& tensor : value.tensors()) {
    SetTensor(input.at("slow").at(tensor.name), tensor, behaviour.slow().data());
  }
  learner.PackWeights();

  Comparison comparison(tolerance);
  std::size_t updates = 0;
  ForEachUpdate(
      input, golden,
      [&](const std::string& title, const Json& in, const Json& out, const Json* last,
          const GoldenBatch& batch) {
        Status status = learner.Read(batch.view(), in.at("seed"));
        ASSERT_TRUE(status.ok()) << status.message;
        UpdateLosses losses;
        learner.Gradients(&losses);

        comparison.Array("forward", title + "posterior states", Flat(learner.world().states()),
                         Flat(out.at("posterior_states")));
        const auto starts = static_cast<Index>(in.at("starts").size());
        if (starts <= kStartsPerBlock) {
          const DreamStops<T> dream = behaviour.Stops();
          comparison.Array("forward", title + "dream states",
                           {dream.states.begin(), dream.states.end()},
                           Flat(out.at("dream_states")));
          comparison.Array("forward", title + "dream weights",
                           {dream.weights.begin(), dream.weights.end()},
                           Flat(out.at("dream_weights")));
        }
        comparison.Array("forward", title + "returns",
                         TauMajor(behaviour.returns(), starts, learner.settings().horizon),
                         Flat(out.at("returns")));
        CompareLosses(title, losses, out, &comparison);
        CompareGradients(title, groups, out, last, &comparison);
        status = learner.CheckFinite(losses, updates);
        ASSERT_TRUE(status.ok()) << status.message;
        learner.Apply(losses);
        ++updates;
      });

  for (const ParameterGroup<T>* group : groups) {
    CompareSteps<T>("step norms", *group, group->values(), input.at("weights"),
                    golden.at("step_norms"), updates, &comparison);
  }
  CompareSteps<T>("slow step norms", value, behaviour.slow().data(), input.at("slow"),
                  golden.at("slow_step_norms"), updates, &comparison);
  comparison.Show(name + (sizeof(T) == sizeof(float) ? ", float" : ", double"));
  EXPECT_GT(comparison.compared(), 100 * static_cast<int>(updates));
}

double DrawResidual(const Json& input) {
  const Settings settings = SettingsFromJson(input.at("settings"));
  const Index a = input.at("action_size");
  return networks::DrawResidual(input, [&](const Json& update) {
    const auto dreams = static_cast<Index>(update.at("starts").size()) * settings.horizon;
    const Index columns = update.at("sequences").get<Index>() * update.at("length").get<Index>();
    return std::vector<networks::Noise>{
        {"posterior_noise", kPosteriorStream, settings.stochastic * columns},
        {"latent_noise", kLatentStream, settings.stochastic * dreams},
        {"action_noise", kActionStream, a * dreams}};
  });
}

struct DreamerUpdates {
  static constexpr const char* kFolder = "model_dreamer/golden";
  template <typename T>
  static void CompareUpdates(const std::string& name, double tolerance) {
    dreamer::CompareUpdates<T>(name, tolerance);
  }
  static double DrawResidual(const Json& input) { return dreamer::DrawResidual(input); }
  static Json DeclaredSettings() {
    return networks::ResolvedSettings(DeclaredParameters(), "fast", kNeutral, Json::object());
  }
};

}  // namespace
}  // namespace dreamsearch::dreamer

namespace dreamsearch::networks {
INSTANTIATE_TYPED_TEST_SUITE_P(Dreamer, GoldenPromises, dreamer::DreamerUpdates);
}  // namespace dreamsearch::networks
