#include "results/upkeep/verification.h"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>

#include "results/analysis/published.h"
#include "results/database/derived_rows.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

class VerificationTest : public testing::Test {
 protected:
  VerificationTest() : db_(Database::OpenOrCreate(folder_ / "r.db")) {
    NewRun row = MakeNewRun(db_.get());
    row.action_repeat = 500;  // a decision an episode
    const std::int64_t run = db_->CreateRun(row).run_id;
    RunWriter writer(db_.get(), run);
    writer.BeginSegment(MakeSegment(db_.get()));
    const std::int64_t metric = writer.Metric("loss", "nats", "a loss");
    for (std::int64_t i = 1; i <= 60; ++i) {
      writer.AddStep({.env_step = i * 500,
                      .episode = i - 1,
                      .reward = 1.0 / static_cast<double>(i),
                      .value = 3.0 + static_cast<double>(i),
                      .plan_us = 1000 + i,
                      .simulations = 50,
                      .nodes = 51,
                      .depth = 5});
      writer.AddEpisode({.episode = i - 1,
                         .env_step = i * 500,
                         .length = 500,
                         .episode_return = 1.0 / static_cast<double>(i),
                         .wall_seconds = 1.5,
                         .plan_us_mean = 1000.25,
                         .plan_us_p95 = 2000.5,
                         .model_transitions = 25000,
                         .digest = static_cast<std::uint64_t>(i) << 50});
      writer.AddScalar(i * 500, metric, 0.1 * static_cast<double>(i));
    }
    writer.AddArtifact(db_->RunFolder(*db_->GetRun(run)) + "/last.ckpt", "checkpoint", 30000, 1,
                       "00");
    writer.SetProgress(30000);
    writer.Finish();
    db_->SetRunStatus(run, RunStatus::kFinished, 0);
  }
  std::size_t Problems() { return Verify(db_.get(), {}).size(); }

  TemporaryFolder folder_;
  std::unique_ptr<Database> db_;
};

TEST_F(VerificationTest, FindsNothingInWhatWasWritten) { EXPECT_EQ(Problems(), 0u); }

// One bit of one value of one row, whatever the row, column and bit. The value is
// changed through SQL with the triggers off, as a bad disk would: unseen.
TEST_F(VerificationTest, FindsEveryFlippedBitOfAStoredRow) {
  db_->connection().Execute("DROP TRIGGER episode_updated");
  const std::size_t dropped = 1;  // the trigger is missed as well
  ASSERT_EQ(Problems(), dropped);
  struct Column {
    const char* table;
    const char* name;
    bool real;
  };
  const Column columns[] = {{"step", "reward", true},
                            {"step", "value", true},
                            {"step", "plan_us", false},
                            {"step", "depth", false},
                            {"step", "t", false},
                            {"step", "nodes", false},
                            {"episode", "length", false},
                            {"episode", "episode_return", true},
                            {"episode", "wall_s", true},
                            {"episode", "digest", false},
                            {"episode", "plan_us_mean", true},
                            {"episode", "model_transitions", false},
                            {"scalar", "value", true}};
  int flips = 0;
  for (const Column& column : columns) {
    for (int bit = 0; bit < 63; bit += 3) {
      for (const int row : {1, 30, 60}) {
        const std::string at = " WHERE env_step = " + std::to_string(row * 500);
        Statement read = db_->connection().Prepare(std::string("SELECT ") + column.name + " FROM " +
                                                   column.table + at);
        ASSERT_TRUE(read.Step());
        Statement write = db_->connection().Prepare(std::string("UPDATE ") + column.table +
                                                    " SET " + column.name + " = ?1" + at);
        if (column.real) {
          const double value = read.Real(0);
          std::uint64_t bits;
          std::memcpy(&bits, &value, sizeof bits);
          bits ^= std::uint64_t{1} << bit;
          double flipped;
          std::memcpy(&flipped, &bits, sizeof flipped);
          read.Reset();
          write.Bind(flipped).Run();
          EXPECT_GT(Problems(), dropped) << column.table << "." << column.name << " bit " << bit;
          write.Bind(value).Run();
        } else {
          const std::int64_t value = read.Int(0);
          read.Reset();
          write.Bind(value ^ (std::int64_t{1} << bit)).Run();
          EXPECT_GT(Problems(), dropped) << column.table << "." << column.name << " bit " << bit;
          write.Bind(value).Run();
        }
        ++flips;
      }
    }
  }
  EXPECT_EQ(flips, 13 * 21 * 3);
  EXPECT_EQ(Problems(), dropped) << "the flips were not taken back";
}

