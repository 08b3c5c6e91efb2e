// run_writer.cc - over 400 lines: every kind of row has its statement, its queue and its digest,
// and all of them are stored by one transaction.
#include "results/database/run_writer.h"

#include <algorithm>
#include <cmath>

#include "results/database/derived_rows.h"
#include "results/database/schema.h"
#include "results/system/error.h"
#include "results/system/machine_fault.h"

namespace dreamsearch::results {
namespace {

constexpr std::size_t kRowsPerCommit = 1000;
constexpr std::chrono::seconds kCommitInterval{1};

}  // namespace

RunWriter::RunWriter(Database* database, std::int64_t run_id)
    : database_(database),
      connection_(database->connection()),
      run_id_(run_id),
      last_commit_(std::chrono::steady_clock::now()) {
  const std::optional<RunInfo> run = database->GetRun(run_id);
  if (!run) {
    throw Failure(ExitCode::kNotFound,
                  connection_.path() + ": there is no run " + std::to_string(run_id));
  }
  env_steps_done_ = run->env_steps_done;
  // Appending needs few pages; a reader's cache of 16 MB would take hours to fill, and a run's
  // memory would grow as long.
  connection_.Execute("PRAGMA cache_size = -2000");

  insert_step_ = connection_.Prepare(
      "INSERT INTO step (run_id, env_step, episode, t, reward, value, plan_us, simulations, nodes,"
      " depth) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10) ON CONFLICT DO UPDATE SET"
      " episode = excluded.episode, t = excluded.t, reward = excluded.reward,"
      " value = excluded.value, plan_us = excluded.plan_us, simulations = excluded.simulations,"
      " nodes = excluded.nodes, depth = excluded.depth");
  insert_episode_ = connection_.Prepare(
      "INSERT INTO episode (run_id, phase, episode, env_step, length, episode_return, wall_s,"
      " plan_us_mean, plan_us_p95, model_transitions, digest)"
      " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11) ON CONFLICT DO UPDATE SET"
      " env_step = excluded.env_step, length = excluded.length,"
      " episode_return = excluded.episode_return, wall_s = excluded.wall_s,"
      " plan_us_mean = excluded.plan_us_mean, plan_us_p95 = excluded.plan_us_p95,"
      " model_transitions = excluded.model_transitions, digest = excluded.digest");
  insert_scalar_ = connection_.Prepare(
      "INSERT INTO scalar (run_id, metric_id, env_step, value) VALUES (?1, ?2, ?3, ?4)"
      " ON CONFLICT DO UPDATE SET value = excluded.value");
  insert_time_use_ = connection_.Prepare(
      "INSERT INTO time_use (run_id, env_step, activity, seconds, processor_seconds, gflop)"
      " VALUES (?1, ?2, ?3, ?4, ?5, ?6)"
      " ON CONFLICT DO UPDATE SET seconds = excluded.seconds");
  insert_event_ = connection_.Prepare(
      "INSERT INTO event (run_id, seq, env_step, utc, level, kind, detail)"
      " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)");
  insert_artifact_ = connection_.Prepare(
      "INSERT INTO artifact (run_id, path, kind, env_step, bytes, sha256, path_sha256)"
      " VALUES (?1, ?2, ?3, ?4, ?5, ?6, sha256(?2)) ON CONFLICT DO UPDATE SET kind = excluded.kind,"
      " env_step = excluded.env_step, bytes = excluded.bytes, sha256 = excluded.sha256");
  select_step_ = connection_.Prepare(std::string("SELECT ") + kStepColumns +
                                     " FROM step WHERE run_id = ?1 AND env_step = ?2");
  select_episode_ =
      connection_.Prepare(std::string("SELECT ") + kEpisodeColumns +
                          " FROM episode WHERE run_id = ?1 AND phase = ?2 AND episode = ?3");
  select_scalar_ = connection_.Prepare(
      "SELECT value FROM scalar WHERE run_id = ?1 AND metric_id = ?2 AND env_step = ?3");
  update_run_ = connection_.Prepare(
      "UPDATE run SET env_steps_done = ?2, heartbeat_utc = ?3 WHERE run_id = ?1");
  last_segment_ = connection_.Prepare("SELECT max(segment) FROM segment WHERE run_id = ?1");
}

RunWriter::~RunWriter() = default;

void RunWriter::BeginSegment(const SegmentInfo& segment, const ResumePoint& point) {
  // Before the transaction, which others wait for: this process alone writes the run.
  const RowSums rows = RowSumsAt(database_, run_id_, point);
  if (point.rows && *point.rows != rows) {
    throw Failure(ExitCode::kBadInput,
                  connection_.path() + ": run " + std::to_string(run_id_) +
                      " does not have the rows that its checkpoint of environment "
                      "step " +
                      std::to_string(point.env_step) + " was made with.");
  }
  std::int64_t rolled_back = 0;
  std::int64_t number = 0;
  connection_.Transact([&] {
    rolled_back = RollBack(connection_, run_id_, point);
    last_segment_.Bind(run_id_);
    number = last_segment_.Step() ? last_segment_.OptionalInt(0).value_or(-1) + 1 : 0;
    last_segment_.Reset();
    const std::string now = UtcNow();
    connection_
        .Prepare(
            "UPDATE segment SET ended_utc = ?2, end_reason = 'lost', to_env_step ="
            " (SELECT env_steps_done FROM run WHERE run_id = ?1)"
            " WHERE run_id = ?1 AND ended_utc IS NULL")
        .Bind(run_id_, now)
        .Run();
    connection_
        .Prepare(
            "INSERT INTO segment (run_id, segment, host_id, build_id, instruction_set, pid,"
            " from_env_step, started_utc, rows_rolled_back, slurm_job, gflop_per_second,"
            " slurm_restarts, slurm_node)"
            " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)")
        .Bind(run_id_, number, segment.host_id,
              segment.build_id != 0 ? std::optional(segment.build_id) : std::nullopt,
              segment.instruction_set, segment.pid, point.env_step, now, rolled_back,
              segment.slurm_job.empty() ? std::nullopt : std::optional(segment.slurm_job),
              segment.gflop_per_second > 0 ? std::optional(segment.gflop_per_second) : std::nullopt,
              segment.slurm_restarts,
              segment.slurm_node.empty() ? std::nullopt : std::optional(segment.slurm_node))
        .Run();
    connection_
        .Prepare(
            "UPDATE run SET status = 'running', env_steps_done = ?2, heartbeat_utc = ?3,"
            " ended_utc = NULL, exit_code = NULL, error = '', result_digest = NULL"
            " WHERE run_id = ?1")
        .Bind(run_id_, point.env_step, now)
        .Run();
  });
  segment_ = number;
  rows_rolled_back_ = rolled_back;
  env_steps_done_ = point.env_step;
  rows_ = rows;
  LoadStored();
  last_commit_ = std::chrono::steady_clock::now();
}

void RunWriter::LoadStored() {
  stored_ = {};
  Statement step = connection_.Prepare("SELECT max(env_step) FROM step WHERE run_id = ?1");
  if (step.Bind(run_id_).Step()) stored_.step = step.OptionalInt(0).value_or(-1);
  Statement episodes = connection_.Prepare(
      "SELECT phase, max(episode) FROM episode WHERE run_id = ?1 GROUP BY phase");
  episodes.Bind(run_id_);
  while (episodes.Step()) stored_.episode[episodes.Int(0)] = episodes.Int(1);
  Statement scalars = connection_.Prepare(
      "SELECT metric_id, max(env_step) FROM scalar WHERE run_id = ?1 GROUP BY metric_id");
  scalars.Bind(run_id_);
  while (scalars.Step()) stored_.scalar[scalars.Int(0)] = scalars.Int(1);
  Statement events =
      connection_.Prepare("SELECT ifnull(max(seq) + 1, 0) FROM event WHERE run_id = ?1");
  if (events.Bind(run_id_).Step()) events_ = events.Int(0);
}

void RunWriter::CheckFinite(double value, std::int64_t env_step, const char* what) {
  if (std::isfinite(value)) return;
  AddEvent(env_step, "warning", "not_finite",
           std::string(what) + " is " +
               (std::isnan(value) ? "NaN"
                : value > 0       ? "+infinity"
                                  : "-infinity") +
               "; stored as NULL");
}

void RunWriter::RowAdded() {
  if (++rows_waiting_ >= kRowsPerCommit) {
    if (!trouble_) TryCommit();
  } else {
    CommitIfDue();
  }
}

void RunWriter::AddStep(const StepRow& row) {
  CheckFinite(row.reward, row.env_step, "step.reward");
  CheckFinite(row.value, row.env_step, "step.value");
  steps_.push_back(row);
  RowAdded();
}

void RunWriter::AddEpisode(const EpisodeRow& row) {
  CheckFinite(row.episode_return, row.env_step, "episode.episode_return");
  CheckFinite(row.wall_seconds, row.env_step, "episode.wall_s");
  CheckFinite(row.plan_us_mean, row.env_step, "episode.plan_us_mean");
  CheckFinite(row.plan_us_p95, row.env_step, "episode.plan_us_p95");
  episodes_.push_back(row);
  RowAdded();
}

std::int64_t RunWriter::Metric(const std::string& name, const std::string& unit,
                               const std::string& doc) {
  const auto known = metrics_.find({name, unit});
  if (known != metrics_.end()) return known->second;
  std::int64_t id = 0;
  connection_.Transact([&] {
    connection_
        .Prepare(
            "INSERT INTO metric (name, unit, doc, doc_sha256) VALUES (?1, ?2, ?3, sha256(?3))"
            " ON CONFLICT DO NOTHING")
        .Bind(name, unit, doc)
        .Run();
    Statement find =
        connection_.Prepare("SELECT metric_id FROM metric WHERE name = ?1 AND unit = ?2");
    find.Bind(name, unit).Step();
    id = find.Int(0);
  });
  metrics_[{name, unit}] = id;
  metric_digests_[id] = MetricDigest(name, unit);
  return id;
}

void RunWriter::AddScalar(std::int64_t env_step, std::int64_t metric_id, double value) {
  if (metric_digests_.find(metric_id) == metric_digests_.end()) {
    throw Failure(ExitCode::kInternal, "metric " + std::to_string(metric_id) +
                                           " was not asked for with RunWriter::Metric");
  }
  if (!std::isfinite(value)) {
    for (const auto& [name, id] : metrics_) {
      if (id == metric_id) CheckFinite(value, env_step, ("scalar " + name.first).c_str());
    }
  }
  scalars_.push_back({env_step, metric_id, value});
  RowAdded();
}

void RunWriter::AddTimeUse(const TimeUseRow& row) {
  if (std::find(kActivities.begin(), kActivities.end(), row.activity) == kActivities.end()) {
    throw Failure(ExitCode::kInternal, "no activity '" + row.activity +
                                           "'. Known: environment, planning, learning, evaluation, "
                                           "recording, other");
  }
  CheckFinite(row.seconds, row.env_step, "time_use.seconds");
  time_uses_.push_back(row);
  RowAdded();
}

void RunWriter::AddEvent(std::int64_t env_step, const std::string& level, const std::string& kind,
                         const std::string& detail) {
  if (level != "info" && level != "warning" && level != "error") {
    throw Failure(ExitCode::kInternal,
                  "no event level '" + level + "'. Known: info, warning, error");
  }
  new_events_.push_back({env_step, UtcNow(), level, kind, detail});
  ++rows_waiting_;  // committed with the row it belongs to
}

void RunWriter::AddArtifact(const std::string& path, const std::string& kind, std::int64_t env_step,
                            std::int64_t bytes, const std::string& sha256) {
  artifacts_.push_back({database_->RelativePath(path), kind, env_step, bytes, sha256});
  RowAdded();
}

void RunWriter::SetProgress(std::int64_t env_steps_done) { env_steps_done_ = env_steps_done; }

void RunWriter::CheckOwnership() {
  last_segment_.Bind(run_id_);
  const std::int64_t last = last_segment_.Step() ? last_segment_.OptionalInt(0).value_or(-1) : -1;
  last_segment_.Reset();
  if (segment_ < 0) {
    throw Failure(ExitCode::kInternal,
                  "RunWriter::BeginSegment comes before anything is committed");
  }
  if (last != segment_) {
    throw Failure(ExitCode::kInputOutput,
                  connection_.path() + ": run " + std::to_string(run_id_) +
                      (last < 0 ? " was deleted"
                                : " was taken over by another "
                                  "process") +
                      " while this process worked on it. Only one process may work on a run.");
  }
}

void RunWriter::StoreRows(Stored* stored, RowSums* rows, std::int64_t* events) {
  Chunks chunks;
  // A key at or below the largest stored one may replace a row, whose digest must
  // then leave its chunk.
  for (const StepRow& row : steps_) {
    if (row.env_step <= stored->step) {
      if (select_step_.Bind(run_id_, row.env_step).Step()) {
        const StepRow old = ReadStep(select_step_);
        chunks[{"step", BinOf(old.env_step)}].Remove(RowDigest(old));
        rows->Remove(old);
        select_step_.Reset();
      }
    } else {
      stored->step = row.env_step;
    }
    insert_step_
        .Bind(run_id_, row.env_step, row.episode, row.t, row.reward, row.value, row.plan_us,
              row.simulations, row.nodes, row.depth)
        .Run();
    chunks[{"step", BinOf(row.env_step)}].Add(RowDigest(row));
    rows->Add(row);
  }
  for (const EpisodeRow& row : episodes_) {
    const int phase = static_cast<int>(row.phase);
    if (row.episode <= stored->episode[phase]) {
      if (select_episode_.Bind(run_id_, phase, row.episode).Step()) {
        const EpisodeRow old = ReadEpisode(select_episode_);
        chunks[{"episode", BinOf(old.env_step)}].Remove(RowDigest(old));
        rows->Remove(old);
        select_episode_.Reset();
      }
    } else {
      stored->episode[phase] = row.episode;
    }
    insert_episode_
        .Bind(run_id_, phase, row.episode, row.env_step, row.length, row.episode_return,
              row.wall_seconds, row.plan_us_mean, row.plan_us_p95, row.model_transitions,
              static_cast<std::int64_t>(row.digest))
        .Run();
    chunks[{"episode", BinOf(row.env_step)}].Add(RowDigest(row));
    rows->Add(row);
  }
  for (const ScalarRow& row : scalars_) {
    const std::uint64_t metric = metric_digests_.at(row.metric_id);
    const auto [largest, first] = stored->scalar.try_emplace(row.metric_id, row.env_step);
    if (!first && row.env_step <= largest->second) {
      if (select_scalar_.Bind(run_id_, row.metric_id, row.env_step).Step()) {
        const double old = RealOrNan(select_scalar_, 0);
        chunks[{"scalar", BinOf(row.env_step)}].Remove(ScalarRowDigest(metric, row.env_step, old));
        select_scalar_.Reset();
      }
    }
    largest->second = std::max(largest->second, row.env_step);
    insert_scalar_.Bind(run_id_, row.metric_id, row.env_step, row.value).Run();
    chunks[{"scalar", BinOf(row.env_step)}].Add(ScalarRowDigest(metric, row.env_step, row.value));
  }
  ApplyChunks(connection_, run_id_, chunks);

  for (const TimeUseRow& row : time_uses_) {
    insert_time_use_
        .Bind(run_id_, row.env_step, row.activity, row.seconds, row.processor_seconds, row.gflop)
        .Run();
  }
  if (!new_events_.empty()) {
    // The supervisor may have added some.
    Statement next =
        connection_.Prepare("SELECT ifnull(max(seq) + 1, 0) FROM event WHERE run_id = ?1");
    next.Bind(run_id_).Step();
    *events = next.Int(0);
    next.Reset();
  }
  for (const EventRow& row : new_events_) {
    insert_event_.Bind(run_id_, (*events)++, row.env_step, row.utc, row.level, row.kind, row.detail)
        .Run();
  }
  for (const ArtifactRow& row : artifacts_) {
    insert_artifact_.Bind(run_id_, row.path, row.kind, row.env_step, row.bytes, row.sha256).Run();
  }
}

void RunWriter::StoreProgress() { update_run_.Bind(run_id_, env_steps_done_, UtcNow()).Run(); }

void RunWriter::Commit() {
  Stored stored = stored_;
  RowSums rows = rows_;
  std::int64_t events = events_;
  connection_.Transact([&] {
    CheckOwnership();
    UnsealRecord(connection_, run_id_);
    StoreRows(&stored, &rows, &events);
    StoreProgress();
  });
  trouble_.reset();
  stored_ = std::move(stored);
  rows_ = rows;
  events_ = events;
  steps_.clear();
  episodes_.clear();
  scalars_.clear();
  time_uses_.clear();
  new_events_.clear();
  artifacts_.clear();
  rows_waiting_ = 0;
  last_commit_ = std::chrono::steady_clock::now();
}

void RunWriter::TryCommit() {
  try {
    Commit();
  } catch (const Failure& error) {
    if (!IsOfTheMachine(error.code())) throw;
    trouble_ = error;
  }
}

void RunWriter::CommitIfDue() {
  if (trouble_) return;
  if (std::chrono::steady_clock::now() - last_commit_ >= kCommitInterval) TryCommit();
}

void RunWriter::EndSegment(const std::string& reason, std::int64_t env_step) {
  SetProgress(env_step);
  Commit();
  connection_.Transact([&] {
    CheckOwnership();
    connection_
        .Prepare(
            "UPDATE segment SET to_env_step = ?3, ended_utc = ?4, end_reason = ?5"
            " WHERE run_id = ?1 AND segment = ?2")
        .Bind(run_id_, segment_, env_step, UtcNow(), reason)
        .Run();
  });
}

std::string RunWriter::Finish() {
  Commit();
  std::string digest;
  connection_.Transact([&] {
    CheckOwnership();
    digest = database_->ComputeResultDigest(run_id_);
    connection_.Prepare("UPDATE run SET result_digest = ?2 WHERE run_id = ?1")
        .Bind(run_id_, digest)
        .Run();
    connection_
        .Prepare(
            "UPDATE segment SET to_env_step = ?3, ended_utc = ?4, end_reason = 'finished'"
            " WHERE run_id = ?1 AND segment = ?2")
        .Bind(run_id_, segment_, env_steps_done_, UtcNow())
        .Run();
  });
  return digest;
}

}  // namespace dreamsearch::results
