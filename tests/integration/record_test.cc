// What a sweep leaves in the database.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

// One sweep for all tests of this file: two tasks, four planners.
class RecordTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    std::vector<std::string> arguments =
        TinyRun("walker_walk,cartpole_swingup", "dreamer,rollout,mcts_pw,mcts_fixed", "r.db",
                {"--set", "rollout.depth=2", "--set", "rollout.actor_candidates=4", "--set",
                 "rollout.uniform_candidates=4", "--set", "mcts_fixed.children=3"});
    result_ = place_->Runner(arguments);
  }
  static void TearDownTestSuite() { delete place_; }

  static std::string Value(const std::string& sql) { return place_->Value("r.db", sql); }

  static Workplace* place_;
  static ProgramResult result_;
};
Workplace* RecordTest::place_ = nullptr;
ProgramResult RecordTest::result_;

TEST_F(RecordTest, EveryRunOfTheCrossProductFinishes) {
  EXPECT_EQ(result_.exit_status, 0) << result_.err;
  EXPECT_EQ(Value("select count(*) from run where status = 'finished' and exit_code = 0"), "8");
  EXPECT_EQ(Value("select count(*) from run where env_steps_done = 4000"), "8");
  EXPECT_EQ(Value("select count(distinct result_digest) from run"), "8");
  EXPECT_NE(result_.err.find("next: "), std::string::npos) << result_.err;
}

TEST_F(RecordTest, EveryDecisionHasAStepRowTheRandomOnesToo) {
  EXPECT_EQ(Value("select count(*) from (select run_id from step group by run_id having "
                  "count(*) = 2000 and min(env_step) = 2 and max(env_step) = 4000)"),
            "8");
  // 500 random decisions, not planned.
  EXPECT_EQ(Value("select count(*) from step join run using (run_id) where planner = 'mcts_pw' "
                  "and (simulations = 0) <> (env_step <= 1000)"),
            "0");
}

TEST_F(RecordTest, EpisodesHoldTrainingAndBothKindsOfEvaluation) {
  EXPECT_EQ(Value("select count(*) from episode where phase = 0"), "32");
  // At 0, 2000 and 4000: without search for all, with search for all but dreamer.
  EXPECT_EQ(Value("select count(*) from episode where phase = 2"), "24");
  EXPECT_EQ(Value("select count(*) from episode where phase = 1"), "18");
  EXPECT_EQ(Value("select count(*) from episode join run using (run_id) where phase = 1 and "
                  "planner = 'dreamer'"),
            "0");
  EXPECT_EQ(Value("select group_concat(distinct length) from episode"), "1000");
}

TEST_F(RecordTest, StepRewardsAddUpToTheEpisodeReturn) {
  EXPECT_EQ(Value("select count(*) from (select abs(sum(reward) - max(episode_return)) as error "
                  "from step join episode using (run_id, episode) where phase = 0 group by "
                  "run_id, episode) where error > 1e-9"),
            "0");
}

TEST_F(RecordTest, EvaluationsOfARunBeginInTheSameStates) {
  // Untrained and with equal weights, the actor alone does the same under every
  // planner of a seed.
  EXPECT_EQ(Value("select count(distinct digest) from episode join run using (run_id) where "
                  "phase = 2 and env_step = 0"),
            "2");
}

TEST_F(RecordTest, TimeUseAddsUpToTheWallTime) {
  // What is missing is the last commit of the segment, which waits for the disk and, on a
  // busy machine, for a core: an activity that is never charged is missing from every run,
  // so the run that waited least decides.
  double least_missing = 1;
  for (const std::string& row : place_->Query(
           "r.db",
           "select run_id, sum(seconds), (julianday(ended_utc) - julianday(started_utc)) * 86400 "
           "from time_use join segment using (run_id) where env_step = 4000 group by run_id")) {
    double run = 0, used = 0, wall = 0;
    ASSERT_EQ(std::sscanf(row.c_str(), "%lf|%lf|%lf", &run, &used, &wall), 3) << row;
    EXPECT_LT(used, wall + 0.01) << row;  // the segment's times are stored in milliseconds
    least_missing = std::min(least_missing, (wall - used - 0.01) / wall);
  }
  EXPECT_LT(least_missing, 0.05);
}

TEST_F(RecordTest, ViewsAnswerWithoutOurTools) {
  EXPECT_NE(Value("select count(*) from v_curve"), "0");
  EXPECT_NE(Value("select count(*) from v_time"), "0");
  EXPECT_EQ(Value("select count(*) from v_run"), "8");
}

TEST_F(RecordTest, LossesAndSearchStatisticsAreScalars) {
  EXPECT_NE(Value("select count(*) from scalar join metric using (metric_id) where name like "
                  "'dreamer.%loss'"),
            "0");
  EXPECT_NE(Value("select count(*) from scalar join metric using (metric_id) where name = "
                  "'mcts_pw.root_visit_entropy'"),
            "0");
}

TEST_F(RecordTest, TheSameCommandAgainSkipsWhatIsFinished) {
  const std::string before = Value("select group_concat(result_digest || ended_utc) from run");
  const ProgramResult again = place_->Runner(
      TinyRun("walker_walk,cartpole_swingup", "dreamer,rollout,mcts_pw,mcts_fixed", "r.db",
              {"--set", "rollout.depth=2", "--set", "rollout.actor_candidates=4", "--set",
               "rollout.uniform_candidates=4", "--set", "mcts_fixed.children=3"}));
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_NE(again.err.find("8 to skip, finished"), std::string::npos) << again.err;
  EXPECT_EQ(Value("select group_concat(result_digest || ended_utc) from run"), before);
}

}  // namespace
}  // namespace dreamsearch
