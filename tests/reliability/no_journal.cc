// A library to preload: SQLite without a journal, so that a harness can show that it finds what a
// kill breaks then.
#include <dlfcn.h>
#include <sqlite3.h>

#include <cstring>

namespace {

template <typename Function>
Function* Real(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

int sqlite3_open_v2(const char* name, sqlite3** handle, int flags, const char* vfs) {
  const int code = Real<decltype(sqlite3_open_v2)>("sqlite3_open_v2")(name, handle, flags, vfs);
  if (code == SQLITE_OK) {
    // A small cache, so that a transaction reaches the file before it is committed.
    Real<decltype(sqlite3_exec)>("sqlite3_exec")(
        *handle, "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF", nullptr, nullptr, nullptr);
  }
  return code;
}

int sqlite3_exec(sqlite3* handle, const char* sql, int (*call)(void*, int, char**, char**),
                 void* argument, char** error) {
  if (std::strstr(sql, "journal_mode = ") != nullptr ||
      std::strstr(sql, "synchronous = ") != nullptr) {
    return SQLITE_OK;
  }
  if (std::strstr(sql, "cache_size = ") != nullptr) sql = "PRAGMA cache_size = 5";
  return Real<decltype(sqlite3_exec)>("sqlite3_exec")(handle, sql, call, argument, error);
}
}
#pragma GCC visibility pop
