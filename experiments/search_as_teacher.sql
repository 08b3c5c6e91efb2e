/* A row a model, task and way of acting: the evaluations at 50,000 steps of the seeds in order,
   untaught and taught, their means, and the mean difference of equal seeds with its standard error,
   of these and of the mean evaluation up to there. */
WITH runs AS (
  SELECT model, task, phase, seed, study <> 'untaught' AS taught, avg(mean) AS curve,
         max(iif(env_step = 50000, mean, NULL)) AS score
  FROM v_curve_run WHERE phase > 0 AND env_step <= 50000 GROUP BY run_id, phase),
pairs AS (
  SELECT a.model, a.task, a.phase, a.seed, a.score AS untaught, b.score AS taught,
         b.score - a.score AS gain, b.curve - a.curve AS gain_of_curve
  FROM runs a JOIN runs b USING (model, task, phase, seed)
  WHERE NOT a.taught AND b.taught AND a.score IS NOT NULL AND b.score IS NOT NULL
  ORDER BY a.seed),
table_of_gains AS (
  SELECT model, task, phase, group_concat(CAST(round(untaught) AS INTEGER), ' / ') AS untaught_seeds,
         group_concat(CAST(round(taught) AS INTEGER), ' / ') AS taught_seeds,
         avg(untaught) AS untaught, avg(taught) AS taught, count(*) AS seeds,
         avg(gain) AS gain, avg(gain_of_curve) AS gain_of_curve,
         iif(count(*) > 1, printf(' ± %.0f', standard_error(gain)), '') AS error,
         iif(count(*) > 1, printf(' ± %.0f', standard_error(gain_of_curve)), '') AS error_of_curve
  FROM pairs GROUP BY model, task, phase)
SELECT model, task, iif(phase = 1, 'with mppi', 'the actor alone') AS acting,
       untaught_seeds AS "untaught, by seed", CAST(round(untaught) AS INTEGER) AS mean,
       taught_seeds AS "taught, by seed", CAST(round(taught) AS INTEGER) AS "mean ",
       printf('%+.0f', gain) || error AS gain,
       printf('%+.0f', gain_of_curve) || error_of_curve AS "gain of the curve"
FROM table_of_gains ORDER BY model DESC, task, phase;
