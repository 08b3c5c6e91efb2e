#include "host/training/procedure.h"

namespace dreamsearch {

const char* RunStageName(RunStage stage) {
  switch (stage) {
    case RunStage::kStarting:
      return "starting";
    case RunStage::kExploring:
      return "explore at random";
    case RunStage::kInteracting:
      return "interact";
    case RunStage::kLearning:
      return "learn";
    case RunStage::kEvaluating:
      return "evaluate";
    case RunStage::kFinished:
      return "finished";
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
