#include "whole_file.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "error.h"

namespace dreamsearch {

void WriteWholeFile(const std::filesystem::path& path, const std::string& bytes) {
  const std::filesystem::path temporary = path.string() + ".tmp";
  const auto fail = [&](const char* what, int error) {
    std::error_code ignored;
    std::filesystem::remove(temporary, ignored);
    throw RunnerError(error == EACCES || error == EPERM || error == EROFS ? ExitCode::kPermission
                      : error == ENOENT || error == ENOTDIR || error == EISDIR
                          ? ExitCode::kCannotCreate
                          : ExitCode::kInputOutput,
                      std::string("cannot ") + what + " " +
                          std::filesystem::absolute(path).string() + ": " + std::strerror(error));
  };
  std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
  if (!file) fail("create", errno);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) fail("write", errno);
  std::error_code error;
  std::filesystem::rename(temporary, path, error);
  if (error) fail("rename to", error.value());
}

}  // namespace dreamsearch
