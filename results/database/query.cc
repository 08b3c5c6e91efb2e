#include "results/database/query.h"

#include <sqlite3.h>

#include <cstring>

#include "results/system/error.h"
#include "results/text/text.h"

namespace dreamsearch::results {
namespace {

// Reading tables and calling functions, nothing that attaches or sets.
int AllowReading(void*, int action, const char* name, const char*, const char*, const char*) {
  switch (action) {
    case SQLITE_SELECT:
    case SQLITE_READ:
    case SQLITE_FUNCTION:
    case SQLITE_RECURSIVE:
      return SQLITE_OK;
    case SQLITE_UPDATE:
      // How json_each and other table functions make themselves known to the connection;
      // SQLite refuses the statement that says so.
      return std::strcmp(name, "sqlite_master") == 0 ? SQLITE_OK : SQLITE_DENY;
    default:
      return SQLITE_DENY;
  }
}

constexpr char kReadsOnly[] = "the query may read tables and views and nothing else";

// Asks AllowReading about all that is prepared and run while it lives.
class Authorized {
 public:
  explicit Authorized(sqlite3* handle) : handle_(handle) {
    sqlite3_set_authorizer(handle_, AllowReading, nullptr);
  }
  ~Authorized() { sqlite3_set_authorizer(handle_, nullptr, nullptr); }
  Authorized(const Authorized&) = delete;
  Authorized& operator=(const Authorized&) = delete;

 private:
  sqlite3* handle_;
};

}  // namespace

std::vector<Cell> ReadCells(const Statement& statement) {
  std::vector<Cell> row;
  for (int i = 0; i < statement.columns(); ++i) {
    if (statement.IsNull(i)) {
      row.emplace_back();
    } else if (statement.IsInt(i)) {
      row.emplace_back(statement.Int(i));
    } else if (statement.IsReal(i)) {
      row.emplace_back(statement.Real(i));
    } else {
      row.emplace_back(statement.Text(i));
    }
  }
  return row;
}

Table ReadTable(Statement* statement) {
  Table table;
  for (int i = 0; i < statement->columns(); ++i) table.columns.push_back(statement->ColumnName(i));
  while (statement->Step()) table.rows.push_back(ReadCells(*statement));
  return table;
}

Table RunQuery(Database* database, const std::string& sql) {
  sqlite3* handle = database->connection().handle();
  const Authorized reading(handle);
  sqlite3_stmt* prepared = nullptr;
  const char* rest = nullptr;
  const int code =
      sqlite3_prepare_v2(handle, sql.data(), static_cast<int>(sql.size()), &prepared, &rest);
  const std::string reason = sqlite3_errmsg(handle);
  const std::string path = database->path();
  Statement statement(prepared, &path);
  if ((code & 0xff) == SQLITE_AUTH) {
    throw Failure(ExitCode::kUsage, kReadsOnly);
  }
  if (code != SQLITE_OK)
    throw Failure(ExitCode::kUsage, path + ": the query is not understood: " + reason);
  if (prepared == nullptr) throw Failure(ExitCode::kUsage, "expected a query, found none");
  const std::string left(rest, sql.data() + sql.size());
  if (left.find_first_not_of(" \t\r\n;") != std::string::npos) {
    throw Failure(ExitCode::kUsage, "expected one query, found more after it: " + Printable(left));
  }
  // What a statement does by itself while it runs (VACUUM INTO attaches a file) is asked for too.
  if (sqlite3_stmt_readonly(prepared) == 0) throw Failure(ExitCode::kUsage, kReadsOnly);
  try {
    return ReadTable(&statement);
  } catch (const Failure& error) {
    if (error.code() != ExitCode::kInternal) throw;
    throw Failure(ExitCode::kUsage, error.what());  // "integer overflow": the query's, not ours
  }
}

}  // namespace dreamsearch::results
