// default_values.h - what a factory gets where nothing was set.
#pragma once

#include <vector>

#include "dreamsearch/plugin.h"

namespace dreamsearch {

inline std::vector<ParameterValue> DefaultValues(const ComponentDescriptor& component) {
  std::vector<ParameterValue> values;
  for (const ParameterSpec& spec : component.parameters) {
    values.push_back({spec.name, spec.default_number, spec.default_choice});
  }
  return values;
}

}  // namespace dreamsearch
