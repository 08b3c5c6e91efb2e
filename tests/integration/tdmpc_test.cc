// The second learned model through the programs: what it asks of the runner, and runs with it.
#include <gtest/gtest.h>

#include <string>

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
  EXPECT_NE(described.out.find("run.batch_size        fast=256, paper=256"), std::string::npos)
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

}  // namespace
}  // namespace dreamsearch
