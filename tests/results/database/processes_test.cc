// Several processes on one file, and processes killed while they write. Children
// are forked before any connection is open: none is carried over.
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>

#include <functional>
#include <vector>

#include "results/database/derived_rows.h"
#include "tests/results/database/child.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

constexpr int kProcesses = 8;

TEST(Processes, EightMakeOneDatabaseAndRecordIntoItAtOnce) {
  const TemporaryFolder folder;
  constexpr std::int64_t kRows = 20000;
  for (int round = 0; round < 5; ++round) {
    const std::string path = (folder / "r") + std::to_string(round) + ".db";
    std::vector<pid_t> children;
    for (int i = 0; i < kProcesses; ++i) {
      children.push_back(Spawn([&path, i] {
        const auto db = Database::OpenOrCreate(path);
        if (!db->warnings().empty()) throw std::runtime_error(db->warnings().front());
        const std::int64_t run = MakeRun(db.get(), {.seed = i});
        RunWriter writer(db.get(), run);
        writer.BeginSegment(MakeSegment(db.get()));
        for (std::int64_t n = 1; n <= kRows / kProcesses; ++n) writer.AddStep({.env_step = n});
        writer.Finish();
        db->SetRunStatus(run, RunStatus::kFinished, 0);
      }));
    }
    for (const pid_t child : children) EXPECT_EQ(Wait(child), 0);
    const auto db = Database::OpenReadOnly(path);
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM run WHERE status = 'finished'"), kProcesses);
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM step"), kRows);
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM study"), 1);
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM config"), 1);
    EXPECT_EQ(db->connection().QueryText("PRAGMA journal_mode"), "wal");
    EXPECT_EQ(db->connection().QueryText("PRAGMA integrity_check"), "ok");
  }
}

TEST(Processes, OneRunIsMadeOnceHoweverManyAsk) {
  const TemporaryFolder folder;
  std::vector<pid_t> children;
  for (int i = 0; i < kProcesses; ++i) {
    children.push_back(
        Spawn([&folder] { MakeRun(Database::OpenOrCreate(folder / "r.db").get()); }));
  }
  for (const pid_t child : children) EXPECT_EQ(Wait(child), 0);
  EXPECT_EQ(Count(Database::OpenReadOnly(folder / "r.db").get(), "SELECT count(*) FROM run"), 1);
}

// Each episode comes with 100 steps in one commit, so a torn commit shows.
TEST(Processes, AKillLosesNoCommittedRowAndTearsNoCommit) {
  const TemporaryFolder folder;
  const std::string path = folder / "r.db";
  int kills_with_rows = 0;
  for (int round = 0; round < 30; ++round) {
    int reports[2];
    ASSERT_EQ(pipe(reports), 0);
    const pid_t child = Spawn([&] {
      const auto db = Database::OpenOrCreate(path);
      RunWriter writer(db.get(), MakeRun(db.get(), {.seed = round}));
      writer.BeginSegment(MakeSegment(db.get()));
      for (std::int64_t episode = 0;; ++episode) {
        for (int i = 1; i <= 100; ++i) {
          writer.AddStep({.env_step = episode * 100 + i, .episode = episode});
        }
        writer.AddEpisode({.episode = episode, .env_step = episode * 100 + 100});
        writer.Commit();
        if (write(reports[1], &episode, sizeof episode) != sizeof episode) _exit(2);
      }
    });
    // A different moment each round, of every other from its first commit on; what matters is
    // checked for every one.
    pollfd first_commit = {reports[0], POLLIN, 0};
    if (round % 2 == 1) poll(&first_commit, 1, 10000);
    const timespec pause = {0, 5000000 + round * 3000000};
    nanosleep(&pause, nullptr);
    kill(child, SIGKILL);
    Wait(child);
    close(reports[1]);
    std::int64_t committed = -1, episode;
    while (read(reports[0], &episode, sizeof episode) == sizeof episode) committed = episode;
    close(reports[0]);

    const auto db = Database::OpenOrCreate(path);
    ASSERT_EQ(db->connection().QueryText("PRAGMA integrity_check"), "ok");
    const std::vector<RunInfo> runs = db->ListRuns({.seeds = {round}});
    if (runs.empty()) {
      EXPECT_EQ(committed, -1);
      continue;
    }
    const std::string run = std::to_string(runs[0].run_id);
    const std::int64_t episodes =
        Count(db.get(), "SELECT count(*) FROM episode WHERE run_id = " + run);
    EXPECT_GE(episodes, committed + 1);
    EXPECT_LE(episodes, committed + 2);
    EXPECT_EQ(Count(db.get(), "SELECT count(*) FROM step WHERE run_id = " + run), episodes * 100);
    EXPECT_EQ(ReadChunks(db->connection(), runs[0].run_id, 0),
              ComputeChunks(db->connection(), runs[0].run_id, 0));
    kills_with_rows += episodes > 0;
    // And it can be taken up again.
    RunWriter writer(db.get(), runs[0].run_id);
    writer.BeginSegment(MakeSegment(db.get()),
                        {.env_step = episodes * 100, .training_episodes = episodes});
    EXPECT_EQ(writer.rows_rolled_back(), 0);
  }
  EXPECT_GT(kills_with_rows, 10) << "the kills came too early to show anything";
}

}  // namespace
}  // namespace dreamsearch::results
