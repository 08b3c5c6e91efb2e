#include "results/system/temporary_folder.h"

#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "results/system/error.h"

namespace dreamsearch {

TemporaryFolder::TemporaryFolder() {
  std::error_code error;
  const std::filesystem::path place = std::filesystem::temp_directory_path(error);
  std::string name = (place / "dreamsearch_XXXXXX").string();
  if (error) {
    const char* given = ::getenv("TMPDIR");
    throw Failure(ExitCode::kCannotCreate,
                  std::string(given == nullptr ? "/tmp" : given) +
                      ": expected a folder for temporary files: " + error.message() +
                      ". TMPDIR can name another place.");
  }
  if (::mkdtemp(name.data()) == nullptr) {
    throw Failure(ExitCode::kCannotCreate,
                  name + ": cannot create a temporary folder: " + std::strerror(errno) +
                      ". TMPDIR can name another place.");
  }
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace dreamsearch
