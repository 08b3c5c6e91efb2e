// linear_model.cc - a linear model of the world, learned step by step.
//
// A latent is the observation. Of one transition it learns the change of the observation and the
// reward, each linear in (observation, action, 1); the value is linear in (observation, 1) and
// learned from the value after (TD(0), Sutton 1988). All of them by normalised least mean squares
// (Widrow and Hoff 1960), which is stable whatever the scale. Its actor knows nothing: the mode is
// 0, samples are uniform. A search does the work.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "dreamsearch/factory.h"
#include "dreamsearch/random.h"
#include "dreamsearch/settings.h"

namespace dreamsearch {
namespace {

struct Settings {
  double rate;
  double discount;
};
constexpr auto kSettings = BindSettings<Settings>(
    Bind<&Settings::rate>(RealParameter("rate", 0.1, 0, 1, "", "Step size of every update.")),
    Bind<&Settings::discount>(
        RealParameter("discount", 0.97, 0, 1, "", "Discount of a decision.")));

constexpr MetricSpec kMetrics[] = {
    {"change_error", "", "Mean absolute error of the predicted change of an observation entry."},
    {"reward_error", "", "Mean absolute error of the predicted reward."},
    {"value_error", "", "Mean absolute error of the value against the one after."},
};

// What it has learned: row i of `change` predicts the change of observation entry i.
struct Weights {
  std::vector<double> change, reward, value;
};

class LinearModel final : public Offers<Model, TensorExport> {
 public:
  explicit LinearModel(const ModelContext& context)
      : settings_(kSettings.Read(context.parameters)),
        o_(context.observation_size),
        a_(context.action_size),
        f_(o_ + a_ + 1),
        latent_bytes_((o_ * sizeof(double) + kLatentAlignment - 1) / kLatentAlignment *
                      kLatentAlignment),
        weights_{std::vector<double>(o_ * f_), std::vector<double>(f_),
                 std::vector<double>(o_ + 1)},
        features_(f_) {}

  std::uint64_t latent_bytes() const noexcept override { return latent_bytes_; }
  std::uint64_t action_size() const noexcept override { return a_; }

  Status InitialLatent(Latents latents) noexcept override {
    if (latents.cols != latent_bytes_) return WrongSizes("InitialLatent");
    std::memset(latents.data, 0, latents.size());
    return OkStatus();
  }

  Status Observe(const ObserveRequest& request, Latents latents) noexcept override {
    if (latents.cols != latent_bytes_ || request.observations.rows != latents.rows ||
        request.observations.cols != o_) {
      return WrongSizes("Observe");
    }
    std::memset(latents.data, 0, latents.size());
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      std::copy_n(request.observations.row(i).data, o_, State(latents, i));
    }
    return OkStatus();
  }

  Status Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept override {
    const std::uint64_t rows = request.latents.rows;
    if (request.latents.cols != latent_bytes_ || request.actions.rows != rows ||
        request.actions.cols != a_ || request.seeds.size != rows || result.latents.rows != rows ||
        result.latents.cols != latent_bytes_ || result.rewards.size != rows ||
        result.discounts.size != rows) {
      return WrongSizes("Imagine");
    }
    std::memset(result.latents.data, 0, result.latents.size());
    for (std::uint64_t i = 0; i < rows; ++i) {
      const double* from = State(request.latents, i);
      double* to = State(result.latents, i);
      SetFeatures(from, request.actions.row(i).data);
      for (std::uint64_t j = 0; j < o_; ++j) {
        to[j] = from[j] + Dot(&weights_.change[j * f_], features_.data(), f_);
      }
      result.rewards[i] = Dot(weights_.reward.data(), features_.data(), f_);
      result.discounts[i] = settings_.discount;
    }
    return OkStatus();
  }

  Status Value(ConstLatents latents, View<double> values) noexcept override {
    if (latents.cols != latent_bytes_ || values.size != latents.rows) return WrongSizes("Value");
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      values[i] = ValueOf(weights_, State(latents, i));
    }
    return OkStatus();
  }

  Status ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept override {
    if (latents.cols != latent_bytes_ || actions.rows != latents.rows || actions.cols != a_) {
      return WrongSizes("ProposeMode");
    }
    std::fill_n(actions.data, actions.size(), 0.0);
    return OkStatus();
  }

