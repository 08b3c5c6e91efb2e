// file_system.h - what SQLite may rely on where a database lies.
#pragma once

#include <cstdint>
#include <string>

namespace dreamsearch::results {

struct FileSystem {
  std::string name;  // "NFS", "FUSE", or "a file system of type 0x1234"
  // Whether a write-ahead log is safe. Its index is memory that all processes map from one
  // file, so they must be on one machine, and mapping must show what others write.
  bool write_ahead_is_safe = false;
};

// By the type that statfs gives. One that is not known to be of this machine alone is taken for
// shared.
FileSystem FileSystemOfType(std::uint32_t type);

// That of a file, or of its nearest folder that is there. A place that cannot be asked
// is taken for an ordinary disk: opening the file says what is wrong.
FileSystem FileSystemOf(const std::string& path);

// Why files beside `path` cannot be locked; empty if they can, or if nothing can be written
// there. SQLite itself takes a lock that does not exist for one that somebody holds.
std::string WhyNoLocks(const std::string& path);

}  // namespace dreamsearch::results
