#include "results/verification.h"

#include <gtest/gtest.h>

#include <cstring>

#include "recording.h"

namespace dreamsearch::results {
namespace {

class VerificationTest : public testing::Test {
 protected:
  VerificationTest() : db_(Database::OpenOrCreate(folder_ / "r.db")) {
    const std::int64_t run = MakeRun(db_.get());
    RunWriter writer(db_.get(), run);
    writer.BeginSegment(MakeSegment(db_.get()));
    const std::int64_t metric = writer.Metric("loss");
    for (std::int64_t i = 1; i <= 60; ++i) {
      writer.AddStep({.env_step = i * 500,
                      .episode = i / 2,
                      .t = i % 2,
                      .reward = 1.0 / static_cast<double>(i),
                      .value = 3.0 + static_cast<double>(i),
                      .plan_us = 1000 + i,
                      .simulations = 50,
                      .nodes = 51,
                      .depth = 5});
      writer.AddEpisode({.episode = i,
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
          EXPECT_GT(Problems(), 0u) << column.table << "." << column.name << " bit " << bit;
          write.Bind(value).Run();
        } else {
          const std::int64_t value = read.Int(0);
          read.Reset();
          write.Bind(value ^ (std::int64_t{1} << bit)).Run();
          EXPECT_GT(Problems(), 0u) << column.table << "." << column.name << " bit " << bit;
          write.Bind(value).Run();
        }
        ++flips;
      }
    }
  }
  EXPECT_EQ(flips, 13 * 21 * 3);
  EXPECT_EQ(Problems(), 0u) << "the flips were not taken back";
}

TEST_F(VerificationTest, FindsAChangeInAnythingElseOfARunThatHasEnded) {
  db_->AddEvent(1, 5, "info", "note", "after the end");
  EXPECT_EQ(Problems(), 0u);
  for (const auto& [change, back] : std::vector<std::pair<const char*, const char*>>{
           {"UPDATE run SET seed = seed + 1", "UPDATE run SET seed = seed - 1"},
           {"UPDATE run SET error = 'x'", "UPDATE run SET error = ''"},
           {"UPDATE task SET substeps = 11", "UPDATE task SET substeps = 10"},
           {"UPDATE plugin SET sha256 = 'ac'", "UPDATE plugin SET sha256 = 'ab'"},
           {"UPDATE build SET flags = 'x'", "UPDATE build SET flags = ''"},
           {"UPDATE host SET cores = 3", "UPDATE host SET cores = 2"},
           {"UPDATE segment SET pid = pid + 1", "UPDATE segment SET pid = pid - 1"},
           {"UPDATE event SET detail = 'After the end'",
            "UPDATE event SET detail = 'after the end'"},
           {"UPDATE study SET name = 'defaulu'", "UPDATE study SET name = 'default'"}}) {
    db_->connection().Execute(change);
    EXPECT_EQ(Problems(), 1u) << change;
    db_->connection().Execute(back);
    EXPECT_EQ(Problems(), 0u) << back;
  }
}

TEST_F(VerificationTest, ARunThatGoesOnIsNotHeldToItsOldRecord) {
  RunWriter writer(db_.get(), 1);
  writer.BeginSegment(MakeSegment(db_.get()), {.env_step = 10000, .training_episodes = 21});
  EXPECT_EQ(Problems(), 0u);
  db_->SetRunStatus(1, RunStatus::kInterrupted, 75);
  EXPECT_EQ(Problems(), 0u);
  // A commit after the supervisor has spoken.
  writer.AddTimeUse(10000, "other", 1);
  writer.Commit();
  EXPECT_EQ(Problems(), 0u);
}

TEST_F(VerificationTest, FindsMissingAndAddedRows) {
  db_->connection().Execute("DELETE FROM step WHERE env_step = 15000");
  EXPECT_EQ(Problems(), 1u);
  db_->connection().Execute(
      "INSERT INTO scalar SELECT run_id, metric_id, 777, 1 FROM scalar LIMIT 1");
  EXPECT_EQ(Problems(), 2u);
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
