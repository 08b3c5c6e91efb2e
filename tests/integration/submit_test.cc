// `runner submit` and `runner status --folder` with a Slurm that is played by shell scripts: jobs
// are numbered and kept, and a test says what of them is in the queue.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>

#include "tests/integration/program.h"

namespace dreamsearch {
namespace {

using Words = std::vector<std::string>;

class SubmitTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(place_.Path("slurm"));
    Program("sbatch",
            "n=$(($(cat $d/next 2>/dev/null || echo 100) + 1)); echo $n > $d/next\n"
            "cp \"$2\" $d/job.$n; echo $n\n");
    Program("squeue",
            "if [ -f $d/broken ]; then echo 'cannot connect' >&2; exit 1; fi\n"
            "cat $d/queue 2>/dev/null; exit 0\n");
    Program("scontrol", "cat $d/config 2>/dev/null; exit 0\n");
    ::setenv("PATH", (place_.Path("slurm") + ":" + path_).c_str(), 1);
  }
  void TearDown() override { ::setenv("PATH", path_.c_str(), 1); }

  void Program(const std::string& name, const std::string& text) {
    const std::string file = place_.Path("slurm/" + name);
    std::ofstream(file) << "#!/bin/sh\nd=" << place_.Path("slurm") << "\n" << text;
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  }
  void Write(const std::string& name, const std::string& text) {
    std::ofstream(place_.Path("slurm/" + name)) << text;
  }
  std::string Script(int job) const {
    std::ifstream file(place_.Path("slurm/job." + std::to_string(job)));
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  // The tasks of a job's script: the words of each.
  std::vector<std::string> Tasks(const std::string& script) const {
    std::vector<std::string> tasks;
    const std::size_t begin = script.find("tasks=(\n");
    const std::string list = script.substr(begin, script.find("\n)\n", begin) - begin);
    const std::regex task("\"([0-9a-f ]+)\"");
    for (std::sregex_iterator it(list.begin(), list.end(), task), end; it != end; ++it) {
      tasks.push_back((*it)[1]);
    }
    return tasks;
  }

  // A run of moments on the task and planner that need least.
  static Words Tiny(const std::string& command, const Words& more) {
    Words words = TinyRun("cartpole_balance", "random", "unused", more);
    words.erase(std::find(words.begin(), words.end(), "--db"),
                std::find(words.begin(), words.end(), "--db") + 2);
    if (!command.empty()) words.insert(words.begin(), command);
    return words;
  }
  ProgramResult Submit(const Words& more) const {
    Words words = {"--folder", "s w"};
    words.insert(words.end(), more.begin(), more.end());
    return place_.Runner(Tiny("submit", words));
  }
  // What a node would do.
  ProgramResult Do(const std::string& id) const {
    return place_.Runner({"--config", "s w/runs/" + id + ".cfg", "--db", "s w/runs/" + id + ".db"});
  }
  std::string Status() const { return place_.Runner({"status", "--folder", "s w"}).out; }
  static std::size_t Count(const std::string& text, const std::string& part) {
    std::size_t count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
      ++count;
    }
    return count;
  }

  const Workplace place_;
  const std::string path_ = std::getenv("PATH");
};

TEST_F(SubmitTest, MakesATaskOfEachRunAndAMergeJobThatWaitsForThem) {
  const ProgramResult result = Submit({"--seeds", "3", "--time", "4h"});
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(result.out, "101\n102\n");
  EXPECT_NE(result.err.find("3 runs: 3 submitted, 0 finished, 0 queued or active, 0 skipped\n"),
            std::string::npos)
      << result.err;
  EXPECT_EQ(Tasks(Script(101)).size(), 3u);
  EXPECT_NE(Script(101).find("#SBATCH --array=0-2\n"), std::string::npos);
  EXPECT_NE(Script(102).find("#SBATCH --dependency=afterany:101\n"), std::string::npos);
  for (const std::string& id : Tasks(Script(101))) {
    EXPECT_TRUE(std::filesystem::exists(place_.Path("s w/runs/" + id + ".cfg")));
  }
}

