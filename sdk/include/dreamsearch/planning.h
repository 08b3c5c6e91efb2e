// planning.h - what most planners need besides the interface.
//
// Aligned memory for latents, exploration noise, the use of values' spread, the checks of
// planner.h, and the factory of factory.h. Nothing here crosses the plugin
// boundary: a planner may use all of it or none.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <stdexcept>
#include <vector>

#include "dreamsearch/extension.h"
#include "dreamsearch/factory.h"
#include "dreamsearch/plugin.h"
#include "dreamsearch/random.h"
#include "dreamsearch/settings.h"

namespace dreamsearch {

// Owns `rows` latents, aligned as models expect them.
class LatentBuffer {
 public:
  LatentBuffer() = default;
  // Throws std::bad_alloc, std::length_error.
  LatentBuffer(std::uint64_t rows, std::uint64_t latent_bytes)
      : rows_(rows), latent_bytes_(latent_bytes) {
    if (latent_bytes != 0 && rows > PTRDIFF_MAX / latent_bytes) {
      throw std::length_error("the latents do not fit the address space");
    }
    data_.reset(static_cast<std::byte*>(
        ::operator new (rows* latent_bytes, std::align_val_t{kLatentAlignment})));
  }

  std::uint64_t rows() const noexcept { return rows_; }
  Latents middle_rows(std::uint64_t first, std::uint64_t count) noexcept {
    return {data_.get() + first * latent_bytes_, count, latent_bytes_};
  }
  Latents row(std::uint64_t i) noexcept { return middle_rows(i, 1); }
  ConstLatents row(std::uint64_t i) const noexcept {
    return {data_.get() + i * latent_bytes_, 1, latent_bytes_};
  }
  void Set(std::uint64_t i, ConstLatents latent) noexcept {
    std::memcpy(data_.get() + i * latent_bytes_, latent.data, latent_bytes_);
  }

