// Runs and what is asked about them.
#include <sys/random.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>

#include "results/database/database.h"
#include "results/database/derived_rows.h"
#include "results/system/error.h"
#include "results/system/sha256.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

constexpr const char* kStatusNames[] = {"queued", "running", "finished", "interrupted",
                                        "failed", "crashed", "diverged", "killed"};

constexpr char kSelectRun[] =
    "SELECT r.run_id, r.uuid, s.name, t.name, r.planner, r.model, r.env_plugin, r.model_plugin,"
    " r.planner_plugin, r.config_id, c.json, c.sha256, r.preset, r.seed, r.action_repeat,"
    " r.env_steps_target, r.env_steps_done, r.status, r.parent_run_id, r.log_path, r.exit_code,"
    " r.error, r.argv, r.build_id, r.created_utc, r.ended_utc, r.heartbeat_utc, r.result_digest,"
    " (julianday('now') - julianday(r.heartbeat_utc)) * 86400.0,"
    " (SELECT ifnull(max(segment), -1) FROM segment WHERE run_id = r.run_id),"
    " pe.name, pe.version, pe.sha256, pm.name, pm.version, pm.sha256, pp.name, pp.version, "
    "pp.sha256"
    " FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id)"
    " JOIN config c USING (config_id) LEFT JOIN plugin pe ON pe.plugin_id = r.env_plugin"
    " LEFT JOIN plugin pm ON pm.plugin_id = r.model_plugin"
    " LEFT JOIN plugin pp ON pp.plugin_id = r.planner_plugin ";

RunInfo ReadRun(const Statement& row) {
  RunInfo run;
  int i = 0;
  run.run_id = row.Int(i++);
  run.uuid = row.Text(i++);
  run.study = row.Text(i++);
  run.task = row.Text(i++);
  run.planner = row.Text(i++);
  run.model = row.Text(i++);
  run.env_plugin = row.OptionalInt(i++);
  run.model_plugin = row.OptionalInt(i++);
  run.planner_plugin = row.OptionalInt(i++);
  run.config_id = row.Int(i++);
  run.config_json = row.Text(i++);
  run.config_sha256 = row.Text(i++);
  run.preset = row.Text(i++);
  run.seed = row.Int(i++);
  run.action_repeat = row.Int(i++);
  run.env_steps_target = row.Int(i++);
  run.env_steps_done = row.Int(i++);
  run.status = ParseRunStatus(row.Text(i++));
  run.parent_run_id = row.OptionalInt(i++);
  run.log_path = row.Text(i++);
  run.exit_code = row.OptionalInt(i++);
  run.error = row.Text(i++);
  run.argv = row.Text(i++);
  run.build_id = row.Int(i++);
  run.created_utc = row.Text(i++);
  run.ended_utc = row.Text(i++);
  run.heartbeat_utc = row.Text(i++);
  run.result_digest = row.Text(i++);
  run.heartbeat_age_seconds = row.IsNull(i) ? std::numeric_limits<double>::infinity() : row.Real(i);
  run.last_segment = row.Int(++i);
  for (LoadedPlugin& plugin : run.loaded) {
    plugin.name = row.Text(++i);
    plugin.version = row.Text(++i);
    plugin.sha256 = row.Text(++i);
  }
  return run;
}

// "?, ?, ?" for a list bound later, as a JSON array read by json_each.
std::string JsonArray(const std::vector<std::string>& texts) {
  std::string json = "[";
  for (const std::string& text : texts) {
    json += json.size() > 1 ? ",\"" : "\"";
    for (const char c : text) {
      char escaped[8];
      const auto byte = static_cast<unsigned char>(c);
      if (byte < 0x20 || c == '"' || c == '\\') {
        std::snprintf(escaped, sizeof escaped, "\\u%04x", byte);
        json += escaped;
      } else {
        json += c;
      }
    }
    json += '"';
  }
  return json + "]";
}

}  // namespace

const char* RunStatusName(RunStatus status) { return kStatusNames[static_cast<int>(status)]; }

RunStatus ParseRunStatus(const std::string& name) {
  for (int i = 0; i < 8; ++i) {
    if (name == kStatusNames[i]) return static_cast<RunStatus>(i);
  }
  throw Failure(ExitCode::kBadInput,
                "no run status '" + name +
                    "'. Known: queued, running, finished, interrupted, failed, "
                    "crashed, diverged, killed");
}

