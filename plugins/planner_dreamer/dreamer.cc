// dreamer.cc - the planner that does not search: the actor's mode action
// (Hafner et al. 2020, "Dream to Control"), plus Gaussian noise when exploring.
//
// The value it reports is the critic's v(root).
#include "dreamsearch/planning.h"

namespace dreamsearch {
namespace {

struct DreamerSettings {
  double noise_std;
  bool noise_on_sample;
};
constexpr auto kSettings = BindSettings<DreamerSettings>(
    Bind<&DreamerSettings::noise_std>(
        RealParameter("noise_std", 0.3, 0, 10, "",
                      "Standard deviation of the Gaussian noise on the action while exploring "
                      "(Koul et al. 2020).")),
    Bind<&DreamerSettings::noise_on_sample>(
        ChoiceParameter("noise_on", "sample", "mode,sample",
                        "What the noise is added to while exploring: the actor's mode (Koul et al. "
                        "2020) or a sample of it (Dreamer's code).")
            .Preset("paper", "mode")));

enum Metric { kModeDistance, kMetricCount };
constexpr MetricSpec kMetrics[] = {
    {"mode_distance", "", "Euclidean distance of the played action from the actor's mode action."},
};
static_assert(std::size(kMetrics) == kMetricCount);

// Streams of a decision's seed.
enum Stream : std::uint64_t { kSample = 1, kNoise = 2 };

class Dreamer final : public MemorylessPlanner {
 public:
  explicit Dreamer(const PlannerContext& context)
      : MemorylessPlanner(context, kMetricCount),
        settings_(kSettings.Read(context.parameters)),
        mode_(std::make_unique<double[]>(context.action_size)),
        action_(std::make_unique<double[]>(context.action_size)) {}

  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
    const std::uint64_t size = sizes_.action_size;
    const View<double> action{action_.get(), size};
    double value = 0;
    Status status = model_->ProposeMode(request.root, {mode_.get(), 1, size});
    if (!status.ok()) return status;
    status = model_->Value(request.root, {&value, 1});
    if (!status.ok()) return status;
    if (request.explore && settings_.noise_on_sample) {
      const std::uint64_t seed = DeriveSeed(request.seed, kSample);
      status = model_->ProposeSamples(request.root, {&seed, 1}, {action.data, 1, size});
      if (!status.ok()) return status;
    } else {
      std::copy_n(mode_.get(), size, action.data);
    }
    if (status = CheckFinite("action component", action); !status.ok()) return status;
    if (status = CheckFinite("value", {&value, 1}); !status.ok()) return status;
    if (request.explore) {
      AddExplorationNoise(settings_.noise_std, DeriveSeed(request.seed, kNoise),
                          {action.data, 1, size});
    }

    std::copy_n(action.data, size, result->action.data);
    result->metrics[kModeDistance] = ActionDistance(action, {mode_.get(), size});
    result->value = value;
    result->simulations = 0;
    result->nodes = 1;
    result->depth = 0;
    return OkStatus();
  }

 private:
  const DreamerSettings settings_;
  const std::unique_ptr<double[]> mode_;    // [A]
  const std::unique_ptr<double[]> action_;  // [A]
};

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kPlanner,
    .traits = kActorAlone,
    .name = "dreamer",
    .version = "1.0.0",
    .summary = "The actor's mode action, with noise when exploring; no search",
    .parameters = kSettings.declared(),
    .metrics = ViewOf(kMetrics),
    .create_planner = CreatePlanner<Dreamer>,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("planner_dreamer", "1.0.0", dreamsearch::kComponents)