 private:
  struct Free {
    void operator()(std::byte* data) const noexcept {
      ::operator delete (data, std::align_val_t{kLatentAlignment});
    }
  };
  std::unique_ptr<std::byte, Free> data_;
  std::uint64_t rows_ = 0;
  std::uint64_t latent_bytes_ = 0;
};

// Adds N(0, std^2) to every component and clips to [-1, 1]; nothing when std is 0.
inline void AddExplorationNoise(double std, std::uint64_t seed,
                                MatrixView<double> actions) noexcept {
  if (std == 0) return;
  Random random(seed);
  for (std::uint64_t i = 0; i < actions.size(); ++i) {
    actions.data[i] = std::clamp(actions.data[i] + std * random.Normal(), -1.0, 1.0);
  }
}

// The Euclidean distance of two actions.
inline double ActionDistance(View<const double> a, View<const double> b) noexcept {
  double sum = 0;
  for (std::uint64_t i = 0; i < a.size; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

// How a search uses the spread of a model's values (ValueSpread). With a model that offers none
// these change nothing.
struct ValueUse {
  double value_bonus;
  bool least_in_evaluation;
};
inline constexpr auto kValueBonusParameter = Bind<&ValueUse::value_bonus>(RealParameter(
    "value_bonus", 0, -100, 100, "deviations",
    "Added to a value of the model while exploring, in deviations of its ensemble (EfficientTDMPC "
    "2026: 0.3)."));
inline constexpr auto kValueInEvaluationParameter =
    Bind<&ValueUse::least_in_evaluation>(ChoiceParameter(
        "value_in_evaluation", "mean", "mean,least",
        "The value of the model while not exploring: its ensemble's mean or least (MRS.Q 2026)."));

// Asks for values as those two parameters say, for up to `rows` latents at once.
class SearchValues {
 public:
  SearchValues(const ValueUse& use, std::uint64_t rows) : use_(use) {
    if (use.value_bonus != 0) deviations_.resize(rows);
    if (use.least_in_evaluation) means_.resize(rows);
  }

  Status Ask(LatentModel* model, ConstLatents latents, bool explore, View<double> values) noexcept {
    const bool bonus = explore && use_.value_bonus != 0;
    const bool least = !explore && use_.least_in_evaluation;
    auto* spread = bonus || least ? ExtensionOf<ValueSpread>(model) : nullptr;
    if (spread == nullptr) return model->Value(latents, values);
    if (least) {
      return spread->Spread(latents, {.values = {means_.data(), values.size}, .least = values});
    }
    const Status status = spread->Spread(
        latents, {.values = values, .deviations = {deviations_.data(), values.size}});
    for (std::uint64_t i = 0; i < values.size; ++i) values[i] += use_.value_bonus * deviations_[i];
    return status;
  }

 private:
  const ValueUse use_;
  std::vector<double> deviations_, means_;
};

// What a planner was made for; `metrics` counts the component's MetricSpecs.
struct PlannerSizes {
  std::uint64_t action_size = 0;
  std::uint64_t latent_bytes = 0;
  std::uint64_t metrics = 0;
};

// The kInvalidArgument of Planner::BeginEpisode.
inline Status CheckModel(const PlannerSizes& sizes, const LatentModel* model) noexcept {
  if (model == nullptr) return Error(StatusCode::kInvalidArgument, "the model is null");
  if (model->latent_bytes() != sizes.latent_bytes || model->action_size() != sizes.action_size) {
    return Error(StatusCode::kInvalidArgument,
                 "the planner was made for latents of %llu bytes and %llu action components, "
                 "the model has %llu and %llu",
                 static_cast<unsigned long long>(sizes.latent_bytes),
                 static_cast<unsigned long long>(sizes.action_size),
                 static_cast<unsigned long long>(model->latent_bytes()),
                 static_cast<unsigned long long>(model->action_size()));
  }
  return OkStatus();
}

// The kFailedPrecondition and kInvalidArgument of Planner::Plan. `model` is null
// before the first episode.
inline Status CheckPlan(const PlannerSizes& sizes, const LatentModel* model,
                        const PlanRequest& request, const PlanResult* result) noexcept {
  if (model == nullptr) {
    return Error(StatusCode::kFailedPrecondition, "Plan before BeginEpisode: there is no model");
  }
  if (result == nullptr) return Error(StatusCode::kInvalidArgument, "the result is null");
  if (request.root.rows != 1 || request.root.cols != sizes.latent_bytes) {
    return Error(StatusCode::kInvalidArgument, "the root is [%llu, %llu] bytes, expected [1, %llu]",
                 static_cast<unsigned long long>(request.root.rows),
                 static_cast<unsigned long long>(request.root.cols),
                 static_cast<unsigned long long>(sizes.latent_bytes));
  }
  if (result->action.size != sizes.action_size) {
    return Error(StatusCode::kInvalidArgument, "the action has %llu components, expected %llu",
                 static_cast<unsigned long long>(result->action.size),
                 static_cast<unsigned long long>(sizes.action_size));
  }
  if (result->metrics.size != sizes.metrics) {
    return Error(StatusCode::kInvalidArgument, "there is room for %llu metrics, expected %llu",
                 static_cast<unsigned long long>(result->metrics.size),
                 static_cast<unsigned long long>(sizes.metrics));
  }
  return OkStatus();
}

// PolicyReporting::ReportPolicy: the heaviest of a search's actions, the earlier of equals first.
// each(visit) calls visit(weight, action) for every action, in the same order whenever it is
// called; a weight is not negative, at least one is positive.
template <typename Each>
Status FillPolicy(const PlannerSizes& sizes, Each each, MatrixView<double> actions,
                  View<double> weights) noexcept {
  if (actions.rows != weights.size || actions.cols != sizes.action_size) {
    return Error(StatusCode::kInvalidArgument,
                 "there is room for a policy of %llu actions of %llu components and %llu weights, "
                 "expected as many of %llu",
                 static_cast<unsigned long long>(actions.rows),
                 static_cast<unsigned long long>(actions.cols),
                 static_cast<unsigned long long>(weights.size),
                 static_cast<unsigned long long>(sizes.action_size));
  }
  double last_weight = 0, sum = 0;
  std::uint64_t last = 0;
  for (std::uint64_t k = 0; k < weights.size; ++k) {
    const View<double> kept = actions.row(k);
    double best_weight = 0;
    std::uint64_t i = 0, best = 0;
    each([&](double weight, View<const double> action) {
      const std::uint64_t index = i++;
      const bool reported =
          k > 0 && (weight > last_weight || (weight == last_weight && index <= last));
      if (reported || weight <= best_weight) return;
      best_weight = weight;
      best = index;
      std::copy_n(action.data, action.size, kept.data);
    });
    if (best_weight == 0) std::fill_n(kept.data, kept.size, 0.0);
    weights[k] = last_weight = best_weight;
    last = best;
    sum += best_weight;
  }
  for (double& weight : weights) weight /= sum;
  return OkStatus();
}

// kNotFinite unless every value is finite; `what` names one of them.
inline Status CheckFinite(const char* what, View<const double> values) noexcept {
  for (std::uint64_t i = 0; i < values.size; ++i) {
    if (!std::isfinite(values[i])) {
      return Error(StatusCode::kNotFinite, "the model's %s %llu of %llu is not finite: %g", what,
                   static_cast<unsigned long long>(i) + 1,
                   static_cast<unsigned long long>(values.size), values[i]);
    }
  }
  return OkStatus();
}

// A planner that carries nothing from one decision to the next: a class of it writes Plan, which
// begins with CheckPlan(sizes_, model_, request, result). One with extensions derives from
// Offers<MemorylessPlanner, ...>.
class MemorylessPlanner : public Planner {
 public:
  Status BeginEpisode(LatentModel* model) noexcept override {
    if (Status status = CheckModel(sizes_, model); !status.ok()) return status;
    model_ = model;
    return OkStatus();
  }
  Status Save(ByteSink*) const noexcept final { return OkStatus(); }
  Status Load(ByteSource*) noexcept final { return OkStatus(); }
  void Destroy() noexcept final { delete this; }

 protected:
  // `metrics` counts the component's MetricSpecs.
  MemorylessPlanner(const PlannerContext& context, std::uint64_t metrics)
      : sizes_{context.action_size, context.latent_bytes, metrics} {}
  virtual ~MemorylessPlanner() = default;

  const PlannerSizes sizes_;
  LatentModel* model_ = nullptr;  // from the first BeginEpisode on
};

}  // namespace dreamsearch
