#include "host/acting/components.h"

#include <cmath>
#include <cstring>
#include <sstream>

#include "host/plugins/call_site.h"
#include "host/plugins/plugin_loader.h"
#include "results/system/error.h"

namespace dreamsearch {
namespace {

const ComponentDescriptor& Load(const ResolvedComponent& component, ComponentKind kind) {
  const ComponentDescriptor& found =
      FindComponent(LoadPlugin(component.info->plugin.path), kind, component.name());
  std::vector<ParameterInfo> parameters;
  for (const ParameterSpec& parameter : found.parameters) {
    parameters.push_back(DescribeParameter(parameter));
  }
  CheckValues(component.parameters, parameters, component.name() + ".");
  return found;
}

// A factory's result, or Failure. The settings were in their ranges, so what
// a factory refuses is a combination: the user's to change.
template <typename T>
T* FactoryResult(const Status& status, T* object, const char* kind, const std::string& name) {
  const std::string what = std::string(kind) + " '" + name + "'";
  if (!status.ok()) {
    throw Failure(
        status.code == StatusCode::kInvalidArgument ? ExitCode::kUsage : ExitCode::kInternal,
        what + " cannot be made: " + status.message);
  }
  if (object == nullptr) {
    throw Failure(ExitCode::kInternal, what + ": its factory returned null");
  }
  return object;
}

// What a call of a factory returns; a crash or a hang inside it is located there.
template <typename Factory>
Status CallFactory(const char* kind, const std::string& name, Factory factory) {
  const CallScope scope({kind, name.c_str(), "factory"});
  return factory();
}

// The values that a plugin declares of a component, held against what the interface
// demands: others divide by it and index with it.
class DeclaredValues {
 public:
  DeclaredValues(const char* kind, const ResolvedComponent& component)
      : kind_(kind), component_(component) {}

  template <typename Value>
  void Check(bool holds, const std::string& field, const Value& found,
             const std::string& expected) const {
    if (holds) return;
    const PluginInfo& plugin = component_.info->plugin;
    std::ostringstream message;
    message << "plugin " << plugin.name << " (" << plugin.path << "): " << kind_ << " '"
            << component_.name() << "' says " << field << " = " << found << ", expected "
            << expected;
    throw Failure(ExitCode::kPluginRefused, message.str());
  }

