// child.h - how a child process is started and how it ended.
#pragma once

#include <sys/types.h>
#include <sys/wait.h>

#include <cerrno>
#include <string>
#include <vector>

namespace dreamsearch {

// The words of a command as exec and posix_spawn want them; valid while `words` are.
inline std::vector<char*> ArgumentVector(std::vector<std::string>* words) {
  std::vector<char*> argv;
  for (std::string& word : *words) argv.push_back(word.data());
  argv.push_back(nullptr);
  return argv;
}

// Waits for the end of a child, whatever signals come meanwhile, and returns its wait status.
inline int WaitForEnd(pid_t pid) {
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace dreamsearch
