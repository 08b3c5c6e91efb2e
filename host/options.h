// options.h - the command line and the configuration file of `runner`.
//
// Every flag is declared once; the parser and the help text come from that
// declaration. A configuration file holds the same names without the dashes,
// `name = value`, one a line, `set` as often as wanted; `#` begins a comment.
// The command line wins over the file. A relative path in either is relative to
// the current folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <boost/program_options.hpp>

#include "error.h"

namespace dreamsearch {

// One `--set key=value`, and where it was written.
struct Setting {
  std::string key;
  std::string value;
  bool from_file = false;
  std::string where;  // "runner: --set", "/path/x.cfg, line 3": begins a message
};

// What every command that runs experiments understands.
struct ProcessOptions {
  std::filesystem::path db = "results/dreamsearch.db";
  std::vector<std::string> plugin_path;
  int jobs = 1;                       // default: the number of cores
  double time_limit_seconds = 0;      // 0: none
  std::uint64_t memory_limit_bytes = 0;  // 0: none
  double hang_timeout_seconds = 60;
  bool retry = false;
  bool replace = false;
  bool log_decisions = false;
  bool record_trees = false;
  bool dry_run = false;
};

struct Options {
  bool help = false;     // then nothing else was checked
  bool version = false;  // likewise
  std::vector<std::string> environments;
  std::vector<std::string> planners;
  std::vector<std::string> models;
  std::string eval_planner;           // empty: the run's own
  std::vector<std::uint64_t> seeds;   // each once, in the order given
  std::string study = "default";
  std::string preset = "fast";
  std::vector<Setting> settings;      // the file's first; --steps is run.steps
  std::string config;                 // the file, empty if none
  bool evaluate = false;              // of `runner eval`: nothing is trained
  ProcessOptions process;
};

// The command line of `runner eval`.
struct EvaluationOptions {
  std::string run;     // the trained run; empty: none
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
// --plugin-path. ParseFlags reads them with RunnerError instead of Boost's errors. A flag
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
