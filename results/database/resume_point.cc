#include "results/database/resume_point.h"

#include <algorithm>
#include <string>

#include "results/database/derived_rows.h"

namespace dreamsearch::results {
namespace {

bool IsStart(const ResumePoint& point) {
  return point.env_step == 0 && point.training_episodes == 0 &&
         point.search_evaluation_episodes == 0 && point.actor_evaluation_episodes == 0 &&
         point.events == 0;
}

// From the start even the rows of env_step 0 go.
std::int64_t LastKept(const ResumePoint& point) { return IsStart(point) ? -1 : point.env_step; }

}  // namespace

void RowSums::Add(const StepRow& row) {
  ++steps;
  steps_digest += SeedDigest(row);
}
void RowSums::Add(const EpisodeRow& row) {
  ++episodes;
  episodes_digest += SeedDigest(row);
}
void RowSums::Remove(const StepRow& row) {
  --steps;
  steps_digest -= SeedDigest(row);
}
void RowSums::Remove(const EpisodeRow& row) {
  --episodes;
  episodes_digest -= SeedDigest(row);
}

RowSums RowSumsAt(Database* database, std::int64_t run_id, const ResumePoint& point) {
  Connection& db = database->connection();
  RowSums rows;
  Statement steps = db.Prepare(std::string("SELECT ") + kStepColumns +
                               " FROM step WHERE run_id = ?1 AND env_step <= ?2");
  steps.Bind(run_id, LastKept(point));
  while (steps.Step()) rows.Add(ReadStep(steps));
  Statement episodes = db.Prepare(std::string("SELECT ") + kEpisodeColumns +
                                  " FROM episode WHERE run_id = ?1 AND episode <"
                                  " CASE phase WHEN 0 THEN ?2 WHEN 1 THEN ?3 ELSE ?4 END");
  episodes.Bind(run_id, point.training_episodes, point.search_evaluation_episodes,
                point.actor_evaluation_episodes);
  while (episodes.Step()) rows.Add(ReadEpisode(episodes));
  return rows;
}

std::int64_t RollBack(Connection& db, std::int64_t run_id, const ResumePoint& point) {
  const std::int64_t last_kept = LastKept(point);
  std::int64_t rolled_back = 0;
  Statement doomed = db.Prepare(
      "SELECT min(env_step) FROM episode WHERE run_id = ?1 AND episode >="
      " CASE phase WHEN 0 THEN ?2 WHEN 1 THEN ?3 ELSE ?4 END");
  doomed.Bind(run_id, point.training_episodes, point.search_evaluation_episodes,
              point.actor_evaluation_episodes);
  doomed.Step();
  const std::int64_t first_touched =
      std::max<std::int64_t>(0, std::min(last_kept, doomed.OptionalInt(0).value_or(last_kept)));
  doomed.Reset();

  // The bins go first, so that no trigger maintains what is remade below.
  db.Prepare("DELETE FROM curve_bin WHERE run_id = ?1").Bind(run_id).Run();
  db.Prepare(
        "DELETE FROM episode WHERE run_id = ?1 AND episode >="
        " CASE phase WHEN 0 THEN ?2 WHEN 1 THEN ?3 ELSE ?4 END")
      .Bind(run_id, point.training_episodes, point.search_evaluation_episodes,
            point.actor_evaluation_episodes)
      .Run();
  rolled_back += db.Changes();
  for (const char* table : {"step", "scalar", "time_use", "artifact"}) {
    db.Prepare(std::string("DELETE FROM ") + table + " WHERE run_id = ?1 AND env_step > ?2")
        .Bind(run_id, last_kept)
        .Run();
    rolled_back += db.Changes();
  }
  // What ended a segment and what began one stays; other events go with their rows.
  db.Prepare(
        "DELETE FROM event WHERE run_id = ?1 AND seq >= ?2 AND kind NOT IN ('crashed',"
        " 'damaged_checkpoint', 'diverged', 'failed', 'interrupted', 'killed', 'resume',"
        " 'unused_checkpoint')")
      .Bind(run_id, point.events)
      .Run();
  rolled_back += db.Changes();
  UnsealRecord(db, run_id);
  RemakeCurveBins(db, run_id);
  RemakeChunks(db, run_id, BinOf(first_touched));
  return rolled_back;
}

}  // namespace dreamsearch::results
