// parameter_text.h - the values of declared parameters as people write them.
#pragma once

#include <string>

#include "host/plugins/description.h"
#include "host/settings/run_spec.h"

namespace dreamsearch {

// "expected an integer from 1 to 16 (steps), default 2".
std::string Expectation(const ParameterInfo& parameter);

// What a setting of an environment must be where a trained run is evaluated:
// "expected a factor of variation (env.mass_scale, env.gravity_scale)".
std::string ExpectedVariation(const std::vector<ParameterInfo>& parameters);

// Sets number or choice of *value. Returns false if the text is not a value of the parameter.
// Integers may be written 2e6.
bool ParseValue(const ParameterInfo& parameter, const std::string& text, ResolvedValue* value);

// The text without characters that a terminal would not print, and not too long for a message.
std::string Quotable(const std::string& text);
bool IsOneLine(const std::string& text);

}  // namespace dreamsearch
