// mppi.cc - model predictive path integral control over action sequences, as
// TD-MPC2 plans (Williams et al. 2015; Hansen, Su, Wang 2024, section 3.2).
//
// As in the cross-entropy method a Gaussian over sequences is refitted, but
//   - some candidates follow samples of the actor, the same in every iteration;
//   - a sequence's return ends with the value of its last latent;
//   - elites count with weight exp(temperature * (return - best return));
//   - the standard deviation is kept between two bounds;
//   - the mean starts from the plan of the decision before, shifted by one
//     transition (zero at an episode's start), the deviation from its upper bound.
// The first action of one elite, drawn by weight, is played, or that of the mean.
// Exploring adds noise of the plan's own standard deviation.
//
// The value it reports is the weighted mean return of the last elites, the improved policy their
// first actions with these weights.
#include <string>

#include "gaussian_plan.h"
#include "shooting_planner.h"

namespace dreamsearch {
namespace {

struct MppiSettings : RefitSettings {
  std::uint64_t actor_candidates;
  double temperature;
  double min_std, max_std;
  bool warm_start;
  bool play_mean;
};
constexpr auto kSettings = BindSettings<MppiSettings>(
    Bind<&MppiSettings::candidates>(
        IntParameter("candidates", 512, 2, 1000000, "sequences",
                     "Sequences an iteration, those of the actor included (Hansen et al. 2024).")),
    Bind<&MppiSettings::actor_candidates>(
        IntParameter("actor_candidates", 24, 0, 1000000, "sequences",
                     "Sequences that follow the actor (Hansen et al. 2024).")),
    Bind<&MppiSettings::elites>(
        IntParameter("elites", 64, 1, 1000000, "sequences",
                     "Sequences that mean and deviation are refitted to (Hansen et al. 2024).")),
    Bind<&MppiSettings::iterations>(
        IntParameter("iterations", 6, 1, 1000, "", "Refits a decision (Hansen et al. 2024).")),
    Bind<&MppiSettings::horizon>(IntParameter("horizon", 3, 1, 1000, "transitions",
                                              "Actions in a sequence (Hansen et al. 2024).")),
    Bind<&MppiSettings::temperature>(
        RealParameter("temperature", 0.5, 0, 1e6, "",
                      "Elites count with exp(temperature (return - best)) (Hansen et al. 2024).")),
    Bind<&MppiSettings::min_std>(
        RealParameter("min_std", 0.05, 0, 10, "", "Least deviation (Hansen et al. 2024).")),
    Bind<&MppiSettings::max_std>(
        RealParameter("max_std", 2, 1e-6, 10, "",
                      "Largest deviation, and that of the first candidates (Hansen et al. 2024).")),
    Bind<&MppiSettings::bootstrap>(BoolParameter(
        "bootstrap", true,
        "Add the value of the last imagined latent to the return of a sequence (Hansen "
        "et al. 2024).")),
    Bind<&MppiSettings::warm_start>(
        BoolParameter("warm_start", true,
                      "Start from the last decision's mean, shifted by one (Hansen et al. 2024).")),
    Bind<&MppiSettings::play_mean>(
        ChoiceParameter("play", "elite", "elite,mean",
                        "Play an elite drawn by weight (Hansen et al. 2024) or the mean.")),
    kValueBonusParameter, kValueInEvaluationParameter);

enum Stream : std::uint64_t { kActor = 1, kIteration = 2, kElite = 3, kNoise = 4 };

class Mppi final : public ShootingPlanner {
 public:
  explicit Mppi(const PlannerContext& context)
      : Mppi(context, kSettings.Read(context.parameters)) {}

  // The mean of the last plan.
  Status Save(ByteSink* sink) const noexcept override {
    return sink->Write(gaussian_.mean().data, gaussian_.mean().size * sizeof(double));
  }
  Status Load(ByteSource* source) noexcept override {
    Status status = source->Read(gaussian_.mean().data, gaussian_.mean().size * sizeof(double));
    if (!status.ok()) ForgetPlan();
    return status;
  }

