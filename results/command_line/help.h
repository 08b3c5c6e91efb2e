// help.h - the one form of `--help`.
//
// Summary, usage, examples, what else there is to know, arguments, and the flags in their
// groups: name, name of the value, what it does, default.
#pragma once

#include <string>
#include <vector>

#include "results/command_line/command.h"

namespace dreamsearch {

std::string HelpText(const CommandSpec& spec);

// A heading with two columns below it; a second column too long for the line goes on below
// itself.
std::string TwoColumns(const std::string& heading,
                       const std::vector<std::pair<std::string, std::string>>& rows);

}  // namespace dreamsearch
