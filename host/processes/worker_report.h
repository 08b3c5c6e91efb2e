// worker_report.h - what a worker tells its supervisor, a line of JSON each.
//
// Reports are for people and for the hang watch. Results go to the database, so
// a lost report loses nothing.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host/training/run_loop.h"

namespace dreamsearch {

struct WorkerReport {
  enum class Kind : std::uint32_t { kProgress = 0, kError = 1, kDone = 2 };
  Kind kind = Kind::kProgress;
  RunProgress progress;       // kProgress
  std::string message;        // kError
  std::string result_digest;  // kDone

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("kind", &kind);
    (*archive)("progress", &progress);
    (*archive)("message", &message);
    (*archive)("result_digest", &result_digest);
  }
};

// One line, newline included.
std::string EncodeWorkerReport(const WorkerReport& report);
// nullopt for a line that is not a report (a plugin may write to any descriptor).
std::optional<WorkerReport> DecodeWorkerReport(const std::string& line);

}  // namespace dreamsearch
