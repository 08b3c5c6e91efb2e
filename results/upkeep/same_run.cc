#include "results/upkeep/same_run.h"

namespace dreamsearch::results {
namespace {

auto Rank(const RunInfo& run) {
  return std::tuple(run.status == RunStatus::kFinished, run.env_steps_done, run.heartbeat_utc,
                    run.ended_utc, run.result_digest);
}

}  // namespace

ExperimentKey KeyOf(const RunInfo& run) {
  return {run.study,         run.task, run.planner,      run.model,
          run.config_sha256, run.seed, run.action_repeat};
}

bool StaysOver(const RunInfo& run, const RunInfo& other) {
  if (Rank(run) != Rank(other)) return Rank(run) > Rank(other);
  return run.uuid < other.uuid;
}

std::string RunTwice(const RunInfo& run, const RunInfo& other) {
  return run.task + ", " + run.planner + ", seed " + std::to_string(run.seed) +
         " was run twice, as " + run.uuid.substr(0, 8) + " and " + other.uuid.substr(0, 8) + "; " +
         (StaysOver(run, other) ? run : other).uuid.substr(0, 8) + " stays.";
}

}  // namespace dreamsearch::results
