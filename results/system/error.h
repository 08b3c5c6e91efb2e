// error.h - how the programs say that something went wrong, and how they exit.
//
// One exception type in host and results: Failure carries one line for the user and the
// exit code the program ends with. The line says what was expected, what was found,
// where (an absolute path), and what to do.
#pragma once

#include <stdexcept>
#include <string>

namespace dreamsearch {

// What the programs exit with; scripts rely on these numbers.
enum class ExitCode : int {
  kOk = 0,
  kUsage = 2,                // the command line is wrong
  kBadInput = 65,            // a configuration, model file or database is wrong or damaged
  kNotFound = 66,            // no such file, run, component or plugin
  kPluginRefused = 69,       // a plugin was found and cannot be used
  kInternal = 70,            // a defect of ours
  kPluginCrashed = 71,       // a plugin crashed or timed out
  kDiverged = 72,            // NaN, infinity or a physics warning ended a run
  kCannotCreate = 73,        // a database or an output cannot be created
  kInputOutput = 74,         // reading or writing failed, the disk is full, locked for too long
  kInterrupted = 75,         // stopped; can be resumed
  kPermission = 77,          // not allowed
  kVerificationFailed = 78,  // stored and recomputed results differ
};

class Failure : public std::runtime_error {
 public:
  Failure(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}

  ExitCode code() const noexcept { return code_; }
  int exit_status() const noexcept { return static_cast<int>(code_); }

 private:
  ExitCode code_;
};

}  // namespace dreamsearch
