// broken_models.cc - a linear model that learns its reward, and what can be wrong with one.
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "dreamsearch/plugin.h"
#include "dreamsearch/random.h"
#include "tests/sdk/check/broken.h"

namespace dreamsearch::check {
namespace {

enum class Fault {
  kNone,
  kRefusesToTrainInAnEpisode,
  kTakesAnySize,
  kLeavesDeviations,
  kDiscountsAboveOne,
  kWritesPastTheRewards,
  kReadsTheNextRow,
  kCountsRows,
  kNoticesRepeats,
  kSharesState,
  kForgetsOnSave,
  kTakesCutBytes,
  kAllocates,
  kLearnsNan,
  kCountsThreads,
  kWrongShape,
  kForgetsTheValueInGradients,
  kReportsAnotherReturn,
  kDoesNotSayThatItLearns,
};

double shared_bias = 0;  // of Fault::kSharesState

// The others give none: what is wrong with their transitions would be wrong with the gradient too.
constexpr bool GivesGradients(Fault fault) {
  return fault == Fault::kNone || fault == Fault::kForgetsTheValueInGradients ||
         fault == Fault::kReportsAnotherReturn;
}

// A latent is the first four entries of the observation; the reward is a learned bias plus the
// first of them.
template <Fault kFault>
class Linear final : public Offers<Model, ValueSpread, ReturnGradient, TensorExport> {
 public:
  explicit Linear(const ModelContext& context)
      : observation_size_(context.observation_size), action_size_(context.action_size) {
    Random random(context.seed);
    bias() = random.Uniform();
  }

  void* Extension(const char* name) noexcept override {
    if (!GivesGradients(kFault) && std::strcmp(name, ReturnGradient::kName) == 0) return nullptr;
    return Offers::Extension(name);
  }

  std::uint64_t latent_bytes() const noexcept override { return kLatentAlignment; }
  std::uint64_t action_size() const noexcept override { return action_size_; }

  Status InitialLatent(Latents latents) noexcept override {
    std::memset(latents.data, 0, latents.size());
    return OkStatus();
  }

  Status Observe(const ObserveRequest& request, Latents latents) noexcept override {
    asked_ = true;
    std::memset(latents.data, 0, latents.size());
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      double x[4] = {};
      for (std::uint64_t j = 0; j < observation_size_; ++j) {
        x[j % 4] += request.observations(i, j);
      }
      for (double& entry : x) entry = std::tanh(entry);
      Write(latents, i, x);
    }
    return OkStatus();
  }

  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    const std::uint64_t n = request.latents.rows;
    if (kFault != Fault::kTakesAnySize &&
        (request.latents.cols != kLatentAlignment || request.actions.cols != action_size_ ||
         request.actions.rows != n || request.seeds.size != n || result.rewards.size != n ||
         result.discounts.size != n || result.latents.rows != n)) {
      return Error(StatusCode::kInvalidArgument, "Imagine: views of other sizes");
    }
    if (kFault == Fault::kAllocates) scratch_.assign(1, std::vector<double>(n));
    const bool again = seeds_.size() == n &&
                       std::memcmp(seeds_.data(), request.seeds.data, n * sizeof seeds_[0]) == 0;
    if (kFault == Fault::kNoticesRepeats) seeds_.assign(request.seeds.begin(), request.seeds.end());
    for (std::uint64_t i = 0; i < n; ++i) {
      double x[4], next[4];
      Read(request.latents, i, x);
      Read(request.latents, (i + 1) % n, next);
      for (std::uint64_t j = 0; j < action_size_; ++j) {
        x[j % 4] = std::tanh(x[j % 4] + 0.1 * request.actions(i, j));
      }
      Write(result.latents, i, x);
      result.rewards[i] = bias() + x[0];
      if (kFault == Fault::kReadsTheNextRow) result.rewards[i] += 1e-9 * next[0];
      if (kFault == Fault::kCountsRows) result.rewards[i] += 0.01 * static_cast<double>(n);
      if (kFault == Fault::kNoticesRepeats && again) result.rewards[i] += 0.01;
      if (kFault == Fault::kCountsThreads) result.rewards[i] += 0.01 * threads_;
      result.discounts[i] = kFault == Fault::kDiscountsAboveOne ? 7 : 0.99;
    }
    if (kFault == Fault::kWritesPastTheRewards) result.rewards.data[n] = 0;
    return OkStatus();
  }

