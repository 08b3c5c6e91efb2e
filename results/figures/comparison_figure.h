// comparison_figure.h - pictures of a comparison of planners.
#pragma once

#include "results/analysis/comparison.h"
#include "results/analysis/efficiency.h"
#include "results/figures/figure.h"

namespace dreamsearch::results {

Figure IntervalFigure(const Comparison& comparison);
Figure ProfileFigure(const Comparison& comparison);
Figure ImprovementFigure(const Comparison& comparison);
Figure EfficiencyFigure(const Efficiency& efficiency);

}  // namespace dreamsearch::results
