// What a site forbids or does - no locks, no temporary folder, no home, a quota, clocks that
// differ, a disk that nodes share - gives a sentence and the right exit code, and costs no row.
// Over 400 lines: the sites that most of them share are made here.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <thread>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

using Variables = std::map<std::string, std::string>;

// Variables for the programs that the body starts.
void With(const Variables& variables, const std::function<void()>& body) {
  for (const auto& [name, value] : variables) ::setenv(name.c_str(), value.c_str(), 1);
  body();
  for (const auto& [name, value] : variables) ::unsetenv(name.c_str());
}

ProgramResult RunWith(const Workplace& place, Variables variables,
                      const std::vector<std::string>& words) {
  variables.emplace("LD_PRELOAD", DREAMSEARCH_SITE);
  ProgramResult result;
  With(variables, [&] { result = place.Runner(words); });
  return result;
}

// A training of about a second, and one that takes longer than what is done to it.
std::vector<std::string> Short(const std::string& db, std::vector<std::string> more = {}) {
  more.insert(more.end(), {"--jobs", "2"});
  return TinyRun("cartpole_balance", "random", db, more);
}
std::vector<std::string> Long(const std::string& db, const std::vector<std::string>& more = {}) {
  std::vector<std::string> run = Short(db, more);
  for (std::string& word : run) {
    if (word == "4000") word = "60000";
    if (word == "run.checkpoint_every=1000") word = "run.checkpoint_every=5000";
    if (word == "run.eval_every=2000") word = "run.eval_every=20000";
  }
  return run;
}

std::string Digests(const Workplace& place, const std::string& db) {
  std::string all;
  for (const std::string& row :
       place.Query(db, "select seed, status, result_digest from run order by seed")) {
    all += row + "\n";
  }
  return all;
}

std::string Undisturbed(const std::vector<std::string>& run) {
  const Workplace place;
  const ProgramResult result = place.Runner(run);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  return Digests(place, "m.db");
}

