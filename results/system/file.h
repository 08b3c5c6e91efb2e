// file.h - files that are read whole, and written whole or not at all.
//
// Errors   Failure 66 for what is not there, 73 for what cannot be created, 74 when reading
//          or writing fails or the disk is full, 77 for what is not allowed; the message has
//          the absolute path and the reason.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "results/system/file_descriptor.h"

namespace dreamsearch {

// An absolute path, its links as they are.
std::string AbsolutePath(const std::string& path);

using Append = std::function<void(std::string_view bytes)>;

// A file beside `path` that is not yet there: it is made, never one that is found, and no link
// is followed. Its name, of random letters between `path` and kTemporarySuffix, is nobody's to
// guess. Throws as WriteWholeFile does.
inline constexpr char kTemporarySuffix[] = ".tmp";
struct TemporaryFile {
  std::filesystem::path path;
  FileDescriptor file;
};
TemporaryFile MakeTemporaryFile(const std::filesystem::path& path);
// Whether a file of that name may be one that MakeTemporaryFile has made for `path`.
bool IsTemporaryOf(const std::filesystem::path& file, const std::filesystem::path& path);

// Hands over the bytes of a file, piece by piece.
void ReadFile(const std::filesystem::path& path, const Append& append);
std::string ReadWholeFile(const std::filesystem::path& path);

// Throws Failure 65 if the folder is a symbolic link: whoever made it, and not its owner, would
// decide what is written where.
void CheckIsNoLink(const std::filesystem::path& folder);

// For what a run must find again after a crash or a power cut: written under a temporary
// name, synced, renamed, and its folder synced. `write` hands over the bytes, piece by
// piece. After an error no file of that name was changed.
void WriteWholeFile(const std::filesystem::path& path,
                    const std::function<void(const Append& append)>& write);
void WriteWholeFile(const std::filesystem::path& path, const std::string& bytes);

// An output that the user named, there whole or not at all: written under another
// name, synced and renamed by Close. Not closed, it leaves nothing. Symbolic links are
// followed. What is there and no regular file (a pipe, a terminal) is written to as it
// is, never replaced.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void Append(const std::string& bytes);
  void Close();

 private:
  void Flush();
  void RemoveTemporary();
  [[noreturn]] void Fail(const char* what);

  std::string path_;
  std::string temporary_;  // empty: written to path_ itself
  std::string buffer_;
  int file_ = -1;
};

void WriteFile(const std::string& path, const std::string& bytes);

}  // namespace dreamsearch
