#include "results/database/database.h"

#include <sqlite3.h>
#include <sys/random.h>
#include <sys/statfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <limits>
#include <thread>

#include "results/database/derived_rows.h"
#include "results/database/schema.h"
#include "results/system/file.h"
#include "results/system/sha256.h"

namespace dreamsearch::results {
namespace {

constexpr const char* kStatusNames[] = {"queued", "running", "finished", "interrupted",
                                        "failed", "crashed", "diverged", "killed"};

// More in a row are a loop, as for the kernel.
constexpr int kMaxLinks = 40;

// File systems on which the shared memory of WAL does not work between machines.
bool IsNetworkFileSystem(const std::string& path) {
  struct statfs info;
  if (statfs(path.c_str(), &info) != 0) return false;
  switch (static_cast<std::uint32_t>(info.f_type)) {
    case 0x6969:      // NFS
    case 0x517b:      // SMB
    case 0xff534d42:  // CIFS
    case 0xfe534d42:  // SMB 2
    case 0x5346414f:  // AFS
    case 0x73757245:  // Coda
    case 0x0bd00bd0:  // Lustre
    case 0x47504653:  // GPFS
    case 0x19830326:  // BeeGFS
    case 0x00c36400:  // Ceph
    case 0x01021997:  // 9P
    case 0x01161970:  // GFS2
    case 0x7461636f:  // OCFS2
      return true;
    default:
      return false;
  }
}

void CreateFolders(const std::string& path) {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::filesystem::create_directories(folder, error);
  if (!error) return;
  ExitCode code = ExitCode::kCannotCreate;
  if (error == std::errc::permission_denied) code = ExitCode::kPermission;
  if (error == std::errc::no_space_on_device || error == std::errc::io_error) {
    code = ExitCode::kInputOutput;
  }
  throw Failure(code, folder.string() + ": the database's folder cannot be created (" +
                          error.message() + "). Name another file with --db.");
}

std::string NamedPath(const std::string& path) {
  if (path.empty()) {
    throw Failure(ExitCode::kUsage,
                  "expected the name of a results database, found nothing. Name one with --db.");
  }
  // The file behind all links, also one that is yet to be made. What is wrong with a path
  // that cannot be followed shows when it is opened.
  std::error_code error;
  std::filesystem::path file = std::filesystem::absolute(path, error);
  for (int links = 0; links < kMaxLinks && !error; ++links) {
    const std::filesystem::path folder =
        std::filesystem::weakly_canonical(file.parent_path(), error);
    if (error) break;
    file = folder / file.filename();
    if (!std::filesystem::is_symlink(file, error)) return file.lexically_normal().string();
    file = folder / std::filesystem::read_symlink(file, error);
  }
  return AbsolutePath(path);
}

// Text of milliseconds since 1970.
std::string UtcText(std::int64_t milliseconds) {
  const std::time_t seconds = milliseconds / 1000;
  std::tm parts;
  gmtime_r(&seconds, &parts);
  char text[96];
  std::snprintf(text, sizeof text, "%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", parts.tm_year + 1900,
                parts.tm_mon + 1, parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec,
                static_cast<int>(milliseconds % 1000));
  return text;
}

std::int64_t NowMilliseconds() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

constexpr char kSelectRun[] =
    "SELECT r.run_id, r.uuid, s.name, t.name, r.planner, r.model, r.env_plugin, r.model_plugin,"
    " r.planner_plugin, r.config_id, c.json, c.sha256, r.preset, r.seed, r.action_repeat,"
    " r.env_steps_target, r.env_steps_done, r.status, r.parent_run_id, r.log_path, r.exit_code,"
    " r.error, r.argv, r.build_id, r.created_utc, r.ended_utc, r.heartbeat_utc, r.result_digest,"
    " (julianday('now') - julianday(r.heartbeat_utc)) * 86400.0,"
    " (SELECT ifnull(max(segment), -1) FROM segment WHERE run_id = r.run_id)"
    " FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id)"
    " JOIN config c USING (config_id) ";

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

std::string UtcNow() { return UtcText(NowMilliseconds()); }

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

std::unique_ptr<Database> Database::OpenOrCreate(const std::string& path) {
  return std::unique_ptr<Database>(new Database(path, OpenMode::kCreate));
}
std::unique_ptr<Database> Database::OpenExisting(const std::string& path) {
  return std::unique_ptr<Database>(new Database(path, OpenMode::kReadWrite));
}
std::unique_ptr<Database> Database::OpenReadOnly(const std::string& path) {
  return std::unique_ptr<Database>(new Database(path, OpenMode::kReadOnly));
}

void Database::CheckWritable(const std::string& path) {
  std::filesystem::path folder = std::filesystem::path(NamedPath(path)).parent_path();
  std::error_code error;
  while (!std::filesystem::exists(folder, error) && folder != folder.root_path()) {
    folder = folder.parent_path();
  }
  if (!std::filesystem::is_directory(folder, error)) {
    throw Failure(ExitCode::kCannotCreate, folder.string() +
                                               ": is no folder, so the database's folder "
                                               "cannot be created. Name another file with "
                                               "--db.");
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw Failure(ExitCode::kPermission, folder.string() +
                                             ": may not be written by this user, so the "
                                             "database cannot be. Name another file with "
                                             "--db.");
  }
}

Database::Database(const std::string& path, OpenMode mode) {
  const std::string absolute = NamedPath(path);
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(absolute, error);
  if (status.type() == std::filesystem::file_type::not_found) {
    if (mode != OpenMode::kCreate) {
      throw Failure(ExitCode::kNotFound,
                    absolute + ": there is no such database. Name one with --db.");
    }
    CreateFolders(absolute);
  } else if (error) {
    throw Failure(
        error == std::errc::permission_denied ? ExitCode::kPermission : ExitCode::kInputOutput,
        absolute + ": cannot be reached: " + error.message());
  } else if (status.type() == std::filesystem::file_type::directory) {
    throw Failure(mode == OpenMode::kCreate ? ExitCode::kCannotCreate : ExitCode::kBadInput,
                  absolute + ": expected a results database, found a folder.");
  } else if (status.type() != std::filesystem::file_type::regular) {
    throw Failure(mode == OpenMode::kCreate ? ExitCode::kCannotCreate : ExitCode::kBadInput,
                  absolute +
                      ": expected a results database, found a device, a pipe or a socket. "
                      "Name another file with --db.");
  } else if (access(absolute.c_str(), mode == OpenMode::kReadOnly ? R_OK : R_OK | W_OK) != 0) {
    throw Failure(ExitCode::kPermission, absolute + ": may not be " +
                                             (mode == OpenMode::kReadOnly ? "read" : "written") +
                                             " by this user.");
  }
  const bool folder_writable =
      access(std::filesystem::path(absolute).parent_path().c_str(), W_OK) == 0;
  if (mode != OpenMode::kReadOnly && !folder_writable) {
    throw Failure(ExitCode::kPermission,
                  std::filesystem::path(absolute).parent_path().string() +
                      ": may not be written by this user; the database needs its journal there.");
  }
  // A reader in WAL mode needs files of its own beside the database, and only one
  // that may write takes them away again at its end. query_only keeps it from
  // changing anything else.
  OpenMode opened = mode;
  if (mode == OpenMode::kReadOnly) {
    if (folder_writable && access(absolute.c_str(), W_OK) == 0) {
      opened = OpenMode::kReadWrite;
    } else if (access((absolute + "-wal").c_str(), F_OK) != 0) {
      opened = OpenMode::kImmutable;
    }
  }
  connection_ = std::make_unique<Connection>(absolute, opened);
  if (opened == OpenMode::kReadWrite && mode == OpenMode::kReadOnly &&
      connection_->QueryInt("PRAGMA application_id") == kApplicationId &&
      connection_->QueryInt("PRAGMA user_version") < SchemaVersion()) {
    Prepare(OpenMode::kReadWrite);
  }
  if (mode == OpenMode::kReadOnly) connection_->Execute("PRAGMA query_only = ON");
  Prepare(mode);
}

void Database::Prepare(OpenMode mode) {
  Connection& db = *connection_;
  const auto ours = [&db] { return db.QueryInt("PRAGMA application_id") == kApplicationId; };
  const auto version = [&db] { return db.QueryInt("PRAGMA user_version").value_or(0); };
  const auto blank = [&] {
    return db.QueryInt("PRAGMA application_id") == 0 && version() == 0 &&
           db.QueryInt("SELECT count(*) FROM sqlite_schema") == 0;
  };

  const bool create = mode == OpenMode::kCreate && blank();
  if (!create && !ours()) {
    throw Failure(ExitCode::kBadInput,
                  path() + ": " +
                      (blank() ? "is empty, not a results database."
                               : "is an SQLite file of another program, not a results "
                                 "database.") +
                      " Name another file with --db.");
  }
  if (version() > SchemaVersion()) {
    throw Failure(ExitCode::kBadInput, path() + ": has schema " + std::to_string(version()) +
                                           ", this program knows up to " +
                                           std::to_string(SchemaVersion()) +
                                           ". Use the newer program that wrote it.");
  }
  if (version() < SchemaVersion() && mode == OpenMode::kReadOnly) {
    throw Failure(ExitCode::kPermission,
                  path() + ": has the older schema " + std::to_string(version()) + ", expected " +
                      std::to_string(SchemaVersion()) +
                      "; to bring it up to date, it must be writable. Read a copy.");
  }

  db.Execute("PRAGMA foreign_keys = ON; PRAGMA trusted_schema = OFF; PRAGMA cache_size = -16000");
  if (mode == OpenMode::kReadOnly) return;

  // FULL makes a commit survive a power cut; it costs 0.6 us a row at 1000-row
  // commits.
  db.Execute("PRAGMA synchronous = FULL");
  if (create || version() < SchemaVersion()) {
    db.Transact([this] { Migrate(); });
  }

  const bool network = IsNetworkFileSystem(path());
  const std::string journal = network ? "delete" : "wal";
  if (network) {
    warnings_.push_back(path() +
                        ": is on a network file system; it is written with a rollback journal, "
                        "which is slower. Prefer a local file a machine, and `results merge`.");
  }
  // Changing the mode needs the file for itself for a moment, and SQLite does not
  // wait for that by itself when several processes open a new file at once.
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (db.QueryText("PRAGMA journal_mode") != journal) {
    sqlite3_exec(db.handle(), ("PRAGMA journal_mode = " + journal).c_str(), nullptr, nullptr,
                 nullptr);
    const int code = sqlite3_errcode(db.handle()) & 0xff;
    if (code != SQLITE_OK && code != SQLITE_BUSY && code != SQLITE_LOCKED) {
      ThrowSqlite(db.handle(), path(), "setting its journal mode");
    }
    if (code == SQLITE_OK && db.QueryText("PRAGMA journal_mode") != journal) {
      warnings_.push_back(path() + ": cannot use journal mode " + journal + " here; goes on with " +
                          db.QueryText("PRAGMA journal_mode"));
      break;
    }
    if (std::chrono::steady_clock::now() > deadline) {
      ThrowSqlite(db.handle(), path(), "setting its journal mode");
    }
    if (code != SQLITE_OK) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  db.Execute("PRAGMA journal_size_limit = 67108864");
}

void Database::Migrate() {
  Connection& db = *connection_;
  const std::int64_t version = db.QueryInt("PRAGMA user_version").value_or(0);
  if (version >= SchemaVersion()) return;  // Another process was faster.
  if (version > 0) {
    // Between two runs of a sweep none is running, but others are queued.
    Statement active = db.Prepare(
        "SELECT run_id, age FROM (SELECT run_id, status, (julianday('now') -"
        " julianday(heartbeat_utc)) * 86400.0 AS age FROM run) WHERE age < ?1 AND"
        " (status = 'running' OR EXISTS (SELECT 1 FROM run WHERE status = 'queued'))"
        " ORDER BY age LIMIT 1");
    if (active.Bind(kAliveSeconds).Step()) {
      char age[32];
      std::snprintf(age, sizeof age, "%.0f", std::max(active.Real(1), 0.0));
      throw Failure(ExitCode::kInputOutput,
                    path() + ": has the older schema " + std::to_string(version) + ", expected " +
                        std::to_string(SchemaVersion()) + ", and run " +
                        std::to_string(active.Int(0)) + " was active " + age +
                        " s ago: the program that runs it would not know the newer schema. Wait "
                        "until it and what is queued behind it have ended; or use the older "
                        "program; or read a copy (sqlite3 FILE \".backup COPY\"), which opens a "
                        "minute after it was made.");
    }
  }
  db.Execute(DropViews());
  for (std::int64_t v = version; v < SchemaVersion(); ++v) {
    db.Execute(Migrations()[static_cast<std::size_t>(v)]);
  }
  db.Execute(CreateViews());
  db.Execute("PRAGMA user_version = " + std::to_string(SchemaVersion()) +
             "; PRAGMA application_id = " + std::to_string(kApplicationId));
}

std::string Database::NewRunFolder(const std::string& uuid) const {
  return path() + ".files/" + uuid;
}

std::string Database::RunFolder(const RunInfo& run) const {
  const std::filesystem::path recorded =
      (std::filesystem::path(path()).parent_path() / run.log_path).lexically_normal().parent_path();
  // A database that was copied or renamed with its files keeps to them. A path is data:
  // it names no folder but the run's own.
  const std::string beside = NewRunFolder(run.uuid);
  // A database that was copied or renamed with its files keeps to them. A path is data:
  // it names no folder but the run's own.
  const bool own = std::filesystem::exists(beside) || recorded.filename() != run.uuid;
  return own ? beside : recorded.string();
}

std::string Database::RelativePath(const std::string& file) const {
  const std::string folder = std::filesystem::path(path()).parent_path().string() + "/";
  const std::string absolute = AbsolutePath(file);
  return absolute.rfind(folder, 0) == 0 ? absolute.substr(folder.size()) : absolute;
}

std::int64_t Database::Study(const std::string& name, const std::string& description) {
  Statement find = connection_->Prepare("SELECT study_id FROM study WHERE name = ?1");
  if (find.Bind(name).Step()) return find.Int(0);
  std::int64_t id = 0;
  connection_->Transact([&] {
    connection_
        ->Prepare(
            "INSERT INTO study (name, description, created_utc) VALUES (?1, ?2, ?3)"
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
                      "' was recorded with other figures (observation size, action size, control "
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

std::int64_t Database::Plugin(const PluginInfo& plugin) {
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

PluginInfo Database::GetPlugin(std::int64_t plugin_id) {
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
            " parent_run_id, log_path, argv, build_id, created_utc) VALUES"
            " (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18)")
        .Bind(uuid, run.study_id, run.task_id, run.planner, run.model, run.env_plugin,
              run.model_plugin, run.planner_plugin, run.config_id, run.preset, run.seed,
              run.action_repeat, run.env_steps_target, run.parent_run_id,
              RelativePath(NewRunFolder(uuid) + "/" + run.log_name), run.argv, run.build_id,
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
            " heartbeat_utc = NULL, result_digest = NULL, log_path = ?17 WHERE run_id = ?1")
        .Bind(run_id, run.study_id, run.task_id, run.planner, run.model, run.env_plugin,
              run.model_plugin, run.planner_plugin, run.config_id, run.preset, run.seed,
              run.action_repeat, run.env_steps_target, run.parent_run_id, run.argv, run.build_id,
              RelativePath(NewRunFolder(uuid) + "/" + run.log_name))
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
    throw Failure(ExitCode::kUsage, path() + ": run '" + id_or_uuid + "' is ambiguous: " +
                                        matches[0].uuid + " and " + matches[1].uuid + " begin so.");
  }
  const std::int64_t count = connection_->QueryInt("SELECT count(*) FROM run").value_or(0);
  const std::int64_t last = connection_->QueryInt("SELECT max(run_id) FROM run").value_or(0);
  throw Failure(ExitCode::kNotFound,
                path() + ": no run '" + id_or_uuid + "'. Expected a run_id or the " +
                    "beginning of a UUID (4 characters or more); there are " +
                    std::to_string(count) + " runs" +
                    (count > 0 ? ", the last is " + std::to_string(last) : "") +
                    ". See `results list`.");
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
