/* The table of trained_agents.sh: evaluations of the trained runs over so many episodes in the world
   as it was trained in. */
SELECT t.name || ', run ' || r.parent_run_id AS agent, r.planner, f.settings, r.model,
       printf('%.0f ± %.0f', avg(e.episode_return), standard_error(e.episode_return)) AS "return",
       round(sum(e.plan_us_mean * e.length) / sum(e.length) / 1000, 2) AS "ms/decision",
       round(1.0 * sum(e.model_transitions) * r.action_repeat / sum(e.length))
         AS "transitions/decision"
FROM run r
JOIN task t USING (task_id)
JOIN (SELECT config_id, json_extract(json, '$.run.eval_episodes') AS episodes,
             (SELECT count(*) FROM json_each(json, '$.environment.parameters')) AS changes,
             (SELECT group_concat(key || ' ' || value, ', ')
              FROM json_each(json, '$.planner.parameters')
              WHERE key IN ('simulations', 'depth', 'equal_depth')
                    AND NOT (key = 'equal_depth' AND value = 0)) AS settings
      FROM config) f USING (config_id)
JOIN episode e USING (run_id)
WHERE r.parent_run_id IN (:runs) AND r.status = 'finished' AND f.episodes = :episodes
      AND f.changes = 0
GROUP BY r.run_id
ORDER BY r.parent_run_id, r.model, r.planner, f.settings;
