// What the machine does to a run - locks, signals, disks, names - costs no row and no lie.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <thread>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

using std::chrono::milliseconds;

bool WaitFor(const std::function<bool()>& there) {
  for (int i = 0; i < 3000; ++i) {
    if (there()) return true;
    std::this_thread::sleep_for(milliseconds(10));
  }
  return false;
}

bool Holds(const std::string& path, const std::string& text) {
  std::ifstream file(path);
  const std::string said((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  return said.find(text) != std::string::npos;
}

bool HasBegun(const Workplace& place, const std::string& db) {
  return WaitFor([&] { return !place.Value(db, "select 1 from segment").empty(); });
}

// A training that takes longer than what is done to it.
std::vector<std::string> LongRun(const std::string& db, const std::string& steps = "60000") {
  std::vector<std::string> run = TinyRun("cartpole_balance", "random", db, {"--jobs", "2"});
  const std::pair<const char*, std::string> changes[] = {
      {"4000", steps},
      {"run.checkpoint_every=1000", "run.checkpoint_every=10000"},
      {"run.eval_every=2000", "run.eval_every=20000"}};
  for (const auto& [from, to] : changes) {
    std::replace(run.begin(), run.end(), std::string(from), to);
  }
  return run;
}

std::vector<std::filesystem::path> Checkpoints(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> found;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".ckpt") found.push_back(entry.path());
  }
  return found;
}

// What a run that nothing happens to ends with.
std::string Undisturbed(const std::vector<std::string>& run) {
  const Workplace place;
  const ProgramResult result = place.Runner(run);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  return place.Value("m.db", "select result_digest from run");
}

std::string Digest(const Workplace& place) {
  return place.Value("m.db", "select result_digest from run");
}

// Holds the write lock of a database while it lives.
class WriteLock {
 public:
  explicit WriteLock(const std::string& path) {
    sqlite3_open_v2(path.c_str(), &connection_, SQLITE_OPEN_READWRITE, nullptr);
    sqlite3_busy_timeout(connection_, 30000);
    taken_ = sqlite3_exec(connection_, "begin immediate", nullptr, nullptr, nullptr) == SQLITE_OK;
  }
  ~WriteLock() {
    sqlite3_exec(connection_, "rollback", nullptr, nullptr, nullptr);
    sqlite3_close(connection_);
  }
  WriteLock(const WriteLock&) = delete;
  WriteLock& operator=(const WriteLock&) = delete;
  bool taken() const { return taken_; }

 private:
  sqlite3* connection_ = nullptr;
  bool taken_ = false;
};

std::string Log(const Workplace& place) {
  return place.Path("m.db.files/" + place.Value("m.db", "select uuid from run") + "/run.log");
}

TEST(LockedDatabase, ARunWaitsForAsLongAsItIsLockedAndSaysSo) {
  const std::vector<std::string> run = LongRun("m.db");
  const Workplace place;
  const pid_t pid = place.Start(run);
  ASSERT_TRUE(HasBegun(place, "m.db"));
  {
    const WriteLock lock(place.Path("m.db"));
    ASSERT_TRUE(lock.taken());
    EXPECT_TRUE(WaitFor([&] { return Holds(Log(place), "waiting: another process has locked"); }));
    EXPECT_TRUE(WaitFor([&] {
      return Holds(place.Path("err." + std::to_string(pid)), "waiting cartpole_balance");
    }));
    std::this_thread::sleep_for(std::chrono::seconds(36));
  }
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_TRUE(Holds(Log(place), "the database is unlocked"));
  EXPECT_EQ(place.Value("m.db", "select status, (select count(*) from segment) from run"),
            "finished|1");
  EXPECT_EQ(Digest(place), Undisturbed(run));
}

TEST(LockedDatabase, AStopWhileItIsLockedLosesNoCommittedRow) {
  const std::vector<std::string> run = LongRun("m.db");
  const Workplace place;
  const pid_t pid = place.Start(run);
  ASSERT_TRUE(HasBegun(place, "m.db"));
  {
    const WriteLock lock(place.Path("m.db"));
    ASSERT_TRUE(lock.taken());
    ASSERT_TRUE(WaitFor([&] { return Holds(Log(place), "waiting: another process has locked"); }));
    const auto asked = std::chrono::steady_clock::now();
    ::kill(pid, SIGTERM);
    const ProgramResult stopped = place.Wait(pid);
    EXPECT_EQ(stopped.exit_status, 75) << stopped.err;
    EXPECT_LT(std::chrono::steady_clock::now() - asked, std::chrono::seconds(15));
  }
  const ProgramResult again = place.Runner(run);
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(Digest(place), Undisturbed(run));
}

