#include "host/clusters/run_state.h"

#include "results/database/cluster_place.h"
#include "results/database/database.h"
#include "results/system/error.h"
#include "results/system/run_lock.h"

namespace dreamsearch {

std::string RunCondition::name() const {
  switch (state) {
    case RunState::kQueued:
      return "queued in Slurm";
    case RunState::kRunning:
      return "running";
    case RunState::kFinished:
      return "finished";
    case RunState::kFailed:
      return "failed";
    case RunState::kMissing:
      return "missing";
  }
  return "";
}

RunCondition ConditionOf(const std::filesystem::path& folder, const SubmittedRun& run,
                         const Queue* queue) {
  RunCondition condition;
  condition.job = run.job;
  const QueuedJob* job = nullptr;
  if (queue != nullptr) {
    const auto found = queue->find(run.job);
    if (found != queue->end()) job = &found->second;
  }
  const bool waits = job != nullptr && job->state == "PENDING";
  std::optional<results::RunStatus> status;
  bool held = false;
  const std::filesystem::path path = RunDatabase(folder, run.id);
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    try {
      const auto database = results::Database::OpenReadOnly(path.string());
      for (const results::RunInfo& row : database->ListRuns()) {
        if (row.parent_run_id) continue;  // an evaluation that somebody added
        status = row.status;
        held = RunIsLocked(database->RunFolder(row));
        condition.steps = row.env_steps_done;
        condition.note = row.error;
        const results::ClusterPlace place = results::LastPlace(database.get(), row.run_id);
        condition.node = place.node;
        if (condition.job.empty()) condition.job = place.job;
        break;
      }
    } catch (const Failure& failure) {
      condition.note = failure.what();
    }
  }
  if (status == results::RunStatus::kFinished) {
    condition.state = RunState::kFinished;
    return condition;
  }
  if (job != nullptr && !job->node.empty()) condition.node = job->node;
  const bool begun = status == results::RunStatus::kRunning;
  if (held || (job != nullptr && !waits && begun)) {
    condition.state = RunState::kRunning;
    condition.note.clear();
  } else if (waits || (job != nullptr && !(status && results::HasFailed(*status)))) {
    condition.state = RunState::kQueued;
    condition.note = job->reason;
  } else if (status && results::HasFailed(*status)) {
    condition.state = RunState::kFailed;
    condition.note = std::string(results::RunStatusName(*status)) +
                     (condition.note.empty() ? "" : ": " + condition.note);
  } else if (queue == nullptr && begun) {
    condition.state = RunState::kRunning;  // on another machine, as far as can be known
  } else if (status) {
    const char* name = begun ? "lost its process" : results::RunStatusName(*status);
    condition.note = name + (condition.note.empty() ? "" : ": " + condition.note);
  }
  return condition;
}

}  // namespace dreamsearch
