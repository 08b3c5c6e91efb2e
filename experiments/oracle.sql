/* A row an evaluation: return with its 95 % interval (normal), cost of a decision, settings. */
WITH played AS (
  SELECT run_id, count(*) AS n, avg(episode_return) AS mean,
         1.96 * standard_error(episode_return) AS half,
         sum(plan_us_mean * length) / sum(length) / 1000 AS ms,
         1.0 * sum(model_transitions) / sum(length) AS transitions_a_step
  FROM episode WHERE phase = 1 GROUP BY run_id)
SELECT t.name AS task, r.action_repeat AS repeat, r.planner, p.n AS episodes,
       round(p.mean, 1) AS "return", round(p.mean - p.half, 1) AS low,
       round(p.mean + p.half, 1) AS high,
       CASE WHEN r.planner = 'random' THEN ''
            WHEN p.mean > b.mean + b.half THEN 'yes' ELSE 'no' END AS "beats random",
       round(p.ms, 2) AS "ms/decision",
       round(p.transitions_a_step * r.action_repeat) AS "transitions/decision",
       (SELECT group_concat(key || ' ' || value, ', ')
        FROM json_each(c.json, '$.planner.parameters')
        WHERE key IN ('simulations', 'children', 'widening_exponent', 'candidates', 'elites',
                      'iterations', 'horizon', 'actor_candidates', 'uniform_candidates',
                      'depth')) AS settings
FROM run r JOIN study s USING (study_id) JOIN task t USING (task_id) JOIN config c USING (config_id)
     JOIN played p USING (run_id)
     JOIN run br ON br.study_id = r.study_id AND br.task_id = r.task_id
       AND br.action_repeat = r.action_repeat AND br.planner = 'random'
     JOIN played b ON b.run_id = br.run_id
WHERE s.name = 'oracle' AND r.parent_run_id IS NULL
ORDER BY t.name, r.action_repeat, r.planner <> 'random', p.mean;
