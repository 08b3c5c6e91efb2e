// A library to preload: what a site may forbid, or do to a program. It stands for file systems
// without locks, quotas, nodes whose clocks differ, and kills at a given moment, by variables of
// the environment:
//
//   SITE_NO_LOCKS=FOLDER SITE_LOCK_ERROR=N   files below cannot be locked: error N
//   SITE_QUOTA=FOLDER                        nothing can be written below while FOLDER/full is
//   there SITE_CLOCK_AHEAD=SECONDS                 this process's clock differs SITE_KILL=FOLDER
//   SITE_KILL_AT=N          killed at the N-th renaming of a file below: before it
//                                            if N is odd, after it otherwise
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

bool IsBelow(const char* path, const char* variable) {
  const char* folder = ::getenv(variable);
  return folder != nullptr && std::strncmp(path, folder, std::strlen(folder)) == 0;
}

bool IsBelow(int file, const char* variable) {
  if (::getenv(variable) == nullptr) return false;
  char link[64], path[4096];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  const ssize_t length = ::readlink(link, path, sizeof path - 1);
  if (length <= 0) return false;
  path[length] = '\0';
  return IsBelow(path, variable);
}

bool LocksFail(int file) {
  if (!IsBelow(file, "SITE_NO_LOCKS")) return false;
  errno = std::atoi(::getenv("SITE_LOCK_ERROR"));
  return true;
}

bool IsFull(int file) {
  if (!IsBelow(file, "SITE_QUOTA")) return false;
  char flag[4096];
  std::snprintf(flag, sizeof flag, "%s/full", ::getenv("SITE_QUOTA"));
  if (::access(flag, F_OK) != 0) return false;
  errno = EDQUOT;
  return true;
}

long Control(int file, int command, long argument) {
  switch (command) {
    case F_SETLK:
    case F_SETLKW:
    case F_GETLK:
    case F_OFD_SETLK:
    case F_OFD_SETLKW:
    case F_OFD_GETLK:
      if (LocksFail(file)) return -1;
      break;
    default:
      break;
  }
  return ::syscall(SYS_fcntl, file, command, argument);
}

long Ahead() {
  const char* seconds = ::getenv("SITE_CLOCK_AHEAD");
  return seconds == nullptr ? 0 : std::atol(seconds);
}

}  // namespace

// What it replaces must be seen outside, unlike what else is built here.
#pragma GCC visibility push(default)

extern "C" {

int flock(int file, int operation) {
  return LocksFail(file) ? -1 : static_cast<int>(::syscall(SYS_flock, file, operation));
}

int fcntl(int file, int command, ...) {
  va_list more;
  va_start(more, command);
  const long argument = va_arg(more, long);
  va_end(more);
  return static_cast<int>(Control(file, command, argument));
}

int fcntl64(int file, int command, ...) {
  va_list more;
  va_start(more, command);
  const long argument = va_arg(more, long);
  va_end(more);
  return static_cast<int>(Control(file, command, argument));
}

ssize_t write(int file, const void* bytes, size_t size) {
  return IsFull(file) ? -1 : ::syscall(SYS_write, file, bytes, size);
}

ssize_t pwrite(int file, const void* bytes, size_t size, off_t at) {
  return IsFull(file) ? -1 : ::syscall(SYS_pwrite64, file, bytes, size, at);
}

ssize_t pwrite64(int file, const void* bytes, size_t size, off64_t at) {
  return IsFull(file) ? -1 : ::syscall(SYS_pwrite64, file, bytes, size, at);
}

int clock_gettime(clockid_t clock, struct timespec* now) noexcept {
  const long result = ::syscall(SYS_clock_gettime, clock, now);
  if (clock == CLOCK_REALTIME) now->tv_sec += Ahead();
  return static_cast<int>(result);
}

int gettimeofday(struct timeval* now, void*) noexcept {
  timespec time;
  clock_gettime(CLOCK_REALTIME, &time);
  now->tv_sec = time.tv_sec;
  now->tv_usec = time.tv_nsec / 1000;
  return 0;
}

time_t time(time_t* now) noexcept {
  timespec time;
  clock_gettime(CLOCK_REALTIME, &time);
  if (now != nullptr) *now = time.tv_sec;
  return time.tv_sec;
}

int rename(const char* from, const char* to) noexcept {
  static int renamed = 0;
  const char* at = IsBelow(to, "SITE_KILL") ? ::getenv("SITE_KILL_AT") : nullptr;
  const int point = at == nullptr ? 0 : std::atoi(at);
  if (at != nullptr) ++renamed;
  if (point != 0 && point == 2 * renamed - 1) ::raise(SIGKILL);
  const long result = ::syscall(SYS_rename, from, to);
  if (point != 0 && point == 2 * renamed) ::raise(SIGKILL);
  return static_cast<int>(result);
}

}  // extern "C"

#pragma GCC visibility pop
