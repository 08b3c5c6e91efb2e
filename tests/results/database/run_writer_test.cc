// What a run records is there, once, whatever ended it.
// Over 400 lines: the tests of one class, on one fixture.
#include "results/database/run_writer.h"

#include <gtest/gtest.h>
#include <time.h>

#include <cmath>
#include <limits>

#include "results/database/derived_rows.h"
#include "results/system/error.h"
#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

class RunWriterTest : public testing::Test {
 protected:
  RunWriterTest() : db_(Database::OpenOrCreate(folder_ / "r.db")), run_(MakeRun(db_.get())) {}

  // 500 decisions, a training episode a 1000 environment steps, evaluations every
  // 5000 from step 0, scalars with every episode.
  void Record(RunWriter* writer, std::int64_t from, std::int64_t to) {
    const std::int64_t metric = writer->Metric("model_loss", "nats", "negative log-likelihood");
    if (from == 0) Evaluate(writer, 0);
    for (std::int64_t env_step = from + 2; env_step <= to; env_step += 2) {
      const std::int64_t episode = (env_step - 1) / 1000;
      writer->AddStep({.env_step = env_step,
                       .episode = episode,
                       .t = (env_step - 2) % 1000 / 2,
                       .reward = std::sin(static_cast<double>(env_step)),
                       .value = std::cos(static_cast<double>(env_step)),
                       .plan_us = 1500,
                       .simulations = 50,
                       .nodes = 51,
                       .depth = 6});
      if (env_step % 1000 == 0) {
        writer->AddEpisode({.phase = Phase::kTraining,
                            .episode = episode,
                            .env_step = env_step,
                            .length = 1000,
                            .episode_return = 1000 * std::sin(0.1 * static_cast<double>(episode)),
                            .digest = 1ull << 63 | static_cast<std::uint64_t>(episode)});
        writer->AddScalar(env_step, metric, 1.0 / static_cast<double>(env_step));
        writer->AddTimeUse({env_step, "learning", static_cast<double>(env_step) / 100});
        if (env_step % 5000 == 0) Evaluate(writer, env_step);
        writer->SetProgress(env_step);
      }
    }
    writer->Commit();
  }
  void Evaluate(RunWriter* writer, std::int64_t env_step) {
    for (const Phase phase : {Phase::kSearchEvaluation, Phase::kActorEvaluation}) {
      for (std::int64_t i = 0; i < 5; ++i) {
        const std::int64_t episode = env_step / 5000 * 5 + i;
        writer->AddEpisode({.phase = phase,
                            .episode = episode,
                            .env_step = env_step,
                            .length = 1000,
                            .episode_return = 0.1 * static_cast<double>(episode),
                            .digest = static_cast<std::uint64_t>(episode)});
      }
    }
  }
  // Every stored row but times and segments, as text.
  std::string Everything() {
    std::string all;
    for (const char* sql :
         {"SELECT * FROM step", "SELECT * FROM episode", "SELECT * FROM scalar",
          "SELECT * FROM time_use", "SELECT * FROM curve_bin", "SELECT * FROM chunk_digest"}) {
      Statement rows = db_->connection().Prepare(sql);
      while (rows.Step()) {
        for (int i = 0; i < rows.columns(); ++i) {
          char text[40];
          std::snprintf(text, sizeof text, "%a", rows.IsReal(i) ? rows.Real(i) : 0.0);
          all += rows.IsReal(i) ? text : rows.Text(i);
          all += rows.IsNull(i) ? "NULL," : ",";
        }
        all += '\n';
      }
    }
    return all;
  }
  void ExpectDerivedRowsMatch() {
    EXPECT_EQ(ReadChunks(db_->connection(), run_, 0), ComputeChunks(db_->connection(), run_, 0));
    const std::string grown = Everything();
    db_->connection().Transact([&] { RemakeCurveBins(db_->connection(), run_); });
    EXPECT_EQ(Everything(), grown) << "rebuilt bins differ from those that grew";
  }

