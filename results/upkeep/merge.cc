#include "results/upkeep/merge.h"

#include <unistd.h>

#include <filesystem>
#include <map>

#include "results/system/error.h"
#include "results/text/table.h"
#include "results/upkeep/same_run.h"

namespace dreamsearch::results {
namespace {

// Attached for the lifetime of the object.
class Attached {
 public:
  Attached(Connection* db, const std::string& path) : db_(db) {
    // As a name bound to a parameter, so that any path will do.
    db->Prepare("ATTACH ?1 AS source").Bind(ReadOnlyUri(path)).Run();
  }
  ~Attached() {
    try {
      db_->Execute("DETACH source");
    } catch (const Failure&) {
      // The connection goes away with it.
    }
  }
  Attached(const Attached&) = delete;
  Attached& operator=(const Attached&) = delete;

 private:
  Connection* db_;
};

class Merger {
 public:
  Merger(Database* target, const std::string& source)
      : target_(target), db_(target->connection()), source_(Database::OpenReadOnly(source)) {}

  MergeResult Run() {
    if (source_->path() == target_->path()) {
      throw Failure(ExitCode::kUsage, source_->path() + ": cannot be merged into itself");
    }
    // Parents before the evaluations that name them.
    std::vector<RunInfo> runs = source_->ListRuns();
    std::stable_sort(runs.begin(), runs.end(), [](const RunInfo& a, const RunInfo& b) {
      return !a.parent_run_id && b.parent_run_id;
    });
    const Attached attached(&db_, source_->path());
    db_.Execute(
        "CREATE TEMP TABLE IF NOT EXISTS metric_map (old INTEGER PRIMARY KEY, new INTEGER)");
    MapMetrics();
    for (RunInfo& run : runs) {
      db_.Transact([&] {
        if (ReadAgain(&run)) MergeRun(run);
      });
    }
    db_.Transact([this] { MergePublished(); });
    return result_;
  }

 private:
  void MapMetrics() {
    db_.Transact([this] {
      db_.Execute(
          "DELETE FROM temp.metric_map;"
          "INSERT INTO metric (name, unit, doc) SELECT name, unit, doc FROM source.metric"
          " WHERE true ORDER BY name, unit ON CONFLICT DO NOTHING;"
          "INSERT INTO temp.metric_map SELECT s.metric_id, m.metric_id FROM source.metric s"
          " JOIN main.metric m USING (name, unit)");
    });
  }

  // The run may have gone on, or have ended, since it was listed. All of it that is
  // copied is read in the transaction, which sees the source at one moment. False for
  // a run that was deleted.
  bool ReadAgain(RunInfo* run) {
    Statement row = db_.Prepare(
        "SELECT env_steps_done, status, exit_code, error, ended_utc, heartbeat_utc, result_digest"
        " FROM source.run WHERE run_id = ?1 AND uuid = ?2");
    if (!row.Bind(run->run_id, run->uuid).Step()) return false;
    run->env_steps_done = row.Int(0);
    run->status = ParseRunStatus(row.Text(1));
    run->exit_code = row.OptionalInt(2);
    run->error = row.Text(3);
    run->ended_utc = row.Text(4);
    run->heartbeat_utc = row.Text(5);
    run->result_digest = row.Text(6);
    return true;
  }

  void MergeRun(const RunInfo& run) {
    std::optional<std::int64_t> parent;
    if (run.parent_run_id) {
      const auto found = merged_.find(*run.parent_run_id);
      if (found == merged_.end()) {
        result_.notes.push_back("evaluation " + run.uuid.substr(0, 8) +
                                " is left out: the run it evaluates lost to another of its key.");
        return;
      }
      parent = found->second;
    }
    std::optional<RunInfo> there = ByUuid(run.uuid);
    if (!there) {
      there = target_->FindRun({run.study, run.task, run.planner, run.model, run.config_sha256,
                                run.seed, run.action_repeat, parent});
    }
    std::int64_t run_id = 0;
    if (there) {
      const bool same = there->uuid == run.uuid;
      if (!same) result_.notes.push_back(RunTwice(run, *there));
      if (!StaysOver(run, *there)) {
        ++result_.kept;
        if (same) merged_[run.run_id] = there->run_id;
        return;
      }
      run_id = there->run_id;
      target_->ReplaceRun(run_id, Provenance(run, parent));
      if (!same) {
        // The evaluations below were of the other run.
        for (const RunInfo& child : target_->ListRuns()) {
          if (child.parent_run_id == run_id) target_->DeleteRun(child.run_id);
        }
      }
      ++result_.replaced;
    } else {
      run_id = target_->CreateRun(Provenance(run, parent)).run_id;
      ++result_.added;
    }
    merged_[run.run_id] = run_id;
    db_.Prepare(
           "UPDATE run SET uuid = ?2, env_steps_done = ?3, status = ?4, log_path = ?5,"
           " exit_code = ?6, error = ?7, created_utc = ?8, ended_utc = ?9,"
           " heartbeat_utc = ?10, result_digest = ?11 WHERE run_id = ?1")
        .Bind(run_id, run.uuid, run.env_steps_done, RunStatusName(run.status), Moved(run.log_path),
              run.exit_code, run.error, run.created_utc, Maybe(run.ended_utc),
              Maybe(run.heartbeat_utc), Maybe(run.result_digest))
        .Run();
    CopyRows(run.run_id, run_id);
  }

