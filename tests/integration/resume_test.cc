// Going on with unfinished runs: what is kept, what is refused, what starts over.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "dreamsearch/instruction_set.h"
#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

// Runs of a second: an environment and a model of the plugin `faulty`, and a copy of
// planner_random that a test may change.
class ResumeTest : public testing::Test {
 protected:
  ResumeTest() {
    std::filesystem::create_directory(place_.folder() / "plugins");
    const std::filesystem::path built =
        std::filesystem::path(DREAMSEARCH_TEST_BIN_DIR).parent_path() / "lib/dreamsearch/plugins";
    for (const auto& entry : std::filesystem::directory_iterator(built)) {
      if (entry.path().stem().string().find("planner_random") == std::string::npos) continue;
      plugin_ = place_.folder() / "plugins" / entry.path().filename();
      std::filesystem::copy(entry.path(), plugin_);
    }
  }

  ProgramResult Run(const std::string& planner, const std::string& eval_planner,
                    const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"--env",         "good_environment",
                                          "--model",       "idle_model",
                                          "--planner",     planner,
                                          "--steps",       "100",
                                          "--db",          "r.db",
                                          "--plugin-path", place_.Path("plugins"),
                                          "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR};
    if (!eval_planner.empty()) arguments.insert(arguments.end(), {"--eval-planner", eval_planner});
    for (const char* setting : {"run.action_repeat=1", "run.prefill_steps=20",
                                "run.sequence_length=4", "run.eval_episodes=1"}) {
      arguments.insert(arguments.end(), {"--set", setting});
    }
    arguments.insert(arguments.end(), more.begin(), more.end());
    return place_.Runner(arguments);
  }

  ProgramResult Resume(const std::string& what) const {
    return place_.Runner({"resume", what, "--db", "r.db", "--plugin-path", place_.Path("plugins"),
                          "--plugin-path", DREAMSEARCH_FAULTY_PLUGIN_DIR});
  }

  // Every run as if its process had died before its first checkpoint.
  void Unfinish() const {
    place_.Query("r.db", "update run set status = 'queued', exit_code = null, env_steps_done = 0");
    place_.Query("r.db", "delete from artifact");
    for (const std::filesystem::path& path : Files(".ckpt")) std::filesystem::remove(path);
  }
  // As if it had been stopped after its last checkpoint.
  void Interrupt() const {
    place_.Query("r.db", "update run set status = 'interrupted', exit_code = 75");
  }
  void ChangePlugin() const { std::ofstream(plugin_, std::ios::app) << "changed"; }
  std::vector<std::filesystem::path> Files(const std::string& extension) const {
    std::vector<std::filesystem::path> found;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(place_.folder() / "r.db.files")) {
      if (entry.path().extension() == extension) found.push_back(entry.path());
    }
    return found;
  }
  std::string Value(const std::string& sql) const { return place_.Value("r.db", sql); }

  Workplace place_;
  std::filesystem::path plugin_;
};

TEST_F(ResumeTest, ARunWithoutItsSettingsGetsThemFromTheSameCommand) {
  ASSERT_EQ(Run("random", "").exit_status, 0);
  Unfinish();
  const std::filesystem::path file = Files(".json").at(0);
  std::filesystem::remove(file);
  const ProgramResult alone = Resume("1");
  EXPECT_EQ(alone.exit_status, 66) << alone.err;
  EXPECT_NE(alone.err.find(file.string()), std::string::npos) << alone.err;
  ASSERT_EQ(Run("random", "").exit_status, 0);
  EXPECT_TRUE(std::filesystem::exists(file));
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".tmp"));
  Unfinish();
  const ProgramResult resumed = Resume("1");
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(Value("select status from run"), "finished");
}

TEST_F(ResumeTest, ACheckpointOfAnOlderRunnerIsRefusedWithASentenceAndNothingIsLost) {
  ASSERT_EQ(Run("random", "").exit_status, 0);
  Interrupt();
  for (const std::filesystem::path& path : Files(".ckpt")) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(7).put(1);  // the format
  }
  const std::string rows = "select count(*) from step";
  const std::string before = Value(rows);
  for (const ProgramResult& refused : {Resume("1"), Run("random", "")}) {
    EXPECT_EQ(refused.exit_status, 65) << refused.err;
    EXPECT_NE(refused.err.find(Files(".ckpt").at(0).string() +
                               " is a checkpoint of format 1, of another runner"),
              std::string::npos)
        << refused.err;
    EXPECT_NE(refused.err.find("--retry --replace"), std::string::npos) << refused.err;
  }
  EXPECT_EQ(Value(rows), before);
  EXPECT_EQ(Run("random", "", {"--retry", "--replace"}).exit_status, 0);
  EXPECT_EQ(Value("select status from run"), "finished");
}

