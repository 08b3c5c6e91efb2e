// own_folder.h - where an installation, and a build tree, keep what the programs bring along.
#pragma once

#include <filesystem>
#include <system_error>

namespace dreamsearch {

// lib/dreamsearch beside this program's folder; empty if it cannot be told.
inline std::filesystem::path OwnFolder() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return {};
  return program.parent_path().parent_path() / "lib/dreamsearch";
}

}  // namespace dreamsearch
