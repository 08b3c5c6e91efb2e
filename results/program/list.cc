// results list - which runs are there, how far are they, and which are missing?
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <sstream>

#include "results/analysis/missing_runs.h"
#include "results/analysis/run_groups.h"
#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

std::string Percent(const RunInfo& run) {
  if (run.env_steps_target <= 0) return GroupDigits(run.env_steps_done);
  return GroupDigits(run.env_steps_done) + " / " + GroupDigits(run.env_steps_target);
}

double FourDigits(double value) {
  return std::strtod(FormatNumber("%.4g", value).c_str(), nullptr);
}

// With long values, such as digests, cut short; `results show` has them whole.
std::string Brief(const std::string& settings) {
  constexpr std::size_t kLongest = 32;
  std::istringstream parts(ShortLabel(settings));
  std::string text, part;
  while (parts >> part) {
    if (Width(part) > kLongest) {
      std::size_t end = kLongest - 3;
      while (end > 0 && (static_cast<unsigned char>(part[end]) & 0xc0) == 0x80) --end;
      part = part.substr(0, end) + "...";
    }
    text += (text.empty() ? "" : " ") + part;
  }
  return text;
}

// The mean return of the newest evaluation, with search where there is one.
Cell LastEvaluation(Connection& db, std::int64_t run_id) {
  for (const int phase : {1, 2}) {
    Statement last = db.Prepare(
        "SELECT avg(episode_return) FROM episode WHERE run_id = ?1 AND phase = ?2 AND env_step ="
        " (SELECT env_step FROM episode WHERE run_id = ?1 AND phase = ?2 ORDER BY episode DESC"
        " LIMIT 1)");
    // Four digits are more than a single evaluation is good for.
    if (last.Bind(run_id, phase).Step() && !last.IsNull(0)) return FourDigits(last.Real(0));
  }
  return {};
}

Cell Seconds(Connection& db, std::int64_t run_id) {
  Statement sum = db.Prepare(
      "SELECT sum(seconds) FROM time_use WHERE run_id = ?1 AND env_step ="
      " (SELECT max(env_step) FROM time_use WHERE run_id = ?1)");
  if (sum.Bind(run_id).Step() && !sum.IsNull(0)) return std::round(sum.Real(0) * 10) / 10;
  return {};
}

struct List {
  Selection selection;
  bool missing = false;
  TableForm form = TableForm::kText;
  std::string out;

  CommandSpec Declare() {
    FlagGroup which = SelectionFlags(&selection);
    which.flags.push_back(StatusFlag(&selection.filter));
    which.flags.push_back(
        {"missing", "", Switch(&missing),
         "list what each study lacks: every combination of its tasks, planners (with each of "
         "their settings) and seeds that has no run in these databases together"});
    return {.name = "results list",
            .summary = "lists runs, one line each, oldest first",
            .examples = {"results list --study first --status failed,crashed"},
            .about =
                "The column `settings` shows the settings in which a planner's runs of a task "
                "differ, the versions of their plugins where those differ, and the first digits of "
                "the digests of a plugin that was built again under one version.",
            .groups = {std::move(which),
                       {"How",
                        {FormFlag(&form),
                         {"out", "FILE", Text(&out),
                          "write the table to this file (.txt, .md, .csv, .json)"}}}}};
  }
  int Run();
};

int List::Run() {
  const RunFilter& filter = selection.filter;
  if (missing && !filter.statuses.empty()) {
    throw Failure(ExitCode::kUsage,
                  "results list: expected --missing or --status, found both; a run that is "
                  "missing has no status");
  }
  const auto databases = OpenSelected(selection);
  const bool several = databases.size() > 1;

  Table table;
  if (missing) {
    table.columns = {"study", "task", "planner", "settings", "model", "seed"};
    for (const MissingRun& run : MissingRuns(databases, filter)) {
      table.rows.push_back(
          {run.study, run.task, run.planner, Brief(run.settings), run.model, run.seed});
    }
  } else {
    table.columns = {"run",  "uuid",   "study",     "task",       "planner", "settings", "model",
                     "seed", "status", "env steps", "last eval.", "seconds", "note"};
    if (several) table.columns.emplace_back("database");
    for (const auto& database : databases) {
      const std::vector<RunInfo> runs = database->ListRuns(filter);
      std::vector<const RunInfo*> pointers;
      for (const RunInfo& run : runs) pointers.push_back(&run);
      const std::vector<std::string> settings = SettingLabels(pointers, Apart::kBuilds);
      for (std::size_t i = 0; i < runs.size(); ++i) {
        const RunInfo& run = runs[i];
        std::string note = run.error;
        if (run.parent_run_id) {
          note = "of run " + std::to_string(*run.parent_run_id) + (note.empty() ? "" : "; ") + note;
        }
        table.rows.push_back({run.run_id, run.uuid.substr(0, 8), run.study, run.task, run.planner,
                              Brief(settings[i]), run.model, run.seed,
                              std::string(RunStatusName(run.status)), Percent(run),
                              LastEvaluation(database->connection(), run.run_id),
                              Seconds(database->connection(), run.run_id), note});
        if (several) table.rows.back().emplace_back(database->path());
      }
    }
  }
  PrintTable(table, form, out);
  if (table.rows.empty()) {
    std::cerr << (missing ? "nothing is missing\n" : "no runs\n");
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command ListCommand() { return MakeCommand<List>(); }

}  // namespace dreamsearch::results