// A small file system of its own, on which a run meets its end.
class SmallDisk {
 public:
  explicit SmallDisk(const std::filesystem::path& folder) : folder_(folder) {
    std::filesystem::create_directory(folder_);
    mounted_ = ::mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=32m") == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(folder_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool mounted() const { return mounted_; }
  void Fill() const {
    std::ofstream file(folder_ / "filler", std::ios::binary);
    const std::string block(4096, 'x');
    while (file.write(block.data(), static_cast<std::streamsize>(block.size())).flush()) {
    }
  }
  void Empty() const { std::filesystem::remove(folder_ / "filler"); }

 private:
  std::filesystem::path folder_;
  bool mounted_ = false;
};

TEST(FullDisk, ARunIsInterruptedAndTheSameCommandResumesIt) {
  const Workplace place;
  const SmallDisk disk(place.Path("disk"));
  if (!disk.mounted()) GTEST_SKIP() << "a file system can be mounted by root only";
  const std::vector<std::string> run = LongRun("disk/m.db");
  const pid_t pid = place.Start(run);
  ASSERT_TRUE(HasBegun(place, "disk/m.db"));
  disk.Fill();
  const ProgramResult stopped = place.Wait(pid);
  EXPECT_EQ(stopped.exit_status, 74) << stopped.err;
  EXPECT_NE(stopped.err.find(place.Path("disk")), std::string::npos) << stopped.err;
  EXPECT_NE(stopped.err.find("bytes free"), std::string::npos) << stopped.err;
  disk.Empty();
  const std::string status = place.Value("disk/m.db", "select status from run");
  EXPECT_TRUE(status == "interrupted" || status == "running") << status << stopped.err;
  const ProgramResult again = place.Runner(run);
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(place.Value("disk/m.db", "select result_digest from run"),
            Undisturbed(LongRun("m.db")));
}

// The database is on one disk, the run's files on another that has no room: rows can be kept.
TEST(FullDisk, ACheckpointThatCannotBeWrittenInterruptsTheRun) {
  const std::vector<std::string> run = LongRun("m.db");
  const Workplace place;
  const SmallDisk disk(place.Path("m.db.files"));
  if (!disk.mounted()) GTEST_SKIP() << "a file system can be mounted by root only";
  const pid_t pid = place.Start(run);
  ASSERT_TRUE(HasBegun(place, "m.db"));
  disk.Fill();
  const ProgramResult stopped = place.Wait(pid);
  EXPECT_EQ(stopped.exit_status, 74) << stopped.err;
  EXPECT_NE(stopped.err.find("interrupted cartpole_balance"), std::string::npos) << stopped.err;
  EXPECT_NE(stopped.err.find("resume with the same command"), std::string::npos) << stopped.err;
  EXPECT_EQ(place.Value("m.db", "select status, exit_code from run"), "interrupted|74");
  EXPECT_EQ(place.Value("m.db", "select level from event where kind = 'interrupted'"), "warning");
  disk.Empty();
  const ProgramResult again = place.Runner(run);
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(Digest(place), Undisturbed(run));
}

// The advice of each message leads on: first room, then over the other run's checkpoint.
TEST(FullDisk, WhatTheMessagesAdviseEndsARunThatAnothersCheckpointBlocks) {
  const Workplace place, elsewhere;
  const SmallDisk disk(place.Path("disk"));
  if (!disk.mounted()) GTEST_SKIP() << "a file system can be mounted by root only";
  const std::vector<std::string> run = LongRun("disk/m.db");
  ASSERT_EQ(elsewhere.Runner(TinyRun("cartpole_balance", "random", "o.db")).exit_status, 0);
  const pid_t pid = place.Start(run);
  ASSERT_TRUE(HasBegun(place, "disk/m.db"));
  disk.Fill();
  ASSERT_EQ(place.Wait(pid).exit_status, 74);
  disk.Empty();
  const auto files = [](const Workplace& of, const std::string& db) {
    return std::filesystem::path(of.Path(db + ".files")) / of.Value(db, "select uuid from run");
  };
  const std::filesystem::path folder = files(place, "disk/m.db");
  for (const std::filesystem::path& path : Checkpoints(folder)) std::filesystem::remove(path);
  const auto others = Checkpoints(files(elsewhere, "o.db"));
  ASSERT_FALSE(others.empty());
  for (const std::filesystem::path& other : others) {
    std::filesystem::copy(other, folder / other.filename());
  }

  const ProgramResult blocked = place.Runner(run);
  EXPECT_EQ(blocked.exit_status, 65) << blocked.err;
  EXPECT_NE(blocked.err.find("--retry --replace"), std::string::npos) << blocked.err;
  std::vector<std::string> over = run;
  over.insert(over.end(), {"--retry", "--replace"});
  disk.Fill();
  const ProgramResult full = place.Runner(over);
  EXPECT_EQ(full.exit_status, 74) << full.err;
  EXPECT_NE(full.err.find("the disk is full (0 bytes free there). Make room and run the same "
                          "command again."),
            std::string::npos)
      << full.err;
  disk.Empty();
  const ProgramResult again = place.Runner(over);
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(place.Value("disk/m.db", "select status, result_digest from run"),
            "finished|" + Undisturbed(LongRun("m.db")));
}

// Runs the body with a variable of the environment set, which programs started by it inherit.
void WithPreloaded(const char* library, const std::function<void()>& body) {
  ::setenv("LD_PRELOAD", library, 1);
  body();
  ::unsetenv("LD_PRELOAD");
}

TEST(NoFlock, ARunIsLockedByOtherMeans) {
  for (const char* library : {DREAMSEARCH_FLOCK_ENOSYS, DREAMSEARCH_FLOCK_ENOLCK}) {
    const Workplace place;
    pid_t first = -1, second = -1;
    WithPreloaded(library, [&] { first = place.Start(LongRun("m.db", "30000")); });
    ASSERT_TRUE(HasBegun(place, "m.db"));
    WithPreloaded(library, [&] { second = place.Start(LongRun("m.db", "30000")); });
    const ProgramResult other = place.Wait(second);
    EXPECT_EQ(other.exit_status, 0) << other.err;
    EXPECT_NE(other.err.find("another process is working on it"), std::string::npos) << other.err;
    const ProgramResult result = place.Wait(first);
    EXPECT_EQ(result.exit_status, 0) << result.err;
    EXPECT_EQ(place.Value("m.db", "select status, (select count(*) from segment) from run"),
              "finished|1");
  }
}

TEST(IgnoredSignal, StaysIgnoredInRunnerAndWorker) {
  for (const int signal : {SIGHUP, SIGINT, SIGTERM}) {
    const Workplace place;
    ::signal(signal, SIG_IGN);
    const pid_t pid = place.Start(LongRun("m.db", "20000"));
    ::signal(signal, SIG_DFL);
    ASSERT_TRUE(HasBegun(place, "m.db"));
    ::kill(pid, signal);
    ::kill(std::stoi(place.Value("m.db", "select pid from segment")), signal);
    const ProgramResult result = place.Wait(pid);
    EXPECT_EQ(result.exit_status, 0) << signal << result.err;
    EXPECT_EQ(place.Value("m.db", "select status, (select count(*) from segment) from run"),
              "finished|1");
  }
}

TEST(IgnoredSignal, AnotherOneStillStopsTheRunWithACheckpoint) {
  const Workplace place;
  ::signal(SIGTERM, SIG_IGN);
  const pid_t pid = place.Start(LongRun("m.db"));
  ::signal(SIGTERM, SIG_DFL);
  ASSERT_TRUE(HasBegun(place, "m.db"));
  ::kill(pid, SIGINT);
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 75) << result.err;
  EXPECT_EQ(place.Value("m.db", "select status from run"), "interrupted");
  EXPECT_EQ(place.Value("m.db", "select count(*) from artifact where kind = 'checkpoint'"), "1");
}

