// The model behind the SDK's interface: saving, seeds, memory, errors, learning.
#include "plugins/model_dreamer/dreamer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "batches.h"
#include "dreamsearch/random.h"
#include "plugins/networks/noise.h"

// Counts what the program allocates, Eigen's memory and aligned memory included.
// The sanitizers bring an allocator of their own, which is left alone.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define DREAMSEARCH_COUNTS_ALLOCATIONS 1
#else
#define DREAMSEARCH_COUNTS_ALLOCATIONS 0
#endif

namespace {

std::atomic<std::uint64_t> g_allocations{0};

}  // namespace

#if DREAMSEARCH_COUNTS_ALLOCATIONS
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
__attribute__((visibility("default"))) void* malloc(std::size_t size) {
  g_allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
__attribute__((visibility("default"))) void* aligned_alloc(std::size_t alignment,
                                                           std::size_t size) {
  g_allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_memalign(alignment, size);
}
}
#endif

namespace dreamsearch::dreamer {
namespace {

struct Destroyer {
  void operator()(Model* model) const { model->Destroy(); }
};
using ModelPointer = std::unique_ptr<Model, Destroyer>;

Settings Small(const char* preset = "fast") {
  Settings s = PresetSettings(preset);
  s.deterministic = s.hidden = 24;
  s.stochastic = 5;
  s.horizon = 5;
  s.imagination_starts = 20;
  return s;
}

ModelPointer Make(const Settings& settings, std::uint64_t seed = 1, Index o = 2, Index a = 1,
                  Index threads = 1) {
  ModelPointer model(new Dreamer(settings, o, a, seed));
  model->SetThreads(static_cast<std::uint32_t>(threads));
  return model;
}

std::vector<double> Train(Model* model, const OwnedBatch& batch, std::uint64_t update) {
  std::vector<double> metrics(DeclaredMetrics().size);
  const Status status = model->Train({batch.view(), DeriveSeed(9, update), update, 0},
                                     {metrics.data(), metrics.size()});
  EXPECT_TRUE(status.ok()) << status.message;
  return metrics;
}

double Metric(const std::vector<double>& metrics, const std::string& name) {
  for (std::uint64_t i = 0; i < metrics.size(); ++i) {
    if (DeclaredMetrics()[i].name == name) return metrics[i];
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

std::vector<char> SavedBytes(const Model& model) {
  Bytes sink;
  EXPECT_TRUE(model.Save(&sink).ok());
  return sink.bytes;
}

// Memory for n latents.
class LatentArray {
 public:
  LatentArray(const Model& model, std::uint64_t n)
      : rows_(n), cols_(model.latent_bytes()), floats_(n * cols_ / sizeof(float)) {}
  operator Latents() { return {reinterpret_cast<std::byte*>(floats_.data()), rows_, cols_}; }
  operator ConstLatents() { return Latents(*this); }
  std::vector<float>& floats() { return floats_; }

 private:
  std::uint64_t rows_, cols_;
  std::vector<float> floats_;
};

// Everything a planner can ask, at n copies of a latent reached by one observation.
struct Answers {
  std::vector<float> observed, imagined;
  std::vector<double> rewards, discounts, values, mode, samples;
  bool operator==(const Answers&) const = default;
};

Answers Ask(Model* model, std::uint64_t n, std::uint64_t seed) {
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
  EXPECT_TRUE(model->Value(imagined, {.values = {answers.values.data(), n}}).ok());
  EXPECT_TRUE(model->ProposeMode(imagined, {answers.mode.data(), n, a}).ok());
  EXPECT_TRUE(model->ProposeSamples(imagined, seeds, {answers.samples.data(), 3 * n, a}).ok());
  answers.observed = observed.floats();
  answers.imagined = imagined.floats();
  return answers;
}

TEST(Dreamer, EqualSeedsGiveEqualBits) {
  const OwnedBatch batch = PointBatch(6, 10, 1);
  const ModelPointer a = Make(Small()), b = Make(Small()), other = Make(Small(), 2);
  EXPECT_NE(SavedBytes(*a), SavedBytes(*other));
  for (std::uint64_t update = 0; update < 3; ++update) {
    EXPECT_EQ(Train(a.get(), batch, update), Train(b.get(), batch, update));
  }
  EXPECT_EQ(SavedBytes(*a), SavedBytes(*b));
  EXPECT_EQ(Ask(a.get(), 4, 5), Ask(b.get(), 4, 5));
  EXPECT_NE(Ask(a.get(), 4, 5).samples, Ask(a.get(), 4, 6).samples);
}

TEST(Dreamer, AnyNumberOfThreadsGivesEqualBits) {
  for (const char* precision : {"float", "bfloat16"}) {
    Settings settings = Small();
    settings.bfloat16 = std::string(precision) == "bfloat16";
    settings.imagination_starts = 0;
    settings.start_skip = 0;
    const OwnedBatch batch = PointBatch(23, 10, 1);  // 230 starts: lanes of one and two blocks
    std::string first;
    for (const Index threads : {1, 2, 3, 9}) {
      const ModelPointer model = Make(settings, 1, 2, 1, threads);
      std::string bits;
      for (std::uint64_t update = 0; update < 5; ++update) {
        for (const double metric : Train(model.get(), batch, update)) {
          bits.append(reinterpret_cast<const char*>(&metric), sizeof metric);
        }
      }
      const auto saved = SavedBytes(*model);
      bits.append(saved.begin(), saved.end());
      if (threads == 1) first = bits;
      EXPECT_TRUE(bits == first) << precision << ", " << threads << " threads";
    }
  }
}

TEST(Dreamer, ThreadsThatComeAndGoBetweenUpdatesLeaveTheBitsOfOne) {
  for (const char* precision : {"float", "bfloat16"}) {
    Settings settings = Small();
    settings.bfloat16 = std::string(precision) == "bfloat16";
    settings.imagination_starts = 0;
    settings.start_skip = 0;
    const OwnedBatch batch = PointBatch(23, 10, 1);
    const ModelPointer one = Make(settings), changing = Make(settings);
    std::uint64_t update = 0;
    for (const std::uint32_t threads : {1u, 2u, 1u, 3u, 9u, 2u, 2u, 100u, 1u, 4u}) {
      changing->SetThreads(threads);
      EXPECT_EQ(Train(changing.get(), batch, update), Train(one.get(), batch, update))
          << precision << ", update " << update << " on " << threads << " threads";
      ++update;
    }
    EXPECT_EQ(SavedBytes(*changing), SavedBytes(*one)) << precision;
  }
}

TEST(Dreamer, LoadedContinuesAsTheSavedWouldHave) {
  for (const char* preset : {"fast", "paper"}) {
    const OwnedBatch batch = PointBatch(6, 10, 1);
    const ModelPointer a = Make(Small(preset)), b = Make(Small(preset), 77);
    Train(a.get(), batch, 0);
    Bytes saved;
    ASSERT_TRUE(a->Save(&saved).ok());
    ASSERT_TRUE(b->Load(&saved).ok());
    EXPECT_EQ(saved.position, saved.bytes.size());
    for (std::uint64_t update = 1; update < 4; ++update) {
      EXPECT_EQ(Train(a.get(), batch, update), Train(b.get(), batch, update));
    }
    EXPECT_EQ(SavedBytes(*a), SavedBytes(*b));
    EXPECT_EQ(Ask(a.get(), 2, 5), Ask(b.get(), 2, 5));
  }
}

TEST(Dreamer, LoadRefusesOtherSizesAndMissingBytes) {
  const ModelPointer model = Make(Small());
  Bytes saved;
  ASSERT_TRUE(model->Save(&saved).ok());
  Bytes cut = saved;
  cut.bytes.pop_back();
  EXPECT_EQ(Make(Small())->Load(&cut).code, StatusCode::kDataLoss);
  Bytes again = saved;
  Settings wider = Small();
  wider.hidden += 1;
  const Status status = Make(wider)->Load(&saved);
  EXPECT_EQ(status.code, StatusCode::kDataLoss);
  EXPECT_NE(std::string(status.message).find("world model size"), std::string::npos)
      << status.message;
  // As many parameters in other layers.
  Settings moved = Small();
  moved.decoder_layers -= 1;
  moved.reward_layers += 1;
  const Status other = Make(moved)->Load(&again);
  EXPECT_EQ(other.code, StatusCode::kDataLoss);
  EXPECT_NE(std::string(other.message).find("architecture"), std::string::npos) << other.message;
}

TEST(Dreamer, LearnsWithTheSmallestEpsilon) {
  Settings settings = Small();  // zero heads: the first gradients of their hidden layers are 0
  for (const ParameterSpec& spec : DeclaredParameters()) {
    if (std::string(spec.name) == "adam_epsilon") settings.adam_epsilon = spec.min;
  }
  const ModelPointer model = Make(settings);
  for (std::uint64_t update = 0; update < 3; ++update) {
    Train(model.get(), PointBatch(6, 10, 1), update);
  }
}

TEST(Dreamer, DiscountsByGammaWithoutAContinuationModel) {
  const ModelPointer model = Make(Small());
  for (const double discount : Ask(model.get(), 3, 5).discounts) EXPECT_EQ(discount, 0.99);
}

// Everything a planner can ask about kRows different rows, in requests of `size` rows.
struct RowAnswers {
  std::vector<float> observed, imagined;
  std::vector<double> rewards, discounts, values, mode, samples;
};

RowAnswers AskInRequests(Model* model, std::uint64_t rows, std::uint64_t size,
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
  answers.mode.resize(rows * kActions);
  answers.samples.resize(rows * kActions * kEach);
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
    EXPECT_TRUE(model->Value(next, {.values = {answers.values.data() + first, n}}).ok());
    EXPECT_TRUE(model->ProposeMode(next, {answers.mode.data() + first, n, kActions}).ok());
    EXPECT_TRUE(
        model->ProposeSamples(next, seed, {answers.samples.data() + first * kEach, n * kEach, 1})
            .ok());
  }
  answers.observed = observed.floats();
  answers.imagined = imagined.floats();
  return answers;
}

// The law of rows in model.h: a planner would break ties by rounding, and an episode would
// depend on those that are evaluated beside it.
TEST(Dreamer, ARowHasTheSameAnswerWhateverStandsBesideIt) {
  constexpr std::uint64_t kRows = 512;
  for (const bool bfloat16 : {false, true}) {
    for (const char* preset : {"fast", "paper"}) {
      Settings settings = PresetSettings(preset);
      settings.horizon = 3;
      settings.imagination_starts = 20;
      settings.bfloat16_planning = bfloat16;
      settings.continuation = true;
      settings.imagined_latent_sample = true;
      const ModelPointer model = Make(settings);
      for (std::uint64_t update = 0; update < 3; ++update) {
        Train(model.get(), PointBatch(6, 10, 1), update);
      }
      const RowAnswers alone = AskInRequests(model.get(), kRows, 1, 1);
      for (const std::uint64_t size :
           {2u, 3u, 5u, 6u, 7u, 31u, 32u, 33u, 35u, 65u, 97u, 200u, 511u, 512u}) {
        SCOPED_TRACE(testing::Message() << preset << ", bfloat16 " << bfloat16 << ", " << size
                                        << " rows in a request");
        for (const std::uint64_t first_size : {size, std::uint64_t{1}}) {
          const RowAnswers together = AskInRequests(model.get(), kRows, size, first_size);
          EXPECT_TRUE(alone.observed == together.observed);
          EXPECT_TRUE(alone.imagined == together.imagined);
          EXPECT_TRUE(alone.rewards == together.rewards);
          EXPECT_TRUE(alone.discounts == together.discounts);
          EXPECT_TRUE(alone.values == together.values);
          EXPECT_TRUE(alone.mode == together.mode);
          EXPECT_TRUE(alone.samples == together.samples);
        }
      }
    }
  }
}

TEST(Dreamer, InitialLatentIsZeroAndPaddingStaysZero) {
  const ModelPointer model = Make(Small());
  EXPECT_EQ(model->latent_bytes() % kLatentAlignment, 0u);
  const Answers answers = Ask(model.get(), 2, 5);
  const std::size_t stride = model->latent_bytes() / sizeof(float);
  for (std::size_t i = 24 + 5; i < stride; ++i) {
    EXPECT_EQ(answers.imagined[i], 0);
    EXPECT_EQ(answers.observed[stride + i], 0);
  }
}

TEST(Dreamer, AllocatesNothingAfterWarmUp) {
  if (!DREAMSEARCH_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer allocates";
  for (const char* preset : {"fast", "paper"}) {
    SCOPED_TRACE(preset);
    Settings settings = PresetSettings(preset);
    settings.continuation = true;
    settings.horizon = 3;
    settings.imagination_starts = 300;  // more than one block
    const ModelPointer model = Make(settings, 1, 2, 1, 2);
    const OwnedBatch batch = PointBatch(20, 20, 1);
    std::vector<double> metrics(DeclaredMetrics().size);
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
      ok &= model->Value(from, {.values = {values.data(), n}}).ok();
      ok &= model->ProposeMode(from, {samples.data(), n, 1}).ok();
      ok &= model->ProposeSamples({from.data, 1, bytes}, {seeds.data, 1}, {samples.data(), n, 1})
                .ok();
      return ok;
    };
    const auto train = [&](std::uint64_t update) {
      model->SetThreads(2);  // as many as it has
      return model->Train({batch.view(), update, update, 0}, {metrics.data(), metrics.size()}).ok();
    };
    ASSERT_TRUE(train(0) && call_everything(150, 1) && train(1) && call_everything(150, 2));
    const std::uint64_t before = g_allocations.load();
    const bool ok = call_everything(1, 3) && call_everything(50, 4) && train(2) &&
                    call_everything(150, 5) && train(3);
    const std::uint64_t made = g_allocations.load() - before;
    EXPECT_TRUE(ok);
    EXPECT_EQ(made, 0u) << preset;
  }
  const std::uint64_t before = g_allocations.load();
  Buffer<float> counted;
  counted.Reserve(1000);
  EXPECT_GT(g_allocations.load(), before) << "the counter does not count";
}

TEST(Dreamer, RefusesNanInABatchAndStaysAsItWas) {
  const struct {
    const char* what;
    float* (*place)(OwnedBatch*);
    const char* named;
  } cases[] = {
      {"observation", [](OwnedBatch* b) { return &b->observations[7]; }, "observation loss"},
      {"reward", [](OwnedBatch* b) { return &b->rewards[7]; }, "reward loss"},
      {"action", [](OwnedBatch* b) { return &b->actions[7]; }, "observation loss"},
  };
  for (const char* preset : {"fast", "paper"}) {
    for (const auto& item : cases) {
      for (const float bad :
           {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        const ModelPointer model = Make(Small(preset));
        OwnedBatch batch = PointBatch(6, 10, 1);
        Train(model.get(), batch, 0);
        const std::vector<char> before = SavedBytes(*model);
        *item.place(&batch) = bad;
        std::vector<double> metrics(DeclaredMetrics().size);
        const Status status =
            model->Train({batch.view(), 1, 5, 0}, {metrics.data(), metrics.size()});
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

TEST(Dreamer, FindsNanInItsOwnLatents) {
  const ModelPointer model = Make(Small());
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

TEST(Dreamer, HasOneCriticAndSoNoSpread) {
  const ModelPointer model = Make(Small());
  LatentArray latents(*model, 3);
  for (std::size_t i = 0; i < latents.floats().size(); ++i) {
    latents.floats()[i] = 0.01f * static_cast<float>(i % 7);
  }
  std::vector<double> alone(3), values(3), deviations(3, -1), least(3, -1);
  ASSERT_TRUE(model->Value(latents, {.values = {alone.data(), 3}}).ok());
  ASSERT_TRUE(
      model->Value(latents, {{values.data(), 3}, {deviations.data(), 3}, {least.data(), 3}}).ok());
  EXPECT_EQ(values, alone);
  EXPECT_EQ(least, alone);
  EXPECT_EQ(deviations, std::vector<double>(3, 0));
}

// What a row draws follows from its own seed, wherever it stands.
TEST(Dreamer, ARowDrawsFromItsOwnSeed) {
  const ModelPointer model = Make(Small());
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

TEST(Dreamer, RefusesWrongSizes) {
  const ModelPointer model = Make(Small());
  LatentArray latents(*model, 2), next(*model, 2);
  std::vector<double> numbers(8);
  const auto code = [](const Status& status) { return status.code; };
  const std::uint64_t row_seeds[] = {0, 0};
  const View<const std::uint64_t> seeds{row_seeds, 2}, one_seed{row_seeds, 1};
  EXPECT_EQ(code(model->Value(latents, {.values = {numbers.data(), 3}})),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(code(model->Value(latents, {{numbers.data(), 2}, {numbers.data(), 1}, {}})),
            StatusCode::kInvalidArgument);
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

class Names final : public TensorSink {
 public:
  Status Tensor(const char* name, View<const std::uint64_t> shape,
                View<const float> values) noexcept override {
    std::uint64_t size = 1;
    for (const std::uint64_t n : shape) size *= n;
    EXPECT_EQ(size, values.size) << name;
    total += values.size;
    names.emplace_back(name);
    return OkStatus();
  }
  std::uint64_t total = 0;
  std::vector<std::string> names;
};

TEST(Dreamer, ExportsEveryParameterOnce) {
  const ModelPointer model = Make(PresetSettings("paper"), 1, 24, 6);
  Names sink;
  ASSERT_TRUE(model->Export(&sink).ok());
  // Multiply-adds of the layers at these sizes (weights), and one bias an output.
  const std::uint64_t weights =
      84800 + 7200 + 240000 + 52000 + 92000 + 90800 + 86200 + 168400 + 126200;
  const std::uint64_t biases = 3 * 200 + 200 + 2 * 600 + 260 + 260 + 424 + 401 + 812 + 601;
  EXPECT_EQ(sink.total, weights + biases + 2 * 24);
  EXPECT_EQ(sink.names.front(), "encoder.0.weight");
}

// The loss falls and the actor comes to prefer the way to the reward: from x = 0.5
// it pushes left, from -0.5 right.
TEST(Dreamer, LearnsAPointOnALine) {
  Settings settings = Small();
  settings.layer_norm = true;  // bears the high rates that keep this short
  settings.model_learning_rate = settings.value_learning_rate = 2e-3;
  settings.actor_learning_rate = 2e-3;
  settings.acting_latent_sample = false;
  settings.imagination_starts = 64;
  const ModelPointer model = Make(settings);
  std::vector<double> first, last;
  for (std::uint64_t update = 0; update < 250; ++update) {
    const std::vector<double> metrics = Train(model.get(), PointBatch(8, 12, update), update);
    if (update == 0) first = metrics;
    last = metrics;
  }
  EXPECT_LT(Metric(last, "observation_loss"), 0.2 * Metric(first, "observation_loss"));
  EXPECT_LT(Metric(last, "reward_loss"), 0.1 * Metric(first, "reward_loss"));
  EXPECT_GT(Metric(last, "imagined_return"), Metric(first, "imagined_return") + 1);
  double modes[2];
  for (const double x : {0.5, -0.5}) {
    LatentArray previous(*model, 1), latent(*model, 1);
    ASSERT_TRUE(model->InitialLatent(previous).ok());
    const double observation[] = {x, x * x};
    const double action[] = {0};
    const std::uint64_t seed = 0;
    ASSERT_TRUE(
        model->Observe({previous, {action, 1, 1}, {observation, 1, 2}, {}, {&seed, 1}}, latent)
            .ok());
    ASSERT_TRUE(model->ProposeMode(latent, {&modes[x < 0], 1, 1}).ok());
  }
  EXPECT_LT(modes[0], -0.3);
  EXPECT_GT(modes[1], 0.3);
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
