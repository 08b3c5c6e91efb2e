// error.h - how the host says that something went wrong, and how it exits.
//
// One exception type inside the host: RunnerError carries one line for the user
// and the exit code the program ends with. The line says what was expected,
// what was found, where, and what is known.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace dreamsearch {

// What the programs exit with; scripts rely on these numbers.
enum class ExitCode : int {
  kOk = 0,
  kUsage = 2,                // the command line is wrong
  kBadInput = 65,            // a configuration, model file or database is wrong
  kNotFound = 66,            // no such file, component or plugin
  kPluginRefused = 69,       // a plugin was found and cannot be used
  kInternal = 70,            // a defect of ours
  kPluginCrashed = 71,       // a plugin crashed or timed out
  kDiverged = 72,            // NaN, infinity or a physics warning ended a run
  kCannotCreate = 73,        // an output cannot be created
  kInputOutput = 74,         // reading or writing failed, the disk is full
  kInterrupted = 75,         // stopped; can be resumed
  kPermission = 77,          // not allowed
  kVerificationFailed = 78,  // stored and recomputed results differ
};

class RunnerError : public std::runtime_error {
 public:
  RunnerError(ExitCode code, const std::string& message)
      : std::runtime_error(message), code_(code) {}

  ExitCode code() const noexcept { return code_; }
  int exit_status() const noexcept { return static_cast<int>(code_); }

 private:
  ExitCode code_;
};

// The known names that `wanted` may be a misspelling of: those whose edit
// distance (insert, delete, change, swap neighbours; case ignored) is smallest
// and at most a third of the longer name's length; if there are none, those that
// begin with `wanted`. In the order of `known`.
std::vector<std::string> NearestNames(std::string_view wanted,
                                      const std::vector<std::string>& known);

// "Known: cem, dreamer, mcts_pw. Did you mean mcts_pw?", the question only when
// something is near; "Known: none." when nothing is.
std::string KnownNames(std::string_view wanted, const std::vector<std::string>& known);

// "one, two, three".
std::string JoinNames(const std::vector<std::string>& names);

}  // namespace dreamsearch
