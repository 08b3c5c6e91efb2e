#include "host/plugins/descriptor_check.h"

#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "results/system/error.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

class Checker {
 public:
  explicit Checker(const std::filesystem::path& file) : file_(file) {}

  [[noreturn]] void Refuse(const std::string& message) const { RefusePlugin(file_, message); }

  void CheckContents(const PluginDescriptor& plugin) const {
    CheckText("the plugin's name", plugin.name, true);
    CheckText("the plugin's version", plugin.version, true);
    if (plugin.components.size == 0) Refuse("expected at least one component, found none");
    std::set<std::pair<ComponentKind, std::string>> names;
    for (std::uint64_t i = 0; i < plugin.components.size; ++i) {
      const ComponentDescriptor& component = plugin.components[i];
      CheckComponent(component, i);
      std::vector<std::string> all = AliasList(component);
      all.insert(all.begin(), component.name);
      for (const std::string& name : all) {
        CheckName("component " + std::to_string(i), name.c_str());
        if (!names.emplace(component.kind, name).second) {
          Refuse(std::string("two components offer the ") + ComponentKindName(component.kind) +
                 " '" + name + "'; expected each name once a kind");
        }
      }
    }
  }

 private:
  static std::vector<std::string> Split(const char* list) {
    std::vector<std::string> parts;
    if (list == nullptr || *list == '\0') return parts;
    std::string part;
    for (const char* c = list;; ++c) {
      if (*c == ',' || *c == '\0') {
        parts.push_back(std::exchange(part, {}));
        if (*c == '\0') return parts;
      } else {
        part += *c;
      }
    }
  }

  static constexpr std::size_t kLongestText = 10000;

  static std::vector<std::string> AliasList(const ComponentDescriptor& component) {
    return Split(component.aliases);
  }

  // One line of UTF-8 without control characters.
  void CheckText(const std::string& what, const char* text, bool required) const {
    if (text == nullptr) {
      if (!required) return;
      Refuse(what + " is a null pointer; expected a text");
    }
    const std::size_t length = ::strnlen(text, kLongestText + 1);
    if (length > kLongestText) {
      Refuse(what + " is longer than " + std::to_string(kLongestText) + " bytes");
    }
    if (required && length == 0) Refuse(what + " is empty");
    for (std::size_t i = 0; i < length;) {
      const auto byte = static_cast<unsigned char>(text[i]);
      const std::size_t size = byte < 0x80           ? 1
                               : (byte >> 5) == 0x06 ? 2
                               : (byte >> 4) == 0x0e ? 3
                               : (byte >> 3) == 0x1e ? 4
                                                     : 0;
      bool good = size != 0 && i + size <= length && byte >= 0x20 && byte != 0x7f;
      for (std::size_t k = 1; good && k < size; ++k) {
        good = (static_cast<unsigned char>(text[i + k]) & 0xc0) == 0x80;
      }
      if (!good) {
        Refuse(what + " has the byte " + std::to_string(byte) + " at " + std::to_string(i) +
               "; expected one line of UTF-8");
      }
      i += size;
    }
  }

  void CheckName(const std::string& what, const char* name) const {
    CheckText(what + "'s name", name, true);
    bool good = name[0] >= 'a' && name[0] <= 'z';
    for (const char* c = name; *c != '\0'; ++c) {
      good = good && ((*c >= 'a' && *c <= 'z') || (*c >= '0' && *c <= '9') || *c == '_');
    }
    if (!good) {
      Refuse(what + ": expected a name of the form [a-z][a-z0-9_]*, found '" + name + "'");
    }
  }

