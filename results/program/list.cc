// results list - runs, one line each.
#include <cmath>
#include <iostream>

#include "results/program/arguments.h"
#include "results/program/commands.h"

namespace dreamsearch::results {
namespace {

std::string Percent(const RunInfo& run) {
  if (run.env_steps_target <= 0) return Grouped(run.env_steps_done);
  return Grouped(run.env_steps_done) + " / " + Grouped(run.env_steps_target);
}

// The mean return of the newest evaluation, with search where there is one.
Cell LastEvaluation(Connection& db, std::int64_t run_id) {
  for (const int phase : {1, 2}) {
    Statement last = db.Prepare(
        "SELECT avg(episode_return) FROM episode WHERE run_id = ?1 AND phase = ?2 AND env_step ="
        " (SELECT env_step FROM episode WHERE run_id = ?1 AND phase = ?2 ORDER BY episode DESC"
        " LIMIT 1)");
    if (last.Bind(run_id, phase).Step() && !last.IsNull(0)) return last.Real(0);
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

}  // namespace

int ListCommand(const Words& words) {
  Arguments arguments("list", "[options]", "Lists runs, one line each, oldest first.");
  arguments.AddDatabase();
  arguments.AddFilter();
  namespace po = boost::program_options;
  arguments.Add()("status", po::value<std::vector<std::string>>()->value_name("LIST"),
                  "only these: queued, running, finished, interrupted, failed, crashed, diverged, "
                  "killed")(
      "missing", "what each study lacks: every task, planner and seed that occurs in it")(
      "format", po::value<std::string>()->default_value("text"), "text, markdown, csv or json")(
      "out", po::value<std::string>()->default_value(""), "a file (.txt, .md, .csv, .json)");
  if (!arguments.Parse(words)) return kExitOk;
  Selection selection = arguments.GetSelection();
  for (const std::string& status : arguments.List("status")) {
    try {
      selection.filter.statuses.push_back(ParseRunStatus(status));
    } catch (const Error& error) {
      throw Error(kExitUsage, std::string("--status: ") + error.what());
    }
  }
  const auto databases = OpenSelected(selection);
  const bool several = databases.size() > 1;

  Table table;
  if (arguments.Has("missing")) {
    table.columns = {"study", "task", "planner", "model", "seed"};
    for (const auto& database : databases) {
      Statement rows = database->connection().Prepare(
          "SELECT study, task, planner, model, seed FROM v_matrix WHERE status = 'missing'"
          " ORDER BY study, task, planner, model, seed");
      for (auto& row : ReadTable(&rows).rows) table.rows.push_back(std::move(row));
    }
  } else {
    table.columns = {"run",  "uuid",   "study",     "task",       "planner", "model",
                     "seed", "status", "env steps", "last eval.", "seconds", "note"};
    if (several) table.columns.emplace_back("database");
    for (const auto& database : databases) {
      for (const RunInfo& run : database->ListRuns(selection.filter)) {
        std::string note = run.error;
        if (run.parent_run_id) {
          note = "of run " + std::to_string(*run.parent_run_id) + (note.empty() ? "" : "; ") + note;
        }
        table.rows.push_back({run.run_id, run.uuid.substr(0, 8), run.study, run.task, run.planner,
                              run.model, run.seed, std::string(RunStatusName(run.status)),
                              Percent(run), LastEvaluation(database->connection(), run.run_id),
                              Seconds(database->connection(), run.run_id), note});
        if (several) table.rows.back().emplace_back(database->path());
      }
    }
  }
  PrintTable(table, arguments.Get<std::string>("format"), arguments.Get<std::string>("out"));
  if (table.rows.empty()) {
    std::cerr << (arguments.Has("missing") ? "nothing is missing\n" : "no runs\n");
  }
  return kExitOk;
}

}  // namespace dreamsearch::results
