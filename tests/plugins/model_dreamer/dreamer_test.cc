// The model behind the SDK's interface: the promises of every learned model, and its own.
#include "plugins/model_dreamer/dreamer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "plugins/networks/noise.h"
#include "tests/plugins/networks/model_promises.h"

namespace dreamsearch::dreamer {
namespace {

struct DreamerCase {
  using Settings = dreamer::Settings;
  static constexpr std::size_t kSmallState = 24 + 5;
  static constexpr const char* kObservationLoss = "observation loss";
  static constexpr const char* kRewardLoss = "reward loss";

  static Settings Small(const char* preset) {
    Settings s = PresetSettings(preset);
    s.deterministic = s.hidden = 24;
    s.stochastic = 5;
    s.horizon = 5;
    s.imagination_starts = 20;
    return s;
  }
  // 230 starts: lanes of one and two blocks.
  static Settings InLanes() {
    Settings s = Small("fast");
    s.imagination_starts = 0;
    s.start_skip = 0;
    return s;
  }
  static Settings AskingForAll(const char* preset) {
    Settings s = PresetSettings(preset);
    s.continuation = true;
    s.critics = 2;
    s.imagined_latent_mean = false;
    s.actor_average = 0.1;
    s.horizon = 3;
    s.imagination_starts = 300;  // more than one block
    return s;
  }
  static Settings QuickToLearn() {
    Settings s = Small("fast");
    s.layer_norm = true;  // bears the high rates
    s.model_learning_rate = s.value_learning_rate = s.actor_learning_rate = 2e-3;
    return s;
  }
  static Model* Make(const Settings& settings, Index o, Index a, std::uint64_t seed) {
    return new Dreamer(settings, o, a, seed);
  }
  static View<const MetricSpec> Metrics() { return DeclaredMetrics(); }
};

}  // namespace
}  // namespace dreamsearch::dreamer

namespace dreamsearch {
INSTANTIATE_TYPED_TEST_SUITE_P(Dreamer, ModelPromises, dreamer::DreamerCase);
}  // namespace dreamsearch

