// runner status - how far are the runs of a database, or of a sweep on a cluster?
#include <algorithm>
#include <iostream>
#include <map>
#include <optional>
#include <vector>

#include "host/clusters/run_state.h"
#include "host/clusters/slurm.h"
#include "host/clusters/submission.h"
#include "host/commands/commands.h"
#include "host/flags/flags.h"
#include "results/database/database.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/run_lock.h"
#include "results/text/table.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

std::string Label(const results::RunInfo& run, bool with_model) {
  std::string text = run.task + " " + run.planner;
  if (with_model) text += " on " + run.model;
  text += " seed " + std::to_string(run.seed);
  if (run.parent_run_id) text += ", evaluation of " + std::to_string(*run.parent_run_id);
  return text;
}

struct ShowStatus {
  std::string db = kDefaultDatabase;
  std::string folder;
  bool unfinished = false;

  CommandSpec Declare() {
    return {.name = "runner status",
            .summary = "shows which runs of a database are queued, active, stopped or done",
            .usage = {"runner status [--db FILE]", "runner status --folder DIR    of a cluster"},
            .examples = {"runner status --db walker.db", "runner status --folder sweep"},
            .groups = {{"Where",
                        {DatabaseFlag(&db),
                         {"folder", "DIR", Text(&folder),
                          "the folder of a sweep that `runner submit` began, by its databases and "
                          "Slurm's queue"}}},
                       {"What to show",
                        {{"unfinished", "", Switch(&unfinished),
                          "only the runs that are not finished"}}}},
            .exclusive = {{"db", "folder"}}};
  }
  int Run();

 private:
  int OfFolder() const;
};

// Without Slurm the databases alone are read, and that is said.
int ShowStatus::OfFolder() const {
  if (!HasSubmission(folder)) {
    throw Failure(ExitCode::kNotFound, AbsolutePath(folder) +
                                           ": expected a folder in which `runner submit` has begun "
                                           "a sweep, found no submission.json");
  }
  const Submission submission = ReadSubmission(folder);
  std::optional<Queue> queue;
  try {
    queue = AskQueue(submission.Jobs());
  } catch (const Failure& error) {
    std::cerr << "warning: squeue was not asked, so queued runs look missing: " << error.what()
              << "\n";
  }
  std::map<std::string, int> labels;
  for (const SubmittedRun& run : submission.runs) ++labels[run.label];
  results::Table table;
  table.columns = {"run", "state", "steps", "node", "job", "note"};
  std::map<std::string, int> states;
  for (const SubmittedRun& run : submission.runs) {
    const RunCondition condition = ConditionOf(folder, run, queue ? &*queue : nullptr);
    ++states[condition.name()];
    if (unfinished && condition.state == RunState::kFinished) continue;
    // Other settings or another study, of the same label.
    const std::string label = run.label + (labels[run.label] > 1 ? " (" + run.id + ")" : "");
    table.rows.push_back(
        {label, condition.name(),
         GroupDigits(condition.steps) + " of " + GroupDigits(static_cast<std::int64_t>(run.steps)),
         condition.node, condition.job, condition.note});
  }
  if (!table.rows.empty()) std::cout << table.Print(results::TableForm::kText);
  std::cerr << Counted(submission.runs.size(), "run") << ":";
  const char* separator = " ";
  for (const auto& [state, count] : states) {
    std::cerr << separator << count << " " << state;
    separator = ", ";
  }
  std::cerr << "\n";
  return static_cast<int>(ExitCode::kOk);
}

int ShowStatus::Run() {
  if (!folder.empty()) return OfFolder();
  const auto database = results::Database::OpenReadOnly(db);
  const std::vector<results::RunInfo> runs = database->ListRuns();
  const bool models_differ = std::any_of(
      runs.begin(), runs.end(), [&](const auto& run) { return run.model != runs.front().model; });
  results::Table table;
  for (const results::RunInfo& run : runs) {
    if (unfinished && run.status == results::RunStatus::kFinished) continue;
    const bool held = RunIsLocked(database->RunFolder(run));
    std::string state = results::RunStatusName(run.status);
    // A run that says it is running but that nobody holds lost its process.
    if (run.status == results::RunStatus::kRunning && !held) state = "stale";
    std::string note;
    if (held) note = "seen " + FormatDuration(std::max(0.0, run.heartbeat_age_seconds)) + " ago";
    if (!run.error.empty()) note += (note.empty() ? "" : "  ") + run.error;
    table.rows.push_back(
        {run.run_id, Label(run, models_differ), state,
         GroupDigits(run.env_steps_done) + " of " + GroupDigits(run.env_steps_target) + " steps",
         note});
  }
  if (table.rows.empty()) {
    std::cout << (unfinished && !runs.empty() ? "no unfinished runs in " : "no runs in ")
              << database->path() << "\n";
  } else {
    std::cout << table.Print(results::TableForm::kText, 2);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command StatusCommand() { return MakeCommand<ShowStatus>(); }

}  // namespace dreamsearch
