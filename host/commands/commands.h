// commands.h - the commands of `runner`, one file each, which opens with the question that the
// command answers.
//
// Each writes results to standard output and messages to standard error.
#pragma once

#include "results/command_line/command.h"

namespace dreamsearch {

Command CheckCommand();
Command DescribeCommand();
Command EvalCommand();
Command ExplainCommand();
Command ExportCommand();
Command ExtendCommand();
Command ListCommand();
Command NewCommand();
Command RenderCommand();
Command ResumeCommand();
Command RunCommand();  // without a command's name
Command StatusCommand();
Command SubmitCommand();
Command VerifyCommand();
Command WatchCommand();

// Child processes, which load the plugins.
int CheckComponentMain();
int ExplainDecisionMain();
int ExportModelMain();

}  // namespace dreamsearch
