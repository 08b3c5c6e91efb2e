/* A row a task: scores of the seeds, the mean of these and its standard error; of one seed alone,
   over its evaluation episodes. Then what a run takes, evaluation left out. The last row is the mean
   over the tasks. */
WITH cost AS (
  SELECT run_id, sum(processor_seconds) / 60 AS minutes, sum(gflop) AS gflop
  FROM time_use u
  WHERE activity <> 'evaluation'
    AND env_step = (SELECT max(env_step) FROM time_use WHERE run_id = u.run_id)
  GROUP BY run_id),
scored AS (
  SELECT e.task, e.seed, e.score, c.minutes, c.gflop,
         (SELECT standard_error(p.episode_return) FROM episode p
          WHERE p.run_id = e.run_id AND p.phase = 2
            AND p.env_step = (SELECT max(env_step) FROM episode
                              WHERE run_id = e.run_id AND phase = 2)) AS over_episodes
  FROM v_final e JOIN cost c USING (run_id)
  WHERE e.study = 'twenty_100k' AND e.phase = 2 AND e.status = 'finished'
  ORDER BY e.task, e.seed),
by_task AS (
  SELECT task, group_concat(seed, ' / ') AS seeds,
         group_concat(CAST(round(score) AS INTEGER), ' / ') AS scores, avg(score) AS mean,
         CASE WHEN count(*) > 1 THEN standard_error(score) ELSE over_episodes END AS error,
         avg(minutes) AS minutes, avg(gflop) AS gflop
  FROM scored GROUP BY task)
SELECT task, seeds, scores, CAST(round(mean) AS INTEGER) AS mean,
       CAST(round(error) AS INTEGER) AS error, round(minutes, 1) AS "core-minutes",
       CAST(round(gflop / 1000) * 1000 AS INTEGER) AS GFLOP
FROM by_task
UNION ALL
SELECT 'mean of ' || count(*), '', '', CAST(round(avg(mean)) AS INTEGER), '',
       round(avg(minutes), 1), CAST(round(avg(gflop) / 1000) * 1000 AS INTEGER)
FROM by_task;
