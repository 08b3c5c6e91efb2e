// runner status - how far are the runs of a database?
#include <algorithm>
#include <iostream>
#include <vector>

#include "host/commands/commands.h"
#include "host/commands/flags.h"
#include "host/processes/run_lock.h"
#include "results/database/database.h"
#include "results/system/error.h"
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

  CommandSpec Declare() {
    return {.name = "runner status",
            .summary = "shows which runs of a database are queued, active, stopped or done",
            .examples = {"runner status --db walker.db"},
            .groups = {{"Where", {DatabaseFlag(&db)}}}};
  }
  int Run();
};

int ShowStatus::Run() {
  const auto database = results::Database::OpenReadOnly(db);
  const std::vector<results::RunInfo> runs = database->ListRuns();
  const bool models_differ = std::any_of(
      runs.begin(), runs.end(), [&](const auto& run) { return run.model != runs.front().model; });
  results::Table table;
  for (const results::RunInfo& run : runs) {
    const bool held = RunIsLocked(database->RunFolder(run));
    std::string state = results::RunStatusName(run.status);
    // A run that says it is running but that nobody holds lost its process.
    if (run.status == results::RunStatus::kRunning && !held) state = "stale";
    std::string note;
    if (held) note = "seen " + FormatDuration(run.heartbeat_age_seconds) + " ago";
    if (!run.error.empty()) note += (note.empty() ? "" : "  ") + run.error;
    table.rows.push_back(
        {run.run_id, Label(run, models_differ), state,
         GroupDigits(run.env_steps_done) + " of " + GroupDigits(run.env_steps_target) + " steps",
         note});
  }
  if (table.rows.empty()) {
    std::cout << "no runs in " << database->path() << "\n";
  } else {
    std::cout << table.Print(results::TableForm::kText, 2);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command StatusCommand() { return MakeCommand<ShowStatus>(); }

}  // namespace dreamsearch
