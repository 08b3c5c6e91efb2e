// components.h - a run's environment, model and planners, loaded and made.
//
// Owns the objects that plugins handed out and destroys them in the right order.
// Errors of a factory become Failure with the component's name: 2 when it
// refuses the settings, 69 when what it made says something impossible about itself or is
// not what the run was resolved with, 70 otherwise.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "dreamsearch/plugin.h"
#include "host/saving/checkpoint.h"
#include "host/settings/seeds.h"
#include "host/settings/settings.h"

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

// Throws Failure unless `status` is ok: diverged (72) for kNotFinite and
// kDiverged, otherwise internal (70). `what` says which component did what.
void ThrowUnlessOk(const Status& status, const std::string& what);

// A model as a part of a run's checkpoint. Throw what StateWriter and Checkpoint::Read
// throw, and as ThrowUnlessOk.
inline constexpr PartName kModelPart{"model", 1};
void SaveModel(const Model& model, const std::string& name, CheckpointWriter* writer);
void LoadModel(const Checkpoint& checkpoint, const std::string& name, Model* model);
// Brings a model of the same kind to the state of another.
void CopyModel(const Model& from, const std::string& name, Model* to);
// SHA-256 of what the model's Save wrote into the checkpoint.
std::string ModelSha256(const Checkpoint& checkpoint);

// EnvironmentSpec::ingredients, owned.
std::map<std::string, std::string> IngredientsOf(const EnvironmentSpec& spec);

// The components of one run, loaded from the plugins that its RunSpec names.
class Components {
 public:
  explicit Components(const RunSpec& spec);

  EnvironmentPtr MakeEnvironment() const;
  // `threads` as for Model::SetThreads. `own_environment` is for a model that needs one,
  // `trained_model` for one that takes proposal and value from a trained run; both must
  // outlive the model.
  ModelPtr MakeModel(const EnvironmentSpec& environment, std::uint32_t threads,
                     Environment* own_environment, Model* trained_model = nullptr) const;
  // The trained run's model of an evaluation that names one, otherwise null.
  ModelPtr MakeTrainedModel(const EnvironmentSpec& environment, std::uint32_t threads) const;
  PlannerPtr MakePlanner(const LatentModel& model) const;
  PlannerPtr MakeEvaluationPlanner(const LatentModel& model) const;

  const ComponentDescriptor& environment() const { return *environment_; }
  const ComponentDescriptor& model() const { return *model_; }
  const ComponentDescriptor& planner() const { return *planner_; }
  const ComponentDescriptor& evaluation_planner() const { return *evaluation_planner_; }

 private:
  ModelPtr MakeModel(const ResolvedComponent& model, const ComponentDescriptor& descriptor,
                     const EnvironmentSpec& environment, std::uint32_t threads,
                     Environment* own_environment, Model* trained_model) const;
  static PlannerPtr MakePlanner(const ResolvedComponent& planner,
                                const ComponentDescriptor& descriptor, const LatentModel& model);

  const RunSpec& spec_;
  const ComponentDescriptor* environment_;
  const ComponentDescriptor* model_;
  const ComponentDescriptor* planner_;
  const ComponentDescriptor* evaluation_planner_;
  const ComponentDescriptor* trained_ = nullptr;
};

}  // namespace dreamsearch
