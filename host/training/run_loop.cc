#include "host/training/run_loop.h"

namespace dreamsearch {

const char* RunStageName(RunStage stage) {
  switch (stage) {
    case RunStage::kStarting:
      return "starting";
    case RunStage::kExploring:
      return "exploring at random";
    case RunStage::kInteracting:
      return "interacting";
    case RunStage::kLearning:
      return "learning";
    case RunStage::kEvaluating:
      return "evaluating";
    case RunStage::kFinished:
      return "finishing";
  }
  return "unknown";
}

std::vector<std::int64_t> MetricIds(const ResolvedComponent& component,
                                    results::RunWriter* writer) {
  std::vector<std::int64_t> ids;
  for (const MetricInfo& metric : component.info->metrics) {
    ids.push_back(writer->Metric(component.name() + "." + metric.name, metric.unit, metric.help));
  }
  return ids;
}

}  // namespace dreamsearch
