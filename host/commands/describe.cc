// runner describe [KIND/]NAME - what a component declares.
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "host/commands/commands.h"
#include "host/commands/options.h"
#include "host/commands/text_table.h"
#include "host/plugins/catalogue.h"
#include "host/settings/run_parameters.h"
#include "host/settings/settings.h"
#include "results/system/error.h"
#include "results/system/names.h"
#include "results/system/text.h"

namespace dreamsearch {
namespace {

namespace po = boost::program_options;

constexpr std::size_t kWidth = 100;

constexpr const char* kHelp =
    R"(runner describe [KIND/]NAME - parameters, presets and metrics of a component

KIND is environment, model or planner; without it every component of that name is
shown. `runner describe PLUGIN` lists the components of a plugin, `runner describe run`
shows the runner's own parameters.

)";

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
      return "";
    default:
      return Value(parameter, parameter.min, "") + " .. " + Value(parameter, parameter.max, "");
  }
}

// `key` is what --set calls the component.
void PrintParameters(const std::string& key, const std::vector<ParameterInfo>& parameters) {
  if (parameters.empty()) {
    std::cout << "\nno parameters\n";
    return;
  }
  std::cout << "\nparameters (--set " << key << ".NAME=VALUE)\n";
  TextTable table(2);
  table.Row({"NAME", "TYPE", "DEFAULT", "RANGE", "UNIT", "PRESETS"});
  for (const ParameterInfo& parameter : parameters) {
    std::vector<std::string> presets;
    for (const PresetInfo& preset : parameter.presets) {
      presets.push_back(preset.preset + "=" + Value(parameter, preset.number, preset.choice));
    }
    table.Row({parameter.name, TypeName(parameter.type),
               Value(parameter, parameter.default_number, parameter.default_choice),
               Range(parameter), parameter.unit, JoinNames(presets)});
    table.Note(WrapText(parameter.help, kWidth, 6));
  }
  table.Print(std::cout);
}

// "learns, default": what a component declares of itself.
std::string TraitsText(const ComponentInfo& component) {
  constexpr std::pair<Trait, const char*> kNames[] = {{kSearches, "searches"},
                                                      {kActorAlone, "the actor alone"},
                                                      {kLearns, "learns"},
                                                      {kNeedsEnvironment, "needs an environment"},
                                                      {kDefault, "taken if none is named"}};
  std::vector<std::string> names;
  for (const auto& [trait, name] : kNames) {
    if (component.Has(trait)) names.emplace_back(name);
  }
  return JoinNames(names);
}

void PrintComponent(const ComponentInfo& component) {
  const PluginInfo& plugin = component.plugin;
  std::cout << ComponentKindName(component.kind) << ' ' << component.name << ' '
            << component.version << '\n'
            << WrapText(component.summary, kWidth, 2) << '\n';
  TextTable facts(2);
  if (!component.aliases.empty()) facts.Row({"also called", JoinNames(component.aliases)});
  const std::string traits = TraitsText(component);
  if (!traits.empty()) facts.Row({"traits", traits});
  facts.Row({"plugin", plugin.name + " " + plugin.version + ", SDK " +
                           std::to_string(plugin.sdk_major) + "." +
                           std::to_string(plugin.sdk_minor)});
  facts.Row({"file", plugin.path});
  facts.Row({"sha256", plugin.sha256});
  facts.Print(std::cout);
  PrintParameters(component.name, component.parameters);
  if (component.metrics.empty()) return;
  std::cout << "\nmetrics\n";
  TextTable metrics(2);
  metrics.Row({"NAME", "UNIT", "MEANING"});
  for (const MetricInfo& metric : component.metrics) {
    metrics.Row({metric.name, metric.unit, metric.help});
  }
  metrics.Print(std::cout);
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
  TextTable table(2);
  table.Row({"KIND", "NAME", "WHAT IT IS"});
  for (const ComponentInfo* component : offered) {
    table.Row({ComponentKindName(component->kind), component->name, component->summary});
  }
  table.Print(std::cout);
  std::cout << "\n`runner describe " << ComponentKindName(offered.front()->kind) << '/'
            << offered.front()->name << "` shows what can be set of one\n";
  return true;
}

// The components a text names: of one kind if it says so, otherwise of all; empty if
// there are none.
std::vector<std::shared_ptr<const ComponentInfo>> Named(const Catalogue& catalogue,
                                                        const std::string& text) {
  const auto slash = text.find('/');
  const std::string name = slash == std::string::npos ? text : text.substr(slash + 1);
  const std::string kind_name = slash == std::string::npos ? "" : text.substr(0, slash);
  const std::vector<ComponentKind> kinds = {ComponentKind::kEnvironment, ComponentKind::kModel,
                                            ComponentKind::kPlanner};
  if (!kind_name.empty()) {
    for (const ComponentKind kind : kinds) {
      const bool short_name = kind == ComponentKind::kEnvironment && kind_name == "env";
      if (short_name || kind_name == ComponentKindName(kind)) return {catalogue.Find(kind, name)};
    }
    throw Failure(ExitCode::kUsage, "runner describe: no kind '" + kind_name + "'. " +
                                        KnownNames(kind_name, {"environment", "model", "planner"}));
  }
  std::vector<std::shared_ptr<const ComponentInfo>> found;
  for (const ComponentKind kind : kinds) {
    try {
      found.push_back(catalogue.Find(kind, name));
    } catch (const Failure& error) {
      // Of no such name here: perhaps of another kind. Anything else is the answer.
      if (error.code() != ExitCode::kNotFound) throw;
    }
  }
  return found;
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

}  // namespace

int DescribeCommand(const std::vector<std::string>& arguments) {
  bool help = false;
  std::string name;
  std::vector<std::string> plugin_path;
  po::options_description flags = PluginPathFlag(&plugin_path);
  flags.add_options()("help", po::bool_switch(&help), "show this text");
  po::options_description all = flags;
  all.add_options()("name", po::value(&name), "");
  ParseFlags("runner describe", arguments, all,
             po::positional_options_description().add("name", 1));
  if (help) {
    std::cout << kHelp << flags;
    return static_cast<int>(ExitCode::kOk);
  }
  if (name.empty()) {
    throw Failure(ExitCode::kUsage,
                  "runner describe: expected [KIND/]NAME, found nothing; `runner list` shows "
                  "the names");
  }
  if (name == "run") {
    PrintRun();
    return static_cast<int>(ExitCode::kOk);
  }
  const Catalogue catalogue = Catalogue::Scan(PluginFolders(plugin_path));
  const std::vector<std::shared_ptr<const ComponentInfo>> components = Named(catalogue, name);
  if (components.empty() && !PrintPlugin(catalogue, name)) RefuseUnknown(catalogue, name);
  bool first = true;
  for (const auto& component : components) {
    if (!first) std::cout << '\n';
    first = false;
    PrintComponent(*component);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch
