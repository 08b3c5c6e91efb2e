#include "results/upkeep/merge.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "results/analysis/published.h"
#include "results/upkeep/verification.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

// One finished run of `episodes` episodes; rows depend on the seed alone.
void Record(Database* db, const RunSettings& settings, std::int64_t episodes,
            RunStatus status = RunStatus::kFinished) {
  const std::int64_t run = MakeRun(db, settings);
  RunWriter writer(db, run);
  SegmentInfo segment = MakeSegment(db);
  segment.slurm_job = "12_3";
  segment.slurm_restarts = 1;
  segment.slurm_node = "n1";
  segment.gflop_per_second = 50;
  writer.BeginSegment(segment);
  const std::int64_t metric = writer.Metric("loss " + std::to_string(settings.seed), "nats", "x");
  for (std::int64_t e = 0; e < episodes; ++e) {
    for (std::int64_t i = 1; i <= 10; ++i) {
      writer.AddStep({.env_step = e * 10 + i,
                      .episode = e,
                      .t = i - 1,
                      .reward = static_cast<double>(settings.seed) + 0.1});
    }
    writer.AddEpisode({.episode = e,
                       .env_step = e * 10 + 10,
                       .length = 10,
                       .episode_return = static_cast<double>(settings.seed * 10 + e) / 3});
    writer.AddScalar(e * 10 + 10, metric, 0.5);
    writer.AddTimeUse(
        {e * 10 + 10, "learning", static_cast<double>(e), 2.0 * static_cast<double>(e), 5});
  }
  writer.AddArtifact(db->RunFolder(*db->GetRun(run)) + "/ckpt", "checkpoint", 10, 1, "00");
  writer.AddEvent(1, "info", "start", "of seed " + std::to_string(settings.seed));
  writer.SetProgress(episodes * 10);
  writer.Finish();
  db->SetRunStatus(run, status, 0);
}

// All rows of all runs, ids aside.
std::vector<std::string> Everything(Database* db) {
  std::vector<std::string> lines;
  for (const char* sql :
       {"SELECT uuid, s.name, t.name, planner, model, c.json, seed, status, env_steps_done,"
        " log_path, result_digest, r.created_utc, ended_utc, heartbeat_utc, s.created_utc FROM run"
        " r JOIN study s USING (study_id) JOIN task t USING (task_id) JOIN config c USING"
        " (config_id)",
        "SELECT uuid, x.* FROM step x JOIN run USING (run_id)",
        "SELECT uuid, x.* FROM episode x JOIN run USING (run_id)",
        "SELECT uuid, m.name, x.env_step, x.value FROM scalar x JOIN run USING (run_id) JOIN"
        " metric m USING (metric_id)",
        "SELECT uuid, x.* FROM time_use x JOIN run USING (run_id)",
        "SELECT uuid, x.* FROM event x JOIN run USING (run_id)",
        "SELECT uuid, x.* FROM artifact x JOIN run USING (run_id)",
        "SELECT uuid, x.* FROM curve_bin x JOIN run USING (run_id)",
        "SELECT uuid, x.* FROM chunk_digest x JOIN run USING (run_id)",
        "SELECT uuid, h.hostname, x.pid, x.from_env_step, x.gflop_per_second, x.slurm_job,"
        " x.slurm_restarts, x.slurm_node FROM segment x JOIN run USING (run_id) JOIN host h USING "
        "(host_id)",
        "SELECT * FROM published"}) {
    Statement rows = db->connection().Prepare(sql);
    while (rows.Step()) {
      std::string line;
      for (int i = 0; i < rows.columns(); ++i) {
        if (rows.ColumnName(i) == "run_id") continue;
        line += rows.Text(i) + "|";
      }
      lines.push_back(line);
    }
  }
  std::sort(lines.begin(), lines.end());
  return lines;
}

class MergeTest : public testing::Test {
 protected:
  std::unique_ptr<Database> Open(const std::string& name) {
    return Database::OpenOrCreate(folder_ / name);
  }
  void MergeAll(const std::string& target, const std::vector<std::string>& sources) {
    const auto db = Open(target);
    for (const std::string& source : sources) Merge(db.get(), folder_ / source);
  }

