// runner describe [KIND/]NAME - what can be set of a component, and what does it measure?
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "host/commands/commands.h"
#include "host/flags/flags.h"
#include "host/plugins/catalogue.h"
#include "host/settings/run_parameters.h"
#include "host/settings/settings.h"
#include "results/system/error.h"
#include "results/text/names.h"
#include "results/text/table.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kWidth = 100;

std::string Value(const ParameterInfo& parameter, double number, const std::string& choice) {
  ResolvedValue value;
  value.type = parameter.type;
  value.number = number;
  value.choice = choice;
  return ValueText(value);
}

std::string TypeName(ParameterType type) {
  switch (type) {
    case ParameterType::kBool:
      return "bool";
    case ParameterType::kInt:
      return "int";
    case ParameterType::kReal:
      return "real";
    case ParameterType::kChoice:
      return "choice";
    case ParameterType::kText:
      return "text";
    case ParameterType::kPath:
      return "path";
  }
  return "unknown";
}

std::string Range(const ParameterInfo& parameter) {
  switch (parameter.type) {
    case ParameterType::kBool:
      return "true, false";
    case ParameterType::kChoice:
      return JoinNames(parameter.choices);
    case ParameterType::kText:
    case ParameterType::kPath:
      return "";
    default:
      return Value(parameter, parameter.min, "") + " .. " + Value(parameter, parameter.max, "");
  }
}

void Print(const results::Table& table) { std::cout << table.Print(results::TableForm::kText, 2); }

// `key` is what --set calls the component.
void PrintParameters(const std::string& key, const std::vector<ParameterInfo>& parameters) {
  if (parameters.empty()) {
    std::cout << "\nno parameters\n";
    return;
  }
  std::cout << "\nparameters (--set " << key << ".NAME=VALUE)\n";
  results::Table table = {{"NAME", "TYPE", "DEFAULT", "RANGE", "UNIT", "PRESETS"}, {}};
  for (const ParameterInfo& parameter : parameters) {
    std::vector<std::string> presets;
    for (const PresetInfo& preset : parameter.presets) {
      presets.push_back(preset.preset + "=" + Value(parameter, preset.number, preset.choice));
    }
    const std::string help =
        parameter.help + (parameter.variation ? " May differ in `runner eval`." : "");
    table.notes[table.rows.size()] = WrapText(help, kWidth, 6);
    table.rows.push_back({parameter.name, TypeName(parameter.type),
                          Value(parameter, parameter.default_number, parameter.default_choice),
                          Range(parameter), parameter.unit, JoinNames(presets)});
  }
  Print(table);
}

// "learns, default": what a component declares of itself.
std::string TraitsText(const ComponentInfo& component) {
  constexpr std::pair<Trait, const char*> kNames[] = {{kSearches, "searches"},
                                                      {kActorAlone, "the actor alone"},
                                                      {kReportsPolicy, "reports its policy"},
                                                      {kLearns, "learns"},
                                                      {kLearnsFromSearch, "learns from searches"},
                                                      {kGivesGradients, "gives gradients"},
                                                      {kNeedsGradients, "needs gradients"},
                                                      {kNeedsEnvironment, "needs an environment"},
                                                      {kDefault, "taken if none is named"}};
  std::vector<std::string> names;
  for (const auto& [trait, name] : kNames) {
    if (component.Has(trait)) names.emplace_back(name);
  }
  return JoinNames(names);
}

// What a model or an environment asks of the runner.
void PrintRunPresets(const ComponentInfo& component) {
  if (component.run_presets.empty()) return;
  std::cout << "\nits values of the runner's own parameters (`runner describe run`), below "
               "configuration file and command line\n";
  std::map<std::string, std::vector<std::string>> presets;
  for (const RunPresetInfo& preset : component.run_presets) {
    ResolvedValue value;
    value.type = ParameterType::kReal;
    value.number = preset.number;
    presets[preset.name].push_back(preset.preset + "=" + ValueText(value));
  }
  results::Table table = {{"NAME", "PRESETS"}, {}};
  for (const auto& [name, values] : presets) {
    table.rows.push_back({"run." + name, JoinNames(values)});
  }
  Print(table);
}