std::size_t Entries(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::recursive_directory_iterator(folder), {}));
}

// What a command says of names that are not UTF-8: a sentence, and nothing is written.
TEST(OtherEncoding, IsRefusedBeforeAnythingIsWritten) {
  const Workplace place;
  const std::string folder = "b\xe9";
  std::filesystem::create_directory(place.Path(folder));
  std::ofstream(place.Path(folder + "/a.cfg")) << "steps = 4000\n";
  std::ofstream(place.Path("a.cfg")) << "study = s\nset = env.text=b\xe9\n";
  std::filesystem::create_symlink(place.Path(folder), place.Path("link"));
  const std::size_t before = Entries(place.folder());
  const std::pair<std::vector<std::string>, int> cases[] = {
      {TinyRun("cartpole_balance", "random", folder + "/m.db"), 2},
      {TinyRun("cartpole_balance", "random", "link/m.db"), 2},
      {TinyRun("cartpole_balance", "random", "m.db", {"--plugin-path", folder}), 2},
      {TinyRun("cartpole_balance", "random", "m.db", {"--plugin-path", "link"}), 66},
      {TinyRun("cartpole_balance", "random", "m.db", {"--config", folder + "/a.cfg"}), 2},
      {TinyRun("cartpole_balance", "random", "m.db", {"--config", "a.cfg"}), 65},
      {{"eval", "--env", "cartpole_balance", "--planner", "random", "--db", "link/m.db"}, 2},
      {{"resume", "--db", folder + "/m.db"}, 2},
      {{"status", "--db", "link/m.db"}, 2}};
  for (const auto& [words, status] : cases) {
    const ProgramResult result = place.Runner(words);
    EXPECT_EQ(result.exit_status, status) << result.err;
    EXPECT_NE(result.err.find("UTF-8"), std::string::npos) << result.err;
    EXPECT_EQ(result.err.find("defect"), std::string::npos) << result.err;
    EXPECT_EQ(Entries(place.folder()), before) << result.err;
  }
  const ProgramResult results = place.Results({"list", "--db", folder + "/m.db"});
  EXPECT_EQ(results.exit_status, 2) << results.err;
}