  TemporaryFolder folder_;
  std::unique_ptr<Database> db_;
  std::int64_t run_;
};

TEST_F(RunWriterTest, WhatIsCommittedIsThereToTheBit) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  writer.AddStep({2, 0, 1, 0.1, 1e-310, 123456, 50, 51, 7});
  writer.AddEpisode({Phase::kSearchEvaluation, 3, 20000, 1000, 1.0 / 3, 2.5, 100.5, 200.25,
                     std::int64_t{1} << 40, ~0ull});
  writer.SetProgress(2);
  writer.Commit();
  Statement step = db_->connection().Prepare(std::string("SELECT ") + kStepColumns + " FROM step");
  ASSERT_TRUE(step.Step());
  const StepRow row = ReadStep(step);
  EXPECT_EQ(row.reward, 0.1);
  EXPECT_EQ(row.value, 1e-310);
  EXPECT_EQ(row.plan_us, 123456);
  EXPECT_EQ(row.depth, 7);
  Statement episode =
      db_->connection().Prepare(std::string("SELECT ") + kEpisodeColumns + " FROM episode");
  ASSERT_TRUE(episode.Step());
  const EpisodeRow stored = ReadEpisode(episode);
  EXPECT_EQ(stored.episode_return, 1.0 / 3);
  EXPECT_EQ(stored.digest, ~0ull);
  EXPECT_EQ(stored.model_transitions, std::int64_t{1} << 40);
  const RunInfo run = *db_->GetRun(run_);
  EXPECT_EQ(run.env_steps_done, 2);
  EXPECT_EQ(run.status, RunStatus::kRunning);
  EXPECT_LT(run.heartbeat_age_seconds, 60);
}

TEST_F(RunWriterTest, CommitsByItselfAfterAThousandRows) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  const auto reader = Database::OpenReadOnly(folder_ / "r.db");
  for (std::int64_t i = 1; i < 1000; ++i) writer.AddStep({.env_step = i});
  EXPECT_EQ(Count(reader.get(), "SELECT count(*) FROM step"), 0);
  writer.AddStep({.env_step = 1000});
  EXPECT_EQ(Count(reader.get(), "SELECT count(*) FROM step"), 1000);
}

TEST_F(RunWriterTest, CommitsByItselfAfterASecond) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  writer.AddStep({.env_step = 1});
  usleep(1010000);
  writer.CommitIfDue();
  EXPECT_EQ(Count(db_.get(), "SELECT count(*) FROM step"), 1);
}

TEST_F(RunWriterTest, BinsHoldTheReturnsOfTheirSteps) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  // Bin k covers ((k - 1) 10000, k 10000].
  for (const auto& [episode, env_step, value] :
       {std::tuple{0, 0, 1.0}, {1, 1, 2.0}, {2, 10000, 4.0}, {3, 10001, 8.0}}) {
    writer.AddEpisode({.episode = episode, .env_step = env_step, .episode_return = value});
  }
  writer.AddEpisode({.episode = 4, .env_step = 10002, .episode_return = INFINITY});
  writer.Commit();
  Statement bins = db_->connection().Prepare(
      "SELECT env_step_bin, n, sum_return, nonfinite FROM curve_bin ORDER BY 1");
  const double expected[][4] = {{0, 1, 1, 0}, {1, 2, 6, 0}, {2, 1, 8, 1}};
  for (const auto& row : expected) {
    ASSERT_TRUE(bins.Step());
    for (int i = 0; i < 4; ++i) EXPECT_EQ(bins.Real(i), row[i]);
  }
  EXPECT_FALSE(bins.Step());
}

TEST_F(RunWriterTest, BinsAndDigestsThatGrewAreThoseRebuilt) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  Record(&writer, 0, 26000);
  ExpectDerivedRowsMatch();
}