std::string NewUuid() {
  unsigned char bytes[16];
  if (getrandom(bytes, sizeof bytes, 0) != sizeof bytes) {
    throw Failure(ExitCode::kInternal, "getrandom gave no random bytes for a UUID");
  }
  bytes[6] = static_cast<unsigned char>((bytes[6] & 0x0f) | 0x40);
  bytes[8] = static_cast<unsigned char>((bytes[8] & 0x3f) | 0x80);
  std::string text;
  for (int i = 0; i < 16; ++i) {
    char hex[3];
    std::snprintf(hex, sizeof hex, "%02x", bytes[i]);
    if (i == 4 || i == 6 || i == 8 || i == 10) text += '-';
    text += hex;
  }
  return text;
}

std::optional<RunInfo> Database::FindRun(const RunKey& key) {
  Statement find = connection_->Prepare(
      std::string(kSelectRun) +
      "WHERE s.name = ?1 AND t.name = ?2 AND r.planner = ?3 AND r.model = ?4 AND c.sha256 = ?5 AND"
      " r.seed = ?6 AND r.action_repeat = ?7 AND r.parent_run_id IS ?8");
  if (!find.Bind(key.study, key.task, key.planner, key.model, key.config_sha256, key.seed,
                 key.action_repeat, key.parent_run_id)
           .Step()) {
    return std::nullopt;
  }
  return ReadRun(find);
}

CreatedRun Database::CreateRun(const NewRun& run) {
  CreatedRun result;
  connection_->Transact([&] {
    Statement find = connection_->Prepare(
        "SELECT run_id, uuid FROM run WHERE study_id = ?1 AND task_id = ?2 AND planner = ?3 AND"
        " model = ?4 AND config_id = ?5 AND seed = ?6 AND action_repeat = ?7 AND"
        " parent_run_id IS ?8");
    if (find.Bind(run.study_id, run.task_id, run.planner, run.model, run.config_id, run.seed,
                  run.action_repeat, run.parent_run_id)
            .Step()) {
      result = {find.Int(0), find.Text(1), false};
      return;
    }
    const std::string uuid = NewUuid();
    connection_
        ->Prepare(
            "INSERT INTO run (uuid, study_id, task_id, planner, model, env_plugin, model_plugin,"
            " planner_plugin, config_id, preset, seed, action_repeat, env_steps_target,"
            " parent_run_id, log_path, log_path_sha256, argv, build_id, created_utc) VALUES (?1,"
            " ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, sha256(?15), ?16, ?17,"
            " ?18)")
        .Bind(uuid, run.study_id, run.task_id, run.planner, run.model, run.env_plugin,
              run.model_plugin, run.planner_plugin, run.config_id, run.preset, run.seed,
              run.action_repeat, run.env_steps_target, run.parent_run_id,
              RelativePath(NewRunFolder(path(), uuid) + "/" + run.log_name), run.argv, run.build_id,
              UtcNow())
        .Run();
    result = {connection_->LastInsertId(), uuid, true};
  });
  return result;
}

bool Database::SetRunStatus(std::int64_t run_id, RunStatus status, std::optional<int> exit_code,
                            const std::string& error, const std::optional<WorkerInfo>& worker) {
  const bool ended = status != RunStatus::kQueued && status != RunStatus::kRunning;
  const std::string name = RunStatusName(status);
  bool taken_over = false;
  connection_->Transact([&] {
    if (worker) {
      Statement last = connection_->Prepare(
          "SELECT ifnull(max(segment), -1), pid FROM segment WHERE run_id = ?1");
      last.Bind(run_id).Step();
      const std::int64_t segment = last.Int(0);
      const bool own = segment > worker->after_segment && last.Int(1) == worker->pid;
      taken_over = segment != worker->after_segment && !own;
      if (taken_over) return;
    }
    const std::string now = UtcNow();
    connection_
        ->Prepare(
            "UPDATE run SET status = ?2, exit_code = ?3, error = ?4, ended_utc = ?5"
            " WHERE run_id = ?1")
        .Bind(run_id, name, exit_code, error, ended ? std::optional(now) : std::nullopt)
        .Run();
    if (connection_->Changes() != 1) {
      if (worker) {
        taken_over = true;
        return;
      }
      throw Failure(ExitCode::kNotFound, path() + ": there is no run " + std::to_string(run_id));
    }
    UnsealRecord(*connection_, run_id);
    if (!ended) return;
    connection_
        ->Prepare(
            "UPDATE segment SET ended_utc = ?2, end_reason = ?3, to_env_step ="
            " (SELECT env_steps_done FROM run WHERE run_id = ?1)"
            " WHERE run_id = ?1 AND ended_utc IS NULL")
        .Bind(run_id, now, name)
        .Run();
    SealRecord(*connection_, run_id);
  });
  return !taken_over;
}

