// database.cc - over 400 lines: opening a file is one chain of checks, from its name to its schema.
#include "results/database/database.h"

#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <map>
#include <memory>
#include <thread>

#include "results/database/file_system.h"
#include "results/database/schema.h"
#include "results/system/file.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

// More in a row are a loop, as for the kernel.
constexpr int kMaxLinks = 40;

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

// Paths are stored as text and handed to workers as JSON, which hold UTF-8 only.
std::string CheckedPath(const std::string& path) {
  if (IsUtf8(path)) return path;
  throw Failure(ExitCode::kUsage, ShellWord(path) +
                                      ": expected the path of a database in UTF-8, found other "
                                      "bytes. Rename the file or folder, or name another with "
                                      "--db.");
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
  if (error) {
    throw Failure(ExitCode::kNotFound, Printable(path) +
                                           ": the folder in which the command was given is gone. "
                                           "Give it in another one, or a path from the root.");
  }
  for (int links = 0; links < kMaxLinks && !error; ++links) {
    const std::filesystem::path folder =
        std::filesystem::weakly_canonical(file.parent_path(), error);
    if (error) break;
    file = folder / file.filename();
    if (!std::filesystem::is_symlink(file, error)) {
      return CheckedPath(file.lexically_normal().string());
    }
    file = folder / std::filesystem::read_symlink(file, error);
  }
  return CheckedPath(AbsolutePath(path));
}

