// Over 400 lines: the tables, triggers and views, which are SQL, in the order of their versions.
#include "results/database/schema.h"

namespace dreamsearch::results {
namespace {

// Bin of an env_step: ceil(env_step / 10000) for env_step >= 0.
#define BIN(row) "(" row ".env_step + 9999) / 10000"

constexpr char kTables[] = R"sql(
CREATE TABLE study (
  study_id     INTEGER PRIMARY KEY,
  name         TEXT NOT NULL UNIQUE,
  description  TEXT NOT NULL,
  created_utc  TEXT NOT NULL
) STRICT;

CREATE TABLE task (
  task_id          INTEGER PRIMARY KEY,
  name             TEXT NOT NULL UNIQUE,
  domain           TEXT NOT NULL,
  observation_size INTEGER NOT NULL,
  action_size      INTEGER NOT NULL,
  control_seconds  REAL NOT NULL,
  substeps         INTEGER NOT NULL,
  episode_steps    INTEGER NOT NULL,
  return_low       REAL,
  return_high      REAL
) STRICT;

CREATE TABLE plugin (
  plugin_id  INTEGER PRIMARY KEY,
  name       TEXT NOT NULL,
  version    TEXT NOT NULL,
  abi        TEXT NOT NULL,
  file       TEXT NOT NULL,
  sha256     TEXT NOT NULL,
  UNIQUE (name, version, abi, file, sha256)
) STRICT;

CREATE TABLE config (
  config_id  INTEGER PRIMARY KEY,
  sha256     TEXT NOT NULL UNIQUE,
  json       TEXT NOT NULL
) STRICT;

CREATE TABLE build (
  build_id        INTEGER PRIMARY KEY,
  version         TEXT NOT NULL,
  commit_hash     TEXT NOT NULL,
  dirty           INTEGER NOT NULL,
  compiler        TEXT NOT NULL,
  flags           TEXT NOT NULL,
  instruction_set TEXT NOT NULL,
  libraries       TEXT NOT NULL,
  UNIQUE (version, commit_hash, dirty, compiler, flags, instruction_set, libraries)
) STRICT;

CREATE TABLE host (
  host_id      INTEGER PRIMARY KEY,
  hostname     TEXT NOT NULL,
  cpu          TEXT NOT NULL,
  cores        INTEGER NOT NULL,
  memory_bytes INTEGER NOT NULL,
  os           TEXT NOT NULL,
  UNIQUE (hostname, cpu, cores, memory_bytes, os)
) STRICT;

CREATE TABLE run (
  run_id           INTEGER PRIMARY KEY,
  uuid             TEXT NOT NULL UNIQUE,
  study_id         INTEGER NOT NULL REFERENCES study,
  task_id          INTEGER NOT NULL REFERENCES task,
  planner          TEXT NOT NULL,
  model            TEXT NOT NULL,
  env_plugin       INTEGER REFERENCES plugin,
  model_plugin     INTEGER REFERENCES plugin,
  planner_plugin   INTEGER REFERENCES plugin,
  config_id        INTEGER NOT NULL REFERENCES config,
  preset           TEXT NOT NULL,
  seed             INTEGER NOT NULL,
  action_repeat    INTEGER NOT NULL,
  env_steps_target INTEGER NOT NULL,
  env_steps_done   INTEGER NOT NULL DEFAULT 0,
  status           TEXT NOT NULL DEFAULT 'queued' CHECK (status IN
    ('queued', 'running', 'finished', 'interrupted', 'failed', 'crashed', 'diverged', 'killed')),
  parent_run_id    INTEGER REFERENCES run ON DELETE CASCADE,
  log_path         TEXT NOT NULL,
  exit_code        INTEGER,
  error            TEXT NOT NULL DEFAULT '',
  argv             TEXT NOT NULL,
  build_id         INTEGER NOT NULL REFERENCES build,
  created_utc      TEXT NOT NULL,
  ended_utc        TEXT,
  heartbeat_utc    TEXT,
  result_digest    TEXT
) STRICT;
-- Evaluations of a trained run have a key space of their own below it.
CREATE UNIQUE INDEX run_key ON run (study_id, task_id, planner, model, config_id, seed,
                                    action_repeat, ifnull(parent_run_id, 0));
CREATE INDEX run_parent ON run (parent_run_id) WHERE parent_run_id IS NOT NULL;

CREATE TABLE segment (
  run_id           INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  segment          INTEGER NOT NULL,
  host_id          INTEGER NOT NULL REFERENCES host,
  build_id         INTEGER REFERENCES build,
  instruction_set  TEXT NOT NULL,
  pid              INTEGER NOT NULL,
  from_env_step    INTEGER NOT NULL,
  to_env_step      INTEGER,
  started_utc      TEXT NOT NULL,
  ended_utc        TEXT,
  end_reason       TEXT,
  rows_rolled_back INTEGER NOT NULL,
  slurm_job        TEXT,
  PRIMARY KEY (run_id, segment)
) STRICT, WITHOUT ROWID;

CREATE TABLE step (
  run_id      INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  env_step    INTEGER NOT NULL,
  episode     INTEGER NOT NULL,
  t           INTEGER NOT NULL,
  reward      REAL,
  value       REAL,
  plan_us     INTEGER NOT NULL,
  simulations INTEGER NOT NULL,
  nodes       INTEGER NOT NULL,
  depth       INTEGER NOT NULL,
  PRIMARY KEY (run_id, env_step)
) STRICT, WITHOUT ROWID;

CREATE TABLE episode (
  run_id            INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  phase             INTEGER NOT NULL CHECK (phase IN (0, 1, 2)),
  episode           INTEGER NOT NULL,
  env_step          INTEGER NOT NULL,
  length            INTEGER NOT NULL,
  episode_return    REAL,
  wall_s            REAL,
  plan_us_mean      REAL,
  plan_us_p95       REAL,
  model_transitions INTEGER NOT NULL,
  digest            INTEGER NOT NULL,
  PRIMARY KEY (run_id, phase, episode)
) STRICT, WITHOUT ROWID;

CREATE TABLE metric (
  metric_id  INTEGER PRIMARY KEY,
  name       TEXT NOT NULL,
  unit       TEXT NOT NULL,
  doc        TEXT NOT NULL,
  UNIQUE (name, unit)
) STRICT;

CREATE TABLE scalar (
  run_id     INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  metric_id  INTEGER NOT NULL REFERENCES metric,
  env_step   INTEGER NOT NULL,
  value      REAL,
  PRIMARY KEY (run_id, metric_id, env_step)
) STRICT, WITHOUT ROWID;

CREATE TABLE time_use (
  run_id     INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  env_step   INTEGER NOT NULL,
  activity   TEXT NOT NULL CHECK (activity IN
    ('environment', 'planning', 'learning', 'evaluation', 'recording', 'other')),
  seconds    REAL,
  PRIMARY KEY (run_id, env_step, activity)
) STRICT, WITHOUT ROWID;

CREATE TABLE curve_bin (
  run_id       INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  phase        INTEGER NOT NULL,
  env_step_bin INTEGER NOT NULL,
  n            INTEGER NOT NULL,
  sum_return   REAL NOT NULL,
  nonfinite    INTEGER NOT NULL,
  PRIMARY KEY (run_id, phase, env_step_bin)
) STRICT, WITHOUT ROWID;

CREATE TABLE published (
  source         TEXT NOT NULL,
  method         TEXT NOT NULL,
  obs            TEXT NOT NULL,
  task           TEXT NOT NULL,
  env_steps      INTEGER NOT NULL,
  seed           INTEGER,  -- NULL: a mean over n_seeds seeds
  episode_return REAL,
  n_seeds        INTEGER,
  seed_sd        REAL
) STRICT;
CREATE UNIQUE INDEX published_key ON published (source, method, obs, task, ifnull(seed, -1),
                                                env_steps);

CREATE TABLE event (
  run_id    INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  seq       INTEGER NOT NULL,
  env_step  INTEGER NOT NULL,
  utc       TEXT NOT NULL,
  level     TEXT NOT NULL CHECK (level IN ('info', 'warning', 'error')),
  kind      TEXT NOT NULL,
  detail    TEXT NOT NULL,
  PRIMARY KEY (run_id, seq)
) STRICT, WITHOUT ROWID;

CREATE TABLE artifact (
  run_id    INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  path      TEXT NOT NULL,
  kind      TEXT NOT NULL,
  env_step  INTEGER NOT NULL,
  bytes     INTEGER NOT NULL,
  sha256    TEXT NOT NULL,
  PRIMARY KEY (run_id, path)
) STRICT, WITHOUT ROWID;

CREATE TABLE chunk_digest (
  run_id     INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  tbl        TEXT NOT NULL CHECK (tbl IN ('step', 'episode', 'scalar')),
  first_step INTEGER NOT NULL,
  last_step  INTEGER NOT NULL,
  n_rows     INTEGER NOT NULL,
  digest     INTEGER NOT NULL,
  PRIMARY KEY (run_id, tbl, first_step)
) STRICT, WITHOUT ROWID;
)sql";

// The bins follow the episodes. A sum is always that of the bin's returns added
// in the order of their keys, whatever was inserted, replaced or deleted before,
// so that a rebuilt bin has the bits of one that grew.
#define REMAKE_BIN(row) \
  "DELETE FROM curve_bin WHERE run_id = " row ".run_id AND phase = " row                        \
  ".phase AND env_step_bin = " BIN(row) ";\n"                                                   \
  "INSERT INTO curve_bin SELECT e.run_id, e.phase, " BIN(row) ", e.episode_return IS NOT NULL," \
  " ifnull(e.episode_return, 0.0), e.episode_return IS NULL FROM episode e"                     \
  " WHERE e.run_id = " row ".run_id AND e.phase = " row ".phase AND " BIN("e") " = " BIN(row)   \
  " ORDER BY e.episode"                                                                         \
  " ON CONFLICT DO UPDATE SET n = n + excluded.n, sum_return = sum_return + excluded.sum_return," \
  " nonfinite = nonfinite + excluded.nonfinite;\n"

constexpr char kTriggers[] =
    "CREATE TRIGGER episode_inserted AFTER INSERT ON episode BEGIN\n"
    "INSERT INTO curve_bin VALUES (NEW.run_id, NEW.phase, " BIN("NEW")
    ", NEW.episode_return IS NOT NULL, ifnull(NEW.episode_return, 0.0),"
    " NEW.episode_return IS NULL)\n"
    "ON CONFLICT DO UPDATE SET n = n + excluded.n, sum_return = sum_return + excluded.sum_return,"
    " nonfinite = nonfinite + excluded.nonfinite;\nEND;\n"
    "CREATE TRIGGER episode_updated AFTER UPDATE ON episode BEGIN\n"
    REMAKE_BIN("OLD") REMAKE_BIN("NEW") "END;\n"
    // Whoever deletes many episodes deletes their bins first, and this does nothing.
    "CREATE TRIGGER episode_deleted AFTER DELETE ON episode WHEN EXISTS (SELECT 1 FROM curve_bin"
    " WHERE run_id = OLD.run_id AND phase = OLD.phase AND env_step_bin = " BIN("OLD") ") BEGIN\n"
    REMAKE_BIN("OLD") "END;\n";

constexpr char kViews[] = R"sql(
-- What the plugins of a run call their versions. A built-in planner has none.
CREATE VIEW v_versions AS
SELECT r.run_id, ltrim(ifnull('environment ' || e.version, '') || ifnull(', model ' || m.version, '')
                       || ifnull(', planner ' || p.version, ''), ', ') AS versions
FROM run r LEFT JOIN plugin e ON e.plugin_id = r.env_plugin
     LEFT JOIN plugin m ON m.plugin_id = r.model_plugin
     LEFT JOIN plugin p ON p.plugin_id = r.planner_plugin;

CREATE VIEW v_run AS
SELECT r.run_id, substr(r.uuid, 1, 8) AS uuid, s.name AS study, t.name AS task, r.planner,
       r.model, r.preset, r.seed, r.action_repeat, r.status, r.env_steps_done,
       r.env_steps_target,
       round(100.0 * r.env_steps_done / nullif(r.env_steps_target, 0), 1) AS percent,
       (SELECT e.episode_return FROM episode e WHERE e.run_id = r.run_id AND e.phase = 0
        ORDER BY e.episode DESC LIMIT 1) AS last_return,
       (SELECT count(*) FROM segment g WHERE g.run_id = r.run_id) AS segments,
       (SELECT round(sum(u.seconds), 1) FROM time_use u WHERE u.run_id = r.run_id AND
        u.env_step = (SELECT max(env_step) FROM time_use WHERE run_id = r.run_id)) AS seconds,
       r.exit_code, r.error, r.config_id, r.parent_run_id, r.created_utc, r.ended_utc,
       v.versions
FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id)
     JOIN v_versions v USING (run_id);

