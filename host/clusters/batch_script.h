// batch_script.h - the texts of the batch scripts that a sweep submits.
//
// The script of an array begins its runs one after the other, each with a database and a
// configuration of its own. It hands the first signal on to `runner`, which stops with a
// checkpoint and 75, and then puts its own task back into the queue: Slurm requeues no job for
// its exit status. The script of the merge job makes one database and one page of all runs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace dreamsearch {

// How long before a job's end its script is told, and what Slurm may be early by.
inline constexpr int kNoticeSeconds = 120;
inline constexpr int kEarlySeconds = 60;

// In the sweep's folder: what its plugins are (KnownPlugins).
inline constexpr char kKnownPluginsFile[] = "plugins.json";

// What each task of an array is given.
struct Allocation {
  std::string partition;           // empty: the site's default
  std::string account;             // empty: the user's default
  double time_seconds = 0;         // 0: the partition's limit
  std::uint64_t memory_bytes = 0;  // 0: the site's default
  std::uint32_t cores = 1;
  std::vector<std::string> extra_lines;  // "#SBATCH --qos=long", of every script
};

// The programs and folders that the scripts name, absolute.
struct BatchPlace {
  std::filesystem::path folder;   // of the sweep
  std::filesystem::path working;  // in which the command was given
  std::filesystem::path runner;
  std::filesystem::path results;
  std::string instruction_set;
};

// The lines of a file that begin with #SBATCH; empty ones are passed over. Failure 65 for others,
// and for what the sweep itself must say: --array, --dependency and --chdir.
std::vector<std::string> ExtraLines(const std::filesystem::path& file);

// One task for each list of runs, by their file names. `flags` are of `runner`, beside those that
// say which run it is; `retry` is added where a task has not been restarted.
//   Failure 2  the folder's path is one that no line of #SBATCH can name.
std::string ArrayScript(const BatchPlace& place, const Allocation& allocation,
                        const std::vector<std::vector<std::string>>& tasks,
                        const std::vector<std::string>& flags, bool retry);

// Begins when all `after` have ended, however they did.
std::string MergeScript(const BatchPlace& place, const Allocation& allocation,
                        const std::vector<std::string>& after);

}  // namespace dreamsearch