  Status Value(ConstLatents latents, View<double> values) noexcept override {
    return Spread(latents, {.values = values});
  }
  Status Spread(ConstLatents latents, const SpreadResult& result) noexcept override {
    if (kFault != Fault::kTakesAnySize &&
        (latents.cols != kLatentAlignment || !HasRoom(result, latents.rows))) {
      return Error(StatusCode::kInvalidArgument, "Value: views of other sizes");
    }
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      double x[4];
      Read(latents, i, x);
      result.values[i] = 10 * x[0];
      if (!result.deviations.empty() && kFault != Fault::kLeavesDeviations) {
        result.deviations[i] = 0;
      }
      if (!result.least.empty()) result.least[i] = result.values[i];
    }
    return OkStatus();
  }

  // Entry 0 of a latent alone decides rewards and values, and an action moves it by a tenth of the
  // sum of its entries 0, 4, 8, ...
  Status Gradient(const GradientRequest& request, const GradientResult& result) noexcept override {
    const std::uint64_t n = request.latents.rows, rows = request.actions.rows;
    const std::uint64_t horizon = n == 0 ? 0 : rows / n;
    if (request.latents.cols != kLatentAlignment || request.actions.cols != action_size_ ||
        rows != n * horizon || request.seeds.size != rows || result.returns.size != n ||
        result.gradients.rows != rows || result.gradients.cols != action_size_) {
      return Error(StatusCode::kInvalidArgument, "Gradient: views of other sizes");
    }
    for (std::uint64_t b = 0; b < n; ++b) {
      double x[4];
      Read(request.latents, b, x);
      double sum = 0, left = 1;
      for (std::uint64_t t = 0; t < horizon; ++t) {
        double moved = x[0];
        for (std::uint64_t j = 0; j < action_size_; j += 4) {
          moved += 0.1 * request.actions(b * horizon + t, j);
        }
        x[0] = std::tanh(moved);
        sum += left * (bias() + x[0]);
        left *= 0.99;
        // Until the way back below: how much of a change of the entry before is left.
        result.gradients(b * horizon + t, 0) = 1 - x[0] * x[0];
      }
      result.returns[b] = sum + left * 10 * x[0];
      if (kFault == Fault::kReportsAnotherReturn) result.returns[b] += 0.5;
      double slope = kFault == Fault::kForgetsTheValueInGradients ? 0 : left * 10;
      for (std::uint64_t t = horizon; t-- > 0;) {
        const View<double> row = result.gradients.row(b * horizon + t);
        left /= 0.99;
        slope = (slope + left) * row[0];
        for (std::uint64_t j = 0; j < action_size_; ++j) row[j] = j % 4 == 0 ? 0.1 * slope : 0;
      }
    }
    return OkStatus();
  }

  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override {
    if (kFault != Fault::kTakesAnySize &&
        (latents.cols != kLatentAlignment || actions.rows != latents.rows ||
         actions.cols != action_size_)) {
      return Error(StatusCode::kInvalidArgument, "ProposeMode: views of other sizes");
    }
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      double x[4];
      Read(latents, i, x);
      for (std::uint64_t j = 0; j < action_size_; ++j) actions(i, j) = -x[j % 4];
    }
    return OkStatus();
  }

  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override {
    if (kFault != Fault::kTakesAnySize &&
        (latents.rows == 0 || actions.rows % latents.rows != 0 || actions.cols != action_size_ ||
         seeds.size != latents.rows)) {
      return Error(StatusCode::kInvalidArgument, "ProposeSamples: views of other sizes");
    }
    const std::uint64_t each = actions.rows / latents.rows;
    for (std::uint64_t i = 0; i < actions.rows; ++i) {
      Random random(DeriveSeed(seeds[i / each], i % each));
      for (std::uint64_t j = 0; j < action_size_; ++j) actions(i, j) = random.Uniform(-1, 1);
    }
    return OkStatus();
  }

  Status Train(const TrainRequest& request, View<double> metrics) noexcept override {
    if (kFault == Fault::kRefusesToTrainInAnEpisode && asked_) {
      return Error(StatusCode::kFailedPrecondition, "an episode is under way");
    }
    double mean = 0, seen = 0;
    for (const float reward : request.batch->rewards) mean += reward;
    mean /= static_cast<double>(request.batch->rewards.size);
    for (std::uint64_t i = 0; i < request.batch->observations.size(); ++i) {
      seen += request.batch->observations.data[i];
    }
    if (kFault != Fault::kLearnsNan && !std::isfinite(mean + seen)) {
      return Error(StatusCode::kNotFinite, "update %llu: the mean reward is %g",
                   static_cast<unsigned long long>(request.update), mean);
    }
    momentum_ = 0.9 * momentum_ + 0.1 * (mean - bias());
    bias() += 0.1 * momentum_;
    metrics[0] = std::isfinite(mean) ? mean - bias() : 0;
    return OkStatus();
  }

  void SetThreads(std::uint32_t threads) noexcept override { threads_ = threads; }

  Status Save(ByteSink* sink) const noexcept override {
    if (Status status = WriteValue(sink, bias()); !status.ok()) return status;
    const double momentum = kFault == Fault::kForgetsOnSave ? 0 : momentum_;
    return WriteValue(sink, momentum);
  }
  Status Load(ByteSource* source) noexcept override {
    Status status = ReadValue(source, &bias());
    if (status.ok()) status = ReadValue(source, &momentum_);
    return kFault == Fault::kTakesCutBytes ? OkStatus() : status;
  }
  Status Export(TensorSink* sink) const noexcept override {
    const auto bias_value = static_cast<float>(bias());
    const std::uint64_t shape[] = {kFault == Fault::kWrongShape ? 2u : 1u};
    return sink->Tensor("bias", {shape, 1}, {&bias_value, 1});
  }
  void Destroy() noexcept override { delete this; }

 private:
  ~Linear() = default;

  double& bias() { return kFault == Fault::kSharesState ? shared_bias : bias_; }
  double bias() const { return kFault == Fault::kSharesState ? shared_bias : bias_; }

  static void Read(ConstLatents latents, std::uint64_t row, double (&x)[4]) {
    std::memcpy(x, latents.data + row * kLatentAlignment, sizeof x);
  }
  static void Write(Latents latents, std::uint64_t row, const double (&x)[4]) {
    std::memcpy(latents.data + row * kLatentAlignment, x, sizeof x);
  }

  const std::uint64_t observation_size_, action_size_;
  double bias_ = 0, momentum_ = 0;
  std::uint32_t threads_ = 1;
  bool asked_ = false;
  std::vector<std::vector<double>> scratch_;
  std::vector<std::uint64_t> seeds_;
};

