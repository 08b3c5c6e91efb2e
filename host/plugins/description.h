// description.h - what a plugin offers, as owning copies that outlive the library and pass
// between processes as JSON (results/text/json_fields.h).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "dreamsearch/plugin.h"
#include "results/system/error.h"

namespace dreamsearch {

struct PresetInfo {
  std::string preset;
  double number = 0;
  std::string choice;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("preset", &preset);
    (*archive)("number", &number);
    (*archive)("choice", &choice);
  }
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
  bool variation = false;
  std::vector<PresetInfo> presets;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("name", &name);
    (*archive)("type", &type);
    (*archive)("default_number", &default_number);
    (*archive)("min", &min);
    (*archive)("max", &max);
    (*archive)("default_choice", &default_choice);
    (*archive)("choices", &choices);
    (*archive)("unit", &unit);
    (*archive)("help", &help);
    (*archive)("variation", &variation);
    (*archive)("presets", &presets);
  }
};

struct MetricInfo {
  std::string name;
  std::string unit;
  std::string help;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("name", &name);
    (*archive)("unit", &unit);
    (*archive)("help", &help);
  }
};

// A RunPreset, owned.
struct RunPresetInfo {
  std::string name;
  std::string preset;
  double number = 0;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("name", &name);
    (*archive)("preset", &preset);
    (*archive)("number", &number);
  }
};

struct PluginInfo {
  std::string name;
  std::string version;
  std::string path;    // absolute
  std::string sha256;  // of the file, hexadecimal
  std::uint32_t sdk_major = 0;
  std::uint32_t sdk_minor = 0;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("name", &name);
    (*archive)("version", &version);
    (*archive)("path", &path);
    (*archive)("sha256", &sha256);
    (*archive)("sdk_major", &sdk_major);
    (*archive)("sdk_minor", &sdk_minor);
  }
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
  std::vector<RunPresetInfo> run_presets;
  std::string task_parameter;  // empty: the task is the component
  PluginInfo plugin;

  bool Has(Trait trait) const { return (traits & trait) != 0; }

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("kind", &kind);
    (*archive)("name", &name);
    (*archive)("aliases", &aliases);
    (*archive)("version", &version);
    (*archive)("summary", &summary);
    (*archive)("traits", &traits);
    (*archive)("parameters", &parameters);
    (*archive)("metrics", &metrics);
    (*archive)("run_presets", &run_presets);
    (*archive)("task_parameter", &task_parameter);
    (*archive)("plugin", &plugin);
  }
};

// A library that is in a folder and cannot be used.
struct PluginRefusal {
  std::string path;  // absolute
  ExitCode code = ExitCode::kPluginRefused;
  std::string message;  // names the file

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("path", &path);
    (*archive)("code", &code);
    (*archive)("message", &message);
  }
};

// What came of describing one library.
struct PluginDescription {
  bool refused = false;
  PluginRefusal refusal;                  // if refused
  std::vector<ComponentInfo> components;  // otherwise

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("refused", &refused);
    (*archive)("refusal", &refusal);
    (*archive)("components", &components);
  }
};

// Copies a declaration that passed the loader's checks.
ParameterInfo DescribeParameter(const ParameterSpec& spec);
ComponentInfo DescribeComponent(const ComponentDescriptor& component, const PluginInfo& plugin);

// The parts of a list, "one,two"; empty ones are left out.
std::vector<std::string> SplitList(std::string_view list, char separator);

// Whether a plugin changed: how it differs from the file with that SHA-256 that it was then,
// one text for whoever asks; empty if it is the same. `then` is empty if there was no such
// plugin.
std::string PluginChange(const PluginInfo& now, const std::string& then);

}  // namespace dreamsearch
