// presets.h - the values that declared parameters take under a preset, where there is no
// host to resolve them: in tests and benchmarks.
#pragma once

#include <cstring>
#include <vector>

#include "dreamsearch/parameter.h"

namespace dreamsearch::networks {

// A parameter's value under a preset; its default if it declares none for it.
inline ParameterValue ValueUnder(const ParameterSpec& spec, const char* preset) {
  for (std::uint32_t i = 0; i < spec.preset_count; ++i) {
    const PresetValue& value = spec.presets[i];
    if (std::strcmp(value.preset, preset) == 0) return {spec.name, value.number, value.choice};
  }
  return {spec.name, spec.default_number, spec.default_choice};
}

inline std::vector<ParameterValue> ValuesUnder(View<const ParameterSpec> specs,
                                               const char* preset) {
  std::vector<ParameterValue> values;
  for (const ParameterSpec& spec : specs) values.push_back(ValueUnder(spec, preset));
  return values;
}

}  // namespace dreamsearch::networks
