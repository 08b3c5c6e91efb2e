// results delete - how do runs that nobody needs go?
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <set>
#include <thread>
#include <vector>

#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/system/run_lock.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

// A worker shows one a second.
constexpr std::chrono::milliseconds kHeartbeats{2500};

struct Delete {
  std::vector<std::string> names;
  Selection selection;
  std::string db = kDefaultDatabase;
  bool yes = false, files = false;

  CommandSpec Declare() {
    std::vector<Flag> which = FilterFlags(&selection.filter);
    which.push_back(StatusFlag(&selection.filter));
    return {
        .name = "results delete",
        .summary = "deletes runs and everything they recorded",
        .usage = {"results delete RUN... [flags]",
                  "results delete --study LIST [--env LIST ...] [flags]"},
        .examples = {"results delete 3 4 --yes", "results delete --status failed,crashed"},
        .about =
            "Deleting a run also deletes its evaluations. Without --yes the command only says what "
            "it "
            "would delete.",
        .arguments = {{"", "RUN", Texts(&names),
                       "the run's number or the beginning of its UUID, from `results list`"}},
        .groups = {
            {"Where", {DatabaseFlag(&db)}},
            {"Which runs", std::move(which)},
            {"What to do",
             {{"yes", "", Switch(&yes), "delete"},
              {"files", "", Switch(&files), "delete the runs' checkpoints and logs as well"}}}}};
  }
  int Run();
};

// The runs whose process is alive: a lock says so, if it is on this machine or the file system has
// locks for all; or a heartbeat. The clocks of machines differ: what shows no heartbeat of this
// minute may show the next one.
std::set<std::int64_t> ActiveOf(Database* database, const std::vector<RunInfo>& runs) {
  std::set<std::int64_t> active;
  std::vector<RunInfo> doubtful;
  for (const RunInfo& run : runs) {
    if (RunIsLocked(database->RunFolder(run))) {
      active.insert(run.run_id);
      continue;
    }
    if (run.status != RunStatus::kRunning) continue;
    if (run.heartbeat_age_seconds >= 0 && IsActive(run)) {
      active.insert(run.run_id);
    } else {
      doubtful.push_back(run);
    }
  }
  if (doubtful.empty()) return active;
  std::this_thread::sleep_for(kHeartbeats);
  for (const RunInfo& run : doubtful) {
    const auto now = database->GetRun(run.run_id);
    if (now && now->heartbeat_utc != run.heartbeat_utc) active.insert(run.run_id);
  }
  return active;
}

int Delete::Run() {
  const RunFilter& filter = selection.filter;
  const bool chosen = !filter.studies.empty() || !filter.tasks.empty() ||
                      !filter.planners.empty() || !filter.seeds.empty() || !filter.statuses.empty();
  if (names.empty() != chosen) {
    throw Failure(ExitCode::kUsage,
                  "results delete: expected either runs or a choice with --study, --env, "
                  "--planner, --seed or --status, found " +
                      std::string(chosen ? "both" : "neither"));
  }
  selection.databases = {db};
  OpenSelected(selection);  // every name asked for must be there
  const auto database = Database::OpenExisting(db);
  std::vector<RunInfo> runs;
  if (chosen) {
    runs = database->ListRuns(filter);
  } else {
    for (const std::string& name : names) {
      runs.push_back(database->GetRun(name));
    }
  }
  // What goes with them.
  const std::size_t named = runs.size();
  for (RunInfo& run : database->ListRuns()) {
    const auto is = [](std::int64_t run_id) {
      return [run_id](const RunInfo& other) { return other.run_id == run_id; };
    };
    if (!run.parent_run_id || std::any_of(runs.begin(), runs.end(), is(run.run_id)) ||
        std::none_of(runs.begin(), runs.end(), is(*run.parent_run_id))) {
      continue;
    }
    runs.push_back(std::move(run));
  }
  const std::set<std::int64_t> active = ActiveOf(database.get(), runs);
  for (const RunInfo& run : runs) {
    if (active.count(run.run_id) == 0) continue;
    throw Failure(ExitCode::kUsage,
                  database->path() + ": run " + std::to_string(run.run_id) +
                      (run.parent_run_id
                           ? ", an evaluation of run " + std::to_string(*run.parent_run_id) + ","
                           : "") +
                      " is running; stop it first. Nothing was deleted.");
  }
  for (const RunInfo& run : runs) {
    // It may have gone with a run it evaluates.
    if (yes && database->GetRun(run.run_id)) database->DeleteRun(run.run_id);
    std::cout << (yes ? "deleted" : "would delete") << " run " << run.run_id << "  "
              << run.uuid.substr(0, 8) << "  " << Printable(run.study) << "  "
              << Printable(run.task) << "  " << Printable(run.planner) << "  seed " << run.seed
              << "  " << RunStatusName(run.status);
    if (run.parent_run_id) std::cout << "  evaluation of run " << *run.parent_run_id;
    std::cout << "\n";
    if (yes && files) {
      std::error_code error;
      const std::string folder = database->RunFolder(run);
      if (folder == database->path() + ".files/" + run.uuid) {
        std::filesystem::remove_all(folder, error);
      } else if (std::filesystem::exists(folder, error)) {
        std::cerr << "kept " << folder << ": it belongs to the database it was merged from\n";
      }
      if (error) std::cerr << "warning: " << folder << ": " << error.message() << "\n";
    }
  }
  if (runs.size() > named) {
    std::cerr << runs.size() << " runs, " << runs.size() - named
              << " of them evaluations of the others\n";
  }
  if (!yes) std::cerr << "nothing was deleted; repeat the command with --yes to delete\n";
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command DeleteCommand() { return MakeCommand<Delete>(); }

}  // namespace dreamsearch::results
