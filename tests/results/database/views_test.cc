// The figures of the views on a database small enough to work out by hand.
#include <gtest/gtest.h>

#include <vector>

#include "tests/results/database/recording.h"

namespace dreamsearch::results {
namespace {

class ViewsTest : public testing::Test {
 protected:
  ViewsTest() : db_(Database::OpenOrCreate(folder_ / "r.db")) {}

  struct Episode {
    Phase phase;
    std::int64_t episode, env_step;
    double episode_return;
  };
  std::int64_t AddRun(const RunSettings& settings, const std::vector<Episode>& episodes) {
    const std::int64_t run = MakeRun(db_.get(), settings);
    RunWriter writer(db_.get(), run);
    writer.BeginSegment(MakeSegment(db_.get()));
    for (const Episode& e : episodes) {
      writer.AddEpisode({.phase = e.phase,
                         .episode = e.episode,
                         .env_step = e.env_step,
                         .length = 1000,
                         .episode_return = e.episode_return});
    }
    writer.AddTimeUse({50, "planning", 1});
    writer.AddTimeUse({100, "planning", 4.0 + static_cast<double>(settings.seed)});
    writer.AddTimeUse({100, "learning", 10});
    writer.Commit();
    return run;
  }
  // Rows as "a|b|c".
  std::vector<std::string> Rows(const std::string& sql) {
    Statement rows = db_->connection().Prepare(sql);
    std::vector<std::string> all;
    while (rows.Step()) {
      std::string line;
      for (int i = 0; i < rows.columns(); ++i) {
        if (i > 0) line += '|';
        line += rows.Text(i);
      }
      all.push_back(line);
    }
    return all;
  }
  using Lines = std::vector<std::string>;