// A UUID names a folder: nothing else may be in it, no ../ above all.
bool IsUuid(const std::string& text) {
  if (text.size() != 36) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool hyphen = i == 8 || i == 13 || i == 18 || i == 23;
    const char c = text[i];
    if (hyphen ? c != '-' : !((c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'))) return false;
  }
  return true;
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

}  // namespace

std::string UtcNow() { return UtcText(NowMilliseconds()); }

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
                                               ": is not a folder, so the database's folder "
                                               "cannot be created. Name another file with "
                                               "--db.");
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw Failure(ExitCode::kPermission, folder.string() +
                                             ": this user may not write here, so the "
                                             "database cannot be created. Name another file with "
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
  // SQLite would follow them and write its own bytes wherever they point.
  for (const char* suffix : {"-wal", "-shm", "-journal"}) {
    if (std::filesystem::is_symlink(absolute + suffix, error)) {
      throw Failure(ExitCode::kBadInput, absolute + suffix +
                                             ": expected a file of SQLite, found a symbolic link. "
                                             "Remove it.");
    }
  }
  const bool folder_writable =
      access(std::filesystem::path(absolute).parent_path().c_str(), W_OK) == 0;
  if (mode != OpenMode::kReadOnly && !folder_writable) {
    throw Failure(ExitCode::kPermission,
                  std::filesystem::path(absolute).parent_path().string() +
                      ": may not be written by this user; the database's journal must be there.");
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
  LeaveWriteAhead(mode, opened);
  if (opened == OpenMode::kReadWrite && mode == OpenMode::kReadOnly) {
    const bool old = connection_->QueryInt("PRAGMA user_version") < SchemaVersion();
    const auto program = connection_->QueryInt("PRAGMA application_id");
    if ((program == kApplicationId && old) || (program == 0 && SchemaOfTables())) {
      Prepare(OpenMode::kReadWrite);
    }
  }
  Prepare(mode);
  if (mode == OpenMode::kReadOnly) connection_->Execute("PRAGMA query_only = ON");
}

// Of a file with a write-ahead log, as one copied from a disk has, where such a log is not safe:
// without the memory that processes would share. Who only reads changes nothing if no log is there.
void Database::LeaveWriteAhead(OpenMode mode, OpenMode opened) {
  if (opened == OpenMode::kImmutable || FileSystemOf(path()).write_ahead_is_safe ||
      !connection_->IsWriteAhead()) {
    return;
  }
  const bool log = access((path() + "-wal").c_str(), F_OK) == 0;
  if (opened == OpenMode::kReadOnly || (mode == OpenMode::kReadOnly && !log)) {
    if (log) {
      throw Failure(ExitCode::kPermission,
                    path() + ": has a write-ahead log on " + FileSystemOf(path()).name +
                        ", where only a user who may write it can take it in. Read a copy.");
    }
    auto unchanged = std::make_unique<Connection>(path(), OpenMode::kImmutable);
    if (unchanged->QueryInt("PRAGMA user_version") >= SchemaVersion()) {
      connection_ = std::move(unchanged);
      return;
    }
  }
  connection_->Execute("PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = DELETE");
  // The lock goes with the next read.
  connection_->Execute("PRAGMA locking_mode = NORMAL; SELECT count(*) FROM sqlite_schema");
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
  const bool foreign = !ours() && db.QueryInt("PRAGMA application_id") != 0;
  const std::int64_t marked = ours() ? version() : 0;
  if (!create && !foreign && marked >= 0 && marked < SchemaVersion()) {
    // What says it is older than its tables would be brought up to date twice.
    const std::optional<std::int64_t> schema = SchemaOfTables();
    if (schema && *schema > marked) Mark(*schema, mode);
  }
  if (!create && !ours()) {
    throw Failure(ExitCode::kBadInput,
                  path() + ": " +
                      (blank() ? "is empty, not a results database."
                               : "is an SQLite file of another program, not a results "
                                 "database.") +
                      " Name another file with --db.");
  }
  if (version() < 0) {
    throw Failure(ExitCode::kBadInput, path() + ": has schema " + std::to_string(version()) +
                                           ", which no program wrote: the file is damaged. "
                                           "Restore a copy.");
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

  if (!create && version() == SchemaVersion()) DistrustViews();
  db.Execute("PRAGMA foreign_keys = ON; PRAGMA trusted_schema = OFF; PRAGMA cache_size = -16000");
  if (mode == OpenMode::kReadOnly) return;

  // FULL makes a commit survive a power cut; it costs 0.6 us a row at 1000-row
  // commits.
  db.Execute("PRAGMA synchronous = FULL");
  if (create || version() < SchemaVersion()) {
    db.Transact([this] { Migrate(); });
  }

  const FileSystem file_system = FileSystemOf(path());
  const std::string journal = file_system.write_ahead_is_safe ? "wal" : "delete";
  if (!file_system.write_ahead_is_safe) {
    warnings_.push_back(path() + ": is on " + file_system.name +
                        ", where SQLite's write-ahead log is not safe; it is written with a "
                        "rollback journal, which is slower. `runner --scratch DIR` keeps it in a "
                        "folder of this machine while runs are active.");
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
      warnings_.push_back(path() + ": cannot use journal mode " + journal + " here; uses instead " +
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

namespace {

struct SchemaObject {
  std::string type, sql;
};
using Schema = std::map<std::string, SchemaObject>;  // by name

// Without what SQLite makes by itself.
Schema SchemaOf(sqlite3* handle) {
  Schema found;
  const auto add = [](void* schema, int, char** text, char**) {
    (*static_cast<Schema*>(schema))[text[1]] = {text[0], text[2]};
    return 0;
  };
  sqlite3_exec(handle,
               "SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL AND name NOT LIKE"
               " 'sqlite%'",
               add, &found, nullptr);
  return found;
}

std::unique_ptr<sqlite3, int (*)(sqlite3*)> DatabaseInMemory() {
  sqlite3* opened = nullptr;
  const int code = sqlite3_open(":memory:", &opened);
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> model(opened, sqlite3_close);
  if (code != SQLITE_OK) throw Failure(ExitCode::kInputOutput, "SQLite: out of memory");
  return model;
}

// What a new file has after each of the migrations; the views with the last.
const std::vector<Schema>& OwnSchemas() {
  static const std::vector<Schema> schemas = [] {
    std::vector<Schema> made;
    const auto model = DatabaseInMemory();
    for (const std::string& migration : Migrations()) {
      sqlite3_exec(model.get(), migration.c_str(), nullptr, nullptr, nullptr);
      if (made.size() + 1 == Migrations().size()) {
        sqlite3_exec(model.get(), CreateViews().c_str(), nullptr, nullptr, nullptr);
      }
      made.push_back(SchemaOf(model.get()));
    }
    return made;
  }();
  return schemas;
}

// Whether a file has our views, no others, and tables that are tables: most do, and to see that
// takes a tenth of the time of OwnSchemas. A view can be made without its tables.
bool HasOurViewsAlone(const Schema& here) {
  const auto model = DatabaseInMemory();
  sqlite3_exec(model.get(), CreateViews().c_str(), nullptr, nullptr, nullptr);
  const Schema own = SchemaOf(model.get());
  std::size_t views = 0;
  for (const auto& [name, object] : here) {
    if (object.type == "view") {
      const auto found = own.find(name);
      if (found == own.end() || found->second.sql != object.sql) return false;
      ++views;
    } else if (object.type == "table" && object.sql.rfind("CREATE TABLE", 0) != 0) {
      return false;
    }
  }
  return views == own.size();
}

}  // namespace

// The version whose tables, indices and triggers this file has, though it may not say so: they
// are all that SQL text carries (`sqlite3 a.db .dump | sqlite3 b.db`). nullopt if it has not.
std::optional<std::int64_t> Database::SchemaOfTables() {
  const Schema here = SchemaOf(connection_->handle());
  if (here.empty()) return std::nullopt;
  for (std::size_t v = 0; v < OwnSchemas().size(); ++v) {
    const Schema& expected = OwnSchemas()[v];
    const bool all = std::all_of(expected.begin(), expected.end(), [&](const auto& object) {
      const auto found = here.find(object.first);
      return object.second.type == "view" ||
             (found != here.end() && found->second.type == object.second.type &&
              found->second.sql == object.second.sql);
    });
    if (all) return static_cast<std::int64_t>(v) + 1;
  }
  return std::nullopt;
}

std::vector<std::string> Database::ChangedSchema() {
  const Schema here = SchemaOf(connection_->handle());
  std::vector<std::string> changed;
  for (const auto& [name, object] : OwnSchemas().back()) {
    const auto found = here.find(name);
    if (found == here.end() || found->second.type != object.type ||
        found->second.sql != object.sql) {
      changed.push_back(object.type + " " + name);
    }
  }
  for (const auto& [name, object] : here) {
    if (object.type == "trigger" && OwnSchemas().back().count(name) == 0) {
      changed.push_back("trigger " + name);
    }
  }
  return changed;
}

// A stranger's file may call something of its own as we call a table or a view, and it need never
// come to an end. A view gives way to ours, in this connection; for a table nothing stands in.
void Database::DistrustViews() {
  const Schema here = SchemaOf(connection_->handle());
  if (HasOurViewsAlone(here)) return;
  bool changed = false;
  for (const auto& [name, own] : OwnSchemas().back()) {
    const auto found = here.find(name);
    if (own.type == "view") {
      changed = changed || found == here.end() || found->second.sql != own.sql;
    } else if (own.type == "table" && found != here.end() &&
               (found->second.type != "table" || found->second.sql.rfind("CREATE TABLE", 0) != 0)) {
      throw Failure(ExitCode::kBadInput, path() + ": '" + name +
                                             "' is no table in it: not a results database, or one "
                                             "that was changed. Restore a copy.");
    }
  }
  if (!changed) return;
  for (const auto& [name, own] : OwnSchemas().back()) {
    if (own.type == "view") {
      connection_->Execute("CREATE TEMP VIEW IF NOT EXISTS " + name +
                           own.sql.substr(own.sql.find(" AS")));
    }
  }
}

// Gives a file the two marks that its tables should have: SQL text does not carry them, and a
// damaged file may have others. Its views are made anew.
void Database::Mark(std::int64_t schema, OpenMode mode) {
  Connection& db = *connection_;
  const std::string marks = "PRAGMA application_id = " + std::to_string(kApplicationId) +
                            "; PRAGMA user_version = " + std::to_string(schema);
  if (mode == OpenMode::kReadOnly) {
    throw Failure(ExitCode::kPermission,
                  path() +
                      ": has the tables of a results database, but not their application_id and "
                      "user_version, which files rebuilt from SQL text have lost, and this user "
                      "may not write it. Give them to a copy: sqlite3 COPY '" +
                      marks + "'");
  }
  db.Transact([&] {
    // Another process may have been faster.
    if (db.QueryInt("PRAGMA application_id") == kApplicationId &&
        db.QueryInt("PRAGMA user_version").value_or(0) >= schema) {
      return;
    }
    db.Execute(marks);
  });
  warnings_.push_back(path() +
                      ": had the tables of a results database without their application_id and "
                      "user_version, as files rebuilt from SQL text have; they were set.");
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
      const std::string age = FormatNumber("%.0f", std::max(active.Real(1), 0.0));
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
  db.Execute(FillDigests());
  db.Execute("PRAGMA user_version = " + std::to_string(SchemaVersion()) +
             "; PRAGMA application_id = " + std::to_string(kApplicationId));
}

std::string Database::NewRunFolder(const std::string& path, const std::string& uuid) {
  if (!IsUuid(uuid)) {
    throw Failure(ExitCode::kBadInput,
                  path + ": a run has the UUID '" + Printable(uuid.substr(0, 80)) +
                      "', which is none, and so no folder: the database was damaged or changed. "
                      "Restore a copy.");
  }
  return path + ".files/" + uuid;
}

std::string Database::RunFolderAt(const std::string& path, const RunInfo& run) {
  const std::filesystem::path recorded =
      (std::filesystem::path(path).parent_path() / run.log_path).lexically_normal().parent_path();
  const std::string beside = NewRunFolder(path, run.uuid);
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

}  // namespace dreamsearch::results