TEST_F(RunWriterTest, AReplacedRowLeavesNoTrace) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  Record(&writer, 0, 14000);
  const std::string once = Everything();
  // Other values first, some of them in another bin, then the right ones again.
  const std::int64_t metric = writer.Metric("model_loss", "nats");
  writer.AddStep({.env_step = 4000, .reward = 99});
  writer.AddStep({.env_step = 4000, .reward = 98});
  writer.AddEpisode({.episode = 3, .env_step = 9000, .episode_return = NAN});
  writer.AddEpisode({.episode = 4, .env_step = 30000, .episode_return = 7});
  writer.AddScalar(5000, metric, NAN);
  writer.Commit();
  EXPECT_NE(Everything(), once);
  ExpectDerivedRowsMatch();
  Record(&writer, 0, 14000);
  EXPECT_EQ(Everything(), once);
}

TEST_F(RunWriterTest, AResumeRemakesEveryRowToTheBit) {
  std::string uninterrupted;
  {
    RunWriter writer(db_.get(), run_);
    writer.BeginSegment(MakeSegment(db_.get()));
    Record(&writer, 0, 26000);
    uninterrupted = Everything();
  }
  const std::string digest = db_->ComputeResultDigest(run_);
  // Back to a checkpoint in the middle of an episode, in the middle of a bin.
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()), {.env_step = 12500,
                                               .training_episodes = 12,
                                               .search_evaluation_episodes = 15,
                                               .actor_evaluation_episodes = 15});
  EXPECT_EQ(Count(db_.get(), "SELECT max(env_step) FROM step"), 12500);
  EXPECT_EQ(Count(db_.get(), "SELECT max(episode) FROM episode WHERE phase = 0"), 11);
  EXPECT_EQ(Count(db_.get(), "SELECT max(episode) FROM episode WHERE phase = 1"), 14);
  EXPECT_EQ(Count(db_.get(), "SELECT max(env_step) FROM scalar"), 12000);
  EXPECT_EQ(db_->GetRun(run_)->env_steps_done, 12500);
  // 6750 steps, 14 training and 30 evaluation episodes, 14 scalars, 14 time uses.
  EXPECT_EQ(writer.rows_rolled_back(), 6750 + 14 + 30 + 14 + 14);
  EXPECT_EQ(Count(db_.get(), "SELECT rows_rolled_back FROM segment WHERE segment = 1"),
            writer.rows_rolled_back());
  ExpectDerivedRowsMatch();
  Record(&writer, 12500, 26000);
  EXPECT_EQ(Everything(), uninterrupted);
  EXPECT_EQ(db_->ComputeResultDigest(run_), digest);
}

// A checkpoint between two evaluation episodes of one evaluation, on a bin's edge.
TEST_F(RunWriterTest, AResumeInsideAnEvaluationKeepsTheEpisodesBefore) {
  std::string uninterrupted;
  {
    RunWriter writer(db_.get(), run_);
    writer.BeginSegment(MakeSegment(db_.get()));
    Record(&writer, 0, 10000);
    uninterrupted = Everything();
  }
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()), {.env_step = 10000,
                                               .training_episodes = 10,
                                               .search_evaluation_episodes = 12,
                                               .actor_evaluation_episodes = 10});
  EXPECT_EQ(Count(db_.get(), "SELECT count(*) FROM episode WHERE phase = 1"), 12);
  EXPECT_EQ(Count(db_.get(), "SELECT count(*) FROM episode WHERE phase = 2"), 10);
  ExpectDerivedRowsMatch();
  Evaluate(&writer, 10000);
  writer.Commit();
  EXPECT_EQ(Everything(), uninterrupted);
}

