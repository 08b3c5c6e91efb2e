// error.h - the one exception of the results database.
#pragma once

#include <stdexcept>
#include <string>

namespace dreamsearch::results {

// What the program that meets the error ends with.
enum ExitCode : int {
  kExitOk = 0,
  kExitUsage = 2,
  kExitBadData = 65,       // not our database, a newer schema, damaged or malformed input
  kExitNoInput = 66,       // no such file or run
  kExitInternal = 70,      // a defect of ours
  kExitCannotCreate = 73,  // the database or an output cannot be created
  kExitInputOutput = 74,   // disk full, input/output error, locked for too long
  kExitPermission = 77,
  kExitVerification = 78,  // stored digests do not match the stored rows
};

// The message says what was expected, what was found, where (an absolute path)
// and what to do.
class Error : public std::runtime_error {
 public:
  Error(int exit_code, const std::string& message)
      : std::runtime_error(message), exit_code_(exit_code) {}

  int exit_code() const { return exit_code_; }

 private:
  int exit_code_;
};

}  // namespace dreamsearch::results
