// comparison_figure.h - pictures of a comparison of planners.
#pragma once

#include <memory>
#include <vector>

#include "results/analysis/comparison.h"
#include "results/figures/figure.h"

namespace dreamsearch::results {

Figure IntervalFigure(const Comparison& comparison);
Figure ProfileFigure(const Comparison& comparison);
Figure ImprovementFigure(const Comparison& comparison);
// The interquartile mean over tasks and runs against environment steps, where
// every run of every task has an evaluation.
Figure EfficiencyFigure(const std::vector<std::unique_ptr<Database>>& databases,
                        const ComparisonRequest& request);

}  // namespace dreamsearch::results
