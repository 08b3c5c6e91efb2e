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
#include <string>

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

enum Stream : std::uint64_t { kIteration = 1, kNoise = 2 };

class Cem final : public ShootingPlanner {
 public:
  explicit Cem(const PlannerContext& context) : Cem(context, kSettings.Read(context.parameters)) {}

 private:
  Cem(const PlannerContext& context, const CemSettings& settings)
      : ShootingPlanner(context, settings),
        settings_(settings),
        mean_(settings.horizon * context.action_size),
        std_(settings.horizon * context.action_size) {
    AtMostCandidates(settings, "elites", settings.elites);
  }

  Status Search(const PlanRequest& request, View<double> played,
                ShootingPlan* plan) noexcept override {
    std::fill(mean_.begin(), mean_.end(), 0.0);
    std::fill(std_.begin(), std_.end(), settings_.initial_std);
    for (std::uint64_t k = 0; k < settings_.iterations; ++k) {
      const std::uint64_t seed = DeriveSeed(DeriveSeed(request.seed, kIteration), k);
      Draw(DeriveSeed(seed, 0));
      Status status =
          trajectories_.Imagine(model_, request, settings_.bootstrap, DeriveSeed(seed, 1));
      if (!status.ok()) return status;
      Refit();
    }
    std::copy_n(mean_.data(), played.size, played.data);
    if (request.explore) {
      AddExplorationNoise(settings_.noise_std, DeriveSeed(request.seed, kNoise),
                          {played.data, 1, played.size});
    }
    plan->policy = trajectories_.Best(settings_.elites);
    for (const std::uint32_t i : plan->policy) {
      plan->value += trajectories_.returns()[i] / static_cast<double>(settings_.elites);
    }
    for (std::uint64_t j = 0; j < played.size; ++j) {
      plan->std += std_[j] / static_cast<double>(played.size);
    }
    plan->iterations = settings_.iterations;
    return OkStatus();
  }

  void Draw(std::uint64_t seed) noexcept {
    Random random(seed);
    const std::uint64_t size = sizes_.action_size;
    for (std::uint64_t t = 0; t < trajectories_.horizon(); ++t) {
      const MatrixView<double> actions = trajectories_.actions(t);
      for (std::uint64_t i = 0; i < actions.rows; ++i) {
        for (std::uint64_t j = 0; j < size; ++j) {
          actions(i, j) =
              std::clamp(mean_[t * size + j] + std_[t * size + j] * random.Normal(), -1.0, 1.0);
        }
      }
    }
  }

  void Refit() noexcept {
    const View<const std::uint32_t> elites = trajectories_.Best(settings_.elites);
    const double count = static_cast<double>(settings_.elites);
    const std::uint64_t size = sizes_.action_size;
    for (std::uint64_t t = 0; t < trajectories_.horizon(); ++t) {
      const MatrixView<double> actions = trajectories_.actions(t);
      for (std::uint64_t j = 0; j < size; ++j) {
        double mean = 0, variance = 0;
        for (const std::uint32_t i : elites) mean += actions(i, j) / count;
        for (const std::uint32_t i : elites) {
          variance += (actions(i, j) - mean) * (actions(i, j) - mean) / count;
        }
        // A mean of ones may round to more than one.
        mean_[t * size + j] = std::clamp(mean, -1.0, 1.0);
        std_[t * size + j] = std::sqrt(variance);
      }
    }
  }

  const CemSettings settings_;
  std::vector<double> mean_;  // [H, A]
  std::vector<double> std_;   // [H, A]
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