-- Here and below, a run that trains: it has no parent and a budget of environment steps. The
-- others are evaluations, of a trained run or of a planner on the true dynamics.
--
-- CROSS JOIN keeps this order: of the few runs only those asked for, then their bins.
CREATE VIEW v_curve_run AS
SELECT s.name AS study, t.name AS task, r.planner, b.phase, b.env_step_bin,
       b.sum_return / b.n AS mean, b.n AS episodes, r.seed, r.run_id, r.status,
       b.env_step_bin * 10000 AS env_step, r.model, r.config_id, r.action_repeat, v.versions
FROM run r CROSS JOIN study s ON s.study_id = r.study_id CROSS JOIN task t ON t.task_id = r.task_id
     CROSS JOIN v_versions v ON v.run_id = r.run_id CROSS JOIN curve_bin b ON b.run_id = r.run_id
WHERE r.parent_run_id IS NULL AND r.env_steps_target > 0 AND b.n > 0;

-- Seeds are averaged, other things never: runs that differ in model, configuration, action
-- repeat or versions of their plugins make rows of their own.
CREATE VIEW v_curve AS
SELECT study, task, planner, phase, env_step_bin, avg(mean) AS mean, min(mean) AS lo,
       max(mean) AS hi, count(*) AS seeds, env_step, model, config_id, action_repeat, versions
