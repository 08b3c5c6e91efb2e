#include "results/database/sqlite.h"

#include <sqlite3.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <thread>

#include "results/database/file_system.h"
#include "results/statistics/statistics.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/sha256.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

constexpr double kLockPatienceSeconds = 30;

// A lock that is held so long may be one that does not exist.
constexpr double kLockDoubtSeconds = 0.1;

// Bytes an ordinary user can still write beside `path`, for messages.
std::string FreeSpace(const std::string& path) {
  struct statvfs info;
  const std::string folder = std::filesystem::path(path).parent_path().string();
  if (statvfs(folder.c_str(), &info) != 0) return "free space unknown";
  return std::to_string(static_cast<std::uint64_t>(info.f_bavail) * info.f_frsize) +
         " bytes free there";
}

// What is written needs space, and so does what is only read: SQLite makes a file beside it.
bool IsFull(const std::string& path) {
  struct statvfs info;
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return statvfs(folder.c_str(), &info) == 0 && info.f_bavail == 0 &&
         (info.f_flag & ST_RDONLY) == 0;
}

std::string FileUri(const std::string& path) {
  std::string uri = "file:";
  for (const char c : path) {
    char escaped[4];
    std::snprintf(escaped, sizeof escaped, "%%%02x", static_cast<unsigned char>(c));
    uri += c == '/' ? "/" : escaped;
  }
  return uri;
}

// SQLite's own files are needed beside a database unless nobody can change it.
bool IsUnchangeable(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return access(folder.c_str(), W_OK) != 0 && access((path + "-wal").c_str(), F_OK) != 0;
}

