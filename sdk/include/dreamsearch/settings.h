// settings.h - a component's parameters, bound to the members of a struct.
//
//     struct RolloutSettings {
//       std::uint64_t depth;
//       bool sample_continuation;
//     };
//     constexpr auto kSettings = BindSettings<RolloutSettings>(
//         Bind<&RolloutSettings::depth>(
//             IntParameter("depth", 10, 1, 1000, "transitions", "Transitions of a trajectory.")),
//         Bind<&RolloutSettings::sample_continuation>(ChoiceParameter(
//             "continuation", "mode", "mode,sample", "Actions after the first.")));
//
// The table is the only place that knows a parameter's name. The descriptor declares
// kSettings.declared(), the factory reads kSettings.Read(context.parameters).
//
// What a member may be: for a bool parameter bool; for an integer one any integer type that
// holds its range, or double; for a real one double; for a choice std::string, or, by its place
// in the list of choices, an enum or (of two choices, true is the second) bool; for a text or a
// path std::string. Anything else does not compile. A member of a base class may be bound too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include "dreamsearch/parameter.h"

namespace dreamsearch {

namespace settings_internal {

template <typename Class, typename Value>
Value TypeOf(Value Class::*);

// Not constexpr: a table whose declaration gets here does not compile, and the compiler shows
// the call with its reason.
inline void Refuse(const char*) {}

constexpr std::uint64_t ChoiceCount(const ParameterSpec& spec) {
  std::uint64_t count = 1;
  for (const char* c = spec.choices; *c != '\0'; ++c) count += *c == ',' ? 1 : 0;
  return count;
}

// The place of `choice` among "one,two,three"; their number if it is none of them.
constexpr std::uint64_t ChoiceIndex(std::string_view choices, std::string_view choice) {
  std::uint64_t index = 0;
  for (;; ++index) {
    const std::size_t comma = choices.find(',');
    if (choices.substr(0, comma) == choice) return index;
    if (comma == std::string_view::npos) return index + 1;
    choices.remove_prefix(comma + 1);
  }
}

template <typename Value>
consteval void CheckMember(const ParameterSpec& spec) {
  const bool integer = spec.type == ParameterType::kInt;
  if constexpr (std::is_same_v<Value, bool>) {
    const bool one_of_two = spec.type == ParameterType::kChoice && ChoiceCount(spec) == 2;
    if (spec.type != ParameterType::kBool && !one_of_two) {
      Refuse("a bool holds a bool parameter or one choice of two");
    }
  } else if constexpr (std::is_enum_v<Value>) {
    if (spec.type != ParameterType::kChoice) Refuse("an enum holds a choice");
  } else if constexpr (std::is_integral_v<Value>) {
    if (!integer) Refuse("an integer holds an integer parameter");
    if (spec.min < static_cast<double>(std::numeric_limits<Value>::min()) ||
        spec.max > static_cast<double>(std::numeric_limits<Value>::max())) {
      Refuse("the member's type does not hold the parameter's range");
    }
  } else if constexpr (std::is_same_v<Value, double>) {
    if (!integer && spec.type != ParameterType::kReal) Refuse("a double holds a number");
  } else {
    static_assert(std::is_same_v<Value, std::string>, "see the list of types in settings.h");
    if (!IsText(spec.type)) Refuse("a std::string holds a choice, a text or a path");
  }
}

template <typename Settings, auto kMember>
void Assign(Settings* settings, const ParameterSpec& spec, const ParameterValue& value) {
  using Value = decltype(TypeOf(kMember));
  if constexpr (std::is_same_v<Value, std::string>) {
    settings->*kMember = value.choice == nullptr ? "" : value.choice;
  } else if constexpr (std::is_enum_v<Value>) {
    settings->*kMember = static_cast<Value>(ChoiceIndex(spec.choices, value.choice));
  } else if constexpr (std::is_same_v<Value, bool>) {
    settings->*kMember = spec.type == ParameterType::kBool
                             ? value.number != 0
                             : ChoiceIndex(spec.choices, value.choice) == 1;
  } else {
    settings->*kMember = static_cast<Value>(value.number);
  }
}

inline const ParameterValue& ValueOf(const Parameters& parameters, const char* name) {
  if (const ParameterValue* value = parameters.Find(name)) return *value;
  throw std::invalid_argument(std::string("there is no value for the parameter '") + name + "'");
}

template <auto kMember>
struct BoundParameter {
  ParameterSpec spec;
};

}  // namespace settings_internal

template <typename Settings, std::size_t kCount>
class SettingsTable {
 public:
  template <auto... kMembers>
  consteval explicit SettingsTable(settings_internal::BoundParameter<kMembers>... bound)
      : specs_{bound.spec...}, assign_{&settings_internal::Assign<Settings, kMembers>...} {}

  // For the component's descriptor. Lives as long as the table.
  constexpr View<const ParameterSpec> declared() const { return {specs_, kCount}; }

  // The resolved values. Throws std::invalid_argument if one is missing, which the host never
  // lets happen to a component that declares declared(); catch it before it crosses the
  // boundary, as CreatePlanner and its like do.
  Settings Read(const Parameters& parameters) const {
    Settings settings{};
    for (std::size_t i = 0; i < kCount; ++i) {
      assign_[i](&settings, specs_[i], settings_internal::ValueOf(parameters, specs_[i].name));
    }
    return settings;
  }

 private:
  ParameterSpec specs_[kCount];
  void (*assign_[kCount])(Settings*, const ParameterSpec&, const ParameterValue&);
};

// One row of a table.
template <auto kMember>
consteval settings_internal::BoundParameter<kMember> Bind(const ParameterSpec& spec) {
  settings_internal::CheckMember<decltype(settings_internal::TypeOf(kMember))>(spec);
  return {spec};
}

template <typename Settings, auto... kMembers>
consteval SettingsTable<Settings, sizeof...(kMembers)> BindSettings(
    settings_internal::BoundParameter<kMembers>... bound) {
  return SettingsTable<Settings, sizeof...(kMembers)>(bound...);
}

}  // namespace dreamsearch
