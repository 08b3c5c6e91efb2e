#include "host/clusters/submission.h"

#include <nlohmann/json.hpp>

#include "host/sweeps/sweep.h"
#include "results/system/error.h"
#include "results/system/file.h"
#include "results/system/sha256.h"
#include "results/text/json_fields.h"
#include "results/text/json_text.h"

namespace dreamsearch {
namespace {

constexpr std::size_t kIdDigits = 16;

std::filesystem::path RecordPath(const std::filesystem::path& folder) {
  return folder / "submission.json";
}

std::string Line(const std::string& name, const std::string& value) {
  return name + " = " + value + "\n";
}

// Values that somebody gave; all others follow from preset and model.
std::string SettingLines(const std::string& scope, const ResolvedValues& values) {
  std::string lines;
  for (const ResolvedValue& value : values.values) {
    if (value.origin != ValueOrigin::kFile && value.origin != ValueOrigin::kCommandLine) continue;
    lines += Line("set", scope + "." + value.name + "=" + ValueText(value));
  }
  return lines;
}

}  // namespace

SubmittedRun* Submission::Run(const std::string& id) {
  for (SubmittedRun& run : runs) {
    if (run.id == id) return &run;
  }
  runs.push_back({.id = id, .label = "", .steps = 0, .job = ""});
  return &runs.back();
}

std::vector<std::string> Submission::Jobs() const {
  std::vector<std::string> jobs = arrays;
  if (!merge_job.empty()) jobs.push_back(merge_job);
  return jobs;
}

std::string RunFileName(const RunSpec& spec) {
  const results::RunKey key = KeyOf(spec);
  return Sha256Hex(
             results::JsonText(nlohmann::json{key.study, key.task, key.planner, key.model,
                                              key.config_sha256, key.seed, key.action_repeat}))
      .substr(0, kIdDigits);
}

std::filesystem::path RunDatabase(const std::filesystem::path& folder, const std::string& id) {
  return folder / "runs" / (id + ".db");
}

std::filesystem::path RunConfiguration(const std::filesystem::path& folder, const std::string& id) {
  return folder / "runs" / (id + ".cfg");
}

bool HasSubmission(const std::filesystem::path& folder) {
  std::error_code error;
  return std::filesystem::exists(RecordPath(folder), error);
}

Submission ReadSubmission(const std::filesystem::path& folder) {
  if (!HasSubmission(folder)) return {};
  const std::filesystem::path path = RecordPath(folder);
  try {
    return results::FieldsFromJson<Submission>(results::ParseJson(ReadWholeFile(path)));
  } catch (const nlohmann::json::exception& error) {
    throw Failure(ExitCode::kBadInput,
                  path.string() + " is not what `runner submit` writes: " + error.what());
  }
}

void WriteSubmission(const std::filesystem::path& folder, const Submission& submission) {
  WriteWholeFile(RecordPath(folder),
                 results::JsonText(results::FieldsToJson(submission), 1) + "\n");
}

std::string ConfigurationText(const RunSpec& spec) {
  std::string text = Line("env", spec.environment.name());
  text += Line("planner", spec.planner.name());
  text += Line("model", spec.model.name());
  const bool own = spec.eval_planner.name() == spec.planner.name();
  if (!own) text += Line("eval-planner", spec.eval_planner.name());
  text += Line("seed-list", std::to_string(spec.seed));
  text += Line("study", spec.study);
  text += Line("preset", spec.preset);
  text += SettingLines("run", spec.run);
  text += SettingLines("env", spec.environment.parameters);
  text += SettingLines("model", spec.model.parameters);
  text += SettingLines("planner/" + spec.planner.name(), spec.planner.parameters);
  if (!own) {
    text += SettingLines("planner/" + spec.eval_planner.name(), spec.eval_planner.parameters);
  }
  return text;
}

}  // namespace dreamsearch
