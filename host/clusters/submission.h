// submission.h - the folder of a submitted sweep, and its record of what was submitted.
//
//   DIR/submission.json   the record
//   DIR/runs/ID.cfg       a configuration file that is exactly one run
//   DIR/runs/ID.db        the run's database
//   DIR/jobs/, DIR/logs/  batch scripts, and what their jobs wrote
//   DIR/all.db            all runs, DIR/report.html their page: by the merge job
//
// ID is the beginning of a digest of the run's key, so that the same run has the same files
// whoever submits it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "host/settings/run_spec.h"

namespace dreamsearch {

struct SubmittedRun {
  std::string id;
  std::string label;  // "walker_walk mcts_pw seed 0"
  std::uint64_t steps = 0;
  std::string job;  // the task of an array that has it, "12_3"; empty: it was not submitted yet

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("id", &id);
    (*archive)("label", &label);
    (*archive)("steps", &steps);
    (*archive)("job", &job);
  }
};

struct Submission {
  std::string instruction_set;  // of all runs, so that every node can resume them
  std::vector<SubmittedRun> runs;
  std::vector<std::string> arrays;  // numbers of jobs
  std::string merge_job;            // the last one; empty: none

  // Adds the run if it is not there. Addresses hold until the next one is added.
  SubmittedRun* Run(const std::string& id);
  // The arrays and the merge job.
  std::vector<std::string> Jobs() const;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("instruction_set", &instruction_set);
    (*archive)("runs", &runs);
    (*archive)("arrays", &arrays);
    (*archive)("merge_job", &merge_job);
  }
};

// 16 hexadecimal digits.
std::string RunFileName(const RunSpec& spec);
std::filesystem::path RunDatabase(const std::filesystem::path& folder, const std::string& id);
std::filesystem::path RunConfiguration(const std::filesystem::path& folder, const std::string& id);

// Whether there is a record; the record, which is empty if there is none. Failure 65 if it is not
// what `runner submit` writes.
bool HasSubmission(const std::filesystem::path& folder);
Submission ReadSubmission(const std::filesystem::path& folder);
void WriteSubmission(const std::filesystem::path& folder, const Submission& submission);

// The flags that resolve to this run and no other, one a line, as --config reads them.
std::string ConfigurationText(const RunSpec& spec);

}  // namespace dreamsearch