// A Connection::TextFunction as SQLite calls it: nothing is thrown through SQLite's frames.
void CallTextFunction(sqlite3_context* context, int, sqlite3_value** values) noexcept {
  const auto* text = reinterpret_cast<const char*>(sqlite3_value_text(values[0]));
  if (text == nullptr) return;
  const auto size = static_cast<std::size_t>(sqlite3_value_bytes(values[0]));
  try {
    const auto& function = *static_cast<Connection::TextFunction*>(sqlite3_user_data(context));
    const std::string result = function({text, size});
    sqlite3_result_text64(context, result.data(), result.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
  } catch (const std::exception& error) {
    sqlite3_result_error(context, error.what(), -1);
  }
}

// The aggregate standard_error; SQLite's memory for a group begins as zeros.
void AddToSample(sqlite3_context* context, int, sqlite3_value** values) {
  if (sqlite3_value_type(values[0]) == SQLITE_NULL) return;
  auto* sample = static_cast<Sample*>(sqlite3_aggregate_context(context, sizeof(Sample)));
  if (sample == nullptr) return sqlite3_result_error_nomem(context);
  sample->Add(sqlite3_value_double(values[0]));
}

void EndSample(sqlite3_context* context) {
  const auto* sample = static_cast<const Sample*>(sqlite3_aggregate_context(context, 0));
  if (sample == nullptr) return;  // NULL
  if (const auto error = sample->StandardError()) sqlite3_result_double(context, *error);
}

// After a lock that was not to be had: throws if there are none.
void CheckLocksExist(const std::string& path, const std::string& where) {
  const std::string why = WhyNoLocks(path);
  if (why.empty()) return;
  throw Failure(ExitCode::kInputOutput,
                where + "files cannot be locked here (" + why +
                    "), so nothing keeps two processes from writing at once. Name a database on "
                    "another file system, or give `runner` a folder of this machine with "
                    "--scratch.");
}

// errno of the call that failed last on the database's files; 0 if none did.
int SystemError(sqlite3* handle) {
  for (const int which : {SQLITE_FCNTL_JOURNAL_POINTER, SQLITE_FCNTL_FILE_POINTER}) {
    sqlite3_file* file = nullptr;
    sqlite3_file_control(handle, "main", which, &file);
    int error = 0;
    if (file != nullptr && file->pMethods != nullptr &&
        file->pMethods->xFileControl(file, SQLITE_FCNTL_LAST_ERRNO, &error) == SQLITE_OK &&
        error != 0) {
      return error;
    }
  }
  return 0;
}

// `system_error` is errno of the call that failed, as far as SQLite knows.
[[noreturn]] void ThrowCode(int code, const std::string& reason, int system_error,
                            const std::string& path, const std::string& what) {
  const std::string where = path + ": " + what + ": ";
  switch (code & 0xff) {
    case SQLITE_NOTADB:
      throw Failure(ExitCode::kBadInput,
                    where + "this is not an SQLite file. Name a results database.");
    case SQLITE_CORRUPT:
      throw Failure(ExitCode::kBadInput,
                    where + "the file is damaged (" + reason +
                        "). Restore a copy, or save what can still be read: sqlite3 " +
                        ShellWord(path) + " .dump | sed 's/^ROLLBACK;.*/COMMIT;/' | sqlite3 " +
                        ShellWord(path + ".saved"));
    case SQLITE_FULL:
    case SQLITE_IOERR:
      if ((code & 0xff) == SQLITE_FULL || system_error == ENOSPC || IsFull(path)) {
        throw Failure(ExitCode::kInputOutput, where + "the disk is full (" + FreeSpace(path) +
                                                  "). Make room and run the same command again.");
      }
      if (system_error == EDQUOT) {
        throw Failure(ExitCode::kInputOutput, where +
                                                  "the quota of this user or project is used up. "
                                                  "Make room and run the same command again.");
      }
      if (code == SQLITE_IOERR_LOCK || code == SQLITE_IOERR_RDLOCK) CheckLocksExist(path, where);
      throw Failure(ExitCode::kInputOutput,
                    where + "input/output error (" + reason + "; " + FreeSpace(path) +
                        "). Check the disk and run the same command again.");
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      CheckLocksExist(path, where);
      throw Failure(ExitCode::kInputOutput,
                    where +
                        "another process kept the database locked for too long. End that process "
                        "and run the same command again, or use another database and merge.");
    case SQLITE_READONLY:
    case SQLITE_PERM:
    case SQLITE_AUTH:
      throw Failure(ExitCode::kPermission, where + "no permission (" + reason +
                                               "). Write access to the file and its "
                                               "folder is needed.");
    case SQLITE_CANTOPEN:
      throw Failure(ExitCode::kCannotCreate,
                    where + "cannot be opened (" + reason +
                        "). Check that the folder exists and can be written.");
    case SQLITE_ERROR:
      if (reason.rfind("no such table", 0) == 0 || reason.rfind("no such column", 0) == 0) {
        throw Failure(ExitCode::kBadInput,
                      where + reason + ": not a whole results database. Restore a copy.");
      }
      [[fallthrough]];
    default:
      throw Failure(ExitCode::kInternal, where + reason);
  }
}

}  // namespace

std::string ReadOnlyUri(const std::string& path) {
  const bool no_log = access((path + "-wal").c_str(), F_OK) != 0;
  const bool immutable =
      IsUnchangeable(path) || (no_log && !FileSystemOf(path).write_ahead_is_safe &&
                               Connection(path, OpenMode::kImmutable).IsWriteAhead());
  return FileUri(path) + (immutable ? "?immutable=1" : "?mode=ro");
}

void ThrowSqlite(sqlite3* handle, const std::string& path, const std::string& what) {
  ThrowCode(sqlite3_extended_errcode(handle), sqlite3_errmsg(handle), SystemError(handle), path,
            what);
}

Statement::~Statement() { sqlite3_finalize(statement_); }

void Statement::Reset() { sqlite3_reset(statement_); }