TEST_F(SubmitTest, ATaskStartsNoPluginToLearnWhatIsInIt) {
  ASSERT_EQ(Submit({}).exit_status, 0);
  const std::string script = Script(101);
  const std::string name = "export DREAMSEARCH_KNOWN_PLUGINS=\"$folder\"/plugins.json\n";
  ASSERT_NE(script.find(name), std::string::npos) << script;
  // What it says counts: with no planner in it there is none for unchanged files.
  const std::string file = place_.Path("s w/plugins.json");
  const std::string id = Tasks(script).at(0);
  ::setenv("DREAMSEARCH_KNOWN_PLUGINS", file.c_str(), 1);
  EXPECT_EQ(Do(id).exit_status, 0);
  std::ifstream stream(file);
  std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  const std::string named = "\"name\":\"random\"";
  ASSERT_NE(text.find(named), std::string::npos);
  std::ofstream(file) << text.replace(text.find(named), named.size(), "\"name\":\"rondam\"");
  const ProgramResult result = Do(id);
  ::unsetenv("DREAMSEARCH_KNOWN_PLUGINS");
  EXPECT_EQ(result.exit_status, 66) << result.err;
}

TEST_F(SubmitTest, ArraysStayBelowTheSitesLargest) {
  Write("config", "MaxArraySize            = 4\n");
  const ProgramResult result = Submit({"--seeds", "8", "--runs-per-task", "2"});
  EXPECT_EQ(result.out, "101\n102\n103\n") << result.err;
  EXPECT_EQ(Tasks(Script(101)).size(), 3u);
  EXPECT_EQ(Tasks(Script(102)).size(), 1u);
  EXPECT_EQ(Tasks(Script(102))[0].size(), 2 * 16u + 1);
  EXPECT_NE(Script(103).find("--dependency=afterany:101:102\n"), std::string::npos);
}

TEST_F(SubmitTest, TheSameCommandAgainSubmitsOnlyWhatNoJobHas) {
  Submit({"--seeds", "4"});
  const std::vector<std::string> ids = Tasks(Script(101));
  ASSERT_EQ(ids.size(), 4u);
  const ProgramResult run = Do(ids[0]);
  ASSERT_EQ(run.exit_status, 0) << run.err;
  Write("queue", "101|1|RUNNING|n1|None\n101|2|PENDING||Priority\n102|N/A|PENDING||Dependency\n");
  const ProgramResult again = Submit({"--seeds", "4"});
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_NE(again.err.find("4 runs: 1 submitted, 1 finished, 2 queued or active, 0 skipped"),
            std::string::npos)
      << again.err;
  EXPECT_EQ(Tasks(Script(103)), std::vector<std::string>{ids[3]});
  // The new merge is the last to write: it waits for the old array and merge too.
  EXPECT_NE(Script(104).find("--dependency=afterany:101:102:103\n"), std::string::npos)
      << Script(104);

  // A changed matrix adds to it.
  Write("queue", "101|1|RUNNING|n1|None\n101|2|PENDING||Priority\n103|0|PENDING||Priority\n");
  const ProgramResult more = Submit({"--seeds", "5"});
  EXPECT_NE(more.err.find("5 runs: 1 submitted, 1 finished, 3 queued or active"), std::string::npos)
      << more.err;
  const std::string status = Status();
  EXPECT_EQ(Count(status, "cartpole_balance random seed "), 5u) << status;
  EXPECT_EQ(Count(status, "  finished  "), 1u) << status;
  EXPECT_EQ(Count(status, "queued in Slurm"), 3u) << status;
  EXPECT_EQ(Count(status, "  missing  "), 1u) << status;  // of the job 105, not in the queue
}

TEST_F(SubmitTest, FailedRunsAreSubmittedAgainOnlyWithRetry) {
  Submit({});
  const std::string id = Tasks(Script(101)).at(0);
  ASSERT_EQ(Do(id).exit_status, 0);
  const std::string db = "s w/runs/" + id + ".db";
  place_.Query(db, "UPDATE run SET status = 'failed', exit_code = 70, error = 'broke'");
  Write("../s w/report.html", "");
  const ProgramResult plain = Submit({});
  EXPECT_EQ(plain.exit_status, 70) << plain.err;
  EXPECT_NE(plain.err.find("--retry runs it again"), std::string::npos) << plain.err;
  EXPECT_EQ(plain.out, "");
  EXPECT_NE(Status().find("failed: broke"), std::string::npos) << Status();
  const ProgramResult retried = Submit({"--retry"});
  EXPECT_EQ(retried.exit_status, 0) << retried.err;
  EXPECT_EQ(Tasks(Script(103)), std::vector<std::string>{id});
  EXPECT_NE(Script(103).find("flags+=(--retry)"), std::string::npos);
}

