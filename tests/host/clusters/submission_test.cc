// The record of a submitted sweep, and configuration files that are exactly one run.
#include "host/clusters/submission.h"

#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "host/flags/run_flags.h"
#include "host/plugins/catalogue.h"
#include "host/settings/settings.h"
#include "results/system/temporary_folder.h"
#include "tests/host/refusal.h"

namespace dreamsearch {
namespace {

const Catalogue& TestCatalogue() {
  static const Catalogue catalogue = [] {
    ScanOptions patient;
    patient.timeout = std::chrono::seconds(60);
    return Catalogue::Scan({DREAMSEARCH_SETTINGS_PLUGIN_DIR}, patient);
  }();
  return catalogue;
}

class SubmissionTest : public testing::Test {
 protected:
  // Every run of a command line, by way of its configuration file, is itself again.
  void ExpectEachRunIsItsConfiguration(const Words& words) {
    RunOptions options;
    ReadCommandLine(RunFlags(&options), words);
    std::set<std::string> ids;
    for (const RunSpec& spec : ResolveMatrix(options, TestCatalogue())) {
      const std::string text = ConfigurationText(spec);
      std::ofstream(folder_ / "run.cfg") << text;
      RunOptions read;
      ReadCommandLine(RunFlags(&read), {"--config", folder_ / "run.cfg"});
      const std::vector<RunSpec> runs = ResolveMatrix(read, TestCatalogue());
      ASSERT_EQ(runs.size(), 1u) << text;
      EXPECT_EQ(CanonicalJson(runs[0]), CanonicalJson(spec)) << text;
      EXPECT_EQ(RunFileName(runs[0]), RunFileName(spec)) << text;
      EXPECT_EQ(runs[0].preset, spec.preset);
      EXPECT_TRUE(ids.insert(RunFileName(spec)).second) << "two runs, one file: " << text;
    }
  }

  const TemporaryFolder folder_;
};

TEST_F(SubmissionTest, AConfigurationFileIsExactlyOneRun) {
  // What one planner declares and the other does not, and what both do.
  ExpectEachRunIsItsConfiguration({"--env",       "walker_walk,cup_catch",
                                   "--planner",   "mcts_pw,dreamer",
                                   "--model",     "dreamer",
                                   "--seed-list", "3,9",
                                   "--study",     "first look",
                                   "--preset",    "paper",
                                   "--steps",     "4000",
                                   "--set",       "mcts_pw.simulations=7",
                                   "--set",       "planner.noise=0.123456789012345678",
                                   "--set",       "env.sparse=true",
                                   "--set",       "model.starts=99",
                                   "--set",       "run.batch_size=12",
                                   "--set",       "planner/dreamer.noise_on=sample"});
}

TEST_F(SubmissionTest, AnEvaluationPlannerKeepsItsOwnSettings) {
  ExpectEachRunIsItsConfiguration({"--env", "walker_walk", "--planner", "dreamer,mcts_pw",
                                   "--model", "dreamer", "--eval-planner", "mcts_pw", "--set",
                                   "mcts_pw.simulations=9", "--set", "planner/dreamer.noise=0.25"});
}

TEST_F(SubmissionTest, OneOfManyTasksOfAnEnvironmentIsNamedWhole) {
  ExpectEachRunIsItsConfiguration(
      {"--env", "bridge:a,bridge:b/c:d", "--planner", "cem", "--model", "another", "--seeds", "2"});
}

TEST_F(SubmissionTest, ARunOfAnotherStudySeedOrSettingHasOtherFiles) {
  const auto id = [](const Words& more) {
    Words words = {"--env", "walker_walk", "--planner", "mcts_pw", "--model", "dreamer"};
    words.insert(words.end(), more.begin(), more.end());
    RunOptions options;
    ReadCommandLine(RunFlags(&options), words);
    return RunFileName(ResolveMatrix(options, TestCatalogue()).at(0));
  };
  EXPECT_EQ(id({}), id({"--seeds", "1"}));
  EXPECT_EQ(id({}).size(), 16u);
  const std::set<std::string> ids = {id({}), id({"--seed-list", "1"}), id({"--study", "other"}),
                                     id({"--set", "mcts_pw.simulations=3"}),
                                     id({"--steps", "4000"})};
  EXPECT_EQ(ids.size(), 5u);
}

TEST_F(SubmissionTest, TheRecordComesBackWhole) {
  EXPECT_FALSE(HasSubmission(folder_.path()));
  EXPECT_TRUE(ReadSubmission(folder_.path()).runs.empty());
  Submission record;
  record.instruction_set = "avx2";
  *record.Run("0123456789abcdef") = {"0123456789abcdef", "walker_walk mcts_pw seed 0", 4000, "7_0"};
  record.Run("0123456789abcdef")->job = "12_3";
  record.arrays = {"7", "12"};
  record.merge_job = "13";
  WriteSubmission(folder_.path(), record);
  EXPECT_TRUE(HasSubmission(folder_.path()));
  const Submission read = ReadSubmission(folder_.path());
  EXPECT_EQ(read.instruction_set, "avx2");
  ASSERT_EQ(read.runs.size(), 1u);
  EXPECT_EQ(read.runs[0].label, "walker_walk mcts_pw seed 0");
  EXPECT_EQ(read.runs[0].steps, 4000u);
  EXPECT_EQ(read.runs[0].job, "12_3");
  EXPECT_EQ(read.Jobs(), (std::vector<std::string>{"7", "12", "13"}));
}

TEST_F(SubmissionTest, ARecordThatIsNotOursIsRefused) {
  for (const char* text : {"", "{}", "[1, 2]", "{\"runs\": 3}"}) {
    std::ofstream(folder_ / "submission.json") << text;
    ExpectRefusal([&] { ReadSubmission(folder_.path()); }, ExitCode::kBadInput,
                  {folder_ / "submission.json", "not what `runner submit` writes"});
  }
}

}  // namespace
}  // namespace dreamsearch
