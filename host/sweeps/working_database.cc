#include "host/sweeps/working_database.h"

#include <filesystem>
#include <iostream>
#include <utility>

#include "results/database/database.h"
#include "results/system/error.h"
#include "results/system/file.h"

namespace dreamsearch {

WorkingDatabase::WorkingDatabase(const ProcessOptions& options, bool exists, SweepObserver* display)
    : named_(options.db.string()), observer_(display, &scratch_) {
  if (options.scratch.empty() || options.dry_run) return;
  if (exists && !std::filesystem::exists(options.db) &&
      !Scratch::HasCopy(options.db, options.scratch)) {
    results::Database::OpenExisting(named_);
  }
  scratch_.emplace(options.db, options.scratch);
}

std::string WorkingDatabase::path() const { return scratch_ ? scratch_->database() : named_; }

std::string WorkingDatabase::Name() const {
  const std::string name = AbsolutePath(named_);
  return scratch_ ? name + ", for now in " + scratch_->database() : name;
}

void WorkingDatabase::TakeToRead(const std::string& run) {
  if (scratch_) scratch_->TakeToRead(run);
}

void WorkingDatabase::Finish() {
  if (scratch_ && !std::exchange(finished_, true)) scratch_->Finish();
}

WorkingDatabase::~WorkingDatabase() {
  try {
    Finish();
  } catch (const Failure& error) {
    std::cerr << "warning: " << error.what() << "\n";
  }
}

void WorkingDatabase::Observer::Show(const std::map<std::size_t, ActiveLine>& lines,
                                     const std::string& summary) {
  display_->Show(lines, summary);
  if (*scratch_) (*scratch_)->PutBackIfDue();
}

}  // namespace dreamsearch
