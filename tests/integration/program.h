// program.h - calls `runner` as a user does, in a folder that is thrown away.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace dreamsearch {

struct ProgramResult {
  int exit_status = -1;  // 128 + signal if a signal ended it
  std::string out;
  std::string err;
};

// A folder for one test: databases go here, and programs run in it.
class Workplace {
 public:
  Workplace();
  ~Workplace();
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  // Runs `runner` with these arguments to its end.
  ProgramResult Runner(const std::vector<std::string>& arguments) const;
  // Runs `results`.
  ProgramResult Results(const std::vector<std::string>& arguments) const;
  // Starts `runner`, or another program; Wait ends the waiting.
  pid_t Start(const std::vector<std::string>& arguments, const char* program = "runner") const;
  ProgramResult Wait(pid_t pid) const;

  // Rows of a query on a database file, columns joined by '|'. Empty if the file
  // or the table is not there.
  std::vector<std::string> Query(const std::string& db, const std::string& sql) const;
  std::string Value(const std::string& db, const std::string& sql) const;
  // Runs a script of the system's Python in the folder; its exit status. It has no double quotes.
  int Python(const std::string& script) const;
  // Waits, for `seconds` at most, until a decision at `env_step` or later is recorded; whether one
  // is.
  bool WaitForStep(const std::string& db, int env_step, int seconds = 10) const;

 private:
  std::filesystem::path folder_;
};

// Whether the system's Python has NumPy.
bool HasNumPy();

// Arguments of a run that takes about a second: real task, real model, tiny sizes.
std::vector<std::string> TinyRun(const std::string& environment, const std::string& planner,
                                 const std::string& db, const std::vector<std::string>& more = {});

}  // namespace dreamsearch