TEST_F(SubmitTest, PrintShowsTheScriptsAndWritesNothing) {
  const ProgramResult result = Submit({"--seeds", "3", "--print", "--partition", "cpu"});
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_EQ(Count(result.out, "#!/bin/bash\n"), 2u);
  EXPECT_EQ(Count(result.out, "#SBATCH --partition=cpu\n"), 2u);
  EXPECT_FALSE(std::filesystem::exists(place_.Path("s w")));
  EXPECT_FALSE(std::filesystem::exists(place_.Path("slurm/next"))) << "sbatch was called";
  EXPECT_NE(result.err.find("nothing was written or submitted"), std::string::npos);
}

TEST_F(SubmitTest, WithoutSlurmASentenceNamesTheProgram) {
  ::setenv("PATH", "/nonexistent", 1);
  const ProgramResult result = Submit({});
  EXPECT_EQ(result.exit_status, 66);
  EXPECT_NE(result.err.find("there is no program scontrol on PATH"), std::string::npos)
      << result.err;
  EXPECT_EQ(result.out, "");
  // The scripts can be looked at all the same.
  const ProgramResult printed = Submit({"--print"});
  EXPECT_EQ(printed.exit_status, 0) << printed.err;
  EXPECT_EQ(Count(printed.out, "#!/bin/bash\n"), 2u);
}

TEST_F(SubmitTest, StatusWithoutSlurmSaysThatTheQueueWasNotAsked) {
  Submit({"--seeds", "2"});
  ASSERT_EQ(Do(Tasks(Script(101)).at(0)).exit_status, 0);
  Write("broken", "");
  const ProgramResult result = place_.Runner({"status", "--folder", "s w"});
  EXPECT_EQ(result.exit_status, 0) << result.err;
  EXPECT_NE(result.err.find("squeue was not asked"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("cannot connect"), std::string::npos) << result.err;
  EXPECT_EQ(Count(result.out, "  finished  "), 1u) << result.out;
  const ProgramResult unfinished = place_.Runner({"status", "--folder", "s w", "--unfinished"});
  EXPECT_EQ(Count(unfinished.out, " seed "), 1u) << unfinished.out;
  // Nobody knows what is queued, so nothing is submitted twice.
  EXPECT_EQ(Submit({"--seeds", "2"}).exit_status, 74);
}

TEST_F(SubmitTest, OneInstructionSetIsFixedForTheSweep) {
  ASSERT_EQ(Submit({"--instruction-set", "x86-64"}).exit_status, 0);
  EXPECT_NE(Script(101).find("export DREAMSEARCH_INSTRUCTION_SET=x86-64\n"), std::string::npos);
  const ProgramResult other = Submit({"--instruction-set", "avx2"});
  EXPECT_EQ(other.exit_status, 2);
  EXPECT_NE(other.err.find("expected x86-64, with which the sweep"), std::string::npos)
      << other.err;
  Submit({});
  EXPECT_NE(Script(103).find("export DREAMSEARCH_INSTRUCTION_SET=x86-64\n"), std::string::npos);
}

TEST_F(SubmitTest, SettingsThatAFileCannotHoldAreRefusedBeforeAnythingIsSubmitted) {
  const ProgramResult result = Submit({"--study", "a#b"});
  EXPECT_EQ(result.exit_status, 2) << result.err;
  EXPECT_NE(result.err.find("that a configuration file can hold"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(place_.Path("slurm/next")));
}

TEST_F(SubmitTest, ATimeThatIsAllWarningIsRefused) {
  const ProgramResult result = Submit({"--time", "2m"});
  EXPECT_EQ(result.exit_status, 2);
  EXPECT_NE(result.err.find("--time: expected 5m or more"), std::string::npos) << result.err;
}

TEST_F(SubmitTest, WhatSbatchRefusesIsSaidInItsWords) {
  Program("sbatch", "echo 'sbatch: error: invalid partition specified: cpu' >&2; exit 1\n");
  const ProgramResult result = Submit({});
  EXPECT_EQ(result.exit_status, 74);
  EXPECT_NE(result.err.find("invalid partition specified: cpu"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("exit status 1"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace dreamsearch
