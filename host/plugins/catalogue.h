// catalogue.h - what all plugins of some folders offer, without loading them here.
//
// Each library is described in a child process, so that one that crashes, hangs,
// exits or floods its output is a refusal with a reason and nothing more. What
// is kept are owning copies; they outlive the catalogue.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dreamsearch/plugin.h"
#include "results/system/error.h"

namespace dreamsearch {

struct PresetInfo {
  std::string preset;
  double number = 0;
  std::string choice;
};

// A ParameterSpec, owned; the fields mean the same.
struct ParameterInfo {
  std::string name;
  ParameterType type = ParameterType::kReal;
  double default_number = 0;
  double min = 0;
  double max = 0;
  std::string default_choice;
  std::vector<std::string> choices;
  std::string unit;
  std::string help;
  std::vector<PresetInfo> presets;
};

struct MetricInfo {
  std::string name;
  std::string unit;
  std::string help;
};

struct PluginInfo {
  std::string name;
  std::string version;
  std::string path;    // absolute
  std::string sha256;  // of the file, hexadecimal
  std::uint32_t sdk_major = 0;
  std::uint32_t sdk_minor = 0;
};

struct ComponentInfo {
  ComponentKind kind = ComponentKind::kEnvironment;
  std::string name;
  std::vector<std::string> aliases;
  std::string version;
  std::string summary;
  std::uint32_t traits = 0;
  std::vector<ParameterInfo> parameters;
  std::vector<MetricInfo> metrics;
  PluginInfo plugin;

  bool Has(Trait trait) const { return (traits & trait) != 0; }
};

// Copies a declaration that passed the loader's checks.
ParameterInfo DescribeParameter(const ParameterSpec& spec);

nlohmann::json ToJson(const ComponentInfo& component);
ComponentInfo ComponentInfoFromJson(
    const nlohmann::json& json);  // throws nlohmann::json::exception

// A library that is in a folder and cannot be used.
struct PluginRefusal {
  std::string path;  // absolute
  ExitCode code = ExitCode::kPluginRefused;
  std::string message;  // names the file
};

struct ScanOptions {
  // The program that describes a plugin: it is called with `arguments` and then
  // the file, and calls DescribePluginMain.
  std::string program = "/proc/self/exe";
  std::vector<std::string> arguments = {"describe-plugin"};
  std::chrono::milliseconds timeout = std::chrono::seconds(10);
  int children = 2;  // at once
};

class Catalogue {
 public:
  // Describes every *.so of the folders. A folder that does not exist is
  // skipped. Of a component offered twice the earlier folder's is kept, with a
  // warning; offered twice in one folder it cannot be used, and Find says so.
  static Catalogue Scan(const std::vector<std::filesystem::path>& folders,
                        const ScanOptions& options = {});

  // The component with that name or alias.
  //   kNotFound       none has; the message lists the known ones. If a refused
  //                   library is called so, its refusal is thrown instead.
  //   kPluginRefused  two plugins of one folder offer it.
  std::shared_ptr<const ComponentInfo> Find(ComponentKind kind, std::string_view name) const;

  // The model of a command that names none: the one that declares kDefault, of those that
  // learn or of those that do not.
  //   kNotFound       no plugin has one; the message lists what there is to name.
  //   kUsage          several have; it lists them.
  std::shared_ptr<const ComponentInfo> DefaultModel(bool learns) const;

  // The names of the components of that kind that have all of these traits.
  std::vector<std::string> NamesOf(ComponentKind kind, std::uint32_t traits = 0) const;

  // Sorted by kind, then name.
  const std::vector<std::shared_ptr<const ComponentInfo>>& components() const {
    return components_;
  }
  const std::vector<PluginRefusal>& refusals() const { return refusals_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  const std::vector<std::filesystem::path>& folders() const { return folders_; }

 private:
  std::vector<std::shared_ptr<const ComponentInfo>> components_;
  std::vector<PluginRefusal> refusals_;
  std::vector<std::string> warnings_;
  std::vector<std::filesystem::path> folders_;
  // Names that two plugins of one folder claim, and the message for each.
  std::map<std::pair<ComponentKind, std::string>, std::string> ambiguous_;
};

// Where plugins are looked for, in order: `first`, the entries of
// $DREAMSEARCH_PLUGIN_PATH, and lib/dreamsearch/plugins beside this program's
// folder. Absolute, each once.
std::vector<std::filesystem::path> PluginFolders(const std::vector<std::string>& first);

// The child's side of Scan: loads the plugin, writes its description to
// descriptor kDescribeDescriptor, and ends the process without running the
// library's destructors. Returns only if that descriptor is not open.
inline constexpr int kDescribeDescriptor = 3;
int DescribePluginMain(const std::string& file);

}  // namespace dreamsearch
