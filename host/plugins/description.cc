#include "host/plugins/description.h"

namespace dreamsearch {

namespace {

std::string TextOrEmpty(const char* text) { return text == nullptr ? "" : text; }

}  // namespace

std::vector<std::string> SplitList(std::string_view list, char separator) {
  std::vector<std::string> parts;
  while (!list.empty()) {
    const auto end = list.find(separator);
    if (end != 0) parts.emplace_back(list.substr(0, end));
    if (end == std::string_view::npos) break;
    list.remove_prefix(end + 1);
  }
  return parts;
}

ParameterInfo DescribeParameter(const ParameterSpec& spec) {
  ParameterInfo info;
  info.name = spec.name;
  info.type = spec.type;
  info.default_number = spec.default_number;
  info.min = spec.min;
  info.max = spec.max;
  info.default_choice = TextOrEmpty(spec.default_choice);
  info.choices = SplitList(TextOrEmpty(spec.choices), ',');
  info.unit = TextOrEmpty(spec.unit);
  info.help = TextOrEmpty(spec.help);
  info.variation = spec.variation;
  for (std::uint32_t i = 0; i < spec.preset_count; ++i) {
    const PresetValue& preset = spec.presets[i];
    info.presets.push_back({preset.preset, preset.number, TextOrEmpty(preset.choice)});
  }
  return info;
}

ComponentInfo DescribeComponent(const ComponentDescriptor& component, const PluginInfo& plugin) {
  ComponentInfo info;
  info.kind = component.kind;
  info.name = component.name;
  info.aliases = SplitList(TextOrEmpty(component.aliases), ',');
  info.version = component.version;
  info.summary = component.summary;
  info.traits = component.traits;
  for (const ParameterSpec& spec : component.parameters) {
    info.parameters.push_back(DescribeParameter(spec));
  }
  for (const MetricSpec& metric : component.metrics) {
    info.metrics.push_back({metric.name, TextOrEmpty(metric.unit), TextOrEmpty(metric.help)});
  }
  for (const RunPreset& preset : component.run_presets) {
    info.run_presets.push_back({preset.name, preset.preset, preset.number});
  }
  info.task_parameter = TextOrEmpty(component.task_parameter);
  info.plugin = plugin;
  return info;
}

std::string PluginChange(const PluginInfo& now, const std::string& then) {
  if (now.sha256 == then) return "";
  return "plugin " + now.name + " changed (" + now.path + ": SHA-256 " +
         (then.empty() ? "of another plugin" : then.substr(0, 12)) + " then, " +
         now.sha256.substr(0, 12) + " now)";
}

}  // namespace dreamsearch
