// man_page.h - the manual pages of a program, of the declarations that `--help` prints.
//
// One page for the program (`man runner`) and one for each command (`man runner-eval`, which
// man-db also finds as `man runner eval`).
#pragma once

#include <string>

#include "results/command_line/program.h"

namespace dreamsearch {

// The page of the program, or of one of its commands, as source for groff and mandoc.
std::string ManPage(const Program& program);
std::string ManPage(const Program& program, const Command& command);

// Writes PROGRAM.1 and PROGRAM-COMMAND.1 into the folder, which is made. Failure 73 and 74.
void WriteManPages(const Program& program, const std::string& folder);

}  // namespace dreamsearch