FROM v_curve_run
GROUP BY study, task, planner, phase, env_step_bin, model, config_id, action_repeat, versions;

CREATE VIEW v_final AS
SELECT s.name AS study, t.name AS task, r.planner, e.phase, r.seed, avg(e.episode_return) AS score,
       CASE WHEN t.return_high > t.return_low THEN
         (avg(e.episode_return) - t.return_low) / (t.return_high - t.return_low) END AS normalised,
       count(e.episode_return) AS episodes, r.run_id, r.status, r.model, r.config_id,
       r.action_repeat, v.versions
FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id) JOIN v_versions v USING (run_id)
     JOIN episode e ON e.run_id = r.run_id AND e.phase IN (1, 2)
                       AND 10 * e.env_step > 9 * r.env_steps_target
WHERE r.parent_run_id IS NULL AND r.env_steps_target > 0
GROUP BY r.run_id, e.phase;

-- Seconds of a run, averaged over its seeds.
CREATE VIEW v_time AS
SELECT s.name AS study, t.name AS task, r.planner, u.activity, avg(u.seconds) AS seconds,
       sum(u.seconds) AS seconds_of_all_runs, count(*) AS runs, avg(u.env_step) AS env_steps,
       r.model, r.config_id, avg(u.processor_seconds) AS processor_seconds,
       avg(u.gflop) / 3600 AS core_minutes, v.versions
FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id) JOIN v_versions v USING (run_id)
     JOIN time_use u ON u.run_id = r.run_id AND u.env_step =
       (SELECT max(env_step) FROM time_use WHERE run_id = r.run_id)
WHERE r.parent_run_id IS NULL AND r.env_steps_target > 0
GROUP BY s.name, t.name, r.planner, r.model, r.config_id, v.versions, u.activity;

-- Every task, planner and seed that occurs in a study, with what became of it: for each
-- configuration and action repeat of a planner on a task, or, where it has no run there, once.
CREATE VIEW v_matrix AS
WITH main AS (SELECT * FROM run WHERE parent_run_id IS NULL AND env_steps_target > 0),
     line AS (SELECT DISTINCT study_id, task_id, planner, model, config_id, action_repeat
              FROM main),
     cell AS (SELECT * FROM (SELECT DISTINCT study_id, task_id FROM main)
              JOIN (SELECT DISTINCT study_id, planner, model FROM main) USING (study_id)
              LEFT JOIN line USING (study_id, task_id, planner, model)
              JOIN (SELECT DISTINCT study_id, seed FROM main) USING (study_id))
SELECT s.name AS study, t.name AS task, cell.planner, cell.model, cell.seed,
       ifnull(r.status, 'missing') AS status, r.env_steps_done, r.env_steps_target, r.run_id,
       cell.config_id, cell.action_repeat
