#include "results/system/temporary_folder.h"

#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "results/system/error.h"

namespace dreamsearch {

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "dreamsearch_XXXXXX").string();
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
