// A database and the files of its runs that have parted: one of them copied, put back,
// merged, moved or lost. Whatever the way, the run ends with the digest it would have had,
// or is refused with every row in its place.
// Over 400 lines: the ways to part them share one trained run.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <thread>

#include "results/upkeep/merge.h"
#include "results/upkeep/verification.h"
#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

constexpr auto kRecursive = std::filesystem::copy_options::recursive;

// Waits until the query gives something.
bool WaitFor(const Workplace& place, const std::string& db, const std::string& sql) {
  for (int i = 0; i < 6000; ++i) {
    const std::string value = place.Value(db, sql);
    if (!value.empty() && value != "NULL") return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

// One run of 12,000 steps at three times: `begun`, killed before its first checkpoint, which
// is of 2000; `early`, interrupted some time later, with a checkpoint of then and the one
// before; `late`, finished, with its last two.
class PartedFilesTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    std::filesystem::create_directory(place_->folder() / "now");
    Kill("now/r.db", "select 1 from step");
    ASSERT_TRUE(Checkpoints("now/r.db").empty()) << "killed too late to show anything";
    Copy("now", "begun");
    const pid_t pid = place_->Start(Command("now/r.db"));
    ASSERT_TRUE(WaitFor(*place_, "now/r.db", "select 1 from step where env_step >= 2100"));
    ::kill(pid, SIGINT);
    const ProgramResult stopped = place_->Wait(pid);
    ASSERT_EQ(stopped.exit_status, 75) << stopped.err;
    Copy("now", "early");
    const ProgramResult finished = place_->Runner(Command("now/r.db"));
    ASSERT_EQ(finished.exit_status, 0) << finished.err;
    Copy("now", "late");
    uuid_ = place_->Value("late/r.db", "select uuid from run");

    const ProgramResult reference = place_->Runner(Command("reference.db"));
    ASSERT_EQ(reference.exit_status, 0) << reference.err;
    digest_ = place_->Value("reference.db", "select result_digest from run");
    ASSERT_EQ(digest_.size(), 64u);
    ASSERT_EQ(Digest("late/r.db"), digest_);
    ASSERT_EQ(Checkpoints("early/r.db").size(), 2u);
    ASSERT_EQ(Checkpoints("late/r.db").size(), 2u);
    // None of the finished run's checkpoints is of steps that the early database has.
    ASSERT_GT(Checkpoints("late/r.db")[0].second, Checkpoints("early/r.db")[1].second);
  }
  static void TearDownTestSuite() { delete place_; }

  static std::vector<std::string> Command(const std::string& db,
                                          const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = TinyRun("cartpole_balance", "dreamer", db, more);
    const auto replace = [&](const std::string& from, const std::string& to) {
      std::replace(arguments.begin(), arguments.end(), from, to);
    };
    replace("4000", "12000");
    replace("run.checkpoint_every=1000", "run.checkpoint_every=2000");
    // Long enough for a kill between the first rows and the first checkpoint.
    replace("run.pretrain_updates=4", "run.pretrain_updates=200");
    return arguments;
  }
  static ProgramResult Run(const std::string& db, const std::vector<std::string>& more = {}) {
    return place_->Runner(Command(db, more));
  }

  // Runs the command and kills all of it once the query gives something.
  static void Kill(const std::string& db, const std::string& sql) {
    const pid_t pid = place_->Start(Command(db));
    ASSERT_TRUE(WaitFor(*place_, db, sql));
    const std::string worker = place_->Value(db, "select pid from segment order by segment desc");
    ::kill(pid, SIGSTOP);  // nobody is to write down what became of the worker
    ::kill(std::stoi(worker), SIGKILL);
    ::kill(pid, SIGKILL);
    place_->Wait(pid);
    const auto runs = [&] {
      std::ifstream stat("/proc/" + worker + "/stat");
      const std::string text((std::istreambuf_iterator<char>(stat)),
                             std::istreambuf_iterator<char>());
      return !text.empty() && text.find(") Z") == std::string::npos;
    };
    for (int i = 0; i < 2000 && runs(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }

  static void Copy(const std::string& from, const std::string& to) {
    std::filesystem::copy(place_->Path(from), place_->Path(to), kRecursive);
  }
  // A copy of `early`, `late` or `begun` for one test; the name of its database.
  static std::string Stage(const std::string& state) {
    const std::string name =
        testing::UnitTest::GetInstance()->current_test_info()->name() + std::string("_") + state;
    Copy(state, name);
    return name + "/r.db";
  }

  // The folder with the run's files. Does not open the database, which would take in its log.
  static std::filesystem::path Files(const std::string& db) {
    return std::filesystem::directory_iterator(place_->Path(db + ".files"))->path();
  }
  // Names and steps of the checkpoints there, in their order.
  static std::vector<std::pair<std::string, int>> Checkpoints(const std::string& db) {
    std::vector<std::pair<std::string, int>> found;
    for (const auto& entry : std::filesystem::directory_iterator(Files(db))) {
      const std::string name = entry.path().filename().string();
      int env_step = 0;
      if (std::sscanf(name.c_str(), "checkpoint-%d.ckpt", &env_step) == 1) {
        found.emplace_back(name, env_step);
      }
    }
    std::sort(found.begin(), found.end(),
              [](const auto& a, const auto& b) { return a.second < b.second; });
    return found;
  }

  static std::string Digest(const std::string& db) {
    return place_->Value(db, "select result_digest from run where status = 'finished'");
  }
  // All that a refused command must leave as it is.
  static std::string State(const std::string& db) {
    return place_->Value(
        db,
        "select (select group_concat(run_id || status || env_steps_done || error) from run) || "
        "'|' || (select count(*) || ' ' || ifnull(sum(plan_us), 0) from step) || '|' || (select "
        "count(*) || ' ' || ifnull(sum(wall_s), 0) from episode) || '|' || (select count(*) from "
        "segment) || '|' || (select count(*) from event) || '|' || (select count(*) from "
        "artifact)");
  }
  static std::vector<std::string> Verify(const std::string& db) {
    return results::Verify(results::Database::OpenReadOnly(place_->Path(db)).get(), {});
  }

  // Neither the same command nor `runner resume` touches the run.
  static void ExpectRefused(const std::string& db, int exit_status, const std::string& message) {
    const std::string before = State(db);
    const ProgramResult same = Run(db);
    EXPECT_EQ(same.exit_status, exit_status) << same.err;
    EXPECT_NE(same.err.find(message), std::string::npos) << same.err;
    EXPECT_NE(same.err.find("--retry --replace"), std::string::npos) << same.err;
    EXPECT_EQ(State(db), before) << same.err;
    const ProgramResult resumed = place_->Runner({"resume", "--db", db});
    EXPECT_EQ(resumed.exit_status, exit_status) << resumed.err;
    EXPECT_EQ(State(db), before) << resumed.err;
  }
  // What the message advises works.
  static void ExpectStartsOver(const std::string& db) {
    const ProgramResult over = Run(db, {"--retry", "--replace"});
    EXPECT_EQ(over.exit_status, 0) << over.err;
    EXPECT_NE(over.err.find("1 to start over"), std::string::npos) << over.err;
    EXPECT_EQ(Digest(db), digest_);
    EXPECT_EQ(Verify(db), std::vector<std::string>());
  }
  static void ExpectResumes(const std::string& db, const std::string& as = "") {
    const ProgramResult resumed = Run(as.empty() ? db : as);
    EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
    EXPECT_EQ(Digest(db), digest_) << resumed.err;
    EXPECT_EQ(Verify(db), std::vector<std::string>());
    EXPECT_NE(place_->Value(db, "select from_env_step from segment order by segment desc"), "0")
        << "it started from the beginning";
  }

  static Workplace* place_;
  static std::string uuid_;
  static std::string digest_;
};
Workplace* PartedFilesTest::place_ = nullptr;
std::string PartedFilesTest::uuid_;
std::string PartedFilesTest::digest_;

// cp a.db b.db, the same command on a, then on b.
TEST_F(PartedFilesTest, ACopyBesideTheSameFilesIsRefusedOnceTheOtherHasGoneOn) {
  const std::string a = Stage("early");
  const std::string b = std::filesystem::path(a).parent_path().string() + "/b.db";
  std::filesystem::copy(place_->Path(a), place_->Path(b));
  ExpectResumes(a);
  const auto files = Checkpoints(a);
  ExpectRefused(b, 65, "of which the database has");
  // Starting over takes a folder of its own.
  ExpectStartsOver(b);
  EXPECT_EQ(Checkpoints(a), files);
  EXPECT_EQ(place_->Runner({"export", "1", "--db", a, "--out", "weights"}).exit_status, 0);
  EXPECT_EQ(place_->Value(b, "select log_path from run"), "b.db.files/" + uuid_ + "/run.log");
}

TEST_F(PartedFilesTest, ACopyThatHasTheRowsOfACheckpointResumesFromIt) {
  const std::string a = Stage("early");
  const std::string b = std::filesystem::path(a).parent_path().string() + "/b.db";
  std::filesystem::copy(place_->Path(a), place_->Path(b));
  ExpectResumes(b);
  ExpectRefused(a, 65, "of which the database has");
}

TEST_F(PartedFilesTest, AMergedRunThatWentOnLeavesItsSourceRefusedAndTheOtherWayRound) {
  for (const bool merged_first : {true, false}) {
    const std::string name = merged_first ? "merged_first" : "source_first";
    Copy("early", name);
    const std::string source = name + "/r.db", merged = name + "_merged/all.db";
    results::Merge(results::Database::OpenOrCreate(place_->Path(merged)).get(),
                   place_->Path(source));
    ExpectResumes(merged_first ? merged : source);
    ExpectRefused(merged_first ? source : merged, 65, "of which the database has");
  }
}

// The database is as it was before the log; the files are ahead of it.
TEST_F(PartedFilesTest, ARunWhoseLogIsLostAfterAKillGoesBackToTheCheckpointThatFits) {
  const std::string db = Stage("early");
  const int early = Checkpoints(db)[1].second;
  Kill(db,
       "select 1 from artifact where kind = 'checkpoint' and env_step > " + std::to_string(early));
  ASSERT_TRUE(std::filesystem::remove(place_->Path(db + "-wal")));
  std::filesystem::remove(place_->Path(db + "-shm"));
  ASSERT_GT(Checkpoints(db).back().second, early);
  ASSERT_EQ(place_->Value(db, "select max(env_step) from step"), std::to_string(early));
  ExpectResumes(db);
  EXPECT_EQ(place_->Value(db, "select count(*) from event where kind = 'unused_checkpoint'"), "1");
}

TEST_F(PartedFilesTest, AnOldCopyOfTheDatabasePutBackIsRefused) {
  const std::string db = Stage("late");
  std::filesystem::copy(place_->Path("early/r.db"), place_->Path(db),
                        std::filesystem::copy_options::overwrite_existing);
  ExpectRefused(db, 65, "of which the database has");
  // Nor is what it has not trained evaluated, exported or explained.
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"eval", "1", "--planner", "dreamer"},
        std::vector<std::string>{"export", "1", "--out", place_->Path("weights")}}) {
    std::vector<std::string> arguments = command;
    arguments.insert(arguments.end(), {"--db", db});
    const ProgramResult result = place_->Runner(arguments);
    EXPECT_EQ(result.exit_status, 65) << result.err;
    EXPECT_NE(result.err.find("of which the database has"), std::string::npos) << result.err;
  }
  EXPECT_EQ(place_->Value(db, "select count(*) from run"), "1");
  ExpectStartsOver(db);
}

