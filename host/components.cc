#include "components.h"

#include "plugin_loader.h"

namespace dreamsearch {
namespace {

const ComponentDescriptor& Load(const ResolvedComponent& component, ComponentKind kind) {
  return FindComponent(LoadPlugin(component.info->plugin.path), kind, component.name());
}

// A factory's result, or RunnerError. The settings were in their ranges, so what
// a factory refuses is a combination: the user's to change.
template <typename T>
T* Made(const Status& status, T* object, const char* kind, const std::string& name) {
  const std::string what = std::string(kind) + " '" + name + "'";
  if (!status.ok()) {
    throw RunnerError(status.code == StatusCode::kInvalidArgument ? ExitCode::kUsage
                                                                  : ExitCode::kInternal,
                      what + " cannot be made: " + status.message);
  }
  if (object == nullptr) {
    throw RunnerError(ExitCode::kInternal, what + ": its factory returned null");
  }
  return object;
}

}  // namespace

void ThrowUnlessOk(const Status& status, const std::string& what) {
  if (status.ok()) return;
  const bool diverged =
      status.code == StatusCode::kNotFinite || status.code == StatusCode::kDiverged;
  throw RunnerError(diverged ? ExitCode::kDiverged : ExitCode::kInternal,
                    what + ": " + StatusCodeName(status.code) + ": " + status.message);
}

Components::Components(const RunSpec& spec)
    : spec_(spec),
      environment_(&Load(spec.environment, ComponentKind::kEnvironment)),
      model_(&Load(spec.model, ComponentKind::kModel)),
      planner_(&Load(spec.planner, ComponentKind::kPlanner)),
      evaluation_planner_(&Load(spec.eval_planner, ComponentKind::kPlanner)) {}

EnvironmentPtr Components::MakeEnvironment() const {
  const ParameterStorage parameters(spec_.environment.parameters);
  EnvironmentContext context;
  context.parameters = parameters.view();
  Environment* environment = nullptr;
  const Status status = environment_->create_environment(context, &environment);
  return EnvironmentPtr(Made(status, environment, "environment", spec_.environment.name()));
}

ModelPtr Components::MakeModel(const EnvironmentSpec& environment, std::uint32_t threads,
                               Environment* own_environment) const {
  const ParameterStorage parameters(spec_.model.parameters);
  ModelContext context;
  context.parameters = parameters.view();
  context.observation_size = environment.observation_size;
  context.action_size = environment.action_size;
  context.action_repeat = spec_.action_repeat();
  context.episode_decisions =
      (environment.episode_steps + spec_.action_repeat() - 1) / spec_.action_repeat();
  context.seed = SeedFor(spec_.seed, SeedUse::kParameters, Phase::kTraining, 0, 0);
  context.threads = threads;
  context.environment = own_environment;
  Model* model = nullptr;
  const Status status = model_->create_model(context, &model);
  return ModelPtr(Made(status, model, "model", spec_.model.name()));
}

PlannerPtr Components::MakePlanner(const ResolvedComponent& planner,
                                   const ComponentDescriptor& descriptor,
                                   const LatentModel& model) {
  const ParameterStorage parameters(planner.parameters);
  PlannerContext context;
  context.parameters = parameters.view();
  context.action_size = model.action_size();
  context.latent_bytes = model.latent_bytes();
  Planner* made = nullptr;
  const Status status = descriptor.create_planner(context, &made);
  return PlannerPtr(Made(status, made, "planner", planner.name()));
}

PlannerPtr Components::MakePlanner(const LatentModel& model) const {
  return MakePlanner(spec_.planner, *planner_, model);
}

PlannerPtr Components::MakeEvaluationPlanner(const LatentModel& model) const {
  return MakePlanner(spec_.eval_planner, *evaluation_planner_, model);
}

}  // namespace dreamsearch