bool WaitFor(const std::function<bool()>& there) {
  for (int i = 0; i < 6000; ++i) {
    if (there()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

// The database in a scratch folder, relative to the workplace; empty while it is not there.
std::string ScratchDatabase(const Workplace& place) {
  std::error_code error;
  for (std::filesystem::recursive_directory_iterator at(place.Path("scratch"), error), end;
       !error && at != end; at.increment(error)) {
    if (at->path().filename() == "m.db") {
      return at->path().lexically_relative(place.folder()).string();
    }
  }
  return "";
}

bool IsEmpty(const Workplace& place, const std::string& folder) {
  return std::filesystem::is_empty(place.Path(folder));
}

TEST(NoLocks, AreSaidAndNotTakenForAnotherProcess) {
  for (const int error : {ENOLCK, ENOSYS, EOPNOTSUPP}) {
    const Workplace place;
    std::filesystem::create_directory(place.Path("shared"));
    const auto begun = std::chrono::steady_clock::now();
    const ProgramResult result = RunWith(
        place,
        {{"SITE_NO_LOCKS", place.Path("shared")}, {"SITE_LOCK_ERROR", std::to_string(error)}},
        Short("shared/m.db"));
    EXPECT_EQ(result.exit_status, 74) << error << result.err;
    EXPECT_NE(result.err.find("files cannot be locked here"), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("--scratch"), std::string::npos) << result.err;
    EXPECT_EQ(result.err.find("another process"), std::string::npos) << result.err;
    EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(25));
  }
}

TEST(NoLocks, AreNotNeededWithAScratchFolder) {
  const Workplace place;
  std::filesystem::create_directory(place.Path("shared"));
  const Variables site = {{"SITE_NO_LOCKS", place.Path("shared")},
                          {"SITE_LOCK_ERROR", std::to_string(ENOLCK)}};
  const std::vector<std::string> scratch = {"--scratch", "scratch"};
  ProgramResult result = RunWith(place, site, Short("shared/m.db", scratch));
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Digests(place, "shared/m.db"), Undisturbed(Short("m.db")));
  // And a second time, which must read it there.
  result = RunWith(place, site, Short("shared/m.db", scratch));
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_NE(result.err.find("1 to skip, finished"), std::string::npos) << result.err;
}

TEST(Scratch, ASweepIsPutBackWholeWithItsFiles) {
  const Workplace place;
  const ProgramResult first = place.Runner(Short("shared/m.db"));
  ASSERT_EQ(first.exit_status, 0) << first.err;
  const std::string before = Digests(place, "shared/m.db");
  const pid_t pid = place.Start(Long("shared/m.db", {"--seeds", "2", "--scratch", "scratch"}));
  ASSERT_TRUE(WaitFor([&] {
    const std::string copy = ScratchDatabase(place);
    return !copy.empty() && place.Value(copy, "select count(*) from segment") == "3";
  }));
  EXPECT_EQ(Digests(place, "shared/m.db"), before);  // untouched so far
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_TRUE(IsEmpty(place, "scratch"));
  EXPECT_EQ(place.Value("shared/m.db", "select count(*) from run where status = 'finished'"), "3");
  for (const std::string& path :
       place.Query("shared/m.db",
                   "select path from artifact a where env_step = (select"
                   " max(env_step) from artifact b where b.run_id = a.run_id)")) {
    EXPECT_TRUE(std::filesystem::exists(place.Path("shared/" + path))) << path;
  }
  for (const std::string& path : place.Query("shared/m.db", "select log_path from run")) {
    EXPECT_TRUE(std::filesystem::exists(place.Path("shared/" + path))) << path;
  }
  EXPECT_EQ(place.Results({"verify", "--db", "shared/m.db"}).exit_status, 0);
}

TEST(Scratch, AStoppedRunIsPutBackAndResumesWithoutOne) {
  const Workplace place;
  const pid_t pid = place.Start(Long("shared/m.db", {"--scratch", "scratch"}));
  ASSERT_TRUE(WaitFor([&] {
    const std::string copy = ScratchDatabase(place);
    return !copy.empty() && !place.Value(copy, "select 1 from artifact").empty();
  }));
  ::kill(pid, SIGTERM);
  const ProgramResult stopped = place.Wait(pid);
  EXPECT_EQ(stopped.exit_status, 75) << stopped.err;
  EXPECT_TRUE(IsEmpty(place, "scratch"));
  EXPECT_EQ(place.Value("shared/m.db", "select status from run"), "interrupted");
  const ProgramResult again = place.Runner(Long("shared/m.db"));
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_GT(std::stoi(place.Value("shared/m.db", "select max(from_env_step) from segment")), 0);
  EXPECT_EQ(Digests(place, "shared/m.db"), Undisturbed(Long("m.db")));
}

TEST(Scratch, AfterAKillTheSameCommandGoesOnWithTheCopy) {
  const Workplace place;
  const std::vector<std::string> run = Long("shared/m.db", {"--scratch", "scratch"});
  const pid_t pid = place.Start(run);
  std::string copy;
  ASSERT_TRUE(WaitFor([&] {
    copy = ScratchDatabase(place);
    return !copy.empty() && !place.Value(copy, "select 1 from artifact").empty();
  }));
  ::kill(std::stoi(place.Value(copy, "select pid from segment")), SIGKILL);
  ::kill(pid, SIGKILL);
  place.Wait(pid);
  EXPECT_FALSE(std::filesystem::exists(place.Path("shared/m.db")));
  const ProgramResult again = place.Runner(run);
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_GT(std::stoi(place.Value("shared/m.db", "select max(from_env_step) from segment")), 0);
  EXPECT_EQ(Digests(place, "shared/m.db"), Undisturbed(Long("m.db")));
  EXPECT_TRUE(IsEmpty(place, "scratch"));
}

// Killed before and after each renaming of a file below the shared folder, in one command after
// the other, until nothing is left to rename.
TEST(Scratch, AKillAtAnyMomentOfPuttingBackLeavesTheOldOrTheNew) {
  const Workplace place;
  ASSERT_EQ(place.Runner(Short("shared/m.db")).exit_status, 0);
  const std::vector<std::string> run =
      Short("shared/m.db", {"--seeds", "2", "--scratch", "scratch"});
  int kills = 0;
  bool done = false;
  for (int point = 1; point < 200 && !done; ++point) {
    const ProgramResult result = RunWith(
        place, {{"SITE_KILL", place.Path("shared")}, {"SITE_KILL_AT", std::to_string(point)}}, run);
    done = result.exit_status == 0;
    if (!done) {
      ASSERT_EQ(result.exit_status, 128 + SIGKILL) << point << result.err;
      ++kills;
    }
    EXPECT_EQ(place.Value("shared/m.db", "pragma integrity_check"), "ok") << point;
    EXPECT_GE(
        std::stoi(place.Value("shared/m.db", "select count(*) from run where status = 'finished'")),
        1);
  }
  EXPECT_TRUE(done);
  EXPECT_GE(kills, 4);
  EXPECT_EQ(Digests(place, "shared/m.db"), Undisturbed(Short("m.db", {"--seeds", "2"})));
  EXPECT_TRUE(IsEmpty(place, "scratch"));
  EXPECT_EQ(place.Results({"verify", "--db", "shared/m.db"}).exit_status, 0);
}

TEST(Scratch, WhatOthersWriteMeanwhileStays) {
  const Workplace place;
  ASSERT_EQ(place.Runner(Short("shared/m.db")).exit_status, 0);
  const pid_t pid = place.Start(Long("shared/m.db", {"--seed-list", "1", "--scratch", "scratch"}));
  ASSERT_TRUE(WaitFor([&] { return !ScratchDatabase(place).empty(); }));
  const ProgramResult other = place.Runner(Short("shared/m.db", {"--seed-list", "2"}));
  EXPECT_EQ(other.exit_status, 0) << other.err;
  const ProgramResult result = place.Wait(pid);
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(place.Query("shared/m.db", "select seed, status from run order by seed"),
            (std::vector<std::string>{"0|finished", "1|finished", "2|finished"}));
  EXPECT_EQ(place.Results({"verify", "--db", "shared/m.db"}).exit_status, 0);
}

// Files are only put back of what was worked on in the copy. The other process has gone on
// meanwhile, and removed checkpoints that the copy still has.
TEST(Scratch, ARunThatOthersResumeMeanwhileKeepsItsNewerCheckpoints) {
  const Workplace place;
  const auto start = [&](const std::vector<std::string>& more) {
    std::vector<std::string> run = Long("shared/m.db", more);
    std::replace(run.begin(), run.end(), std::string("60000"), std::string("6000000"));
    return place.Start(run);
  };
  const auto newest = [&] {
    const std::string step = place.Value(
        "shared/m.db", "select ifnull(max(env_step), 0) from artifact where run_id = 1");
    return step.empty() ? 0 : std::stoi(step);
  };
  pid_t other = start({});
  ASSERT_TRUE(WaitFor([&] { return newest() > 0; }));
  ::kill(other, SIGTERM);
  EXPECT_EQ(place.Wait(other).exit_status, 75);

  const pid_t pid = start({"--seed-list", "1", "--scratch", "scratch"});
  ASSERT_TRUE(WaitFor([&] {
    const std::string copy = ScratchDatabase(place);
    return !copy.empty() && place.Value(copy, "select count(*) from segment") == "2";
  }));
  const int before = newest();
  other = start({});
  ASSERT_TRUE(WaitFor([&] { return newest() > before + 10000; }));
  ::kill(other, SIGTERM);
  EXPECT_EQ(place.Wait(other).exit_status, 75);
  ::kill(pid, SIGTERM);
  const ProgramResult stopped = place.Wait(pid);
  EXPECT_EQ(stopped.exit_status, 75) << stopped.err;
  const ProgramResult resumable =
      place.Runner({"resume", "all", "--dry-run", "--db", "shared/m.db"});
  EXPECT_EQ(resumable.exit_status, 0) << resumable.err;
  EXPECT_NE(resumable.out.find("would resume run 1"), std::string::npos) << resumable.out;
  const std::vector<std::string> checkpoints =
      place.Query("shared/m.db", "select path from artifact where run_id = 1 and env_step = " +
                                     std::to_string(newest()));
  ASSERT_FALSE(checkpoints.empty());
  for (const std::string& path : checkpoints) {
    EXPECT_TRUE(std::filesystem::exists(place.Path("shared/" + path))) << path;
  }
  EXPECT_NE(resumable.out.find("would resume run 2"), std::string::npos) << resumable.out;
}

// On a disk without locks, where each would fail without the copy.
TEST(Scratch, ServesWhateverGoesOnWithRunsToo) {
  const Workplace place;
  std::filesystem::create_directory(place.Path("shared"));
  const Variables site = {{"SITE_NO_LOCKS", place.Path("shared")},
                          {"SITE_LOCK_ERROR", std::to_string(ENOLCK)}};
  const auto run = [&](std::vector<std::string> words) {
    words.insert(words.end(), {"--scratch", "scratch"});
    const ProgramResult result = RunWith(place, site, words);
    EXPECT_EQ(result.exit_status, 0) << words[0] << result.err;
    EXPECT_TRUE(IsEmpty(place, "scratch")) << words[0];
  };
  const std::vector<std::string> train = Short("shared/m.db", {"--keep-replay"});
  run(train);
  run({"eval", "1", "--planner", "random", "--episodes", "2", "--db", "shared/m.db"});
  run({"extend", "1", "--steps", "6000", "--db", "shared/m.db"});
  // Both have to be resumed; of the evaluation that needs the trained run's checkpoint.
  place.Query("shared/m.db",
              "update run set status = 'interrupted', result_digest = null where run_id > 1");
  run({"resume", "--db", "shared/m.db"});
  EXPECT_EQ(place.Query("shared/m.db", "select status from run"),
            (std::vector<std::string>(3, "finished")));

  const Workplace plain;
  for (const std::vector<std::string>& words :
       {Short("m.db", {"--keep-replay"}),
        {"eval", "1", "--planner", "random", "--episodes", "2", "--db", "m.db"},
        {"extend", "1", "--steps", "6000", "--db", "m.db"}}) {
    const ProgramResult result = plain.Runner(words);
    EXPECT_EQ(result.exit_status, 0) << result.err;
  }
  EXPECT_EQ(Digests(place, "shared/m.db"), Digests(plain, "m.db"));
  // No copy of what was only read, and nothing for a name that is none.
  EXPECT_EQ(place.Runner({"resume", "--db", "gone/m.db", "--scratch", "scratch"}).exit_status, 66);
  EXPECT_FALSE(std::filesystem::exists(place.Path("gone")));
  EXPECT_TRUE(IsEmpty(place, "scratch"));
}

TEST(Scratch, TwoCommandsDoNotShareOneCopy) {
  const Workplace place;
  const pid_t pid = place.Start(Long("shared/m.db", {"--scratch", "scratch"}));
  ASSERT_TRUE(WaitFor([&] { return !ScratchDatabase(place).empty(); }));
  const ProgramResult other = place.Runner(Long("shared/m.db", {"--scratch", "scratch"}));
  EXPECT_EQ(other.exit_status, 74) << other.err;
  EXPECT_NE(other.err.find("another command works on the copy"), std::string::npos) << other.err;
  ::kill(pid, SIGTERM);
  EXPECT_EQ(place.Wait(pid).exit_status, 75);
}

TEST(Quota, ARunIsInterruptedWithASentenceAndTheSameCommandResumesIt) {
  const Workplace place;
  std::filesystem::create_directory(place.Path("shared"));
  pid_t pid = -1;
  With({{"LD_PRELOAD", DREAMSEARCH_SITE}, {"SITE_QUOTA", place.Path("shared")}},
       [&] { pid = place.Start(Long("shared/m.db")); });
  ASSERT_TRUE(
      WaitFor([&] { return !place.Value("shared/m.db", "select 1 from artifact").empty(); }));
  std::ofstream(place.Path("shared/full")) << "";
  const ProgramResult stopped = place.Wait(pid);
  EXPECT_EQ(stopped.exit_status, 74) << stopped.err;
  EXPECT_NE(stopped.err.find("uota"), std::string::npos) << stopped.err;
  EXPECT_NE(stopped.err.find(place.Path("shared")), std::string::npos) << stopped.err;
  std::filesystem::remove(place.Path("shared/full"));
  const ProgramResult again = place.Runner(Long("shared/m.db"));
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(Digests(place, "shared/m.db"), Undisturbed(Long("m.db")));
}

TEST(Quota, WhatCannotBePutBackIsKeptAndPutBackByTheSameCommand) {
  const Workplace place;
  std::filesystem::create_directory(place.Path("shared"));
  const std::vector<std::string> run = Short("shared/m.db", {"--scratch", "scratch"});
  std::ofstream(place.Path("shared/full")) << "";
  const ProgramResult first = RunWith(place, {{"SITE_QUOTA", place.Path("shared")}}, run);
  EXPECT_EQ(first.exit_status, 74) << first.err;
  EXPECT_NE(first.err.find("are kept in"), std::string::npos) << first.err;
  std::filesystem::remove(place.Path("shared/full"));
  const ProgramResult again = place.Runner(run);
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(place.Value("shared/m.db", "select count(*) from segment"), "1");
  EXPECT_EQ(Digests(place, "shared/m.db"), Undisturbed(Short("m.db")));
}

// The node that resumes has a clock a day behind, the one that looks on has one a day ahead.
TEST(ClockSkew, ARunResumesOnANodeWithAnotherClock) {
  const Workplace place;
  pid_t pid = -1;
  With({{"LD_PRELOAD", DREAMSEARCH_SITE}, {"SITE_CLOCK_AHEAD", "86400"}},
       [&] { pid = place.Start(Long("m.db")); });
  ASSERT_TRUE(WaitFor([&] { return !place.Value("m.db", "select 1 from artifact").empty(); }));
  // It must not end while it is looked at.
  const pid_t worker = std::stoi(place.Value("m.db", "select pid from segment"));
  ::kill(worker, SIGSTOP);
  for (const char* ahead : {"0", "-86400", "172800"}) {
    const ProgramResult seen =
        RunWith(place, {{"SITE_CLOCK_AHEAD", ahead}}, {"status", "--db", "m.db"});
    EXPECT_EQ(seen.exit_status, 0) << seen.err;
    EXPECT_NE(seen.out.find("running"), std::string::npos) << seen.out;
    EXPECT_EQ(seen.out.find("seen -"), std::string::npos) << seen.out;
  }
  const ProgramResult deleted = place.Results({"delete", "1", "--yes", "--db", "m.db"});
  EXPECT_EQ(deleted.exit_status, 2) << deleted.out << deleted.err;
  EXPECT_NE(deleted.err.find("is running"), std::string::npos) << deleted.err;
  ::kill(worker, SIGKILL);
  const ProgramResult killed = place.Wait(pid);
  EXPECT_EQ(killed.exit_status, 71) << killed.err;
  const ProgramResult again = RunWith(place, {{"SITE_CLOCK_AHEAD", "-86400"}}, Long("m.db"));
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(place.Value("m.db", "select count(*) from segment"), "2");
  EXPECT_EQ(Digests(place, "m.db"), Undisturbed(Long("m.db")));
  EXPECT_EQ(place.Results({"verify", "--db", "m.db"}).exit_status, 0);
}

// Runs a program under a shell that sets variables which Workplace sets itself.
int Shell(const Workplace& place, const std::string& variables, const std::string& program,
          const std::vector<std::string>& words) {
  std::string line = "cd " + place.folder().string() + " && env " + variables +
                     " " DREAMSEARCH_TEST_BIN_DIR "/" + program;
  for (const std::string& word : words) line += " " + word;
  return WEXITSTATUS(std::system((line + " > said 2>&1 < /dev/null").c_str()));
}

std::string Said(const Workplace& place) {
  std::ifstream file(place.Path("said"));
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

TEST(NoTemporaryFolder, RunsNeedNoneAndWhatNeedsOneSaysSo) {
  const Workplace place;
  for (const std::string& folder : {place.Path("gone"), std::string("/proc/self")}) {
    const std::string variables = "TMPDIR=" + folder;
    std::filesystem::remove(place.Path("m.db"));
    EXPECT_EQ(Shell(place, variables, "runner", Short("m.db")), 0) << Said(place);
    EXPECT_EQ(Shell(place, variables, "runner", {"verify", "1", "--db", "m.db"}), 73)
        << Said(place);
    EXPECT_NE(Said(place).find("TMPDIR"), std::string::npos) << Said(place);
    EXPECT_EQ(place.Value("m.db", "select status from run"), "finished");
  }
}

TEST(NoHome, NothingIsWrittenThere) {
  const Workplace place;
  for (const char* variables : {"HOME=/proc/self", "-u HOME"}) {
    std::filesystem::remove(place.Path("m.db"));
    EXPECT_EQ(Shell(place, variables, "runner", Short("m.db")), 0) << Said(place);
    EXPECT_EQ(Shell(place, variables, "results", {"list", "--db", "m.db"}), 0) << Said(place);
    EXPECT_EQ(Shell(place, variables, "results", {"curves", "--db", "m.db", "--out", "c.csv"}), 0)
        << Said(place);
    EXPECT_EQ(Shell(place, variables, "results", {"report", "r.html", "--db", "m.db"}), 0)
        << Said(place);
  }
}

}  // namespace
}  // namespace dreamsearch
