// resume_point.h - the rows that a checkpoint has seen, and going back to them.
#pragma once

#include <cstdint>
#include <optional>

#include "results/database/sqlite.h"

namespace dreamsearch::results {

class Database;
struct EpisodeRow;
struct StepRow;

// The decisions and episodes of a run in short: how many there are, and the sums of
// digests over all that the seed decides, times left out. A checkpoint carries those of
// the rows that were there when it was made, so it can be told whether a database still
// has them: every one, and no others.
struct RowSums {
  std::int64_t steps = 0;
  std::int64_t episodes = 0;
  std::uint64_t steps_digest = 0;
  std::uint64_t episodes_digest = 0;

  void Add(const StepRow& row);
  void Add(const EpisodeRow& row);
  void Remove(const StepRow& row);
  void Remove(const EpisodeRow& row);
  bool operator==(const RowSums&) const = default;
};

// What a checkpoint has seen. The default is the start of the run: nothing.
struct ResumePoint {
  std::int64_t env_step = 0;
  std::int64_t training_episodes = 0;  // finished ones: their indices are below
  std::int64_t search_evaluation_episodes = 0;
  std::int64_t actor_evaluation_episodes = 0;
  std::int64_t events = 0;      // RunWriter::events() when the checkpoint was made
  std::optional<RowSums> rows;  // RunWriter::rows() then
};

// What the database has of the rows that a checkpoint has seen.
RowSums RowSumsAt(Database* database, std::int64_t run_id, const ResumePoint& point);

// Gives a run that has made no checkpoint the rows that one of another run, of the same task and
// seed, has seen: decisions, episodes, scalars, times, events, and the segments that made them. In
// one transaction.
void CopyRows(Database* database, std::int64_t from_run, std::int64_t to_run,
              const ResumePoint& point);

// Within a transaction: deletes what was recorded of the run past the point, and remakes the
// bins and digests of what is left. Events that say how a segment began or ended stay.
// Returns how many rows it deleted, those of bins not counted.
std::int64_t RollBack(Connection& db, std::int64_t run_id, const ResumePoint& point);

}  // namespace dreamsearch::results