  Status ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                        MatrixView<double> actions) noexcept override {
    if (latents.cols != latent_bytes_ || latents.rows == 0 || seeds.size != latents.rows ||
        actions.rows % latents.rows != 0 || actions.cols != a_) {
      return WrongSizes("ProposeSamples");
    }
    const std::uint64_t each = actions.rows / latents.rows;
    for (std::uint64_t i = 0; i < latents.rows; ++i) {
      Random random(seeds[i]);  // a row's seed decides its draws, whatever the other rows are
      const MatrixView<double> own = actions.middle_rows(i * each, each);
      for (std::uint64_t j = 0; j < own.size(); ++j) own.data[j] = random.Uniform(-1, 1);
    }
    return OkStatus();
  }

  Status Train(const TrainRequest& request, View<double> metrics) noexcept override {
    if (metrics.size != std::size(kMetrics)) return WrongSizes("Train");
    const SequenceBatch& batch = *request.batch;
    Weights learned = weights_;  // so that a batch which is not finite leaves no trace
    double change_error = 0, reward_error = 0, value_error = 0;
    std::uint64_t count = 0;
    std::vector<double> before(o_), after(o_), action(a_);
    for (std::uint64_t row = 1; row < batch.rewards.size; ++row) {
      if (row % batch.length == 0 || batch.is_first[row] != 0) continue;  // not led to by the last
      ++count;
      for (std::uint64_t j = 0; j < o_; ++j) before[j] = batch.observations(row - 1, j);
      for (std::uint64_t j = 0; j < o_; ++j) after[j] = batch.observations(row, j);
      for (std::uint64_t j = 0; j < a_; ++j) action[j] = batch.actions(row, j);
      SetFeatures(before.data(), action.data());
      for (std::uint64_t j = 0; j < o_; ++j) {
        change_error += Learn(after[j] - before[j], features_.data(), f_, &learned.change[j * f_]) /
                        static_cast<double>(o_);
      }
      reward_error += Learn(batch.rewards[row], features_.data(), f_, learned.reward.data());
      const double target = batch.rewards[row] + settings_.discount * batch.discounts[row] *
                                                     ValueOf(learned, after.data());
      before.push_back(1);
      value_error += Learn(target, before.data(), o_ + 1, learned.value.data());
      before.pop_back();
    }
    const double total = change_error + reward_error + value_error;
    if (!std::isfinite(total)) {
      return Error(StatusCode::kNotFinite, "update %llu: the sum of errors is %g",
                   static_cast<unsigned long long>(request.update), total);
    }
    const double scale = 1 / static_cast<double>(std::max<std::uint64_t>(count, 1));
    metrics[0] = change_error * scale;
    metrics[1] = reward_error * scale;
    metrics[2] = value_error * scale;
    weights_ = std::move(learned);
    return OkStatus();
  }

  Status Save(ByteSink* sink) const noexcept override {
    for (const std::vector<double>* part : {&weights_.change, &weights_.reward, &weights_.value}) {
      if (Status status = sink->Write(part->data(), part->size() * sizeof(double)); !status.ok()) {
        return status;
      }
    }
    return OkStatus();
  }
  Status Load(ByteSource* source) noexcept override {
    for (std::vector<double>* part : {&weights_.change, &weights_.reward, &weights_.value}) {
      if (Status status = source->Read(part->data(), part->size() * sizeof(double)); !status.ok()) {
        return status;
      }
    }
    return OkStatus();
  }

  Status Export(TensorSink* sink) const noexcept override {
    const std::vector<float> reward(weights_.reward.begin(), weights_.reward.end());
    const std::vector<float> value(weights_.value.begin(), weights_.value.end());
    const std::uint64_t reward_shape[] = {f_}, value_shape[] = {o_ + 1};
    Status status = sink->Tensor("reward", {reward_shape, 1}, {reward.data(), reward.size()});
    if (!status.ok()) return status;
    return sink->Tensor("value", {value_shape, 1}, {value.data(), value.size()});
  }
  void Destroy() noexcept override { delete this; }

 private:
  ~LinearModel() = default;

  static Status WrongSizes(const char* call) noexcept {
    return Error(StatusCode::kInvalidArgument, "%s: views of wrong sizes", call);
  }
  static const double* State(ConstLatents latents, std::uint64_t row) noexcept {
    return reinterpret_cast<const double*>(latents.row(row).data);
  }
  static double* State(Latents latents, std::uint64_t row) noexcept {
    return reinterpret_cast<double*>(latents.row(row).data);
  }
  static double Dot(const double* a, const double* b, std::uint64_t size) noexcept {
    double sum = 0;
    for (std::uint64_t i = 0; i < size; ++i) sum += a[i] * b[i];
    return sum;
  }
  double ValueOf(const Weights& weights, const double* state) const noexcept {
    return Dot(weights.value.data(), state, o_) + weights.value[o_];
  }
  // features_ = (observation, action, 1).
  void SetFeatures(const double* observation, const double* action) noexcept {
    std::copy_n(observation, o_, features_.begin());
    std::copy_n(action, a_, features_.begin() + static_cast<std::ptrdiff_t>(o_));
    features_[o_ + a_] = 1;
  }
  // Moves `weights` towards predicting `target`; returns how far off they were.
  double Learn(double target, const double* features, std::uint64_t size,
               double* weights) const noexcept {
    const double error = target - Dot(weights, features, size);
    const double step = settings_.rate * error / Dot(features, features, size);
    for (std::uint64_t i = 0; i < size; ++i) weights[i] += step * features[i];
    return std::abs(error);
  }

  const Settings settings_;
  const std::uint64_t o_, a_, f_, latent_bytes_;
  Weights weights_;
  std::vector<double> features_;
};

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kModel,
    .traits = kLearns,
    .name = "linear_model",
    .version = "1.0.0",
    .summary = "A linear model of observations, rewards and values, for a search to plan with",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kMetrics),
    .create_model = CreateModel<LinearModel>,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("linear_model", "1.0.0", dreamsearch::kComponents)
