// derived_rows.h - the rows that follow from others: curve_bin from episode, and
// chunk_digest from step, episode and scalar.
//
// A chunk is the rows of one run and table whose env_step lies in one bin. Its
// digest is the sum, modulo 2^64, of the digests of its rows, so it does not
// depend on their order and a row can be taken out again. Digests know a metric
// by its name, never by an id, so they survive a merge.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "results/database/run_writer.h"
#include "results/database/sqlite.h"

namespace dreamsearch::results {

std::uint64_t RowDigest(const StepRow& row);
std::uint64_t RowDigest(const EpisodeRow& row);
// The same of what the seed decides, that is without the times.
std::uint64_t SeedDigest(const StepRow& row);
std::uint64_t SeedDigest(const EpisodeRow& row);
// metric: MetricDigest of the metric's name and unit.
std::uint64_t ScalarRowDigest(std::uint64_t metric, std::int64_t env_step, double value);
std::uint64_t MetricDigest(const std::string& name, const std::string& unit);

// Rows as stored; a NULL is read as NaN.
inline constexpr char kStepColumns[] =
    "env_step, episode, t, reward, value, plan_us, simulations, nodes, depth";
inline constexpr char kEpisodeColumns[] =
    "phase, episode, env_step, length, episode_return, wall_s, plan_us_mean, plan_us_p95,"
    " model_transitions, digest";
StepRow ReadStep(const Statement& row);
EpisodeRow ReadEpisode(const Statement& row);
double RealOrNan(const Statement& row, int column);

struct Chunk {
  std::int64_t rows = 0;
  std::uint64_t digest = 0;

  void Add(std::uint64_t row) {
    ++rows;
    digest += row;
  }
  void Remove(std::uint64_t row) {
    --rows;
    digest -= row;
  }
  bool operator==(const Chunk&) const = default;
};

// Chunks by table name and bin.
using Chunks = std::map<std::pair<std::string, std::int64_t>, Chunk>;

std::int64_t BinOf(std::int64_t env_step);
std::int64_t FirstStepOfBin(std::int64_t bin);

// What the stored rows of a run's bins first_bin and later amount to.
Chunks ComputeChunks(Connection& db, std::int64_t run_id, std::int64_t first_bin);
// What chunk_digest says of them.
Chunks ReadChunks(Connection& db, std::int64_t run_id, std::int64_t first_bin);

// Adds the differences to the stored chunks; chunks without rows are deleted.
void ApplyChunks(Connection& db, std::int64_t run_id, const Chunks& differences);
// Replaces the stored chunks of first_bin and later by what the rows amount to.
void RemakeChunks(Connection& db, std::int64_t run_id, std::int64_t first_bin);

// A run that has ended has one more row of chunk_digest, `tbl` being 'run' and the
// steps -1: the digest of its record, that is of everything else there is about it
// (its row, task, plugins, build, segments with their hosts, times, events, files).
// Names stand in it, never ids or folders, so it too survives a merge. As a program of a generation
// of records makes it; none if the run has rows that such a program did not know.
inline constexpr int kNewestRecord = 2;
std::optional<Chunk> ComputeRecord(Connection& db, std::int64_t run_id, int generation);
// True also for a run without a record, and for one that a program of before ended.
bool RecordIsAsSealed(Connection& db, std::int64_t run_id);
std::optional<Chunk> ReadRecord(Connection& db, std::int64_t run_id);
void SealRecord(Connection& db, std::int64_t run_id);
// To be called before anything in the record changes.
void UnsealRecord(Connection& db, std::int64_t run_id);

void RemakeCurveBins(Connection& db, std::int64_t run_id);

}  // namespace dreamsearch::results
