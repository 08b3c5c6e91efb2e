// runner list [KIND] - the components of all plugins, and what was refused.
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "host/commands/commands.h"
#include "host/commands/options.h"
#include "host/commands/text_table.h"
#include "host/plugins/catalogue.h"
#include "results/system/error.h"
#include "results/system/names.h"

namespace dreamsearch {
namespace {

namespace po = boost::program_options;

constexpr const char* kHelp =
    R"(runner list [KIND] - the components of all plugins, and what was refused

KIND is environments, models or planners; all of them unless given.
`runner describe NAME` shows the parameters of one.

)";

const std::vector<std::string> kKinds = {"environments", "models", "planners"};

std::optional<ComponentKind> ParseKind(const std::string& text) {
  if (text.empty()) return std::nullopt;
  if (text == "env" || text == "environment" || text == "environments") {
    return ComponentKind::kEnvironment;
  }
  if (text == "model" || text == "models") return ComponentKind::kModel;
  if (text == "planner" || text == "planners") return ComponentKind::kPlanner;
  throw Failure(ExitCode::kUsage,
                "runner list: no kind '" + text + "'. " + KnownNames(text, kKinds));
}

void PrintKind(const Catalogue& catalogue, ComponentKind kind) {
  TextTable table(2);
  table.Row({"NAME", "VERSION", "PLUGIN", "SUMMARY"});
  bool any = false;
  for (const auto& component : catalogue.components()) {
    if (component->kind != kind) continue;
    any = true;
    std::string summary = component->summary;
    if (!component->aliases.empty()) summary += " (also " + JoinNames(component->aliases) + ")";
    table.Row({component->name, component->version,
               component->plugin.name + " " + component->plugin.version, summary});
  }
  std::cout << kKinds[static_cast<std::size_t>(kind) - 1] << '\n';
  if (any) {
    table.Print(std::cout);
  } else {
    std::cout << "  none\n";
  }
}

}  // namespace

int ListCommand(const std::vector<std::string>& arguments) {
  bool help = false;
  std::string kind_name;
  std::vector<std::string> plugin_path;
  po::options_description flags = PluginPathFlag(&plugin_path);
  flags.add_options()("help", po::bool_switch(&help), "show this text");
  po::options_description all = flags;
  all.add_options()("kind", po::value(&kind_name), "");
  ParseFlags("runner list", arguments, all, po::positional_options_description().add("kind", 1));
  if (help) {
    std::cout << kHelp << flags;
    return static_cast<int>(ExitCode::kOk);
  }
  const std::optional<ComponentKind> only = ParseKind(kind_name);

  const Catalogue catalogue = Catalogue::Scan(PluginFolders(plugin_path));
  bool first = true;
  for (const ComponentKind kind :
       {ComponentKind::kEnvironment, ComponentKind::kModel, ComponentKind::kPlanner}) {
    if (only && kind != *only) continue;
    if (!first) std::cout << '\n';
    first = false;
    PrintKind(catalogue, kind);
  }
  if (!catalogue.refusals().empty()) std::cout << "\nrefused\n";
  for (const PluginRefusal& refusal : catalogue.refusals()) {
    std::cout << "  " << refusal.message << '\n';
  }
  for (const std::string& warning : catalogue.warnings()) {
    std::cerr << "warning: " << warning << '\n';
  }
  if (catalogue.folders().empty()) {
    std::cerr << "warning: no plugin folder exists; give one with --plugin-path or "
                 "$DREAMSEARCH_PLUGIN_PATH\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace dreamsearch
