#include "host/training/resumption.h"

#include "host/plugins/catalogue.h"
#include "host/training/build_and_host.h"
#include "host/training/evaluation.h"
#include "host/training/experiment.h"
#include "results/system/error.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

constexpr PartName kRowsPart{"rows", 1};

// The fields of row sums.
struct Rows {
  results::RowSums sums;

  template <typename Archive>
  void Fields(Archive* archive) {
    (*archive)("steps", &sums.steps);
    (*archive)("episodes", &sums.episodes);
    (*archive)("steps_digest", &sums.steps_digest);
    (*archive)("episodes_digest", &sums.episodes_digest);
  }
};

// Environment step and counts from which the run goes on.
results::ResumePoint ResumePointOf(const RunSpec& spec, const Checkpoint& checkpoint) {
  results::ResumePoint point =
      spec.evaluation ? Evaluation::ResumePointOf(checkpoint, spec.evaluation->env_step)
                      : Experiment::ResumePointOf(checkpoint);
  point.rows = checkpoint.Value<Rows>(kRowsPart).sums;
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

CheckpointHeader HeaderOf(const RunSpec& spec, const std::string& uuid) {
  CheckpointHeader header;
  header.run = uuid;
  header.configuration = ConfigurationSha256(spec);
  header.seed = spec.seed;
  header.instruction_set = InstructionSetInUse();
  header.plugins = DigestsOf(spec);
  return header;
}

void AddRowSums(const results::RunWriter& writer, CheckpointWriter* checkpoint) {
  checkpoint->Value(kRowsPart, Rows{writer.rows()});
}

std::string WhyUnfit(results::Database* database, const results::RunInfo& run, const RunSpec& spec,
                     const Checkpoint& checkpoint) {
  const auto header = checkpoint.Value<CheckpointHeader>(kHeaderPart);
  if (header.run != run.uuid) return "is of the run " + header.run + ", not of " + run.uuid;
  const results::ResumePoint point = ResumePointOf(spec, checkpoint);
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
                          CheckpointFolder::Extent extent) {
  Resumption resumption;
  const auto judge = [&](const Checkpoint& checkpoint) {
    return WhyUnfit(database, run, spec, checkpoint);
  };
  try {
    resumption.checkpoint = CheckpointFolder(folder).LoadNewest(judge, extent);
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
  resumption.point = ResumePointOf(spec, resumption.checkpoint->checkpoint);
  return resumption;
}

}  // namespace dreamsearch
