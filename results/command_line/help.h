// help.h - what `--help` says of a command, in parts, and the one form in which it is printed.
//
// Summary, usage, examples, what else there is to know, arguments, and the flags in their
// groups: name, name of the value, what it does, default.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "results/command_line/command.h"

namespace dreamsearch {

// A heading and what is below it, which is of one kind.
struct HelpPart {
  std::string heading;                                         // empty: none
  std::vector<std::string> lines = {};                         // as they are
  std::vector<std::string> paragraphs = {};                    // to be wrapped
  std::vector<std::pair<std::string, std::string>> rows = {};  // a name, and what it means
};

// The headings of the usage and of the examples.
inline constexpr const char* kUsageHeading = "Usage";
inline constexpr const char* kExamplesHeading = "Examples";

std::vector<HelpPart> HelpParts(const CommandSpec& spec);

// The summary and the parts, wrapped for a terminal.
std::string HelpText(const CommandSpec& spec, const std::vector<HelpPart>& parts);
inline std::string HelpText(const CommandSpec& spec) { return HelpText(spec, HelpParts(spec)); }

// A heading with two columns below it; a second column too long for the line goes on below
// itself.
std::string TwoColumns(const std::string& heading,
                       const std::vector<std::pair<std::string, std::string>>& rows);

}  // namespace dreamsearch