void PrintComponent(const ComponentInfo& component) {
  const PluginInfo& plugin = component.plugin;
  std::cout << ComponentKindName(component.kind) << ' ' << component.name << ' '
            << component.version << '\n'
            << WrapText(component.summary, kWidth, 2) << '\n';
  results::Table facts;
  if (!component.aliases.empty())
    facts.rows.push_back({"also called", JoinNames(component.aliases)});
  const std::string traits = TraitsText(component);
  if (!traits.empty()) facts.rows.push_back({"traits", traits});
  facts.rows.push_back({"plugin", plugin.name + " " + plugin.version + ", SDK " +
                                      std::to_string(plugin.sdk_major) + "." +
                                      std::to_string(plugin.sdk_minor)});
  facts.rows.push_back({"file", plugin.path});
  facts.rows.push_back({"sha256", plugin.sha256});
  Print(facts);
  PrintParameters(component.name, component.parameters);
  PrintRunPresets(component);
  if (component.metrics.empty()) return;
  std::cout << "\nmetrics\n";
  results::Table metrics = {{"NAME", "UNIT", "MEANING"}, {}};
  for (const MetricInfo& metric : component.metrics) {
    metrics.rows.push_back({metric.name, metric.unit, metric.help});
  }
  Print(metrics);
}

void PrintRun() {
  std::cout << "run\n  The runner's own parameters: budget, schedule and evaluation.\n";
  std::vector<ParameterInfo> parameters;
  for (const ParameterSpec& spec : RunParameters()) parameters.push_back(DescribeParameter(spec));
  PrintParameters("run", parameters);
}

// Lists what a plugin offers; false if there is no plugin of that name.
bool PrintPlugin(const Catalogue& catalogue, const std::string& name) {
  std::vector<const ComponentInfo*> offered;
  for (const auto& component : catalogue.components()) {
    if (component->plugin.name == name) offered.push_back(component.get());
  }
  if (offered.empty()) return false;
  const PluginInfo& plugin = offered.front()->plugin;
  std::cout << "plugin " << plugin.name << ' ' << plugin.version << "\n  " << plugin.path << "\n\n";
  results::Table table = {{"KIND", "NAME", "WHAT IT IS"}, {}};
  for (const ComponentInfo* component : offered) {
    table.rows.push_back(
        {std::string(ComponentKindName(component->kind)), component->name, component->summary});
  }
  Print(table);
  std::cout << "\n`runner describe " << ComponentKindName(offered.front()->kind) << '/'
            << offered.front()->name << "` shows the parameters of a component\n";
  return true;
}

[[noreturn]] void RefuseUnknown(const Catalogue& catalogue, const std::string& name) {
  std::vector<std::string> known;
  for (const auto& component : catalogue.components()) {
    known.push_back(std::string(ComponentKindName(component->kind)) + "/" + component->name);
  }
  std::vector<std::string> names = {"run"};
  for (const auto& component : catalogue.components()) {
    names.push_back(component->name);
    names.push_back(component->plugin.name);
  }
  std::string message = "runner describe: no component or plugin '" + name + "'. Known: run, " +
                        JoinNames(known) + ".";
  const std::vector<std::string> near = NearestNames(name, names);
  if (!near.empty()) message += " Did you mean " + near.front() + "?";
  throw Failure(ExitCode::kNotFound, message);
}

struct Describe {
  std::string name;
  std::vector<std::string> plugin_path;

  CommandSpec Declare() {
    return {.name = "runner describe",
            .summary = "shows what a component declares: parameters, presets and metrics",
            .examples = {"runner describe mcts_pw", "runner describe model/dreamer",
                         "runner describe run"},
            .about =
                "Without a kind (environment/, model/ or planner/) the command shows every "
                "component of that name. With the name of a plugin it lists the plugin's "
                "components. `run` stands for the runner's own parameters.",
            .arguments = {{"", "[KIND/]NAME", Text(&name).Required(),
                           "a component or a plugin, from `runner list`, or `run`"}},
            .groups = {{"Where", {PluginPathFlag(&plugin_path)}}}};
  }
  int Run();
};

int Describe::Run() {
  if (name == "run") {
    PrintRun();
    return static_cast<int>(ExitCode::kOk);
  }
  const Catalogue catalogue = Catalogue::Scan(PluginFolders(plugin_path));
  const std::vector<std::shared_ptr<const ComponentInfo>> components =
      ComponentsNamed(catalogue, "runner describe", name);
  if (components.empty() && !PrintPlugin(catalogue, name)) RefuseUnknown(catalogue, name);
  bool first = true;
  for (const auto& component : components) {
    if (!first) std::cout << '\n';
    first = false;
    PrintComponent(*component);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command DescribeCommand() { return MakeCommand<Describe>(); }

}  // namespace dreamsearch
