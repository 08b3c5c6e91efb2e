// icem.cc - the improved cross-entropy method (Pinneri et al. 2020, "Sample-efficient
// cross-entropy method for real-time planning"), `icem`.
//
// CEM over action sequences with five changes. Noise is coloured over the horizon, so that
// sequences go somewhere instead of trembling in place. The population shrinks from refit to
// refit by `decay`. A share of the elites (`keep_elites`) competes again in the next refit, and
// shifted by one transition in the next decision. The last refit sees the mean as well. The
// first action of the best sequence is played, not that of the mean.
//
// Sequences are clipped to [-1, 1]. A shifted elite ends with a fresh draw.
#include <limits>

#include "coloured_noise.h"
#include "gaussian_plan.h"
#include "shooting_planner.h"

namespace dreamsearch {
namespace {

struct IcemSettings : RefitSettings {
  double decay;
  double beta;
  double keep_elites;
  double momentum;
  double initial_std;
};
constexpr auto kSettings = BindSettings<IcemSettings>(
    Bind<&IcemSettings::candidates>(
        IntParameter("candidates", 128, 2, 1000000, "sequences",
                     "Sequences of the first refit, kept ones included. [ours]")),
    Bind<&IcemSettings::decay>(RealParameter(
        "decay", 1.25, 1, 100, "",
        "Each refit has this times fewer sequences than the one before, at least twice the elites "
        "(Pinneri et al. 2020).")),
    Bind<&IcemSettings::elites>(
        IntParameter("elites", 10, 1, 1000000, "sequences",
                     "Sequences that mean and deviation are refitted to (Pinneri et al. 2020).")),
    Bind<&IcemSettings::keep_elites>(RealParameter(
        "keep_elites", 0.3, 0, 1, "",
        "Share of the elites that competes again in the next refit and, shifted, in the next "
        "decision (Pinneri et al. 2020).")),
    Bind<&IcemSettings::iterations>(
        IntParameter("iterations", 3, 1, 1000, "", "Refits a decision (Pinneri et al. 2020).")),
    Bind<&IcemSettings::horizon>(IntParameter("horizon", 12, 1, 1000, "transitions",
                                              "Actions in a sequence. [PlaNet; paper: 30]")),
    Bind<&IcemSettings::beta>(RealParameter(
        "beta", 2.5, 0, 10, "",
        "Power of the noise falls with frequency as 1 / f^beta; 0 is white (Pinneri et al. 2020: "
        "0.25 to 4 by task).")),
    Bind<&IcemSettings::momentum>(RealParameter(
        "momentum", 0.1, 0, 1, "",
        "Share of the old mean and deviation that a refit keeps (Pinneri et al. 2020).")),
    Bind<&IcemSettings::initial_std>(
        RealParameter("initial_std", 0.5, 1e-6, 10, "",
                      "Standard deviation of the first candidates (Pinneri et al. 2020).")),
    kBootstrapParameter, kPlayedNoiseParameter, kValueBonusParameter, kValueInEvaluationParameter);

enum Stream : std::uint64_t { kIteration = 1, kNoise = 2 };

class Icem final : public ShootingPlanner {
 public:
  explicit Icem(const PlannerContext& context)
      : Icem(context, kSettings.Read(context.parameters)) {}

  // The mean and the kept elites of the last plan.
  Status Save(ByteSink* sink) const noexcept override {
    Status status = sink->Write(&kept_, sizeof kept_);
    if (status.ok()) status = sink->Write(elites_.data(), elites_.size() * sizeof(double));
    if (!status.ok()) return status;
    return sink->Write(gaussian_.mean().data, gaussian_.mean().size * sizeof(double));
  }
  Status Load(ByteSource* source) noexcept override {
    Status status = source->Read(&kept_, sizeof kept_);
    if (status.ok()) status = source->Read(elites_.data(), elites_.size() * sizeof(double));
    if (status.ok()) {
      status = source->Read(gaussian_.mean().data, gaussian_.mean().size * sizeof(double));
    }
    if (status.ok() && kept_ > keep_) {
      status =
          Error(StatusCode::kInvalidArgument, "expected at most %llu kept elites, found %llu",
                static_cast<unsigned long long>(keep_), static_cast<unsigned long long>(kept_));
    }
    if (!status.ok()) ForgetPlan();
    return status;
  }

