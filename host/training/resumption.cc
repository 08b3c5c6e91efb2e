#include "host/training/resumption.h"

#include <nlohmann/json.hpp>

#include "host/plugins/catalogue.h"
#include "host/saving/byte_buffer.h"
#include "host/training/evaluation.h"
#include "host/training/experiment.h"
#include "host/training/provenance.h"
#include "results/system/error.h"
#include "results/system/json_text.h"
#include "results/system/text.h"

namespace dreamsearch {
namespace {

constexpr char kRows[] = "rows";

// Environment step and counts from which the run goes on.
results::ResumePoint ResumePointOf(const RunSpec& spec, const CheckpointSections& sections) {
  results::ResumePoint point = spec.evaluation
                                   ? Evaluation::ResumePointOf(sections, spec.evaluation->env_step)
                                   : Experiment::ResumePointOf(sections);
  const auto found = sections.find(kRows);
  if (found == sections.end()) {
    throw Failure(ExitCode::kBadInput, "the checkpoint has no section 'rows'");
  }
  point.rows = ByteReader(found->second, "checkpoint section 'rows'").Value<results::RowSums>();
  return point;
}

std::string CountsText(const results::RowSums& rows) {
  return Counted(static_cast<std::size_t>(rows.steps), "decision") + " and " +
         Counted(static_cast<std::size_t>(rows.episodes), "episode");
}

Failure Refusal(ExitCode code, const results::Database& database, const results::RunInfo& run,
                const std::string& why) {
  return Failure(code, "run " + std::to_string(run.run_id) + " of " + database.path() +
                           " was not touched: " + why +
                           "\nPut back the database and the folder that belong together, or "
                           "give the run's command with --retry --replace, which deletes what "
                           "it recorded and starts it over");
}

}  // namespace

std::string CheckpointHeader(const RunSpec& spec, const std::string& uuid) {
  nlohmann::json header;
  header["run"] = uuid;
  header["configuration"] = ConfigurationSha256(spec);
  header["seed"] = spec.seed;
  for (const ResolvedComponent* component : ComponentsOf(spec)) {
    header["plugins"][component->info->plugin.name] = component->info->plugin.sha256;
  }
  header["instruction_set"] = InstructionSetInUse();
  return results::JsonText(header);
}

void AddRowSums(const results::RunWriter& writer, CheckpointSections* sections) {
  ByteWriter rows;
  rows.Value(writer.rows());
  (*sections)[kRows] = std::move(rows).bytes();
}

bool HasRowSums(const CheckpointSections& sections) { return sections.count(kRows) != 0; }

std::string WhyUnfit(results::Database* database, const results::RunInfo& run, const RunSpec& spec,
                     const CheckpointSections& sections) {
  const auto found = sections.find("header");
  const nlohmann::json header =
      results::ParseJsonOrDiscard(found != sections.end() ? found->second : std::string());
  const auto uuid = header.is_object() ? header.find("run") : header.end();
  if (uuid == header.end() || !uuid->is_string()) return "does not say of which run it is";
  if (*uuid != run.uuid) {
    return "is of the run " + uuid->get<std::string>() + ", not of " + run.uuid;
  }
  const results::ResumePoint point = ResumePointOf(spec, sections);
  const results::RowSums there = results::RowSumsAt(database, run.run_id, point);
  if (there == *point.rows) return "";
  if (there.steps == point.rows->steps && there.episodes == point.rows->episodes) {
    return "was made when the " + CountsText(there) + " before it had other values";
  }
  return "was made after " + CountsText(*point.rows) + ", of which the database has " +
         CountsText(there);
}

Resumption FindResumption(results::Database* database, const results::RunInfo& run,
                          const RunSpec& spec, const std::filesystem::path& folder,
                          CheckpointPart part) {
  Resumption resumption;
  const auto judge = [&](const CheckpointSections& sections) {
    return WhyUnfit(database, run, spec, sections);
  };
  const SectionFilter outline = [](const std::string& name) {
    return name == "header" || name == "position" || name == kRows;
  };
  try {
    resumption.checkpoint = CheckpointFolder(folder).LoadNewest(
        judge, part == CheckpointPart::kOutline ? outline : SectionFilter());
  } catch (const Failure& error) {
    throw Refusal(error.code(), *database, run, error.what());
  }
  // The last that the database knows of. An evaluation names none, but has one after each
  // episode.
  std::filesystem::path made = database->LastArtifact(run.run_id, "checkpoint");
  if (made.empty() && spec.evaluation) {
    const std::size_t episodes = database->ListEpisodes(run.run_id).size();
    if (episodes > 1) made = CheckpointFolder(folder).PathOf(episodes - 1);
  }
  if (!made.empty()) made = folder / made.filename();
  const bool gone = !made.empty() && !std::filesystem::exists(made);
  if (!resumption.checkpoint) {
    if (!gone) return resumption;
    throw Refusal(
        ExitCode::kNotFound, *database, run,
        "it made the checkpoint " + made.string() + ", which is gone, and no other is there");
  }
  if (gone) resumption.checkpoint->skipped.push_back({false, made.string() + " is gone"});
  resumption.point = ResumePointOf(spec, resumption.checkpoint->sections);
  return resumption;
}

}  // namespace dreamsearch
