// commands.h - the subcommands of `results`, one file each. Each takes the words
// after its name and returns the exit code, or throws Error.
#pragma once

#include <string>
#include <vector>

namespace dreamsearch::results {

using Words = std::vector<std::string>;

int CompareCommand(const Words& words);
int CurvesCommand(const Words& words);
int DeleteCommand(const Words& words);
int ExportCommand(const Words& words);
int ImportCommand(const Words& words);
int ListCommand(const Words& words);
int MergeCommand(const Words& words);
int ReportCommand(const Words& words);
int ShowCommand(const Words& words);
int SqlCommand(const Words& words);
int VerifyCommand(const Words& words);

}  // namespace dreamsearch::results