TEST_F(PartedFilesTest, ALaterCheckpointCopiedInIsPassedOver) {
  const std::string db = Stage("early");
  const std::string name = Checkpoints("late/r.db").back().first;
  std::filesystem::copy(Files("late/r.db") / name, Files(db) / name);
  ExpectResumes(db);
  EXPECT_NE(place_->Value(db, "select detail from event where kind = 'unused_checkpoint'")
                .find(name + " was made after"),
            std::string::npos);
}

TEST_F(PartedFilesTest, ACheckpointOfAnotherRunIsPassedOver) {
  const std::string db = Stage("early");
  for (const auto& [name, env_step] : Checkpoints("reference.db")) {
    std::filesystem::copy(Files("reference.db") / name, Files(db) / name,
                          std::filesystem::copy_options::overwrite_existing);
  }
  ExpectResumes(db);
  EXPECT_NE(place_->Value(db, "select detail from event where kind = 'unused_checkpoint'")
                .find("is of the run "),
            std::string::npos);
}

// A copy of the folder put back, older than the database: rows past it are remade.
TEST_F(PartedFilesTest, AnOldCopyOfTheFilesPutBackIsResumedFromWithAWarning) {
  const std::string db = Stage("early");
  const auto checkpoints = Checkpoints(db);
  std::filesystem::remove(Files(db) / checkpoints[1].first);
  ExpectResumes(db);
  EXPECT_EQ(place_->Value(db, "select from_env_step from segment order by segment desc"),
            std::to_string(checkpoints[0].second));
  EXPECT_NE(place_->Value(db, "select detail from event where kind = 'unused_checkpoint'")
                .find(checkpoints[1].first + " is gone"),
            std::string::npos);
}

