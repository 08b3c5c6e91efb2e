// random_shooting.cc - imagines action sequences drawn uniformly and plays the
// first action of the one with the largest return (Richards 2005; the baseline of
// Nagabandi et al. 2018).
//
// The value it reports is that largest return, the improved policy that one action: a sequence is
// imagined once, so nothing says how far the returns of others are to be trusted.
#include "shooting_planner.h"

namespace dreamsearch {
namespace {

constexpr auto kSettings = BindSettings<ShootingSettings>(
    Bind<&ShootingSettings::candidates>(
        IntParameter("candidates", 1000, 1, 1000000, "sequences", "Sequences a decision.")),
    Bind<&ShootingSettings::horizon>(
        IntParameter("horizon", 12, 1, 1000, "transitions", "Actions in a sequence.")),
    kBootstrapParameter, kPlayedNoiseParameter, kValueBonusParameter, kValueInEvaluationParameter);

enum Stream : std::uint64_t { kActions = 1, kImagine = 2, kNoise = 3 };

class RandomShooting final : public ShootingPlanner {
 public:
  explicit RandomShooting(const PlannerContext& context)
      : RandomShooting(context, kSettings.Read(context.parameters)) {}

 private:
  RandomShooting(const PlannerContext& context, const ShootingSettings& settings)
      : ShootingPlanner(context, settings), settings_(settings) {}

  Status Search(const PlanRequest& request, View<double> played,
                ShootingPlan* plan) noexcept override {
    Random random(DeriveSeed(request.seed, kActions));
    for (std::uint64_t t = 0; t < trajectories_.horizon(); ++t) {
      const MatrixView<double> actions = trajectories_.actions(t);
      for (std::uint64_t i = 0; i < actions.size(); ++i) actions.data[i] = random.Uniform(-1, 1);
    }
    Status status = trajectories_.Imagine(model_, request, settings_.bootstrap,
                                          DeriveSeed(request.seed, kImagine));
    if (!status.ok()) return status;
    PlayBest(request, settings_.noise_std, kNoise, played, plan);
    plan->sequences = settings_.candidates;
    plan->std = 1 / std::sqrt(3.0);  // of a uniform draw from [-1, 1]
    return OkStatus();
  }

  const ShootingSettings settings_;
};

}  // namespace

constexpr ComponentDescriptor kRandomShooting = {
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "random_shooting",
    .version = "1.0.0",
    .summary = "Plays the first action of the best of many uniformly random sequences",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kShootingMetrics),
    .create_planner = CreatePlanner<RandomShooting>,
};

}  // namespace dreamsearch
