// options.h - the command line and the configuration file of `runner`.
//
// Every flag is declared once; the parser and the help text come from that
// declaration. A configuration file holds the same names without the dashes,
// `name = value`, one a line, `set` as often as wanted; `#` begins a comment.
// The command line wins over the file. A relative path in either is relative to
// the current folder.
#pragma once

#include <boost/program_options.hpp>
#include <string>
#include <vector>

#include "host/settings/run_options.h"
#include "results/system/error.h"

namespace dreamsearch {

// The command line of `runner eval`.
struct EvaluationOptions {
  std::string run;  // the trained run; empty: none
  // What the command line says; empty lists where it says nothing. Settings hold
  // --episodes as run.eval_episodes.
  Options choice;
};

// Reads the arguments after the program's name, and the file of --config.
//   kUsage      unknown flag, missing or wrong value; the message names the known.
//   kBadInput   the same in the file; the message has its path and line.
//   kNotFound, kPermission  the file.
Options ParseOptions(const std::vector<std::string>& arguments);

// The text of `runner --help`.
std::string RunnerHelp();

// Reads the arguments after `runner eval`; choice.help as in ParseOptions. kUsage as
// there, and for what does not go together: a task, seeds or a study beside RUN, no
// task without one, settings of the training.
EvaluationOptions ParseEvaluationOptions(const std::vector<std::string>& arguments);
// The text of `runner eval --help`.
std::string EvaluationHelp();

// The file that --out names: in a folder, which is there or ends in a slash, `name`;
// `name` here if it is empty.
std::string OutputPath(const std::string& out, const std::string& name);

// For subcommands. The flags that fill *process: where and within which limits; with them
// those that mean something to `runner eval`, to `runner resume`, and all; or only
// --plugin-path. ParseFlags reads them with Failure instead of Boost's errors. A flag
// may be given once unless its value is a vector. `command` is for messages:
// "runner list".
boost::program_options::options_description LimitFlags(ProcessOptions* process);
boost::program_options::options_description EvaluationProcessFlags(ProcessOptions* process);
boost::program_options::options_description ResumeFlags(ProcessOptions* process);
boost::program_options::options_description ProcessFlags(ProcessOptions* process);
boost::program_options::options_description PluginPathFlag(std::vector<std::string>* plugin_path);
boost::program_options::variables_map ParseFlags(
    const std::string& command, const std::vector<std::string>& arguments,
    const boost::program_options::options_description& flags,
    const boost::program_options::positional_options_description& positional = {});

}  // namespace dreamsearch