 private:
  Icem(const PlannerContext& context, const IcemSettings& settings)
      : ShootingPlanner(context, settings),
        settings_(settings),
        keep_(static_cast<std::uint64_t>(settings.keep_elites *
                                         static_cast<double>(settings.elites))),
        gaussian_(settings.horizon, context.action_size),
        coloured_(settings.horizon, settings.beta),
        elites_(keep_ * settings.horizon * context.action_size),
        noise_(settings.horizon) {
    AtMostCandidates(settings, "elites", settings.elites);
  }

  void ForgetPlan() noexcept override {
    gaussian_.SetMean(0);
    kept_ = 0;
  }

  Status Search(const PlanRequest& request, View<double> played,
                ShootingPlan* plan) noexcept override {
    gaussian_.ShiftMean();
    gaussian_.SetStd(settings_.initial_std);
    double population = static_cast<double>(settings_.candidates);
    for (std::uint64_t k = 0; k < settings_.iterations; ++k) {
      const std::uint64_t seed = DeriveSeed(DeriveSeed(request.seed, kIteration), k);
      // Best() must find `elites` sequences, and the largest population has `candidates`.
      trajectories_.SetCount(
          std::min(settings_.candidates,
                   std::max(static_cast<std::uint64_t>(population), 2 * settings_.elites)));
      population /= settings_.decay;
      Fill(k == 0, k + 1 == settings_.iterations, DeriveSeed(seed, 0));
      const Status status =
          trajectories_.Imagine(model_, request, settings_.bootstrap, DeriveSeed(seed, 1));
      if (!status.ok()) return status;
      plan->sequences += trajectories_.count();
      const View<const std::uint32_t> elites = trajectories_.Best(settings_.elites);
      gaussian_.Refit(&trajectories_, elites, {}, settings_.momentum, 0,
                      std::numeric_limits<double>::infinity());
      Keep(elites);
    }
    PlayBest(request, settings_.noise_std, kNoise, played, plan);
    plan->std = gaussian_.MeanFirstStd();
    return OkStatus();
  }

  // The sequences of a refit: kept elites first (shifted at a decision's first refit), the mean
  // at its last, and draws.
  void Fill(bool first, bool last, std::uint64_t seed) noexcept {
    Random random(seed);
    const std::uint64_t size = sizes_.action_size, horizon = trajectories_.horizon();
    std::uint64_t row = 0;
    for (; row < kept_; ++row) {
      for (std::uint64_t t = 0; t < horizon; ++t) {
        const std::uint64_t from = first ? t + 1 : t;
        for (std::uint64_t j = 0; j < size; ++j) {
          double* component = &trajectories_.actions(t)(row, j);
          if (from < horizon) {
            *component = elites_[(row * horizon + from) * size + j];
          } else {
            gaussian_.Place(t, j, random.Normal(), component);
          }
        }
      }
    }
    if (last && row < trajectories_.count()) {
      for (std::uint64_t t = 0; t < horizon; ++t) {
        for (std::uint64_t j = 0; j < size; ++j) {
          gaussian_.Place(t, j, 0, &trajectories_.actions(t)(row, j));
        }
      }
      ++row;
    }
    const View<double> noise{noise_.data(), noise_.size()};
    for (; row < trajectories_.count(); ++row) {
      for (std::uint64_t j = 0; j < size; ++j) {
        coloured_.Draw(&random, noise);
        for (std::uint64_t t = 0; t < horizon; ++t) {
          gaussian_.Place(t, j, noise[t], &trajectories_.actions(t)(row, j));
        }
      }
    }
  }

  // The best of the elites, for the next refit.
  void Keep(View<const std::uint32_t> elites) noexcept {
    const std::uint64_t size = sizes_.action_size, horizon = trajectories_.horizon();
    for (kept_ = 0; kept_ < keep_; ++kept_) {
      for (std::uint64_t t = 0; t < horizon; ++t) {
        std::copy_n(trajectories_.actions(t).row(elites[kept_]).data, size,
                    elites_.data() + (kept_ * horizon + t) * size);
      }
    }
  }

  const IcemSettings settings_;
  const std::uint64_t keep_;  // sequences that are kept
  GaussianPlan gaussian_;
  ColouredNoise coloured_;
  std::vector<double> elites_;  // [keep_, H, A]
  std::uint64_t kept_ = 0;      // of them, those there are
  std::vector<double> noise_;   // [H]
};

}  // namespace

constexpr ComponentDescriptor kIcem = {
    .kind = ComponentKind::kPlanner,
    .traits = kSearches | kReportsPolicy,
    .name = "icem",
    .version = "1.0.0",
    .summary = "Cross-entropy method with coloured noise, kept elites and a shrinking population",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kShootingMetrics),
    .create_planner = CreatePlanner<Icem>,
};

}  // namespace dreamsearch