// Whichever way the sums came about: as rows were added, or of what a resume left.
TEST_F(RunWriterTest, RowSumsAreThoseOfTheRowsThatAreThere) {
  const ResumePoint point = {.env_step = 12500,
                             .training_episodes = 12,
                             .search_evaluation_episodes = 15,
                             .actor_evaluation_episodes = 15};
  const ResumePoint end = {.env_step = 26000,
                           .training_episodes = 26,
                           .search_evaluation_episodes = 30,
                           .actor_evaluation_episodes = 30};
  RowSums all;
  {
    RunWriter writer(db_.get(), run_);
    writer.BeginSegment(MakeSegment(db_.get()));
    EXPECT_EQ(writer.rows(), RowSums());
    Record(&writer, 0, 26000);
    all = writer.rows();
    EXPECT_EQ(all.steps, Count(db_.get(), "SELECT count(*) FROM step"));
    EXPECT_EQ(all.episodes, Count(db_.get(), "SELECT count(*) FROM episode"));
    EXPECT_EQ(RowSumsAt(db_.get(), run_, end), all);
    // A row that replaces another counts once.
    writer.AddStep({.env_step = 4000, .reward = 99});
    writer.Commit();
    EXPECT_EQ(writer.rows().steps, all.steps);
    EXPECT_NE(writer.rows().steps_digest, all.steps_digest);
    EXPECT_EQ(RowSumsAt(db_.get(), run_, end), writer.rows());
  }
  RunWriter writer(db_.get(), run_);
  const RowSums before = RowSumsAt(db_.get(), run_, point);
  writer.BeginSegment(MakeSegment(db_.get()), point);
  EXPECT_EQ(writer.rows(), before);
  EXPECT_LT(before.steps, all.steps);
  Record(&writer, 0, 26000);
  EXPECT_EQ(writer.rows(), all);
}

TEST_F(RunWriterTest, RowSumsKnowNoTimes) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  writer.AddStep({.env_step = 2, .reward = 1, .plan_us = 5});
  writer.AddEpisode({.env_step = 2, .wall_seconds = 1, .plan_us_mean = 5, .plan_us_p95 = 5});
  writer.Commit();
  const RowSums rows = writer.rows();
  writer.AddStep({.env_step = 2, .reward = 1, .plan_us = 6});
  writer.AddEpisode({.env_step = 2, .wall_seconds = 2, .plan_us_mean = 6, .plan_us_p95 = 6});
  writer.Commit();
  EXPECT_EQ(writer.rows(), rows);
}

TEST_F(RunWriterTest, ARunWithoutTheRowsOfItsCheckpointIsNotTouched) {
  {
    RunWriter writer(db_.get(), run_);
    writer.BeginSegment(MakeSegment(db_.get()));
    Record(&writer, 0, 3000);
  }
  const std::string before = Everything();
  ResumePoint point = {.env_step = 5000, .training_episodes = 5};
  point.rows = RowSums{.steps = 2500, .episodes = 5};
  RunWriter writer(db_.get(), run_);
  EXPECT_THROW(writer.BeginSegment(MakeSegment(db_.get()), point), Failure);
  EXPECT_EQ(Everything(), before);
  EXPECT_EQ(Count(db_.get(), "SELECT count(*) FROM segment"), 1);
}

TEST_F(RunWriterTest, AFreshStartDeletesEverythingEvenOfStepZero) {
  {
    RunWriter writer(db_.get(), run_);
    writer.BeginSegment(MakeSegment(db_.get()));
    Record(&writer, 0, 3000);
    writer.AddScalar(0, writer.Metric("x"), 1);
    writer.AddEvent(0, "info", "start", "");
    writer.Commit();
  }
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  for (const char* table :
       {"step", "episode", "scalar", "time_use", "event", "curve_bin", "chunk_digest"}) {
    EXPECT_EQ(Count(db_.get(), std::string("SELECT count(*) FROM ") + table), 0) << table;
  }
}

