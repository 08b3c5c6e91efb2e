// report.h - one HTML page with every figure of a selection, that needs neither a
// network nor other files.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "results/analysis/comparison.h"

namespace dreamsearch::results {

struct ReportRequest {
  std::string title;
  RunFilter filter;
  std::vector<std::string> published;  // as in CurveRequest
  std::uint64_t bootstrap_seed = 0;
};

// The page: learning curves by task and over tasks, time, comparison, what is
// missing, settings, machines, and the query behind each figure. With scripting it
// can be explored; without, it shows static pictures. At most 40 points a run are
// kept; the page says how many steps one stands for.
std::string ReportPage(const std::vector<std::unique_ptr<Database>>& databases,
                       const ReportRequest& request);

}  // namespace dreamsearch::results
