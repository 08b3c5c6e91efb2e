#include "results/text/json_text.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace dreamsearch::results {
namespace {

// The first byte that opens an array or an object nested too deeply; npos if none does. A text
// that is not JSON may be called too deep.
std::size_t TooDeepAt(const std::string& text) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      quoted = c != '"';
    } else if (c == '"') {
      quoted = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kMostJsonDepth) return i;
    } else if (c == ']' || c == '}') {
      depth = std::max(depth - 1, 0);
    }
  }
  return std::string::npos;
}

}  // namespace

nlohmann::json ParseJson(const std::string& text) {
  if (const std::size_t at = TooDeepAt(text); at != std::string::npos) {
    throw nlohmann::json::parse_error::create(101, at,
                                              "expected arrays and objects nested at most " +
                                                  std::to_string(kMostJsonDepth) +
                                                  " deep, found more",
                                              nullptr);
  }
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::out_of_range& error) {  // 1e999
    throw nlohmann::json::parse_error::create(101, 0, error.what(), nullptr);
  }
}

nlohmann::json ParseJsonOrDiscard(const std::string& text) {
  if (TooDeepAt(text) != std::string::npos) {
    return nlohmann::json(nlohmann::json::value_t::discarded);
  }
  return nlohmann::json::parse(text, nullptr, false);
}

std::string JsonText(const nlohmann::json& json, int indent) { return json.dump(indent); }

std::string JsonTextReplacing(const nlohmann::json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::map<std::string, std::string> DottedValues(const nlohmann::json& json) {
  std::map<std::string, std::string> values;
  if (!json.is_structured()) return values;
  const nlohmann::json flat = json.flatten();
  for (const auto& [key, value] : flat.items()) {
    if (key.empty() || value.is_null()) continue;  // an empty object
    std::string dotted = key.substr(1);
    std::replace(dotted.begin(), dotted.end(), '/', '.');
    values.emplace(dotted, JsonText(value));
  }
  return values;
}

std::string JsonTextReplacing(const nlohmann::ordered_json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace dreamsearch::results
