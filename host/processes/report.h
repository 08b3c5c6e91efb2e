// report.h - what a worker tells its supervisor, a line of JSON each.
//
// Reports are for people and for the hang watch. Results go to the database, so
// a lost report loses nothing.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace dreamsearch {

struct Report {
  enum class Kind { kProgress, kError, kDone } kind = Kind::kProgress;
  // kProgress
  std::string stage;
  std::uint64_t env_step = 0;
  double training_return = 0;    // NaN when there is none yet
  double evaluation_return = 0;  // NaN when there is none yet
  std::uint64_t decisions = 1;   // made side by side until the next report
  // kError
  std::string message;
  // kDone
  std::string result_digest;
};

// One line, newline included.
std::string EncodeReport(const Report& report);
// nullopt for a line that is not a report (a plugin may write to any descriptor).
std::optional<Report> DecodeReport(const std::string& line);

}  // namespace dreamsearch
