#include "results/upkeep/put_back.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <thread>

#include "results/database/database.h"
#include "results/database/file_system.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/file_descriptor.h"
#include "results/system/sha256.h"
#include "results/upkeep/merge.h"

namespace dreamsearch::results {
namespace {

constexpr std::chrono::seconds kPatience{30};
constexpr std::chrono::milliseconds kPause{20};
constexpr std::int64_t kPieceBytes = 1 << 20;

bool IsThere(const std::string& path) { return ::access(path.c_str(), F_OK) == 0; }

// A database that nobody else has, with all of it in the one file. It is read through SQLite: to
// open and close the file once more would end the locks.
class HeldDatabase {
 public:
  // Where files cannot be locked nobody is kept out, and only a journal tells of others.
  explicit HeldDatabase(const std::string& path) {
    const std::string why = WhyNoLocks(path);
    if (!why.empty()) {
      for (const char* journal : {"-wal", "-journal"}) {
        if (!IsThere(path + journal)) continue;
        throw Failure(ExitCode::kInputOutput,
                      path + ": files cannot be locked here (" + why + "), and " + path + journal +
                          " shows that another process writes to it or was killed. If none does, "
                          "move both to a folder of this machine, open them there with `results "
                          "list --db`, and move the database back.");
      }
      connection_ = std::make_unique<Connection>(path, OpenMode::kImmutable);
      return;
    }
    connection_ = std::make_unique<Connection>(path, OpenMode::kReadWrite);
  }

  // False if another process has it open for longer than `patience`.
  bool TakeAlone(std::chrono::seconds patience) {
    if (sqlite3_db_readonly(connection_->handle(), "main") == 1) return true;
    const auto deadline = std::chrono::steady_clock::now() + patience;
    const auto give_up = [deadline](double) { return std::chrono::steady_clock::now() < deadline; };
    connection_->WaitForLocks(give_up);
    for (const char* step :
         {"PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = DELETE", "BEGIN EXCLUSIVE"}) {
      while (sqlite3_exec(connection_->handle(), step, nullptr, nullptr, nullptr) != SQLITE_OK) {
        const int code = sqlite3_errcode(connection_->handle()) & 0xff;
        if (code != SQLITE_BUSY && code != SQLITE_LOCKED) {
          ThrowSqlite(connection_->handle(), connection_->path(), "taking it alone");
        }
        if (!give_up(0)) return false;
        std::this_thread::sleep_for(kPause);
      }
    }
    return true;
  }

  void Read(const Append& append) const {
    sqlite3_file* file = nullptr;
    sqlite3_file_control(connection_->handle(), "main", SQLITE_FCNTL_FILE_POINTER, &file);
    sqlite3_int64 size = 0;
    Check(file->pMethods->xFileSize(file, &size));
    std::string piece;
    for (sqlite3_int64 at = 0; at < size; at += kPieceBytes) {
      piece.resize(static_cast<std::size_t>(std::min<sqlite3_int64>(kPieceBytes, size - at)));
      Check(file->pMethods->xRead(file, piece.data(), static_cast<int>(piece.size()), at));
      append(piece);
    }
  }

  Fingerprint Print() const {
    Sha256 digest;
    Read([&](std::string_view bytes) { digest.Add(bytes); });
    return digest.FinishHex();
  }

 private:
  void Check(int code) const {
    if (code == SQLITE_OK) return;
    throw Failure(ExitCode::kInputOutput,
                  connection_->path() + ": cannot be read: " + sqlite3_errstr(code));
  }

  std::unique_ptr<Connection> connection_;
};

// A name beside `path` that no other process takes.
std::string NameBeside(const std::string& path) {
  const std::filesystem::path file = path;
  return (file.parent_path() / ("." + file.filename().string() + ".new-" + NewUuid())).string();
}

class RemovedAtEnd {
 public:
  explicit RemovedAtEnd(std::string path) : path_(std::move(path)) {}
  ~RemovedAtEnd() { ::unlink(path_.c_str()); }
  RemovedAtEnd(const RemovedAtEnd&) = delete;
  RemovedAtEnd& operator=(const RemovedAtEnd&) = delete;
  const std::string& path() const { return path_; }

 private:
  const std::string path_;
};

void Rename(const std::string& from, const std::string& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) {
    const int error = errno;
    throw Failure(error == EACCES || error == EPERM || error == EROFS ? ExitCode::kPermission
                                                                      : ExitCode::kInputOutput,
                  to + ": cannot be replaced: " + std::strerror(error));
  }
  const FileDescriptor folder(
      ::open(std::filesystem::path(to).parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.get() >= 0) ::fsync(folder.get());
}

}  // namespace

Fingerprint TakeDatabase(const std::string& from, const std::string& to) {
  if (!IsThere(from)) return "";
  HeldDatabase held(from);
  if (!held.TakeAlone(kPatience)) {
    throw Failure(ExitCode::kInputOutput,
                  from +
                      ": another process has it open, so it cannot be copied as it is. End that "
                      "process (it may only read) and run the same command again.");
  }
  WriteWholeFile(to, [&](const Append& append) { held.Read(append); });
  return held.Print();
}

Fingerprint PutBackDatabase(const std::string& from, const std::string& to,
                            const Fingerprint& expected) {
  // Compact, consistent, and without a log.
  const RemovedAtEnd whole(NameBeside(from));
  Database::OpenExisting(from)->connection().Prepare("VACUUM INTO ?1").Bind(whole.path()).Run();
  const RemovedAtEnd copy(NameBeside(to));
  Sha256 digest;
  WriteWholeFile(copy.path(), [&](const Append& append) {
    ReadFile(whole.path(), [&](std::string_view bytes) {
      digest.Add(bytes);
      append(bytes);
    });
  });
  const bool there = IsThere(to);
  if (!there && expected.empty()) {
    // What a deleted file left would be taken for the new one's.
    for (const char* part : {"-journal", "-wal", "-shm"}) ::unlink((to + part).c_str());
    Rename(copy.path(), to);
    return digest.FinishHex();
  }
  if (there) {
    HeldDatabase held(to);
    if (held.TakeAlone(std::chrono::seconds(1)) && held.Print() == expected) {
      Rename(copy.path(), to);
      return digest.FinishHex();
    }
  }
  // From beside it, so that the paths of files are relative to the same folder.
  Merge(Database::OpenOrCreate(to).get(), copy.path());
  HeldDatabase held(to);
  return held.TakeAlone(std::chrono::seconds(1)) ? held.Print() : "changing";
}

}  // namespace dreamsearch::results