 private:
  const char* kind_;
  const ResolvedComponent& component_;
};

void CheckEnvironment(const EnvironmentSpec& spec, const ResolvedComponent& component) {
  const DeclaredValues declared("environment", component);
  declared.Check(spec.observation_size > 0, "observation_size", spec.observation_size,
                 "at least 1");
  std::uint64_t parts = 0;
  for (const ObservationPart& part : spec.observation) parts += part.size;
  declared.Check(parts == spec.observation_size || spec.observation.empty(), "observation_size",
                 spec.observation_size,
                 "the sum of its observation parts, " + std::to_string(parts));
  declared.Check(spec.action_size > 0, "action_size", spec.action_size, "at least 1");
  for (const auto& [field, bounds] :
       {std::pair("action_low", spec.action_low), std::pair("action_high", spec.action_high)}) {
    declared.Check(bounds.size == spec.action_size && bounds.data != nullptr,
                   std::string(field) + ".size", bounds.size,
                   "action_size = " + std::to_string(spec.action_size) + " numbers");
  }
  for (std::uint64_t i = 0; i < spec.action_size; ++i) {
    const std::string index = "[" + std::to_string(i) + "]";
    declared.Check(std::isfinite(spec.action_low[i]), "action_low" + index, spec.action_low[i],
                   "a finite number");
    declared.Check(std::isfinite(spec.action_high[i]) && spec.action_high[i] > spec.action_low[i],
                   "action_high" + index, spec.action_high[i],
                   "a finite number above action_low" + index);
  }
  declared.Check(std::isfinite(spec.control_seconds) && spec.control_seconds > 0, "control_seconds",
                 spec.control_seconds, "more than 0");
  declared.Check(spec.substeps > 0, "substeps", spec.substeps, "at least 1");
  declared.Check(spec.episode_steps > 0, "episode_steps", spec.episode_steps, "at least 1");
  for (std::uint64_t i = 0; i < spec.ingredients.size; ++i) {
    const Ingredient& ingredient = spec.ingredients[i];
    declared.Check(ingredient.name != nullptr && ingredient.value != nullptr,
                   "ingredients[" + std::to_string(i) + "]", "null", "a name and a value");
  }
  declared.Check(std::isfinite(spec.return_low), "return_low", spec.return_low, "a finite number");
  declared.Check(std::isfinite(spec.return_high) && spec.return_high >= spec.return_low,
                 "return_high", spec.return_high, "a finite number, not below return_low");
}

void CheckModel(const Model& model, const EnvironmentSpec& environment,
                const ResolvedComponent& component) {
  const DeclaredValues declared("model", component);
  const std::uint64_t bytes = model.latent_bytes();
  declared.Check(bytes > 0 && bytes % kLatentAlignment == 0, "latent_bytes", bytes,
                 "a multiple of " + std::to_string(kLatentAlignment) + " above 0");
  declared.Check(model.action_size() == environment.action_size, "action_size", model.action_size(),
                 "the environment's, " + std::to_string(environment.action_size));
}

// A trait that promises an extension, held against the object.
template <typename Promised, typename Component>
void CheckPromise(const char* kind, const ResolvedComponent& component, Trait trait,
                  const char* name, Component* made) {
  if (!component.Has(trait) || ExtensionOf<Promised>(made) != nullptr) return;
  const PluginInfo& plugin = component.info->plugin;
  throw Failure(ExitCode::kPluginRefused, "plugin " + plugin.name + " (" + plugin.path +
                                              "): " + kind + " '" + component.name() +
                                              "' declares " + name + ", expected that it offers '" +
                                              Promised::kName + "', found that it does not");
}

}  // namespace

std::map<std::string, std::string> IngredientsOf(const EnvironmentSpec& spec) {
  std::map<std::string, std::string> ingredients;
  for (const Ingredient& ingredient : spec.ingredients) {
    ingredients[ingredient.name] = ingredient.value;
  }
  return ingredients;
}

void ThrowUnlessOk(const Status& status, const std::string& what) {
  if (status.ok()) return;
  const bool diverged =
      status.code == StatusCode::kNotFinite || status.code == StatusCode::kDiverged;
  throw Failure(diverged                               ? ExitCode::kDiverged
                : status.code == StatusCode::kDataLoss ? ExitCode::kBadInput
                                                       : ExitCode::kInternal,
                what + ": " + StatusCodeName(status.code) + ": " + status.message);
}

namespace {
constexpr char kModelState[] = "state";
}  // namespace

void SaveModel(const Model& model, const std::string& name, CheckpointWriter* writer) {
  writer->Part(kModelPart, [&](StateWriter* part) {
    const CallScope scope({"model", name.c_str(), "Save"});
    ThrowUnlessOk(part->Stream(kModelState, [&](ByteSink* sink) { return model.Save(sink); }),
                  "model '" + name + "' Save");
  });
}

void LoadModel(const Checkpoint& checkpoint, const std::string& name, Model* model) {
  checkpoint.Read(kModelPart, [&](StateReader* part) {
    const CallScope scope({"model", name.c_str(), "Load"});
    ThrowUnlessOk(
        part->Stream(kModelState, [&](ByteSource* source) { return model->Load(source); }),
        "model '" + name + "' Load");
  });
}

void CopyModel(const Model& from, const std::string& name, Model* to) {
  std::string bytes;
  StateWriter writer([&](std::string_view more) { bytes += more; });
  {
    const CallScope scope({"model", name.c_str(), "Save"});
    ThrowUnlessOk(writer.Stream(kModelState, [&](ByteSink* sink) { return from.Save(sink); }),
                  "model '" + name + "' Save");
  }
  writer.Flush();
  std::size_t read = 0;
  StateReader reader(
      [&](void* data, std::uint64_t size) {
        std::memcpy(data, bytes.data() + read, size);
        read += size;
      },
      bytes.size(), "model '" + name + "'", "");
  const CallScope scope({"model", name.c_str(), "Load"});
  ThrowUnlessOk(reader.Stream(kModelState, [&](ByteSource* source) { return to->Load(source); }),
                "model '" + name + "' Load");
}

std::string ModelSha256(const Checkpoint& checkpoint) {
  return checkpoint.StreamSha256(kModelPart, kModelState);
}

Components::Components(const RunSpec& spec)
    : spec_(spec),
      environment_(&Load(spec.environment, ComponentKind::kEnvironment)),
      model_(&Load(spec.model, ComponentKind::kModel)),
      planner_(&Load(spec.planner, ComponentKind::kPlanner)),
      evaluation_planner_(&Load(spec.eval_planner, ComponentKind::kPlanner)) {
  if (spec.evaluation && spec.evaluation->trained_model) {
    trained_ = &Load(*spec.evaluation->trained_model, ComponentKind::kModel);
  }
}

EnvironmentPtr Components::MakeEnvironment() const {
  const ParameterStorage parameters(spec_.environment.parameters);
  EnvironmentContext context;
  context.action_repeat = spec_.action_repeat();
  context.parameters = parameters.view();
  Environment* environment = nullptr;
  const std::string& name = spec_.environment.name();
  const Status status = CallFactory(
      "environment", name, [&] { return environment_->create_environment(context, &environment); });
  EnvironmentPtr made(FactoryResult(status, environment, "environment", name));
  CheckEnvironment(made->spec(), spec_.environment);
  if (!spec_.environment.ingredients.empty()) {
    ResolvedComponent now = spec_.environment;
    now.ingredients = IngredientsOf(made->spec());
    const std::string change = IngredientChange(now, spec_.environment.ingredients);
    if (!change.empty()) throw Failure(ExitCode::kPluginRefused, change);
  }
  return made;
}

ModelPtr Components::MakeModel(const ResolvedComponent& component,
                               const ComponentDescriptor& descriptor,
                               const EnvironmentSpec& environment, std::uint32_t threads,
                               Environment* own_environment, Model* trained_model) const {
  const ParameterStorage parameters(component.parameters);
  ModelContext context;
  context.parameters = parameters.view();
  context.observation_size = environment.observation_size;
  context.action_size = environment.action_size;
  context.action_repeat = spec_.action_repeat();
  context.episode_decisions =
      (environment.episode_steps + spec_.action_repeat() - 1) / spec_.action_repeat();
  context.terminates = environment.terminates;
  context.seed = SeedFor(spec_.seed, SeedUse::kParameters, EpisodePurpose::kTraining, 0, 0);
  context.environment = own_environment;
  context.trained_model = trained_model;
  Model* model = nullptr;
  const Status status = CallFactory("model", component.name(),
                                    [&] { return descriptor.create_model(context, &model); });
  ModelPtr made(FactoryResult(status, model, "model", component.name()));
  CheckModel(*made, environment, component);
  CheckPromise<ReturnGradient>("model", component, kGivesGradients, "kGivesGradients", made.get());
  made->SetThreads(threads);
  return made;
}

ModelPtr Components::MakeModel(const EnvironmentSpec& environment, std::uint32_t threads,
                               Environment* own_environment, Model* trained_model) const {
  return MakeModel(spec_.model, *model_, environment, threads, own_environment, trained_model);
}

ModelPtr Components::MakeTrainedModel(const EnvironmentSpec& environment,
                                      std::uint32_t threads) const {
  if (trained_ == nullptr) return nullptr;
  return MakeModel(*spec_.evaluation->trained_model, *trained_, environment, threads, nullptr,
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
  const Status status = CallFactory("planner", planner.name(),
                                    [&] { return descriptor.create_planner(context, &made); });
  PlannerPtr owned(FactoryResult(status, made, "planner", planner.name()));
  CheckPromise<PolicyReporting>("planner", planner, kReportsPolicy, "kReportsPolicy", made);
  return owned;
}

PlannerPtr Components::MakePlanner(const LatentModel& model) const {
  return MakePlanner(spec_.planner, *planner_, model);
}

PlannerPtr Components::MakeEvaluationPlanner(const LatentModel& model) const {
  return MakePlanner(spec_.eval_planner, *evaluation_planner_, model);
}

}  // namespace dreamsearch
