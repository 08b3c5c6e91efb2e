#include "results/report/report_queries.h"

#include <algorithm>
#include <map>
#include <set>

#include "results/analysis/common_steps.h"
#include "results/analysis/line_statistics.h"

namespace dreamsearch::results {
namespace {

// A text in SQL.
std::string SqlText(const std::string& text) {
  std::string sql = "'";
  for (const char c : text) {
    if (c == '\'') sql += c;
    sql += c;
  }
  return sql + "'";
}

std::string Joined(const std::vector<std::string>& items) {
  std::string list;
  for (const std::string& item : items) list += (list.empty() ? "" : ", ") + item;
  return list;
}

// " AND COLUMN IN (a, b)"; nothing for an empty list.
std::string SqlIn(const std::string& column, const std::vector<std::string>& values) {
  return values.empty() ? "" : "\n    AND " + column + " IN (" + Joined(values) + ")";
}

std::vector<std::string> SqlTexts(const std::vector<std::string>& texts) {
  std::vector<std::string> sql;
  for (const std::string& text : texts) sql.push_back(SqlText(text));
  return sql;
}

// A run's line: its planner, or, where lines have longer names, by the run.
std::string LineOfRun(const std::vector<Line>& lines) {
  std::map<std::string, std::vector<std::string>> uuids;  // by label
  bool plain = true;
  for (const Line& line : lines) {
    if (line.published) continue;
    plain = plain && line.label == line.planner;
    for (const RunCurve& run : line.runs) {
      uuids[line.label].push_back(SqlText(run.uuid.substr(0, 8)));
    }
  }
  if (plain) return "run.planner";
  std::string sql = "CASE";
  for (const auto& [label, list] : uuids) {
    sql += "\n      WHEN substr(run.uuid, 1, 8) IN (" + Joined(list) + ")\n      THEN " +
           SqlText(label);
  }
  return sql + " END";
}

}  // namespace

ReportQueries::ReportQueries(const RunFilter& filter, const std::vector<Line>& lines)
    : filter_(filter),
      line_of_run_(LineOfRun(lines)),
      tasks_(TasksOf(lines).size()),
      binned_(
          std::any_of(lines.begin(), lines.end(), [](const Line& line) { return line.binned; })) {
  std::map<std::string, std::vector<const Line*>> by_label;
  const auto add = [](const std::vector<const Line*>& grid, std::map<Place, std::int64_t>* to) {
    std::int64_t thinning = 1;  // the queries give every step
    for (const Line* line : grid) thinning = std::max(thinning, line->thinning);
    const std::int64_t spacing = StepsOf(grid).spacing() / thinning;
    for (const Line* line : grid) {
      if (spacing > 0) to->emplace(Place(line->task, line->label), spacing);
    }
  };
  for (const Line& line : lines) {
    if (line.published) continue;
    by_label[line.label].push_back(&line);
    add({&line}, &uneven_by_task_);
  }
  for (const auto& [label, of_label] : by_label) add(of_label, &uneven_over_tasks_);
}

std::string ReportQueries::Chosen(const std::string& study, const std::string& task,
                                  const std::string& planner, const std::string& seed) const {
  std::vector<std::string> seeds;
  for (const std::int64_t s : filter_.seeds) seeds.push_back(std::to_string(s));
  return SqlIn(study, SqlTexts(filter_.studies)) + SqlIn(task, SqlTexts(filter_.tasks)) +
         SqlIn(planner, SqlTexts(filter_.planners)) + SqlIn(seed, seeds);
}

std::string ReportQueries::WithRuns() const {
  return "WITH r AS (\n"
         "  SELECT run.run_id, task.name AS task, task.return_low, task.return_high, run.seed,\n"
         "    run.env_steps_target, " +
         line_of_run_ +
         " AS line,\n"
         "    CASE WHEN EXISTS (SELECT 1 FROM episode e WHERE e.run_id = run.run_id AND e.phase = "
         "1)\n"
         "      THEN 1 ELSE 2 END AS phase\n"
         "  FROM run JOIN study USING (study_id) JOIN task USING (task_id)\n"
         "  WHERE run.parent_run_id IS NULL AND run.env_steps_target > 0" +
         Chosen("study.name", "task.name", "run.planner", "run.seed") + ")";
}

std::string ReportQueries::WithPoints(bool by_task) const {
  // Where runs are interpolated, evaluations that were not finite keep their place.
  const std::map<Place, std::int64_t>& uneven = by_task ? uneven_by_task_ : uneven_over_tasks_;
  const bool plain = uneven.empty();
  std::string sql =
      WithRuns() + ", p AS (\n" +
      (binned_ ? "  SELECT r.*, b.env_step_bin * 10000 AS env_step, b.sum_return / nullif(b.n, 0) "
                 "AS mean\n"
                 "  FROM r JOIN curve_bin b ON b.run_id = r.run_id AND b.phase = r.phase" +
                     std::string(plain ? " AND b.n > 0)" : ")")
               : "  SELECT r.*, e.env_step, avg(e.episode_return) AS mean\n"
                 "  FROM r JOIN episode e ON e.run_id = r.run_id AND e.phase = r.phase\n"
                 "  GROUP BY r.run_id, e.env_step" +
                     std::string(plain ? " HAVING count(e.episode_return) > 0)" : ")"));
  if (plain) return sql + ",\nc AS (SELECT * FROM p)";

  std::vector<std::string> rows;
  for (const auto& [place, spacing] : uneven) {
    rows.push_back("\n    (" + SqlText(place.first) + ", " + SqlText(place.second) + ", " +
                   std::to_string(spacing) + ")");
  }
  const std::string group = by_task ? "task, line" : "line";
  return sql +
         ",\nu(task, line, spacing) AS (  -- lines whose seeds were evaluated at other steps\n"
         "  VALUES" +
         Joined(rows) +
         "),\ne AS (  -- the steps that all of their runs cover\n"
         "  SELECT task, line, spacing, max(a) AS a, min(z) AS z FROM (\n"
         "    SELECT task, line, min(env_step) AS a, max(env_step) AS z\n"
         "    FROM p WHERE mean IS NOT NULL GROUP BY run_id)\n"
         "  JOIN u USING (task, line) GROUP BY " +
         group +
         " HAVING max(a) <= min(z)),\n"
         "m AS (  -- whole multiples of the spacing\n"
         "  SELECT task, line, spacing, a / spacing * spacing AS env_step, z FROM e\n"
         "  UNION ALL SELECT task, line, spacing, env_step + spacing, z FROM m\n"
         "  WHERE env_step + spacing < z),\n"
         "g AS (\n"
         "  SELECT task, line, a AS env_step FROM e UNION SELECT task, line, z FROM e\n"
         "  UNION SELECT m.task, m.line, env_step FROM m JOIN e USING (" +
         group +
         ") WHERE env_step > e.a),\n"
         "w AS (\n"
         "  SELECT *, lead(env_step) OVER run AS next_step, lead(mean) OVER run AS next_mean\n"
         "  FROM p WINDOW run AS (PARTITION BY run_id ORDER BY env_step)),\n"
         "c AS (\n"
         "  SELECT task, line, seed, run_id, return_low, return_high, env_step, mean FROM p\n"
         "  WHERE mean IS NOT NULL AND NOT EXISTS\n"
         "    (SELECT 1 FROM u WHERE u.task = p.task AND u.line = p.line)\n"
         "  UNION ALL\n"
         "  SELECT w.task, w.line, seed, run_id, return_low, return_high, g.env_step,\n"
         "    CASE WHEN g.env_step = w.env_step THEN mean ELSE mean + (next_mean - mean) *\n"
         "      (1.0 * (g.env_step - w.env_step) / (next_step - w.env_step)) END AS value\n"
         "  FROM g JOIN w ON " +
         std::string(by_task ? "w.task = g.task AND " : "") +
         "w.line = g.line AND (g.env_step = w.env_step OR\n"
         "    g.env_step > w.env_step AND g.env_step < next_step)\n"
         "  WHERE value IS NOT NULL)";
}

std::string ReportQueries::Curves() const {
  return WithPoints(true) +
         ", n AS (\n"
         "  SELECT task, line, count(DISTINCT run_id) AS runs FROM p WHERE mean IS NOT NULL\n"
         "  GROUP BY task, line)\n"
         "SELECT task, line, env_step, avg(mean) AS mean, min(mean) AS lo, max(mean) AS hi,\n"
         "  count(*) AS seeds\n"
         "FROM c JOIN n USING (task, line)\n"
         "GROUP BY task, line, env_step HAVING count(*) = runs\n"
         "ORDER BY task, line, env_step";
}

std::string ReportQueries::OverTasks() const {
  return WithPoints(false) +
         ", s AS (\n"
         "  SELECT line, seed, env_step,\n"
         "    avg((mean - return_low) / (return_high - return_low)) AS score\n"
         "  FROM c GROUP BY line, seed, env_step HAVING count(*) = " +
         std::to_string(tasks_) +
         "),\nn AS (\n"
         "  SELECT line, count(DISTINCT seed) AS seeds FROM p WHERE mean IS NOT NULL\n"
         "  GROUP BY line)\n"
         "SELECT line, env_step, avg(score) AS mean, min(score) AS lo, max(score) AS hi, seeds\n"
         "FROM s JOIN n USING (line)\n"
         "GROUP BY line, env_step HAVING count(*) = seeds\n"
         "ORDER BY line, env_step";
}

std::string ReportQueries::Time() const {
  return WithRuns() +
         ", u AS (\n"
         "  SELECT r.line, r.run_id, t.activity, t.seconds, t.env_step\n"
         "  FROM r JOIN time_use t ON t.run_id = r.run_id AND t.env_step =\n"
         "    (SELECT max(env_step) FROM time_use WHERE run_id = r.run_id)),\n"
         "n AS (\n"
         "  SELECT line, sum(env_step) AS env_steps\n"
         "  FROM (SELECT DISTINCT line, run_id, env_step FROM u) GROUP BY line)\n"
         "SELECT line, activity, 1000 * sum(seconds) / env_steps AS seconds_for_1000_env_steps\n"
         "FROM u JOIN n USING (line) WHERE env_steps > 0 GROUP BY line, activity";
}

std::string ReportQueries::Scores(const std::vector<std::string>& tasks) const {
  return WithRuns() +
         "\nSELECT task, line, seed, avg(episode_return) AS score,\n"
         "  (avg(episode_return) - return_low) / (return_high - return_low) AS normalised\n"
         "FROM r JOIN episode e ON e.run_id = r.run_id AND e.phase = r.phase\n"
         "  AND e.env_step <= env_steps_target AND 10 * e.env_step > 9 * env_steps_target\n"
         "WHERE true" +
         SqlIn("task", SqlTexts(tasks)) +
         "\nGROUP BY r.run_id HAVING count(episode_return) > 0\n"
         "ORDER BY task, line, seed";
}

std::string ReportQueries::Runs() const {
  return "SELECT * FROM v_run\nWHERE parent_run_id IS NULL AND env_steps_target > 0" +
         Chosen("study", "task", "planner", "seed");
}

}  // namespace dreamsearch::results
