// runner verify: a run again, from what the database and its folder hold.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

class VerifyTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    const ProgramResult trained = place_->Runner(TinyRun("cartpole_balance", "mcts_pw", "v.db"));
    ASSERT_EQ(trained.exit_status, 0) << trained.err;
    const ProgramResult evaluated =
        place_->Runner({"eval", "1", "--planner", "mcts_pw", "--model", "oracle", "--db", "v.db"});
    ASSERT_EQ(evaluated.exit_status, 0) << evaluated.err;
  }
  static void TearDownTestSuite() { delete place_; }

  // A copy of the database and its files.
  static std::string Copy(const std::string& name) {
    std::filesystem::copy(place_->Path("v.db"), place_->Path(name));
    std::filesystem::copy(place_->Path("v.db.files"), place_->Path(name + ".files"),
                          std::filesystem::copy_options::recursive);
    return place_->Path(name);
  }

  static Workplace* place_;
};
Workplace* VerifyTest::place_ = nullptr;

TEST_F(VerifyTest, ATrainingAndAnEvaluationAreEqualWhenRepeated) {
  for (const char* run : {"1", "2"}) {
    const ProgramResult result = place_->Runner({"verify", run, "--db", "v.db"});
    EXPECT_EQ(result.exit_status, 0) << result.err << result.out;
    EXPECT_EQ(result.out.rfind("equal: run ", 0), 0u) << result.out;
    EXPECT_NE(result.out.find(place_->Value(
                  "v.db", std::string("select result_digest from run where run_id = ") + run)),
              std::string::npos)
        << result.out;
  }
}

TEST_F(VerifyTest, NamesTheFirstDecisionThatDiffers) {
  const std::string copy = Copy("other_seed");
  // The same rows, as if they had come from another seed.
  const std::string path = copy + ".files/" +
                           place_->Value("v.db",
                                         "select uuid from run where "
                                         "run_id = 1") +
                           "/run.json";
  nlohmann::json spec;
  std::ifstream(path) >> spec;
  spec["seed"] = 5;
  std::ofstream(path) << spec;
  const ProgramResult result = place_->Runner({"verify", "1", "--db", copy});
  EXPECT_EQ(result.exit_status, 78) << result.err;
  EXPECT_NE(result.out.find("first differing decision (env_step 2, episode 0, t 0): "),
            std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("first differing episode (env_step 0, "), std::string::npos)
      << result.out;
}

TEST_F(VerifyTest, StoredEpisodesWithoutTheirDigestAreNotRepeated) {
  const std::string copy = Copy("touched");
  place_->Value("touched",
                "update episode set episode_return = episode_return + 1 where run_id = "
                "1 and phase = 0 and episode = 2");
  const ProgramResult result = place_->Runner({"verify", "1", "--db", copy});
  EXPECT_EQ(result.exit_status, 78) << result.err;
  EXPECT_NE(result.out.find("do not have its stored digest"), std::string::npos) << result.out;
}

TEST_F(VerifyTest, RefusesWhatIsNotFinished) {
  std::vector<std::string> arguments = TinyRun("cartpole_balance", "dreamer", "u.db");
  arguments.insert(arguments.end(), {"--time-limit", "0.001"});
  EXPECT_EQ(place_->Runner(arguments).exit_status, 75);
  const ProgramResult result = place_->Runner({"verify", "1", "--db", "u.db"});
  EXPECT_EQ(result.exit_status, 2) << result.err;
  EXPECT_NE(result.err.find("expected a finished run"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace dreamsearch
