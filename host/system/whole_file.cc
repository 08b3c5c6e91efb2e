#include "host/system/whole_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "host/processes/child_process.h"
#include "host/system/error.h"

namespace dreamsearch {
namespace {

[[noreturn]] void ThrowErrno(const std::filesystem::path& path, const char* what, int error) {
  std::error_code ignored;
  const auto space = std::filesystem::space(path.parent_path(), ignored);
  std::string message = std::string("cannot ") + what + " " +
                        std::filesystem::absolute(path).string() + ": " + std::strerror(error);
  if (!ignored) message += " (" + std::to_string(space.available) + " bytes free)";
  const bool permission = error == EACCES || error == EPERM || error == EROFS;
  const bool missing_folder = error == ENOENT || error == ENOTDIR;
  throw RunnerError(permission       ? ExitCode::kPermission
                    : missing_folder ? ExitCode::kCannotCreate
                                     : ExitCode::kInputOutput,
                    message);
}

void WriteOrThrow(int fd, std::string_view bytes, const std::filesystem::path& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      ThrowErrno(path, "write", errno);
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void SyncFolder(const std::filesystem::path& folder) {
  Descriptor fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() < 0 || ::fsync(fd.get()) != 0) ThrowErrno(folder / ".", "sync", errno);
}

}  // namespace

void WriteWholeFile(const std::filesystem::path& path,
                    const std::function<void(const Append& append)>& write) {
  const std::filesystem::path temporary = path.string() + ".tmp";
  Descriptor fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (fd.get() < 0) ThrowErrno(temporary, "create", errno);
  try {
    write([&](std::string_view bytes) { WriteOrThrow(fd.get(), bytes, temporary); });
    if (::fsync(fd.get()) != 0) ThrowErrno(temporary, "sync", errno);
    if (::close(fd.Release()) != 0) ThrowErrno(temporary, "close", errno);
  } catch (...) {
    ::unlink(temporary.c_str());
    throw;
  }
  if (::rename(temporary.c_str(), path.c_str()) != 0) ThrowErrno(path, "rename to", errno);
  SyncFolder(path.parent_path());
}

void WriteWholeFile(const std::filesystem::path& path, const std::string& bytes) {
  WriteWholeFile(path, [&](const Append& append) { append(bytes); });
}

}  // namespace dreamsearch