  std::optional<RunInfo> ByUuid(const std::string& uuid) {
    Statement find = db_.Prepare("SELECT run_id FROM main.run WHERE uuid = ?1");
    if (!find.Bind(uuid).Step()) return std::nullopt;
    return target_->GetRun(find.Int(0));
  }

  static std::optional<std::string> Maybe(const std::string& text) {
    return text.empty() ? std::nullopt : std::optional(text);
  }

  // A path stored relative to the source's folder, as seen from the target.
  std::string Moved(const std::string& path) const {
    if (path.empty() || path[0] == '/') return path;
    const std::filesystem::path folder = std::filesystem::path(source_->path()).parent_path();
    return target_->RelativePath((folder / path).string());
  }

  NewRun Provenance(const RunInfo& run, std::optional<std::int64_t> parent) {
    NewRun copy;
    copy.study_id = target_->Study(run.study);
    db_.Prepare(
           "UPDATE main.study SET"
           " created_utc = min(created_utc, (SELECT created_utc FROM source.study s"
           " WHERE s.name = study.name)),"
           " description = max(description, (SELECT description FROM source.study s"
           " WHERE s.name = study.name)) WHERE study_id = ?1")
        .Bind(copy.study_id)
        .Run();
    copy.task_id = target_->Task(TaskOf(run.task));
    copy.planner = run.planner;
    copy.model = run.model;
    copy.env_plugin = PluginOf(run.env_plugin);
    copy.model_plugin = PluginOf(run.model_plugin);
    copy.planner_plugin = PluginOf(run.planner_plugin);
    copy.config_id = target_->Config(run.config_json);
    copy.preset = run.preset;
    copy.seed = run.seed;
    copy.action_repeat = run.action_repeat;
    copy.env_steps_target = run.env_steps_target;
    copy.parent_run_id = parent;
    copy.argv = run.argv;
    copy.build_id = target_->Build(source_->GetBuild(run.build_id));
    return copy;
  }

  TaskInfo TaskOf(const std::string& name) {
    Statement row = source_->connection().Prepare(
        "SELECT domain, observation_size, action_size, control_seconds, substeps, episode_steps,"
        " return_low, return_high FROM task WHERE name = ?1");
    row.Bind(name).Step();
    return {name,       row.Text(0), row.Int(1),  row.Int(2), row.Real(3),
            row.Int(4), row.Int(5),  row.Real(6), row.Real(7)};
  }
  std::optional<std::int64_t> PluginOf(const std::optional<std::int64_t>& id) {
    if (!id) return std::nullopt;
    return target_->Plugin(source_->GetPlugin(*id));
  }

