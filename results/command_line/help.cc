#include "results/command_line/help.h"

#include <algorithm>
#include <sstream>
#include <utility>

#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kWidth = 96;
constexpr std::size_t kWidestFirstColumn = 24;

std::string Lines(const std::string& heading, const std::vector<std::string>& lines) {
  std::string text = "\n" + heading + "\n";
  for (const std::string& line : lines) text += "  " + line + "\n";
  return text;
}

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

std::string Flags(const std::string& heading, const std::vector<Flag>& flags) {
  std::vector<std::pair<std::string, std::string>> rows;
  for (const Flag& flag : flags) rows.push_back(Row(flag));
  return TwoColumns(heading, rows);
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

std::string HelpText(const CommandSpec& spec) {
  std::string text = spec.name + " - " + spec.summary + "\n" + Lines("Usage", Usage(spec));
  if (!spec.examples.empty()) text += Lines("Examples", spec.examples);
  std::istringstream paragraphs(spec.about);
  for (std::string paragraph; std::getline(paragraphs, paragraph);) {
    text += "\n" + WrapText(paragraph, kWidth, 0) + "\n";
  }
  if (!spec.arguments.empty()) text += Flags("Arguments", spec.arguments);
  for (const FlagGroup& group : spec.groups) text += Flags(group.title, group.flags);
  return text + TwoColumns("General",
                           {{"-h, --help", "show this text"}, {"--version", "show the version"}});
}

}  // namespace dreamsearch