void Database::ReplaceRun(std::int64_t run_id, const NewRun& run) {
  connection_->Transact([&] {
    Statement find = connection_->Prepare("SELECT uuid FROM run WHERE run_id = ?1");
    if (!find.Bind(run_id).Step()) {
      throw Failure(ExitCode::kNotFound, path() + ": there is no run " + std::to_string(run_id));
    }
    const std::string uuid = find.Text(0);
    find.Reset();
    // The bins go first, so that no trigger maintains what is about to vanish.
    for (const char* table : {"curve_bin", "chunk_digest", "step", "episode", "scalar", "time_use",
                              "event", "artifact", "segment"}) {
      connection_->Prepare(std::string("DELETE FROM ") + table + " WHERE run_id = ?1")
          .Bind(run_id)
          .Run();
    }
    connection_
        ->Prepare(
            "UPDATE run SET study_id = ?2, task_id = ?3, planner = ?4, model = ?5,"
            " env_plugin = ?6, model_plugin = ?7, planner_plugin = ?8, config_id = ?9,"
            " preset = ?10, seed = ?11, action_repeat = ?12, env_steps_target = ?13,"
            " parent_run_id = ?14, argv = ?15, build_id = ?16, env_steps_done = 0,"
            " status = 'queued', exit_code = NULL, error = '', ended_utc = NULL,"
            " heartbeat_utc = NULL, result_digest = NULL, log_path = ?17,"
            " log_path_sha256 = sha256(?17) WHERE run_id = ?1")
        .Bind(run_id, run.study_id, run.task_id, run.planner, run.model, run.env_plugin,
              run.model_plugin, run.planner_plugin, run.config_id, run.preset, run.seed,
              run.action_repeat, run.env_steps_target, run.parent_run_id, run.argv, run.build_id,
              RelativePath(NewRunFolder(path(), uuid) + "/" + run.log_name))
        .Run();
  });
}

void Database::DeleteRun(std::int64_t run_id) {
  connection_->Transact([&] {
    // The bins go first, so that no trigger maintains what is about to vanish.
    connection_
        ->Prepare(
            "DELETE FROM curve_bin WHERE run_id IN (SELECT run_id FROM run WHERE run_id = ?1"
            " OR parent_run_id = ?1)")
        .Bind(run_id)
        .Run();
    connection_->Prepare("DELETE FROM run WHERE run_id = ?1").Bind(run_id).Run();
    if (connection_->Changes() != 1) {
      throw Failure(ExitCode::kNotFound, path() + ": there is no run " + std::to_string(run_id));
    }
  });
}

std::vector<RunInfo> Database::ListRuns(const RunFilter& filter) {
  std::vector<std::string> seeds, statuses;
  for (const std::int64_t seed : filter.seeds) seeds.push_back(std::to_string(seed));
  for (const RunStatus status : filter.statuses) statuses.emplace_back(RunStatusName(status));
  Statement rows = connection_->Prepare(
      std::string(kSelectRun) +
      "WHERE (?1 = '[]' OR s.name IN (SELECT value FROM json_each(?1)))"
      " AND (?2 = '[]' OR t.name IN (SELECT value FROM json_each(?2)))"
      " AND (?3 = '[]' OR r.planner IN (SELECT value FROM json_each(?3)))"
      " AND (?4 = '[]' OR CAST(r.seed AS TEXT) IN (SELECT value FROM json_each(?4)))"
      " AND (?5 = '[]' OR r.status IN (SELECT value FROM json_each(?5)))"
      " AND (?6 OR (r.parent_run_id IS NULL AND r.env_steps_target > 0)) ORDER BY r.run_id");
  rows.Bind(JsonArray(filter.studies), JsonArray(filter.tasks), JsonArray(filter.planners),
            JsonArray(seeds), JsonArray(statuses), filter.with_evaluations);
  std::vector<RunInfo> runs;
  while (rows.Step()) runs.push_back(ReadRun(rows));
  return runs;
}

std::string Database::LastWorker(std::int64_t run_id) {
  Statement last = connection_->Prepare(
      "SELECT pid, hostname FROM segment JOIN host USING (host_id) WHERE run_id = ?1"
      " ORDER BY segment DESC LIMIT 1");
  if (!last.Bind(run_id).Step()) return "another process";
  return "process " + std::to_string(last.Int(0)) + " of " + last.Text(1);
}

std::optional<RunInfo> Database::GetRun(std::int64_t run_id) {
  Statement find = connection_->Prepare(std::string(kSelectRun) + "WHERE r.run_id = ?1");
  if (!find.Bind(run_id).Step()) return std::nullopt;
  return ReadRun(find);
}

