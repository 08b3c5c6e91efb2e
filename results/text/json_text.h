// json_text.h - JSON to text and back, compiled once.
//
// nlohmann's parser and writer are templates that every file which calls parse() or
// dump() compiles again, for seconds each. `host` and `results` call these instead.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace dreamsearch::results {

// Deeper texts are refused: whoever walks a value calls itself for each level, and a stranger's
// text must not decide how much stack that takes.
inline constexpr int kMostJsonDepth = 100;

// Throws nlohmann::json::parse_error.
nlohmann::json ParseJson(const std::string& text);
// is_discarded() where the text is not JSON or too deep.
nlohmann::json ParseJsonOrDiscard(const std::string& text);

// On one line, or on many with `indent` spaces a level. Doubles are the shortest texts that
// read back the same. Throws nlohmann::json::type_error for a text that is not UTF-8.
std::string JsonText(const nlohmann::json& json, int indent = -1);
// The same with a replacement character for what is not UTF-8; never throws for it.
std::string JsonTextReplacing(const nlohmann::json& json, int indent = -1);
std::string JsonTextReplacing(const nlohmann::ordered_json& json, int indent = -1);

// What an object or an array holds at any depth: the text of each value by its path with dots,
// "run.batch_size". Of an empty object nothing. Empty for anything else.
std::map<std::string, std::string> DottedValues(const nlohmann::json& json);

}  // namespace dreamsearch::results
