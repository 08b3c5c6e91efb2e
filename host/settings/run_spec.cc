#include "host/settings/run_spec.h"

#include <algorithm>
#include <cassert>
#include <charconv>
#include <cmath>

#include "host/settings/run_parameters.h"
#include "results/system/error.h"
#include "results/system/sha256.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"

namespace dreamsearch {

using Json = nlohmann::json;

Json ToJson(const RunSpec& spec) { return results::FieldsToJson(spec); }

RunSpec RunSpecFromJson(const Json& json) {
  try {
    return results::FieldsFromJson<RunSpec>(json);
  } catch (const Json::exception& error) {
    throw Failure(ExitCode::kInternal,
                  std::string("a run's description cannot be read: ") + error.what());
  }
}

// --- values ------------------------------------------------------------------

std::string NumberText(ParameterType type, double number) {
  char text[64];
  const std::to_chars_result end =
      type == ParameterType::kInt
          ? std::to_chars(text, text + sizeof text, static_cast<std::int64_t>(number))
          : std::to_chars(text, text + sizeof text, number);
  return std::string(text, end.ptr);
}

const char* ValueOriginName(ValueOrigin origin) {
  switch (origin) {
    case ValueOrigin::kDefault:
      return "default";
    case ValueOrigin::kPreset:
      return "preset";
    case ValueOrigin::kFile:
      return "file";
    case ValueOrigin::kCommandLine:
      return "command line";
    case ValueOrigin::kModel:
      return "model";
    case ValueOrigin::kEnvironment:
      return "environment";
  }
  return "unknown";
}

std::string ValueText(const ResolvedValue& value) {
  switch (value.type) {
    case ParameterType::kBool:
      return value.number != 0 ? "true" : "false";
    case ParameterType::kChoice:
    case ParameterType::kText:
    case ParameterType::kPath:
      return value.choice;
    default:
      return NumberText(value.type, value.number);
  }
}

const ResolvedValue* ResolvedValues::Find(std::string_view name) const {
  for (const ResolvedValue& value : values) {
    if (value.name == name) return &value;
  }
  return nullptr;
}

double ResolvedValues::Number(std::string_view name) const {
  const ResolvedValue* value = Find(name);
  if (value == nullptr) {
    throw Failure(ExitCode::kInternal, "no resolved value '" + std::string(name) + "'");
  }
  return value->number;
}

std::uint64_t ResolvedValues::Integer(std::string_view name) const {
  const double number = Number(name);
  assert(number >= 0 && number == std::trunc(number));
  return static_cast<std::uint64_t>(number);
}

const std::string& ResolvedValues::Choice(std::string_view name) const {
  const ResolvedValue* value = Find(name);
  if (value == nullptr) {
    throw Failure(ExitCode::kInternal, "no resolved value '" + std::string(name) + "'");
  }
  return value->choice;
}

std::string ResolvedComponent::task() const {
  if (info->task_parameter.empty()) return info->name;
  const std::string& text = parameters.Choice(info->task_parameter);
  return text.empty() ? info->name : info->name + ":" + text;
}

std::vector<const ResolvedComponent*> ComponentsOf(const RunSpec& spec) {
  std::vector<const ResolvedComponent*> components = {&spec.environment, &spec.model, &spec.planner,
                                                      &spec.eval_planner};
  if (spec.evaluation && spec.evaluation->trained_model) {
    components.push_back(&*spec.evaluation->trained_model);
  }
  return components;
}

namespace {

// The files that the run's settings name, each with its SHA-256 in the value.
std::vector<const ResolvedValue*> NamedFiles(const RunSpec& spec) {
  std::vector<const ResolvedValue*> files;
  for (const ResolvedComponent* component : ComponentsOf(spec)) {
    for (const ResolvedValue& value : component->parameters.values) {
      if (!value.sha256.empty()) files.push_back(&value);
    }
  }
  return files;
}

std::string DigestName(const ResolvedValue& file) { return "file " + file.choice; }
constexpr std::string_view kIngredient = "ingredient ";

// As PluginChange.
std::string FileChange(const ResolvedValue& now, const std::string& then) {
  if (now.sha256 == then) return "";
  return DigestName(now) + " changed (SHA-256 " +
         (then.empty() ? "of another file" : then.substr(0, 12)) + " then, " +
         now.sha256.substr(0, 12) + " now)";
}

}  // namespace

std::string IngredientChange(const ResolvedComponent& environment,
                             const std::map<std::string, std::string>& then) {
  // SHA-256 as PluginChange has them.
  const auto shown = [](const std::map<std::string, std::string>& of, const std::string& name) {
    const auto found = of.find(name);
    if (found == of.end()) return std::string("none");
    const bool digest = found->second.size() == 64;
    return digest ? "SHA-256 " + found->second.substr(0, 12) : found->second;
  };
  std::map<std::string, std::string> all = environment.ingredients;
  all.insert(then.begin(), then.end());
  for (const auto& [name, value] : all) {
    const std::string before = shown(then, name), now = shown(environment.ingredients, name);
    const auto old = then.find(name);
    const auto present = environment.ingredients.find(name);
    if (old != then.end() && present != environment.ingredients.end() &&
        old->second == present->second) {
      continue;
    }
    return name + " of environment '" + environment.task() + "' changed (" + before + " then, " +
           now + " now)";
  }
  return "";
}

std::string ChangedSince(const RunSpec& spec, const std::map<std::string, std::string>& then) {
  const auto before = [&](const std::string& name) {
    const auto found = then.find(name);
    return found == then.end() ? std::string() : found->second;
  };
  for (const ResolvedComponent* component : ComponentsOf(spec)) {
    const PluginInfo& now = component->info->plugin;
    std::string change = PluginChange(now, before(now.name));
    if (!change.empty()) return change;
  }
  for (const ResolvedValue* file : NamedFiles(spec)) {
    std::string change = FileChange(*file, before(DigestName(*file)));
    if (!change.empty()) return change;
  }
  std::map<std::string, std::string> ingredients;
  for (const auto& [name, value] : then) {
    if (name.starts_with(kIngredient)) ingredients[name.substr(kIngredient.size())] = value;
  }
  return IngredientChange(spec.environment, ingredients);
}

std::map<std::string, std::string> DigestsOf(const RunSpec& spec) {
  std::map<std::string, std::string> digests;
  for (const ResolvedComponent* component : ComponentsOf(spec)) {
    digests[component->info->plugin.name] = component->info->plugin.sha256;
  }
  for (const ResolvedValue* file : NamedFiles(spec)) digests[DigestName(*file)] = file->sha256;
  for (const auto& [name, value] : spec.environment.ingredients) {
    digests[std::string(kIngredient) + name] = value;
  }
  return digests;
}

std::string ChangedFile(const RunSpec& spec) {
  for (const ResolvedComponent* component : ComponentsOf(spec)) {
    PluginInfo there = component->info->plugin;
    there.sha256 = Sha256HexOfFile(there.path);
    std::string change = PluginChange(there, component->info->plugin.sha256);
    if (!change.empty()) return change;
  }
  for (const ResolvedValue* file : NamedFiles(spec)) {
    ResolvedValue there = *file;
    there.sha256 = Sha256HexOfFile(file->choice);
    std::string change = FileChange(there, file->sha256);
    if (!change.empty()) return change;
  }
  return "";
}

std::string DigestFilesAnew(ResolvedValues* values) {
  std::string first;
  for (ResolvedValue& value : values->values) {
    if (value.sha256.empty()) continue;
    const std::string then = value.sha256;
    value.sha256 = Sha256HexOfFile(value.choice);
    if (first.empty()) first = FileChange(value, then);
  }
  return first;
}

// --- configurations ----------------------------------------------------------

namespace {

Json ValueJson(const ResolvedValue& value) {
  switch (value.type) {
    case ParameterType::kBool:
      return value.number != 0;
    case ParameterType::kInt:
      return static_cast<std::int64_t>(value.number);
    case ParameterType::kReal:
      return value.number;
    case ParameterType::kChoice:
    case ParameterType::kText:
    case ParameterType::kPath:
      return value.choice;
  }
  return nullptr;
}

Json CanonicalValues(const ResolvedValues& resolved) {
  Json json = Json::object();
  for (const ResolvedValue& value : resolved.values) json[value.name] = ValueJson(value);
  return json;
}

// Takes the value of `name` out of `values` where it is `number`.
void EraseIf(const ResolvedValues& resolved, const std::string& name, double number, Json* values) {
  const ResolvedValue* value = resolved.Find(name);
  if (value != nullptr && value->number == number) values->erase(name);
}

Json CanonicalRun(const ResolvedValues& run) {
  Json values = CanonicalValues(run);
  for (const LaterRunParameter& later : kLaterRunParameters) {
    EraseIf(run, std::string(later.name), later.before, &values);
  }
  return values;
}

Json CanonicalComponent(const ResolvedComponent& component) {
  const ResolvedValues& resolved = component.parameters;
  Json values = CanonicalValues(resolved);
  for (const ParameterInfo& parameter : component.info->parameters) {
    if (parameter.variation) EraseIf(resolved, parameter.name, parameter.default_number, &values);
  }
  return {{"name", component.name()}, {"parameters", values}};
}

}  // namespace

std::string CanonicalJson(const RunSpec& spec) {
  // nlohmann's objects are ordered by key, and its doubles are the shortest texts
  // that read back the same.
  Json json = {{"environment", CanonicalComponent(spec.environment)},
               {"model", CanonicalComponent(spec.model)},
               {"planner", CanonicalComponent(spec.planner)}};
  if (!spec.evaluation) {
    json["eval_planner"] = CanonicalComponent(spec.eval_planner);
    json["run"] = CanonicalRun(spec.run);
    return results::JsonText(json);
  }
  json["run"] = {{"action_repeat", spec.run.Integer("action_repeat")},
                 {"eval_episodes", spec.run.Integer("eval_episodes")}};
  json["evaluation"] = {{"env_step", spec.evaluation->env_step},
                        {"agent_sha256", spec.evaluation->agent_sha256}};
  if (spec.evaluation->trained_model) {
    json["evaluation"]["behaviour"] = CanonicalComponent(*spec.evaluation->trained_model);
  }
  const RankingSpec& ranks = spec.evaluation->ranks;
  if (ranks.every > 0) {
    json["evaluation"]["ranks"] = {{"every", ranks.every}, {"decisions", ranks.decisions}};
  }
  return results::JsonText(json);
}

std::string ConfigurationSha256(const RunSpec& spec) { return Sha256Hex(CanonicalJson(spec)); }

void CheckValues(const ResolvedValues& values, const std::vector<ParameterInfo>& parameters,
                 const std::string& where) {
  const auto refuse = [&](const std::string& name, const std::string& found) {
    throw Failure(ExitCode::kBadInput, where + name + ": found " + found +
                                           " among the recorded settings, which this parameter "
                                           "cannot have; they were damaged or changed");
  };
  for (const ParameterInfo& parameter : parameters) {
    const ResolvedValue* value = values.Find(parameter.name);
    if (value == nullptr) return refuse(parameter.name, "no value");
    if (value->type != parameter.type) return refuse(parameter.name, "a value of another type");
    const bool chosen = parameter.type == ParameterType::kChoice;
    if (chosen && std::find(parameter.choices.begin(), parameter.choices.end(), value->choice) ==
                      parameter.choices.end()) {
      return refuse(parameter.name, "'" + value->choice + "'");
    }
    const bool number =
        parameter.type == ParameterType::kInt || parameter.type == ParameterType::kReal;
    // Written so that NaN fails.
    const bool fits =
        value->number >= parameter.min && value->number <= parameter.max &&
        (parameter.type == ParameterType::kReal || value->number == std::trunc(value->number));
    const bool flag =
        parameter.type != ParameterType::kBool || value->number == 0 || value->number == 1;
    if ((number && !fits) || !flag) {
      return refuse(parameter.name, NumberText(ParameterType::kReal, value->number));
    }
  }
}

ParameterStorage::ParameterStorage(const ResolvedValues& resolved) {
  for (const ResolvedValue& value : resolved.values) {
    ParameterValue stored;
    stored.name = texts_.emplace_back(value.name).c_str();
    stored.number = value.number;
    if (IsText(value.type)) {
      stored.choice = texts_.emplace_back(value.choice).c_str();
    }
    values_.push_back(stored);
  }
}

}  // namespace dreamsearch
