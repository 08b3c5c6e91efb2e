// slurm.h - Slurm's own commands: what they are asked, and what they answer.
//
// Errors   Failure 66 if the command is not on PATH, 74 if it refuses; the message has its own
//          words.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace dreamsearch {

// A job that squeue lists: it waits, runs, or is ending.
struct QueuedJob {
  std::string state;   // "PENDING", "RUNNING", "COMPLETING", ...
  std::string node;    // empty while it waits
  std::string reason;  // why it waits
};

// By the job's name: "12", of an array's task "12_3".
using Queue = std::map<std::string, QueuedJob>;

// Submits a batch script and returns the job's number.
std::string SubmitScript(const std::filesystem::path& script);

// Those of the jobs, by their numbers and without those of tasks, that are in the queue.
Queue AskQueue(const std::vector<std::string>& jobs);

inline constexpr std::uint64_t kDefaultMaxArraySize = 1001;
// Tasks of an array must have numbers less than this; Slurm's default if scontrol does not say.
std::uint64_t MaxArraySize();

// --- what the answers mean ---------------------------------------------------

// The job's number of `sbatch --parsable`: "12", or "12;cluster". Empty if it is something else.
std::string JobNumber(const std::string& answer);
// Lines of "job|task|state|nodes|reason"; others are passed over.
Queue ParseQueue(const std::string& lines);
// From `scontrol show config`.
std::uint64_t ParseMaxArraySize(const std::string& configuration);

}  // namespace dreamsearch
