// The second learned model through the programs: what it asks of the runner, and runs with it.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <utility>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

const std::vector<std::string> kTiny = {"--model", "tdmpc",
                                        "--steps", "3000",
                                        "--set",   "run.prefill_steps=1000",
                                        "--set",   "run.pretrain_updates=4",
                                        "--set",   "run.train_every=200",
                                        "--set",   "run.batch_size=8",
                                        "--set",   "run.eval_episodes=1",
                                        "--set",   "run.eval_every=1500",
                                        "--set",   "model.width=16",
                                        "--set",   "model.encoder_width=16",
                                        "--set",   "model.simplices=2",
                                        "--set",   "mppi.candidates=16",
                                        "--set",   "mppi.elites=8",
                                        "--set",   "mppi.actor_candidates=4",
                                        "--set",   "mppi.iterations=1"};

std::vector<std::string> Tiny(const std::string& planners, const std::string& db) {
  std::vector<std::string> arguments = {"--env", "cartpole_balance", "--planner", planners, "--db",
                                        db};
  arguments.insert(arguments.end(), kTiny.begin(), kTiny.end());
  return arguments;
}

TEST(Tdmpc, DescribeAndDryRunShowWhatItAsksOfTheRunner) {
  const Workplace place;
  const ProgramResult described = place.Runner({"describe", "model/tdmpc"});
  EXPECT_EQ(described.exit_status, 0) << described.err;
  EXPECT_NE(described.out.find("run.batch_size            fast=256, paper=256"), std::string::npos)
      << described.out;
  EXPECT_NE(described.out.find("run.train_within_episode  fast=1, paper=1"), std::string::npos)
      << described.out;
  std::vector<std::string> arguments = Tiny("mppi", "d.db");
  arguments.emplace_back("--dry-run");
  const ProgramResult dry = place.Runner(arguments);
  EXPECT_EQ(dry.exit_status, 0) << dry.err;
  EXPECT_NE(dry.out.find("run.sequence_length = 4  (model)"), std::string::npos) << dry.out;
  EXPECT_NE(dry.out.find("run.batch_size = 8  (command line)"), std::string::npos) << dry.out;
}

TEST(Tdmpc, RunsEqualOneAnotherToTheBit) {
  const Workplace place;
  for (const char* db : {"a.db", "b.db"}) {
    const ProgramResult result = place.Runner(Tiny("mppi,dreamer", db));
    ASSERT_EQ(result.exit_status, 0) << result.err;
  }
  const std::string digests = "SELECT result_digest FROM run WHERE status = 'finished' ORDER BY 1";
  const std::vector<std::string> found = place.Query("a.db", digests);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found, place.Query("b.db", digests));
  EXPECT_NE(found[0], found[1]);
}

// The values that the planner gave the decisions of the first episode it played.
std::vector<std::string> FirstPlannedValues(const Workplace& place, const std::string& db) {
  return place.Query(db, "SELECT value FROM step WHERE episode = 1 ORDER BY t");
}

TEST(Tdmpc, AnUpdateFollowsTheDecisionThatEarnedIt) {
  const Workplace place;
  std::vector<std::string> at_the_end = Tiny("mppi", "end.db");
  at_the_end.insert(at_the_end.end(), {"--set", "run.train_within_episode=false"});
  ASSERT_EQ(place.Runner(Tiny("mppi", "within.db")).exit_status, 0);
  ASSERT_EQ(place.Runner(at_the_end).exit_status, 0);
  const std::vector<std::string> within = FirstPlannedValues(place, "within.db");
  const std::vector<std::string> end = FirstPlannedValues(place, "end.db");
  ASSERT_EQ(within.size(), 500u);
  ASSERT_EQ(end.size(), 500u);
  // An update every 200 steps is one every 100 decisions: decision 100 is the first to see it.
  EXPECT_EQ(std::mismatch(within.begin(), within.end(), end.begin()).first - within.begin(), 100);
}

TEST(Tdmpc, InterruptedBetweenUpdatesOfAnEpisodeAndResumedGivesTheSameDigest) {
  const Workplace place;
  const auto arguments = [](const std::string& db) {
    std::vector<std::string> all = Tiny("mppi", db);
    const std::pair<const char*, const char*> changes[] = {
        {"run.train_every=200", "run.train_every=2"},
        {"run.batch_size=8", "run.batch_size=64"},
        {"run.eval_every=1500", "run.eval_every=3000"}};
    for (const auto& [from, to] : changes) {
      std::replace(all.begin(), all.end(), std::string(from), std::string(to));
    }
    return all;
  };
  const std::string digest = "SELECT result_digest FROM run WHERE status = 'finished'";
  ASSERT_EQ(place.Runner(arguments("whole.db")).exit_status, 0);
  // Until a stop falls into an episode that learns; rows show up at its end or after a second.
  int stopped = 0;
  for (int attempt = 0; attempt < 20 && stopped % 1000 == 0; ++attempt) {
    const pid_t pid = place.Start(arguments("parts.db"));
    place.WaitForStep("parts.db", std::max(stopped + 1, 1000));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ::kill(pid, SIGINT);
    ASSERT_EQ(place.Wait(pid).exit_status, 75) << "finished before a stop fell into an episode";
    stopped = std::stoi(place.Value("parts.db", "SELECT max(to_env_step) FROM segment"));
  }
  EXPECT_GT(stopped, 1000);
  ASSERT_EQ(place.Runner({"resume", "--db", "parts.db"}).exit_status, 0);
  EXPECT_EQ(place.Value("parts.db", digest), place.Value("whole.db", digest));
}

}  // namespace
}  // namespace dreamsearch