  TemporaryFolder folder_;
  std::unique_ptr<Database> db_;
};

TEST_F(ViewsTest, ACurveIsTheMeanOverSeedsOfEachRunsMean) {
  AddRun({.seed = 0}, {{Phase::kTraining, 0, 1000, 1},
                       {Phase::kTraining, 1, 10000, 3},
                       {Phase::kTraining, 2, 11000, 100}});
  AddRun({.seed = 1}, {{Phase::kTraining, 0, 1000, 10}});
  // Seed 0's bin 1 has mean 2, seed 1's has 10: an episode does not count twice.
  EXPECT_EQ(Rows("SELECT study, task, planner, phase, env_step_bin, mean, lo, hi, seeds, env_step"
                 " FROM v_curve ORDER BY env_step_bin"),
            (Lines{"default|walker_walk|mcts_pw|0|1|6.0|2.0|10.0|2|10000",
                   "default|walker_walk|mcts_pw|0|2|100.0|100.0|100.0|1|20000"}));
  EXPECT_EQ(Rows("SELECT seed, env_step_bin, mean, episodes FROM v_curve_run ORDER BY 1, 2"),
            (Lines{"0|1|2.0|2", "0|2|100.0|1", "1|1|10.0|1"}));
}

TEST_F(ViewsTest, RunsOfOtherConfigurationsAreNotAveraged) {
  AddRun({.config = "{\"k\":1}"}, {{Phase::kTraining, 0, 1000, 1}});
  AddRun({.config = "{\"k\":2}"}, {{Phase::kTraining, 0, 1000, 3}});
  EXPECT_EQ(Rows("SELECT mean, seeds FROM v_curve ORDER BY mean"), (Lines{"1.0|1", "3.0|1"}));
}

TEST_F(ViewsTest, RunsOfOtherVersionsAreNotAveraged) {
  AddRun({.seed = 0, .planner_version = "1.0.0"}, {{Phase::kTraining, 0, 1000, 1}});
  AddRun({.seed = 1, .planner_version = "2.0.0"}, {{Phase::kTraining, 0, 1000, 3}});
  AddRun({.seed = 2, .planner_version = "2.0.0", .planner_sha256 = "22"},  // built again
         {{Phase::kTraining, 0, 1000, 5}});
  EXPECT_EQ(
      Rows("SELECT mean, seeds, versions FROM v_curve ORDER BY mean"),
      (Lines{"1.0|1|environment 0.1.0, planner 1.0.0", "4.0|2|environment 0.1.0, planner 2.0.0"}));
  EXPECT_EQ(Rows("SELECT runs, versions FROM v_time WHERE activity = 'learning' ORDER BY 1"),
            (Lines{"1|environment 0.1.0, planner 1.0.0", "2|environment 0.1.0, planner 2.0.0"}));
  EXPECT_EQ(Rows("SELECT count(DISTINCT versions) FROM v_run"), (Lines{"2"}));
}

TEST_F(ViewsTest, EvaluationsOfATrainedRunStayOutOfTheCurves) {
  const std::int64_t run = AddRun({}, {{Phase::kTraining, 0, 1000, 1}});
  AddRun({.parent_run_id = run}, {{Phase::kSearchEvaluation, 0, 1000, 99}});
  EXPECT_EQ(Rows("SELECT phase, mean FROM v_curve"), (Lines{"0|1.0"}));
  EXPECT_EQ(Rows("SELECT count(*) FROM v_final"), (Lines{"0"}));
  EXPECT_EQ(Rows("SELECT count(*) FROM v_matrix"), (Lines{"1"}));
  EXPECT_EQ(Rows("SELECT count(*) FROM v_run"), (Lines{"2"}));
}

// `runner eval --env` on the true dynamics: nothing trains, so there is no parent either.
TEST_F(ViewsTest, EvaluationsWithoutTrainingStayOutOfTheCurves) {
  AddRun({}, {{Phase::kTraining, 0, 1000, 1}});
  AddRun({.planner = "cem", .env_steps_target = 0},
         {{Phase::kSearchEvaluation, 0, 0, 99}, {Phase::kSearchEvaluation, 1, 0, 99}});
  EXPECT_EQ(Rows("SELECT phase, mean FROM v_curve"), (Lines{"0|1.0"}));
  EXPECT_EQ(Rows("SELECT count(*) FROM v_final"), (Lines{"0"}));
  EXPECT_EQ(Rows("SELECT DISTINCT planner FROM v_time"), (Lines{"mcts_pw"}));
  EXPECT_EQ(Rows("SELECT planner FROM v_matrix"), (Lines{"mcts_pw"}));
  EXPECT_EQ(Rows("SELECT count(*) FROM v_run"), (Lines{"2"}));
}

TEST_F(ViewsTest, TheFinalScoreIsTheMeanOverTheLastTenthOfTheBudget) {
  AddRun({.env_steps_target = 100000}, {{Phase::kSearchEvaluation, 0, 90000, 1000},
                                        {Phase::kSearchEvaluation, 1, 90001, 200},
                                        {Phase::kSearchEvaluation, 2, 100000, 400},
                                        {Phase::kActorEvaluation, 0, 100000, 50},
                                        {Phase::kTraining, 0, 100000, 7}});
  EXPECT_EQ(Rows("SELECT phase, score, normalised, episodes FROM v_final ORDER BY phase"),
            (Lines{"1|300.0|0.3|2", "2|50.0|0.05|1"}));
}

TEST_F(ViewsTest, TimeIsTheLastCumulativeFigureOfEachRun) {
  AddRun({.seed = 0}, {});
  AddRun({.seed = 1}, {});
  EXPECT_EQ(Rows("SELECT planner, activity, seconds, seconds_of_all_runs, runs FROM v_time"
                 " ORDER BY activity"),
            (Lines{"mcts_pw|learning|10.0|20.0|2", "mcts_pw|planning|4.5|9.0|2"}));
}

TEST_F(ViewsTest, TheMatrixNamesWhatIsMissing) {
  const std::int64_t run = AddRun({.task = "a", .planner = "p", .seed = 0}, {});
  AddRun({.task = "b", .planner = "q", .seed = 1}, {});
  AddRun({.study = "elsewhere", .task = "c", .planner = "p", .seed = 7}, {});
  db_->SetRunStatus(run, RunStatus::kFinished, 0);
  EXPECT_EQ(Rows("SELECT task, planner, seed, status FROM v_matrix WHERE study = 'default'"
                 " ORDER BY 1, 2, 3"),
            (Lines{"a|p|0|finished", "a|p|1|missing", "a|q|0|missing", "a|q|1|missing",
                   "b|p|0|missing", "b|p|1|missing", "b|q|0|missing", "b|q|1|running"}));
  EXPECT_EQ(Rows("SELECT count(*) FROM v_matrix WHERE study = 'elsewhere'"), (Lines{"1"}));
}

TEST_F(ViewsTest, ARunIsOneLine) {
  AddRun({}, {{Phase::kTraining, 0, 1000, 1}, {Phase::kTraining, 1, 2000, 5}});
  EXPECT_EQ(Rows("SELECT study, task, planner, seed, status, last_return, segments, seconds"
                 " FROM v_run"),
            (Lines{"default|walker_walk|mcts_pw|0|running|5.0|1|14.0"}));
}

}  // namespace
}  // namespace dreamsearch::results