// The history of the run's segments is not remade, so it is not rolled back.
TEST_F(RunWriterTest, AResumeKeepsTheEventsThatEndedAndBeganSegments) {
  {
    RunWriter writer(db_.get(), run_);
    writer.BeginSegment(MakeSegment(db_.get()));
    writer.AddEvent(0, "info", "start", "");
    writer.AddStep({.env_step = 2, .reward = NAN});
    writer.AddEvent(2, "info", "resume", "");
    writer.Commit();
  }
  db_->AddEvent(run_, 2, "error", "crashed", "signal 11");
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()), {.events = 1});
  EXPECT_EQ(db_->connection().QueryText("SELECT group_concat(seq || kind) FROM event"),
            "0start,2resume,3crashed");
  EXPECT_EQ(writer.events(), 4);
  writer.AddEvent(2, "warning", "slow", "");
  writer.Commit();
  EXPECT_EQ(writer.events(), 5);
}

TEST_F(RunWriterTest, WhatIsNotFiniteIsNullWithAnEvent) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  writer.AddStep({.env_step = 2, .reward = NAN, .value = -INFINITY});
  writer.AddScalar(2, writer.Metric("loss"), INFINITY);
  writer.Commit();
  EXPECT_EQ(Count(db_.get(), "SELECT count(*) FROM step WHERE reward IS NULL AND value IS NULL"),
            1);
  EXPECT_EQ(Count(db_.get(), "SELECT count(*) FROM event WHERE kind = 'not_finite'"), 3);
  EXPECT_EQ(db_->connection().QueryText("SELECT detail FROM event WHERE seq = 1"),
            "step.value is -infinity; stored as NULL");
  EXPECT_EQ(db_->connection().QueryText("SELECT detail FROM event WHERE seq = 2"),
            "scalar loss is +infinity; stored as NULL");
}

TEST_F(RunWriterTest, EventsCountWhatTheSupervisorAddedToo) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  writer.AddEvent(0, "info", "checkpoint", "a");
  db_->AddEvent(run_, 0, "warning", "slow", "b");
  writer.Commit();
  EXPECT_EQ(writer.events(), 2);
}

// The later writer has the run; the earlier one must not mix its rows in.
TEST_F(RunWriterTest, OnlyTheLastSegmentsWriterMayCommit) {
  RunWriter first(db_.get(), run_);
  first.BeginSegment(MakeSegment(db_.get()));
  const auto other = Database::OpenOrCreate(folder_ / "r.db");
  RunWriter second(other.get(), run_);
  second.BeginSegment(MakeSegment(other.get()));
  first.AddStep({.env_step = 2});
  EXPECT_THROW(first.Commit(), Failure);
  second.AddStep({.env_step = 2});
  second.Commit();
  EXPECT_EQ(Count(db_.get(), "SELECT count(*) FROM step"), 1);
}

TEST_F(RunWriterTest, AFailedCommitKeepsItsRows) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  writer.AddStep({.env_step = 2});
  const std::int64_t pages = Count(db_.get(), "PRAGMA page_count");
  db_->connection().Execute("PRAGMA max_page_count = " + std::to_string(pages));
  std::int64_t env_step = 2;
  while (env_step < 100000 && !writer.trouble()) writer.AddStep({.env_step = env_step += 2});
  ASSERT_TRUE(writer.trouble());
  EXPECT_EQ(writer.trouble()->code(), ExitCode::kInputOutput);
  EXPECT_NE(std::string(writer.trouble()->what()).find("disk is full"), std::string::npos);
  EXPECT_NE(std::string(writer.trouble()->what()).find("bytes free"), std::string::npos);
  writer.AddStep({.env_step = env_step += 2});  // in the middle of a piece of work
  EXPECT_THROW(writer.Commit(), Failure);
  EXPECT_TRUE(writer.trouble());
  db_->connection().Execute("PRAGMA max_page_count = 1000000");
  writer.Commit();
  EXPECT_FALSE(writer.trouble());
  EXPECT_EQ(Count(db_.get(), "SELECT count(*) FROM step"), env_step / 2);
  ExpectDerivedRowsMatch();
}

