// program.h - a program with commands: which one is meant, and how it ends.
//
// `-h`, `--help` and `--version` are answered here, for the program and for every command,
// before anything else is read. `man-pages FOLDER`, in no help, writes the manual pages there
// (man_page.h). Results go to standard output, messages to standard error.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "results/command_line/command.h"
#include "results/command_line/help.h"

namespace dreamsearch {

struct Program {
  std::string version;  // "results 0.9.0"
  // What it does without the name of a command; its declaration heads the program's help.
  // Without `run` the program has to be given a command.
  Command root;
  std::vector<Command> commands;
  // Processes that the program starts itself; in no help.
  std::map<std::string, std::function<int(const Words&)>> internal = {};
};

// The exit status of the command that the words name, which has run. Failure 2 for a
// command that does not exist.
int RunProgram(const Program& program, const Words& words);

// What `PROGRAM --help` says: of the program itself, its commands and its exit status.
std::vector<HelpPart> ProgramHelpParts(const Program& program);
std::string ProgramHelp(const Program& program);

// The body of a program's main: what `work` returns, or the exit status of the Failure that
// left it, said in one line on standard error; 74 if standard output could not be written, but
// not if whoever read it has left: `| head` has what it wants.
int ExitStatusOf(const std::string& program, const std::function<int()>& work);

}  // namespace dreamsearch
