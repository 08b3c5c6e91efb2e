// library_folder.h - the libraries of corpus/, and a folder for others that is gone at the end of
// a test.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "results/system/temporary_folder.h"

namespace dreamsearch {

// A library of corpus/.
inline std::filesystem::path Corpus(const std::string& name) {
  return std::filesystem::path(DREAMSEARCH_CORPUS_DIR) / (name + ".so");
}

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