  TemporaryFolder folder_;
};

TEST_F(MergeTest, TheSameFilesInAnyOrderAnyNumberOfTimesGiveTheSameRows) {
  Record(Open("a.db").get(), {.seed = 0}, 3);
  Record(Open("a.db").get(), {.study = "other", .task = "cup_catch", .seed = 1}, 2);
  Record(Open("b.db").get(), {.seed = 1}, 4);
  Record(Open("c.db").get(), {.seed = 2}, 5);
  // Seed 0 was run on two machines: unfinished here, so a.db's stays.
  Record(Open("c.db").get(), {.seed = 0}, 1, RunStatus::kInterrupted);
  // And seed 1 finished on both: a matter of heartbeats, but the same whichever
  // comes first.
  Record(Open("c.db").get(), {.seed = 1}, 4);
  MergeAll("abc.db", {"a.db", "b.db", "c.db"});
  MergeAll("cba.db", {"c.db", "b.db", "a.db"});
  MergeAll("bacabc.db", {"b.db", "a.db", "c.db", "a.db", "b.db", "c.db"});
  const std::vector<std::string> expected = Everything(Open("abc.db").get());
  EXPECT_EQ(Everything(Open("cba.db").get()), expected);
  EXPECT_EQ(Everything(Open("bacabc.db").get()), expected);
  EXPECT_EQ(Count(Open("abc.db").get(), "SELECT count(*) FROM run"), 4);
  EXPECT_TRUE(Verify(Open("abc.db").get(), {}).empty());
}

TEST_F(MergeTest, AMergedRunIsTheRunToTheBit) {
  Record(Open("a.db").get(), {.seed = 3}, 3);
  Open("b.db");
  MergeAll("b.db", {"a.db"});
  EXPECT_EQ(Everything(Open("b.db").get()), Everything(Open("a.db").get()));
  const auto a = Open("a.db"), b = Open("b.db");
  EXPECT_EQ(b->ComputeResultDigest(1), a->ComputeResultDigest(1));
}

TEST_F(MergeTest, ARunThatGotFurtherReplacesTheSameRun) {
  const auto a = Open("a.db");
  Record(a.get(), {.seed = 0}, 2, RunStatus::kInterrupted);
  MergeAll("t.db", {"a.db"});
  {
    RunWriter writer(a.get(), 1);
    writer.BeginSegment(MakeSegment(a.get()),
                        {.env_step = 20, .training_episodes = 2, .events = 1});
    writer.AddEpisode({.episode = 2, .env_step = 30, .episode_return = 9});
    writer.SetProgress(30);
    writer.Finish();
    a->SetRunStatus(1, RunStatus::kFinished, 0);
  }
  const auto target = Open("t.db");
  const MergeResult result = Merge(target.get(), folder_ / "a.db");
  EXPECT_EQ(result.replaced, 1);
  EXPECT_EQ(Everything(target.get()), Everything(a.get()));
  // The older state never comes back.
  Record(Open("old.db").get(), {.seed = 0}, 1, RunStatus::kInterrupted);
  EXPECT_EQ(Merge(target.get(), folder_ / "old.db").kept, 1);
  EXPECT_EQ(Everything(target.get()), Everything(a.get()));
}

