// scratch.h - a database whose runs are worked on in a folder of this machine.
//
// The database and the files of its unfinished runs are copied to a folder below --scratch, worked
// on there, and put back: from time to time, and at the end. Files go first and the database last,
// by one rename, so that whoever is killed in between leaves the old state or the new one. After
// a kill the copy stays, and the same command on the same machine goes on with it. Of files only
// those of runs are put back that were worked on in the copy: the others are somebody else's.
//
// Threads  one thread uses it.
// Errors   Failure; 74 if the copy cannot be put back, and then it stays.
#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "results/database/database.h"
#include "results/system/file_descriptor.h"

namespace dreamsearch {

class Scratch {
 public:
  // Brings the copy up to date: new, or what a killed command left, with what others have
  // written to `database` since. Failure 74 if another command works on the copy.
  Scratch(const std::filesystem::path& database, const std::filesystem::path& scratch);
  // A killed command has left a copy.
  static bool HasCopy(const std::filesystem::path& database, const std::filesystem::path& scratch);

  // The copy.
  std::string database() const { return (folder_ / database_.filename()).string(); }

  // Has the files of a run in the copy that is read there and not worked on. `run` as
  // Database::GetRun, and what that throws.
  void TakeToRead(const std::string& run);

  // May be called while workers write to the copy.
  void PutBack();
  // The same if it has not been done for a while. What goes wrong is said once, and tried again.
  void PutBackIfDue();
  // Puts back and removes the copy.
  void Finish();

 private:
  void TakeFiles();
  void TakeFilesOf(const results::RunInfo& run, bool to_read);
  bool IsWorkedOn(const std::string& uuid) const;
  void Snapshot(const std::filesystem::path& snapshot) const;
  [[noreturn]] void FailWith(const std::string& why, int code) const;

  std::filesystem::path database_;  // absolute
  std::filesystem::path folder_;    // of the copy
  FileDescriptor lock_;
  std::set<std::string> read_;  // UUIDs of runs whose files are not put back
  std::string expected_;  // what the database was when it was last copied (results::Fingerprint)
  double put_back_at_ = 0;
  double put_back_seconds_ = 0;  // the last time
  bool said_ = false;
};

}  // namespace dreamsearch
