#include "host/commands/progress.h"

#include <gtest/gtest.h>

#include <cmath>

#include "host/processes/rate_meter.h"
#include "host/processes/report.h"
#include "results/system/text.h"

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

TEST(RateMeter, CountsOnlyWhatCounts) {
  RateMeter meter;
  meter.Add(0, 0, false);
  meter.Add(1, 5000, false);  // the random steps go fast
  meter.Add(2, 5000, true);
  EXPECT_EQ(meter.Rate(), 0);
  meter.Add(22, 6000, true);
  EXPECT_DOUBLE_EQ(meter.Rate(), 50);
}

TEST(Report, RoundTripsAndRefusesNoise) {
  Report report;
  report.stage = "learn";
  report.env_step = 5000;
  report.training_return = 12.5;
  report.evaluation_return = std::numeric_limits<double>::quiet_NaN();
  const auto decoded = DecodeReport(EncodeReport(report));
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->stage, "learn");
  EXPECT_EQ(decoded->env_step, 5000u);
  EXPECT_EQ(decoded->training_return, 12.5);
  EXPECT_TRUE(std::isnan(decoded->evaluation_return));
  EXPECT_FALSE(DecodeReport("hello"));
  EXPECT_FALSE(DecodeReport("[1, 2]"));
  EXPECT_FALSE(DecodeReport("{}"));
}

}  // namespace
}  // namespace dreamsearch
