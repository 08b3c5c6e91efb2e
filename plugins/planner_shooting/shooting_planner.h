// shooting_planner.h - what planners over whole action sequences share.
#pragma once

#include <string>
#include <vector>

#include "dreamsearch/planning.h"
#include "trajectories.h"

namespace dreamsearch {

enum ShootingMetric { kModeDistance, kReturnSpread, kPlanStd, kShootingMetricCount };
constexpr MetricSpec kShootingMetrics[] = {
    {"mode_distance", "", "Euclidean distance of the played action from the actor's mode action."},
    {"return_spread", "", "Standard deviation of the last candidates' returns."},
    {"plan_std", "", "Mean standard deviation of the plan's first action, over its components."},
};
static_assert(std::size(kShootingMetrics) == kShootingMetricCount);

// Exploring adds Gaussian noise to the played action only: the candidates are
// random as they are.
inline constexpr auto kPlayedNoiseParameter = Bind<&ShootingSettings::noise_std>(
    RealParameter("noise_std", 0.3, 0, 10, "",
                  "Standard deviation of the Gaussian noise on the played action while exploring "
                  "(Hafner et al. 2019)."));
inline constexpr auto kBootstrapParameter = Bind<&ShootingSettings::bootstrap>(BoolParameter(
    "bootstrap", false, "Add the value of the last imagined latent to the return of a sequence."));

// The rest of a planner that refits a Gaussian to its best sequences.
struct RefitSettings : ShootingSettings {
  std::uint64_t elites;
  std::uint64_t iterations;
};
// Throws std::invalid_argument: the parameter `name` counts some of the candidates.
inline void AtMostCandidates(const ShootingSettings& settings, const char* name,
                             std::uint64_t count) {
  if (count <= settings.candidates) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(count) +
                              ", expected at most candidates, which is " +
                              std::to_string(settings.candidates));
}

// A plan: what a derived class found.
struct ShootingPlan {
  double value = 0;             // the planner's estimate of the root's value
  double std = 0;               // of the first action
  std::uint64_t sequences = 0;  // imagined in all
  // The improved policy: sequences whose first actions it plays, and their weights; empty: equal
  // ones. Both stay until the next search.
  View<const std::uint32_t> policy;
  View<const double> weights;
};

class ShootingPlanner : public Offers<Planner, TreeReporting, PolicyReporting> {
 public:
  Status BeginEpisode(LatentModel* model) noexcept final {
    if (Status status = CheckModel(sizes_, model); !status.ok()) return status;
    model_ = model;
    ForgetPlan();
    return OkStatus();
  }

  Status Plan(const PlanRequest& request, PlanResult* result) noexcept final {
    if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
    Status status = model_->ProposeMode(request.root, {mode_.data(), 1, mode_.size()});
    if (status.ok()) status = CheckFinite("action component", {mode_.data(), mode_.size()});
    if (!status.ok()) return status;
    plan_ = ShootingPlan();
    const View<double> played{played_.data(), played_.size()};
    if (status = Search(request, played, &plan_); !status.ok()) {
      ForgetPlan();
      return status;
    }
    std::copy(played_.begin(), played_.end(), result->action.data);
    result->metrics[kModeDistance] = ActionDistance(played, {mode_.data(), mode_.size()});
    result->metrics[kReturnSpread] = trajectories_.ReturnSpread();
    result->metrics[kPlanStd] = plan_.std;
    result->value = plan_.value;
    result->simulations = static_cast<std::uint32_t>(plan_.sequences);
    result->nodes = static_cast<std::uint32_t>(plan_.sequences * trajectories_.horizon() + 1);
    result->depth = static_cast<std::uint32_t>(trajectories_.horizon());
    return OkStatus();
  }

  // The last candidates.
  void ReportTree(TreeSink* sink) noexcept final { trajectories_.Report(sink); }

  Status ReportPolicy(MatrixView<double> policy, View<double> weights) noexcept final {
    return FillPolicy(
        sizes_,
        [this](auto visit) {
          for (std::uint64_t i = 0; i < plan_.policy.size; ++i) {
            visit(plan_.weights.empty() ? 1 : plan_.weights[i],
                  trajectories_.actions(0).row(plan_.policy[i]));
          }
        },
        policy, weights);
  }

  // Nothing is carried from one decision to the next unless a class says so.
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept final { delete this; }

 protected:
  ShootingPlanner(const PlannerContext& context, const ShootingSettings& settings)
      : sizes_{context.action_size, context.latent_bytes, kShootingMetricCount},
        trajectories_(context, settings),
        mode_(context.action_size),
        played_(context.action_size) {}
  virtual ~ShootingPlanner() = default;

  // Fills `played`, noise included, and the plan; leaves the last candidates in
  // trajectories_.
  virtual Status Search(const PlanRequest& request, View<double> played,
                        ShootingPlan* plan) noexcept = 0;
  // The best sequence is the plan: its first action is played, with noise while exploring, whose
  // draws follow from the decision's seed and `stream`.
  void PlayBest(const PlanRequest& request, double noise_std, std::uint64_t stream,
                View<double> played, ShootingPlan* plan) noexcept {
    plan->policy = trajectories_.Best(1);
    const std::uint32_t best = plan->policy[0];
    std::copy_n(trajectories_.actions(0).row(best).data, played.size, played.data);
    if (request.explore) {
      AddExplorationNoise(noise_std, DeriveSeed(request.seed, stream),
                          {played.data, 1, played.size});
    }
    plan->value = trajectories_.returns()[best];
  }
  // An episode begins, or a search failed.
  virtual void ForgetPlan() noexcept {}

  const PlannerSizes sizes_;
  LatentModel* model_ = nullptr;
  Trajectories trajectories_;

 private:
  ShootingPlan plan_;           // the last one
  std::vector<double> mode_;    // [A]
  std::vector<double> played_;  // [A]
};

// The components of planner_shooting.so.
extern const ComponentDescriptor kRandomShooting;
extern const ComponentDescriptor kCem;
extern const ComponentDescriptor kIcem;
extern const ComponentDescriptor kMppi;

}  // namespace dreamsearch