TEST_F(PartedFilesTest, ADatabaseWithAHoleBeforeItsCheckpointIsRefused) {
  const std::pair<const char*, const char*> cases[] = {
      {"delete from step where env_step = (select max(env_step) from step where env_step < 500)",
       "of which the database has"},
      {"delete from episode where phase = 0 and episode = 0", "of which the database has"},
      {"delete from step where env_step < 500", "of which the database has"},
      {"update step set reward = reward + 1 where t = 7", "had other values"}};
  for (const auto& [change, message] : cases) {
    Copy("early", "hole");
    place_->Query("hole/r.db", change);
    ExpectRefused("hole/r.db", 65, message);
    EXPECT_FALSE(Verify("hole/r.db").empty()) << change;
    std::filesystem::remove_all(place_->Path("hole"));
  }
}

TEST_F(PartedFilesTest, ARunWhoseFilesAreGoneKeepsItsRowsAndGoesOnOnceTheyAreBack) {
  const std::string db = Stage("early");
  const std::string files = place_->Path(db + ".files"), away = place_->Path("away");
  std::filesystem::rename(files, away);
  ExpectRefused(db, 66, "");
  const ProgramResult gone = Run(db);
  EXPECT_NE(gone.err.find(Checkpoints("early/r.db")[1].first + ", which is gone"),
            std::string::npos)
      << gone.err;
  const ProgramResult dry = Run(db, {"--dry-run"});
  EXPECT_EQ(dry.exit_status, 66) << dry.err;
  EXPECT_NE(dry.out.find(": refuse"), std::string::npos) << dry.out;
  // The folder without its checkpoints is no better.
  std::filesystem::copy(away, files, kRecursive);
  for (const auto& [name, env_step] : Checkpoints(db)) {
    std::filesystem::remove(Files(db) / name);
  }
  ExpectRefused(db, 66, "which is gone");
  std::filesystem::remove_all(files);
  std::filesystem::rename(away, files);
  ExpectResumes(db);
}