TEST_F(ResumeTest, ACheckpointOfALowerInstructionSetIsResumedUnderIt) {
  if (BestInstructionSet() == InstructionSet::kBaseline) GTEST_SKIP() << "there is no lower one";
  const char* lowest = InstructionSetName(InstructionSet::kBaseline);
  ::setenv(kInstructionSetVariable, lowest, 1);
  ASSERT_EQ(Run("random", "").exit_status, 0);
  Interrupt();
  ::unsetenv(kInstructionSetVariable);
  const ProgramResult refused = Resume("1");
  EXPECT_EQ(refused.exit_status, 74) << refused.err;
  EXPECT_NE(refused.err.find("with DREAMSEARCH_INSTRUCTION_SET=x86-64 before it, or accept that "
                             "with `runner resume 1 --force --db "),
            std::string::npos)
      << refused.err;
  EXPECT_EQ(Value("select status from run"), "interrupted");
  ::setenv(kInstructionSetVariable, lowest, 1);
  const ProgramResult resumed = Resume("1");
  ::unsetenv(kInstructionSetVariable);
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(Value("select status from run"), "finished");
}

TEST_F(ResumeTest, WhatWasRecordedIsRecordedOn) {
  ASSERT_EQ(Run("random", "", {"--log-decisions", "--record-trees"}).exit_status, 0);
  const auto spec = [&] {
    nlohmann::json json;
    std::ifstream(Files(".json").at(0)) >> json;
    return json;
  };
  EXPECT_TRUE(spec()["log_decisions"].get<bool>() && spec()["record_trees"].get<bool>());
  // The same command without the flags.
  Unfinish();
  ASSERT_EQ(Run("random", "").exit_status, 0);
  EXPECT_TRUE(spec()["log_decisions"].get<bool>() && spec()["record_trees"].get<bool>());
}

TEST_F(ResumeTest, AChangedEvaluationPlannerIsRefusedAndReplaced) {
  ASSERT_EQ(Run("dreamer", "random").exit_status, 0);
  Unfinish();
  ChangePlugin();
  const ProgramResult refused = Run("dreamer", "random");
  EXPECT_EQ(refused.exit_status, 69) << refused.err;
  EXPECT_NE(refused.err.find("plugin planner_random changed"), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("--replace"), std::string::npos) << refused.err;
  EXPECT_EQ(Value("select status from run"), "queued");
  std::ofstream(Files(".json").at(0).parent_path() / "trees-7.trees") << "of before";
  const ProgramResult replaced = Run("dreamer", "random", {"--replace"});
  EXPECT_EQ(replaced.exit_status, 0) << replaced.err;
  EXPECT_NE(replaced.err.find("1 to start over"), std::string::npos) << replaced.err;
  EXPECT_EQ(Value("select status from run"), "finished");
  EXPECT_TRUE(Files(".trees").empty());
}

TEST_F(ResumeTest, ARunWithoutAWholeCheckpointIsReplaced) {
  ASSERT_EQ(Run("random", "").exit_status, 0);
  place_.Query("r.db", "update run set status = 'interrupted'");
  for (const std::filesystem::path& path : Files(".ckpt")) std::filesystem::resize_file(path, 20);
  const ProgramResult failed = Run("random", "");
  EXPECT_EQ(failed.exit_status, 65) << failed.err;
  EXPECT_NE(failed.err.find("--retry --replace"), std::string::npos) << failed.err;
  const ProgramResult replaced = Run("random", "", {"--retry", "--replace"});
  EXPECT_EQ(replaced.exit_status, 0) << replaced.err;
  EXPECT_NE(replaced.err.find("1 to start over"), std::string::npos) << replaced.err;
}

TEST_F(ResumeTest, ARefusedRunDoesNotKeepTheOthers) {
  ASSERT_EQ(Run("random,dreamer", "dreamer").exit_status, 0);
  const auto dreamer = [&] {
    return Value("select status from run where planner = 'dreamer'") + ", " +
           Value("select status from run where planner = 'random'");
  };
  Unfinish();
  ChangePlugin();
  const ProgramResult same = Run("random,dreamer", "dreamer");
  EXPECT_EQ(same.exit_status, 69) << same.err;
  EXPECT_NE(same.err.find("refused: good_environment random on idle_model seed 0: "),
            std::string::npos)
      << same.err;
  EXPECT_EQ(dreamer(), "finished, queued");

  // The plugin that it was begun with is in no folder. (Were it in one, it would be found there by
  // its digest.)
  Unfinish();
  const std::string uuid = Value("select uuid from run where planner = 'random'");
  const std::filesystem::path file = place_.folder() / "r.db.files" / uuid / "run.json";
  std::ifstream stored(file);
  std::string text((std::istreambuf_iterator<char>(stored)), std::istreambuf_iterator<char>());
  const std::string digest = Value("select sha256 from plugin where name = 'planner_random'");
  for (std::size_t at; (at = text.find(digest)) != std::string::npos;) {
    text.replace(at, digest.size(), std::string(digest.size(), '0'));
  }
  std::ofstream(file) << text;
  const ProgramResult all = Resume("all");
  EXPECT_EQ(all.exit_status, 69) << all.err;
  EXPECT_NE(all.err.find("refused: run 1 cannot resume, because something changed"),
            std::string::npos)
      << all.err;
  EXPECT_EQ(dreamer(), "finished, queued");
}

}  // namespace
}  // namespace dreamsearch
