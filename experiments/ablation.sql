/* A row a choice: the settings that differ from the study "norm=none", the base; scores of the
   seeds in order, the mean of the curve (over the bins of 10,000 steps), and in how many pairs of
   runs on one task the base has the higher curve. */
WITH finished AS (
  SELECT r.run_id, r.task_id, r.seed, t.name AS task, s.name AS study, c.json
  FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id) JOIN config c USING (config_id)
  WHERE r.parent_run_id IS NULL AND r.status = 'finished'),
base AS (SELECT DISTINCT task_id, json FROM finished WHERE study = 'norm=none'),
difference AS (
  SELECT f.run_id, v.key || '=' || CASE v.type WHEN 'true' THEN 'true' WHEN 'false' THEN 'false'
                                               ELSE v.value END AS setting
  FROM finished f JOIN base b USING (task_id) JOIN json_each(f.json, '$.model.parameters') v
  WHERE v.value IS NOT json_extract(b.json, '$.model.parameters.' || v.key)
  UNION ALL
  SELECT f.run_id, 'run.' || v.key || '=' || v.value
  FROM finished f JOIN base b USING (task_id) JOIN json_each(f.json, '$.run') v
  WHERE v.value IS NOT json_extract(b.json, '$.run.' || v.key)),
scored AS (
  SELECT f.run_id, f.task, f.seed, e.score,
         ifnull((SELECT group_concat(setting, ' ') FROM difference d WHERE d.run_id = f.run_id),
                'base') AS choice,
         (SELECT avg(mean) FROM v_curve_run v WHERE v.run_id = f.run_id AND v.phase = 2) AS curve
  FROM finished f JOIN v_final e USING (run_id) WHERE e.phase = 2),
by_task AS (
  SELECT choice, task, count(*) AS runs, avg(score) AS score, avg(curve) AS curve,
         group_concat(CAST(round(score) AS INTEGER), ' / ') AS seeds
  FROM (SELECT * FROM scored ORDER BY seed) GROUP BY choice, task),
ahead AS (
  SELECT o.choice, sum(b.curve > o.curve) AS won, count(*) AS pairs
  FROM scored o JOIN scored b ON b.choice = 'base' AND b.task = o.task
  WHERE o.choice <> 'base' GROUP BY o.choice)
SELECT w.choice, w.seeds AS "walker_walk", CAST(round(w.score) AS INTEGER) AS mean,
       CAST(round(w.curve) AS INTEGER) AS curve,
       c.seeds AS "cartpole_swingup", CAST(round(c.score) AS INTEGER) AS "mean ",
       CAST(round(c.curve) AS INTEGER) AS "curve ",
       ifnull(a.won || ' of ' || a.pairs, '') AS "base ahead"
FROM by_task w JOIN by_task c ON c.choice = w.choice AND c.task = 'cartpole_swingup'
     LEFT JOIN ahead a ON a.choice = w.choice
WHERE w.task = 'walker_walk' AND w.runs = 3 AND c.runs = 3
ORDER BY w.choice <> 'base', w.curve + c.curve DESC;