RunInfo Database::GetRun(const std::string& id_or_uuid) {
  const bool number = !id_or_uuid.empty() && id_or_uuid.size() < 10 &&
                      std::all_of(id_or_uuid.begin(), id_or_uuid.end(),
                                  [](char c) { return c >= '0' && c <= '9'; });
  if (number) {
    if (std::optional<RunInfo> run = GetRun(std::int64_t{std::stol(id_or_uuid)})) return *run;
  }
  std::vector<RunInfo> matches;
  if (id_or_uuid.size() >= 4) {
    Statement find =
        connection_->Prepare(std::string(kSelectRun) + "WHERE substr(r.uuid, 1, length(?1)) = ?1");
    find.Bind(id_or_uuid);
    while (find.Step()) matches.push_back(ReadRun(find));
  }
  if (matches.size() == 1) return matches.front();
  if (matches.size() > 1) {
    throw Failure(ExitCode::kUsage, path() + ": run '" + id_or_uuid +
                                        "' is ambiguous: " + matches[0].uuid + " and " +
                                        matches[1].uuid + " begin with it.");
  }
  const std::int64_t count = connection_->QueryInt("SELECT count(*) FROM run").value_or(0);
  const std::int64_t last = connection_->QueryInt("SELECT max(run_id) FROM run").value_or(0);
  throw Failure(ExitCode::kNotFound,
                path() + ": no run '" + id_or_uuid + "'. Expected a run_id or the " +
                    "beginning of a UUID (4 characters or more); there are " +
                    std::to_string(count) + " runs" +
                    (count > 0 ? ", the last is " + std::to_string(last) : "") + ". See " +
                    CommandOn("results list", path()) + ".");
}

std::vector<EpisodeInfo> Database::ListEpisodes(std::int64_t run_id) {
  Statement rows = connection_->Prepare(
      "SELECT phase, episode, length, episode_return, plan_us_mean, model_transitions"
      " FROM episode WHERE run_id = ?1 ORDER BY phase, episode");
  rows.Bind(run_id);
  std::vector<EpisodeInfo> episodes;
  while (rows.Step()) {
    EpisodeInfo episode;
    episode.phase = static_cast<int>(rows.Int(0));
    episode.episode = rows.Int(1);
    episode.length = rows.Int(2);
    if (!rows.IsNull(3)) episode.episode_return = rows.Real(3);
    episode.plan_us_mean = rows.IsNull(4) ? 0 : rows.Real(4);
    episode.model_transitions = rows.Int(5);
    episodes.push_back(episode);
  }
  return episodes;
}

std::optional<double> Database::LastScalar(std::int64_t run_id, const std::string& metric) {
  Statement find = connection_->Prepare(
      "SELECT value FROM scalar JOIN metric USING (metric_id) WHERE run_id = ?1 AND name = ?2 "
      "ORDER BY env_step DESC LIMIT 1");
  if (!find.Bind(run_id, metric).Step() || find.IsNull(0)) return std::nullopt;
  return find.Real(0);
}

std::string Database::LastArtifact(std::int64_t run_id, const std::string& kind) {
  Statement find = connection_->Prepare(
      "SELECT path FROM artifact WHERE run_id = ?1 AND kind = ?2 ORDER BY env_step DESC LIMIT 1");
  if (!find.Bind(run_id, kind).Step()) return "";
  return (std::filesystem::path(path()).parent_path() / find.Text(0)).string();
}

void Database::AddEvent(std::int64_t run_id, std::int64_t env_step, const std::string& level,
                        const std::string& kind, const std::string& detail) {
  connection_->Transact([&] {
    connection_
        ->Prepare(
            "INSERT INTO event SELECT ?1, (SELECT ifnull(max(seq) + 1, 0) FROM event"
            " WHERE run_id = ?1), ?2, ?3, ?4, ?5, ?6")
        .Bind(run_id, env_step, UtcNow(), level, kind, detail)
        .Run();
    if (ReadRecord(*connection_, run_id)) SealRecord(*connection_, run_id);
  });
}

std::string Database::ComputeResultDigest(std::int64_t run_id) {
  Statement rows = connection_->Prepare(
      "SELECT phase, episode, env_step, length, episode_return, digest FROM episode"
      " WHERE run_id = ?1 ORDER BY phase, episode");
  std::string bytes = "dreamsearch result 1\n";
  // Little-endian whatever the machine, a return that is not finite as a quiet NaN.
  const auto append = [&bytes](std::uint64_t word) {
    for (int shift = 0; shift < 64; shift += 8) bytes += static_cast<char>(word >> shift);
  };
  rows.Bind(run_id);
  while (rows.Step()) {
    for (int i = 0; i < 4; ++i) append(static_cast<std::uint64_t>(rows.Int(i)));
    const double value = rows.IsNull(4) ? std::numeric_limits<double>::quiet_NaN() : rows.Real(4);
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    append(bits);
    append(static_cast<std::uint64_t>(rows.Int(5)));
  }
  return Sha256Hex(bytes);
}

}  // namespace dreamsearch::results
