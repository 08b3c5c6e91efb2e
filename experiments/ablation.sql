/* A row a study: scores of the seeds in order, the mean of the curve (over the bins of 10,000
   steps), and in how many pairs of runs on one task the preset has the higher curve. */
WITH run_curve AS (
  SELECT study, task, seed, run_id, avg(mean) AS curve FROM v_curve_run
  WHERE phase = 2 AND status = 'finished' GROUP BY run_id),
scored AS (
  SELECT c.*, f.score FROM run_curve c JOIN v_final f USING (run_id) WHERE f.phase = 2),
by_task AS (
  SELECT study, task, count(*) AS runs, avg(score) AS score, avg(curve) AS curve,
         group_concat(CAST(round(score) AS INTEGER), ' / ') AS seeds
  FROM (SELECT * FROM scored ORDER BY seed) GROUP BY study, task),
ahead AS (
  SELECT o.study, sum(b.curve > o.curve) AS won, count(*) AS pairs
  FROM scored o JOIN scored b ON b.study = 'fast' AND b.task = o.task
  WHERE o.study <> 'fast' GROUP BY o.study),
learning AS (
  SELECT study, sum(seconds_of_all_runs) / sum(runs) / 60 AS minutes FROM v_time
  WHERE activity = 'learning' GROUP BY study)
SELECT w.study AS choice,
       w.seeds AS "walker_walk", CAST(round(w.score) AS INTEGER) AS mean,
       CAST(round(w.curve) AS INTEGER) AS "mean of curve",
       c.seeds AS "cartpole_swingup", CAST(round(c.score) AS INTEGER) AS "mean ",
       CAST(round(c.curve) AS INTEGER) AS "mean of curve ",
       ifnull(a.won || ' of ' || a.pairs, '') AS "fast ahead",
       round(l.minutes, 1) AS "minutes learning"
FROM by_task w JOIN by_task c ON c.study = w.study AND c.task = 'cartpole_swingup'
     LEFT JOIN ahead a ON a.study = w.study LEFT JOIN learning l ON l.study = w.study
WHERE w.task = 'walker_walk'
ORDER BY w.study <> 'fast', w.curve + c.curve;
