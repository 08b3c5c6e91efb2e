// probe.h - asks plugins about a run, in a child process, without running it.
//
// The supervisor loads no plugin, but needs a task's figures before it can record
// a run, and for a dry run what its pieces cost on this machine.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "host/settings/settings.h"
#include "results/database/database.h"

namespace dreamsearch {

// Seconds of the pieces a run is made of, measured here and now, and bytes.
struct RunCosts {
  double environment_step = 0;
  double training_decision = 0;           // posterior update and exploring search
  double search_evaluation_decision = 0;  // its share, beside the other episodes
  double actor_evaluation_decision = 0;
  double update = 0;
  double checkpoint_bytes = 0;  // without the replay
  double model_save = 0;        // of them, without writing them
  double replay_row_bytes = 0;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("environment_step", &environment_step);
    (*archive)("training_decision", &training_decision);
    (*archive)("search_evaluation_decision", &search_evaluation_decision);
    (*archive)("actor_evaluation_decision", &actor_evaluation_decision);
    (*archive)("update", &update);
    (*archive)("checkpoint_bytes", &checkpoint_bytes);
    (*archive)("model_save", &model_save);
    (*archive)("replay_row_bytes", &replay_row_bytes);
  }
};

struct RunEstimate {
  double seconds = 0;
  double database_bytes = 0;
  double checkpoint_bytes = 0;  // the last, with its replay
  double file_bytes = 0;        // checkpoints, at their largest
  double memory_bytes = 0;      // resident
};

struct ProbeResult {
  results::TaskInfo task;
  std::map<std::string, std::string> ingredients;  // of the environment
  std::string notice;                              // EnvironmentSpec::notice
  RunCosts costs;                                  // zero unless measured
  double memory_bytes = 0;  // resident, of all but replay and database; zero unless measured

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("task", &task);
    (*archive)("ingredients", &ingredients);
    (*archive)("notice", &notice);
    (*archive)("costs", &costs);
    (*archive)("memory_bytes", &memory_bytes);
  }
};

// How much a probe asks for.
enum class ProbeDepth {
  kTask,        // makes the environment
  kComponents,  // and the model and the planners
  kMemory,      // and has all that a run keeps do each of its pieces, which takes a second
  kCosts,       // and measures how long each takes
};

// What every command grants a probe.
inline constexpr double kProbeTimeoutSeconds = 120;

// Throws Failure with the child's message and exit code; 71 if it crashed, or took longer
// than kProbeTimeoutSeconds of wall time or more memory than `options` give one run.
ProbeResult ProbeRun(const RunSpec& spec, ProbeDepth depth, const ProcessOptions& options);

struct SweepFigures {
  std::vector<results::TaskInfo> tasks;  // one a spec
  std::uint64_t memory_bytes = 0;        // MemoryOfRuns
  std::vector<std::string> notices;      // of the environments, each once
};

// What a sweep's tasks are; their environments' ingredients go into the specs. Makes the
// components of every configuration once, so that nothing is written for settings that do not go
// together: throws Failure 2 for those, and what ProbeRun throws for an environment. Another fault
// of a model or a planner is left to cost its own run.
SweepFigures ProbeSweep(std::vector<RunSpec>* specs, const ProcessOptions& options);

// What the largest of these runs takes, estimated. 0: it could not be measured, or nobody wants to
// know, because the number of runs at once is given or there is one run. `tasks` are theirs: runs
// that have all but their task in common are measured on that with the most observations and
// actions. Where it is empty, on each.
std::uint64_t MemoryOfRuns(const std::vector<RunSpec>& specs,
                           const std::vector<results::TaskInfo>& tasks,
                           const ProcessOptions& options);

// How the ingredients of a recorded run's environment have changed since; empty if they have not
// or it has none. Throws what ProbeRun throws.
std::string ChangedIngredient(const RunSpec& spec, const ProcessOptions& options);

// What the whole run takes at those costs.
RunEstimate EstimateRun(const RunSpec& spec, const ProbeResult& probe);

// Seconds to write so many bytes safely where `database` is or will be. Writes a part of them to
// a file without a name, so that nothing is left. 0 if nothing can be written there.
double SecondsToWrite(double bytes, const std::filesystem::path& database);

// The child's side; reads the run from standard input, answers on descriptor 3.
int ProbeMain();

}  // namespace dreamsearch
