// The model behind the SDK's interface: the promises of every learned model, and its own.
#include "plugins/model_tdmpc/tdmpc.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/plugins/networks/model_promises.h"

namespace dreamsearch::tdmpc {
namespace {

struct TdmpcCase {
  using Settings = tdmpc::Settings;
  static constexpr std::size_t kSmallState = 24;
  static constexpr const char* kObservationLoss = "consistency_loss";
  static constexpr const char* kRewardLoss = "reward_loss";

  static Settings Small(const char* preset) {
    Settings s = PresetSettings(preset);
    s.latent = static_cast<Index>(kSmallState);
    s.encoder_width = s.width = 20;
    s.critics = 3;
    return s;
  }
  static Settings InLanes() { return Small("fast"); }  // 23 sequences: two lanes
  static Settings AskingForAll(const char* preset) {
    Settings s = PresetSettings(preset);
    s.critics = 2;  // five would take long
    return s;
  }
  static Settings QuickToLearn() {
    Settings s = Small("fast");
    s.learning_rate = s.actor_learning_rate = 2e-3;
    return s;
  }
  static Model* Make(const Settings& settings, Index o, Index a, std::uint64_t seed) {
    return new Tdmpc(settings, o, a, seed);
  }
  static View<const MetricSpec> Metrics() { return ViewOf(kMetrics); }
};

}  // namespace
}  // namespace dreamsearch::tdmpc

namespace dreamsearch {
INSTANTIATE_TYPED_TEST_SUITE_P(Tdmpc, ModelPromises, tdmpc::TdmpcCase);
}  // namespace dreamsearch

