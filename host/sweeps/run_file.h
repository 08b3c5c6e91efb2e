// run_file.h - run.json: what a run's folder keeps of its job.
#pragma once

#include <filesystem>
#include <vector>

#include "host/processes/worker.h"
#include "host/settings/retry.h"
#include "host/settings/run_spec.h"

namespace dreamsearch {

inline constexpr char kRunFile[] = "run.json";

struct RunFile {
  RunSpec spec;
  bool log_decisions = false;
  bool record_trees = false;
  bool keep_replay = false;
  std::vector<Retry> retries;  // in the order in which they were made

  template <typename Archive>
  void Fields(Archive* archive) {
    spec.Fields(archive);
    (*archive)("log_decisions", &log_decisions);
    (*archive)("record_trees", &record_trees);
    archive->AddedLater("keep_replay", &keep_replay);
    archive->AddedLater("retries", &retries);
  }
};

// Throws Failure 65 if it is gone or not what `runner` wrote.
RunFile ReadRunFile(const std::filesystem::path& folder);

// Throws Failure 73 or 77 if the folder cannot be made, and what WriteWholeFile throws.
void WriteRunFile(const WorkerJob& work);

}  // namespace dreamsearch