TEST(OtherEncoding, OfTheWorkingFolderIsRefusedOnlyWhereItIsNamed) {
  const Workplace place;
  std::filesystem::create_directory(place.Path("b\xe9"));
  const auto call = [&](const std::string& db) {
    std::string command = "cd \"$0\" && " DREAMSEARCH_TEST_BIN_DIR "/runner";
    for (const std::string& word : TinyRun("cartpole_balance", "random", db)) command += " " + word;
    const std::string line =
        "bash -c '" + command + "' " + place.Path("b\xe9") + " 2> " + place.Path("err");
    return WEXITSTATUS(std::system(line.c_str()));
  };
  EXPECT_EQ(call("m.db"), 2);
  EXPECT_TRUE(Holds(place.Path("err"), "UTF-8"));
  EXPECT_TRUE(std::filesystem::is_empty(place.Path("b\xe9")));
  EXPECT_EQ(call(place.Path("m.db")), 0);
  EXPECT_EQ(place.Value("m.db", "select status from run"), "finished");
}

// The command after "next: ", pasted into a shell.
TEST(Advice, CanBePasted) {
  const Workplace place;
  for (const char* name : {"my dir", "it's", "a$HOME;b", "\xd0\xb4\xd0\xb1"}) {
    std::filesystem::create_directory(place.Path(name));
    const std::string db = std::string(name) + "/y.db";
    const ProgramResult result = place.Runner(TinyRun("cartpole_balance", "random", db));
    ASSERT_EQ(result.exit_status, 0) << result.err;
    const std::size_t begin = result.err.find("next: ") + 6;
    const std::string command = result.err.substr(begin, result.err.find('\n', begin) - begin);
    std::ofstream(place.Path("pasted.sh")) << command << " > out.txt 2>&1\n";
    const std::string shell = "cd " + place.folder().string() + " && sh pasted.sh";
    EXPECT_EQ(std::system(shell.c_str()), 0) << command;
    EXPECT_TRUE(Holds(place.Path("out.txt"), "cartpole_balance")) << command;
  }
}

TEST(Advice, OfARunWhoseFilesAreGoneIsItsCommand) {
  const Workplace place;
  std::filesystem::create_directory(place.Path("my dir"));
  const std::vector<std::string> run = TinyRun("cartpole_balance", "random", "my dir/y.db");
  ASSERT_EQ(place.Runner(run).exit_status, 0);
  std::filesystem::remove_all(place.Path("my dir/y.db.files"));
  const ProgramResult result = place.Runner({"export", "1", "--db", "my dir/y.db"});
  EXPECT_EQ(result.exit_status, 66) << result.err;
  EXPECT_NE(result.err.find("`results delete 1 --yes --db '" + place.Path("my dir/y.db") + "'`"),
            std::string::npos)
      << result.err;
  EXPECT_NE(result.err.find("runner --env cartpole_balance --planner random --db 'my dir/y.db'"),
            std::string::npos)
      << result.err;
}

}  // namespace
}  // namespace dreamsearch
