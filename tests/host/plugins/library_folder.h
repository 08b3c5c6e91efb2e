// library_folder.h - a folder for libraries that is gone at the end of a test.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "results/system/temporary_folder.h"

namespace dreamsearch {

class LibraryFolder : public TemporaryFolder {
 public:
  std::filesystem::path Write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path() / name, std::ios::binary) << bytes;
    return path() / name;
  }
  // A copy of one of the corpus' libraries.
  std::filesystem::path Copy(const std::filesystem::path& file, const std::string& name) const {
    std::filesystem::copy_file(file, path() / name);
    return path() / name;
  }
};

}  // namespace dreamsearch
