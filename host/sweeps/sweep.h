// sweep.h - from resolved runs to jobs in a database.
//
// Decides for each run of a matrix whether this command starts, resumes, skips or refuses
// it, and records what is to be run.
#pragma once

#include <string>
#include <vector>

#include "host/processes/supervisor.h"
#include "host/settings/run_options.h"
#include "host/settings/settings.h"
#include "host/sweeps/probe.h"
#include "results/database/database.h"
#include "results/system/error.h"

namespace dreamsearch {

// "walker_walk mcts_pw seed 0", with the model where it is not what a training takes
// if none is named; an
// evaluation says so.
std::string RunLabel(const RunSpec& spec);

// The key under which the database knows the run.
results::RunKey KeyOf(const RunSpec& spec);

enum class SweepAction {
  kStart,
  kResume,
  kStartOver,
  kSkipFinished,
  kSkipFailed,
  kSkipActive,
  kRefused,  // begun with other plugins or files, or its checkpoints do not continue it
};
bool IsWork(SweepAction action);

struct PlannedRun {
  RunSpec spec;
  SweepAction action = SweepAction::kStart;
  std::int64_t run_id = 0;           // 0: not recorded yet
  std::string note;                  // why it is skipped or starts over, or where it resumes
  ExitCode refusal = ExitCode::kOk;  // what a refused run makes the command end with
  bool changed = false;              // of a failed one: it starts over with --replace
};

// Decides for each run whether this command starts, resumes, skips or refuses it. Writes nothing;
// `database` may be null (no file yet). An unfinished run whose plugins or files changed or that
// has lost its checkpoints is refused, unless options.replace: then it starts over. So is a new
// seed beside finished ones that other plugins made, which would be one line with them, unless
// options.replace.
std::vector<PlannedRun> PlanSweep(results::Database* database, const ProcessOptions& options,
                                  const std::vector<RunSpec>& specs);

// Says which runs are skipped or refused, and why. Returns the exit code of the first
// of them that failed before, 0 if none did.
int SaySkipped(results::Database* database, const std::vector<PlannedRun>& planned);

// What the command ends with: 75 if it was stopped, else the code of the first run that
// was refused, else what its jobs ended with.
int SweepStatus(const std::vector<PlannedRun>& planned, const SweepResult& result);

// Records the planned runs and returns the jobs for those to be worked on, in
// order. tasks: one a spec, from ProbeRun.
std::vector<SweepJob> RecordSweep(results::Database* database, const ProcessOptions& options,
                                  const std::vector<PlannedRun>& runs,
                                  const std::vector<results::TaskInfo>& tasks,
                                  const std::vector<std::string>& argv);

// What a recorded run was to do, from the run.json in its folder; to be read, not to be run.
// Throws Failure 66 if that is gone, 65 if it is not what `runner` wrote.
RunSpec RecordedSpec(results::Database* database, const results::RunInfo& run);

// The same to be run: its code is that of TrustRecordedCode, and what that throws.
RunSpec TrustedSpec(results::Database* database, const results::RunInfo& run,
                    const TrustedCode& trusted);

// The checkpoint of the trained run that an evaluation names; empty if it names none.
std::filesystem::path AgentCheckpoint(results::Database* database, const RunSpec& spec);

// Of a run whose lock another process holds: who it is and since when it has recorded nothing, if
// that is longer than any worker is busy; else empty.
inline constexpr double kSilentSeconds = 300;
std::string SilentWorker(results::Database* database, const results::RunInfo& run);

// The job of a recorded run. Throws what TrustedSpec and FindResumption throw, and 69 if
// a plugin, a file that its settings name or an ingredient of its environment has changed.
// With options.retry a diverged run is given its next Retry, which is recorded in its run.json
// unless options.dry_run.
SweepJob RecordedJob(results::Database* database, const ProcessOptions& options,
                     const results::RunInfo& run);

}  // namespace dreamsearch
