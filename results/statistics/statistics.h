// statistics.h - comparing algorithms over tasks and few seeds, after Agarwal et
// al. 2021, "Deep reinforcement learning at the edge of the statistical
// precipice".
//
// Scores are normalised: 0 and 1 are the ends of a task's range of returns.
// Intervals are 95 % percentile intervals of a stratified bootstrap: every
// repetition draws, for each task independently, as many runs as there are, with
// replacement. They are a function of the scores and the seed alone, to the bit.
// With fewer than kIntervalRuns runs on any task there is no interval.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace dreamsearch::results {

// scores[task][run]. Tasks may differ in their number of runs; none is empty.
using Scores = std::vector<std::vector<double>>;

// Mean over tasks of the mean over runs.
double MeanScore(const Scores& scores);
// Median over tasks of the mean over runs.
double MedianScore(const Scores& scores);
// Mean of all N runs' scores, sorted, without the floor(N / 4) at each end.
double InterquartileMean(const Scores& scores);
// Mean over all runs of 1 - min(score, 1).
double OptimalityGap(const Scores& scores);
// P(X > Y): the mean over tasks of Mann and Whitney's U / (n_X n_Y), a tie being
// one half. x and y have the same tasks.
double ImprovementProbability(const Scores& x, const Scores& y);
// Mean over tasks of the standard deviation over a task's runs, n - 1 in the denominator; NaN
// where a task has one run.
double Spread(const Scores& scores);

// What compares two algorithms; x and y have the same tasks.
using Contrast = double (*)(const Scores& x, const Scores& y);
// MeanScore(x) - MeanScore(y).
double MeanDifference(const Scores& x, const Scores& y);
// Of positive numbers: geometric mean over tasks of the ratio of the means over runs.
double MeanRatio(const Scores& x, const Scores& y);

// Share of all runs whose score is greater than tau.
double PerformanceProfile(const Scores& scores, double tau);

// The q-quantile, 0 <= q <= 1, by linear interpolation between order statistics.
// Reorders the values.
double Quantile(std::vector<double>* values, double q);

// The q-quantile of Student's t, 0 < q < 1, at least one degree of freedom.
double StudentQuantile(double q, int degrees_of_freedom);

// Numbers as they come, by Welford (1962): no digits are lost however far from 0 they lie. All
// zeros is an empty one.
struct Sample {
  std::int64_t n = 0;
  double mean = 0;
  double squares = 0;  // of the distances from the mean, summed

  void Add(double x);
  // Of the mean; nothing of fewer than two numbers.
  std::optional<double> StandardError() const;
};
Sample SampleOf(const std::vector<double>& values);

// Fewer runs of a task give no interval.
inline constexpr int kIntervalRuns = 3;
struct Interval {
  double lo = 0, hi = 0;
};
struct Estimate {
  double value = 0;
  std::optional<Interval> interval;
};
struct Aggregates {
  Estimate mean, median, interquartile_mean, optimality_gap;
};

inline constexpr int kBootstrapRepetitions = 50000;
inline constexpr int kProfileRepetitions = 2000;

Aggregates Aggregate(const Scores& scores, int repetitions, std::uint64_t seed);
Estimate Improvement(const Scores& x, const Scores& y, int repetitions, std::uint64_t seed);
// The spread, and that of x less that of y. A resample of few runs has repeated ones and is too
// narrow, so resampled spreads are scaled until their mean is the spread of the scores. [ours]
Estimate SpreadEstimate(const Scores& scores, int repetitions, std::uint64_t seed);
Estimate SpreadDifference(const Scores& x, const Scores& y, int repetitions, std::uint64_t seed);
Estimate ContrastEstimate(Contrast contrast, const Scores& x, const Scores& y, int repetitions,
                          std::uint64_t seed);
// One estimate for each tau.
std::vector<Estimate> Profile(const Scores& scores, const std::vector<double>& taus,
                              int repetitions, std::uint64_t seed);
Estimate InterquartileMeanEstimate(const Scores& scores, int repetitions, std::uint64_t seed);

// Different draws with replacement, order aside: the product over tasks of
// (2 n - 1 choose n), or infinity where that is more than 10^15. A bootstrap of
// few of them is coarse.
double DistinctResamples(const Scores& scores);

}  // namespace dreamsearch::results
