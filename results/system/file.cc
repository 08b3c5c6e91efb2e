#include "results/system/file.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include "results/system/error.h"
#include "results/system/file_descriptor.h"

namespace dreamsearch {
namespace {

// Of the name of a temporary file.
constexpr std::size_t kRandomLetters = 12;

[[noreturn]] void ThrowErrno(const std::filesystem::path& path, const char* what, int error) {
  std::error_code ignored;
  const auto space = std::filesystem::space(path.parent_path(), ignored);
  std::string message = std::string("cannot ") + what + " " + AbsolutePath(path.string()) + ": " +
                        std::strerror(error);
  if (!ignored) message += " (" + std::to_string(space.available) + " bytes free)";
  const bool permission = error == EACCES || error == EPERM || error == EROFS;
  const bool impossible = error == ENOENT || error == ENOTDIR || error == EISDIR ||
                          error == ELOOP || error == ENAMETOOLONG;
  throw Failure(permission   ? ExitCode::kPermission
                : impossible ? ExitCode::kCannotCreate
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

void CheckIsNoLink(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (!std::filesystem::is_symlink(folder, ignored)) return;
  throw Failure(ExitCode::kBadInput,
                AbsolutePath(folder.string()) +
                    ": expected the folder of a run, found a symbolic link, through which nothing "
                    "is written. Put the folder itself there");
}

TemporaryFile MakeTemporaryFile(const std::filesystem::path& path) {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyz012345";
  const std::size_t most = NAME_MAX - kRandomLetters - std::strlen(kTemporarySuffix) - 1;
  const std::string begin =
      (path.parent_path() / path.filename().string().substr(0, most)).string();
  for (;;) {
    unsigned char random[kRandomLetters];
    if (::getrandom(random, sizeof random, 0) != sizeof random) {
      ThrowErrno(path, "draw a name beside", errno);
    }
    std::string name = begin + ".";
    for (const unsigned char byte : random) name += kLetters[byte % kLetters.size()];
    name += kTemporarySuffix;
    FileDescriptor file(
        ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
    if (file.get() >= 0) return {name, std::move(file)};
    if (errno != EEXIST) ThrowErrno(path, "create", errno);
  }
}

bool IsTemporaryOf(const std::filesystem::path& file, const std::filesystem::path& path) {
  const std::string name = file.string(), begin = path.string() + ".";
  return name.starts_with(begin) && name.ends_with(kTemporarySuffix) &&
         name.size() == begin.size() + kRandomLetters + std::strlen(kTemporarySuffix);
}

void WriteWholeFile(const std::filesystem::path& path,
                    const std::function<void(const Append& append)>& write) {
  TemporaryFile made = MakeTemporaryFile(path);
  const std::filesystem::path& temporary = made.path;
  FileDescriptor& fd = made.file;
  try {
    write([&](std::string_view bytes) {
      if (!WriteAll(fd.get(), bytes)) ThrowErrno(path, "write", errno);
    });
    if (::fsync(fd.get()) != 0) ThrowErrno(path, "sync", errno);
    if (::close(fd.Release()) != 0) ThrowErrno(path, "close", errno);
  } catch (...) {
    ::unlink(temporary.c_str());
    throw;
  }
  if (::rename(temporary.c_str(), path.c_str()) != 0) {
    const int error = errno;
    ::unlink(temporary.c_str());
    ThrowErrno(path, "rename to", error);
  }
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
  TemporaryFile made = MakeTemporaryFile(path_);
  temporary_ = made.path;
  file_ = made.file.Release();
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
