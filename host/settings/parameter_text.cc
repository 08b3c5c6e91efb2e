#include "host/settings/parameter_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <system_error>

#include "results/text/names.h"
#include "results/text/shell.h"

namespace dreamsearch {
namespace {

std::string DefaultText(const ParameterInfo& parameter) {
  switch (parameter.type) {
    case ParameterType::kBool:
      return parameter.default_number != 0 ? "true" : "false";
    case ParameterType::kChoice:
      return parameter.default_choice;
    case ParameterType::kText:
    case ParameterType::kPath:
      return "'" + parameter.default_choice + "'";
    default:
      return NumberText(parameter.type, parameter.default_number);
  }
}

std::optional<double> ParseNumber(const std::string& text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(number)) {
    return std::nullopt;
  }
  return number + 0.0;  // -0 becomes 0, so that equal values have equal digests
}

bool IsControl(char c) { return (c >= 0 && c < ' ') || c == 127; }

}  // namespace

std::string Expectation(const ParameterInfo& parameter) {
  std::string text = "expected ";
  switch (parameter.type) {
    case ParameterType::kBool:
      text += "true or false";
      break;
    case ParameterType::kInt:
    case ParameterType::kReal:
      text += parameter.type == ParameterType::kInt ? "an integer from " : "a number from ";
      text += NumberText(parameter.type, parameter.min) + " to " +
              NumberText(parameter.type, parameter.max);
      break;
    case ParameterType::kChoice:
      text += "one of " + JoinNames(parameter.choices);
      break;
    case ParameterType::kText:
      text += "a text of one line";
      break;
    case ParameterType::kPath:
      text += "the path of a file";
      if (!parameter.choices.empty()) text += " (" + JoinNames(parameter.choices) + ") or a name";
      break;
  }
  if (!parameter.unit.empty()) text += " (" + parameter.unit + ")";
  return text + ", default " + DefaultText(parameter);
}

std::string ExpectedVariation(const std::vector<ParameterInfo>& parameters) {
  std::vector<std::string> names;
  for (const ParameterInfo& parameter : parameters) {
    if (parameter.variation) names.push_back("env." + parameter.name);
  }
  return names.empty() ? "expected a factor of variation, of which this task has none"
                       : "expected a factor of variation (" + JoinNames(names) + ")";
}

bool IsOneLine(const std::string& text) {
  return IsUtf8(text) && std::none_of(text.begin(), text.end(), IsControl);
}

std::string Quotable(const std::string& text) {
  constexpr std::size_t kMost = 60;
  std::string quotable = text.size() > kMost ? text.substr(0, kMost) + "..." : text;
  std::replace_if(quotable.begin(), quotable.end(), IsControl, '?');
  return quotable;
}

bool ParseValue(const ParameterInfo& parameter, const std::string& text, ResolvedValue* value) {
  switch (parameter.type) {
    case ParameterType::kBool:
      if (text == "true" || text == "1" || text == "on" || text == "yes") {
        value->number = 1;
      } else if (text == "false" || text == "0" || text == "off" || text == "no") {
        value->number = 0;
      } else {
        return false;
      }
      return true;
    case ParameterType::kInt:
    case ParameterType::kReal: {
      const std::optional<double> number = ParseNumber(text);
      if (!number || *number < parameter.min || *number > parameter.max) return false;
      if (parameter.type == ParameterType::kInt && *number != std::trunc(*number)) return false;
      value->number = *number;
      return true;
    }
    case ParameterType::kChoice:
      value->choice = text;
      return std::find(parameter.choices.begin(), parameter.choices.end(), text) !=
             parameter.choices.end();
    case ParameterType::kText:
    case ParameterType::kPath:
      value->choice = text;
      return IsOneLine(text);
  }
  return false;
}

}  // namespace dreamsearch