TEST_F(RunWriterTest, AnUnknownActivityOrLevelIsRefusedByName) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  EXPECT_THROW(writer.AddTimeUse({0, "sleeping", 1}), Failure);
  EXPECT_THROW(writer.AddTimeUse({0, "environment, planning", 1}), Failure);
  EXPECT_THROW(writer.AddEvent(0, "fatal", "x", ""), Failure);
  EXPECT_THROW(writer.AddScalar(0, 12345, 1), Failure);
}

TEST_F(RunWriterTest, FinishStoresTheResultDigest) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  Record(&writer, 0, 2000);
  const std::string digest = writer.Finish();
  EXPECT_EQ(digest.size(), 64u);
  EXPECT_EQ(db_->GetRun(run_)->result_digest, digest);
  EXPECT_EQ(db_->connection().QueryText("SELECT end_reason FROM segment"), "finished");
}

TEST_F(RunWriterTest, TheResultDigestCoversReturnsLengthsAndDigestsAndNoTimes) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  const EpisodeRow row = {Phase::kTraining, 0, 1000, 1000, 12.5, 3, 4, 5, 6, 7};
  const auto digest_of = [&](const EpisodeRow& episode) {
    writer.AddEpisode(episode);
    writer.Commit();
    return db_->ComputeResultDigest(run_);
  };
  const std::string plain = digest_of(row);
  EpisodeRow changed = row;
  changed.wall_seconds = changed.plan_us_mean = changed.plan_us_p95 = 99;
  EXPECT_EQ(digest_of(changed), plain);
  changed = row;
  changed.episode_return = std::nextafter(12.5, 13.0);
  EXPECT_NE(digest_of(changed), plain);
  changed = row;
  changed.length = 999;
  EXPECT_NE(digest_of(changed), plain);
  changed = row;
  changed.env_step = 1001;
  EXPECT_NE(digest_of(changed), plain);
  changed = row;
  changed.digest ^= std::uint64_t{1} << 63;
  EXPECT_NE(digest_of(changed), plain);
  EXPECT_EQ(digest_of(row), plain);
}

double CpuSeconds() {
  timespec time;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// The contract: 5 us of CPU a decision and 50 MB a million. CPU time, so that a
// busy machine does not fail it; the margin for slower machines is fourfold.
TEST_F(RunWriterTest, AMillionDecisionsTakeFiftyMegabytes) {
  RunWriter writer(db_.get(), run_);
  writer.BeginSegment(MakeSegment(db_.get()));
  constexpr std::int64_t kRows = 200000;
  const double before = CpuSeconds();
  for (std::int64_t i = 1; i <= kRows; ++i) {
    writer.AddStep({.env_step = 1800000 + 2 * i,
                    .episode = 1800 + i / 500,
                    .t = i % 500,
                    .reward = 1.0 / static_cast<double>(i),
                    .value = 100.0 / static_cast<double>(i),
                    .plan_us = 20000 + i % 1000,
                    .simulations = 50,
                    .nodes = 51 + i % 100,
                    .depth = i % 20});
  }
  writer.Commit();
  const double us = 1e6 * (CpuSeconds() - before) / kRows;
  db_->connection().Execute("PRAGMA wal_checkpoint(TRUNCATE)");
  const double megabytes =
      static_cast<double>(std::filesystem::file_size(folder_ / "r.db")) / 1e6 / kRows * 1e6;
  RecordProperty("microseconds_a_row", std::to_string(us));
  RecordProperty("megabytes_a_million", std::to_string(megabytes));
  std::printf("%.2f us of CPU a row, %.1f MB a million rows\n", us, megabytes);
#ifdef __OPTIMIZE__
  EXPECT_LT(us, 20);
#endif
  EXPECT_LT(megabytes, 50);
}

}  // namespace
}  // namespace dreamsearch::results
