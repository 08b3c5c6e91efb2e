// best_of_samples.cc - plays the best of a few of the actor's actions, one transition ahead.
#include "dreamsearch/planning.h"

namespace dreamsearch {
namespace {

struct Settings {
  std::uint64_t samples;
};
constexpr auto kSettings = BindSettings<Settings>(Bind<&Settings::samples>(
    IntParameter("samples", 16, 1, 1000, "actions", "Actions that are tried at a decision.")));

constexpr MetricSpec kMetrics[] = {{"gain", "", "The best return less the mean of all."}};

class BestOfSamples final : public MemorylessPlanner {
 public:
  explicit BestOfSamples(const PlannerContext& context)
      : BestOfSamples(context, kSettings.Read(context.parameters).samples) {}

  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
    FillSeeds(request.seed, {seeds_.data(), n_});
    const MatrixView<double> actions{actions_.data(), n_, sizes_.action_size};
    const Latents from = from_.middle_rows(0, n_), to = to_.middle_rows(0, n_);
    for (std::uint64_t i = 0; i < n_; ++i) from_.Set(i, request.root);

    Status status = model_->ProposeSamples(request.root, {&request.seed, 1}, actions);
    if (!status.ok()) return status;
    status = model_->Imagine({from, actions, {seeds_.data(), n_}},
                             {to, {rewards_.data(), n_}, {discounts_.data(), n_}});
    if (!status.ok()) return status;
    status = model_->Value(to, {returns_.data(), n_});
    if (!status.ok()) return status;

    double mean = 0;
    for (std::uint64_t i = 0; i < n_; ++i) {
      returns_[i] = rewards_[i] + discounts_[i] * returns_[i];
      mean += returns_[i] / static_cast<double>(n_);
    }
    status = CheckFinite("return", {returns_.data(), n_});
    if (!status.ok()) return status;
    const auto best = static_cast<std::uint64_t>(
        std::max_element(returns_.begin(), returns_.end()) - returns_.begin());
    std::copy_n(actions.row(best).data, sizes_.action_size, result->action.data);
    result->metrics[0] = returns_[best] - mean;
    result->value = returns_[best];
    result->simulations = static_cast<std::uint32_t>(n_);
    result->nodes = static_cast<std::uint32_t>(n_ + 1);
    result->depth = 1;
    return OkStatus();
  }

 private:
  // Everything that Plan needs is made here: a decision allocates nothing.
  BestOfSamples(const PlannerContext& context, std::uint64_t samples)
      : MemorylessPlanner(context, std::size(kMetrics)),
        n_(samples),
        from_(n_, context.latent_bytes),
        to_(n_, context.latent_bytes),
        seeds_(n_),
        actions_(n_ * context.action_size),
        rewards_(n_),
        discounts_(n_),
        returns_(n_) {}

  const std::uint64_t n_;
  LatentBuffer from_, to_;
  std::vector<std::uint64_t> seeds_;
  std::vector<double> actions_, rewards_, discounts_, returns_;
};

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kPlanner,
    .traits = kSearches,
    .name = "best_of_samples",
    .version = "1.0.0",
    .summary = "The best of a few of the actor's actions, one transition ahead",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kMetrics),
    .create_planner = CreatePlanner<BestOfSamples>,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("best_of_samples", "1.0.0", dreamsearch::kComponents)
