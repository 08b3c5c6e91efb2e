// efficiency.h - sample efficiency: the interquartile mean over tasks and runs against
// environment steps.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "results/analysis/comparison.h"
#include "results/statistics/statistics.h"

namespace dreamsearch::results {

struct EfficiencyPoint {
  std::int64_t env_step = 0;
  Estimate interquartile_mean;  // of normalised scores
};

struct EfficiencyCurve {
  std::string label;
  std::string left_out;                        // why it has no points
  std::size_t fewest_runs = 0, most_runs = 0;  // of a task
  bool interpolated = false;                   // the steps of its runs differ
  std::vector<EfficiencyPoint> points;         // where every run of every task has a value
};

struct Efficiency {
  std::size_t tasks = 0;
  std::vector<EfficiencyCurve> curves;  // in the order of the planners
};

Efficiency ComputeEfficiency(const std::vector<std::unique_ptr<Database>>& databases,
                             const ComparisonRequest& request);

}  // namespace dreamsearch::results