bool Statement::Step() {
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) {
    sqlite3_reset(statement_);
    return false;
  }
  sqlite3* handle = sqlite3_db_handle(statement_);
  const int extended = sqlite3_extended_errcode(handle);
  const std::string reason = sqlite3_errmsg(handle);
  const int system_error = SystemError(handle);
  sqlite3_reset(statement_);
  ThrowCode(extended, reason, system_error, *path_,
            sqlite3_stmt_readonly(statement_) ? "reading" : "writing");
}

void Statement::Run() {
  while (Step()) {
  }
}

void Statement::BindOne(int index, std::int64_t value) {
  sqlite3_bind_int64(statement_, index, value);
}
void Statement::BindOne(int index, double value) {
  if (std::isfinite(value)) {
    sqlite3_bind_double(statement_, index, value);
  } else {
    sqlite3_bind_null(statement_, index);
  }
}
void Statement::BindOne(int index, std::string_view value) {
  sqlite3_bind_text64(statement_, index, value.data() != nullptr ? value.data() : "", value.size(),
                      SQLITE_TRANSIENT, SQLITE_UTF8);
}
void Statement::BindOne(int index, std::nullopt_t) { sqlite3_bind_null(statement_, index); }

int Statement::columns() const { return sqlite3_column_count(statement_); }
std::string Statement::ColumnName(int column) const {
  const char* name = sqlite3_column_name(statement_, column);
  return name != nullptr ? name : "";
}
bool Statement::IsNull(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_NULL;
}
bool Statement::IsInt(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_INTEGER;
}
bool Statement::IsReal(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_FLOAT;
}
std::int64_t Statement::Int(int column) const { return sqlite3_column_int64(statement_, column); }
double Statement::Real(int column) const { return sqlite3_column_double(statement_, column); }
std::string Statement::Text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  if (text == nullptr) return "";
  return {text, static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
}
std::optional<std::int64_t> Statement::OptionalInt(int column) const {
  if (IsNull(column)) return std::nullopt;
  return Int(column);
}
std::optional<double> Statement::OptionalReal(int column) const {
  if (IsNull(column)) return std::nullopt;
  return Real(column);
}

Connection::Connection(const std::string& path, OpenMode mode) : path_(AbsolutePath(path)) {
  // URI: for ReadOnlyUri in ATTACH. A path itself begins with a slash and is none.
  int flags = SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE | SQLITE_OPEN_URI;
  switch (mode) {
    case OpenMode::kReadOnly:
    case OpenMode::kImmutable:
      flags |= SQLITE_OPEN_READONLY;
      break;
    case OpenMode::kReadWrite:
      flags |= SQLITE_OPEN_READWRITE;
      break;
    case OpenMode::kCreate:
      flags |= SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
      break;
  }
  const std::string name = mode == OpenMode::kImmutable ? FileUri(path_) + "?immutable=1" : path_;
  const int code = sqlite3_open_v2(name.c_str(), &handle_, flags, nullptr);
  if (code != SQLITE_OK) {
    const std::string reason = handle_ != nullptr ? sqlite3_errmsg(handle_) : "out of memory";
    const int system_error = handle_ != nullptr ? SystemError(handle_) : 0;
    sqlite3_close_v2(handle_);
    ThrowCode(code, reason, system_error, path_, "opening");
  }
  WaitForLocks([](double seconds) { return seconds < kLockPatienceSeconds; });
  sqlite3_busy_handler(handle_, OnLocked, this);
  AddFunction("sha256", [](const std::string& text) { return Sha256Hex(text); });
  if (sqlite3_create_function_v2(handle_, "standard_error", 1,
                                 SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS, nullptr,
                                 nullptr, AddToSample, EndSample, nullptr) != SQLITE_OK) {
    ThrowSqlite(handle_, path_, "adding the function standard_error");
  }
}

Connection::~Connection() { sqlite3_close_v2(handle_); }

