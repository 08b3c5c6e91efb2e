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
  sqlite3_set_authorizer(handle, AllowReading, nullptr);
  sqlite3_stmt* prepared = nullptr;
  const char* rest = nullptr;
  const int code =
      sqlite3_prepare_v2(handle, sql.data(), static_cast<int>(sql.size()), &prepared, &rest);
  const std::string reason = sqlite3_errmsg(handle);
  sqlite3_set_authorizer(handle, nullptr, nullptr);
  const std::string path = database->path();
  Statement statement(prepared, &path);
  if ((code & 0xff) == SQLITE_AUTH) {
    throw Failure(ExitCode::kUsage, "the query may read tables and views and nothing else");
  }
  if (code != SQLITE_OK)
    throw Failure(ExitCode::kUsage, path + ": the query is not understood: " + reason);
  if (prepared == nullptr) throw Failure(ExitCode::kUsage, "expected a query, found none");
  const std::string left(rest, sql.data() + sql.size());
  if (left.find_first_not_of(" \t\r\n;") != std::string::npos) {
    throw Failure(ExitCode::kUsage, "expected one query, found more after it: " + Printable(left));
  }
  return ReadTable(&statement);
}

}  // namespace dreamsearch::results
