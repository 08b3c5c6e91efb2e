#include "results/text/web_page.h"

#include <openssl/evp.h>

#include <nlohmann/json.hpp>
#include <set>

#include "results/system/error.h"
#include "results/text/json_text.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::string WithoutTags(const std::string& json) {
  std::string text;
  for (const char c : json) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  return text;
}

}  // namespace

std::string HtmlText(const std::string& text) {
  std::string html;
  for (const char c : Printable(text)) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      case '\'':
        html += "&#39;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string ScriptJson(const nlohmann::ordered_json& json) {
  return WithoutTags(results::JsonTextReplacing(json));
}
std::string ScriptJson(const nlohmann::json& json) { return WithoutTags(results::JsonText(json)); }

std::string PngLink(const std::string& png) {
  std::string text(4 * ((png.size() + 2) / 3) + 1, '\0');  // with EVP's zero at the end
  text.resize(static_cast<std::size_t>(EVP_EncodeBlock(
      reinterpret_cast<unsigned char*>(text.data()),
      reinterpret_cast<const unsigned char*>(png.data()), static_cast<int>(png.size()))));
  return "data:image/png;base64," + text;
}

std::string FillTemplate(std::string_view page, const std::map<std::string, std::string>& values) {
  std::string filled;
  std::set<std::string> used;
  while (true) {
    const std::size_t begin = page.find("{{");
    filled += page.substr(0, begin);
    if (begin == std::string_view::npos) break;
    page.remove_prefix(begin + 2);
    const std::size_t end = page.find("}}");
    const std::string name(page.substr(0, end));
    const auto value = values.find(name);
    if (end == std::string_view::npos || value == values.end()) {
      throw Failure(ExitCode::kInternal, "a page has the mark '" + name.substr(0, 40) +
                                             "', for which there is no value");
    }
    filled += value->second;
    used.insert(name);
    page.remove_prefix(end + 2);
  }
  for (const auto& [name, value] : values) {
    if (used.count(name) == 0) {
      throw Failure(ExitCode::kInternal, "a page has no mark '" + name + "' for its value");
    }
  }
  return filled;
}

}  // namespace dreamsearch
