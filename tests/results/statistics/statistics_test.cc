#include "results/statistics/statistics.h"

#include <gtest/gtest.h>
#include <time.h>

#include <cmath>

#include "dreamsearch/random.h"

namespace dreamsearch::results {
namespace {

// Point values: sums of a few numbers of size 1, so a few roundings of 1e-16.
constexpr double kTolerance = 1e-12;

TEST(Statistics, MeanAndMedianAreOverTasksOfTheMeanOverRuns) {
  const Scores scores = {{0.1, 0.3}, {0.5}, {0.6, 0.7, 1.1}, {1.0}};
  // Task means 0.2, 0.5, 0.8, 1.0.
  EXPECT_NEAR(MeanScore(scores), 0.625, kTolerance);
  EXPECT_NEAR(MedianScore(scores), 0.65, kTolerance);
  EXPECT_NEAR(MedianScore({{0.1}, {0.9}, {0.3}}), 0.3, kTolerance);
}

TEST(Statistics, TheInterquartileMeanCutsFloorOfAQuarterFromEachEnd) {
  EXPECT_NEAR(InterquartileMean({{8, 1, 5, 4}, {2, 3, 6, 7}}), 4.5, kTolerance);  // 3 4 5 6
  EXPECT_NEAR(InterquartileMean({{10, 1, 2, 3, 4, 0}}), 2.5, kTolerance);         // 1 2 3 4
  EXPECT_NEAR(InterquartileMean({{1, 2, 6}}), 3, kTolerance);                     // floor(3/4) = 0
  EXPECT_NEAR(InterquartileMean({{1}, {2}, {4}, {100}, {-50}}), 7.0 / 3, kTolerance);
}

TEST(Statistics, TheOptimalityGapCountsNothingAboveOne) {
  EXPECT_NEAR(OptimalityGap({{0.25, 1.5}, {1.0, 0.5}}), 1.25 / 4, kTolerance);
}

TEST(Statistics, ImprovementIsMannWhitneysUWithTiesOneHalf) {
  EXPECT_NEAR(ImprovementProbability({{1, 2, 3}}, {{2}}), 0.5, kTolerance);
  EXPECT_NEAR(
      ImprovementProbability({{1, 2, 3}, {5}}, {{2, 0}, {1, 5, 9}}),
      // 0.5 + 1.5 + 2 wins... of 6 by task one: 1>0, 2=2, 2>0, 3>2, 3>0; task two: 1.5 of 3.
      ((1 + 0.5 + 1 + 1 + 1) / 6 + 1.5 / 3) / 2, kTolerance);
  EXPECT_NEAR(ImprovementProbability({{1, 1}}, {{1, 1}}), 0.5, kTolerance);
}

TEST(Statistics, TheSpreadIsTheMeanOverTasksOfTheDeviationOverRuns) {
  // Deviations 1 and sqrt(((3 - 5)^2 + (7 - 5)^2) / 1).
  EXPECT_NEAR(Spread({{1, 2, 3}, {3, 7}}), (1 + std::sqrt(8.0)) / 2, kTolerance);
  EXPECT_TRUE(std::isnan(Spread({{1, 2, 3}, {3}})));
  EXPECT_EQ(Spread({{4, 4, 4}}), 0);
}

// Of three seeds a plain percentile interval would hold it in half of the studies.
TEST(Statistics, TheIntervalOfASpreadHoldsTheExpectedOne) {
  constexpr double kShareOfDeviation = 0.8862;  // what three normal draws show of it on average
  constexpr int kStudies = 300;
  Random random(5);
  double expected = 0;
  const auto study = [&](double factor) {
    Scores scores(8);
    expected = 0;
    for (std::size_t task = 0; task < scores.size(); ++task) {
      const double deviation = 0.02 * static_cast<double>(task + 1);
      expected += kShareOfDeviation * deviation / 8;
      for (int run = 0; run < 3; ++run) {
        scores[task].push_back(factor * deviation * random.Normal());
      }
    }
    return scores;
  };
  int held = 0, difference_held = 0;
  for (int i = 0; i < kStudies; ++i) {
    const Scores x = study(1), y = study(2);
    const Interval of_x = *SpreadEstimate(x, 500, 1).interval;
    held += of_x.lo <= expected && expected <= of_x.hi;
    const Interval less = *SpreadDifference(y, x, 500, 1).interval;
    difference_held += less.lo <= expected && expected <= less.hi;
  }
  EXPECT_GT(held, 0.88 * kStudies);
  EXPECT_GT(difference_held, 0.88 * kStudies);
}

TEST(Statistics, TheIntervalOfEqualScoresHasNoWidth) {
  const Estimate estimate = SpreadEstimate({{2, 2, 2}}, 100, 1);
  EXPECT_EQ(estimate.interval->lo, 0);
  EXPECT_EQ(estimate.interval->hi, 0);
  EXPECT_FALSE(SpreadDifference({{2, 3}}, {{1, 2, 3}}, 100, 1).interval);
}

TEST(Statistics, ContrastsCompareMeansSpreadsAndCosts) {
  const Scores x = {{1, 2, 3}, {8, 8, 8}}, y = {{1, 1, 1}, {1, 2, 3}};
  EXPECT_NEAR(MeanDifference(x, y), 5 - 1.5, kTolerance);
  EXPECT_NEAR(SpreadDifference(x, y, 100, 1).value, 0, kTolerance);
  EXPECT_NEAR(MeanRatio(x, y), std::sqrt(2.0 * 4.0), kTolerance);
}

TEST(Statistics, AContrastOfConstantsHasAnIntervalWithoutWidth) {
  const Estimate estimate = ContrastEstimate(MeanDifference, {{3, 3, 3}}, {{1, 1, 1}}, 100, 7);
  ASSERT_TRUE(estimate.interval);
  EXPECT_EQ(estimate.interval->lo, 2);
  EXPECT_EQ(estimate.interval->hi, 2);
  EXPECT_FALSE(ContrastEstimate(MeanDifference, {{3, 3}}, {{1, 1, 1}}, 100, 7).interval);
}

// Of three runs 0, 0, 3 a resample has a mean of 3 with probability 1/27 and one of 0 with 8/27, so
// the interval of 95 % reaches from 0 to 3.
TEST(Statistics, AContrastResamplesRunsWithinTheirTask) {
  const Estimate estimate = ContrastEstimate(MeanDifference, {{0, 0, 3}}, {{1, 1, 1}}, 5000, 7);
  EXPECT_EQ(estimate.interval->lo, -1);
  EXPECT_EQ(estimate.interval->hi, 2);
  EXPECT_EQ(estimate.value, 0);
}

TEST(Statistics, TheProfileCountsScoresStrictlyAbove) {
  const Scores scores = {{0.2, 0.5}, {0.5, 0.9}};
  EXPECT_NEAR(PerformanceProfile(scores, 0.1), 1, kTolerance);
  EXPECT_NEAR(PerformanceProfile(scores, 0.5), 0.25, kTolerance);
  EXPECT_NEAR(PerformanceProfile(scores, 0.9), 0, kTolerance);
}

TEST(Statistics, QuantilesInterpolateLinearly) {
  std::vector<double> values = {4, 1, 3, 2};
  EXPECT_NEAR(Quantile(&values, 0), 1, kTolerance);
  EXPECT_NEAR(Quantile(&values, 0.025), 1.075, kTolerance);
  EXPECT_NEAR(Quantile(&values, 0.5), 2.5, kTolerance);
  EXPECT_NEAR(Quantile(&values, 1), 4, kTolerance);
  std::vector<double> one = {7};
  EXPECT_EQ(Quantile(&one, 0.975), 7);
}

// The mean of four draws from {0, 0, 0, 1} is Binomial(4, 1/4) / 4: at most 0 with
// probability 0.316, at most 1/2 with 0.949, at most 3/4 with 0.996. So the 2.5 %
// quantile is 0 and the 97.5 % quantile 3/4; at 50,000 repetitions the shares are
// known to 0.001, far from either.
TEST(Statistics, TheIntervalIsThatOfTheKnownBootstrapDistribution) {
  const Aggregates aggregates = Aggregate({{0, 0, 0, 1}}, kBootstrapRepetitions, 1);
  ASSERT_TRUE(aggregates.mean.interval);
  EXPECT_EQ(aggregates.mean.interval->lo, 0);
  EXPECT_EQ(aggregates.mean.interval->hi, 0.75);
  EXPECT_EQ(aggregates.optimality_gap.interval->lo, 0.25);
  EXPECT_EQ(aggregates.optimality_gap.interval->hi, 1);
  // The interquartile mean of four draws is (s2 + s3) / 2: 1 when 3 or more are 1,
  // with probability 0.051.
  EXPECT_EQ(aggregates.interquartile_mean.interval->lo, 0);
  EXPECT_EQ(aggregates.interquartile_mean.interval->hi, 1);
}

// Two tasks that differ only by a constant: runs are drawn within a task, never
// across, so the mean of every repetition is the middle of the constants.
TEST(Statistics, RunsAreDrawnWithinTheirTask) {
  const Aggregates aggregates = Aggregate({{0.2, 0.2, 0.2}, {0.8, 0.8, 0.8}}, 2000, 1);
  EXPECT_NEAR(aggregates.mean.interval->lo, 0.5, kTolerance);
  EXPECT_NEAR(aggregates.mean.interval->hi, 0.5, kTolerance);
}

// P(X > Y) of one task with X = {0, 1, 1} against Y = {0.5, 0.5, 0.5} is the share
// of ones among three draws: Binomial(3, 2/3) / 3. P(0) = 0.037, P(1) = 0.296.
TEST(Statistics, ImprovementsIntervalIsThatOfTheKnownDistribution) {
  const Estimate estimate = Improvement({{0, 1, 1}}, {{0.5, 0.5, 0.5}}, kBootstrapRepetitions, 3);
  EXPECT_NEAR(estimate.value, 2.0 / 3, kTolerance);
  EXPECT_EQ(estimate.interval->lo, 0);
  EXPECT_EQ(estimate.interval->hi, 1);
  // Both sides are drawn: with Y varying and X not, the interval is as wide.
  const Estimate other = Improvement({{0.5, 0.5, 0.5}}, {{0, 1, 1}}, kBootstrapRepetitions, 3);
  EXPECT_EQ(other.interval->lo, 0);
  EXPECT_EQ(other.interval->hi, 1);
}

TEST(Statistics, TheProfilesIntervalIsThatOfTheKnownDistribution) {
  const std::vector<Estimate> profile = Profile({{0, 0, 0, 1}}, {-1, 0.5, 2}, 20000, 1);
  EXPECT_EQ(profile[0].interval->lo, 1);
  EXPECT_EQ(profile[1].value, 0.25);
  EXPECT_EQ(profile[1].interval->lo, 0);
  EXPECT_EQ(profile[1].interval->hi, 0.75);
  EXPECT_EQ(profile[2].interval->hi, 0);
}

Scores Random20By5(std::uint64_t seed) {
  Random random(seed);
  Scores scores(20, std::vector<double>(5));
  for (auto& runs : scores) {
    for (double& score : runs) score = random.Uniform();
  }
  return scores;
}

TEST(Statistics, IntervalsAreAFunctionOfTheSeedToTheBit) {
  const Scores scores = Random20By5(1);
  const Aggregates a = Aggregate(scores, 2000, 7), b = Aggregate(scores, 2000, 7),
                   c = Aggregate(scores, 2000, 8);
  EXPECT_EQ(a.interquartile_mean.interval->lo, b.interquartile_mean.interval->lo);
  EXPECT_EQ(a.median.interval->hi, b.median.interval->hi);
  EXPECT_NE(a.interquartile_mean.interval->lo, c.interquartile_mean.interval->lo);
}

TEST(Statistics, FewerThanThreeRunsGiveNoInterval) {
  EXPECT_FALSE(Aggregate({{0.1, 0.2}}, 100, 1).mean.interval);
  EXPECT_FALSE(Aggregate({{0.1, 0.2, 0.3}, {0.1, 0.2}}, 100, 1).mean.interval);
  EXPECT_FALSE(Improvement({{1, 2, 3}}, {{1, 2}}, 100, 1).interval);
  EXPECT_FALSE(Profile({{1, 2}}, {0.5}, 100, 1)[0].interval);
  EXPECT_TRUE(Aggregate({{0.1, 0.2, 0.3}}, 100, 1).mean.interval);
}

TEST(Statistics, DistinctResamplesAreCounted) {
  EXPECT_EQ(DistinctResamples({{1, 2, 3}}), 10);
  EXPECT_EQ(DistinctResamples({{1, 2, 3}, {1, 2, 3}}), 100);
  EXPECT_EQ(DistinctResamples({{1, 2, 3, 4, 5}}), 126);
  EXPECT_TRUE(std::isinf(DistinctResamples(Scores(20, {1, 2, 3}))));
}

// Tabulated, e.g. in Abramowitz and Stegun, table 26.10.
TEST(Statistics, StudentsQuantilesHaveNoJump) {
  EXPECT_NEAR(StudentQuantile(0.975, 1), 12.706, 5e-4);
  EXPECT_NEAR(StudentQuantile(0.975, 2), 4.303, 5e-4);
  EXPECT_NEAR(StudentQuantile(0.975, 30), 2.042, 5e-4);
  EXPECT_NEAR(StudentQuantile(0.975, 120), 1.980, 5e-4);
  EXPECT_NEAR(StudentQuantile(0.975, 1000000), 1.960, 5e-4);
  for (int degrees = 1; degrees < 200; ++degrees) {
    EXPECT_GT(StudentQuantile(0.975, degrees), StudentQuantile(0.975, degrees + 1));
    EXPECT_GT(StudentQuantile(0.975, degrees), 1.96);
  }
}

// The contract: 50,000 repetitions over 20 tasks, 5 seeds and 4 planners within
// 5 s. CPU time, so that a busy machine does not fail it.
TEST(Statistics, AStudysBootstrapTakesSeconds) {
  timespec before, after;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &before);
  std::vector<Scores> planners;
  for (std::uint64_t p = 0; p < 4; ++p) planners.push_back(Random20By5(p));
  for (std::size_t x = 0; x < 4; ++x) {
    Aggregate(planners[x], kBootstrapRepetitions, x);
    for (std::size_t y = 0; y < 4; ++y) {
      if (x != y) Improvement(planners[x], planners[y], kBootstrapRepetitions, x * 4 + y);
    }
  }
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &after);
  const double seconds = static_cast<double>(after.tv_sec - before.tv_sec) +
                         1e-9 * static_cast<double>(after.tv_nsec - before.tv_nsec);
  std::printf("%.2f s of CPU\n", seconds);
#if defined(__OPTIMIZE__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LT(seconds, 5);
#endif
}

}  // namespace
}  // namespace dreamsearch::results
