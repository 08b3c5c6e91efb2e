// python_process.h - a Python process that plays an environment, see bridge.py.
//
// Frames go out on one pipe and come back on another. The process ends when this object does,
// when the run's process does, or when it asks for more than an answer.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace dreamsearch::gym {

// The interpreter could not be started, or is gone. The text says how it ended.
class ProcessError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The environment refused a request or raised an exception; the text is its own.
class EnvironmentError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class PythonProcess {
 public:
  // Runs `program`, the text of bridge.py, with `interpreter` (a path, or a name that is
  // looked up in PATH).
  PythonProcess(const std::string& interpreter, const std::string& program);
  ~PythonProcess();
  PythonProcess(const PythonProcess&) = delete;
  PythonProcess& operator=(const PythonProcess&) = delete;

  // Sends `kind` and `body`; returns the body of the answer, whose kind must be the same letter
  // in lower case. It stays until the next call.
  std::string_view Ask(char kind, std::string_view body);

 private:
  [[noreturn]] void FailAsItEnded(const char* what);
  // Its wait status; kills it after two seconds.
  int WaitForEnd();
  void Read(char* data, std::size_t size);

  std::string interpreter_;
  pid_t pid_ = -1;
  int requests_ = -1;
  int answers_ = -1;
  std::vector<char> frame_;
};

}  // namespace dreamsearch::gym
