// Ordinary environments, whose episodes end when they like.
#include <gtest/gtest.h>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

class EarlyTest : public testing::Test {
 protected:
  // A small budget of 600 decisions, each of one environment step.
  ProgramResult Run(const std::string& environment, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"--plugin-path", DREAMSEARCH_EARLY_PLUGIN_DIR, "--set",
                                          "run.action_repeat=1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    arguments = TinyRun(environment, "random", "e.db", arguments);
    for (std::string& argument : arguments) {
      if (argument == "4000") argument = "600";
      if (argument == "run.prefill_steps=1000") argument = "run.prefill_steps=200";
      if (argument == "run.sequence_length=8") argument = "run.sequence_length=32";
      if (argument == "run.train_every=250") argument = "run.train_every=50";
      if (argument == "run.eval_every=2000") argument = "run.eval_every=300";
      if (argument == "run.checkpoint_every=1000") argument = "run.checkpoint_every=300";
    }
    return place_.Runner(arguments);
  }
  std::string Value(const std::string& sql) { return place_.Value("e.db", sql); }

  Workplace place_;
};

TEST_F(EarlyTest, EpisodesShorterThanASequenceAreLearnedFrom) {
  const ProgramResult result = Run("short20");
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Value("select count(*) from episode where phase = 0 and length = 20"), "30");
  EXPECT_NE(Value("select count(*) from scalar join metric using (metric_id) where name like "
                  "'%observation_loss'"),
            "0");
}

TEST_F(EarlyTest, MemoryFollowsTheBudgetAndNotTheDeclaredLength) {
  const ProgramResult result = Run("unlimited", {"--memory-limit", "1G"});
  EXPECT_EQ(result.exit_status, 0) << result.err;
}

TEST_F(EarlyTest, ATaskThatDeclaresItsDeathsHasThemLearned) {
  const ProgramResult result = Run("varied");
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Value("select count(*) from event where kind = 'terminal_state'"), "0");
  EXPECT_NE(Value("select max(value) from scalar join metric using (metric_id) where name like "
                  "'%continuation_loss'"),
            "0.0");
}

TEST_F(EarlyTest, ATaskThatDiesWithoutSayingSoIsWarnedOfOnce) {
  const ProgramResult result = Run("silent");
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Value("select count(*) from event where kind = 'terminal_state'"), "1");
}

TEST_F(EarlyTest, AnEpisodeThatDivergesEndsAndTheNextBegins) {
  const ProgramResult result = Run("rarely_bad", {"--seeds", "3"});
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Value("select group_concat(status || env_steps_done) from run"),
            "finished600,finished600,finished600");
  // Each is recorded with what plays it again, and what it lived before counts.
  const std::string bad = Value(
      "select count(*) from event where kind = 'divergence' and detail like '%training episode%'");
  EXPECT_NE(bad, "0");
  EXPECT_EQ(Value("select count(*) from artifact where kind = 'divergence'"), bad);
  EXPECT_EQ(Value("select count(*) from episode where phase = 0 and length = 49"), bad);
  EXPECT_EQ(
      Value("select count(*) from episode as e where phase = 0 and length <> (select count(*) "
            "from step as s where s.run_id = e.run_id and s.episode = e.episode)"),
      "0");
}

TEST_F(EarlyTest, ARunIsGivenUpAfterEpisodesInARowThatDiverge) {
  const ProgramResult result = Run("always_bad", {"--set", "run.diverged_episodes=3"});
  EXPECT_EQ(result.exit_status, 72) << result.err;
  EXPECT_EQ(Value("select status from run"), "diverged");
  EXPECT_NE(Value("select error from run").find("so ended 3 episodes in a row"), std::string::npos)
      << Value("select error from run");
  EXPECT_EQ(Value("select count(*) from event where level = 'warning' and kind = 'divergence' and "
                  "detail like '%training%'"),
            "3");
}

TEST_F(EarlyTest, ARetriedRunHasOtherSeedsFromThereOnAndDoesNotDivergeAtTheSameStepForEver) {
  // The third episode of seed 2 diverges, after the checkpoint of environment step 319.
  const std::vector<std::string> more = {"--set", "run.diverged_episodes=1", "--seed-list", "2"};
  std::vector<std::string> again = more;
  again.push_back("--retry");
  ProgramResult result = Run("rarely_bad", more);
  ASSERT_EQ(result.exit_status, 72) << result.err;
  const std::string kept =
      "select group_concat(digest) from episode where phase = 0 and episode < 2";
  const std::string before = Value(kept);
  ASSERT_EQ(Value("select max(env_step) from artifact where kind = 'checkpoint'"), "319");
  int retries = 0;
  while (result.exit_status == 72 && retries < 40) {
    result = Run("rarely_bad", again);
    ++retries;
  }
  ASSERT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Value("select status from run"), "finished");
  EXPECT_EQ(Value(kept), before);
  // Each is recorded with its number, and where it began.
  EXPECT_EQ(Value("select count(*) from event where kind = 'retry'"), std::to_string(retries));
  EXPECT_EQ(Value("select detail from event where kind = 'retry' order by seq limit 1"),
            "retry 1: training episodes from 2 on have other seeds");
  // What it became can be had again.
  const ProgramResult verified =
      place_.Runner({"verify", "1", "--db", "e.db", "--plugin-path", DREAMSEARCH_EARLY_PLUGIN_DIR});
  EXPECT_EQ(verified.exit_status, 0) << verified.out << verified.err;
}

}  // namespace
}  // namespace dreamsearch
