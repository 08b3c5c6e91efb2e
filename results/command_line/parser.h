// parser.h - from words, or a line of a file, to the flags of a command.
//
// Its .cc is the one file that includes Boost.ProgramOptions. Nothing here reads a value:
// the texts are as they were written.
#pragma once

#include <string>
#include <vector>

#include "results/command_line/command.h"

namespace dreamsearch {

// Every flag and argument among the words after the command's name, in their order, each
// once unless it may be given several times. A flag's name is never abbreviated, so that a
// new flag does not change what an old command means; "-1" is a value.
std::vector<Given> ParseWords(const CommandSpec& spec, const Words& words);

// `name = value` of one line of a file, with the value; `where` begins every message.
// Empty if the line has only a comment.
std::vector<Given> ParseLine(const CommandSpec& spec, const std::string& line,
                             const std::string& where);

}  // namespace dreamsearch
