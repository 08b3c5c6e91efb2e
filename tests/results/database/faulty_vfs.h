// faulty_vfs.h - SQLite's file access with a fault at the n-th write-class call
// (write, truncate, sync, delete), for one process.
#pragma once

#include <sqlite3.h>

namespace dreamsearch::results {

enum class Fault { kNone, kKill, kDiskFull, kInputOutputError };

// From now on every connection of this process goes through it. The n-th call,
// counted from 1, meets the fault; all other calls are the file system's.
void InstallFaultyVfs(Fault fault, int n);
// Write-class calls so far.
int WriteCalls();

}  // namespace dreamsearch::results