// One that claims to have got further than it has, and one whose returns were changed.
TEST_F(MergeTest, ARunThatIsThereAndWholeStaysOverAChangedCopy) {
  Record(Open("a.db").get(), {.seed = 0}, 2, RunStatus::kInterrupted);
  MergeAll("t.db", {"a.db"});
  const auto target = Open("t.db");
  const auto before = Everything(target.get());
  for (const char* change :
       {"UPDATE run SET status = 'finished', env_steps_done = 100000",
        "UPDATE run SET heartbeat_utc = '2999-01-01T00:00:00.000Z'; UPDATE episode SET"
        " episode_return = 1000"}) {
    const std::string copy =
        std::string("copy") + std::to_string(before.size()) + change[15] + ".db";
    std::filesystem::copy_file(folder_ / "a.db", folder_ / copy);
    Open(copy)->connection().Execute(change);
    const MergeResult result = Merge(target.get(), folder_ / copy);
    EXPECT_EQ(result.kept, 1) << change;
    EXPECT_EQ(result.replaced, 0) << change;
    ASSERT_EQ(result.notes.size(), 1u) << change;
    EXPECT_NE(result.notes[0].find("is not as it was written"), std::string::npos);
    EXPECT_EQ(Everything(target.get()), before);
  }
}

TEST_F(MergeTest, EvaluationsFollowTheRunTheyAreOf) {
  const auto a = Open("a.db");
  Record(a.get(), {.seed = 5}, 1);
  Record(a.get(), {.seed = 0}, 2);
  Record(a.get(), {.planner = "rollout", .seed = 0, .parent_run_id = 2}, 1);
  const auto target = Open("t.db");
  Record(target.get(), {.seed = 7}, 1);
  Merge(target.get(), folder_ / "a.db");
  EXPECT_EQ(target->connection().QueryText(
                "SELECT p.uuid FROM run r JOIN run p ON p.run_id = r.parent_run_id"),
            a->GetRun(2)->uuid);
  EXPECT_EQ(Merge(target.get(), folder_ / "a.db").kept, 3);
}

TEST_F(MergeTest, FilesAreFoundWhereTheirSourceHasThem) {
  std::filesystem::create_directory(folder_ / "sub");
  Record(Open("a.db").get(), {.seed = 0}, 1);
  Record(Open("sub/b.db").get(), {.seed = 1}, 1);
  std::filesystem::create_directory(folder_ / "far");
  MergeAll("far/t.db", {"a.db", "sub/b.db"});
  const auto a = Open("a.db"), b = Open("sub/b.db"), t = Open("far/t.db");
  for (Database* source : {a.get(), b.get()}) {
    const RunInfo run = *source->GetRun(1);
    EXPECT_EQ(source->RunFolder(run), source->path() + ".files/" + run.uuid);
    EXPECT_EQ(t->RunFolder(t->GetRun(run.uuid)), source->RunFolder(run));
  }
  // Renamed together with its files, a database still has them.
  const RunInfo run = *a->GetRun(1);
  std::filesystem::create_directories(folder_ / ("c.db.files/" + run.uuid));
  std::filesystem::copy(folder_ / "a.db", folder_ / "c.db");
  EXPECT_EQ(Open("c.db")->RunFolder(run), folder_ / ("c.db.files/" + run.uuid));
  // A path that is not the run's own folder is never followed.
  RunInfo strange = run;
  strange.log_path = "../run.log";
  EXPECT_EQ(a->RunFolder(strange), a->RunFolder(run));
}

TEST_F(MergeTest, ATaskWithOtherFiguresIsRefused) {
  const auto a = Open("a.db");
  a->connection().Execute("SELECT 1");
  Record(a.get(), {}, 1);
  a->connection().Execute("UPDATE task SET observation_size = 7");
  const auto b = Open("b.db");
  Record(b.get(), {.seed = 1}, 1);
  EXPECT_THROW(Merge(b.get(), folder_ / "a.db"), Failure);
  EXPECT_EQ(Count(b.get(), "SELECT count(*) FROM run"), 1);
}