 private:
  Mppi(const PlannerContext& context, const MppiSettings& settings)
      : ShootingPlanner(context, settings),
        settings_(settings),
        gaussian_(settings.horizon, context.action_size),
        weights_(settings.elites) {
    AtMostCandidates(settings, "elites", settings.elites);
    AtMostCandidates(settings, "actor_candidates", settings.actor_candidates);
    if (settings_.min_std > settings_.max_std) {
      throw std::invalid_argument("min_std is " + std::to_string(settings_.min_std) +
                                  ", expected at most max_std, which is " +
                                  std::to_string(settings_.max_std));
    }
  }

  void ForgetPlan() noexcept override { gaussian_.SetMean(0); }

  Status Search(const PlanRequest& request, View<double> played,
                ShootingPlan* plan) noexcept override {
    if (settings_.warm_start) {
      gaussian_.ShiftMean();
    } else {
      ForgetPlan();
    }
    gaussian_.SetStd(settings_.max_std);
    Status status;
    if (settings_.actor_candidates > 0) {
      status = trajectories_.FollowActor(model_, request.root, settings_.actor_candidates,
                                         DeriveSeed(request.seed, kActor));
      if (!status.ok()) return status;
    }
    for (std::uint64_t k = 0; k < settings_.iterations; ++k) {
      const std::uint64_t seed = DeriveSeed(DeriveSeed(request.seed, kIteration), k);
      gaussian_.Draw(&trajectories_, settings_.actor_candidates, DeriveSeed(seed, 0));
      status = trajectories_.Imagine(model_, request, settings_.bootstrap, DeriveSeed(seed, 1));
      if (!status.ok()) return status;
      Refit();
    }

    const View<const std::uint32_t> elites = trajectories_.Best(settings_.elites);
    if (settings_.play_mean) {
      std::copy_n(gaussian_.mean().data, played.size, played.data);
    } else {
      const std::uint32_t elite = elites[DrawElite(DeriveSeed(request.seed, kElite))];
      std::copy_n(trajectories_.actions(0).row(elite).data, played.size, played.data);
    }
    for (std::uint64_t i = 0; i < settings_.elites; ++i) {
      plan->value += weights_[i] * trajectories_.returns()[elites[i]];
    }
    plan->std = gaussian_.MeanFirstStd();
    plan->sequences = settings_.iterations * settings_.candidates;
    plan->policy = elites;
    plan->weights = {weights_.data(), weights_.size()};
    if (request.explore) {
      Random random(DeriveSeed(request.seed, kNoise));
      for (std::uint64_t j = 0; j < played.size; ++j) {
        played[j] = std::clamp(played[j] + gaussian_.first_std(j) * random.Normal(), -1.0, 1.0);
      }
    }
    return OkStatus();
  }

  void Refit() noexcept {
    const View<const std::uint32_t> elites = trajectories_.Best(settings_.elites);
    const double best = trajectories_.returns()[elites[0]];
    double sum = 0;
    for (std::uint64_t i = 0; i < settings_.elites; ++i) {
      weights_[i] = std::exp(settings_.temperature * (trajectories_.returns()[elites[i]] - best));
      sum += weights_[i];
    }
    for (double& weight : weights_) weight /= sum;
    gaussian_.Refit(&trajectories_, elites, {weights_.data(), weights_.size()}, 0,
                    settings_.min_std, settings_.max_std);
  }

  // An index into the elites, by weight.
  std::uint64_t DrawElite(std::uint64_t seed) const noexcept {
    double left = Random(seed).Uniform();
    for (std::uint64_t i = 0; i + 1 < settings_.elites; ++i) {
      left -= weights_[i];
      if (left < 0) return i;
    }
    return settings_.elites - 1;
  }

  const MppiSettings settings_;
  GaussianPlan gaussian_;
  std::vector<double> weights_;  // [elites], of the last refit, sum 1
};

}  // namespace

constexpr ComponentDescriptor kMppi = {
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "mppi",
    .version = "1.0.0",
    .summary = "Path integral control with actor proposals, bootstrap and warm start (TD-MPC2)",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kShootingMetrics),
    .create_planner = CreatePlanner<Mppi>,
};

}  // namespace dreamsearch
