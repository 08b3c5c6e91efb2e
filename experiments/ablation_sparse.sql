/* A row a choice and task: scores of the seeds in order, their mean, the mean of the curves (over
   the bins of 10,000 steps). */
WITH scored AS (
  SELECT s.name AS choice, t.name AS task, r.seed, e.score,
         (SELECT avg(mean) FROM v_curve_run v WHERE v.run_id = r.run_id AND v.phase = 2) AS curve
  FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id) JOIN v_final e USING (run_id)
  WHERE r.parent_run_id IS NULL AND r.status = 'finished' AND e.phase = 2
  ORDER BY t.name, s.name, r.seed)
SELECT task, choice, group_concat(CAST(round(score) AS INTEGER), ' / ') AS seeds,
       CAST(round(avg(score)) AS INTEGER) AS mean, CAST(round(avg(curve)) AS INTEGER) AS curve
FROM scored GROUP BY task, choice ORDER BY task, choice <> 'fast', curve DESC;
