#include "results/command_line/help.h"

#include <algorithm>
#include <sstream>
#include <utility>

#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kWidth = 96;
constexpr std::size_t kWidestFirstColumn = 24;

std::string ArgumentUsage(const Flag& argument) {
  std::string text = argument.value_name;
  if (argument.value.takes == FlagValue::Takes::kTexts) text += "...";
  return argument.value.required ? text : "[" + text + "]";
}

std::vector<std::string> Usage(const CommandSpec& spec) {
  if (!spec.usage.empty()) return spec.usage;
  std::string line = spec.name;
  for (const Flag& argument : spec.arguments) line += " " + ArgumentUsage(argument);
  for (const FlagGroup& group : spec.groups) {
    for (const Flag& flag : group.flags) {
      if (flag.value.required) line += " --" + flag.name + " " + flag.value_name;
    }
  }
  return {line + (spec.groups.empty() ? "" : " [flags]")};
}

std::pair<std::string, std::string> Row(const Flag& flag) {
  const FlagValue& value = flag.value;
  std::string name = flag.is_argument() ? flag.value_name : "--" + flag.name;
  if (!flag.is_argument() && !flag.value_name.empty()) name += " " + flag.value_name;
  std::string text = flag.help;
  if (!value.choices.empty()) text += "; one of " + value.choices;
  if (value.takes == FlagValue::Takes::kTexts && !flag.is_argument()) text += "; repeatable";
  if (!value.default_text.empty()) text += " (default: " + value.default_text + ")";
  return {name, text};
}

HelpPart Flags(const std::string& heading, const std::vector<Flag>& flags) {
  HelpPart part = {heading};
  for (const Flag& flag : flags) part.rows.push_back(Row(flag));
  return part;
}

}  // namespace

std::string TwoColumns(const std::string& heading,
                       const std::vector<std::pair<std::string, std::string>>& rows) {
  std::size_t width = 0;
  for (const auto& [first, second] : rows) {
    if (Width(first) <= kWidestFirstColumn) width = std::max(width, Width(first));
  }
  std::string text = "\n" + heading + "\n";
  for (const auto& [first, second] : rows) {
    const std::string wrapped = WrapText(second, kWidth, width + 4);
    const bool fits = Width(first) <= width;
    text += "  " + first;
    text += fits ? std::string(width - Width(first) + 2, ' ') + wrapped.substr(width + 4)
                 : "\n" + wrapped;
    text += "\n";
  }
  return text;
}

std::vector<HelpPart> HelpParts(const CommandSpec& spec) {
  std::vector<HelpPart> parts = {{.heading = kUsageHeading, .lines = Usage(spec)}};
  if (!spec.examples.empty()) {
    parts.push_back({.heading = kExamplesHeading, .lines = spec.examples});
  }
  HelpPart about;
  std::istringstream paragraphs(spec.about);
  for (std::string paragraph; std::getline(paragraphs, paragraph);) {
    about.paragraphs.push_back(paragraph);
  }
  if (!about.paragraphs.empty()) parts.push_back(about);
  if (!spec.arguments.empty()) parts.push_back(Flags("Arguments", spec.arguments));
  for (const FlagGroup& group : spec.groups) parts.push_back(Flags(group.title, group.flags));
  parts.push_back({.heading = "General",
                   .rows = {{"-h, --help", "show this text"}, {"--version", "show the version"}}});
  return parts;
}

std::string HelpText(const CommandSpec& spec, const std::vector<HelpPart>& parts) {
  std::string text = spec.name + " - " + spec.summary + "\n";
  for (const HelpPart& part : parts) {
    if (!part.lines.empty()) {
      text += "\n" + part.heading + "\n";
      for (const std::string& line : part.lines) text += "  " + line + "\n";
    }
    for (const std::string& paragraph : part.paragraphs) {
      text += "\n" + WrapText(paragraph, kWidth, 0) + "\n";
    }
    if (!part.rows.empty()) text += TwoColumns(part.heading, part.rows);
  }
  return text;
}

}  // namespace dreamsearch
