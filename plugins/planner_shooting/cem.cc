// cem.cc - the cross-entropy method over action sequences, as PlaNet plans (Hafner
// et al. 2019, algorithm 2; Rubinstein 1997).
//
// A Gaussian over sequences, N(0, 1) at first, independent in every time and
// component. Each iteration draws candidates clipped to [-1, 1], imagines them, and
// refits mean and standard deviation to the ones with the largest returns. The
// first action of the last mean is played; nothing is kept for the next decision.
//
// The value it reports is the mean return of the last elites, the improved policy their first
// actions in equal parts.
#include <limits>

#include "gaussian_plan.h"
#include "shooting_planner.h"

namespace dreamsearch {
namespace {

struct CemSettings : RefitSettings {
  double initial_std;
};
constexpr auto kSettings = BindSettings<CemSettings>(
    Bind<&CemSettings::candidates>(IntParameter("candidates", 1000, 2, 1000000, "sequences",
                                                "Sequences an iteration (Hafner et al. 2019).")),
    Bind<&CemSettings::elites>(
        IntParameter("elites", 100, 1, 1000000, "sequences",
                     "Sequences that mean and deviation are refitted to (Hafner et al. 2019).")),
    Bind<&CemSettings::iterations>(
        IntParameter("iterations", 10, 1, 1000, "", "Refits a decision (Hafner et al. 2019).")),
    Bind<&CemSettings::horizon>(IntParameter("horizon", 12, 1, 1000, "transitions",
                                             "Actions in a sequence (Hafner et al. 2019).")),
    Bind<&CemSettings::initial_std>(
        RealParameter("initial_std", 1, 1e-6, 10, "",
                      "Standard deviation of the first candidates (Hafner et al. 2019).")),
    kBootstrapParameter, kPlayedNoiseParameter, kValueBonusParameter, kValueInEvaluationParameter);

constexpr double kAnyStd = std::numeric_limits<double>::infinity();

enum Stream : std::uint64_t { kIteration = 1, kNoise = 2 };

class Cem final : public ShootingPlanner {
 public:
  explicit Cem(const PlannerContext& context) : Cem(context, kSettings.Read(context.parameters)) {}

 private:
  Cem(const PlannerContext& context, const CemSettings& settings)
      : ShootingPlanner(context, settings),
        settings_(settings),
        gaussian_(settings.horizon, context.action_size) {
    AtMostCandidates(settings, "elites", settings.elites);
  }

  Status Search(const PlanRequest& request, View<double> played,
                ShootingPlan* plan) noexcept override {
    gaussian_.SetMean(0);
    gaussian_.SetStd(settings_.initial_std);
    for (std::uint64_t k = 0; k < settings_.iterations; ++k) {
      const std::uint64_t seed = DeriveSeed(DeriveSeed(request.seed, kIteration), k);
      gaussian_.Draw(&trajectories_, 0, DeriveSeed(seed, 0));
      Status status =
          trajectories_.Imagine(model_, request, settings_.bootstrap, DeriveSeed(seed, 1));
      if (!status.ok()) return status;
      gaussian_.Refit(&trajectories_, trajectories_.Best(settings_.elites), {}, 0, 0, kAnyStd);
    }
    std::copy_n(gaussian_.mean().data, played.size, played.data);
    if (request.explore) {
      AddExplorationNoise(settings_.noise_std, DeriveSeed(request.seed, kNoise),
                          {played.data, 1, played.size});
    }
    plan->policy = trajectories_.Best(settings_.elites);
    for (const std::uint32_t i : plan->policy) {
      plan->value += trajectories_.returns()[i] / static_cast<double>(settings_.elites);
    }
    plan->std = gaussian_.MeanFirstStd();
    plan->sequences = settings_.iterations * settings_.candidates;
    return OkStatus();
  }

  const CemSettings settings_;
  GaussianPlan gaussian_;
};

}  // namespace

constexpr ComponentDescriptor kCem = {
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "cem",
    .version = "1.0.0",
    .summary = "Cross-entropy method over action sequences, with PlaNet's settings",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kShootingMetrics),
    .create_planner = CreatePlanner<Cem>,
};

}  // namespace dreamsearch
