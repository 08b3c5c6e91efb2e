// run_lock.h - one process at a time works on a run.
//
// The lock is on the file `lock` in the run's folder: flock, or a lock of fcntl where the file
// system has no flock. SQLite needs the second kind, so wherever the database works, one of the
// two does. The system gives a lock back when its process ends, however it ends.
#pragma once

#include <filesystem>

#include "results/system/file_descriptor.h"

namespace dreamsearch {

// Holds the run for this process until the descriptor is closed. Failure 74 if another process
// holds it, or if the file system has neither kind of lock.
FileDescriptor LockRun(const std::filesystem::path& folder);

// Whether some process holds the run in `folder`.
bool RunIsLocked(const std::filesystem::path& folder);

}  // namespace dreamsearch
