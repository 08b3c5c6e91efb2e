// A worker does not outlive its supervisor by more than its time to checkpoint, whatever it does
// and whenever the supervisor goes.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

// Processes of `runner` that work in the folder.
std::vector<pid_t> Workers(const std::filesystem::path& folder) {
  std::vector<pid_t> found;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::error_code error;
    const auto cwd = std::filesystem::read_symlink(entry.path() / "cwd", error);
    if (!error && cwd == folder && std::stoi(name) != ::getpid()) found.push_back(std::stoi(name));
  }
  return found;
}

bool AllEndWithin(const std::filesystem::path& folder, milliseconds time) {
  const auto deadline = std::chrono::steady_clock::now() + time;
  while (!Workers(folder).empty()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(milliseconds(20));
  }
  return true;
}

void KillAll(const std::filesystem::path& folder) {
  for (const pid_t pid : Workers(folder)) ::kill(pid, SIGKILL);
}

// Aimed at the moment after the worker was spawned, before it has asked for its signal.
TEST(Orphan, AWorkerWhoseSupervisorDiesRightAfterSpawningItEnds) {
  int workers_seen = 0;
  for (int i = 0; i < 12; ++i) {
    const Workplace place;
    std::vector<std::string> run = TinyRun("cartpole_balance", "random", "o.db");
    for (std::string& word : run) {
      if (word == "4000") word = "400000";
    }
    const pid_t supervisor = place.Start(run);
    const std::string children =
        "/proc/" + std::to_string(supervisor) + "/task/" + std::to_string(supervisor) + "/children";
    // The worker is the child that is there once its log is.
    bool spawned = false;
    for (int k = 0; k < 100000 && !spawned; ++k) {
      std::error_code error;
      for (const auto& entry :
           std::filesystem::recursive_directory_iterator(place.folder(), error)) {
        if (entry.path().filename() != "run.log") continue;
        std::ifstream file(children);
        int child = 0;
        spawned = static_cast<bool>(file >> child);
      }
      std::this_thread::sleep_for(microseconds(100));
    }
    ASSERT_TRUE(spawned);
    std::this_thread::sleep_for(microseconds(500 * i));
    ::kill(supervisor, SIGKILL);
    workers_seen += Workers(place.folder()).empty() ? 0 : 1;
    place.Wait(supervisor);
    EXPECT_TRUE(AllEndWithin(place.folder(), milliseconds(15000)))
        << "killed " << 0.5 * i << " ms after the worker was spawned";
    KillAll(place.folder());
  }
  EXPECT_GT(workers_seen, 0);
}

TEST(Orphan, AWorkerThatHangsInAPluginEndsOnceItsTimeToCheckpointIsOver) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ThreadSanitizer keeps a signal back until the program calls the system";
#endif
  const Workplace place;
  std::vector<std::string> run = TinyRun("cartpole_balance", "hanging_planner", "o.db",
                                         {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR,
                                          "--hang-timeout", "2", "--model", "idle_model"});
  std::erase_if(run, [](const std::string& word) { return word.starts_with("model."); });
  // Each setting went without its flag.
  std::vector<std::string> words;
  for (std::size_t i = 0; i < run.size(); ++i) {
    if (run[i] == "--set" && (i + 1 == run.size() || !run[i + 1].starts_with("run."))) continue;
    words.push_back(run[i]);
  }
  const pid_t supervisor = place.Start(words);
  bool hangs = false;
  for (int i = 0; i < 3000 && !hangs; ++i) {
    std::this_thread::sleep_for(milliseconds(10));
    hangs = !place.Value("o.db", "select 1 from step where env_step >= 998").empty();
  }
  ASSERT_TRUE(hangs);
  std::this_thread::sleep_for(milliseconds(300));
  ::kill(supervisor, SIGKILL);
  place.Wait(supervisor);
  EXPECT_FALSE(Workers(place.folder()).empty()) << "the worker did not hang";
  EXPECT_TRUE(AllEndWithin(place.folder(), milliseconds(10000)));
  KillAll(place.folder());
}

// One that is stopped holds its run; whoever asks for the run is told so, and not with exit 0.
TEST(Orphan, ARunThatASilentWorkerHoldsIsSaidSo) {
  const Workplace place;
  std::vector<std::string> run = TinyRun("cartpole_balance", "random", "o.db");
  for (std::string& word : run) {
    if (word == "4000") word = "4000000";
  }
  const pid_t supervisor = place.Start(run);
  for (int i = 0; i < 3000 && place.Value("o.db", "select 1 from segment").empty(); ++i) {
    std::this_thread::sleep_for(milliseconds(10));
  }
  const std::string pid = place.Value("o.db", "select pid from segment");
  ASSERT_FALSE(pid.empty());
  ::kill(supervisor, SIGSTOP);
  ::kill(std::stoi(pid), SIGSTOP);
  const ProgramResult soon = place.Runner(run);
  EXPECT_EQ(soon.exit_status, 0) << soon.err;  // it may be at work
  place.Query("o.db", "update run set heartbeat_utc = '2020-01-01T00:00:00.000Z'");
  for (const auto& command : {run, std::vector<std::string>{"resume", "1", "--db", "o.db"}}) {
    const ProgramResult later = place.Runner(command);
    EXPECT_EQ(later.exit_status, 74) << later.err;
    EXPECT_NE(later.err.find("process " + pid + " of "), std::string::npos) << later.err;
  }
  KillAll(place.folder());
  place.Wait(supervisor);
}

}  // namespace
}  // namespace dreamsearch
