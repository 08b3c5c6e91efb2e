// run_groups.h - which runs are the same experiment with other seeds.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "results/database/database.h"

namespace dreamsearch::results {

// Which episodes a curve or score is of. kEvaluation is the evaluation with the
// planner where a run has one, else that with the actor alone.
enum class CurvePhase { kEvaluation, kTraining, kSearchEvaluation, kActorEvaluation };

struct GroupedRun {
  RunInfo run;
  Database* database = nullptr;
  int phase = 0;                   // as in `episode`: what the request comes to for this run
  std::vector<std::string> notes;  // of records of the same experiment that gave way (RunTwice)
};

// The runs that trained; evaluations of trained runs are left out. A run that is in several
// databases counts once, and so does an experiment that was done twice: of its records one
// stays, as if the databases had been merged. `phase` is not set.
//   Failure 65  a task of these runs has other values in two of the databases.
std::vector<GroupedRun> TrainedRuns(const std::vector<std::unique_ptr<Database>>& databases,
                                    const RunFilter& filter);

// Runs of one task that have everything in common but the seed, and but the builds of equal
// versions of plugins.
struct RunGroup {
  std::string task;
  std::string planner;
  std::size_t planner_rank = 0;  // its place in the order in which planners are listed
  // "mcts_pw", with the model and study where others have other ones, and with the action repeat,
  // the settings and the versions in which runs of the planner differ on some task. "(2 builds)"
  // if its runs, of all tasks, have so many builds of one version of a plugin. Equal over tasks for
  // equal experiments.
  std::string label;
  std::optional<double> return_low, return_high;
  std::vector<GroupedRun> runs;  // by seed
};

// Groups TrainedRuns by task, then in the order in which the planners were first recorded.
std::vector<RunGroup> GroupRuns(const std::vector<std::unique_ptr<Database>>& databases,
                                const RunFilter& filter, CurvePhase phase);

// The labels of the groups, each once, in the order of the planners.
std::vector<std::string> OrderedLabels(const std::vector<RunGroup>& groups);

// Up to what runs are told apart: settings; versions of their plugins too, as lines are; or also
// builds of one version, files with other digests.
enum class Apart { kSettings, kVersions, kBuilds };

// What tells runs of a planner apart, for each of these runs: "k=5 model.version="2.0.0"", the
// settings in which the planner's runs on the same model differ on some task and which this run
// has, then its versions and builds where others have others of the same component. Empty where
// none do.
// Evaluations are told from each other, not from trained runs.
std::vector<std::string> SettingLabels(const std::vector<const RunInfo*>& runs, Apart apart);

// A label with the settings' own names alone, for where there is little room:
// "model.parameters.norm=none" as "norm=none", unless two would end alike.
std::string ShortLabel(const std::string& label);

// Which `episode.phase` a request comes to for this run.
int PhaseOf(Connection& db, std::int64_t run_id, CurvePhase phase);

// Why there is no group: an empty choice, or evaluations alone, and where those show.
std::string NothingToGroup(const std::vector<std::unique_ptr<Database>>& databases,
                           const RunFilter& filter);

// "failed at 12,000 of 60,000 steps" if the run did not finish, else "".
std::string Unfinished(const RunInfo& run);

}  // namespace dreamsearch::results