TEST_F(PartedFilesTest, AFailedRunWhoseFilesAreGoneIsNotRetriedFromTheStart) {
  const std::string db = Stage("early");
  place_->Query(db, "update run set status = 'failed', exit_code = 70");
  std::filesystem::remove_all(place_->Path(db + ".files"));
  const std::string before = State(db);
  const ProgramResult retried = Run(db, {"--retry"});
  EXPECT_EQ(retried.exit_status, 66) << retried.err;
  EXPECT_EQ(State(db), before) << retried.err;
  ExpectStartsOver(db);
}

TEST_F(PartedFilesTest, ARunKilledBeforeItsFirstCheckpointStartsFromItsBeginning) {
  for (const bool with_files : {true, false}) {
    Copy("begun", "again");
    ASSERT_TRUE(Checkpoints("again/r.db").empty());
    if (!with_files) std::filesystem::remove_all(place_->Path("again/r.db.files"));
    const ProgramResult again = Run("again/r.db");
    EXPECT_EQ(again.exit_status, 0) << again.err;
    EXPECT_EQ(Digest("again/r.db"), digest_);
    EXPECT_EQ(Verify("again/r.db"), std::vector<std::string>());
    EXPECT_NE(place_->Value("again/r.db", "select rows_rolled_back from segment where segment = 1"),
              "0");
    std::filesystem::remove_all(place_->Path("again"));
  }
}

// A checkpoint comes after the commit of its rows and before the commit of its name. What a
// kill in between leaves is resumed from, with nothing to warn of.
TEST_F(PartedFilesTest, AKillBetweenTheRowsACheckpointAndItsNameLosesNothing) {
  const std::string db = Stage("early");
  const auto expect_resumes_from = [&](const std::string& from) {
    ExpectResumes(db);
    EXPECT_EQ(place_->Value(db, "select from_env_step from segment order by segment desc"), from);
    EXPECT_EQ(place_->Value(db, "select count(*) from event where kind like '%_checkpoint'"), "0");
    std::filesystem::remove_all(place_->Path(db).substr(0, place_->Path(db).rfind('/')));
    Copy("early", std::filesystem::path(db).parent_path());
  };
  const auto checkpoints = Checkpoints(db);
  const std::string before = std::to_string(checkpoints[0].second);
  const std::string last = std::to_string(checkpoints[1].second);
  // Renamed, not named; of all, as of the first one.
  place_->Query(db, "delete from artifact where env_step = " + last);
  expect_resumes_from(last);
  place_->Query(db, "delete from artifact");
  expect_resumes_from(last);
  // Not even renamed.
  place_->Query(db, "delete from artifact where env_step = " + last);
  std::filesystem::resize_file(Files(db) / checkpoints[1].first, 1000);
  std::filesystem::rename(Files(db) / checkpoints[1].first,
                          Files(db) / (checkpoints[1].first + ".tmp"));
  expect_resumes_from(before);
}

