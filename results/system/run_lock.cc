#include "results/system/run_lock.h"

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <string>
#include <thread>

#include "results/system/error.h"
#include "results/system/file.h"

namespace dreamsearch {
namespace {

// A second in all.
constexpr int kLockAttempts = 100;
constexpr std::chrono::milliseconds kLockPause{10};

std::filesystem::path LockPath(const std::filesystem::path& folder) { return folder / "lock"; }

// 0, or why the lock was not taken: EWOULDBLOCK if another process holds it.
int TryLock(int file, bool exclusive) {
  for (;;) {
    if (::flock(file, (exclusive ? LOCK_EX : LOCK_SH) | LOCK_NB) == 0) return 0;
    if (errno == EWOULDBLOCK) return EWOULDBLOCK;
    if (errno != EINTR) break;
  }
  struct flock whole {};
  whole.l_type = exclusive ? F_WRLCK : F_RDLCK;
  whole.l_whence = SEEK_SET;
  if (::fcntl(file, F_OFD_SETLK, &whole) == 0) return 0;
  return errno == EACCES || errno == EAGAIN ? EWOULDBLOCK : errno;
}

}  // namespace

// Who asks with RunIsLocked holds the file for a moment, so a refusal counts only once it has
// lasted.
FileDescriptor LockRun(const std::filesystem::path& folder) {
  CheckIsNoLink(folder);
  const std::string path = LockPath(folder).string();
  FileDescriptor lock(::open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644));
  if (lock.get() < 0) {
    const int error = errno;
    throw Failure(error == EACCES || error == EROFS     ? ExitCode::kPermission
                  : error == ENOENT || error == ENOTDIR ? ExitCode::kCannotCreate
                                                        : ExitCode::kInputOutput,
                  "cannot create " + path + ": " + std::strerror(error));
  }
  for (int attempt = 0;; ++attempt) {
    const int error = TryLock(lock.get(), true);
    if (error == 0) return lock;
    if (error != EWOULDBLOCK) {
      throw Failure(ExitCode::kInputOutput,
                    "cannot lock " + path + ": " + std::strerror(error) +
                        ". The file system has no locks, which keep two processes from working "
                        "on one run; name a database on another one with --db");
    }
    if (attempt == kLockAttempts) {
      throw Failure(ExitCode::kInputOutput,
                    "another process is working on this run: " + path + " is locked");
    }
    std::this_thread::sleep_for(kLockPause);
  }
}

bool RunIsLocked(const std::filesystem::path& folder) {
  const FileDescriptor lock(
      ::open(LockPath(folder).c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  // Shared, so that two who ask at once do not take each other for a worker.
  return lock.get() >= 0 && TryLock(lock.get(), false) == EWOULDBLOCK;
}

}  // namespace dreamsearch
