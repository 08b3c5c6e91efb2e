// results show RUN - what is known about one run?
#include <iostream>
#include <nlohmann/json.hpp>

#include "results/database/query.h"
#include "results/program/commands.h"
#include "results/program/selection.h"
#include "results/system/error.h"
#include "results/text/json_text.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

void Heading(const std::string& text) { std::cout << "\n" << text << "\n"; }

void Query(Connection& db, const std::string& heading, const char* sql, std::int64_t run_id) {
  Statement rows = db.Prepare(sql);
  rows.Bind(run_id);
  const Table table = ReadTable(&rows);
  if (table.rows.empty()) return;
  Heading(heading);
  std::cout << table.Print(TableForm::kText, 2);
}

struct Show {
  std::string name, db = kDefaultDatabase;

  CommandSpec Declare() {
    return {.name = "results show",
            .summary = "shows what is known about one run",
            .examples = {"results show 3"},
            .about = "Shows what the run is, how far it is, how long it took and what happened.",
            .arguments = {{"", "RUN", Text(&name).Required(),
                           "the run's number or the beginning of its UUID, from `results list`"}},
            .groups = {{"Where", {DatabaseFlag(&db)}}}};
  }
  int Run();
};

int Show::Run() {
  const auto database = Database::OpenReadOnly(db);
  const RunInfo run = database->GetRun(name);
  Connection& rows = database->connection();

  std::cout << "run " << run.run_id << "  " << run.uuid << "\n";
  Table facts;
  const auto fact = [&facts](const char* what, const Cell& value) {
    const auto* text = std::get_if<std::string>(&value);
    if (std::holds_alternative<std::monostate>(value) || (text != nullptr && text->empty())) return;
    facts.rows.push_back({std::string(what), value});
  };
  const auto plugin = [&](const std::optional<std::int64_t>& id) -> Cell {
    if (!id) return {};
    const PluginRow info = database->GetPlugin(*id);
    return info.name + " " + info.version + "  " + info.file + "  sha256 " +
           info.sha256.substr(0, 12);
  };
  const BuildInfo build = database->GetBuild(run.build_id);
  fact("database", database->path());
  fact("study", run.study);
  fact("task", run.task);
  fact("planner", run.planner);
  fact("model", run.model);
  fact("seed", std::to_string(run.seed));
  fact("preset", run.preset);
  fact("action repeat", std::to_string(run.action_repeat));
  fact("status", std::string(RunStatusName(run.status)) +
                     (run.exit_code ? ", exit code " + std::to_string(*run.exit_code) : ""));
  fact("error", run.error);
  fact("environment steps",
       GroupDigits(run.env_steps_done) + " of " + GroupDigits(run.env_steps_target));
  if (run.parent_run_id) fact("evaluates run", std::to_string(*run.parent_run_id));
  fact("created", run.created_utc);
  fact("heartbeat", run.heartbeat_utc);
  fact("ended", run.ended_utc);
  fact("result digest", run.result_digest);
  fact("command", ShellCommandOf(run.argv));
  fact("log", run.log_path);
  fact("files", database->RelativePath(database->RunFolder(run)));
  fact("environment plugin", plugin(run.env_plugin));
  fact("model plugin", plugin(run.model_plugin));
  fact("planner plugin", plugin(run.planner_plugin));
  fact("build", build.version + (build.commit.empty() ? "" : " " + build.commit.substr(0, 12)) +
                    (build.dirty ? " with changes" : "") + ", " + build.compiler + ", " +
                    build.instruction_set);
  std::cout << facts.Print(TableForm::kText);

  Query(rows, "Last evaluations (phase 1: with search, 2: the actor alone)",
        "SELECT phase, env_step, avg(episode_return) AS mean, min(episode_return) AS lo,"
        " max(episode_return) AS hi, count(*) AS episodes FROM episode WHERE run_id = ?1 AND"
        " phase > 0 GROUP BY phase, env_step HAVING env_step >= (SELECT max(env_step) FROM episode"
        " e WHERE e.run_id = ?1 AND e.phase = episode.phase) - 0 ORDER BY phase, env_step",
        run.run_id);
  Query(rows, "Last training episodes",
        "SELECT * FROM (SELECT episode, env_step, length, episode_return, wall_s, plan_us_mean,"
        " plan_us_p95, model_transitions FROM episode WHERE run_id = ?1 AND phase = 0"
        " ORDER BY episode DESC LIMIT 5) ORDER BY episode",
        run.run_id);
  Query(rows, "Time",
        "SELECT activity, round(seconds, 1) AS seconds, round(100 * seconds / sum(seconds) OVER (),"
        " 1) AS percent FROM time_use WHERE run_id = ?1 AND env_step = (SELECT max(env_step) FROM"
        " time_use WHERE run_id = ?1) ORDER BY seconds DESC",
        run.run_id);
  Query(rows, "Last values of its metrics",
        "SELECT name, value, unit, env_step, doc FROM (SELECT m.name, s.value, m.unit, s.env_step,"
        " m.doc, max(s.env_step) FROM scalar s JOIN metric m USING (metric_id) WHERE"
        " s.run_id = ?1 GROUP BY s.metric_id) ORDER BY name",
        run.run_id);
  Query(rows, "Segments",
        "SELECT segment, hostname AS host, pid, from_env_step AS \"from\", to_env_step AS \"to\","
        " started_utc AS started, ended_utc AS ended, end_reason AS reason, rows_rolled_back AS"
        " rolled_back, instruction_set, slurm_job, slurm_restarts, slurm_node FROM segment JOIN "
        "host USING (host_id)"
        " WHERE run_id = ?1 ORDER BY segment",
        run.run_id);
  Query(rows, "Events (the last 20)",
        "SELECT * FROM (SELECT seq, env_step, utc, level, kind, detail FROM event WHERE"
        " run_id = ?1 ORDER BY seq DESC LIMIT 20) ORDER BY seq",
        run.run_id);
  Query(
      rows, "Files",
      "SELECT path, kind, env_step, bytes FROM artifact WHERE run_id = ?1 ORDER BY env_step, path",
      run.run_id);

  Heading("Settings (sha256 " + run.config_sha256.substr(0, 12) + ")");
  const nlohmann::json config = ParseJsonOrDiscard(run.config_json);
  if (config.is_structured()) {
    Table settings;
    for (const auto& [key, value] : DottedValues(config)) settings.rows.push_back({key, value});
    std::cout << settings.Print(TableForm::kText, 2);
  } else {
    std::cout << "  " << Printable(run.config_json) << "\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

Command ShowCommand() { return MakeCommand<Show>(); }

}  // namespace dreamsearch::results