TEST_F(MergeTest, APublishedPointStaysWholeWhicheverComesFirst) {
  const auto publish = [&](const std::string& name, std::optional<double> episode_return,
                           std::optional<std::int64_t> seeds, std::optional<double> sd) {
    PublishedPoint point = {.source = "s", .method = "m", .obs = "state", .task = "t"};
    point.episode_return = episode_return.value_or(std::nan(""));
    point.n_seeds = seeds;
    point.seed_sd = sd;
    StorePublished(Open(name).get(), {point});
  };
  publish("a.db", 5, 3, 1.5);
  publish("b.db", 5, 3, 1.25);
  publish("c.db", 7, 10, 2.0);
  publish("d.db", std::nullopt, 1, std::nullopt);
  publish("e.db", 5, std::nullopt, 0.5);
  for (const auto& order : std::vector<std::vector<std::string>>{
           {"a.db", "b.db", "c.db", "d.db", "e.db"}, {"e.db", "d.db", "c.db", "b.db", "a.db"}}) {
    MergeAll(order[0] + "t", order);
    const auto merged = Open(order[0] + "t");
    Statement row = merged->connection().Prepare(
        "SELECT count(*), max(episode_return), n_seeds, seed_sd FROM published");
    ASSERT_TRUE(row.Step());
    EXPECT_EQ(row.Int(0), 1);
    EXPECT_EQ(row.Real(1), 5);
    EXPECT_EQ(row.Int(2), 3);
    EXPECT_EQ(row.Real(3), 1.25);
  }
}

// The runs are listed first and copied one by one.
TEST_F(MergeTest, ARunThatEndsMeanwhileIsCopiedAsItEnded) {
  const auto a = Open("a.db");
  const std::int64_t run = MakeRun(a.get());
  RunWriter writer(a.get(), run);
  writer.BeginSegment(MakeSegment(a.get()));
  writer.AddEpisode({.env_step = 10, .length = 10, .episode_return = 1});
  writer.Commit();
  const auto target = Open("t.db");
  // At the first commit, of the metrics, before any run is copied.
  const auto end = [](void* source) {
    auto* db = static_cast<Database*>(source);
    if (db->GetRun(1)->status == RunStatus::kRunning) {
      db->SetRunStatus(1, RunStatus::kFailed, 70, "it ended");
    }
    return 0;
  };
  sqlite3_commit_hook(target->connection().handle(), end, a.get());
  EXPECT_EQ(Merge(target.get(), folder_ / "a.db").added, 1);
  sqlite3_commit_hook(target->connection().handle(), nullptr, nullptr);
  EXPECT_EQ(target->GetRun(1)->status, RunStatus::kFailed);
  EXPECT_EQ(target->GetRun(1)->error, "it ended");
  EXPECT_TRUE(Verify(target.get(), {}).empty());
}

TEST_F(MergeTest, WithoutItsDecisionsAFinishedRunVerifiesAndCanHaveThemBack) {
  Record(Open("a.db").get(), {.seed = 0}, 3);
  Record(Open("a.db").get(), {.seed = 1}, 3, RunStatus::kInterrupted);
  const auto a = Open("a.db"), target = Open("t.db");
  EXPECT_EQ(Merge(target.get(), a.get(), {.decisions = false}).added, 2);
  EXPECT_EQ(Count(target.get(), "SELECT count(*) FROM step WHERE run_id = 1"), 0);
  EXPECT_EQ(Count(target.get(), "SELECT count(*) FROM step WHERE run_id = 2"), 30)
      << "an unfinished run goes on from its decisions";
  EXPECT_EQ(Verify(target.get(), {}), std::vector<std::string>());
  EXPECT_EQ(target->ComputeResultDigest(1), a->ComputeResultDigest(1));
  EXPECT_EQ(CompareRuns(target.get(), 1, a.get(), 1), std::vector<std::string>());

  EXPECT_EQ(Merge(target.get(), a.get(), {.decisions = false}).kept, 2);
  EXPECT_EQ(Merge(target.get(), a.get()).replaced, 1);
  EXPECT_EQ(Everything(target.get()), Everything(a.get()));
  EXPECT_EQ(Merge(target.get(), a.get(), {.decisions = false}).kept, 2);
  EXPECT_EQ(Everything(target.get()), Everything(a.get()));
}

TEST_F(MergeTest, ADatabaseIsNotMergedIntoItself) {
  const auto a = Open("a.db");
  EXPECT_THROW(Merge(a.get(), folder_ / "a.db"), Failure);
}

}  // namespace
}  // namespace dreamsearch::results
