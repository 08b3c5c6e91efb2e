// The texts of batch scripts. The scripts themselves run in tests/integration/slurm.
#include "host/clusters/batch_script.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "results/system/error.h"
#include "results/system/temporary_folder.h"
#include "tests/host/refusal.h"

namespace dreamsearch {
namespace {

BatchPlace PlaceIn(const std::string& folder) {
  return {.folder = folder,
          .working = "/home/me",
          .runner = "/opt/bin/runner",
          .results = "/opt/bin/results",
          .instruction_set = "avx2"};
}

bool Has(const std::string& script, const std::string& text) {
  return script.find(text) != std::string::npos;
}

int SyntaxOf(const std::string& script) {
  const TemporaryFolder folder;
  std::ofstream(folder / "script.sh") << script;
  return std::system(("bash -n '" + (folder / "script.sh") + "'").c_str());
}

TEST(BatchScript, AsksSlurmForWhatWasAllocated) {
  const std::string script = ArrayScript(PlaceIn("/data/sweep"),
                                         {.partition = "cpu",
                                          .account = "lab",
                                          .time_seconds = 26 * 3600 + 90,
                                          .memory_bytes = (4ull << 30) + 1,
                                          .cores = 3,
                                          .extra_lines = {"#SBATCH --qos=long"}},
                                         {{"a"}, {"b"}, {"c"}}, {"--jobs", "1"}, false);
  for (const char* line :
       {"#!/bin/bash\n", "\n#SBATCH --partition=cpu\n", "\n#SBATCH --account=lab\n",
        "\n#SBATCH --time=1-02:01:30\n", "\n#SBATCH --mem=4097M\n", "\n#SBATCH --cpus-per-task=3\n",
        "\n#SBATCH --qos=long\n", "\n#SBATCH --array=0-2\n", "\n#SBATCH --requeue\n",
        "\n#SBATCH --signal=B:USR1@120\n", "\n#SBATCH --open-mode=append\n",
        "\n#SBATCH --chdir=\"/home/me\"\n", "\n#SBATCH --output=\"/data/sweep/logs/%A_%a.log\"\n",
        "\nexport DREAMSEARCH_INSTRUCTION_SET=avx2\n", "\nflags=(--jobs 1)\n"}) {
    EXPECT_TRUE(Has(script, line)) << line << script;
  }
  // Slurm reads its lines up to the first command.
  EXPECT_LT(script.rfind("#SBATCH"), script.find("export "));
  EXPECT_EQ(SyntaxOf(script), 0) << script;
}

TEST(BatchScript, SaysNothingThatWasNotAsked) {
  const std::string script = ArrayScript(PlaceIn("/data/sweep"), {}, {{"a"}}, {}, false);
  for (const char* option : {"--partition", "--account", "--time", "--mem", "--retry"}) {
    EXPECT_FALSE(Has(script, option)) << option;
  }
}

TEST(BatchScript, EachTaskHasItsRunsInOrder) {
  const std::string script = ArrayScript(PlaceIn("/d"), {}, {{"a", "b"}, {"c"}}, {}, false);
  EXPECT_TRUE(Has(script, "tasks=(\n  \"a b\"\n  \"c\"\n)\n")) << script;
  EXPECT_TRUE(Has(script, "#SBATCH --array=0-1\n"));
}

TEST(BatchScript, ARequeuedTaskDoesNotRetryWhatFailedInIt) {
  const std::string script = ArrayScript(PlaceIn("/d"), {}, {{"a"}}, {}, true);
  EXPECT_TRUE(Has(script, "if ((${SLURM_RESTART_COUNT:-0} == 0)); then flags+=(--retry); fi\n"));
}

TEST(BatchScript, AFolderWithSpacesAndPercentSignsIsNamedWhole) {
  const std::string script = ArrayScript(PlaceIn("/my data/100%"), {}, {{"a"}}, {}, false);
  EXPECT_TRUE(Has(script, "#SBATCH --output=\"/my data/100%%/logs/%A_%a.log\"\n")) << script;
  EXPECT_TRUE(Has(script, "\nfolder='/my data/100%'\n")) << script;
  EXPECT_EQ(SyntaxOf(script), 0);
}

TEST(BatchScript, AFolderThatSlurmCannotNameIsRefused) {
  for (const char* folder : {"/a\"b", "/a\\b", "/a\nb", "/it's"}) {
    ExpectRefusal([&] { ArrayScript(PlaceIn(folder), {}, {{"a"}}, {}, false); }, ExitCode::kUsage,
                  {"a folder that a line of #SBATCH can name"});
  }
}

TEST(BatchScript, TheMergeBeginsWhenAllArraysHaveEndedHoweverTheyDid) {
  const Allocation allocation = {.time_seconds = 86400, .cores = 16};
  const std::string script = MergeScript(PlaceIn("/d"), allocation, {"12", "13"});
  EXPECT_TRUE(Has(script, "\n#SBATCH --dependency=afterany:12:13\n")) << script;
  EXPECT_TRUE(Has(script, "\n#SBATCH --cpus-per-task=1\n"));
  EXPECT_TRUE(Has(script, "\n#SBATCH --time=0-01:00:00\n"));
  EXPECT_FALSE(Has(script, "--array"));
  EXPECT_EQ(SyntaxOf(script), 0) << script;
  EXPECT_FALSE(Has(MergeScript(PlaceIn("/d"), {}, {}), "--dependency"));
}

class ExtraLinesTest : public testing::Test {
 protected:
  std::string Write(const std::string& text) {
    std::ofstream(path_) << text;
    return path_;
  }
  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "extra";
};

TEST_F(ExtraLinesTest, AreTakenAsTheyAre) {
  EXPECT_EQ(ExtraLines(Write("#SBATCH --qos=long\n\n#SBATCH --gres=gpu:1\r\n")),
            (std::vector<std::string>{"#SBATCH --qos=long", "#SBATCH --gres=gpu:1"}));
}

TEST_F(ExtraLinesTest, OtherLinesAreRefusedWithTheirNumber) {
  for (const char* text : {"#SBATCH --qos=long\nmodule load gcc\n", "\n# a comment\n",
                           "\n#SBATCH --array=0-9\n", "\n#SBATCH -d afterok:1\n"}) {
    ExpectRefusal([&] { ExtraLines(Write(text)); }, ExitCode::kBadInput, {path_ + ", line 2"});
  }
}

}  // namespace
}  // namespace dreamsearch