template <Fault kFault>
Status Create(const ModelContext& context, Model** result) noexcept {
  *result = new Linear<kFault>(context);
  return OkStatus();
}

constexpr MetricSpec kMetrics[] = {{"error", "", "how far the mean reward is from the bias"}};

template <Fault kFault>
const ComponentDescriptor* Component() {
  static const ComponentDescriptor component = [] {
    ComponentDescriptor made;
    made.kind = ComponentKind::kModel;
    if (kFault != Fault::kDoesNotSayThatItLearns) made.traits |= kLearns;
    if (GivesGradients(kFault)) made.traits |= kGivesGradients;
    made.name = "broken_model";
    made.version = "1.0.0";
    made.summary = "right but for one thing";
    made.metrics = ViewOf(kMetrics);
    made.create_model = Create<kFault>;
    return made;
  }();
  return &component;
}

}  // namespace

std::vector<BrokenComponent> BrokenModels() {
  constexpr auto kExtremes = Level::kExtremes;
  return {
      {Component<Fault::kNone>(), "", "", kExtremes},
      {Component<Fault::kDoesNotSayThatItLearns>(), "C2", "Train is never called", kExtremes},
      {Component<Fault::kRefusesToTrainInAnEpisode>(), "M1", "an episode is under way"},
      {Component<Fault::kTakesAnySize>(), "M2", "success"},
      {Component<Fault::kLeavesDeviations>(), "M3", "NaN, or was not set"},
      {Component<Fault::kDiscountsAboveOne>(), "M3", "value 0 is 7"},
      {Component<Fault::kWritesPastTheRewards>(), "M3", "a write 24 bytes from its beginning"},
      {Component<Fault::kReadsTheNextRow>(), "M4", "", kExtremes},
      {Component<Fault::kCountsRows>(), "M5", "", kExtremes},
      {Component<Fault::kNoticesRepeats>(), "M6", "", kExtremes},
      {Component<Fault::kSharesState>(), "M7", "", kExtremes},
      {Component<Fault::kForgetsOnSave>(), "M8", "", kExtremes},
      {Component<Fault::kTakesCutBytes>(), "M9", "success", kExtremes},
      {Component<Fault::kAllocates>(), "M10", "in a request of", kExtremes},
      {Component<Fault::kLearnsNan>(), "M11", "success", kExtremes},
      {Component<Fault::kCountsThreads>(), "M12", "", kExtremes},
      {Component<Fault::kWrongShape>(), "M13", "", kExtremes},
      {Component<Fault::kForgetsTheValueInGradients>(), "M14", "a gradient of ", kExtremes},
      {Component<Fault::kReportsAnotherReturn>(), "M14", "", kExtremes},
  };
}

}  // namespace dreamsearch::check
