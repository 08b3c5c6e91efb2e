#include "host/processes/worker_report.h"

#include "results/text/json_fields.h"
#include "results/text/json_text.h"

namespace dreamsearch {

std::string EncodeWorkerReport(const WorkerReport& report) {
  return results::JsonTextReplacing(results::FieldsToJson(report)) + "\n";
}

std::optional<WorkerReport> DecodeWorkerReport(const std::string& line) {
  try {
    const auto report = results::FieldsFromJson<WorkerReport>(results::ParseJson(line));
    if (report.kind > WorkerReport::Kind::kDone || report.progress.stage > RunStage::kFinished) {
      return std::nullopt;
    }
    return report;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace dreamsearch
