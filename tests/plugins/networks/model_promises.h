// model_promises.h - what model.h promises and how a learned model behaves, held against every
// one of them: saving, seeds, rows, threads, memory, errors.
// Over 400 lines: a template for one test suite cannot stand in several files.
//
// A model is a type with
//   struct Settings                     with bfloat16 and bfloat16_planning
//   Settings Small(preset)              quick to train; a latent with padding
//   Settings InLanes()                  the same, an update of 23 x 10 decisions in several lanes
//   Settings AskingForAll(preset)       full sizes, all that can be asked for switched on
//   Settings QuickToLearn()             some 300 updates of PointBatch show
//   Model* Make(settings, o, a, seed)
//   View<const MetricSpec> Metrics()
//   kSmallState                         floats of a latent that are not padding
//   kObservationLoss, kRewardLoss       what names an observation or a reward that is not finite
// Instantiate with INSTANTIATE_TYPED_TEST_SUITE_P(Name, ModelPromises, Type).
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dreamsearch/random.h"
#include "plugins/networks/matrix.h"
#include "tests/plugins/networks/batches.h"
#include "tests/plugins/networks/malloc_counter.h"
#include "tests/plugins/owned.h"

namespace dreamsearch {

using networks::Index;

using ModelPointer = Owned<Model>;

template <typename Case>
ModelPointer Make(const typename Case::Settings& settings, std::uint64_t seed = 1, Index o = 2,
                  Index a = 1, Index threads = 1) {
  ModelPointer model(Case::Make(settings, o, a, seed));
  model->SetThreads(static_cast<std::uint32_t>(threads));
  return model;
}

template <typename Case>
std::vector<double> Train(Model* model, const OwnedBatch& batch, std::uint64_t update) {
  std::vector<double> metrics(Case::Metrics().size);
  const SequenceBatch view = batch.view();
  const Status status =
      model->Train({&view, DeriveSeed(9, update), update, 0}, {metrics.data(), metrics.size()});
  EXPECT_TRUE(status.ok()) << status.message;
  return metrics;
}

template <typename Case>
double Metric(const std::vector<double>& metrics, const std::string& name) {
  for (std::uint64_t i = 0; i < metrics.size(); ++i) {
    if (Case::Metrics()[i].name == name) return metrics[i];
  }
  ADD_FAILURE() << "no metric " << name;
  return 0;
}

class Bytes final : public ByteSink, public ByteSource {
 public:
  Status Write(const void* data, std::uint64_t size) noexcept override {
    const auto* from = static_cast<const char*>(data);
    bytes.insert(bytes.end(), from, from + size);
    return OkStatus();
  }
  Status Read(void* data, std::uint64_t size) noexcept override {
    if (position + size > bytes.size()) return Error(StatusCode::kDataLoss, "bytes missing");
    std::memcpy(data, bytes.data() + position, size);
    position += size;
    return OkStatus();
  }
  std::vector<char> bytes;
  std::uint64_t position = 0;
};

inline std::vector<char> SavedBytes(const Model& model) {
  Bytes sink;
  EXPECT_TRUE(model.Save(&sink).ok());
  return sink.bytes;
}

// Memory for n latents.
class LatentArray {
 public:
  LatentArray(const Model& model, std::uint64_t n)
      : rows_(n), cols_(model.latent_bytes()), floats_(n * cols_ / sizeof(float)) {}
  // Where the SDK asks for latents. NOLINTBEGIN(google-explicit-constructor)
  operator Latents() { return {reinterpret_cast<std::byte*>(floats_.data()), rows_, cols_}; }
  operator ConstLatents() { return Latents(*this); }
  // NOLINTEND(google-explicit-constructor)
  std::vector<float>& floats() { return floats_; }

