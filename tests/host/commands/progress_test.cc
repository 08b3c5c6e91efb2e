#include "host/commands/progress.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "host/processes/worker_report.h"
#include "host/training/rate_meter.h"
#include "results/text/shell.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

TEST(Format, NumbersReadWell) {
  EXPECT_EQ(GroupDigits(0), "0");
  EXPECT_EQ(GroupDigits(999), "999");
  EXPECT_EQ(GroupDigits(1000), "1,000");
  EXPECT_EQ(GroupDigits(1234567), "1,234,567");
  EXPECT_EQ(FormatDuration(42), "42 s");
  EXPECT_EQ(FormatDuration(600), "10 min");
  EXPECT_EQ(FormatDuration(3 * 3600 + 20 * 60), "3 h 20 min");
  EXPECT_EQ(FormatDuration(50 * 3600), "2 d 2 h");
  EXPECT_EQ(FormatBytes(999), "999 B");
  EXPECT_EQ(FormatBytes(3.4e6), "3.4 MB");
}

TEST(ShellWord, IsWhatAShellTakesForOneWord) {
  EXPECT_EQ(ShellWord("results/a-b_c.db"), "results/a-b_c.db");
  EXPECT_EQ(ShellWord(""), "''");
  EXPECT_EQ(ShellWord("my dir/y.db"), "'my dir/y.db'");
  EXPECT_EQ(ShellWord("it's"), "'it'\\''s'");
  EXPECT_EQ(ShellWord("a\n'\\\xe9"), "$'a\\012\\'\\\\\\351'");
  EXPECT_EQ(ShellCommand({"runner", "--db", "a b"}), "runner --db 'a b'");
  // Every byte but NUL, alone and between others, comes back from a shell.
  std::string all;
  for (int byte = 1; byte < 256; ++byte) all += static_cast<char>(byte);
  const std::string command = "bash -c " + ShellWord("printf %s " + ShellWord(all));
  FILE* shell = ::popen(("bash -c " + ShellWord("exec " + command)).c_str(), "r");
  ASSERT_NE(shell, nullptr);
  std::string back(512, '\0');
  back.resize(std::fread(back.data(), 1, back.size(), shell));
  ::pclose(shell);
  EXPECT_EQ(back, all);
}

TEST(IsUtf8, TakesWhatTheStandardTakes) {
  for (const char* text : {"", "abc", "\xc3\xa9", "\xe2\x82\xac", "\xf0\x9f\x98\x80",
                           "\xef\xbf\xbf", "\xf4\x8f\xbf\xbf", "\xed\x9f\xbf"}) {
    EXPECT_TRUE(IsUtf8(text)) << text;
  }
  for (const char* text : {"b\xe9", "\xc0\xaf", "\xc3", "\xe2\x82", "\xe0\x80\xaf", "\xed\xa0\x80",
                           "\xf4\x90\x80\x80", "\xff", "\x80"}) {
    EXPECT_FALSE(IsUtf8(text)) << text;
  }
}

TEST(RateMeter, CountsOnlyWhatCounts) {
  RateMeter meter;
  meter.Add(0, 0, false);
  meter.Add(1, 5000, false);  // the random steps go fast
  meter.Add(2, 5000, true);
  EXPECT_EQ(meter.Rate(), 0);
  meter.Add(22, 6000, true);
  EXPECT_DOUBLE_EQ(meter.Rate(), 50);
}

TEST(WorkerReport, RoundTripsAndRefusesNoise) {
  WorkerReport report;
  report.progress.stage = RunStage::kLearning;
  report.progress.env_step = 5000;
  report.progress.training_return = 12.5;
  report.progress.decisions = 3;
  report.progress.threads = 2;
  report.progress.lock_wait_seconds = 1.5;
  const auto decoded = DecodeWorkerReport(EncodeWorkerReport(report));
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->kind, WorkerReport::Kind::kProgress);
  EXPECT_EQ(decoded->progress.stage, RunStage::kLearning);
  EXPECT_EQ(decoded->progress.env_step, 5000u);
  EXPECT_EQ(decoded->progress.training_return, 12.5);
  EXPECT_TRUE(std::isnan(decoded->progress.evaluation_return));
  EXPECT_EQ(decoded->progress.decisions, 3u);
  EXPECT_EQ(decoded->progress.threads, 2u);
  EXPECT_EQ(decoded->progress.lock_wait_seconds, 1.5);
  const std::string line = EncodeWorkerReport(report);
  for (const auto& [from, to] :
       {std::pair("\"kind\":0", "\"kind\":9"), std::pair("\"stage\":3", "\"stage\":17"),
        std::pair("\"env_step\":5000", "\"env_step\":\"x\"")}) {
    std::string noise = line;
    ASSERT_NE(noise.find(from), std::string::npos) << line;
    noise.replace(noise.find(from), std::string(from).size(), to);
    EXPECT_FALSE(DecodeWorkerReport(noise)) << noise;
  }
  for (const char* noise : {"hello", "[1, 2]", "{}", "", "null", "{\"kind\":0}"}) {
    EXPECT_FALSE(DecodeWorkerReport(noise)) << noise;
  }
}

}  // namespace
}  // namespace dreamsearch
