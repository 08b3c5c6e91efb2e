// random.cc - uniform random actions: the baseline that every search must beat.
//
// It asks the model nothing, reports the value 0, and draws every component
// uniformly from [-1, 1], whether it explores or not.
#include "dreamsearch/planning.h"

namespace dreamsearch {
namespace {

class RandomPolicy final : public MemorylessPlanner {
 public:
  explicit RandomPolicy(const PlannerContext& context) : MemorylessPlanner(context, 0) {}

  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
    Random random(request.seed);
    for (double& component : result->action) component = random.Uniform(-1, 1);
    result->value = 0;
    result->simulations = 0;
    result->nodes = 0;
    result->depth = 0;
    return OkStatus();
  }
};

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kPlanner,
    .name = "random",
    .version = "1.0.0",
    .summary = "Uniform random actions, the baseline; no model, no search",
    .create_planner = CreatePlanner<RandomPolicy>,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("planner_random", "1.0.0", dreamsearch::kComponents)