FROM cell JOIN study s USING (study_id) JOIN task t USING (task_id)
     LEFT JOIN main r ON r.study_id = cell.study_id AND r.task_id = cell.task_id
       AND r.planner = cell.planner AND r.model = cell.model AND r.seed = cell.seed
       AND r.config_id = cell.config_id AND r.action_repeat = cell.action_repeat;
)sql";

// Every view that a schema ever had; people may have made views of their own.
constexpr char kDropViews[] =
    "DROP VIEW IF EXISTS v_run; DROP VIEW IF EXISTS v_curve; DROP VIEW IF EXISTS v_curve_run;"
    " DROP VIEW IF EXISTS v_final; DROP VIEW IF EXISTS v_time; DROP VIEW IF EXISTS v_matrix;"
    " DROP VIEW IF EXISTS v_versions;";

// A run that has ended has a digest of its record as well, so `tbl` may be 'run'.
constexpr char kRecordDigests[] = R"sql(
CREATE TABLE chunk_digest_2 (
  run_id     INTEGER NOT NULL REFERENCES run ON DELETE CASCADE,
  tbl        TEXT NOT NULL CHECK (tbl IN ('step', 'episode', 'scalar', 'run')),
  first_step INTEGER NOT NULL,
  last_step  INTEGER NOT NULL,
  n_rows     INTEGER NOT NULL,
  digest     INTEGER NOT NULL,
  PRIMARY KEY (run_id, tbl, first_step)
) STRICT, WITHOUT ROWID;
INSERT INTO chunk_digest_2 SELECT * FROM chunk_digest;
DROP TABLE chunk_digest;
ALTER TABLE chunk_digest_2 RENAME TO chunk_digest;
)sql";

// What processor time was worth, so that runs of different machines have one axis; and where in
// a cluster a segment ran.
constexpr char kProcessorTime[] = R"sql(
ALTER TABLE time_use ADD COLUMN processor_seconds REAL;
ALTER TABLE time_use ADD COLUMN gflop REAL;
ALTER TABLE segment ADD COLUMN gflop_per_second REAL;
ALTER TABLE segment ADD COLUMN slurm_restarts INTEGER;
ALTER TABLE segment ADD COLUMN slurm_node TEXT;
)sql";

// No run's digest can answer for what a metric's doc says: runs of other versions of a plugin share
// the row.
constexpr char kMetricDigests[] =
    "ALTER TABLE metric ADD COLUMN doc_sha256 TEXT NOT NULL DEFAULT '';";

// Nor for a study's row, which its runs share, nor for paths, which a merge changes, nor for what
// others published.
constexpr char kPathDigests[] = R"sql(
ALTER TABLE study ADD COLUMN sha256 TEXT NOT NULL DEFAULT '';
ALTER TABLE published ADD COLUMN sha256 TEXT NOT NULL DEFAULT '';
ALTER TABLE run ADD COLUMN log_path_sha256 TEXT NOT NULL DEFAULT '';
ALTER TABLE artifact ADD COLUMN path_sha256 TEXT NOT NULL DEFAULT '';
)sql";

}  // namespace

const std::vector<std::string>& Migrations() {
  static const std::vector<std::string> migrations = {
      std::string(kTables) + kTriggers,
      kRecordDigests,
      "",  // views
      "",  // Evaluations without a parent left the views.
      "",  // v_matrix has a line for each configuration.
      kProcessorTime,
      "",  // The views tell versions apart.
      kMetricDigests,
      kPathDigests,
  };
  return migrations;
}

const std::string& FillDigests() {
  static const std::string sql =
      "UPDATE metric SET doc_sha256 = sha256(doc) WHERE doc_sha256 = '';"
      "UPDATE study SET sha256 = " +
      std::string(kStudySha256) +
      " WHERE sha256 = '';"
      "UPDATE published SET sha256 = " +
      std::string(kPublishedSha256) +
      " WHERE sha256 = '';"
      "UPDATE run SET log_path_sha256 = sha256(log_path) WHERE log_path_sha256 = '';"
      "UPDATE artifact SET path_sha256 = sha256(path) WHERE path_sha256 = '';";
  return sql;
}

const std::string& DropViews() {
  static const std::string sql = kDropViews;
  return sql;
}

const std::string& CreateViews() {
  static const std::string sql = kViews;
  return sql;
}

std::int64_t SchemaVersion() { return static_cast<std::int64_t>(Migrations().size()); }

}  // namespace dreamsearch::results
