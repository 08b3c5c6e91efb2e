// run_options.h - which runs a command was asked for, and how to run them.
//
// host/flags/run_flags.h binds them to flags.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "results/system/default_database.h"

namespace dreamsearch {

// One `--set key=value`, and where it was written.
struct Setting {
  std::string key;
  std::string value;
  bool from_file = false;
  std::string where;                  // "runner: --set", "/path/x.cfg, line 3": begins a message
  std::filesystem::path folder = {};  // a relative path in `value` begins here; empty: where
                                      // the command was typed
};

inline constexpr std::uint64_t kShareOfMemory = std::numeric_limits<std::uint64_t>::max();

// What of the code that a recorded run names may be run.
struct TrustedCode {
  std::vector<std::string> folders;  // --plugin-path
  std::vector<std::string> modules;  // --trust-module
};

// What every command that runs experiments understands.
struct ProcessOptions {
  std::filesystem::path db = kDefaultDatabase;
  std::filesystem::path scratch;  // a folder of this machine for the running database; empty: none
  std::vector<std::string> plugin_path;
  std::vector<std::string> trusted_modules;
  int jobs = 0;                   // 0: as many as the cores and the memory allow
  bool in_process = false;        // --jobs 0: work in this process, one run after the other
  double time_limit_seconds = 0;  // 0: none
  // Of resident size, for each run. 0: none; kShareOfMemory: the memory that is free, divided by
  // the number of jobs.
  std::uint64_t memory_limit_bytes = kShareOfMemory;
  int nice = 0;  // added to the niceness of workers
  double hang_timeout_seconds = 60;
  bool retry = false;
  bool replace = false;
  bool log_decisions = false;
  bool record_trees = false;
  bool keep_replay = false;
  bool dry_run = false;

  TrustedCode trusted() const { return {plugin_path, trusted_modules}; }
};

struct RunOptions {
  std::vector<std::string> environments;
  std::vector<std::string> planners;
  std::vector<std::string> models;   // empty: Catalogue::DefaultModel
  std::string eval_planner;          // empty: the run's own
  std::vector<std::uint64_t> seeds;  // each once, in the order given
  std::string study = "default";
  std::string preset = "fast";
  std::vector<Setting> settings;  // the file's first; --steps is run.steps
  bool evaluate = false;          // of `runner eval`: nothing is trained
  ProcessOptions process;
};

}  // namespace dreamsearch