namespace dreamsearch::dreamer {
namespace {

Settings Small() { return DreamerCase::Small("fast"); }
ModelPointer Make(const Settings& settings, Index o = 2, Index a = 1) {
  return dreamsearch::Make<DreamerCase>(settings, 1, o, a);
}
double Metric(const std::vector<double>& metrics, const std::string& name) {
  return dreamsearch::Metric<DreamerCase>(metrics, name);
}

TEST(Dreamer, LoadRefusesOtherSizes) {
  Bytes saved;
  ASSERT_TRUE(Make(Small())->Save(&saved).ok());
  Settings wider = Small();
  wider.hidden += 1;
  ExpectOtherModel(Make(wider).get(), saved, "world model size");
  // As many parameters in other layers.
  Settings moved = Small();
  moved.decoder_layers -= 1;
  moved.reward_layers += 1;
  ExpectOtherModel(Make(moved).get(), saved, "architecture");
}

TEST(Dreamer, LearnsWithTheSmallestEpsilon) {
  Settings settings = Small();  // zero heads: the first gradients of their hidden layers are 0
  for (const ParameterSpec& spec : DeclaredParameters()) {
    if (std::string(spec.name) == "adam_epsilon") settings.adam_epsilon = spec.min;
  }
  const ModelPointer model = Make(settings);
  for (std::uint64_t update = 0; update < 3; ++update) {
    Train<DreamerCase>(model.get(), PointBatch(6, 10, 1), update);
  }
}

TEST(Dreamer, DiscountsByGammaWithoutAContinuationModel) {
  const ModelPointer model = Make(Small());
  for (const double discount : Ask(model.get(), 3, 5).discounts) EXPECT_EQ(discount, 0.99);
}

TEST(Dreamer, ReportsMeanDeviationAndLeastOfItsCritics) {
  Settings settings = Small();
  settings.critics = 3;
  const ModelPointer model = Make(settings);
  for (std::uint64_t update = 0; update < 20; ++update) {
    Train<DreamerCase>(model.get(), PointBatch(6, 10, update), update);
  }
  LatentArray latents(*model, 5);
  for (std::size_t i = 0; i < latents.floats().size(); ++i) {
    latents.floats()[i] = 0.02f * static_cast<float>(i % 7);
  }
  std::vector<double> values(5), deviations(5), least(5);
  ASSERT_TRUE(ExtensionOf<ValueSpread>(model.get())
                  ->Spread(latents, {{values.data(), 5}, {deviations.data(), 5}, {least.data(), 5}})
                  .ok());
  Buffer<float> buffer;
  const Mat<float> of_each = buffer.Shape(3, 1);
  for (std::size_t row = 0; row < 5; ++row) {
    const float* state = latents.floats().data() + row * (model->latent_bytes() / sizeof(float));
    static_cast<Dreamer*>(model.get())
        ->learner()
        .behaviour()
        .Value(Mat<const float>(state, settings.state_size(), 1), of_each);
    double mean = 0, squares = 0;
    for (Index c = 0; c < 3; ++c) {
      mean += static_cast<double>(of_each(c, 0)) / 3;
      squares += static_cast<double>(of_each(c, 0)) * static_cast<double>(of_each(c, 0)) / 3;
    }
    EXPECT_NEAR(values[row], mean, 1e-9);
    EXPECT_NEAR(deviations[row], std::sqrt(squares - mean * mean), 1e-6);
    EXPECT_EQ(least[row], *std::min_element(of_each.data, of_each.data + 3));
    EXPECT_GT(deviations[row], 1e-6) << "the critics began as different ones";
  }
}

TEST(Dreamer, HasOneCriticAndSoOffersNoSpread) {
  const ModelPointer model = Make(Small());
  EXPECT_EQ(ExtensionOf<ValueSpread>(model.get()), nullptr);
  EXPECT_NE(ExtensionOf<TensorExport>(model.get()), nullptr);
}

TEST(Dreamer, ExportsEveryParameterOnce) {
  const ModelPointer model = Make(PresetSettings("paper"), 24, 6);
  Names sink;
  ASSERT_TRUE(ExtensionOf<TensorExport>(model.get())->Export(&sink).ok());
  // Multiply-adds of the layers at these sizes (weights), and one bias an output.
  const std::uint64_t weights =
      84800 + 7200 + 240000 + 52000 + 92000 + 90800 + 86200 + 168400 + 126200;
  const std::uint64_t biases = 3 * 200 + 200 + 2 * 600 + 260 + 260 + 424 + 401 + 812 + 601;
  EXPECT_EQ(sink.total, weights + biases + 2 * 24);
  EXPECT_EQ(sink.names.front(), "encoder.0.weight");
}

// The exported tensors whose names begin so, one after the other.
std::vector<float> Exported(Model* model, const std::string& prefix) {
  Names sink;
  EXPECT_TRUE(ExtensionOf<TensorExport>(model)->Export(&sink).ok());
  std::vector<float> values;
  for (std::size_t i = 0; i < sink.names.size(); ++i) {
    if (!sink.names[i].starts_with(prefix)) continue;
    values.insert(values.end(), sink.contents[i].begin(), sink.contents[i].end());
  }
  return values;
}

// The mean of all updates at first, then a moving one. It gives the mode and nothing else.
TEST(Dreamer, PlaysTheModeOfTheAverageOfItsActor) {
  constexpr double kRate = 0.25;
  Settings settings = Small();
  const ModelPointer present = Make(settings);
  settings.actor_average = kRate;
  const ModelPointer average = Make(settings);
  const std::vector<float> first = Exported(present.get(), "actor.");
  std::vector<double> expected(first.begin(), first.end());
  EXPECT_EQ(Exported(average.get(), "acting_actor."), first);
  EXPECT_TRUE(Exported(present.get(), "acting_actor.").empty());
  for (std::uint64_t update = 0; update < 8; ++update) {
    const OwnedBatch batch = PointBatch(6, 10, update);
    EXPECT_EQ(Train<DreamerCase>(present.get(), batch, update),
              Train<DreamerCase>(average.get(), batch, update));
    const std::vector<float> learnt = Exported(present.get(), "actor.");
    const double rate = std::max(kRate, 1 / (static_cast<double>(update) + 1));
    for (std::size_t i = 0; i < expected.size(); ++i) {
      expected[i] += rate * (static_cast<double>(learnt[i]) - expected[i]);
    }
  }
  const std::vector<float> acting = Exported(average.get(), "acting_actor.");
  ASSERT_EQ(acting.size(), expected.size());
  for (std::size_t i = 0; i < acting.size(); ++i) EXPECT_NEAR(acting[i], expected[i], 1e-5) << i;

  const Answers answers = Ask(average.get(), 3, 5);
  Answers of_present = Ask(present.get(), 3, 5);
  EXPECT_NE(answers.mode, of_present.mode);
  of_present.mode = answers.mode;
  EXPECT_EQ(answers, of_present);
  Bytes saved;
  ASSERT_TRUE(average->Save(&saved).ok());
  const ModelPointer loaded = Make(settings);
  ASSERT_TRUE(loaded->Load(&saved).ok());
  EXPECT_EQ(Ask(loaded.get(), 3, 5), answers);
  saved.position = 0;
  ExpectOtherModel(present.get(), saved, "architecture");
}

TEST(Dreamer, LearnsAPointOnALine) {
  Settings settings = Small();
  settings.layer_norm = true;  // bears the high rates that keep this short
  settings.model_learning_rate = settings.value_learning_rate = 2e-3;
  settings.actor_learning_rate = 2e-3;
  settings.acting_latent_mean = true;
  settings.imagination_starts = 64;
  const ModelPointer model = Make(settings);
  std::vector<double> first, last;
  for (std::uint64_t update = 0; update < 250; ++update) {
    const std::vector<double> metrics =
        Train<DreamerCase>(model.get(), PointBatch(8, 12, update), update);
    if (update == 0) first = metrics;
    last = metrics;
  }
  EXPECT_LT(Metric(last, "observation_loss"), 0.2 * Metric(first, "observation_loss"));
  EXPECT_LT(Metric(last, "reward_loss"), 0.1 * Metric(first, "reward_loss"));
  EXPECT_GT(Metric(last, "imagined_return"), Metric(first, "imagined_return") + 1);
  ExpectActorPushesToTheOrigin(model.get());
}

TEST(Noise, IsStandardNormalAndDependsOnSeedAndIndexAlone) {
  constexpr Index kCount = 1 << 20;
  std::vector<float> draws(kCount);
  FillNormal(5, draws.data(), kCount);
  double sum = 0, squares = 0, fourth = 0;
  std::uint64_t beyond = 0;
  for (const float x : draws) {
    const double v = static_cast<double>(x);
    sum += v;
    squares += v * v;
    fourth += v * v * v * v;
    if (std::abs(v) > 3) ++beyond;
  }
  // Five standard errors: 1, sqrt 2 and sqrt 96 over sqrt n; P(|x| > 3) = 0.0027.
  const double error = 5 / std::sqrt(double{kCount});
  EXPECT_NEAR(sum / kCount, 0, error);
  EXPECT_NEAR(squares / kCount, 1, 1.42 * error);
  EXPECT_NEAR(fourth / kCount, 3, 9.8 * error);
  EXPECT_NEAR(static_cast<double>(beyond) / kCount, 0.0026998, 0.052 * error);
  std::vector<float> few(333);
  FillNormal(5, few.data(), 333);
  EXPECT_TRUE(std::equal(few.begin(), few.end(), draws.begin()));
  std::vector<double> wide(333);
  FillNormal(5, wide.data(), 333);
  EXPECT_TRUE(std::equal(wide.begin(), wide.end(), few.begin()));
}

}  // namespace
}  // namespace dreamsearch::dreamer
