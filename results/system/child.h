// child.h - how a child process ended.
#pragma once

#include <sys/types.h>
#include <sys/wait.h>

#include <cerrno>

namespace dreamsearch {

// Waits for the end of a child, whatever signals come meanwhile, and returns its wait status.
inline int WaitForEnd(pid_t pid) {
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace dreamsearch
