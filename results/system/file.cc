#include "results/system/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include "results/system/error.h"
#include "results/system/file_descriptor.h"

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
  throw Failure(permission       ? ExitCode::kPermission
                : missing_folder ? ExitCode::kCannotCreate
                                 : ExitCode::kInputOutput,
                message);
}

void SyncFolder(const std::filesystem::path& folder) {
  FileDescriptor fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() < 0 || ::fsync(fd.get()) != 0) ThrowErrno(folder / ".", "sync", errno);
}

// Where a path ends when its symbolic links are followed; nothing need be there.
std::string FinalTarget(std::filesystem::path path) {
  std::error_code error;
  while (std::filesystem::is_symlink(path, error)) {
    path = path.parent_path() / std::filesystem::read_symlink(path, error);
  }
  return path.string();
}

}  // namespace

std::string AbsolutePath(const std::string& path) {
  std::error_code ignored;
  const std::filesystem::path absolute = std::filesystem::absolute(path, ignored);
  return absolute.empty() ? path : absolute.lexically_normal().string();
}

void ReadFile(const std::filesystem::path& path, const Append& append) {
  const auto fail = [&path](int error) {
    const ExitCode code = error == ENOENT || error == ENOTDIR ? ExitCode::kNotFound
                          : error == EACCES                   ? ExitCode::kPermission
                                                              : ExitCode::kInputOutput;
    throw Failure(code, AbsolutePath(path.string()) + ": cannot be read: " + std::strerror(error));
  };
  const FileDescriptor descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (descriptor.get() < 0) fail(errno);
  std::vector<char> block(1 << 16);
  for (;;) {
    const ssize_t got = ::read(descriptor.get(), block.data(), block.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail(errno);
    if (got == 0) return;
    append({block.data(), static_cast<std::size_t>(got)});
  }
}

std::string ReadWholeFile(const std::filesystem::path& path) {
  std::string bytes;
  ReadFile(path, [&](std::string_view piece) { bytes.append(piece); });
  return bytes;
}

void WriteWholeFile(const std::filesystem::path& path,
                    const std::function<void(const Append& append)>& write) {
  const std::filesystem::path temporary = path.string() + ".tmp";
  FileDescriptor fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (fd.get() < 0) ThrowErrno(temporary, "create", errno);
  try {
    write([&](std::string_view bytes) {
      if (!WriteAll(fd.get(), bytes)) ThrowErrno(temporary, "write", errno);
    });
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

OutputFile::OutputFile(const std::string& path) : path_(AbsolutePath(path)) {
  struct stat there;
  const bool exists = stat(path_.c_str(), &there) == 0;
  if (!exists && errno == ELOOP) Fail("created");
  if (exists && !S_ISREG(there.st_mode)) {
    file_ = open(path_.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
    if (file_ < 0) Fail("written");
    return;
  }
  path_ = FinalTarget(path_);
  temporary_ = path_ + ".part" + std::to_string(getpid());
  file_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file_ < 0) Fail("created");
}

OutputFile::~OutputFile() {
  if (file_ < 0) return;
  close(file_);
  RemoveTemporary();
}

void OutputFile::RemoveTemporary() {
  if (!temporary_.empty()) unlink(temporary_.c_str());
}

void OutputFile::Fail(const char* what) {
  const int error = errno;
  if (file_ >= 0) close(file_);
  file_ = -1;
  RemoveTemporary();
  const ExitCode code = error == EACCES || error == EPERM || error == EROFS ? ExitCode::kPermission
                        : error == ENOSPC || error == EIO || error == EDQUOT
                            ? ExitCode::kInputOutput
                            : ExitCode::kCannotCreate;
  throw Failure(code, path_ + ": cannot be " + what + ": " + std::strerror(error));
}

void OutputFile::Append(const std::string& bytes) {
  buffer_ += bytes;
  if (buffer_.size() >= (1 << 20)) Flush();
}

void OutputFile::Flush() {
  if (!WriteAll(file_, buffer_)) Fail("written");
  buffer_.clear();
}

void OutputFile::Close() {
  Flush();
  if (!temporary_.empty() && fsync(file_) != 0) Fail("written");
  const int file = std::exchange(file_, -1);
  if (close(file) != 0) Fail("written");
  if (!temporary_.empty() && rename(temporary_.c_str(), path_.c_str()) != 0) Fail("put in place");
}

void WriteFile(const std::string& path, const std::string& bytes) {
  OutputFile file(path);
  file.Append(bytes);
  file.Close();
}

}  // namespace dreamsearch
