#include "results/database/derived_rows.h"

#include <bit>
#include <cmath>
#include <limits>

#include "results/database/schema.h"

namespace dreamsearch::results {
namespace {

// Stored values only: what is not finite is NULL, and SQLite may drop the sign
// of zero.
void AddStored(RollingDigest* digest, double value) {
  if (!std::isfinite(value)) {
    digest->AddBits(0x7ff8000000000000ull);
  } else {
    digest->AddBits(value == 0 ? 0 : std::bit_cast<std::uint64_t>(value));
  }
}
void AddStored(RollingDigest* digest, std::int64_t value) {
  digest->AddBits(static_cast<std::uint64_t>(value));
}

}  // namespace

std::uint64_t RowDigest(const StepRow& row) {
  RollingDigest digest(1);
  AddStored(&digest, row.env_step);
  AddStored(&digest, row.episode);
  AddStored(&digest, row.t);
  AddStored(&digest, row.reward);
  AddStored(&digest, row.value);
  AddStored(&digest, row.plan_us);
  AddStored(&digest, row.simulations);
  AddStored(&digest, row.nodes);
  AddStored(&digest, row.depth);
  return digest.state();
}

std::uint64_t RowDigest(const EpisodeRow& row) {
  RollingDigest digest(2);
  AddStored(&digest, static_cast<std::int64_t>(row.phase));
  AddStored(&digest, row.episode);
  AddStored(&digest, row.env_step);
  AddStored(&digest, row.length);
  AddStored(&digest, row.episode_return);
  AddStored(&digest, row.wall_seconds);
  AddStored(&digest, row.plan_us_mean);
  AddStored(&digest, row.plan_us_p95);
  AddStored(&digest, row.model_transitions);
  digest.AddBits(row.digest);
  return digest.state();
}

std::uint64_t SeedDigest(const StepRow& row) {
  StepRow timeless = row;
  timeless.plan_us = 0;
  return RowDigest(timeless);
}

std::uint64_t SeedDigest(const EpisodeRow& row) {
  EpisodeRow timeless = row;
  timeless.wall_seconds = timeless.plan_us_mean = timeless.plan_us_p95 = 0;
  return RowDigest(timeless);
}

std::uint64_t ScalarRowDigest(std::uint64_t metric, std::int64_t env_step, double value) {
  RollingDigest digest(3);
  digest.AddBits(metric);
  AddStored(&digest, env_step);
  AddStored(&digest, value);
  return digest.state();
}

std::uint64_t MetricDigest(const std::string& name, const std::string& unit) {
  RollingDigest digest(4);
  for (const char c : name) digest.AddBits(static_cast<unsigned char>(c));
  digest.AddBits(256);
  for (const char c : unit) digest.AddBits(static_cast<unsigned char>(c));
  return digest.state();
}

double RealOrNan(const Statement& row, int column) {
  return row.IsNull(column) ? std::numeric_limits<double>::quiet_NaN() : row.Real(column);
}

StepRow ReadStep(const Statement& row) {
  return {.env_step = row.Int(0),
          .episode = row.Int(1),
          .t = row.Int(2),
          .reward = RealOrNan(row, 3),
          .value = RealOrNan(row, 4),
          .plan_us = row.Int(5),
          .simulations = row.Int(6),
          .nodes = row.Int(7),
          .depth = row.Int(8)};
}

EpisodeRow ReadEpisode(const Statement& row) {
  return {.phase = static_cast<Phase>(row.Int(0)),
          .episode = row.Int(1),
          .env_step = row.Int(2),
          .length = row.Int(3),
          .episode_return = RealOrNan(row, 4),
          .wall_seconds = RealOrNan(row, 5),
          .plan_us_mean = RealOrNan(row, 6),
          .plan_us_p95 = RealOrNan(row, 7),
          .model_transitions = row.Int(8),
          .digest = static_cast<std::uint64_t>(row.Int(9))};
}

std::int64_t BinOf(std::int64_t env_step) { return (env_step + kBinSteps - 1) / kBinSteps; }

std::int64_t FirstStepOfBin(std::int64_t bin) { return bin <= 0 ? 0 : (bin - 1) * kBinSteps + 1; }

Chunks ComputeChunks(Connection& db, std::int64_t run_id, std::int64_t first_bin) {
  Chunks chunks;
  const std::int64_t first_step = FirstStepOfBin(first_bin);
  Statement steps = db.Prepare(std::string("SELECT ") + kStepColumns +
                               " FROM step WHERE run_id = ?1 AND env_step >= ?2");
  steps.Bind(run_id, first_step);
  while (steps.Step()) {
    const StepRow row = ReadStep(steps);
    chunks[{"step", BinOf(row.env_step)}].Add(RowDigest(row));
  }
  Statement episodes = db.Prepare(std::string("SELECT ") + kEpisodeColumns +
                                  " FROM episode WHERE run_id = ?1 AND env_step >= ?2");
  episodes.Bind(run_id, first_step);
  while (episodes.Step()) {
    const EpisodeRow row = ReadEpisode(episodes);
    chunks[{"episode", BinOf(row.env_step)}].Add(RowDigest(row));
  }
  Statement metrics = db.Prepare("SELECT metric_id, name, unit FROM metric");
  Statement scalars = db.Prepare(
      "SELECT env_step, value FROM scalar WHERE run_id = ?1 AND"
      " metric_id = ?2 AND env_step >= ?3");
  while (metrics.Step()) {
    const std::uint64_t metric = MetricDigest(metrics.Text(1), metrics.Text(2));
    scalars.Bind(run_id, metrics.Int(0), first_step);
    while (scalars.Step()) {
      chunks[{"scalar", BinOf(scalars.Int(0))}].Add(
          ScalarRowDigest(metric, scalars.Int(0), RealOrNan(scalars, 1)));
    }
  }
  return chunks;
}

Chunks ReadChunks(Connection& db, std::int64_t run_id, std::int64_t first_bin) {
  Chunks chunks;
  Statement rows = db.Prepare(
      "SELECT tbl, last_step, n_rows, digest FROM chunk_digest"
      " WHERE run_id = ?1 AND first_step >= ?2");
  rows.Bind(run_id, FirstStepOfBin(first_bin));
  while (rows.Step()) {
    chunks[{rows.Text(0), BinOf(rows.Int(1))}] = {rows.Int(2),
                                                  static_cast<std::uint64_t>(rows.Int(3))};
  }
  return chunks;
}

void ApplyChunks(Connection& db, std::int64_t run_id, const Chunks& differences) {
  // Read, add and write: SQL's + turns into a real number when it overflows.
  Statement read = db.Prepare(
      "SELECT n_rows, digest FROM chunk_digest WHERE run_id = ?1 AND"
      " tbl = ?2 AND first_step = ?3");
  Statement write = db.Prepare(
      "INSERT INTO chunk_digest (run_id, tbl, first_step, last_step,"
      " n_rows, digest) VALUES (?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT DO"
      " UPDATE SET n_rows = excluded.n_rows, digest = excluded.digest");
  Statement remove = db.Prepare(
      "DELETE FROM chunk_digest WHERE run_id = ?1 AND tbl = ?2 AND"
      " first_step = ?3");
  for (const auto& [key, difference] : differences) {
    const auto& [table, bin] = key;
    Chunk chunk = difference;
    if (read.Bind(run_id, table, FirstStepOfBin(bin)).Step()) {
      chunk.rows += read.Int(0);
      chunk.digest += static_cast<std::uint64_t>(read.Int(1));
      read.Reset();
    }
    if (chunk.rows == 0) {
      remove.Bind(run_id, table, FirstStepOfBin(bin)).Run();
    } else {
      write
          .Bind(run_id, table, FirstStepOfBin(bin), bin * kBinSteps, chunk.rows,
                static_cast<std::int64_t>(chunk.digest))
          .Run();
    }
  }
}

void RemakeChunks(Connection& db, std::int64_t run_id, std::int64_t first_bin) {
  db.Prepare("DELETE FROM chunk_digest WHERE run_id = ?1 AND first_step >= ?2")
      .Bind(run_id, FirstStepOfBin(first_bin))
      .Run();
  ApplyChunks(db, run_id, ComputeChunks(db, run_id, first_bin));
}

namespace {

// A query, and the generation of records that it came with: a run that ended before has no rows
// of it, and its record was made without it.
struct RecordQuery {
  const char* sql;
  int since = 0;
};
constexpr RecordQuery kRecord[] = {
    {"SELECT r.uuid, s.name, t.name, t.domain, t.observation_size, t.action_size,"
     " t.control_seconds, t.substeps, t.episode_steps, t.return_low, t.return_high, r.planner,"
     " r.model, e.name, e.version, e.abi, e.file, e.sha256, m.name, m.version, m.abi, m.file,"
     " m.sha256, p.name, p.version, p.abi, p.file, p.sha256, c.sha256, r.preset, r.seed,"
     " r.action_repeat, r.env_steps_target, r.env_steps_done, r.status, parent.uuid, r.exit_code,"
     " r.error, r.argv, b.version, b.commit_hash, b.dirty, b.compiler, b.flags, b.instruction_set,"
     " b.libraries, r.created_utc, r.ended_utc, r.heartbeat_utc, r.result_digest"
     " FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id) JOIN config c USING"
     " (config_id) JOIN build b USING (build_id) LEFT JOIN plugin e ON e.plugin_id = r.env_plugin"
     " LEFT JOIN plugin m ON m.plugin_id = r.model_plugin LEFT JOIN plugin p ON"
     " p.plugin_id = r.planner_plugin LEFT JOIN run parent ON parent.run_id = r.parent_run_id"
     " WHERE r.run_id = ?1"},
    {"SELECT s.segment, h.hostname, h.cpu, h.cores, h.memory_bytes, h.os, b.version, b.commit_hash,"
     " s.instruction_set, s.pid, s.from_env_step, s.to_env_step, s.started_utc, s.ended_utc,"
     " s.end_reason, s.rows_rolled_back, s.slurm_job FROM segment s JOIN host h USING (host_id)"
     " LEFT JOIN build b ON b.build_id = s.build_id WHERE s.run_id = ?1 ORDER BY s.segment"},
    {"SELECT env_step, activity, seconds FROM time_use WHERE run_id = ?1 ORDER BY env_step, "
     "activity"},
    {"SELECT env_step, activity, processor_seconds, gflop FROM time_use WHERE run_id = ?1 AND"
     " processor_seconds IS NOT NULL ORDER BY env_step, activity",
     1},
    {"SELECT segment, gflop_per_second FROM segment WHERE run_id = ?1 AND gflop_per_second IS NOT"
     " NULL ORDER BY segment",
     1},
    {"SELECT segment, slurm_restarts, slurm_node FROM segment WHERE run_id = ?1 AND (slurm_restarts"
     " IS NOT NULL OR slurm_node IS NOT NULL) ORDER BY segment",
     2},
    {"SELECT seq, env_step, utc, level, kind, detail FROM event WHERE run_id = ?1 ORDER BY seq"},
    {"SELECT kind, env_step, bytes, sha256 FROM artifact WHERE run_id = ?1"
     " ORDER BY kind, env_step, sha256, bytes"},
};

}  // namespace

std::optional<Chunk> ComputeRecord(Connection& db, std::int64_t run_id, int generation) {
  RollingDigest digest(5);
  std::int64_t count = 0;
  for (const RecordQuery& query : kRecord) {
    Statement rows = db.Prepare(query.sql);
    rows.Bind(run_id);
    if (query.since > generation) {
      if (rows.Step()) return std::nullopt;
      continue;
    }
    while (rows.Step()) {
      ++count;
      for (int i = 0; i < rows.columns(); ++i) {
        if (rows.IsInt(i)) {
          digest.AddBits(1);
          AddStored(&digest, rows.Int(i));
        } else if (rows.IsReal(i)) {
          digest.AddBits(2);
          AddStored(&digest, rows.Real(i));
        } else if (rows.IsNull(i)) {
          digest.AddBits(3);
        } else {
          digest.AddBits(4);
          const std::string text = rows.Text(i);
          digest.AddBits(text.size());
          for (const char c : text) digest.AddBits(static_cast<unsigned char>(c));
        }
      }
    }
    digest.AddBits(6);
  }
  return Chunk{count, digest.state()};
}

bool RecordIsAsSealed(Connection& db, std::int64_t run_id) {
  const std::optional<Chunk> sealed = ReadRecord(db, run_id);
  if (!sealed) return true;
  for (int generation = kNewestRecord; generation >= 0; --generation) {
    if (ComputeRecord(db, run_id, generation) == sealed) return true;
  }
  return false;
}

std::optional<Chunk> ReadRecord(Connection& db, std::int64_t run_id) {
  Statement row = db.Prepare(
      "SELECT n_rows, digest FROM chunk_digest WHERE run_id = ?1 AND"
      " tbl = 'run'");
  if (!row.Bind(run_id).Step()) return std::nullopt;
  return Chunk{row.Int(0), static_cast<std::uint64_t>(row.Int(1))};
}

void SealRecord(Connection& db, std::int64_t run_id) {
  const Chunk record = *ComputeRecord(db, run_id, kNewestRecord);
  db.Prepare(
        "INSERT INTO chunk_digest (run_id, tbl, first_step, last_step, n_rows, digest)"
        " VALUES (?1, 'run', -1, -1, ?2, ?3) ON CONFLICT DO UPDATE SET"
        " n_rows = excluded.n_rows, digest = excluded.digest")
      .Bind(run_id, record.rows, static_cast<std::int64_t>(record.digest))
      .Run();
}

void UnsealRecord(Connection& db, std::int64_t run_id) {
  db.Prepare("DELETE FROM chunk_digest WHERE run_id = ?1 AND tbl = 'run'").Bind(run_id).Run();
}

void RemakeCurveBins(Connection& db, std::int64_t run_id) {
  db.Prepare("DELETE FROM curve_bin WHERE run_id = ?1").Bind(run_id).Run();
  db.Prepare(
        "INSERT INTO curve_bin SELECT run_id, phase, (env_step + 9999) / 10000,"
        " episode_return IS NOT NULL, ifnull(episode_return, 0.0), episode_return IS NULL"
        " FROM episode WHERE run_id = ?1 ORDER BY phase, episode ON CONFLICT DO UPDATE SET"
        " n = n + excluded.n, sum_return = sum_return + excluded.sum_return,"
        " nonfinite = nonfinite + excluded.nonfinite")
      .Bind(run_id)
      .Run();
}

}  // namespace dreamsearch::results
