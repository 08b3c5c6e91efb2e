// commands.h - the commands of `results`, one file each, which opens with the question that
// the command answers.
#pragma once

#include "results/command_line/command.h"

namespace dreamsearch::results {

Command CompareCommand();
Command CurvesCommand();
Command DeleteCommand();
Command ExportCommand();
Command ImportCommand();
Command ListCommand();
Command MergeCommand();
Command ReportCommand();
Command ShowCommand();
Command SqlCommand();
Command VerifyCommand();

}  // namespace dreamsearch::results
