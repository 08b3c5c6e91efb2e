// The command lines of `runner` and `runner eval`, and the configuration file.
#include "host/flags/run_flags.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "results/command_line/help.h"
#include "results/system/error.h"
#include "tests/host/refusal.h"

namespace dreamsearch {
namespace {

RunOptions ParseOptions(const Words& words) {
  RunOptions options;
  ReadCommandLine(RunFlags(&options), words);
  return options;
}

EvaluationOptions ParseEvaluation(const Words& words) {
  EvaluationOptions evaluation;
  ReadCommandLine(EvaluationFlags(&evaluation), words);
  CompleteEvaluation(&evaluation);
  return evaluation;
}

RunOptions Parse(Words more) {
  Words words = {"--env", "walker_walk", "--planner", "mcts_pw"};
  words.insert(words.end(), more.begin(), more.end());
  return ParseOptions(words);
}

void ExpectUsage(const Words& more, const std::vector<std::string>& parts) {
  ExpectRefusal([&] { Parse(more); }, ExitCode::kUsage, parts);
}

class ConfigurationFile : public testing::Test {
 protected:
  std::string Write(const std::string& text) {
    std::ofstream(path_, std::ios::binary) << text;
    return path_;
  }
  void ExpectBad(const std::string& text, const std::vector<std::string>& parts) {
    Write(text);
    std::vector<std::string> all = parts;
    all.push_back(path_);
    ExpectRefusal([&] { ParseOptions({"--config", path_}); }, ExitCode::kBadInput, all);
  }
  void TearDown() override { std::remove(path_.c_str()); }

