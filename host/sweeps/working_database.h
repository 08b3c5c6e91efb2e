// working_database.h - in which file does a command keep the database while it works?
//
// In the one that is named, or with --scratch in a copy on this machine, which is put back from
// time to time and at the end (scratch.h). A dry run needs no copy.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "host/processes/supervisor.h"
#include "host/settings/run_options.h"
#include "host/sweeps/scratch.h"

namespace dreamsearch {

class WorkingDatabase {
 public:
  // Throws what Scratch throws; of a command that goes on with what `exists`, also what
  // Database::OpenExisting throws.
  // `display` is told of the progress.
  WorkingDatabase(const ProcessOptions& options, bool exists, SweepObserver* display);
  ~WorkingDatabase();
  WorkingDatabase(const WorkingDatabase&) = delete;
  WorkingDatabase& operator=(const WorkingDatabase&) = delete;

  // The file to open.
  std::string path() const;
  // "/shared/a.db", or "/shared/a.db, for now in /tmp/.../a.db".
  std::string Name() const;
  // Has the files of a run that the command reads where path() is looked for. `run` as GetRun.
  void TakeToRead(const std::string& run);

  // Passes the progress on, and puts the copy back when that is due.
  SweepObserver* observer() { return &observer_; }
  // Puts the copy back and removes it; so does the destructor, which only says what goes wrong. No
  // database of path() may be open.
  void Finish();

 private:
  class Observer : public SweepObserver {
   public:
    Observer(SweepObserver* display, std::optional<Scratch>* scratch)
        : display_(display), scratch_(scratch) {}
    void Show(const std::map<std::size_t, ActiveLine>& lines, const std::string& summary) override;
    void Say(const std::string& message) override { display_->Say(message); }

   private:
    SweepObserver* display_;
    std::optional<Scratch>* scratch_;
  };

  std::string named_;  // as the command named it
  std::optional<Scratch> scratch_;
  bool finished_ = false;
  Observer observer_;
};

}  // namespace dreamsearch