TEST_F(VerificationTest, FindsAChangeInAnythingElseOfARunThatHasEnded) {
  db_->AddEvent(1, 5, "info", "note", "after the end");
  StorePublished(db_.get(), {{.source = "a paper",
                              .method = "m",
                              .obs = "state",
                              .task = "walker_walk",
                              .env_steps = 1000,
                              .episode_return = 0.3}});
  EXPECT_EQ(Problems(), 0u);
  for (const auto& [change, back] : std::vector<std::pair<const char*, const char*>>{
           {"UPDATE run SET seed = seed + 1", "UPDATE run SET seed = seed - 1"},
           {"UPDATE run SET error = 'x'", "UPDATE run SET error = ''"},
           {"UPDATE task SET substeps = 11", "UPDATE task SET substeps = 10"},
           {"UPDATE plugin SET sha256 = 'ac'", "UPDATE plugin SET sha256 = 'ab'"},
           {"UPDATE build SET flags = 'x'", "UPDATE build SET flags = ''"},
           {"UPDATE host SET cores = 3", "UPDATE host SET cores = 2"},
           {"UPDATE segment SET pid = pid + 1", "UPDATE segment SET pid = pid - 1"},
           {"UPDATE segment SET slurm_node = 'n1'", "UPDATE segment SET slurm_node = NULL"},
           {"UPDATE event SET detail = 'After the end'",
            "UPDATE event SET detail = 'after the end'"},
           {"UPDATE metric SET doc = 'a lost'", "UPDATE metric SET doc = 'a loss'"},
           {"UPDATE study SET created_utc = 'x' || created_utc",
            "UPDATE study SET created_utc = substr(created_utc, 2)"},
           {"UPDATE run SET log_path = log_path || 'x'",
            "UPDATE run SET log_path = substr(log_path, 1, length(log_path) - 1)"},
           {"UPDATE artifact SET path = 'x' || path", "UPDATE artifact SET path = substr(path, 2)"},
           {"UPDATE published SET episode_return = 0.1 + 0.2",
            "UPDATE published SET episode_return = 0.3"},
           {"UPDATE published SET seed_sd = 0", "UPDATE published SET seed_sd = NULL"},
           {"UPDATE study SET name = 'defaulu'", "UPDATE study SET name = 'default'"}}) {
    db_->connection().Execute(change);
    EXPECT_GE(Problems(), 1u) << change;
    db_->connection().Execute(back);
    EXPECT_EQ(Problems(), 0u) << back;
  }
}

// A program of before knew fewer columns, which are empty in its runs.
TEST_F(VerificationTest, ARunThatAnEarlierProgramEndedIsAsItWasWritten) {
  Connection& db = db_->connection();
  db.Execute("UPDATE segment SET slurm_restarts = NULL, slurm_node = NULL");
  for (int generation = 0; generation <= kNewestRecord; ++generation) {
    const std::optional<Chunk> record = ComputeRecord(db, 1, generation);
    ASSERT_TRUE(record) << generation;
    db.Prepare("UPDATE chunk_digest SET n_rows = ?1, digest = ?2 WHERE tbl = 'run'")
        .Bind(record->rows, static_cast<std::int64_t>(record->digest))
        .Run();
    EXPECT_EQ(Problems(), 0u) << generation;
    for (const char* change :
         {"UPDATE segment SET slurm_node = 'n1'", "UPDATE run SET seed = seed + 1"}) {
      db.Execute(change);
      EXPECT_EQ(Problems(), 1u) << generation << ": " << change;
      db.Execute("UPDATE segment SET slurm_node = NULL; UPDATE run SET seed = 0");
    }
  }
}

TEST_F(VerificationTest, ARunThatGoesOnIsNotHeldToItsOldRecord) {
  RunWriter writer(db_.get(), 1);
  writer.BeginSegment(MakeSegment(db_.get()), {.env_step = 10000, .training_episodes = 20});
  EXPECT_EQ(Problems(), 0u);
  db_->SetRunStatus(1, RunStatus::kInterrupted, 75);
  EXPECT_EQ(Problems(), 0u);
  // A commit after the supervisor has spoken.
  writer.AddTimeUse({10000, "other", 1});
  writer.Commit();
  EXPECT_EQ(Problems(), 0u);
}

TEST_F(VerificationTest, FindsMissingAndAddedRows) {
  // Fewer than were written, and a hole.
  db_->connection().Execute("DELETE FROM step WHERE env_step = 15000");
  EXPECT_EQ(Problems(), 2u);
  db_->connection().Execute(
      "INSERT INTO scalar SELECT run_id, metric_id, 777, 1 FROM scalar LIMIT 1");
  EXPECT_EQ(Problems(), 3u);
}