  const std::string path_ = (std::filesystem::temp_directory_path() /
                             ("dreamsearch-options-" + std::to_string(::getpid()) + ".cfg"))
                                .string();
};

TEST(ParseOptions, FillsInTheDefaultsOfTheContract) {
  const RunOptions options = Parse({});
  EXPECT_EQ(options.environments, Words{"walker_walk"});
  EXPECT_EQ(options.planners, Words{"mcts_pw"});
  EXPECT_EQ(options.models, Words{});
  EXPECT_EQ(options.eval_planner, "");
  EXPECT_EQ(options.seeds, std::vector<std::uint64_t>{0});
  EXPECT_EQ(options.study, "default");
  EXPECT_EQ(options.preset, "fast");
  EXPECT_TRUE(options.settings.empty());
  EXPECT_EQ(options.process.db, "results/dreamsearch.db");
  EXPECT_EQ(options.process.jobs, 0);  // what the cores and the memory allow
  EXPECT_EQ(options.process.memory_limit_bytes, kShareOfMemory);
  EXPECT_EQ(options.process.nice, 0);
  EXPECT_EQ(options.process.hang_timeout_seconds, 60);
  EXPECT_EQ(options.process.time_limit_seconds, 0);
  EXPECT_FALSE(options.process.retry || options.process.replace || options.process.dry_run);
}

TEST(ParseOptions, ReadsEveryFlag) {
  const RunOptions options = ParseOptions({"--env",
                                           "a,b",
                                           "--planner=c,d",
                                           "--model",
                                           "e",
                                           "--eval-planner",
                                           "f",
                                           "--seeds",
                                           "3",
                                           "--study",
                                           "it's",
                                           "--preset",
                                           "paper",
                                           "--steps",
                                           "12000",
                                           "--set",
                                           "planner.k=1",
                                           "--set",
                                           "run.j = 2",
                                           "--db",
                                           "x.db",
                                           "--plugin-path",
                                           "p",
                                           "--plugin-path",
                                           "q",
                                           "--jobs",
                                           "4",
                                           "--time-limit",
                                           "1.5h",
                                           "--memory-limit",
                                           "4G",
                                           "--hang-timeout",
                                           "90",
                                           "--retry",
                                           "--replace",
                                           "--log-decisions",
                                           "--record-trees",
                                           "--dry-run"});
  EXPECT_EQ(options.environments, (Words{"a", "b"}));
  EXPECT_EQ(options.planners, (Words{"c", "d"}));
  EXPECT_EQ(options.models, Words{"e"});
  EXPECT_EQ(options.eval_planner, "f");
  EXPECT_EQ(options.seeds, (std::vector<std::uint64_t>{0, 1, 2}));
  EXPECT_EQ(options.study, "it's");
  EXPECT_EQ(options.preset, "paper");
  ASSERT_EQ(options.settings.size(), 3u);
  EXPECT_EQ(options.settings[0].key, "run.steps");
  EXPECT_EQ(options.settings[0].value, "12000");
  EXPECT_EQ(options.settings[2].key, "run.j");
  EXPECT_EQ(options.settings[2].value, "2");
  EXPECT_EQ(options.process.db, "x.db");
  EXPECT_EQ(options.process.plugin_path, (Words{"p", "q"}));
  EXPECT_EQ(options.process.jobs, 4);
  EXPECT_EQ(options.process.time_limit_seconds, 5400);
  EXPECT_EQ(options.process.memory_limit_bytes, 4ull << 30);
  EXPECT_EQ(options.process.hang_timeout_seconds, 90);
  EXPECT_TRUE(options.process.retry && options.process.replace && options.process.log_decisions &&
              options.process.record_trees && options.process.dry_run);
}

TEST(ParseOptions, WantsATaskAndAPlanner) {
  ExpectRefusal([] { ParseOptions({"--planner", "cem"}); }, ExitCode::kUsage, {"--env"});
  ExpectRefusal([] { ParseOptions({"--env", "cup_catch"}); }, ExitCode::kUsage, {"--planner"});
}

TEST(ParseOptions, NamesTheNearestFlag) {
  ExpectUsage({"--sedes", "3"}, {"no flag '--sedes'", "Did you mean --seeds?"});
  ExpectUsage({"--pre", "fast"}, {"no flag '--pre'"});  // an abbreviation is no flag
  ExpectUsage({"--planner.depth=3"}, {"no flag '--planner.depth'", "--set planner.depth=VALUE"});
  ExpectUsage({"resumee"}, {"did not expect the argument 'resumee'"});
  ExpectUsage({"-x"}, {"no flag '-x'"});
}

TEST(ParseOptions, RefusesMissingDoubleAndSurplusValues) {
  ExpectUsage({"--seeds"}, {"--seeds: expected a value, found none"});
  ExpectUsage({"--preset", "fast", "--preset", "paper"}, {"--preset", "given twice"});
  ExpectUsage({"--retry=perhaps"}, {"--retry: expected no value"});
  ExpectUsage({"--study="}, {"--study: expected a value, found none"});
  ExpectUsage({"--study", ""}, {"--study: expected a name, found nothing"});
}

TEST(ParseOptions, RefusesSeedsThatAreNone) {
  for (const char* bad : {"0", "-1", "abc", "1.5", "", "18446744073709551616", "3 ", "0x3"}) {
    ExpectUsage({std::string("--seeds=") + bad}, {"--seeds"});
  }
  for (const char* bad :
       {"-1", "abc", "1,,2", "3,3", "9223372036854775808", "18446744073709551616", "1,"}) {
    ExpectUsage({"--seed-list", bad}, {"--seed-list", "expected"});
  }
  ExpectUsage({"--seeds", "-1"}, {"--seeds", "found '-1'"});
  ExpectUsage({"--seeds", "2", "--seed-list", "1"}, {"found both"});
  EXPECT_EQ(Parse({"--seed-list", "7,3,9223372036854775807"}).seeds,
            (std::vector<std::uint64_t>{7, 3, 9223372036854775807ull}));
}

TEST(ParseOptions, RefusesLimitsThatAreNone) {
  ExpectUsage({"--jobs", "-1"}, {"--jobs", "from 0"});
  ExpectUsage({"--time-limit", "soon"}, {"--time-limit", "duration", "found 'soon'"});
  ExpectUsage({"--time-limit", "-5"}, {"--time-limit"});
  ExpectUsage({"--time-limit", "nan"}, {"--time-limit"});
  ExpectUsage({"--memory-limit", "4X"}, {"--memory-limit", "size"});
  ExpectUsage({"--memory-limit", "1e30"}, {"--memory-limit"});
  ExpectUsage({"--env", "a,,b"}, {"--env"});
  ExpectUsage({"--set", "planner"}, {"key=value"});
  ExpectUsage({"--set", "=3"}, {"key=value"});
  ExpectUsage({"--study", "bad \xff"}, {"UTF-8"});
}

TEST_F(ConfigurationFile, IsReadAndTheCommandLineWins) {
  Write(
      "# a study\nenv = a,b   # two\nplanner = cem\nseeds = 5\nsteps = 400\nretry = true\n"
      "set = planner.k=1\nset = run.j=2\nplugin-path = from_file\n");
  const RunOptions options = ParseOptions({"--config", path_, "--planner", "rollout", "--seed-list",
                                           "9", "--set", "planner.k=3", "--plugin-path", "given"});
  EXPECT_EQ(options.environments, (Words{"a", "b"}));
  EXPECT_EQ(options.planners, Words{"rollout"});
  EXPECT_EQ(options.seeds, std::vector<std::uint64_t>{9});
  EXPECT_TRUE(options.process.retry);
  EXPECT_EQ(options.process.plugin_path, (Words{"given", "from_file"}));
  ASSERT_EQ(options.settings.size(), 4u);
  EXPECT_EQ(options.settings[0].key, "run.steps");
  EXPECT_TRUE(options.settings[0].from_file);
  EXPECT_EQ(options.settings[1].where, path_ + ", line 7");
  EXPECT_EQ(options.settings[3].value, "3");
  EXPECT_FALSE(options.settings[3].from_file);
}

TEST_F(ConfigurationFile, MayHaveAByteOrderMarkAndCarriageReturns) {
  Write("\xef\xbb\xbf# first\r\n\r\nenv = a\r\nplanner = cem\r\nset = planner.k=1\r\n");
  const RunOptions options = ParseOptions({"--config", path_});
  EXPECT_EQ(options.environments, Words{"a"});
  EXPECT_EQ(options.planners, Words{"cem"});
  ASSERT_EQ(options.settings.size(), 1u);
  EXPECT_EQ(options.settings[0].value, "1");
  EXPECT_EQ(options.settings[0].where, path_ + ", line 5");
  ExpectBad("\xef\xbb\xbf\r\n\r\nplaner = cem\r\n", {"line 3", "Did you mean planner?"});
}

TEST_F(ConfigurationFile, SaysLineAndNearestNameOfAMistake) {
  ExpectBad("env = a\n\nsedes = 3\n", {"line 3", "no flag 'sedes'", "Did you mean seeds?"});
  ExpectBad("env = a\nenv = b\n", {"line 2: env is given twice", "line 1"});
  ExpectBad("seeds = 3\nseed-list = 1\n", {"line 2", "found both", "line 1"});
  ExpectBad("env\n", {"line 1", "expected name = value"});
  ExpectBad("env =\n", {"line 1: env", "expected a value, found none"});
  ExpectBad("seeds = -1\n", {"line 1", "found '-1'"});
  ExpectBad("retry = perhaps\n", {"line 1", "retry"});
  ExpectBad("[planner]\nk = 1\n", {"line 1", "expected name = value"});
  ExpectBad("[a=b]\n", {"line 1", "expected name = value"});
  ExpectBad("set = k\n", {"line 1", "key=value"});
  ExpectBad("config = other.cfg\n", {"line 1", "command line only"});
  ExpectBad(std::string("env = a\0b\n", 10), {"line 1", "control character"});
  ExpectBad("env = " + std::string(2 << 20, 'x') + "\n", {"larger than 1 MB"});
}

// What the command line hides is checked all the same.
TEST_F(ConfigurationFile, IsCheckedWhole) {
  Write("jobs = many\n");
  ExpectRefusal(
      [&] {
        Parse({"--config", path_, "--jobs", "2"});
      },
      ExitCode::kBadInput, {"line 1", "jobs"});
}

TEST_F(ConfigurationFile, MustExistAndBeAFile) {
  ExpectRefusal(
      [&] {
        Parse({"--config", path_ + ".nowhere"});
      },
      ExitCode::kNotFound, {".nowhere"});
  ExpectRefusal([&] { Parse({"--config", "/"}); }, ExitCode::kBadInput, {"folder"});
}

TEST(EvaluationOptions, ADefaultDependsOnWhetherThereIsATrainedRun) {
  const EvaluationOptions with = ParseEvaluation({"3", "--planner", "cem"});
  EXPECT_EQ(with.run, "3");
  EXPECT_TRUE(with.choice.evaluate);
  EXPECT_EQ(with.choice.preset, "");
  EXPECT_EQ(with.choice.models, Words{});
  const EvaluationOptions without =
      ParseEvaluation({"--planner", "cem", "--env", "a", "--episodes", "7"});
  EXPECT_EQ(without.run, "");
  EXPECT_EQ(without.choice.preset, "fast");
  EXPECT_EQ(without.choice.study, "default");
  EXPECT_EQ(without.choice.models, Words{});
  EXPECT_EQ(without.choice.seeds, std::vector<std::uint64_t>{0});
  ASSERT_EQ(without.choice.settings.size(), 1u);
  EXPECT_EQ(without.choice.settings[0].key, "run.eval_episodes");
  EXPECT_EQ(without.choice.settings[0].where, "runner eval: --episodes");
}

TEST(EvaluationOptions, RefusesWhatBelongsToTheTraining) {
  const auto expect = [](const Words& words, const std::vector<std::string>& parts) {
    ExpectRefusal([&] { ParseEvaluation(words); }, ExitCode::kUsage, parts);
  };
  expect({}, {"--planner NAMES"});
  expect({"--planner", "cem"}, {"RUN or --env NAMES", "found neither"});
  expect({"3", "--planner", "cem", "--env", "a"}, {"RUN or --env, found both"});
  expect({"3", "--planner", "cem", "--seed-list", "4"}, {"RUN or --seeds, found both"});
  expect({"3", "--planner", "cem", "--study", "s"}, {"RUN or --study, found both"});
  expect({"3", "4", "--planner", "cem"}, {"did not expect the argument '4'"});
  expect({"3", "--planner", "cem", "--set", "run.batch_size=3"}, {"keeps its settings"});
  expect({"--env", "a", "--planner", "cem", "--set", "run.batch_size=3"}, {"nothing is trained"});
}

TEST(RunnerHelp, NamesEveryFlagOfTheContract) {
  RunOptions options;
  const std::string help = HelpText(RunFlags(&options));
  for (const char* flag :
       {"--env",          "--planner",      "--model",       "--eval-planner", "--seeds",
        "--seed-list",    "--study",        "--preset",      "--steps",        "--set",
        "--config",       "--db",           "--plugin-path", "--jobs",         "--time-limit",
        "--memory-limit", "--hang-timeout", "--retry",       "--replace",      "--log-decisions",
        "--record-trees", "--dry-run",      "--help",        "--version",      "--scratch",
        "--nice"}) {
    EXPECT_NE(help.find(flag), std::string::npos) << flag;
  }
}

}  // namespace
}  // namespace dreamsearch
