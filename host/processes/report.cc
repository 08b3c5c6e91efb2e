#include "host/processes/report.h"

#include "results/text/json_fields.h"
#include "results/text/json_text.h"

namespace dreamsearch {

std::string EncodeReport(const Report& report) {
  return results::JsonTextReplacing(results::FieldsToJson(report)) + "\n";
}

std::optional<Report> DecodeReport(const std::string& line) {
  try {
    const auto report = results::FieldsFromJson<Report>(results::ParseJson(line));
    if (report.kind > Report::Kind::kDone || report.progress.stage > RunStage::kFinished) {
      return std::nullopt;
    }
    return report;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace dreamsearch
