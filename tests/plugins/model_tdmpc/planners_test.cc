// Every planner of every built plugin plans on the model, trained for some updates.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "plugins/model_tdmpc/tdmpc.h"
#include "tests/plugins/networks/batches.h"
#include "tests/plugins/owned.h"
#include "tests/plugins/planners/loaded_planner.h"

namespace dreamsearch {
namespace {

// Of a point on a line, see PointBatch.
Model* Trained() {
  static const Owned<Model> model = [] {
    tdmpc::Settings settings = tdmpc::PresetSettings("fast");
    settings.latent = 24;
    settings.encoder_width = settings.width = 20;
    settings.learning_rate = settings.actor_learning_rate = 2e-3;
    Owned<Model> made(new tdmpc::Tdmpc(settings, 2, 1, 1));
    std::vector<double> metrics(tdmpc::kLosses);
    for (std::uint64_t update = 0; update < 400; ++update) {
      const OwnedBatch batch = PointBatch(32, 4, update);
      const SequenceBatch view = batch.view();
      EXPECT_TRUE(made->Train({&view, update, update, 0}, {metrics.data(), metrics.size()}).ok());
    }
    return made;
  }();
  return model.get();
}

class PlannerOnTdmpc : public testing::TestWithParam<const ComponentDescriptor*> {};

// And finds what the model has learnt: from x = 0.6 the way to the reward is to the left, from
// -0.6 to the right.
TEST_P(PlannerOnTdmpc, PushesThePointToTheReward) {
  Model* model = Trained();
  Settings settings;
  for (const ParameterSpec& spec : GetParam()->parameters) {
    const std::string name = spec.name;
    if (name == "candidates") settings.push_back({"candidates", 100});
    if (name == "elites") settings.push_back({"elites", 10});
  }
  LoadedPlanner planner(*GetParam(), model, settings);
  const std::uint64_t bytes = model->latent_bytes();
  std::vector<float> floats(2 * bytes / sizeof(float));
  const Latents initial{reinterpret_cast<std::byte*>(floats.data()), 1, bytes};
  const Latents root{initial.data + bytes, 1, bytes};
  for (const double x : {0.6, -0.6}) {
    ASSERT_TRUE(model->InitialLatent(initial).ok());
    const double observation[] = {x, x * x}, action[] = {0};
    const std::uint64_t seed = 0;
    ASSERT_TRUE(
        model->Observe({initial, {action, 1, 1}, {observation, 1, 2}, {}, {&seed, 1}}, root).ok());
    double mean = 0;
    for (std::uint64_t decision = 0; decision < 8; ++decision) {
      ASSERT_TRUE(planner->BeginEpisode(model).ok());
      const Decision made = planner.Plan(root, {.explore = decision == 7, .seed = decision});
      ASSERT_TRUE(made.status.ok()) << made.status.message;
      EXPECT_LE(std::abs(made.action[0]), 1);
      EXPECT_TRUE(std::isfinite(made.result.value));
      if (decision < 7) mean += made.action[0] / 7;
    }
    EXPECT_LT(mean * x, 0) << "mean action " << mean << " at " << x;
  }
}

INSTANTIATE_TEST_SUITE_P(Planners, PlannerOnTdmpc, testing::ValuesIn(AllPlanners()),
                         [](const auto& test) { return std::string(test.param->name); });

}  // namespace
}  // namespace dreamsearch
