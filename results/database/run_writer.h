// run_writer.h - writes what a run does, for the one process that works on it.
//
// Rows are kept in memory and stored together in one short transaction: at
// Commit, and by the writer itself once 1000 rows or one second are waiting. So
// at most 1000 rows or one second are at risk when the process dies, and other
// writers of the file wait for microseconds.
//
// A row whose key is there already replaces it: a resumed run remakes its rows.
// A number that is not finite is stored as NULL together with an event.
//
// Errors   Failure as in database.h. A failed Commit has stored nothing and
//          keeps its rows, so it can be tried again once there is space. When the writer
//          commits by itself, within a piece of work, a fault of the machine (a full disk,
//          a lock) is not thrown: trouble() has it, until a Commit succeeds.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "results/database/database.h"
#include "results/database/resume_point.h"
#include "results/system/error.h"

namespace dreamsearch::results {

enum class Phase : int {
  kTraining = 0,
  kSearchEvaluation = 1,  // evaluation with the planner
  kActorEvaluation = 2,   // with the actor alone; all evaluation of a planner that is that
};
inline constexpr int kPhases = 3;

// One training decision. env_step counts environment steps completed after it.
struct StepRow {
  std::int64_t env_step = 0;
  std::int64_t episode = 0;
  std::int64_t t = 0;  // decision in its episode, from 0
  double reward = 0;   // summed over the action repeat
  double value = 0;    // the planner's root value; 0 when nothing was planned
  std::int64_t plan_us = 0;
  std::int64_t simulations = 0;
  std::int64_t nodes = 0;
  std::int64_t depth = 0;
};

struct EpisodeRow {
  Phase phase = Phase::kTraining;
  std::int64_t episode = 0;   // counts from 0 in each phase of the run
  std::int64_t env_step = 0;  // environment steps completed at its end; for an evaluation,
                              //   those of the training it evaluates
  std::int64_t length = 0;    // environment steps
  double episode_return = 0;
  double wall_seconds = 0;  // of an evaluation's episode its share: see README.md
  double plan_us_mean = 0;  // microseconds a decision; of a share as well
  double plan_us_p95 = 0;
  std::int64_t model_transitions = 0;  // transitions its planning imagined
  std::uint64_t digest = 0;            // EpisodeDigest::state()
};

// What a run has spent on an activity so far, in all its segments.
struct TimeUseRow {
  std::int64_t env_step = 0;
  std::string activity;  // one of kActivities
  double seconds = 0;    // of wall time
  // Of all threads of the run's process, and what that time was worth: its product with the
  // segment's gflop_per_second. Evaluations of a trained run do not record them.
  std::optional<double> processor_seconds = std::nullopt;
  std::optional<double> gflop = std::nullopt;
};

struct SegmentInfo {
  std::int64_t pid = 0;
  std::int64_t host_id = 0;
  std::int64_t build_id = 0;    // 0 when unknown
  std::string instruction_set;  // in use by this process
  std::string slurm_job;        // "JOB", of an array "JOB_TASK"; empty outside Slurm
  std::optional<std::int64_t> slurm_restarts = std::nullopt;  // of that job, so far
  std::string slurm_node;                                     // empty outside Slurm
  double gflop_per_second = 0;  // of a large float product on one core, when it began
};

class RunWriter {
 public:
  // The run must exist. Many runs may be written by as many processes; one run has
  // one writer: once a later one has begun a segment, Commit throws Failure 74.
  RunWriter(Database* database, std::int64_t run_id);
  ~RunWriter();  // drops what was not committed
  RunWriter(const RunWriter&) = delete;
  RunWriter& operator=(const RunWriter&) = delete;

  // Opens a segment, sets the run to running and, in the same transaction, deletes
  // what was recorded past `point` and rebuilds bins and digests. Comes first. Events
  // that say how a segment began or ended stay. Failure 65, and nothing has changed, if
  // the rows that would be left are not point.rows.
  void BeginSegment(const SegmentInfo& segment, const ResumePoint& point = {});

