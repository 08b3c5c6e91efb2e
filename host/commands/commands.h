// commands.h - the subcommands of `runner`, one file each.
//
// Each gets the arguments after its name, writes results to standard output and
// messages to standard error, and returns the exit status; Failure leaves it.
#pragma once

#include <string>
#include <vector>

namespace dreamsearch {

// runner, without a subcommand: runs experiments
int RunCommand(const std::vector<std::string>& arguments);

// runner list [KIND]
int ListCommand(const std::vector<std::string>& arguments);

// runner describe [KIND/]NAME
int DescribeCommand(const std::vector<std::string>& arguments);

// runner eval [RUN]
int EvalCommand(const std::vector<std::string>& arguments);

// runner explain RUN; ExplainDecisionMain is its child process
int ExplainCommand(const std::vector<std::string>& arguments);
int ExplainDecisionMain();

// runner export RUN; ExportModelMain is its child process, which loads the plugins
int ExportCommand(const std::vector<std::string>& arguments);
int ExportModelMain();

// runner resume [RUN|STUDY|all]
int ResumeCommand(const std::vector<std::string>& arguments);

// runner status
int StatusCommand(const std::vector<std::string>& arguments);

// runner verify RUN
int VerifyCommand(const std::vector<std::string>& arguments);

}  // namespace dreamsearch