  void CheckComponent(const ComponentDescriptor& component, std::uint64_t index) const {
    const std::string number = "component " + std::to_string(index);
    CheckName(number, component.name);
    const std::string what = number + " ('" + component.name + "')";
    const bool environment = component.kind == ComponentKind::kEnvironment;
    const bool model = component.kind == ComponentKind::kModel;
    const bool planner = component.kind == ComponentKind::kPlanner;
    if (!environment && !model && !planner) {
      Refuse(what + ": expected kind 1 (environment), 2 (model) or 3 (planner), found " +
             std::to_string(static_cast<std::uint32_t>(component.kind)));
    }
    const std::string kind = ComponentKindName(component.kind);
    if ((component.create_environment != nullptr) != environment ||
        (component.create_model != nullptr) != model ||
        (component.create_planner != nullptr) != planner) {
      std::string found;
      if (component.create_environment != nullptr) found += " create_environment";
      if (component.create_model != nullptr) found += " create_model";
      if (component.create_planner != nullptr) found += " create_planner";
      Refuse(what + ": expected create_" + kind + " and no other factory, found" +
             (found.empty() ? " none" : found));
    }
    CheckTraits(what, component);
    CheckText(what + "'s aliases", component.aliases, false);
    CheckText(what + "'s version", component.version, true);
    CheckText(what + "'s summary", component.summary, true);

    std::set<std::string> names;
    for (const ParameterSpec& parameter : component.parameters) {
      CheckName("a parameter of " + what, parameter.name);
      if (!names.insert(parameter.name).second) {
        Refuse(what + ": two parameters are called '" + parameter.name + "'");
      }
      CheckParameter(what + ", parameter '" + parameter.name + "'", parameter);
    }
    names.clear();
    for (const MetricSpec& metric : component.metrics) {
      CheckName("a metric of " + what, metric.name);
      if (!names.insert(metric.name).second) {
        Refuse(what + ": two metrics are called '" + metric.name + "'");
      }
      CheckText(what + ", metric '" + metric.name + "': its unit", metric.unit, false);
      CheckText(what + ", metric '" + metric.name + "': its help", metric.help, false);
    }
    CheckRunPresets(what, component);
    if (component.task_parameter != nullptr) CheckTaskParameter(what, component);
  }

  void CheckTaskParameter(const std::string& what, const ComponentDescriptor& component) const {
    CheckName(what + "'s task parameter", component.task_parameter);
    for (const ParameterSpec& parameter : component.parameters) {
      if (std::strcmp(parameter.name, component.task_parameter) != 0) continue;
      if (component.kind == ComponentKind::kEnvironment && parameter.type == ParameterType::kText) {
        return;
      }
    }
    Refuse(what + ": expected a text parameter of an environment as its task parameter, found '" +
           component.task_parameter + "'");
  }

  // That there are such parameters and that they may have such values is known where runs are
  // resolved.
  void CheckRunPresets(const std::string& what, const ComponentDescriptor& component) const {
    if (component.run_presets.size > 0 && component.kind == ComponentKind::kPlanner) {
      Refuse(what + ": run presets are for models and environments, found " +
             std::to_string(component.run_presets.size) + " on a " +
             ComponentKindName(component.kind));
    }
    std::set<std::pair<std::string, std::string>> seen;
    for (const RunPreset& preset : component.run_presets) {
      CheckName("a run preset of " + what, preset.name);
      const std::string which = what + ", run preset '" + preset.name + "'";
      CheckText(which + ": its preset", preset.preset, true);
      if (!seen.insert({preset.name, preset.preset}).second) {
        Refuse(which + ": expected one value for the preset '" + preset.preset + "', found two");
      }
      if (!std::isfinite(preset.number)) {
        Refuse(which + ": expected a finite number, found " + std::to_string(preset.number));
      }
    }
  }

  void CheckTraits(const std::string& what, const ComponentDescriptor& component) const {
    const std::uint32_t allowed = TraitsOf(component.kind);
    if ((component.traits & ~allowed) != 0) {
      Refuse(what + ": expected no traits but those of a " + ComponentKindName(component.kind) +
             ", bits of " + std::to_string(allowed) + ", found " +
             std::to_string(component.traits));
    }
    if ((component.traits & kSearches) != 0 && (component.traits & kActorAlone) != 0) {
      Refuse(what + ": expected kSearches or kActorAlone, found both");
    }
  }

