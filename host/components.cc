#include "components.h"

#include "byte_buffer.h"
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

void LoadModel(const CheckpointSections& sections, const std::string& name, Model* model) {
  const auto found = sections.find("model");
  if (found == sections.end()) {
    throw RunnerError(ExitCode::kBadInput, "the checkpoint has no section 'model'");
  }
  StringSource source(found->second);
  ThrowUnlessOk(model->Load(&source), "model '" + name + "' Load");
}

Components::Components(const RunSpec& spec)
    : spec_(spec),
      environment_(&Load(spec.environment, ComponentKind::kEnvironment)),
      model_(&Load(spec.model, ComponentKind::kModel)),
      planner_(&Load(spec.planner, ComponentKind::kPlanner)),
      evaluation_planner_(&Load(spec.eval_planner, ComponentKind::kPlanner)) {
  if (spec.evaluation && spec.evaluation->behaviour) {
    behaviour_ = &Load(*spec.evaluation->behaviour, ComponentKind::kModel);
  }
}

EnvironmentPtr Components::MakeEnvironment() const {
  const ParameterStorage parameters(spec_.environment.parameters);
  EnvironmentContext context;
  context.parameters = parameters.view();
  Environment* environment = nullptr;
  const Status status = environment_->create_environment(context, &environment);
  return EnvironmentPtr(Made(status, environment, "environment", spec_.environment.name()));
}

ModelPtr Components::MakeModel(const ResolvedComponent& component,
                               const ComponentDescriptor& descriptor,
                               const EnvironmentSpec& environment, std::uint32_t threads,
                               Environment* own_environment, Model* behaviour) const {
  const ParameterStorage parameters(component.parameters);
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
  context.behaviour = behaviour;
  Model* model = nullptr;
  const Status status = descriptor.create_model(context, &model);
  return ModelPtr(Made(status, model, "model", component.name()));
}

ModelPtr Components::MakeModel(const EnvironmentSpec& environment, std::uint32_t threads,
                               Environment* own_environment, Model* behaviour) const {
  return MakeModel(spec_.model, *model_, environment, threads, own_environment, behaviour);
}

ModelPtr Components::MakeBehaviour(const EnvironmentSpec& environment,
                                   std::uint32_t threads) const {
  if (behaviour_ == nullptr) return nullptr;
  return MakeModel(*spec_.evaluation->behaviour, *behaviour_, environment, threads, nullptr,
                   nullptr);
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
