// parameter.h - how a component declares its settings and is given their values.
//
// A declaration is the only place where a setting's type, default, range, unit
// and help are written: command-line help, `runner describe`, range checks and
// the run's stored configuration all come from it.
//
// Values resolve as default < preset < configuration file < command line. The
// factory gets a value for every declared parameter.
#pragma once

#include <concepts>
#include <cstdint>
#include <cstring>

#include "dreamsearch/view.h"

namespace dreamsearch {

enum class ParameterType : std::uint32_t {
  kBool = 0,
  kInt = 1,
  kReal = 2,
  kChoice = 3,
  kText = 4,  // any text of one line
  kPath = 5,  // a file that is there, or ""; see PathParameter
};

// Whether its value is a text rather than a number.
constexpr bool IsText(ParameterType type) {
  return type == ParameterType::kChoice || type == ParameterType::kText ||
         type == ParameterType::kPath;
}

// The value a parameter takes under a named preset; for kBool 0 or 1, for what IsText
// see `choice`. Frozen.
struct PresetValue {
  const char* preset = nullptr;
  double number = 0;
  const char* choice = nullptr;
};

inline constexpr std::uint32_t kMaxPresets = 4;

struct ParameterSpec {
  const char* name = nullptr;  // snake_case, unique in its component
  ParameterType type = ParameterType::kReal;
  std::uint32_t preset_count = 0;
  double default_number = 0;             // kBool (0, 1), kInt, kReal
  double min = 0;                        // kInt, kReal: inclusive
  double max = 0;                        // kInt, kReal: inclusive
  const char* default_choice = nullptr;  // what IsText; of kPath ""
  const char* choices = nullptr;         // kChoice: "one,two,three"; kPath: endings
  const char* unit = nullptr;            // "" when it has none
  const char* help = nullptr;            // one sentence, with its source
  // Of an environment: a factor of variation, which changes the world and not the task's
  // sizes. A trained agent may be evaluated under another value. Its default changes nothing.
  bool variation = false;
  PresetValue presets[kMaxPresets];
  // Later fields go here.

  constexpr ParameterSpec Variation() const {
    ParameterSpec copy = *this;
    copy.variation = true;
    return copy;
  }

  // Declares another value for a preset. Usable in constant expressions.
  constexpr ParameterSpec Preset(const char* preset, double number) const {
    ParameterSpec copy = *this;
    copy.presets[copy.preset_count++] = {preset, number, nullptr};
    return copy;
  }
  // Also true and false; and 0, which could otherwise be a null choice.
  template <std::integral Number>
  constexpr ParameterSpec Preset(const char* preset, Number number) const {
    return Preset(preset, static_cast<double>(number));
  }
  constexpr ParameterSpec Preset(const char* preset, const char* choice) const {
    ParameterSpec copy = *this;
    copy.presets[copy.preset_count++] = {preset, 0, choice};
    return copy;
  }
};

constexpr ParameterSpec BoolParameter(const char* name, bool value, const char* help) {
  ParameterSpec spec;
  spec.name = name;
  spec.type = ParameterType::kBool;
  spec.default_number = value ? 1 : 0;
  spec.max = 1;
  spec.unit = "";
  spec.help = help;
  return spec;
}

constexpr ParameterSpec IntParameter(const char* name, std::int64_t value, std::int64_t min,
                                     std::int64_t max, const char* unit, const char* help) {
  ParameterSpec spec;
  spec.name = name;
  spec.type = ParameterType::kInt;
  spec.default_number = static_cast<double>(value);
  spec.min = static_cast<double>(min);
  spec.max = static_cast<double>(max);
  spec.unit = unit;
  spec.help = help;
  return spec;
}

constexpr ParameterSpec RealParameter(const char* name, double value, double min, double max,
                                      const char* unit, const char* help) {
  ParameterSpec spec;
  spec.name = name;
  spec.type = ParameterType::kReal;
  spec.default_number = value;
  spec.min = min;
  spec.max = max;
  spec.unit = unit;
  spec.help = help;
  return spec;
}

// `choices` is "one,two,three"; `value` is one of them.
constexpr ParameterSpec ChoiceParameter(const char* name, const char* value, const char* choices,
                                        const char* help) {
  ParameterSpec spec;
  spec.name = name;
  spec.type = ParameterType::kChoice;
  spec.default_choice = value;
  spec.choices = choices;
  spec.unit = "";
  spec.help = help;
  return spec;
}

// A text of one line; `value` may be "".
constexpr ParameterSpec TextParameter(const char* name, const char* value, const char* help) {
  ParameterSpec spec;
  spec.name = name;
  spec.type = ParameterType::kText;
  spec.default_choice = value;
  spec.unit = "";
  spec.help = help;
  return spec;
}

// The path of a file; "" if none is named. The host looks whether the file is there and can be
// read when the run is resolved, hands over its absolute path, and records its SHA-256: a run
// does not resume once the file has changed. A relative path is relative to the configuration
// file that has it, or to the folder in which the command was typed.
// `endings`, ".py,.pyc", if not "": only a text that ends so is a path, others are names.
constexpr ParameterSpec PathParameter(const char* name, const char* endings, const char* help) {
  ParameterSpec spec;
  spec.name = name;
  spec.type = ParameterType::kPath;
  spec.default_choice = "";
  spec.choices = endings;
  spec.unit = "";
  spec.help = help;
  return spec;
}

// One resolved value. Numbers of kInt fit a double exactly (|v| <= 2^53).
struct ParameterValue {
  const char* name = nullptr;
  double number = 0;
  const char* choice = nullptr;  // what IsText
  // Later fields go here.
};

// The resolved values of one component, valid during the factory call. settings.h reads them
// into a struct; there each is named once, where it is declared. Frozen.
struct Parameters {
  Records<ParameterValue> values;

  // The value of a declared name, null for any other.
  const ParameterValue* Find(const char* name) const noexcept {
    for (const ParameterValue& value : values) {
      if (std::strcmp(value.name, name) == 0) return &value;
    }
    return nullptr;
  }
};

// A number that a component reports (a loss, a search statistic).
struct MetricSpec {
  const char* name = nullptr;  // snake_case, unique in its component
  const char* unit = nullptr;  // "" when it has none
  const char* help = nullptr;
  // Later fields go here.
};

}  // namespace dreamsearch