// An old copy of the database from before the run's first checkpoint, beside its files.
TEST_F(PartedFilesTest, ADatabaseOlderThanAllItsFilesIsRefused) {
  const std::string db = Stage("early");
  std::filesystem::copy(place_->Path("begun"),
                        std::filesystem::path(place_->Path(db)).parent_path(),
                        kRecursive | std::filesystem::copy_options::overwrite_existing);
  ExpectRefused(db, 65, "of which the database has");
}

TEST_F(PartedFilesTest, ALinkToTheDatabaseFindsItsFiles) {
  const std::string db = Stage("early");
  std::filesystem::create_directories(place_->Path("links/further"));
  std::filesystem::create_symlink("../../" + db, place_->Path("links/further/one.db"));
  std::filesystem::create_symlink("further/one.db", place_->Path("links/two.db"));
  std::filesystem::create_directory_symlink("links", place_->Path("folder"));
  ExpectResumes(db, "folder/two.db");
  for (const auto& entry : std::filesystem::recursive_directory_iterator(place_->Path("links"))) {
    EXPECT_TRUE(entry.is_symlink() || entry.path().filename() == "further") << entry.path();
  }
}

TEST_F(PartedFilesTest, ALinkToADatabaseThatIsYetToBeMadeKeepsItsFilesThere) {
  std::filesystem::create_directories(place_->Path("target"));
  std::filesystem::create_symlink("target/new.db", place_->Path("new_link.db"));
  const ProgramResult made = Run("new_link.db");
  EXPECT_EQ(made.exit_status, 0) << made.err;
  EXPECT_EQ(Digest("target/new.db"), digest_);
  EXPECT_EQ(Checkpoints("target/new.db").size(), 2u);
  EXPECT_FALSE(std::filesystem::exists(place_->Path("new_link.db.files")));
}

// No link that could be resolved: a second name of the same file.
TEST_F(PartedFilesTest, AHardLinkInAnotherFolderIsRefused) {
  const std::string db = Stage("early");
  std::filesystem::create_directory(place_->Path("hard"));
  std::filesystem::create_hard_link(place_->Path(db), place_->Path("hard/h.db"));
  ExpectRefused("hard/h.db", 66, "");
}

// An evaluation has a checkpoint after every episode and names none in the database.
TEST_F(PartedFilesTest, AnEvaluationIsHeldToItsCheckpointsToo) {
  const auto command = [](const std::string& db) {
    return std::vector<std::string>{"eval",
                                    "--env",
                                    "cartpole_swingup",
                                    "--planner",
                                    "random_shooting",
                                    "--episodes",
                                    "40",
                                    "--set",
                                    "planner.candidates=4",
                                    "--set",
                                    "planner.horizon=2",
                                    "--jobs",
                                    "1",
                                    "--db",
                                    db};
  };
  std::filesystem::create_directory(place_->Path("played"));
  ASSERT_EQ(place_->Runner(command("played/whole.db")).exit_status, 0);
  const std::string digest = Digest("played/whole.db");
  const pid_t pid = place_->Start(command("played/r.db"));
  // The first that are played side by side end together; the others are still to be played.
  ASSERT_TRUE(WaitFor(*place_, "played/r.db", "select 1 from episode where episode = 2"));
  ::kill(pid, SIGINT);
  ASSERT_EQ(place_->Wait(pid).exit_status, 75);
  ASSERT_LT(std::stoi(place_->Value("played/r.db", "select count(*) from episode")), 39);
  const auto expect_refused = [&](const std::string& db, int exit_status) {
    const std::string before = State(db);
    const ProgramResult refused = place_->Runner(command(db));
    EXPECT_EQ(refused.exit_status, exit_status) << refused.err;
    EXPECT_EQ(State(db), before) << refused.err;
  };
  std::filesystem::rename(place_->Path("played/r.db.files"), place_->Path("played/away"));
  expect_refused("played/r.db", 66);
  std::filesystem::rename(place_->Path("played/away"), place_->Path("played/r.db.files"));
  std::filesystem::copy(place_->Path("played/r.db"), place_->Path("played/b.db"));
  const ProgramResult resumed = place_->Runner(command("played/r.db"));
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(Digest("played/r.db"), digest);
  EXPECT_EQ(Verify("played/r.db"), std::vector<std::string>());
  expect_refused("played/b.db", 65);
}

}  // namespace
}  // namespace dreamsearch
