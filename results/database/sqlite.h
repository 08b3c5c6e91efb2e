// sqlite.h - a connection to an SQLite file and its prepared statements.
//
// Values are bound, never pasted into SQL. Every failure is a Failure with the
// absolute path of the file and an exit code. A connection is used by one thread
// and is not carried over fork().
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

struct sqlite3;
struct sqlite3_stmt;

namespace dreamsearch::results {

// One prepared statement. Bind all parameters in order, then step:
//
//   statement.Bind(run_id, "walker_walk", 0.5);
//   while (statement.Step()) use(statement.Int(0), statement.Text(1));
class Statement {
 public:
  Statement() = default;
  Statement(sqlite3_stmt* statement, const std::string* path)
      : statement_(statement), path_(path) {}
  Statement(Statement&& other) noexcept
      : statement_(std::exchange(other.statement_, nullptr)), path_(other.path_) {}
  Statement& operator=(Statement&& other) noexcept {
    std::swap(statement_, other.statement_);
    std::swap(path_, other.path_);
    return *this;
  }
  ~Statement();

  // Resets the statement and binds copies of its parameters ?1, ?2, ...; a double
  // that is not finite is bound as NULL.
  template <typename... Values>
  Statement& Bind(const Values&... values) {
    Reset();
    int index = 0;
    (BindOne(++index, values), ...);
    return *this;
  }

  // True with a row, false at the end; at the end the statement is reset.
  bool Step();
  // For a statement without rows.
  void Run();
  void Reset();

  int columns() const;
  std::string ColumnName(int column) const;
  bool IsNull(int column) const;
  bool IsInt(int column) const;
  bool IsReal(int column) const;
  std::int64_t Int(int column) const;
  double Real(int column) const;
  std::string Text(int column) const;
  std::optional<std::int64_t> OptionalInt(int column) const;
  std::optional<double> OptionalReal(int column) const;

 private:
  void BindOne(int index, std::int64_t value);
  void BindOne(int index, int value) { BindOne(index, std::int64_t{value}); }
  void BindOne(int index, unsigned value) { BindOne(index, std::int64_t{value}); }
  void BindOne(int index, bool value) { BindOne(index, std::int64_t{value}); }
  void BindOne(int index, double value);
  void BindOne(int index, std::string_view value);
  void BindOne(int index, const std::string& value) { BindOne(index, std::string_view(value)); }
  void BindOne(int index, const char* value) { BindOne(index, std::string_view(value)); }
  void BindOne(int index, std::nullopt_t);
  template <typename T>
  void BindOne(int index, const std::optional<T>& value) {
    if (value) {
      BindOne(index, *value);
    } else {
      BindOne(index, std::nullopt);
    }
  }

  sqlite3_stmt* statement_ = nullptr;
  const std::string* path_ = nullptr;
};

// kImmutable: of a file that nobody changes, where SQLite cannot have files of its own beside it.
enum class OpenMode { kReadOnly, kImmutable, kReadWrite, kCreate };

class Connection {
 public:
  // Opens the file itself and looks at nothing in it. `path` is made absolute.
  Connection(const std::string& path, OpenMode mode);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  const std::string& path() const { return path_; }
  sqlite3* handle() const { return handle_; }

  // Whether the file says that it has a write-ahead log, from its header alone: nothing is locked.
  bool IsWriteAhead() const;

  Statement Prepare(std::string_view sql);
  // Runs statements that return nothing of interest; takes no outside text.
  void Execute(const std::string& sql);
  // The first column of the first row, or nothing.
  std::optional<std::int64_t> QueryInt(std::string_view sql);
  std::string QueryText(std::string_view sql);
  std::int64_t LastInsertId() const;
  std::int64_t Changes() const;  // rows of the last statement, triggers not counted

  // Gives SQL a function of one text, NULL of NULL, in place of an older one of that name. It
  // depends on the text alone; what it throws is the statement's error. Always there: `sha256`, in
  // hexadecimal, and the aggregate `standard_error` of the mean of a group's numbers, NULL if there
  // are fewer than two.
  using TextFunction = std::function<std::string(const std::string& text)>;
  void AddFunction(const std::string& name, TextFunction function);

  // Asked again and again while another process has locked the database, with the seconds of
  // this waiting so far; false ends it with Failure 74, as a file system without locks does. At
  // first: 30 seconds.
  using LockWaiter = std::function<bool(double seconds)>;
  void WaitForLocks(LockWaiter waiter);

  // Runs `body` between BEGIN IMMEDIATE and COMMIT, so that it waits for other
  // writers at its start and never in its middle. If anything throws, nothing of
  // it is stored. A transaction within a transaction is part of the outer one.
  // Failure 74 if the file or its write-ahead log was deleted since it was opened:
  // what is written there would be lost.
  void Transact(const std::function<void()>& body);

 private:
  static int OnLocked(void* connection, int count);

  sqlite3* handle_ = nullptr;
  std::string path_;
  LockWaiter lock_waiter_;
  std::chrono::steady_clock::time_point locked_since_;
  bool locks_exist_ = false;  // asked, while it waits for one
  bool in_transaction_ = false;
  bool wal_seen_ = false;
};

// A URI under which any connection opens the file for reading only.
std::string ReadOnlyUri(const std::string& path);

// Throws the Failure for what the connection last reported. `what` says what was
// being done.
[[noreturn]] void ThrowSqlite(sqlite3* handle, const std::string& path, const std::string& what);

}  // namespace dreamsearch::results
