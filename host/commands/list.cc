// runner list [KIND] - which environments, models and planners are there?
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "host/commands/commands.h"
#include "host/flags/flags.h"
#include "host/plugins/catalogue.h"
#include "results/system/error.h"
#include "results/text/names.h"
#include "results/text/table.h"

namespace dreamsearch {
namespace {

constexpr const char* kKinds[] = {"environments", "models", "planners"};

void PrintKind(const Catalogue& catalogue, ComponentKind kind) {
  results::Table table = {{"NAME", "VERSION", "PLUGIN", "SUMMARY"}, {}};
  for (const auto& component : catalogue.components()) {
    if (component->kind != kind) continue;
    std::string summary = component->summary;
    if (!component->aliases.empty()) summary += " (also " + JoinNames(component->aliases) + ")";
    table.rows.push_back({component->name, component->version,
                          component->plugin.name + " " + component->plugin.version, summary});
  }
  std::cout << kKinds[static_cast<std::size_t>(kind) - 1] << '\n';
  if (table.rows.empty()) {
    std::cout << "  none\n";
  } else {
    std::cout << table.Print(results::TableForm::kText, 2);
  }
}

struct List {
  std::optional<ComponentKind> only;
  std::vector<std::string> plugin_path;

  CommandSpec Declare() {
    const Choices<ComponentKind> kinds = {
        {kKinds[0], ComponentKind::kEnvironment, {"environment", "env"}},
        {kKinds[1], ComponentKind::kModel, {"model"}},
        {kKinds[2], ComponentKind::kPlanner, {"planner"}}};
    return {.name = "runner list",
            .summary = "lists the components of all plugins, and the plugins that were refused",
            .examples = {"runner list planners"},
            .about = "`runner describe NAME` shows the parameters of a component.",
            .arguments = {{"", "KIND", OneOf(&only, kinds).Default("all"), "what to list"}},
            .groups = {{"Where", {PluginPathFlag(&plugin_path)}}}};
  }
  int Run();
};

int List::Run() {
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

}  // namespace

Command ListCommand() { return MakeCommand<List>(); }

}  // namespace dreamsearch
