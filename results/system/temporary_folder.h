// temporary_folder.h - a folder that is gone, with all in it, when this is.
#pragma once

#include <filesystem>
#include <string>

namespace dreamsearch {

class TemporaryFolder {
 public:
  // In TMPDIR, or in /tmp. Throws Failure 73.
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // The path of a file in it.
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

}  // namespace dreamsearch
