#include "host/sweeps/extension.h"

#include <utility>

#include "host/settings/schedule.h"
#include "host/training/experiment.h"
#include "host/training/resumption.h"
#include "results/database/resume_point.h"
#include "results/system/error.h"
#include "results/system/run_lock.h"
#include "results/text/text.h"

namespace dreamsearch {
namespace {

void SetInteger(ResolvedValues* values, const char* name, std::uint64_t number) {
  for (ResolvedValue& value : values->values) {
    if (value.name == name) value.number = static_cast<double>(number);
  }
}

}  // namespace

RunSpec ExtendedSpec(const RunSpec& spec, std::uint64_t steps) {
  const std::uint64_t repeat = spec.action_repeat();
  if (steps <= spec.steps() || steps % repeat != 0) {
    throw Failure(ExitCode::kUsage,
                  "--steps: expected more than the run's " + std::to_string(spec.steps()) +
                      " environment steps, a multiple of its action repeat of " +
                      std::to_string(repeat) + ", found " + std::to_string(steps));
  }
  // Neither depends on the length of an episode.
  const Schedule schedule(spec, 1);
  RunSpec longer = spec;
  SetInteger(&longer.run, "eval_every", schedule.eval_every());
  SetInteger(&longer.run, "replay_capacity", schedule.replay_capacity());
  SetInteger(&longer.run, "steps", steps);
  return longer;
}

Checkpoint ExtensibleCheckpoint(results::Database* database, const results::RunInfo& run,
                                const RunSpec& spec) {
  const auto judge = [&](const Checkpoint& checkpoint) -> std::string {
    if (!Experiment::HasReplay(checkpoint)) return "holds no replay";
    const results::ResumePoint point = Experiment::ResumePointOf(checkpoint);
    if (static_cast<std::uint64_t>(point.env_step) >= spec.steps()) {
      return "was made when the budget had ended";
    }
    return WhyUnfit(database, run, spec, checkpoint);
  };
  std::string why = "its files hold no checkpoint";
  try {
    auto loaded = CheckpointFolder(database->RunFolder(run)).LoadNewest(judge);
    if (loaded) return std::move(loaded->checkpoint);
  } catch (const Failure& error) {
    if (error.code() != ExitCode::kBadInput) throw;
    why = error.what();
  }
  throw Failure(ExitCode::kNotFound,
                "run " + std::to_string(run.run_id) + " cannot be extended: " + why +
                    "\nA run that was begun with --keep-replay can. This one can be repeated with "
                    "a larger --steps");
}

void TakeOver(results::Database* database, const results::RunInfo& run, const RunSpec& spec,
              const Checkpoint& checkpoint, const results::RunInfo& longer,
              const RunSpec& longer_spec) {
  const std::filesystem::path folder = database->RunFolder(longer);
  const FileDescriptor lock = LockRun(folder);
  const results::ResumePoint point = Experiment::ResumePointOf(checkpoint);
  CheckpointHeader header = checkpoint.Value<CheckpointHeader>(kHeaderPart);
  header.run = longer.uuid;
  header.configuration = ConfigurationSha256(longer_spec);
  // The rows before the checkpoint that counts them, see resumption.h.
  results::CopyRows(database, run.run_id, longer.run_id, point);
  const auto env_step = static_cast<std::uint64_t>(point.env_step);
  WriteCheckpointFile(CheckpointFolder(folder).PathOf(env_step), [&](CheckpointWriter* writer) {
    writer->Value(kHeaderPart, header);
    writer->CopyParts(checkpoint, kHeaderPart);
  });
  database->AddEvent(longer.run_id, point.env_step, "info", "extension",
                     "of run " + std::to_string(run.run_id) + " (" + run.uuid + ", " +
                         GroupDigits(spec.steps()) + " environment steps), from " +
                         checkpoint.path().filename().string());
}

}  // namespace dreamsearch
