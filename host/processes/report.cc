#include "host/processes/report.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "results/system/json_text.h"

namespace dreamsearch {
namespace {

double NumberOrNaN(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>()
                                                   : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

std::string EncodeReport(const Report& report) {
  nlohmann::json json;
  switch (report.kind) {
    case Report::Kind::kProgress:
      json["progress"] = report.stage;
      json["env_step"] = report.env_step;
      json["training_return"] = report.training_return;
      json["evaluation_return"] = report.evaluation_return;
      json["decisions"] = report.decisions;
      break;
    case Report::Kind::kError:
      json["error"] = report.message;
      break;
    case Report::Kind::kDone:
      json["done"] = report.result_digest;
      break;
  }
  return results::JsonTextReplacing(json) + "\n";
}

std::optional<Report> DecodeReport(const std::string& line) {
  const nlohmann::json json = results::ParseJsonOrDiscard(line);
  if (!json.is_object()) return std::nullopt;
  const auto text = [&](const char* key) -> std::optional<std::string> {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_string()) return std::nullopt;
    return found->get<std::string>();
  };
  Report report;
  if (const auto stage = text("progress")) {
    report.kind = Report::Kind::kProgress;
    report.stage = *stage;
    const auto step = json.find("env_step");
    if (step != json.end() && step->is_number_unsigned())
      report.env_step = step->get<std::uint64_t>();
    report.training_return = NumberOrNaN(json, "training_return");
    report.evaluation_return = NumberOrNaN(json, "evaluation_return");
    const auto decisions = json.find("decisions");
    if (decisions != json.end() && decisions->is_number_unsigned()) {
      report.decisions = decisions->get<std::uint64_t>();
    }
  } else if (const auto message = text("error")) {
    report.kind = Report::Kind::kError;
    report.message = *message;
  } else if (const auto digest = text("done")) {
    report.kind = Report::Kind::kDone;
    report.result_digest = *digest;
  } else {
    return std::nullopt;
  }
  return report;
}

}  // namespace dreamsearch
