// What a component declares decides how it is run and labelled; its name decides nothing.
#include <gtest/gtest.h>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

class TraitsTest : public testing::Test {
 protected:
  ProgramResult Run(const std::string& planner, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return place_.Runner(TinyRun("cartpole_balance", planner, "t.db", arguments));
  }
  std::string Value(const std::string& sql) { return place_.Value("t.db", sql); }

  Workplace place_;
};

// half_actor is a planner of another author, called neither `dreamer` nor `actor`.
TEST_F(TraitsTest, APlannerThatIsTheActorAloneIsEvaluatedOnceByItselfAndLabelledSo) {
  const ProgramResult result = Run("half_actor,random");
  ASSERT_EQ(result.exit_status, 0) << result.err;
  // The evaluations at steps 0, 2000 and 4000.
  const std::string phases =
      "select group_concat(phase || ':' || n) from (select phase, count(*) as n from episode join "
      "run using (run_id) where planner = '";
  EXPECT_EQ(Value(phases + "half_actor' and phase > 0 group by phase)"), "2:3");
  EXPECT_EQ(Value(phases + "random' and phase > 0 group by phase)"), "1:3,2:3");
  // Before any learning the actor of both runs is the same; half of its action is another.
  const std::string first =
      "select digest from episode join run using (run_id) where env_step = 0 and phase = 2 and "
      "planner = '";
  EXPECT_NE(Value(first + "half_actor'"), Value(first + "random'"));

  const ProgramResult played =
      place_.Runner({"eval", "1", "--planner", "half_actor,dreamer", "--plugin-path",
                     DREAMSEARCH_FAULTY_PLUGIN_DIR, "--db", "t.db", "--episodes", "1"});
  ASSERT_EQ(played.exit_status, 0) << played.err;
  EXPECT_EQ(Value("select group_concat(distinct phase) from episode join run using (run_id) where "
                  "parent_run_id = 1"),
            "2");
  // `runner eval` plays what the training's last evaluation played.
  EXPECT_EQ(Value("select count(distinct digest) from episode join run using (run_id) where "
                  "planner = 'half_actor' and phase = 2 and env_step = 4000 and episode in (0, 2)"),
            "1");
}

TEST_F(TraitsTest, APlannerThatLooksAheadWithoutSayingSoFailsWithASentence) {
  const ProgramResult result = Run("secret_search");
  EXPECT_EQ(result.exit_status, 70) << result.err;
  EXPECT_NE(Value("select error from run").find("does not declare kSearches"), std::string::npos)
      << Value("select error from run");
}

TEST_F(TraitsTest, APlannerThatNeedsGradientsPlansOnlyWithAModelThatGivesThem) {
  const ProgramResult refused =
      place_.Runner({"--env", "cartpole_balance", "--planner", "gradient", "--model", "oracle",
                     "--steps", "2000", "--db", "g.db"});
  EXPECT_EQ(refused.exit_status, 2);
  EXPECT_NE(refused.err.find("planner 'gradient': expected a model that gives gradients of "
                             "imagined returns, found 'oracle'. Known: dreamer, tdmpc"),
            std::string::npos)
      << refused.err;
  const ProgramResult run = Run("gradient");
  ASSERT_EQ(run.exit_status, 0) << run.err;
  EXPECT_EQ(Value("select status from run"), "finished");
  EXPECT_EQ(Value("select count(*) > 0 from metric where name = 'gradient.return_gain'"), "1");
  const ProgramResult played = place_.Runner({"eval", "1", "--planner", "gradient", "--model",
                                              "oracle", "--db", "t.db", "--episodes", "1"});
  EXPECT_EQ(played.exit_status, 2) << played.err;
  EXPECT_NE(played.err.find("found 'oracle'"), std::string::npos) << played.err;
}

TEST_F(TraitsTest, AModelThatDoesNotLearnIsNeverTrained) {
  const ProgramResult result = Run("random", {"--model", "oracle"});
  // The settings of TinyRun are those of the model `dreamer`.
  EXPECT_EQ(result.exit_status, 2) << result.err;
  const ProgramResult idle = place_.Runner(
      {"--env", "cartpole_balance", "--planner", "random", "--model", "oracle", "--steps", "2000",
       "--set", "run.prefill_steps=1000", "--set", "run.eval_episodes=1", "--db", "o.db"});
  EXPECT_EQ(idle.exit_status, 0) << idle.err;
  EXPECT_EQ(place_.Value("o.db",
                         "select count(*) from scalar join metric using (metric_id) where "
                         "name like 'oracle.%'"),
            "0");
}

TEST_F(TraitsTest, AModelIsNamedInALabelUnlessItIsTheDefaultOne) {
  const ProgramResult result = place_.Runner({"--env",         "good_environment",
                                              "--planner",     "random",
                                              "--model",       "idle_model,dreamer",
                                              "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR,
                                              "--steps",       "20",
                                              "--set",         "run.prefill_steps=10",
                                              "--set",         "run.eval_episodes=1",
                                              "--set",         "run.sequence_length=2",
                                              "--set",         "run.pretrain_updates=0",
                                              "--set",         "run.batch_size=1",
                                              "--db",          "l.db"});
  ASSERT_EQ(result.exit_status, 0) << result.err;
  EXPECT_NE(result.err.find("finished good_environment random on idle_model seed 0"),
            std::string::npos)
      << result.err;
  EXPECT_NE(result.err.find("finished good_environment random seed 0"), std::string::npos)
      << result.err;
}

}  // namespace
}  // namespace dreamsearch
