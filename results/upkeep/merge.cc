#include "results/upkeep/merge.h"

#include <sqlite3.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <utility>

#include "results/database/schema.h"
#include "results/system/error.h"
#include "results/text/table.h"
#include "results/upkeep/run_copies.h"
#include "results/upkeep/same_run.h"
#include "results/upkeep/verification.h"

namespace dreamsearch::results {
namespace {

// How long other writers wait at a time.
constexpr std::chrono::milliseconds kMoment{500};

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

// A path that is stored in the database `source`, as `target` stores it.
std::string MovedPath(const std::string& path, const std::string& source, const Database& target) {
  if (path.empty() || path[0] == '/') return path;
  return target.RelativePath((std::filesystem::path(source).parent_path() / path).string());
}

// Every row that is copied refers to a row that is there, so they are not looked up one by one.
class ForeignKeysTrusted {
 public:
  explicit ForeignKeysTrusted(Connection* db) : db_(db) {
    db_->Execute("PRAGMA foreign_keys = OFF");
  }
  ~ForeignKeysTrusted() {
    sqlite3_exec(db_->handle(), "PRAGMA foreign_keys = ON", nullptr, nullptr, nullptr);
  }
  ForeignKeysTrusted(const ForeignKeysTrusted&) = delete;
  ForeignKeysTrusted& operator=(const ForeignKeysTrusted&) = delete;

 private:
  Connection* db_;
};

class Merger {
 public:
  Merger(Database* target, Database* source, const MergeSettings& settings)
      : target_(target), db_(target->connection()), source_(source), settings_(settings) {}

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
    db_.AddFunction("merged_path",
                    [source = source_->path(), target = target_](const std::string& path) {
                      return MovedPath(path, source, *target);
                    });
    db_.Execute(
        "CREATE TEMP TABLE IF NOT EXISTS host_map (old INTEGER PRIMARY KEY, new INTEGER);"
        "CREATE TEMP TABLE IF NOT EXISTS build_map (old INTEGER PRIMARY KEY, new INTEGER)");
    MapMetrics();
    PrepareCopies();
    const ForeignKeysTrusted trusted(&db_);
    // Several runs a transaction, for a moment in which others wait.
    for (auto run = runs.begin(); run != runs.end();) {
      db_.Transact([&] {
        const auto begin = std::chrono::steady_clock::now();
        do {
          if (ReadAgain(&*run)) MergeRun(*run);
          ++run;
        } while (run != runs.end() && std::chrono::steady_clock::now() - begin < kMoment);
      });
    }
    db_.Transact([this] { MergePublished(); });
    return result_;
  }

