#include "results/text/json_text.h"

#include <nlohmann/json.hpp>

namespace dreamsearch::results {

nlohmann::json ParseJson(const std::string& text) { return nlohmann::json::parse(text); }

nlohmann::json ParseJsonOrDiscard(const std::string& text) {
  return nlohmann::json::parse(text, nullptr, false);
}

std::string JsonText(const nlohmann::json& json, int indent) { return json.dump(indent); }

std::string JsonTextReplacing(const nlohmann::json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string JsonTextReplacing(const nlohmann::ordered_json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace dreamsearch::results
