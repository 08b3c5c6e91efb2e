/* The table of changed_worlds.sh: evaluations of the trained runs over so many episodes. A factor
   that has its default is not in a configuration. */
WITH played AS (
  SELECT r.run_id, r.parent_run_id, t.name AS task, r.planner,
         CASE WHEN f.mass IS NOT NULL THEN 'mass_scale'
              WHEN f.actuator IS NOT NULL THEN 'actuator_scale'
              WHEN f.delay IS NOT NULL THEN 'action_delay'
              ELSE 'as trained' END AS world,
         coalesce(f.mass, f.actuator, f.delay) AS strength,
         avg(e.episode_return) AS score, standard_error(e.episode_return) AS error
  FROM run r
  JOIN task t USING (task_id)
  JOIN (SELECT config_id,
               json_extract(json, '$.environment.parameters.mass_scale') AS mass,
               json_extract(json, '$.environment.parameters.actuator_scale') AS actuator,
               json_extract(json, '$.environment.parameters.action_delay') AS delay,
               (SELECT count(*) FROM json_each(json, '$.environment.parameters')
                WHERE key IN ('friction_scale', 'gravity_scale', 'observation_noise')) AS others,
               json_extract(json, '$.run.eval_episodes') AS episodes
        FROM config) f USING (config_id)
  JOIN episode e USING (run_id)
  WHERE r.parent_run_id IN (:runs) AND r.status = 'finished' AND f.others = 0
        AND f.episodes = :episodes
        AND (f.mass IS NOT NULL) + (f.actuator IS NOT NULL) + (f.delay IS NOT NULL) <= 1
  GROUP BY r.run_id
)
SELECT p.task || ', run ' || p.parent_run_id AS agent, p.world, ifnull(p.strength, '') AS strength,
       p.planner, printf('%.0f ± %.0f', p.score, p.error) AS "return",
       printf('%.0f %%', 100 * p.score / nullif(o.score, 0)) AS "of as trained"
FROM played p
LEFT JOIN played o ON o.parent_run_id = p.parent_run_id AND o.planner = p.planner
                      AND o.world = 'as trained'
ORDER BY p.parent_run_id, p.world <> 'as trained', p.world DESC,
         CASE p.world WHEN 'actuator_scale' THEN -p.strength ELSE p.strength END, p.planner
