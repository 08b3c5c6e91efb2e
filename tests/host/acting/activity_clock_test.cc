#include "host/acting/activity_clock.h"

#include <gtest/gtest.h>

#include <numeric>
#include <thread>

#include "host/processes/eigen_product.h"

namespace dreamsearch {
namespace {

void WorkFor(double processor_seconds) {
  std::timespec time{};
  const auto now = [&] {
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  for (const double end = now() + processor_seconds; now() < end;) {
  }
}

double Of(const ActivityClock::Numbers& numbers, Activity activity) {
  return numbers[static_cast<std::size_t>(activity)];
}

double Sum(const ActivityClock::Numbers& numbers) {
  return std::accumulate(numbers.begin(), numbers.end(), 0.0);
}

TEST(ActivityClock, ChargesLearningWithTheProcessorTimeOfAllItsThreads) {
  ActivityClock clock(ActivityClock::Now(), 60);
  const double begin = ActivityClock::ProcessorNow();
  {
    const ActivityScope scope(&clock, Activity::kPlanning);
    WorkFor(0.02);
  }
  {
    const ActivityScope scope(&clock, Activity::kLearning);
    std::thread other([] { WorkFor(0.05); });
    WorkFor(0.05);
    other.join();
  }
  const ActivityClock::Use& use = clock.Totals();
  EXPECT_GE(Of(use.processor_seconds, Activity::kLearning), 0.1);
  EXPECT_LT(Of(use.processor_seconds, Activity::kLearning), 0.12);
  EXPECT_GE(Of(use.processor_seconds, Activity::kPlanning), 0.019);
  EXPECT_LT(Of(use.processor_seconds, Activity::kPlanning), 0.04);
  EXPECT_NEAR(Sum(use.processor_seconds), ActivityClock::ProcessorNow() - begin, 0.001);
  EXPECT_DOUBLE_EQ(Of(use.gflop, Activity::kLearning),
                   60 * Of(use.processor_seconds, Activity::kLearning));
}

TEST(ActivityClock, GoesOnFromTheTotalsOfAnEarlierSegmentOnAFasterMachine) {
  ActivityClock::Use before;
  before.seconds[0] = 1;
  before.processor_seconds[0] = 2;
  before.gflop[0] = 500;
  ActivityClock clock(ActivityClock::Now(), 60);
  clock.set_totals(before);
  {
    const ActivityScope scope(&clock, Activity::kEnvironment);
    WorkFor(0.01);
  }
  const ActivityClock::Use& use = clock.Totals();
  EXPECT_GT(use.processor_seconds[0], 2.005);
  EXPECT_NEAR(use.gflop[0], 500 + 60 * (use.processor_seconds[0] - 2), 1e-9);
}

TEST(ActivityClock, APauseCostsWallTimeAlone) {
  ActivityClock clock(ActivityClock::Now(), 60);
  {
    const ActivityScope scope(&clock, Activity::kEnvironment);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  const ActivityClock::Use& use = clock.Totals();
  EXPECT_GE(use.seconds[0], 0.05);
  EXPECT_LT(Sum(use.processor_seconds), 0.01);
}

TEST(EigenProduct, TheMeasuredSpeedIsThatOfAProcessor) {
  const double speed = MeasureGflopPerSecond();
  EXPECT_GT(speed, 0.1);
  EXPECT_LT(speed, 10000);
}

}  // namespace
}  // namespace dreamsearch