namespace dreamsearch::tdmpc {
namespace {

Settings Small() { return TdmpcCase::Small("fast"); }
ModelPointer Make(const Settings& settings, Index o = 2, Index a = 1) {
  return dreamsearch::Make<TdmpcCase>(settings, 1, o, a);
}

TEST(Tdmpc, LoadRefusesOtherSizes) {
  Bytes saved;
  ASSERT_TRUE(Make(Small())->Save(&saved).ok());
  Settings more = Small();
  more.critics += 1;
  ExpectOtherModel(Make(more).get(), saved, "critic size");
}

TEST(Tdmpc, RefusesSequencesOfOneDecision) {
  const ModelPointer model = Make(Small());
  std::vector<double> metrics(kLosses);
  const OwnedBatch batch = PointBatch(4, 1, 1);
  const SequenceBatch view = batch.view();
  const Status status = model->Train({&view, 0, 0, 0}, {metrics.data(), metrics.size()});
  EXPECT_EQ(status.code, StatusCode::kInvalidArgument);
  EXPECT_NE(std::string(status.message).find("run.sequence_length"), std::string::npos)
      << status.message;
}

TEST(Tdmpc, ReportsMeanDeviationAndLeastOfItsCriticsAtTheActorsMode) {
  const ModelPointer model = Make(Small());
  for (std::uint64_t update = 0; update < 20; ++update) {
    Train<TdmpcCase>(model.get(), PointBatch(8, 4, update), update);
  }
  LatentArray latents(*model, 5);
  for (std::size_t i = 0; i < latents.floats().size(); ++i) {
    latents.floats()[i] = 0.02f * static_cast<float>(i % 7);
  }
  std::vector<double> values(5), deviations(5), least(5);
  ASSERT_TRUE(ExtensionOf<ValueSpread>(model.get())
                  ->Spread(latents, {{values.data(), 5}, {deviations.data(), 5}, {least.data(), 5}})
                  .ok());
  Agent<float>& agent = static_cast<Tdmpc*>(model.get())->learner().agent();
  Memory<float> memory;
  Buffer<float> buffers[3];
  const Mat<float> inputs = buffers[0].Shape(agent.l + agent.a, 1);
  const Mat<float> action = buffers[1].Shape(1, 1), value = buffers[2].Shape(1, 1);
  for (Index j = 0; j < 5; ++j) {
    const auto row = static_cast<std::size_t>(j);
    const float* z = latents.floats().data() + j * static_cast<Index>(model->latent_bytes()) / 4;
    Copy<float>(Mat<const float>(z, agent.l, 1), inputs.Rows(0, agent.l));
    agent.Act(inputs.Rows(0, agent.l), 1, Mat<float>(), &memory, action);
    inputs(agent.l, 0) = action(0, 0);
    double mean = 0, squares = 0, low = 1e9;
    for (const Mlp& critic : agent.critics) {
      agent.Evaluate(agent.groups[kCritic].exact(), critic, inputs, &memory, value);
      const auto v = static_cast<double>(value(0, 0));
      mean += v / 3;
      squares += v * v / 3;
      low = std::min(low, v);
    }
    EXPECT_NEAR(values[row], mean, 1e-12);
    EXPECT_NEAR(deviations[row], std::sqrt(squares - mean * mean), 1e-6);
    EXPECT_EQ(least[row], low);
    EXPECT_GT(deviations[row], 1e-6) << "the critics began as different ones";
  }
}

TEST(Tdmpc, DiscountsByGammaUntilAnEpisodeEndsEarlyAndThenByWhatItLearns) {
  Settings settings = Small();
  settings.learning_rate = 3e-3;
  const ModelPointer model = Make(settings);
  Train<TdmpcCase>(model.get(), PointBatch(8, 4, 0), 0);
  for (const double discount : Ask(model.get(), 3, 5).discounts) EXPECT_EQ(discount, 0.99);
  // The end lies to the right of 0.4.
  for (std::uint64_t update = 1; update < 300; ++update) {
    OwnedBatch batch = PointBatch(32, 2, update);
    for (std::size_t row = 0; row < batch.discounts.size(); ++row) {
      if (batch.observations[2 * row] > 0.4f) batch.discounts[row] = 0;
    }
    const std::vector<double> metrics = Train<TdmpcCase>(model.get(), batch, update);
    EXPECT_GT(dreamsearch::Metric<TdmpcCase>(metrics, "continuation_loss"), 0);
  }
  double discounts[2];
  for (const double x : {0.9, -0.9}) {
    LatentArray latent = ObservedPoint(model.get(), x), next(*model, 1);
    const double action[] = {0};
    const std::uint64_t seed = 0;
    double reward = 0;
    ASSERT_TRUE(model
                    ->Imagine({latent, {action, 1, 1}, {&seed, 1}},
                              {next, {&reward, 1}, {&discounts[x < 0], 1}})
                    .ok());
  }
  EXPECT_LT(discounts[0], 0.2);
  EXPECT_GT(discounts[1], 0.9);
}

TEST(Tdmpc, PaperPresetHasFiveMillionParametersAndExportsEachOnce) {
  const ModelPointer model = Make(PresetSettings("paper"), 24, 6);
  Names sink;
  ASSERT_TRUE(ExtensionOf<TensorExport>(model.get())->Export(&sink).ok());
  const auto layer = [](std::uint64_t in, std::uint64_t out) { return in * out + 3 * out; };
  const auto head = [&](std::uint64_t in, std::uint64_t out) {
    return layer(in, 512) + layer(512, 512) + 513 * out;
  };
  const std::uint64_t encoder = layer(24, 256) + layer(256, 512);
  const std::uint64_t dynamics = layer(518, 512) + 2 * layer(512, 512);
  EXPECT_EQ(sink.total,
            encoder + dynamics + 6 * head(518, 101) + head(512, 1) + head(512, 12) + 2 * 24);
  // TD-MPC2 has a continuation only for tasks that end early.
  EXPECT_NEAR(static_cast<double>(sink.total - head(512, 1)), 5e6, 0.1e6);
  EXPECT_EQ(sink.names.front(), "encoder.0.weight");
  std::sort(sink.names.begin(), sink.names.end());
  EXPECT_EQ(std::adjacent_find(sink.names.begin(), sink.names.end()), sink.names.end());
}

TEST(Tdmpc, LearnsAPointOnALine) {
  Settings settings = Small();
  settings.learning_rate = settings.actor_learning_rate = 2e-3;
  const ModelPointer model = Make(settings);
  std::vector<double> first, last;
  for (std::uint64_t update = 0; update < 400; ++update) {
    const auto metrics = Train<TdmpcCase>(model.get(), PointBatch(32, 4, update), update);
    if (update == 0) first = metrics;
    last = metrics;
  }
  for (const char* loss : {"reward_loss", "value_loss"}) {
    EXPECT_LT(dreamsearch::Metric<TdmpcCase>(last, loss),
              0.6 * dreamsearch::Metric<TdmpcCase>(first, loss))
        << loss;
  }
  ExpectActorPushesToTheOrigin(model.get());
}

}  // namespace
}  // namespace dreamsearch::tdmpc
