// commands.h - the subcommands of `runner`, one file each.
//
// Each gets the arguments after its name, writes results to standard output and
// messages to standard error, and returns the exit status; RunnerError leaves it.
#pragma once

#include <string>
#include <vector>

namespace dreamsearch {

// runner list [KIND]
int ListCommand(const std::vector<std::string>& arguments);

// runner describe [KIND/]NAME
int DescribeCommand(const std::vector<std::string>& arguments);

}  // namespace dreamsearch
