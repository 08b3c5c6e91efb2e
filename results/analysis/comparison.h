// comparison.h - final scores of planners over tasks and seeds, and their
// statistics.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "results/analysis/run_groups.h"
#include "results/statistics/statistics.h"
#include "results/text/table.h"

namespace dreamsearch::results {

struct ComparisonRequest {
  RunFilter filter;
  CurvePhase phase = CurvePhase::kEvaluation;
  // Score at so many environment steps; 0: at the end of each run's budget. A
  // score is the mean return of the evaluations in the last tenth before that.
  std::int64_t at = 0;
  int repetitions = kBootstrapRepetitions;
  int profile_repetitions = kProfileRepetitions;
  std::uint64_t seed = 0;  // of the bootstrap
};

// How far apart, normalised, two planners may be that match each other.
inline constexpr double kMatch = 0.05;

// X against Y.
struct Contrasts {
  Estimate improvement;        // P(X > Y)
  Estimate difference;         // of the mean scores
  Estimate spread_difference;  // of the spreads over seeds
  // Of what runs cost, evaluation and recording left out; none where that was not recorded.
  std::optional<Estimate> cost_ratio;

  // What the interval of the difference says: "X is better", "X is worse", "they match" (it lies
  // within kMatch of 0), "cannot tell", "too few runs".
  std::string Verdict() const;
};

// One planner (with what tells it from others) on the compared tasks.
struct Contender {
  std::string label;
  Scores scores;  // [task][run], normalised
  Scores costs;   // of the same runs: core-minutes at 60 GFLOP/s; empty: of some not recorded
  Aggregates aggregates;
  Estimate spread;
  std::vector<Estimate> profile;  // at Comparison::taus
};

struct Comparison {
  std::vector<std::string> tasks;  // those that every contender has a score on
  std::vector<Contender> contenders;
  std::vector<std::vector<Contrasts>> contrasts;  // [x][y]; unset for x = y
  std::vector<double> taus;
  // What was left out and why, and how far the intervals can be trusted.
  std::vector<std::string> notes;
};

// Failure 66 when there is nothing to compare, saying what is missing.
Comparison Compare(const std::vector<std::unique_ptr<Database>>& databases,
                   const ComparisonRequest& request);

// Score by task and planner: mean, least and greatest run, n.
Table ScoreTable(const Comparison& comparison);
// Mean, median, interquartile mean, optimality gap and spread with intervals.
Table AggregateTable(const Comparison& comparison);
Table ImprovementTable(const Comparison& comparison);
// Differences of score and spread and the ratio of costs, of each pair once.
Table ContrastTable(const Comparison& comparison);
// Everything, the single scores included, as JSON.
std::string ComparisonJson(const Comparison& comparison, const ComparisonRequest& request);

// The four aggregates with their names, in the order in which they are shown.
struct NamedAggregate {
  const char* name;
  Estimate Aggregates::*estimate;
};
extern const NamedAggregate kAggregates[4];

// "n = 3", or "n = 3 to 5" where tasks have different numbers of runs.
std::string RunsText(std::size_t fewest, std::size_t most);
std::string RunsText(const Contender& contender);
// The seed of a stream of the bootstrap, by its name.
std::uint64_t StreamSeed(std::uint64_t seed, const std::string& name);

}  // namespace dreamsearch::results
