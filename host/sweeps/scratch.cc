#include "host/sweeps/scratch.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <iostream>
#include <map>
#include <system_error>

#include "host/acting/activity_clock.h"
#include "host/sweeps/run_file.h"
#include "results/database/database.h"
#include "results/system/file.h"
#include "results/system/run_lock.h"
#include "results/system/sha256.h"
#include "results/upkeep/merge.h"
#include "results/upkeep/put_back.h"

namespace dreamsearch {
namespace {

namespace fs = std::filesystem;

// Between two times, and how many times as long as the last one took.
constexpr double kPutBackSeconds = 600;
constexpr double kPutBackShare = 20;

constexpr char kOrigin[] = "origin";  // beside the copy: what the database was
constexpr char kSnapshot[] = "snapshot";

ExitCode CodeOf(const std::error_code& error, ExitCode otherwise) {
  if (error == std::errc::permission_denied || error == std::errc::read_only_file_system) {
    return ExitCode::kPermission;
  }
  if (error == std::errc::no_space_on_device || error == std::errc::io_error ||
      error.value() == EDQUOT) {
    return ExitCode::kInputOutput;
  }
  return otherwise;
}

void CreateFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!error) return;
  throw Failure(CodeOf(error, ExitCode::kCannotCreate),
                "cannot create the folder " + folder.string() + ": " + error.message());
}

// Calls `each` with the path of every regular file below, relative to `folder`.
template <typename Each>
void ForEachFile(const fs::path& folder, Each each) {
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    std::error_code gone;
    if (at->is_regular_file(gone) && !gone) each(at->path().lexically_relative(folder));
  }
}

bool IsSame(const fs::path& a, const fs::path& b) {
  struct stat of_a, of_b;
  return ::stat(a.c_str(), &of_a) == 0 && ::stat(b.c_str(), &of_b) == 0 &&
         of_a.st_size == of_b.st_size && of_a.st_mtim.tv_sec == of_b.st_mtim.tv_sec &&
         of_a.st_mtim.tv_nsec == of_b.st_mtim.tv_nsec;
}

// Whole or not at all, with its time, by which IsSame knows it again.
void CopyFile(const fs::path& from, const fs::path& to) {
  if (IsSame(from, to)) return;
  CreateFolder(to.parent_path());
  struct stat source;
  if (::stat(from.c_str(), &source) != 0) return;  // gone since it was listed
  WriteWholeFile(to, [&](const Append& append) { ReadFile(from, append); });
  const timespec times[2] = {{0, UTIME_OMIT}, source.st_mtim};
  ::utimensat(AT_FDCWD, to.c_str(), times, 0);
}

constexpr char kLock[] = "lock";  // of a run's worker

bool IsOfTheRun(const fs::path& file) {
  return file.filename() != kLock && file.extension() != ".tmp";
}

bool IsCheckpoint(const fs::path& file) { return file.extension() == ".ckpt"; }

fs::path FilesOf(const fs::path& database) { return database.string() + ".files"; }

fs::path FolderOf(const fs::path& database, const fs::path& scratch) {
  return fs::path(AbsolutePath(scratch.string())) /
         ("dreamsearch-" + Sha256Hex(AbsolutePath(database.string())).substr(0, 16));
}

}  // namespace

Scratch::Scratch(const fs::path& database, const fs::path& scratch)
    : database_(AbsolutePath(database.string())), folder_(FolderOf(database, scratch)) {
  CreateFolder(database_.parent_path());
  CreateFolder(folder_);
  if (RunIsLocked(folder_)) {
    throw Failure(ExitCode::kInputOutput, "another command works on the copy of " +
                                              database_.string() + " in " + folder_.string());
  }
  lock_ = LockRun(folder_);
  std::error_code ignored;
  fs::remove_all(folder_ / kSnapshot, ignored);
  const bool left = fs::exists(folder_ / kOrigin);
  if (left) expected_ = ReadWholeFile(folder_ / kOrigin);
  const std::string copy = this->database();
  const std::string taken = copy + ".taken";
  const results::Fingerprint now = results::TakeDatabase(database_.string(), taken);
  if (!left) {
    for (const char* part : {"", "-wal", "-shm", "-journal"}) fs::remove(copy + part, ignored);
    if (!now.empty()) fs::rename(taken, copy);
  } else if (now.empty() && !expected_.empty()) {
    throw Failure(ExitCode::kNotFound,
                  folder_.string() + " has a copy of " + database_.string() +
                      ", which is gone. Put the database back, or delete the copy");
  } else if (now != expected_) {
    // Written by others, or put back by a command that was killed before it could note that.
    results::Merge(results::Database::OpenOrCreate(copy).get(), taken);
  }
  fs::remove(taken, ignored);
  expected_ = now;
  TakeFiles();
  WriteWholeFile(folder_ / kOrigin, expected_);
  put_back_at_ = ActivityClock::Now();
  if (left) {
    std::cerr << "resuming with the copy that a command left in " << folder_.string() << "\n";
  }
}

bool Scratch::HasCopy(const fs::path& database, const fs::path& scratch) {
  std::error_code error;
  return fs::exists(FolderOf(database, scratch) / kOrigin, error);
}