  void AddStep(const StepRow& row);
  void AddEpisode(const EpisodeRow& row);
  // The id of a metric, added if it is new; remembered, so it may be asked for again.
  std::int64_t Metric(const std::string& name, const std::string& unit = "",
                      const std::string& doc = "");
  // One value a metric and env_step.
  void AddScalar(std::int64_t env_step, std::int64_t metric_id, double value);
  // Seconds of the whole run so far, over all its segments. `activity` is one of
  // environment, planning, learning, evaluation, recording, other.
  void AddTimeUse(const TimeUseRow& row);
  // level: info, warning or error; kind: a short snake_case name.
  void AddEvent(std::int64_t env_step, const std::string& level, const std::string& kind,
                const std::string& detail);
  // A file of the run; the path is stored relative to the database's folder.
  void AddArtifact(const std::string& path, const std::string& kind, std::int64_t env_step,
                   std::int64_t bytes, const std::string& sha256);

  // Environment steps done; stored, with the heartbeat, by the next commit.
  void SetProgress(std::int64_t env_steps_done);

  // Stores all rows, progress and heartbeat. Call at each episode's end and before
  // each checkpoint.
  void Commit();
  // Commit, but a fault of the machine is kept for trouble() instead of thrown.
  void TryCommit();
  // TryCommit if a second has passed since the last commit, so that a long phase
  // without rows still shows a heartbeat.
  void CommitIfDue();

  // What kept rows from being stored since the last successful commit. Whoever works on the run
  // looks here between two pieces of work and ends it: rows are no longer stored.
  const std::optional<Failure>& trouble() const { return trouble_; }

  // Events the run has as of the last commit, for ResumePoint.
  std::int64_t events() const { return events_; }
  // The run's decisions and episodes as of the last commit.
  const RowSums& rows() const { return rows_; }
  std::int64_t rows_rolled_back() const { return rows_rolled_back_; }

  // Commits and closes the segment. reason: finished, interrupted, ...
  void EndSegment(const std::string& reason, std::int64_t env_step);
  // Commits and stores the result digest and the end of the segment; returns the
  // digest. The status is the supervisor's to set.
  std::string Finish();

 private:
  struct ScalarRow {
    std::int64_t env_step, metric_id;
    double value;
  };
  struct EventRow {
    std::int64_t env_step;
    std::string utc, level, kind, detail;
  };
  struct ArtifactRow {
    std::string path, kind;
    std::int64_t env_step, bytes;
    std::string sha256;
  };
  // Largest keys stored, to tell a new row from one that replaces another without
  // a look into the file.
  struct Stored {
    std::int64_t step = -1;
    std::int64_t episode[kPhases] = {-1, -1, -1};
    std::map<std::int64_t, std::int64_t> scalar;  // env_step by metric
  };
  void CheckFinite(double value, std::int64_t env_step, const char* what);
  void RowAdded();
  void StoreRows(Stored* stored, RowSums* rows, std::int64_t* events);
  void StoreProgress();
  void LoadStored();
  // Throws unless the segment is still the run's last, that is, its writer.
  void CheckOwnership();

  Database* database_;
  Connection& connection_;
  std::int64_t run_id_;
  std::int64_t segment_ = -1;
  std::int64_t env_steps_done_ = 0;
  std::int64_t events_ = 0;
  std::int64_t rows_rolled_back_ = 0;
  Stored stored_;
  RowSums rows_;

  std::optional<Failure> trouble_;
  std::size_t rows_waiting_ = 0;
  std::chrono::steady_clock::time_point last_commit_;
  std::vector<StepRow> steps_;
  std::vector<EpisodeRow> episodes_;
  std::vector<ScalarRow> scalars_;
  std::vector<TimeUseRow> time_uses_;
  std::vector<EventRow> new_events_;
  std::vector<ArtifactRow> artifacts_;
  std::map<std::pair<std::string, std::string>, std::int64_t> metrics_;  // by name and unit
  std::map<std::int64_t, std::uint64_t> metric_digests_;                 // by id

  Statement insert_step_, insert_episode_, insert_scalar_, insert_time_use_, insert_event_,
      insert_artifact_, select_step_, select_episode_, select_scalar_, update_run_, last_segment_;
};

}  // namespace dreamsearch::results
