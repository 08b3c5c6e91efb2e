#include "host/acting/actor.h"

namespace dreamsearch {
namespace {

class Actor final : public Planner {
 public:
  Status BeginEpisode(LatentModel* model) noexcept override {
    model_ = model;
    return OkStatus();
  }
  Status Plan(const PlanRequest& request, PlanResult* result) noexcept override {
    const Status status =
        model_->ProposeMode(request.root, {result->action.data, 1, result->action.size});
    if (!status.ok()) return status;
    return model_->Value(request.root, {&result->value, 1});
  }
  Status Save(ByteSink*) const noexcept override { return OkStatus(); }
  Status Load(ByteSource*) noexcept override { return OkStatus(); }
  void Destroy() noexcept override { delete this; }

 private:
  ~Actor() = default;

  LatentModel* model_ = nullptr;
};

}  // namespace

PlannerPtr MakeActor() { return PlannerPtr(new Actor); }

}  // namespace dreamsearch