  void CheckParameter(const std::string& what, const ParameterSpec& parameter) const {
    CheckText(what + ": its unit", parameter.unit, false);
    CheckText(what + ": its help", parameter.help, true);
    if (parameter.preset_count > kMaxPresets) {
      Refuse(what + ": expected at most " + std::to_string(kMaxPresets) + " presets, found " +
             std::to_string(parameter.preset_count));
    }
    std::vector<std::string> choices;
    switch (parameter.type) {
      case ParameterType::kBool:
      case ParameterType::kText:
        break;
      case ParameterType::kInt:
      case ParameterType::kReal:
        CheckRange(what, parameter);
        break;
      case ParameterType::kChoice: {
        CheckText(what + ": its choices", parameter.choices, true);
        choices = Split(parameter.choices);
        std::set<std::string> known;
        for (const std::string& choice : choices) {
          if (choice.empty() || !known.insert(choice).second) {
            Refuse(what + ": expected choices that differ and are not empty, found '" +
                   parameter.choices + "'");
          }
        }
        break;
      }
      case ParameterType::kPath:
        CheckText(what + ": its endings", parameter.choices, false);
        break;
      default:
        Refuse(what +
               ": expected type 0 (bool), 1 (int), 2 (real), 3 (choice), 4 (text) or 5 (path), "
               "found " +
               std::to_string(static_cast<std::uint32_t>(parameter.type)));
    }
    CheckValue(what + ": its default", parameter, choices, parameter.default_number,
               parameter.default_choice);
    std::set<std::string> presets;
    for (std::uint32_t i = 0; i < parameter.preset_count; ++i) {
      const PresetValue& preset = parameter.presets[i];
      CheckName(what + ", preset " + std::to_string(i), preset.preset);
      if (!presets.insert(preset.preset).second) {
        Refuse(what + ": preset '" + preset.preset + "' is given twice");
      }
      CheckValue(what + ": its value for preset '" + preset.preset + "'", parameter, choices,
                 preset.number, preset.choice);
    }
  }

  void CheckRange(const std::string& what, const ParameterSpec& parameter) const {
    constexpr double kLargest = 9007199254740992.0;  // 2^53: beyond, a double skips integers
    for (const double bound : {parameter.min, parameter.max}) {
      if (!std::isfinite(bound)) {
        Refuse(what + ": expected a finite range, found " + ExactText(bound));
      }
      if (parameter.type == ParameterType::kInt &&
          (bound != std::trunc(bound) || std::abs(bound) > kLargest)) {
        Refuse(what + ": expected a range of integers up to 2^53, found " + ExactText(bound));
      }
    }
    if (parameter.min > parameter.max) {
      Refuse(what + ": its range is empty, " + ExactText(parameter.min) + " to " +
             ExactText(parameter.max));
    }
  }

  void CheckValue(const std::string& what, const ParameterSpec& parameter,
                  const std::vector<std::string>& choices, double number,
                  const char* choice) const {
    if (parameter.type == ParameterType::kText) {
      CheckText(what, choice, false);
      return;
    }
    if (parameter.type == ParameterType::kPath) {
      CheckText(what, choice, false);
      // What would it be relative to?
      if (*choice != '\0') Refuse(what + ": expected none of a path, found '" + choice + "'");
      return;
    }
    if (parameter.type == ParameterType::kChoice) {
      CheckText(what, choice, true);
      for (const std::string& known : choices) {
        if (known == choice) return;
      }
      Refuse(what + ": expected one of " + parameter.choices + ", found '" + choice + "'");
    }
    if (parameter.type == ParameterType::kBool) {
      if (number != 0 && number != 1) {
        Refuse(what + ": expected 0 or 1, found " + ExactText(number));
      }
      return;
    }
    if (!(number >= parameter.min && number <= parameter.max)) {
      Refuse(what + ": expected " + ExactText(parameter.min) + " to " + ExactText(parameter.max) +
             ", found " + ExactText(number));
    }
    if (parameter.type == ParameterType::kInt && number != std::trunc(number)) {
      Refuse(what + ": expected an integer, found " + ExactText(number));
    }
  }

  const std::filesystem::path& file_;
};

}  // namespace

void RefusePlugin(const std::filesystem::path& file, const std::string& message) {
  throw Failure(ExitCode::kPluginRefused, "plugin " + file.string() + ": " + message);
}

std::string SdkVersionText() {
  return std::to_string(DREAMSEARCH_SDK_MAJOR) + "." + std::to_string(DREAMSEARCH_SDK_MINOR);
}

void CheckDeclarations(const PluginDescriptor& plugin, const std::filesystem::path& file) {
  Checker(file).CheckContents(plugin);
}

}  // namespace dreamsearch