// Finished runs keep theirs where they are, but for trained ones whose evaluation goes on.
void Scratch::TakeFiles() {
  if (!fs::exists(database())) return;
  const auto copy = results::Database::OpenReadOnly(database());
  for (const results::RunInfo& run : copy->ListRuns()) {
    if (run.status == results::RunStatus::kFinished) continue;
    TakeFilesOf(run, /*to_read=*/false);
    if (!run.parent_run_id) continue;
    const std::optional<results::RunInfo> trained = copy->GetRun(*run.parent_run_id);
    if (trained && trained->status == results::RunStatus::kFinished) {
      TakeFilesOf(*trained, /*to_read=*/true);
    }
  }
}

void Scratch::TakeToRead(const std::string& run) {
  const results::RunInfo found = results::Database::OpenReadOnly(database())->GetRun(run);
  if (found.status == results::RunStatus::kFinished) TakeFilesOf(found, /*to_read=*/true);
}

// A run that the copy has further keeps its own.
void Scratch::TakeFilesOf(const results::RunInfo& run, bool to_read) {
  if (to_read && !read_.insert(run.uuid).second) return;
  const fs::path from = results::Database::RunFolderAt(database_.string(), run);
  const fs::path to = FilesOf(database()) / run.uuid;
  ForEachFile(from, [&](const fs::path& file) {
    if (IsOfTheRun(file) && !fs::exists(to / file)) CopyFile(from / file, to / file);
  });
}

// Those that were not have the files that were taken, and others may have changed theirs since.
bool Scratch::IsWorkedOn(const std::string& uuid) const {
  if (read_.count(uuid) > 0) return false;
  const fs::path ours = FilesOf(database()) / uuid, theirs = FilesOf(database_) / uuid;
  return fs::exists(ours / kLock) || !fs::exists(theirs / kRunFile) ||
         !fs::exists(ours / kRunFile) ||
         ReadWholeFile(ours / kRunFile) != ReadWholeFile(theirs / kRunFile);
}

// The files as they are at one moment: links, which keep a checkpoint that its run removes.
void Scratch::Snapshot(const fs::path& snapshot) const {
  const fs::path files = FilesOf(database());
  std::map<std::string, bool> worked_on;  // by UUID
  ForEachFile(files, [&](const fs::path& file) {
    const std::string uuid = file.begin()->string();
    const auto [found, added] = worked_on.try_emplace(uuid);
    if (added) found->second = IsWorkedOn(uuid);
    if (!IsOfTheRun(file) || !found->second) return;
    std::error_code error;
    CreateFolder((snapshot / file).parent_path());
    fs::create_hard_link(files / file, snapshot / file, error);
    if (!error || error == std::errc::file_exists || !fs::exists(files / file)) return;
    CopyFile(files / file, snapshot / file);  // a file system without links
  });
}

void Scratch::PutBack() {
  const double begun = ActivityClock::Now();
  if (!fs::exists(database())) return;
  try {
    const fs::path snapshot = folder_ / kSnapshot;
    fs::remove_all(snapshot);
    // Checkpoints before the rows that name them; those that these rows name, and no rows
    // that a checkpoint which is already gone has seen.
    CreateFolder(snapshot);
    Snapshot(snapshot);
    const fs::path target = FilesOf(database_);
    ForEachFile(snapshot, [&](const fs::path& file) { CopyFile(snapshot / file, target / file); });
    expected_ = results::PutBackDatabase(database(), database_.string(), expected_);
    WriteWholeFile(folder_ / kOrigin, expected_);
    // Older checkpoints, once no row needs them.
    for (const auto& run : fs::directory_iterator(snapshot)) {
      for (const auto& file : fs::directory_iterator(target / run.path().filename())) {
        if (!IsCheckpoint(file.path()) || fs::exists(run.path() / file.path().filename())) continue;
        std::error_code ignored;
        fs::remove(file.path(), ignored);
      }
    }
    fs::remove_all(snapshot);
  } catch (const Failure& error) {
    FailWith(error.what(), error.exit_status());
  } catch (const fs::filesystem_error& error) {
    FailWith(error.what(), static_cast<int>(CodeOf(error.code(), ExitCode::kInputOutput)));
  }
  put_back_at_ = ActivityClock::Now();
  put_back_seconds_ = put_back_at_ - begun;
}

void Scratch::PutBackIfDue() {
  const double pause = std::max(kPutBackSeconds, kPutBackShare * put_back_seconds_);
  if (ActivityClock::Now() - put_back_at_ < pause) return;
  try {
    PutBack();
    said_ = false;
  } catch (const Failure& error) {
    put_back_at_ = ActivityClock::Now();
    if (!said_) std::cerr << "warning: " << error.what() << "\n";
    said_ = true;
  }
}

void Scratch::Finish() {
  PutBack();
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

void Scratch::FailWith(const std::string& why, int code) const {
  throw Failure(static_cast<ExitCode>(code), "the results cannot be put back in the place of " +
                                                 database_.string() + ": " + why +
                                                 ". They are kept in " + folder_.string() +
                                                 ": run the same command on this machine again");
}

}  // namespace dreamsearch