  void CopyRows(std::int64_t from, std::int64_t to) {
    Statement segments = db_.Prepare(
        "SELECT s.segment, h.hostname, h.cpu, h.cores, h.memory_bytes, h.os, s.build_id FROM"
        " source.segment s JOIN source.host h USING (host_id) WHERE s.run_id = ?1"
        " ORDER BY s.segment");
    Statement copy_segment = db_.Prepare(
        "INSERT INTO main.segment (run_id, segment, host_id, build_id, instruction_set, pid,"
        " from_env_step, to_env_step, started_utc, ended_utc, end_reason, rows_rolled_back,"
        " slurm_job, gflop_per_second, slurm_restarts, slurm_node) SELECT ?2, segment, ?4, ?5,"
        " instruction_set, pid, from_env_step, to_env_step, started_utc, ended_utc, end_reason,"
        " rows_rolled_back, slurm_job, gflop_per_second, slurm_restarts, slurm_node FROM"
        " source.segment WHERE run_id = ?1 AND segment = ?3");
    segments.Bind(from);
    while (segments.Step()) {
      const std::int64_t host = target_->Host(
          {segments.Text(1), segments.Text(2), segments.Int(3), segments.Int(4), segments.Text(5)});
      const std::optional<std::int64_t> build = segments.OptionalInt(6);
      copy_segment
          .Bind(from, to, segments.Int(0), host,
                build ? std::optional(target_->Build(source_->GetBuild(*build))) : std::nullopt)
          .Run();
    }
    // In the order of the keys, so that rows are appended.
    for (const char* sql :
         {"INSERT INTO main.step (run_id, env_step, episode, t, reward, value, plan_us,"
          " simulations, nodes, depth) SELECT ?2, env_step, episode, t, reward, value, plan_us,"
          " simulations, nodes, depth FROM source.step WHERE run_id = ?1 ORDER BY env_step",
          "INSERT INTO main.episode (run_id, phase, episode, env_step, length, episode_return,"
          " wall_s, plan_us_mean, plan_us_p95, model_transitions, digest) SELECT ?2, phase,"
          " episode, env_step, length, episode_return, wall_s, plan_us_mean, plan_us_p95,"
          " model_transitions, digest FROM source.episode WHERE run_id = ?1 ORDER BY phase,"
          " episode",
          "INSERT INTO main.scalar (run_id, metric_id, env_step, value) SELECT ?2, m.new, "
          "s.env_step,"
          " s.value FROM source.scalar s JOIN temp.metric_map m ON m.old = s.metric_id WHERE"
          " s.run_id = ?1 ORDER BY m.new, s.env_step",
          "INSERT INTO main.time_use (run_id, env_step, activity, seconds, processor_seconds,"
          " gflop) SELECT ?2, env_step, activity, seconds, processor_seconds, gflop FROM"
          " source.time_use WHERE run_id = ?1 ORDER BY env_step, activity",
          "INSERT INTO main.event (run_id, seq, env_step, utc, level, kind, detail) SELECT ?2, seq,"
          " env_step, utc, level, kind, detail FROM source.event WHERE run_id = ?1 ORDER BY seq",
          "INSERT INTO main.chunk_digest (run_id, tbl, first_step, last_step, n_rows, digest)"
          " SELECT ?2, tbl, first_step, last_step, n_rows, digest FROM source.chunk_digest WHERE"
          " run_id = ?1"}) {
      db_.Prepare(sql).Bind(from, to).Run();
      result_.rows += db_.Changes();
    }
    Statement artifacts = db_.Prepare(
        "SELECT path, kind, env_step, bytes, sha256 FROM source.artifact WHERE run_id = ?1");
    Statement copy_artifact = db_.Prepare(
        "INSERT INTO main.artifact (run_id, path, kind, env_step, bytes, sha256)"
        " VALUES (?1, ?2, ?3, ?4, ?5, ?6)");
    artifacts.Bind(from);
    while (artifacts.Step()) {
      copy_artifact
          .Bind(to, Moved(artifacts.Text(0)), artifacts.Text(1), artifacts.Int(2), artifacts.Int(3),
                artifacts.Text(4))
          .Run();
    }
  }

  void MergePublished() {
    // Of two rows of one key the lesser stays, whole, so that the order of merging
    // does not matter; what is not known comes last.
    const auto order = [](const std::string& row) {
      std::string terms;
      for (const char* column : {"episode_return", "n_seeds", "seed_sd"}) {
        terms += (terms.empty() ? "(" : ", ") + ("ifnull(" + row) + "." + column + ", 9e999)";
      }
      return terms + ")";
    };
    db_.Execute(
        "INSERT INTO main.published SELECT * FROM source.published WHERE true"
        " ON CONFLICT DO UPDATE SET episode_return = excluded.episode_return,"
        " n_seeds = excluded.n_seeds, seed_sd = excluded.seed_sd WHERE " +
        order("excluded") + " < " + order("published"));
  }

  Database* target_;
  Connection& db_;
  std::unique_ptr<Database> source_;
  std::map<std::int64_t, std::int64_t> merged_;  // run_id of the source to that of the target
  MergeResult result_;
};

}  // namespace

MergeResult Merge(Database* target, const std::string& source) {
  return Merger(target, source).Run();
}

}  // namespace dreamsearch::results
