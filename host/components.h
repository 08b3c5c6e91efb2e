// components.h - a run's environment, model and planners, loaded and made.
//
// Owns the objects that plugins handed out and destroys them in the right order.
// Errors of a factory become RunnerError with the component's name: 2 when it
// refuses the settings, 70 otherwise.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "dreamsearch/plugin.h"
#include "seeds.h"
#include "settings.h"

namespace dreamsearch {

struct Destroyer {
  template <typename T>
  void operator()(T* object) const noexcept {
    object->Destroy();
  }
};
using EnvironmentPtr = std::unique_ptr<Environment, Destroyer>;
using ModelPtr = std::unique_ptr<Model, Destroyer>;
using PlannerPtr = std::unique_ptr<Planner, Destroyer>;

// Throws RunnerError unless `status` is ok: diverged (72) for kNotFinite and
// kDiverged, otherwise internal (70). `what` says which component did what.
void ThrowUnlessOk(const Status& status, const std::string& what);

// The components of one run, loaded from the plugins that its RunSpec names.
class Components {
 public:
  explicit Components(const RunSpec& spec);

  EnvironmentPtr MakeEnvironment() const;
  // `own_environment` is for a model that needs one; it must outlive the model.
  ModelPtr MakeModel(const EnvironmentSpec& environment, std::uint32_t threads,
                     Environment* own_environment) const;
  PlannerPtr MakePlanner(const LatentModel& model) const;
  PlannerPtr MakeEvaluationPlanner(const LatentModel& model) const;

  const ComponentDescriptor& environment() const { return *environment_; }
  const ComponentDescriptor& model() const { return *model_; }
  const ComponentDescriptor& planner() const { return *planner_; }
  const ComponentDescriptor& evaluation_planner() const { return *evaluation_planner_; }

 private:
  static PlannerPtr MakePlanner(const ResolvedComponent& planner,
                                const ComponentDescriptor& descriptor, const LatentModel& model);

  const RunSpec& spec_;
  const ComponentDescriptor* environment_;
  const ComponentDescriptor* model_;
  const ComponentDescriptor* planner_;
  const ComponentDescriptor* evaluation_planner_;
};

}  // namespace dreamsearch
