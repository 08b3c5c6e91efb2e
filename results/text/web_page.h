// web_page.h - pages of HTML, filled from templates that are files of their own.
//
// dreamsearch_embed(TARGET NAME FILE) in a CMakeLists.txt puts a file into a program: the
// code declares `std::string_view NAME();` in namespace dreamsearch and gets its bytes.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace dreamsearch {

// A name as text of HTML or as the value of an attribute; control characters escaped as
// Printable does.
std::string HtmlText(const std::string& text);

// JSON for a <script> element: nothing in it can end the element.
std::string ScriptJson(const nlohmann::ordered_json& json);
std::string ScriptJson(const nlohmann::json& json);

// The bytes of a PNG file as a link that holds them, for <img src>.
std::string PngLink(const std::string& png);

// The template with each mark {{name}} replaced by the value of that name; marks in values
// stay. Failure 70 for a mark without a value, and for a value without a mark: the template
// and the code that fills it do not belong together.
std::string FillTemplate(std::string_view page, const std::map<std::string, std::string>& values);

}  // namespace dreamsearch