void Connection::AddFunction(const std::string& name, TextFunction function) {
  const int code = sqlite3_create_function_v2(
      handle_, name.c_str(), 1, SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS,
      new TextFunction(std::move(function)), CallTextFunction, nullptr, nullptr,
      [](void* added) { delete static_cast<TextFunction*>(added); });
  if (code != SQLITE_OK) ThrowSqlite(handle_, path_, "adding the function " + name);
}

void Connection::WaitForLocks(LockWaiter waiter) { lock_waiter_ = std::move(waiter); }

int Connection::OnLocked(void* connection, int count) {
  auto* self = static_cast<Connection*>(connection);
  const auto now = std::chrono::steady_clock::now();
  if (count == 0) {
    self->locked_since_ = now;
    self->locks_exist_ = false;
  }
  const std::chrono::duration<double> waited = now - self->locked_since_;
  if (!self->locks_exist_ && waited.count() > kLockDoubtSeconds) {
    if (!WhyNoLocks(self->path_).empty()) return 0;
    self->locks_exist_ = true;
  }
  if (!self->lock_waiter_(waited.count())) return 0;
  std::this_thread::sleep_for(std::chrono::milliseconds(std::min(1 + 2 * count, 50)));
  return 1;
}

bool Connection::IsWriteAhead() const {
  sqlite3_file* file = nullptr;
  constexpr sqlite3_int64 kWriteVersion = 18;  // of the file format; 2: write-ahead log
  unsigned char version = 0;
  return sqlite3_file_control(handle_, "main", SQLITE_FCNTL_FILE_POINTER, &file) == SQLITE_OK &&
         file != nullptr && file->pMethods != nullptr &&
         file->pMethods->xRead(file, &version, 1, kWriteVersion) == SQLITE_OK && version == 2;
}

Statement Connection::Prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v3(handle_, sql.data(), static_cast<int>(sql.size()),
                         SQLITE_PREPARE_PERSISTENT, &statement, nullptr) != SQLITE_OK) {
    ThrowSqlite(handle_, path_, "reading its schema");
  }
  return {statement, &path_};
}

void Connection::Execute(const std::string& sql) {
  if (sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    ThrowSqlite(handle_, path_, "writing");
  }
}

std::optional<std::int64_t> Connection::QueryInt(std::string_view sql) {
  Statement statement = Prepare(sql);
  if (!statement.Step()) return std::nullopt;
  return statement.OptionalInt(0);
}

std::string Connection::QueryText(std::string_view sql) {
  Statement statement = Prepare(sql);
  return statement.Step() ? statement.Text(0) : "";
}

std::int64_t Connection::LastInsertId() const { return sqlite3_last_insert_rowid(handle_); }
std::int64_t Connection::Changes() const { return sqlite3_changes64(handle_); }

void Connection::Transact(const std::function<void()>& body) {
  if (in_transaction_) {
    body();
    return;
  }
  int moved = 0;
  const bool wal_there = access((path_ + "-wal").c_str(), F_OK) == 0;
  const auto check_there = [&] {
    sqlite3_file_control(handle_, "main", SQLITE_FCNTL_HAS_MOVED, &moved);
    if (moved == 0 && (!wal_seen_ || wal_there)) return;
    throw Failure(ExitCode::kInputOutput,
                  path_ + (moved != 0 ? "" : "-wal") +
                      ": was deleted or replaced while it was in use. Nothing more is written to "
                      "it; run the same command again.");
  };
  check_there();
  Execute("BEGIN IMMEDIATE");
  in_transaction_ = true;
  try {
    check_there();  // while it waited for its turn, another process may have replaced the file
    body();
    Execute("COMMIT");
  } catch (...) {
    in_transaction_ = false;
    // SQLite may have rolled back by itself (disk full, input/output error).
    if (sqlite3_get_autocommit(handle_) == 0) {
      sqlite3_exec(handle_, "ROLLBACK", nullptr, nullptr, nullptr);
    }
    throw;
  }
  in_transaction_ = false;
  wal_seen_ = wal_there;
}

}  // namespace dreamsearch::results
