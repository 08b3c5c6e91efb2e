// flags_file.h - the flags of a command, read from a file.
//
// The file holds the names of the flags without the dashes, `name = value`, one a line, a
// flag that may be given several times as often as wanted; `#` begins a comment. A
// relative path in it is relative to the current folder.
#pragma once

#include <string>
#include <vector>

#include "results/command_line/command.h"

namespace dreamsearch {

// What the file says, in its order. Failure 65 for a line that is wrong, with the file's
// absolute path and the line's number; 66, 74 and 77 for the file.
std::vector<Given> ReadFlagsFile(const CommandSpec& spec, const std::string& path);

}  // namespace dreamsearch
