// The rows that many runs name: studies, tasks, plugins, configurations, builds and machines.
// Each is there once.
#include <optional>

#include "results/database/database.h"
#include "results/database/schema.h"
#include "results/system/error.h"
#include "results/system/sha256.h"

namespace dreamsearch::results {
namespace {

// Finds the row that `find` selects or adds it with `insert`; both take the same
// parameters.
template <typename... Values>
std::int64_t FindOrInsert(Connection& db, const char* find_sql, const char* insert_sql,
                          const Values&... values) {
  Statement find = db.Prepare(find_sql);
  if (find.Bind(values...).Step()) return find.Int(0);
  std::int64_t id = 0;
  db.Transact([&] {
    if (find.Bind(values...).Step()) {
      id = find.Int(0);
      find.Reset();
      return;
    }
    db.Prepare(insert_sql).Bind(values...).Run();
    id = db.LastInsertId();
  });
  return id;
}

}  // namespace

std::int64_t Database::Study(const std::string& name, const std::string& description) {
  Statement find = connection_->Prepare("SELECT study_id FROM study WHERE name = ?1");
  if (find.Bind(name).Step()) return find.Int(0);
  std::int64_t id = 0;
  connection_->Transact([&] {
    connection_
        ->Prepare("INSERT INTO study (name, description, created_utc, sha256) SELECT *, " +
                  std::string(kStudySha256) +
                  " FROM (SELECT ?1 AS name, ?2 AS description, ?3 AS created_utc) WHERE true"
                  " ON CONFLICT DO NOTHING")
        .Bind(name, description, UtcNow())
        .Run();
    find.Bind(name).Step();
    id = find.Int(0);
  });
  return id;
}

std::int64_t Database::Task(const TaskInfo& task) {
  const bool ranged = task.return_high > task.return_low;
  const std::optional<double> low = ranged ? std::optional(task.return_low) : std::nullopt;
  const std::optional<double> high = ranged ? std::optional(task.return_high) : std::nullopt;
  Statement find = connection_->Prepare(
      "SELECT task_id, domain = ?2 AND observation_size = ?3 AND action_size = ?4 AND"
      " control_seconds = ?5 AND substeps = ?6 AND episode_steps = ?7 AND return_low IS ?8 AND"
      " return_high IS ?9, observation_size, action_size, control_seconds, substeps,"
      " episode_steps, return_low, return_high FROM task WHERE name = ?1");
  const auto bind_all = [&](Statement& statement) -> Statement& {
    return statement.Bind(task.name, task.domain, task.observation_size, task.action_size,
                          task.control_seconds, task.substeps, task.episode_steps, low, high);
  };
  std::int64_t id = 0;
  const auto found = [&] {
    if (!bind_all(find).Step()) return false;
    id = find.Int(0);
    if (find.Int(1) != 0) {
      find.Reset();
      return true;
    }
    std::string known;
    for (int i = 2; i < 9; ++i) known += (i == 2 ? "" : ", ") + find.Text(i);
    find.Reset();
    throw Failure(ExitCode::kBadInput,
                  path() + ": task '" + task.name +
                      "' was recorded with other values (observation size, action size, control "
                      "seconds, sub-steps, episode steps, return range: " +
                      known + "). Runs of both must not be averaged: use another --db.");
  };
  if (found()) return id;
  connection_->Transact([&] {
    if (found()) return;
    Statement insert = connection_->Prepare(
        "INSERT INTO task (name, domain, observation_size, action_size, control_seconds, substeps,"
        " episode_steps, return_low, return_high) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)");
    bind_all(insert).Run();
    id = connection_->LastInsertId();
  });
  return id;
}

std::int64_t Database::Plugin(const PluginRow& plugin) {
  return FindOrInsert(*connection_,
                      "SELECT plugin_id FROM plugin WHERE name = ?1 AND version = ?2 AND abi = ?3"
                      " AND file = ?4 AND sha256 = ?5",
                      "INSERT INTO plugin (name, version, abi, file, sha256)"
                      " VALUES (?1, ?2, ?3, ?4, ?5)",
                      plugin.name, plugin.version, plugin.abi, plugin.file, plugin.sha256);
}

std::int64_t Database::Config(const std::string& canonical_json) {
  return FindOrInsert(*connection_, "SELECT config_id FROM config WHERE sha256 = ?1 AND ?2 = json",
                      "INSERT INTO config (sha256, json) VALUES (?1, ?2)",
                      Sha256Hex(canonical_json), canonical_json);
}

std::int64_t Database::Build(const BuildInfo& build) {
  return FindOrInsert(
      *connection_,
      "SELECT build_id FROM build WHERE version = ?1 AND commit_hash = ?2 AND dirty = ?3 AND"
      " compiler = ?4 AND flags = ?5 AND instruction_set = ?6 AND libraries = ?7",
      "INSERT INTO build (version, commit_hash, dirty, compiler, flags, instruction_set, libraries)"
      " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
      build.version, build.commit, build.dirty, build.compiler, build.flags, build.instruction_set,
      build.libraries);
}

std::int64_t Database::Host(const HostInfo& host) {
  return FindOrInsert(*connection_,
                      "SELECT host_id FROM host WHERE hostname = ?1 AND cpu = ?2 AND cores = ?3 AND"
                      " memory_bytes = ?4 AND os = ?5",
                      "INSERT INTO host (hostname, cpu, cores, memory_bytes, os)"
                      " VALUES (?1, ?2, ?3, ?4, ?5)",
                      host.hostname, host.cpu, host.cores, host.memory_bytes, host.os);
}

PluginRow Database::GetPlugin(std::int64_t plugin_id) {
  Statement row = connection_->Prepare(
      "SELECT name, version, abi, file, sha256 FROM plugin WHERE plugin_id = ?1");
  if (!row.Bind(plugin_id).Step()) {
    throw Failure(ExitCode::kInternal,
                  path() + ": there is no plugin row " + std::to_string(plugin_id));
  }
  return {row.Text(0), row.Text(1), row.Text(2), row.Text(3), row.Text(4)};
}

BuildInfo Database::GetBuild(std::int64_t build_id) {
  Statement row = connection_->Prepare(
      "SELECT version, commit_hash, dirty, compiler, flags, instruction_set, libraries FROM build"
      " WHERE build_id = ?1");
  if (!row.Bind(build_id).Step()) {
    throw Failure(ExitCode::kInternal,
                  path() + ": there is no build row " + std::to_string(build_id));
  }
  return {row.Text(0), row.Text(1), row.Int(2) != 0, row.Text(3),
          row.Text(4), row.Text(5), row.Text(6)};
}

}  // namespace dreamsearch::results