 private:
  void MapMetrics() {
    db_.Transact([this] {
      db_.Execute(
          "INSERT INTO metric (name, unit, doc, doc_sha256) SELECT name, unit, doc, doc_sha256"
          " FROM source.metric WHERE true ORDER BY name, unit ON CONFLICT DO NOTHING");
      Statement rows = db_.Prepare(
          "SELECT m.metric_id, s.metric_id FROM source.metric s JOIN main.metric m USING (name,"
          " unit)");
      while (rows.Step()) metrics_[rows.Int(0)] = rows.Int(1);
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
      if (!target_->GetRun(*parent)) return;  // deleted meanwhile, and its evaluations with it
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
      if (!StaysOver(run, *there) && !(same && BringsDecisions(run, *there))) {
        ++result_.kept;
        if (same) merged_[run.run_id] = there->run_id;
        return;
      }
      // What is there and whole is not given up for what was damaged or changed.
      if (const std::vector<std::string> problems = WhyNotAsWritten(source_, run);
          !problems.empty()) {
        result_.notes.push_back("kept the run " + there->uuid.substr(0, 8) +
                                " that is there: the one of " + source_->path() +
                                " is not as it was written: " + problems.front());
        ++result_.kept;
        if (same) merged_[run.run_id] = there->run_id;
        return;
      }
      run_id = there->run_id;
      target_->ReplaceRun(run_id, Provenance(run, parent));
      if (!same) {
        // The evaluations below were of the other run.
        for (const RunInfo& child : target_->ListRuns()) {
          if (child.parent_run_id == run_id) DeleteRun(child.run_id);
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
           " log_path_sha256 = sha256(?5),"
           " exit_code = ?6, error = ?7, created_utc = ?8, ended_utc = ?9,"
           " heartbeat_utc = ?10, result_digest = ?11 WHERE run_id = ?1")
        .Bind(run_id, run.uuid, run.env_steps_done, RunStatusName(run.status),
              MovedPath(run.log_path, source_->path(), *target_), run.exit_code, run.error,
              run.created_utc, Maybe(run.ended_utc), Maybe(run.heartbeat_utc),
              Maybe(run.result_digest))
        .Run();
    CopyRows(run.run_id, run_id, settings_.decisions || run.status != RunStatus::kFinished);
  }

  // Whether a run that was merged without them can have its decisions back.
  bool BringsDecisions(const RunInfo& run, const RunInfo& there) {
    return settings_.decisions && run.env_steps_done == there.env_steps_done &&
           run.status == there.status && HasDecisions("source", run.run_id) &&
           !HasDecisions("main", there.run_id);
  }
  bool HasDecisions(const std::string& schema, std::int64_t run_id) {
    return db_.Prepare("SELECT 1 FROM " + schema + ".step WHERE run_id = ?1").Bind(run_id).Step();
  }

  // The bins go first, so that no trigger maintains what is about to vanish.
  void DeleteRun(std::int64_t run_id) {
    db_.Prepare("DELETE FROM main.curve_bin WHERE run_id = ?1").Bind(run_id).Run();
    for (const std::string& table : tables_) {
      db_.Prepare("DELETE FROM main." + table + " WHERE run_id = ?1").Bind(run_id).Run();
    }
    db_.Prepare("DELETE FROM main.run WHERE run_id = ?1").Bind(run_id).Run();
  }

  std::optional<RunInfo> ByUuid(const std::string& uuid) {
    Statement find = db_.Prepare("SELECT run_id FROM main.run WHERE uuid = ?1");
    if (!find.Bind(uuid).Step()) return std::nullopt;
    return target_->GetRun(find.Int(0));
  }

  static std::optional<std::string> Maybe(const std::string& text) {
    return text.empty() ? std::nullopt : std::optional(text);
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
    db_.Prepare("UPDATE main.study SET sha256 = " + std::string(kStudySha256) +
                " WHERE study_id = ?1")
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

  void PrepareCopies() {
    for (const RunCopy& copy : RunCopies(db_)) {
      tables_.push_back(copy.table);
      if (copy.table == kScalarTable) {
        copy_scalars_ = db_.Prepare(copy.sql);
      } else {
        copies_.emplace_back(copy.table, db_.Prepare(copy.sql));
      }
    }
  }

  void CopyRows(std::int64_t from, std::int64_t to, bool decisions) {
    MapMachines(from);
    for (auto& [table, copy] : copies_) {
      if (table == "step" && !decisions) continue;
      copy.Bind(from, to).Run();
      result_.rows += db_.Changes();
    }
    if (!decisions) {
      db_.Prepare("DELETE FROM main.chunk_digest WHERE run_id = ?1 AND tbl = 'step'")
          .Bind(to)
          .Run();
      result_.rows -= db_.Changes();
    }
    for (const auto& [metric, old] : metrics_) {
      copy_scalars_.Bind(from, to, old, metric).Run();
      result_.rows += db_.Changes();
    }
  }

  // The hosts and builds of a run's segments.
  void MapMachines(std::int64_t run_id) {
    db_.Execute("DELETE FROM temp.host_map; DELETE FROM temp.build_map");
    Statement hosts = db_.Prepare(
        "SELECT host_id, hostname, cpu, cores, memory_bytes, os FROM source.host WHERE host_id IN"
        " (SELECT host_id FROM source.segment WHERE run_id = ?1)");
    hosts.Bind(run_id);
    while (hosts.Step()) {
      const std::int64_t host =
          target_->Host({hosts.Text(1), hosts.Text(2), hosts.Int(3), hosts.Int(4), hosts.Text(5)});
      db_.Prepare("INSERT INTO temp.host_map VALUES (?1, ?2)").Bind(hosts.Int(0), host).Run();
    }
    Statement builds = db_.Prepare(
        "SELECT DISTINCT build_id FROM source.segment WHERE run_id = ?1 AND build_id IS NOT NULL");
    builds.Bind(run_id);
    while (builds.Step()) {
      const std::int64_t build = target_->Build(source_->GetBuild(builds.Int(0)));
      db_.Prepare("INSERT INTO temp.build_map VALUES (?1, ?2)").Bind(builds.Int(0), build).Run();
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
        " n_seeds = excluded.n_seeds, seed_sd = excluded.seed_sd, sha256 = excluded.sha256 WHERE " +
        order("excluded") + " < " + order("published"));
  }

  Database* target_;
  Connection& db_;
  Database* source_;
  const MergeSettings settings_;
  std::map<std::int64_t, std::int64_t> metrics_;  // metric_id of the target to the source's
  std::vector<std::string> tables_;               // of what a run recorded
  std::vector<std::pair<std::string, Statement>> copies_;  // of each table
  Statement copy_scalars_;                                 // of one metric, ?3 there and ?4 here
  std::map<std::int64_t, std::int64_t> merged_;  // run_id of the source to that of the target
  MergeResult result_;
};

}  // namespace

MergeResult Merge(Database* target, Database* source, const MergeSettings& settings) {
  return Merger(target, source, settings).Run();
}

MergeResult Merge(Database* target, const std::string& source, const MergeSettings& settings) {
  return Merge(target, Database::OpenReadOnly(source).get(), settings);
}

}  // namespace dreamsearch::results
