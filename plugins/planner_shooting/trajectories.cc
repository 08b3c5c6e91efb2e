#include "trajectories.h"

#include <limits>
#include <numeric>

namespace dreamsearch {

Trajectories::Trajectories(const PlannerContext& context, const ShootingSettings& settings)
    : count_(settings.candidates),
      horizon_(settings.horizon),
      action_size_(context.action_size),
      latents_{LatentBuffer(count_, context.latent_bytes),
               LatentBuffer(count_, context.latent_bytes)},
      seeds_(count_),
      actions_(horizon_ * count_ * action_size_),
      rewards_(horizon_ * count_),
      discounts_(horizon_ * count_),
      search_values_(settings, count_),
      values_(count_),
      returns_(horizon_ * count_),
      order_(count_) {}

double Trajectories::ReturnSpread() const noexcept {
  double mean = 0;
  for (const double value : returns()) mean += value / static_cast<double>(count_);
  double variance = 0;
  for (const double value : returns()) {
    variance += (value - mean) * (value - mean) / static_cast<double>(count_);
  }
  // Returns of 1e200 are finite, their squares are not.
  return std::min(std::sqrt(variance), std::numeric_limits<double>::max());
}

Status Trajectories::FollowActor(LatentModel* model, ConstLatents root, std::uint64_t rows,
                                 std::uint64_t seed) noexcept {
  const std::uint64_t first_seed = DeriveSeed(seed, 0);
  Status status = model->ProposeSamples(root, {&first_seed, 1}, actions(0).middle_rows(0, rows));
  if (!status.ok()) return status;
  for (std::uint64_t i = 0; i < rows; ++i) latents_[0].Set(i, root);
  for (std::uint64_t t = 0; t + 1 < horizon_; ++t) {
    const Latents from = latents_[t % 2].middle_rows(0, rows);
    const Latents to = latents_[(t + 1) % 2].middle_rows(0, rows);
    status = model->Imagine(
        {from, actions(t).middle_rows(0, rows), Seeds(DeriveSeed(seed, 2 * t + 1), rows)},
        {to, {rewards_.data(), rows}, {discounts_.data(), rows}});
    if (!status.ok()) return status;
    status = model->ProposeSamples(to, Seeds(DeriveSeed(seed, 2 * t + 2), rows),
                                   actions(t + 1).middle_rows(0, rows));
    if (!status.ok()) return status;
  }
  for (std::uint64_t t = 0; t < horizon_; ++t) {
    status = CheckFinite("action component", {actions(t).data, rows * action_size_});
    if (!status.ok()) return status;
  }
  return OkStatus();
}

Status Trajectories::Imagine(LatentModel* model, const PlanRequest& request, bool bootstrap,
                             std::uint64_t seed) noexcept {
  for (std::uint64_t i = 0; i < count_; ++i) latents_[0].Set(i, request.root);
  for (std::uint64_t t = 0; t < horizon_; ++t) {
    const View<double> rewards{rewards_.data() + t * count_, count_};
    const View<double> discounts{discounts_.data() + t * count_, count_};
    Status status = model->Imagine(
        {latents_[t % 2].middle_rows(0, count_), actions(t), Seeds(DeriveSeed(seed, t), count_)},
        {latents_[(t + 1) % 2].middle_rows(0, count_), rewards, discounts});
    if (!status.ok()) return status;
  }
  std::fill(values_.begin(), values_.end(), 0.0);
  if (bootstrap) {
    Status status = search_values_.Ask(model, latents_[horizon_ % 2].middle_rows(0, count_),
                                       request.explore, {values_.data(), count_});
    if (!status.ok()) return status;
  }
  for (std::uint64_t t = horizon_; t-- > 0;) {
    for (std::uint64_t i = 0; i < count_; ++i) {
      const std::uint64_t at = t * count_ + i;
      const double after = t + 1 < horizon_ ? returns_[at + count_] : values_[i];
      returns_[at] = rewards_[at] + discounts_[at] * after;
    }
  }
  return CheckFinite("return of sequence", returns());
}

View<const std::uint32_t> Trajectories::Best(std::uint64_t count) noexcept {
  const auto end = order_.begin() + static_cast<std::ptrdiff_t>(count_);
  std::iota(order_.begin(), end, 0u);
  std::partial_sort(order_.begin(), order_.begin() + static_cast<std::ptrdiff_t>(count), end,
                    [this](std::uint32_t a, std::uint32_t b) {
                      return returns_[a] > returns_[b] || (returns_[a] == returns_[b] && a < b);
                    });
  return {order_.data(), count};
}

void Trajectories::Report(TreeSink* sink) noexcept {
  for (std::uint64_t t = 0; t < horizon_; ++t) {
    for (std::uint64_t i = 0; i < count_; ++i) {
      const std::uint64_t edge = t * count_ + i;
      sink->Edge({.parent = t == 0 ? -1 : static_cast<std::int64_t>(edge - count_),
                  .action = actions(t).row(i),
                  .visits = 1,
                  .q = returns_[edge],
                  .prior = t == 0 ? 1.0 / static_cast<double>(count_) : 1,
                  .reward = rewards_[edge],
                  .discount = discounts_[edge],
                  .value = t + 1 == horizon_ ? values_[i] : 0,
                  .expanded = true});
    }
  }
}

}  // namespace dreamsearch