 private:
  std::uint64_t rows_, cols_;
  std::vector<float> floats_;
};

// `saved` is of another model: Load refuses it and says why.
inline void ExpectOtherModel(Model* model, Bytes saved, const std::string& why) {
  const Status status = model->Load(&saved);
  EXPECT_EQ(status.code, StatusCode::kDataLoss);
  EXPECT_NE(std::string(status.message).find(why), std::string::npos) << status.message;
}

// The latent in which the point on the line of PointBatch stands at x, for that many decisions.
inline LatentArray ObservedPoint(Model* model, double x, int decisions = 1) {
  LatentArray previous(*model, 1), latent(*model, 1);
  EXPECT_TRUE(model->InitialLatent(latent).ok());
  const double observation[] = {x, x * x}, action[] = {0};
  const std::uint64_t seed = 0;
  for (int i = 0; i < decisions; ++i) {
    std::swap(previous, latent);
    EXPECT_TRUE(
        model->Observe({previous, {action, 1, 1}, {observation, 1, 2}, {}, {&seed, 1}}, latent)
            .ok());
  }
  return latent;
}

// The actor has come to prefer the way to the reward: from x = 0.5 it pushes left, from -0.5
// right.
inline void ExpectActorPushesToTheOrigin(Model* model) {
  double left = 0, right = 0;
  EXPECT_TRUE(model->ProposeMode(ObservedPoint(model, 0.5), {&left, 1, 1}).ok());
  EXPECT_TRUE(model->ProposeMode(ObservedPoint(model, -0.5), {&right, 1, 1}).ok());
  EXPECT_LT(left, -0.3);
  EXPECT_GT(right, 0.3);
}

// Everything a planner can ask, at n copies of a latent reached by one observation.
struct Answers {
  std::vector<float> observed, imagined;
  std::vector<double> rewards, discounts, values, mode, samples;
  bool operator==(const Answers&) const = default;
};

inline Answers Ask(Model* model, std::uint64_t n, std::uint64_t seed) {
  Answers answers;
  LatentArray previous(*model, n), observed(*model, n), imagined(*model, n);
  const std::uint64_t a = model->action_size();
  std::vector<double> actions(n * a, 0.3), observations(n * 2);
  for (std::uint64_t i = 0; i < n; ++i) {
    observations[2 * i] = 0.5;
    observations[2 * i + 1] = 0.25;
  }
  answers.rewards.resize(n);
  answers.discounts.resize(n);
  answers.values.resize(n);
  answers.mode.resize(n * a);
  answers.samples.resize(3 * n * a);
  EXPECT_TRUE(model->InitialLatent(previous).ok());
  const MatrixView<const double> action_view{actions.data(), n, a};
  const std::vector<std::uint64_t> row_seeds(n, seed);
  const View<const std::uint64_t> seeds{row_seeds.data(), n};
  EXPECT_TRUE(
      model->Observe({previous, action_view, {observations.data(), n, 2}, {}, seeds}, observed)
          .ok());
  EXPECT_TRUE(model
                  ->Imagine({observed, action_view, seeds},
                            {imagined, {answers.rewards.data(), n}, {answers.discounts.data(), n}})
                  .ok());
  EXPECT_TRUE(model->Value(imagined, {answers.values.data(), n}).ok());
  EXPECT_TRUE(model->ProposeMode(imagined, {answers.mode.data(), n, a}).ok());
  EXPECT_TRUE(model->ProposeSamples(imagined, seeds, {answers.samples.data(), 3 * n, a}).ok());
  answers.observed = observed.floats();
  answers.imagined = imagined.floats();
  return answers;
}

// Everything a planner can ask about kRows different rows, in requests of `size` rows.
struct RowAnswers {
  std::vector<float> observed, imagined;
  std::vector<double> rewards, discounts, values, deviations, least, mode, samples, returns,
      gradients;
};

inline RowAnswers AskInRequests(Model* model, std::uint64_t rows, std::uint64_t size,
                                std::uint64_t first_size) {
  constexpr std::uint64_t kObservations = 2, kActions = 1, kEach = 3;
  Random random(17);
  std::vector<double> actions(rows), observations(rows * kObservations);
  for (double& x : actions) x = random.Uniform(-1, 1);
  for (double& x : observations) x = random.Normal();
  std::vector<std::uint64_t> seeds(rows);
  for (std::uint64_t& seed : seeds) seed = random.Next();
  LatentArray previous(*model, rows), observed(*model, rows), imagined(*model, rows);
  EXPECT_TRUE(model->InitialLatent(previous).ok());
  RowAnswers answers;
  answers.rewards.resize(rows);
  answers.discounts.resize(rows);
  answers.values.resize(rows);
  answers.deviations.resize(rows);
  answers.least.resize(rows);
  answers.mode.resize(rows * kActions);
  answers.samples.resize(rows * kActions * kEach);
  // Sequences of two actions, that of the row and one more.
  constexpr std::uint64_t kHorizon = 2;
  answers.returns.resize(rows);
  answers.gradients.resize(rows * kHorizon);
  std::vector<double> sequences(rows * kHorizon);
  for (double& x : sequences) x = random.Uniform(-1, 1);
  std::vector<std::uint64_t> step_seeds(rows * kHorizon);
  for (std::uint64_t& seed : step_seeds) seed = random.Next();
  for (std::uint64_t first = 0, n = first_size; first < rows; first += n, n = size) {
    n = std::min(n, rows - first);
    const MatrixView<const double> action{actions.data() + first, n, kActions};
    const MatrixView<const double> observation{observations.data() + first * kObservations, n,
                                               kObservations};
    const View<const std::uint64_t> seed{seeds.data() + first, n};
    const Latents from = Latents(previous).middle_rows(first, n);
    const Latents seen = Latents(observed).middle_rows(first, n);
    const Latents next = Latents(imagined).middle_rows(first, n);
    EXPECT_TRUE(model->Observe({from, action, observation, {}, seed}, seen).ok());
    EXPECT_TRUE(model
                    ->Imagine({seen, action, seed}, {next,
                                                     {answers.rewards.data() + first, n},
                                                     {answers.discounts.data() + first, n}})
                    .ok());
    EXPECT_TRUE(model->Value(next, {answers.values.data() + first, n}).ok());
    if (auto* spread = ExtensionOf<ValueSpread>(model)) {
      EXPECT_TRUE(spread
                      ->Spread(next, {{answers.values.data() + first, n},
                                      {answers.deviations.data() + first, n},
                                      {answers.least.data() + first, n}})
                      .ok());
    }
    const std::uint64_t steps = n * kHorizon;
    EXPECT_TRUE(ExtensionOf<ReturnGradient>(model)
                    ->Gradient({seen,
                                {sequences.data() + first * kHorizon, steps, kActions},
                                {step_seeds.data() + first * kHorizon, steps}},
                               {{answers.returns.data() + first, n},
                                {answers.gradients.data() + first * kHorizon, steps, kActions}})
                    .ok());
    EXPECT_TRUE(model->ProposeMode(next, {answers.mode.data() + first, n, kActions}).ok());
    EXPECT_TRUE(
        model->ProposeSamples(next, seed, {answers.samples.data() + first * kEach, n * kEach, 1})
            .ok());
  }
  answers.observed = observed.floats();
  answers.imagined = imagined.floats();
  return answers;
}

class Names final : public TensorSink {
 public:
  Status Tensor(const char* name, View<const std::uint64_t> shape,
                View<const float> values) noexcept override {
    std::uint64_t size = 1;
    for (const std::uint64_t n : shape) size *= n;
    EXPECT_EQ(size, values.size) << name;
    total += values.size;
    names.emplace_back(name);
    contents.emplace_back(values.begin(), values.end());
    return OkStatus();
  }
  std::uint64_t total = 0;
  std::vector<std::string> names;
  std::vector<std::vector<float>> contents;
};

template <typename Case>
class ModelPromises : public testing::Test {};
TYPED_TEST_SUITE_P(ModelPromises);

TYPED_TEST_P(ModelPromises, EqualSeedsGiveEqualBits) {
  const OwnedBatch batch = PointBatch(6, 10, 1);
  const ModelPointer a = Make<TypeParam>(TypeParam::Small("fast")),
                     b = Make<TypeParam>(TypeParam::Small("fast")),
                     other = Make<TypeParam>(TypeParam::Small("fast"), 2);
  EXPECT_NE(SavedBytes(*a), SavedBytes(*other));
  for (std::uint64_t update = 0; update < 3; ++update) {
    EXPECT_EQ(Train<TypeParam>(a.get(), batch, update), Train<TypeParam>(b.get(), batch, update));
  }
  EXPECT_EQ(SavedBytes(*a), SavedBytes(*b));
  EXPECT_EQ(Ask(a.get(), 4, 5), Ask(b.get(), 4, 5));
  EXPECT_NE(Ask(a.get(), 4, 5).samples, Ask(a.get(), 4, 6).samples);
}

TYPED_TEST_P(ModelPromises, AnyNumberOfThreadsGivesEqualBits) {
  for (const bool bfloat16 : {false, true}) {
    auto settings = TypeParam::InLanes();
    settings.bfloat16 = bfloat16;
    OwnedBatch batch = PointBatch(23, 10, 1);
    batch.AddSearches(3, 2);
    std::string first;
    for (const Index threads : {1, 2, 3, 9}) {
      const ModelPointer model = Make<TypeParam>(settings, 1, 2, 1, threads);
      std::string bits;
      for (std::uint64_t update = 0; update < 5; ++update) {
        for (const double metric : Train<TypeParam>(model.get(), batch, update)) {
          bits.append(reinterpret_cast<const char*>(&metric), sizeof metric);
        }
      }
      const auto saved = SavedBytes(*model);
      bits.append(saved.begin(), saved.end());
      if (threads == 1) first = bits;
      EXPECT_TRUE(bits == first) << "bfloat16 " << bfloat16 << ", " << threads << " threads";
    }
  }
}

TYPED_TEST_P(ModelPromises, ThreadsThatComeAndGoBetweenUpdatesLeaveTheBitsOfOne) {
  for (const bool bfloat16 : {false, true}) {
    auto settings = TypeParam::InLanes();
    settings.bfloat16 = bfloat16;
    const OwnedBatch batch = PointBatch(23, 10, 1);
    const ModelPointer one = Make<TypeParam>(settings), changing = Make<TypeParam>(settings);
    std::uint64_t update = 0;
    for (const std::uint32_t threads : {1u, 2u, 1u, 3u, 9u, 2u, 2u, 100u, 1u, 4u}) {
      changing->SetThreads(threads);
      EXPECT_EQ(Train<TypeParam>(changing.get(), batch, update),
                Train<TypeParam>(one.get(), batch, update))
          << "bfloat16 " << bfloat16 << ", update " << update << " on " << threads << " threads";
      ++update;
    }
    EXPECT_EQ(SavedBytes(*changing), SavedBytes(*one)) << "bfloat16 " << bfloat16;
  }
}

TYPED_TEST_P(ModelPromises, LoadedContinuesAsTheSavedWouldHave) {
  for (const char* preset : {"fast", "paper"}) {
    const OwnedBatch batch = PointBatch(6, 10, 1);
    const ModelPointer a = Make<TypeParam>(TypeParam::Small(preset)),
                       b = Make<TypeParam>(TypeParam::Small(preset), 77);
    Train<TypeParam>(a.get(), batch, 0);
    Bytes saved;
    ASSERT_TRUE(a->Save(&saved).ok());
    ASSERT_TRUE(b->Load(&saved).ok());
    EXPECT_EQ(saved.position, saved.bytes.size());
    for (std::uint64_t update = 1; update < 4; ++update) {
      EXPECT_EQ(Train<TypeParam>(a.get(), batch, update), Train<TypeParam>(b.get(), batch, update));
    }
    EXPECT_EQ(SavedBytes(*a), SavedBytes(*b));
    EXPECT_EQ(Ask(a.get(), 2, 5), Ask(b.get(), 2, 5));
  }
}

TYPED_TEST_P(ModelPromises, LoadRefusesMissingBytes) {
  const ModelPointer model = Make<TypeParam>(TypeParam::Small("fast"));
  Bytes saved;
  ASSERT_TRUE(model->Save(&saved).ok());
  saved.bytes.pop_back();
  EXPECT_EQ(model->Load(&saved).code, StatusCode::kDataLoss);
}

// The law of rows in model.h: a planner would break ties by rounding, and an episode would
// depend on those that are evaluated beside it.
TYPED_TEST_P(ModelPromises, ARowHasTheSameAnswerWhateverStandsBesideIt) {
  // Many requests of few rows, few of many.
  const struct {
    std::uint64_t rows;
    std::vector<std::uint64_t> sizes;
  } cases[] = {{128, {2, 3, 5, 6, 7, 31, 32, 33, 35, 65, 97}}, {512, {200, 511, 512}}};
  for (const bool bfloat16 : {false, true}) {
    for (const char* preset : {"fast", "paper"}) {
      auto settings = TypeParam::AskingForAll(preset);
      settings.bfloat16_planning = bfloat16;
      const ModelPointer model = Make<TypeParam>(settings);
      OwnedBatch batch = PointBatch(6, 10, 1);
      batch.discounts.back() = 0;
      for (std::uint64_t update = 0; update < 3; ++update) {
        Train<TypeParam>(model.get(), batch, update);
      }
      for (const auto& [rows, sizes] : cases) {
        const RowAnswers alone = AskInRequests(model.get(), rows, 1, 1);
        for (const std::uint64_t size : sizes) {
          SCOPED_TRACE(testing::Message() << preset << ", bfloat16 " << bfloat16 << ", " << size
                                          << " rows in a request");
          for (const std::uint64_t first_size : {size, std::uint64_t{1}}) {
            const RowAnswers together = AskInRequests(model.get(), rows, size, first_size);
            EXPECT_TRUE(alone.observed == together.observed);
            EXPECT_TRUE(alone.imagined == together.imagined);
            EXPECT_TRUE(alone.rewards == together.rewards);
            EXPECT_TRUE(alone.discounts == together.discounts);
            EXPECT_TRUE(alone.values == together.values);
            EXPECT_TRUE(alone.deviations == together.deviations);
            EXPECT_TRUE(alone.least == together.least);
            EXPECT_TRUE(alone.mode == together.mode);
            EXPECT_TRUE(alone.samples == together.samples);
            EXPECT_TRUE(alone.returns == together.returns);
            EXPECT_TRUE(alone.gradients == together.gradients);
          }
        }
      }
    }
  }
}

// The return of a sequence by the calls that a planner without the gradient makes.
inline double ImaginedReturn(Model* model, LatentArray from, const std::vector<double>& actions,
                             const std::vector<std::uint64_t>& seeds, double deviations,
                             bool least) {
  std::vector<double> rewards(actions.size()), discounts(actions.size());
  for (std::size_t t = 0; t < actions.size(); ++t) {
    LatentArray to(*model, 1);
    EXPECT_TRUE(model
                    ->Imagine({from, {&actions[t], 1, 1}, {&seeds[t], 1}},
                              {to, {&rewards[t], 1}, {&discounts[t], 1}})
                    .ok());
    from = to;
  }
  double total = 0;
  if (auto* spread = ExtensionOf<ValueSpread>(model)) {
    double value = 0, deviation = 0, least_value = 0;
    EXPECT_TRUE(spread->Spread(from, {{&value, 1}, {&deviation, 1}, {&least_value, 1}}).ok());
    total = least ? least_value : value + deviations * deviation;
  } else {
    EXPECT_TRUE(model->Value(from, {&total, 1}).ok());
  }
  for (std::size_t t = actions.size(); t-- > 0;) total = rewards[t] + discounts[t] * total;
  return total;
}

// Slopes: central differences of numbers that are computed in float, eps |return| / h from the
// exact ones, and h^2 / 6 times a third derivative.
TYPED_TEST_P(ModelPromises, TheGradientIsOfTheReturnThatImagineAndValueGive) {
  constexpr std::uint64_t kHorizon = 3;
  constexpr double kStep = 0.05;
  const ModelPointer model = Make<TypeParam>(TypeParam::QuickToLearn());
  for (std::uint64_t update = 0; update < 300; ++update) {
    Train<TypeParam>(model.get(), PointBatch(16, 5, update), update);
  }
  const LatentArray latent = ObservedPoint(model.get(), 0.6);
  LatentArray from = latent;
  const std::vector<double> actions = {0.3, -0.5, 0.1};
  const std::vector<std::uint64_t> seeds = {7, 8, 9};
  struct {
    double deviations;
    bool least;
  } const cases[] = {{0, false}, {1.5, false}, {0, true}};
  for (const auto& [deviations, least] : cases) {
    double value = 0;
    std::vector<double> gradient(kHorizon);
    ASSERT_TRUE(
        ExtensionOf<ReturnGradient>(model.get())
            ->Gradient(
                {from, {actions.data(), kHorizon, 1}, {seeds.data(), kHorizon}, deviations, least},
                {{&value, 1}, {gradient.data(), kHorizon, 1}})
            .ok());
    EXPECT_DOUBLE_EQ(value, ImaginedReturn(model.get(), latent, actions, seeds, deviations, least));
    double largest = 0;
    for (const double slope : gradient) largest = std::max(largest, std::abs(slope));
    EXPECT_GT(largest, 0.01) << "the actions do not matter";
    for (std::size_t t = 0; t < kHorizon; ++t) {
      std::vector<double> above = actions, below = actions;
      above[t] += kStep;
      below[t] -= kStep;
      const double difference =
          (ImaginedReturn(model.get(), latent, above, seeds, deviations, least) -
           ImaginedReturn(model.get(), latent, below, seeds, deviations, least)) /
          (2 * kStep);
      EXPECT_NEAR(gradient[t], difference, 0.02 * largest + 1e-4 * (1 + std::abs(value))) << t;
    }
  }
}

TYPED_TEST_P(ModelPromises, InitialLatentIsZeroAndPaddingStaysZero) {
  const ModelPointer model = Make<TypeParam>(TypeParam::Small("fast"));
  EXPECT_EQ(model->latent_bytes() % kLatentAlignment, 0u);
  ASSERT_LT(TypeParam::kSmallState * sizeof(float), model->latent_bytes());
  LatentArray initial(*model, 2);
  initial.floats().assign(initial.floats().size(), 7);
  ASSERT_TRUE(model->InitialLatent(initial).ok());
  EXPECT_EQ(initial.floats(), std::vector<float>(initial.floats().size(), 0));
  const Answers answers = Ask(model.get(), 2, 5);
  const std::size_t stride = model->latent_bytes() / sizeof(float);
  for (std::size_t i = TypeParam::kSmallState; i < stride; ++i) {
    EXPECT_EQ(answers.imagined[i], 0);
    EXPECT_EQ(answers.observed[stride + i], 0);
  }
}

TYPED_TEST_P(ModelPromises, AllocatesNothingAfterWarmUp) {
  if (!DREAMSEARCH_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer allocates";
  for (const char* preset : {"fast", "paper"}) {
    SCOPED_TRACE(preset);
    const ModelPointer model = Make<TypeParam>(TypeParam::AskingForAll(preset), 1, 2, 1, 2);
    OwnedBatch batch = PointBatch(20, 20, 1);
    batch.AddSearches(2, 3);
    batch.discounts.back() = 0;
    std::vector<double> metrics(TypeParam::Metrics().size);
    LatentArray latents(*model, 150), next(*model, 150);
    std::vector<double> actions(150, 0.1), observations(300, 0.2), rewards(150), discounts(150),
        values(150), samples(150);
    std::vector<std::uint64_t> row_seeds(150);
    const auto call_everything = [&](std::uint64_t n, std::uint64_t seed) {
      bool ok = true;
      FillSeeds(seed, {row_seeds.data(), n});
      const View<const std::uint64_t> seeds{row_seeds.data(), n};
      const std::uint64_t bytes = model->latent_bytes();
      const Latents from{Latents(latents).data, n, bytes}, to{Latents(next).data, n, bytes};
      const MatrixView<const double> action{actions.data(), n, 1};
      ok &= model->InitialLatent(from).ok();
      ok &= model->Observe({from, action, {observations.data(), n, 2}, {}, seeds}, to).ok();
      ok &= model->Imagine({to, action, seeds}, {from, {rewards.data(), n}, {discounts.data(), n}})
                .ok();
      ok &= model->Value(from, {values.data(), n}).ok();
      ok &= ExtensionOf<ReturnGradient>(model.get())
                ->Gradient({to, action, seeds}, {{values.data(), n}, {samples.data(), n, 1}})
                .ok();
      ok &= model->ProposeMode(from, {samples.data(), n, 1}).ok();
      ok &= model->ProposeSamples({from.data, 1, bytes}, {seeds.data, 1}, {samples.data(), n, 1})
                .ok();
      return ok;
    };
    const auto train = [&](std::uint64_t update) {
      model->SetThreads(2);  // as many as it has
      const SequenceBatch view = batch.view();
      return model->Train({&view, update, update, 0}, {metrics.data(), metrics.size()}).ok();
    };
    ASSERT_TRUE(train(0) && call_everything(150, 1) && train(1) && call_everything(150, 2));
    const std::uint64_t before = MallocCount();
    const bool ok = call_everything(1, 3) && call_everything(50, 4) && train(2) &&
                    call_everything(150, 5) && train(3);
    const std::uint64_t made = MallocCount() - before;
    EXPECT_TRUE(ok);
    EXPECT_EQ(made, 0u) << preset;
  }
  const std::uint64_t before = MallocCount();
  const std::vector<float> counted(1000);
  EXPECT_EQ(counted.size(), 1000u);
  EXPECT_GT(MallocCount(), before) << "the counter does not count";
}

TYPED_TEST_P(ModelPromises, RefusesNanInABatchAndStaysAsItWas) {
  const struct {
    const char* what;
    float* (*place)(OwnedBatch*);
    const char* named;
  } cases[] = {
      {"observation", [](OwnedBatch* b) { return &b->observations[7]; },
       TypeParam::kObservationLoss},
      {"reward", [](OwnedBatch* b) { return &b->rewards[7]; }, TypeParam::kRewardLoss},
      {"action", [](OwnedBatch* b) { return &b->actions[7]; }, TypeParam::kObservationLoss},
  };
  for (const char* preset : {"fast", "paper"}) {
    for (const auto& item : cases) {
      for (const float bad :
           {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        const ModelPointer model = Make<TypeParam>(TypeParam::Small(preset));
        OwnedBatch batch = PointBatch(6, 10, 1);
        Train<TypeParam>(model.get(), batch, 0);
        const std::vector<char> before = SavedBytes(*model);
        *item.place(&batch) = bad;
        std::vector<double> metrics(TypeParam::Metrics().size);
        const SequenceBatch view = batch.view();
        const Status status = model->Train({&view, 1, 5, 0}, {metrics.data(), metrics.size()});
        EXPECT_EQ(status.code, StatusCode::kNotFinite) << preset << " " << item.what << " " << bad;
        EXPECT_NE(std::string(status.message).find(item.named), std::string::npos)
            << item.what << ": " << status.message;
        EXPECT_NE(std::string(status.message).find("update 5"), std::string::npos)
            << status.message;
        EXPECT_EQ(SavedBytes(*model), before);
      }
    }
  }
}

TYPED_TEST_P(ModelPromises, FindsNanInItsOwnLatents) {
  const ModelPointer model = Make<TypeParam>(TypeParam::Small("fast"));
  LatentArray latents(*model, 2), next(*model, 2);
  latents.floats()[3] = std::numeric_limits<float>::quiet_NaN();
  const std::vector<double> actions(2, 0.0);
  std::vector<double> numbers(4);
  const std::uint64_t seeds[] = {0, 0};
  EXPECT_EQ(model
                ->Imagine({latents, {actions.data(), 2, 1}, {seeds, 2}},
                          {next, {numbers.data(), 2}, {numbers.data() + 2, 2}})
                .code,
            StatusCode::kNotFinite);
}

// What a row draws follows from its own seed, wherever it stands.
TYPED_TEST_P(ModelPromises, ARowDrawsFromItsOwnSeed) {
  const ModelPointer model = Make<TypeParam>(TypeParam::Small("fast"));
  LatentArray latents(*model, 3);
  ASSERT_TRUE(model->InitialLatent(latents).ok());
  const auto samples = [&](std::vector<std::uint64_t> seeds) {
    std::vector<double> actions(2 * seeds.size());
    EXPECT_TRUE(model
                    ->ProposeSamples(latents, {seeds.data(), seeds.size()},
                                     {actions.data(), actions.size(), 1})
                    .ok());
    return actions;
  };
  const std::vector<double> a = samples({7, 8, 9}), b = samples({9, 8, 7});
  // The latents are equal; the law of rows makes the bits so, the products here do.
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(a[i], b[4 + i], 1e-6);
    EXPECT_NEAR(a[2 + i], b[2 + i], 1e-6);
    EXPECT_NEAR(a[4 + i], b[i], 1e-6);
  }
  EXPECT_GT(std::abs(a[0] - a[4]), 1e-3);
}

TYPED_TEST_P(ModelPromises, RefusesWrongSizes) {
  const ModelPointer model = Make<TypeParam>(TypeParam::Small("fast"));
  LatentArray latents(*model, 2), next(*model, 2);
  std::vector<double> numbers(8);
  const auto code = [](const Status& status) { return status.code; };
  const std::uint64_t row_seeds[] = {0, 0};
  const View<const std::uint64_t> seeds{row_seeds, 2}, one_seed{row_seeds, 1};
  EXPECT_EQ(code(model->Value(latents, {numbers.data(), 3})), StatusCode::kInvalidArgument);
  if (auto* spread = ExtensionOf<ValueSpread>(model.get())) {
    EXPECT_EQ(code(spread->Spread(latents, {{numbers.data(), 2}, {numbers.data(), 1}, {}})),
              StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(code(model->ProposeMode(latents, {numbers.data(), 2, 2})),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(code(model->ProposeSamples(latents, seeds, {numbers.data(), 3, 1})),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(code(model->ProposeSamples(latents, one_seed, {numbers.data(), 4, 1})),
            StatusCode::kInvalidArgument);
  for (const auto& [actions, given] : {std::pair(1u, seeds), std::pair(2u, one_seed)}) {
    EXPECT_EQ(code(model->Imagine({latents, {numbers.data(), actions, 1}, given},
                                  {next, {numbers.data(), 2}, {numbers.data(), 2}})),
              StatusCode::kInvalidArgument);
  }
  for (const auto& [size, given] : {std::pair(3u, seeds), std::pair(2u, one_seed)}) {
    EXPECT_EQ(code(model->Observe(
                  {latents, {numbers.data(), 2, 1}, {numbers.data(), 2, size}, {}, given}, next)),
              StatusCode::kInvalidArgument);
  }
}

TYPED_TEST_P(ModelPromises, RefusesSearchesOfAnotherSize) {
  const ModelPointer model = Make<TypeParam>(TypeParam::Small("fast"));
  OwnedBatch batch = PointBatch(6, 10, 1);
  batch.AddSearches(2, 3);
  std::vector<double> metrics(TypeParam::Metrics().size);
  const View<double> room{metrics.data(), metrics.size()};
  SequenceBatch weights = batch.view(), values = batch.view(), actions = batch.view();
  --weights.search_weights.size;
  values.search_values.size = 0;
  actions.search_actions.cols = 2;
  const std::vector<char> before = SavedBytes(*model);
  for (const SequenceBatch& wrong : {weights, values, actions}) {
    EXPECT_EQ(model->Train({&wrong, 9, 0, 0}, room).code, StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(SavedBytes(*model), before);
  const SequenceBatch right = batch.view();
  EXPECT_TRUE(model->Train({&right, 9, 0, 0}, room).ok());
}

TYPED_TEST_P(ModelPromises, ImitatesTheSearchesOfItsBatches) {
  auto settings = TypeParam::Small("fast");
  settings.search_policy_weight = 100;
  settings.actor_learning_rate = 3e-3;
  const ModelPointer model = Make<TypeParam>(settings);
  OwnedBatch batch = PointBatch(8, 10, 1);
  batch.AddSearches(2, 3);
  std::fill(batch.search_actions.begin(), batch.search_actions.end(), 0.6f);
  std::vector<double> first, last;
  for (std::uint64_t update = 0; update < 300; ++update) {
    last = Train<TypeParam>(model.get(), batch, update);
    if (update == 0) first = last;
  }
  EXPECT_LT(Metric<TypeParam>(last, "imitation_loss"), Metric<TypeParam>(first, "imitation_loss"));
  EXPECT_GT(Metric<TypeParam>(last, "searched"), 0.3);
  EXPECT_LT(Metric<TypeParam>(last, "searched"), 0.9);
  // No dream of `dreamer` starts in the first decisions of an episode, and what starts none is not
  // imitated.
  constexpr int kDecisions = 6;
  for (const double x : {-0.5, 0.5}) {
    double mode = 0;
    EXPECT_TRUE(model->ProposeMode(ObservedPoint(model.get(), x, kDecisions), {&mode, 1, 1}).ok());
    EXPECT_NEAR(mode, 0.6, 0.1) << "at " << x;
  }
}

REGISTER_TYPED_TEST_SUITE_P(ModelPromises, EqualSeedsGiveEqualBits,
                            AnyNumberOfThreadsGivesEqualBits,
                            ThreadsThatComeAndGoBetweenUpdatesLeaveTheBitsOfOne,
                            LoadedContinuesAsTheSavedWouldHave, LoadRefusesMissingBytes,
                            ARowHasTheSameAnswerWhateverStandsBesideIt,
                            TheGradientIsOfTheReturnThatImagineAndValueGive,
                            InitialLatentIsZeroAndPaddingStaysZero, AllocatesNothingAfterWarmUp,
                            RefusesNanInABatchAndStaysAsItWas, FindsNanInItsOwnLatents,
                            ARowDrawsFromItsOwnSeed, RefusesWrongSizes,
                            RefusesSearchesOfAnotherSize, ImitatesTheSearchesOfItsBatches);

}  // namespace dreamsearch
