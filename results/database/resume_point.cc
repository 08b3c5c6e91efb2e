#include "results/database/resume_point.h"

#include <algorithm>
#include <string>
#include <utility>

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

void CopyRows(Database* database, std::int64_t from_run, std::int64_t to_run,
              const ResumePoint& point) {
  Connection& db = database->connection();
  const auto copy = [&](const char* table, const char* columns, const char* condition,
                        std::int64_t limit) {
    const std::string names = columns;
    db.Prepare(std::string("INSERT INTO ") + table + " (run_id, " + names + ") SELECT ?1, " +
               names + " FROM " + table + " WHERE run_id = ?2 AND " + condition)
        .Bind(to_run, from_run, limit)
        .Run();
  };
  db.Transact([&] {
    // What a call that was followed by the end of its process has left.
    for (const char* table :
         {"curve_bin", "step", "episode", "scalar", "time_use", "event", "segment"}) {
      db.Prepare(std::string("DELETE FROM ") + table + " WHERE run_id = ?1").Bind(to_run).Run();
    }
    const std::int64_t last = LastKept(point);
    copy("step", "env_step, episode, t, reward, value, plan_us, simulations, nodes, depth",
         "env_step <= ?3", last);
    const std::pair<const char*, std::int64_t> phases[] = {
        {"phase = 0 AND episode < ?3", point.training_episodes},
        {"phase = 1 AND episode < ?3", point.search_evaluation_episodes},
        {"phase = 2 AND episode < ?3", point.actor_evaluation_episodes}};
    for (const auto& [condition, episodes] : phases) {
      copy("episode",
           "phase, episode, env_step, length, episode_return, wall_s, plan_us_mean, plan_us_p95,"
           " model_transitions, digest",
           condition, episodes);
    }
    copy("scalar", "metric_id, env_step, value", "env_step <= ?3", last);
    copy("time_use", "env_step, activity, seconds, processor_seconds, gflop", "env_step <= ?3",
         last);
    copy("event", "seq, env_step, utc, level, kind, detail", "seq < ?3", point.events);
    copy("segment",
         "segment, host_id, build_id, instruction_set, pid, from_env_step, to_env_step,"
         " started_utc, ended_utc, end_reason, rows_rolled_back, slurm_job, gflop_per_second,"
         " slurm_restarts, slurm_node",
         "from_env_step <= ?3", point.env_step);
    db.Prepare(
          "UPDATE segment SET to_env_step = ?2, end_reason = 'extended' WHERE run_id = ?1 AND"
          " (to_env_step IS NULL OR to_env_step > ?2)")
        .Bind(to_run, point.env_step)
        .Run();
    RemakeCurveBins(db, to_run);
    RemakeChunks(db, to_run, 0);
    db.Prepare("UPDATE run SET env_steps_done = ?2 WHERE run_id = ?1")
        .Bind(to_run, point.env_step)
        .Run();
  });
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
        " 'damaged_checkpoint', 'diverged', 'extension', 'failed', 'interrupted', 'killed',"
        " 'resume', 'retry',"
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
