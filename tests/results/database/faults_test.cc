// A scripted run that is killed, or meets a full disk or an input/output error, at
// every single write-class call it makes. Random kills would prove nothing: a
// database without a journal survives hundreds of them.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>

#include "results/system/error.h"
#include "results/upkeep/verification.h"
#include "tests/results/database/child.h"
#include "tests/results/database/faulty_vfs.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

constexpr std::int64_t kCommits = 8;
constexpr std::int64_t kRows = 25;  // of `step` in each, and one episode

void AddRows(RunWriter* writer, std::int64_t commit) {
  for (std::int64_t i = 1; i <= kRows; ++i) {
    writer->AddStep({.env_step = commit * kRows + i, .episode = commit, .t = i - 1, .reward = 0.5});
  }
  writer->AddEpisode({.episode = commit,
                      .env_step = (commit + 1) * kRows,
                      .length = kRows,
                      .episode_return = 1.0 / 3});
  writer->SetProgress((commit + 1) * kRows);
}

// The script: create, record, checkpoint the log in the middle, finish.
void Record(const std::string& path, bool journal, const std::function<void(std::int64_t)>& done) {
  const auto db = Database::OpenOrCreate(path);
  if (!journal) {
    db->connection().Execute("PRAGMA journal_mode = MEMORY; PRAGMA synchronous = OFF");
  }
  const std::int64_t run = MakeRun(db.get());
  RunWriter writer(db.get(), run);
  writer.BeginSegment(MakeSegment(db.get()));
  for (std::int64_t commit = 0; commit < kCommits; ++commit) {
    AddRows(&writer, commit);
    writer.Commit();
    done(commit);
    if (commit == kCommits / 2) db->connection().Execute("PRAGMA wal_checkpoint(TRUNCATE)");
  }
  writer.Finish();
  db->SetRunStatus(run, RunStatus::kFinished, 0);
}

// What is wrong with the database after its writer was killed; empty if nothing.
// committed: the last commit that was reported as done, or -1.
std::string Damage(const std::string& path, std::int64_t committed) {
  try {
    const auto db = Database::OpenOrCreate(path);
    if (db->connection().QueryText("PRAGMA integrity_check") != "ok") return "integrity";
    const std::int64_t episodes = Count(db.get(), "SELECT count(*) FROM episode");
    if (episodes < committed + 1) return "a committed row is lost";
    if (Count(db.get(), "SELECT count(*) FROM step") != episodes * kRows) return "a torn commit";
    const std::vector<std::string> problems = Verify(db.get(), {});
    if (!problems.empty()) return problems.front();
    // And the run can be taken up again.
    const std::int64_t run = MakeRun(db.get());
    RunWriter writer(db.get(), run);
    writer.BeginSegment(MakeSegment(db.get()),
                        {.env_step = episodes * kRows, .training_episodes = episodes});
    if (writer.rows_rolled_back() != 0) return "rows past the last episode";
    AddRows(&writer, episodes);
    writer.Commit();
    if (Count(db.get(), "SELECT count(*) FROM step") != (episodes + 1) * kRows)
      return "not resumed";
    return "";
  } catch (const Failure& error) {
    return error.what();
  }
}

// Kills the script at its n-th write-class call; false once it makes fewer.
bool KillAt(int n, bool journal, std::string* damage) {
  const TemporaryFolder folder;
  int reports[2];
  if (pipe(reports) != 0) std::abort();
  const int status = Wait(Spawn([&] {
    InstallFaultyVfs(Fault::kKill, n);
    Record(folder / "r.db", journal, [&](std::int64_t commit) {
      if (write(reports[1], &commit, sizeof commit) != sizeof commit) _exit(2);
    });
  }));
  close(reports[1]);
  std::int64_t committed = -1, commit;
  while (read(reports[0], &commit, sizeof commit) == sizeof commit) committed = commit;
  close(reports[0]);
  *damage = Damage(folder / "r.db", committed);
  return WIFSIGNALED(status);
}

TEST(Faults, AKillAtAnyWriteLosesNoCommittedRowAndTearsNoCommit) {
  int n = 1;
  std::string damage;
  for (; KillAt(n, true, &damage); ++n) {
    EXPECT_EQ(damage, "") << "killed at write " << n;
  }
  EXPECT_EQ(damage, "");
  std::printf("%d points\n", n - 1);
  EXPECT_GT(n, 100) << "too few points to show anything";
}

// The same harness finds what it looks for where the journal is only in memory.
TEST(Faults, TheHarnessFindsDamageWithoutAJournal) {
  int damaged = 0, n = 1;
  std::string damage;
  for (; KillAt(n, false, &damage) && damaged < 5; ++n) damaged += damage.empty() ? 0 : 1;
  EXPECT_EQ(damaged, 5) << "of " << n << " points";
}

// Whatever fails says 74 and where, has stored nothing, and succeeds when it is
// called again.
void FailAt(Fault fault, int n, int* points) {
  const TemporaryFolder folder;
  const std::string path = folder / "r.db";
  const auto insist = [&path](const std::function<void()>& call) {
    try {
      call();
    } catch (const Failure& error) {
      if (error.code() != ExitCode::kInputOutput ||
          std::string(error.what()).find(path) == std::string::npos) {
        throw;
      }
      call();
    }
  };
  int counts[2];
  if (pipe(counts) != 0) std::abort();
  const int status = Wait(Spawn([&] {
    InstallFaultyVfs(fault, n);
    std::unique_ptr<Database> db;
    insist([&] { db = Database::OpenOrCreate(path); });
    std::int64_t run = 0;
    insist([&] { run = MakeRun(db.get()); });
    SegmentInfo segment;
    insist([&] { segment = MakeSegment(db.get()); });
    RunWriter writer(db.get(), run);
    insist([&] { writer.BeginSegment(segment); });
    for (std::int64_t commit = 0; commit < kCommits; ++commit) {
      AddRows(&writer, commit);
      insist([&] { writer.Commit(); });
    }
    insist([&] { writer.Finish(); });
    insist([&] { db->SetRunStatus(run, RunStatus::kFinished, 0); });
    const int calls = WriteCalls();
    if (write(counts[1], &calls, sizeof calls) != sizeof calls) _exit(2);
  }));
  close(counts[1]);
  int calls = 0;
  const bool counted = read(counts[0], &calls, sizeof calls) == sizeof calls;
  close(counts[0]);
  ASSERT_EQ(status, 0) << "failed at write " << n;
  ASSERT_TRUE(counted);
  *points = calls;
  const auto db = Database::OpenReadOnly(path);
  EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM step"), kCommits * kRows) << n;
  EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM run WHERE status = 'finished'"), 1) << n;
  EXPECT_EQ(Verify(db.get(), {}), std::vector<std::string>()) << n;
}

TEST(Faults, AFullDiskAtAnyWriteIsAnErrorAndCanBeTriedAgain) {
  int points = 1;
  for (int n = 1; n <= points && !HasFatalFailure(); ++n) FailAt(Fault::kDiskFull, n, &points);
  std::printf("%d points\n", points);
  EXPECT_GT(points, 100);
}

TEST(Faults, AnInputOutputErrorAtAnyWriteIsAnErrorAndCanBeTriedAgain) {
  int points = 1;
  for (int n = 1; n <= points && !HasFatalFailure(); ++n) {
    FailAt(Fault::kInputOutputError, n, &points);
  }
  std::printf("%d points\n", points);
  EXPECT_GT(points, 100);
}

}  // namespace
}  // namespace dreamsearch::results
