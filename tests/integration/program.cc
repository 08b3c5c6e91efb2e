#include "tests/integration/program.h"

#include <fcntl.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <system_error>
#include <thread>

namespace dreamsearch {
namespace {

std::string Read(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

Workplace::Workplace() {
  std::string name = (std::filesystem::temp_directory_path() / "dreamsearch_XXXXXX").string();
  folder_ = ::mkdtemp(name.data());
}

// What a process that is ending removes meanwhile (SQLite's own files) is no error of the test.
Workplace::~Workplace() {
  std::error_code error;
  for (int attempt = 0; attempt < 50; ++attempt) {
    std::filesystem::remove_all(folder_, error);
    if (!error) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  std::cerr << "cannot remove " << folder_ << ": " << error.message() << "\n";
}

pid_t Workplace::Start(const std::vector<std::string>& arguments, const char* name) const {
  const pid_t pid = ::fork();
  if (pid != 0) return pid;
  if (::chdir(folder_.c_str()) != 0) ::_exit(120);
  // No run of another test, or of another person, shares its cores with these.
  ::setenv("TMPDIR", folder_.c_str(), 1);
#if defined(__SANITIZE_ADDRESS__)
  // A library that a test preloads comes before the sanitizer's own.
  const char* options = std::getenv("ASAN_OPTIONS");
  ::setenv("ASAN_OPTIONS",
           (std::string(options == nullptr ? "" : options) + ":verify_asan_link_order=0").c_str(),
           1);
#endif
  const std::string suffix = "." + std::to_string(::getpid());
  ::dup2(::open("/dev/null", O_RDONLY), 0);
  ::dup2(::open(("out" + suffix).c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), 1);
  ::dup2(::open(("err" + suffix).c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), 2);
  const std::string program = std::string(DREAMSEARCH_TEST_BIN_DIR) + "/" + name;
  std::vector<char*> argv = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  ::execv(program.c_str(), argv.data());
  ::_exit(121);
}

ProgramResult Workplace::Wait(pid_t pid) const {
  int status = 0;
  ::waitpid(pid, &status, 0);
  ProgramResult result;
  result.exit_status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  result.out = Read(folder_ / ("out." + std::to_string(pid)));
  result.err = Read(folder_ / ("err." + std::to_string(pid)));
  std::filesystem::remove(folder_ / ("out." + std::to_string(pid)));
  std::filesystem::remove(folder_ / ("err." + std::to_string(pid)));
  return result;
}

ProgramResult Workplace::Runner(const std::vector<std::string>& arguments) const {
  return Wait(Start(arguments));
}

ProgramResult Workplace::Results(const std::vector<std::string>& arguments) const {
  return Wait(Start(arguments, "results"));
}

std::vector<std::string> Workplace::Query(const std::string& db, const std::string& sql) const {
  sqlite3* connection = nullptr;
  std::vector<std::string> rows;
  if (::sqlite3_open_v2(Path(db).c_str(), &connection, SQLITE_OPEN_READWRITE, nullptr) ==
      SQLITE_OK) {
    ::sqlite3_busy_timeout(connection, 10000);
    sqlite3_stmt* statement = nullptr;
    ::sqlite3_prepare_v2(connection, sql.c_str(), -1, &statement, nullptr);
    while (statement != nullptr && ::sqlite3_step(statement) == SQLITE_ROW) {
      std::string row;
      for (int i = 0; i < ::sqlite3_column_count(statement); ++i) {
        const auto* text = reinterpret_cast<const char*>(::sqlite3_column_text(statement, i));
        row += (i == 0 ? "" : "|") + std::string(text != nullptr ? text : "NULL");
      }
      rows.push_back(row);
    }
    ::sqlite3_finalize(statement);
  }
  ::sqlite3_close(connection);
  return rows;
}

std::string Workplace::Value(const std::string& db, const std::string& sql) const {
  const std::vector<std::string> rows = Query(db, sql);
  return rows.empty() ? "" : rows[0];
}

int Workplace::Python(const std::string& script) const {
  const std::string command =
      "cd '" + folder_.string() + "' && /usr/bin/python3 -c \"" + script + "\"";
  return std::system(command.c_str());
}

bool HasNumPy() { return std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") == 0; }

bool Workplace::WaitForStep(const std::string& db, int env_step, int seconds) const {
  for (int i = 0; i < 200 * seconds; ++i) {
    const std::string done = Value(db, "select max(env_step) from step");
    if (!done.empty() && done != "NULL" && std::stoi(done) >= env_step) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

std::vector<std::string> TinyRun(const std::string& environment, const std::string& planner,
                                 const std::string& db, const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"--env", environment, "--planner", planner,
                                        "--db",  db,          "--steps",   "4000"};
  for (const char* setting :
       {"run.prefill_steps=1000", "run.pretrain_updates=4", "run.train_every=250",
        "run.batch_size=4", "run.sequence_length=8", "run.eval_episodes=1", "run.eval_every=2000",
        "run.checkpoint_every=1000", "model.hidden=16", "model.deterministic=16",
        "model.stochastic=4", "model.imagination_starts=8", "model.horizon=3"}) {
    arguments.insert(arguments.end(), {"--set", setting});
  }
  if (planner.find("mcts") != std::string::npos) {
    arguments.insert(arguments.end(), {"--set", "planner.simulations=6"});
  }
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

}  // namespace dreamsearch
