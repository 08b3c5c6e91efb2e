/* A row a model, task and way of acting: scores of the seeds in order without and with the search as
   a teacher, their means, and the mean difference of equal seeds with its standard error, of the
   scores and of the curves' means. */
WITH runs AS (
  SELECT f.model, f.task, f.phase, f.seed, f.study LIKE '%, taught' AS taught, f.score,
         (SELECT avg(mean) FROM v_curve_run v WHERE v.run_id = f.run_id AND v.phase = f.phase) AS curve
  FROM v_final f WHERE f.status = 'finished'),
pairs AS (
  SELECT a.model, a.task, a.phase, a.seed, a.score AS plain, b.score AS taught,
         b.score - a.score AS gain, b.curve - a.curve AS gain_of_curve
  FROM runs a JOIN runs b USING (model, task, phase, seed) WHERE NOT a.taught AND b.taught
  ORDER BY a.seed)
SELECT model, task, iif(phase = 1, 'with mppi', 'the actor alone') AS acting,
       group_concat(CAST(round(plain) AS INTEGER), ' / ') AS "without, by seed",
       CAST(round(avg(plain)) AS INTEGER) AS mean,
       group_concat(CAST(round(taught) AS INTEGER), ' / ') AS "taught, by seed",
       CAST(round(avg(taught)) AS INTEGER) AS "mean ",
       printf('%+.0f ± %.0f', avg(gain), sqrt(max(0, avg(gain * gain) - avg(gain) * avg(gain))
                                              / nullif(count(*) - 1, 0))) AS gain,
       printf('%+.0f ± %.0f', avg(gain_of_curve),
              sqrt(max(0, avg(gain_of_curve * gain_of_curve)
                          - avg(gain_of_curve) * avg(gain_of_curve))
                   / nullif(count(*) - 1, 0))) AS "gain of the curve"
FROM pairs GROUP BY model, task, phase ORDER BY model DESC, task, phase;