// Rows that were never written leave every digest right.
class HolesTest : public testing::Test {
 protected:
  // Episodes of two decisions of one or two steps each, from `episode` on.
  static void AddEpisodes(RunWriter* writer, std::int64_t episode, std::int64_t end) {
    for (; episode < end; ++episode) {
      const std::int64_t begin = 3 * episode;
      writer->AddStep({.env_step = begin + 2, .episode = episode, .t = 0});
      writer->AddStep({.env_step = begin + 3, .episode = episode, .t = 1});
      writer->AddEpisode({.episode = episode, .env_step = begin + 3, .length = 3});
    }
    writer->SetProgress(3 * end);
    writer->Commit();
  }
  static void AddEvaluation(RunWriter* writer, std::int64_t episode) {
    writer->AddEpisode({.phase = Phase::kActorEvaluation, .episode = episode, .length = 3});
    writer->Commit();
  }
  std::vector<std::string> Problems(const std::function<void(RunWriter*)>& record) {
    RunWriter writer(db_.get(), MakeRun(db_.get()));
    writer.BeginSegment(MakeSegment(db_.get()));
    record(&writer);
    return Verify(db_.get(), {});
  }
  static void Expect(const std::vector<std::string>& problems,
                     const std::vector<std::string>& parts) {
    ASSERT_EQ(problems.size(), parts.size()) << testing::PrintToString(problems);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      EXPECT_NE(problems[i].find(parts[i]), std::string::npos) << problems[i];
    }
  }

  TemporaryFolder folder_;
  std::unique_ptr<Database> db_ = Database::OpenOrCreate(folder_ / "r.db");
};

TEST_F(HolesTest, ARunWithoutHolesHasNone) {
  Expect(Problems([](RunWriter* writer) {
           AddEpisodes(writer, 0, 5);
           AddEvaluation(writer, 0);
           AddEvaluation(writer, 1);
         }),
         {});
}

TEST_F(HolesTest, MissingEpisodesAreFoundInBothTables) {
  Expect(Problems([](RunWriter* writer) {
           AddEpisodes(writer, 0, 2);
           AddEpisodes(writer, 4, 5);
         }),
         {"decisions are missing between environment steps 6 and 14",
          "training episodes are missing between environment steps 6 and 15"});
}

TEST_F(HolesTest, ARunThatDoesNotBeginAtItsBeginningHasAHole) {
  Expect(Problems([](RunWriter* writer) { AddEpisodes(writer, 1, 2); }),
         {"decisions are missing between environment steps 0 and 5",
          "training episodes are missing between environment steps 0 and 6"});
}

TEST_F(HolesTest, AMissingDecisionIsFoundThoughItsEpisodeIsThere) {
  Expect(Problems([](RunWriter* writer) {
           writer->AddStep({.env_step = 2, .episode = 0, .t = 0});
           writer->AddEpisode({.episode = 0, .env_step = 3, .length = 3});
           AddEpisodes(writer, 1, 2);
         }),
         {"decisions are missing between environment steps 2 and 5"});
}

TEST_F(HolesTest, DecisionsMissingAtTheEndAreFound) {
  Expect(Problems([](RunWriter* writer) {
           AddEpisodes(writer, 0, 2);
           writer->SetProgress(9);
           writer->Commit();
         }),
         {"decisions are missing between environment steps 6 and 9"});
}

TEST_F(HolesTest, MissingEvaluationEpisodesAreFound) {
  Expect(Problems([](RunWriter* writer) {
           AddEvaluation(writer, 0);
           AddEvaluation(writer, 2);
           AddEvaluation(writer, 5);
         }),
         {"evaluation episodes are missing before episode 2 of phase 2, and in 1 more"});
}

TEST_F(HolesTest, ASegmentThatBeginsPastTheEndOfTheOneBeforeIsFound) {
  Expect(Problems([this](RunWriter* writer) {
           AddEpisodes(writer, 0, 2);
           RunWriter later(db_.get(), 1);
           later.BeginSegment(MakeSegment(db_.get()), {.env_step = 9, .training_episodes = 2});
           later.SetProgress(6);
           later.Commit();
         }),
         {"segment 1 begins at environment step 9, but what was before it ended at 6"});
  db_->connection().Execute("DELETE FROM segment WHERE segment = 0");
  Expect(Verify(db_.get(), {}), {"segment 1 is there, but not segment 0"});
}

TEST_F(VerificationTest, FindsBinsConfigurationsAndDigestsThatDoNotFollow) {
  db_->connection().Execute(
      "UPDATE curve_bin SET sum_return = sum_return + 1e-9 WHERE env_step_bin = 1");
  EXPECT_EQ(Problems(), 1u);
  db_->connection().Execute("UPDATE config SET json = json || ' '");
  EXPECT_EQ(Problems(), 2u);
  // Both the digest and the record that it is part of.
  db_->connection().Execute("UPDATE run SET result_digest = 'x'");
  EXPECT_EQ(Problems(), 4u);
}

}  // namespace
}  // namespace dreamsearch::results
