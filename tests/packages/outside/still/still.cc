// still.cc - a planner that asks for no movement. Its action is the rounded product's error, which
// is 0 unless the compiler fused the product and the sum.
#include "dreamsearch/planning.h"

namespace dreamsearch {
namespace {

double ErrorOfProduct(double a, double b, double rounded_product) {
  return a * b - rounded_product;
}

class Still final : public Planner {
 public:
  explicit Still(const PlannerContext& context)
      : sizes_{context.action_size, context.latent_bytes, 0} {}

  Status BeginEpisode(LatentModel* model) noexcept override {
    if (Status status = CheckModel(sizes_, model); !status.ok()) return status;
    model_ = model;
    return OkStatus();
  }

  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    if (Status status = CheckPlan(sizes_, model_, request, result); !status.ok()) return status;
    const double a = 1 + 1e-9 * static_cast<double>(request.seed % 1000);
    volatile double rounded_product = a * a;
    for (double& component : result->action) component = ErrorOfProduct(a, a, rounded_product);
    result->value = 0;
    result->simulations = 0;
    result->nodes = 0;
    result->depth = 0;
    return OkStatus();
  }

  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }

  void Destroy() noexcept override { delete this; }

 private:
  ~Still() = default;

  const PlannerSizes sizes_;
  LatentModel* model_ = nullptr;
};

constexpr ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kPlanner,
    .name = "still",
    .version = "1.0.0",
    .summary = "No movement",
    .create_planner = CreatePlanner<Still>,
}};

}  // namespace
}  // namespace dreamsearch

DREAMSEARCH_PLUGIN("still", "1.0.0", dreamsearch::kComponents)
