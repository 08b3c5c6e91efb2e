/* The table of root_ranking.sh: a row a budget of the training and a search. */
SELECT trained.env_steps_done AS "trained for", r.planner,
       (SELECT group_concat(key || ' ' || value, ', ')
        FROM json_each(c.json, '$.planner.parameters')
        WHERE key IN ('equal_depth', 'root_actions', 'root_uniform') AND value > 0) AS settings,
       (SELECT printf('%.0f ± %.0f', avg(episode_return), standard_error(episode_return))
        FROM episode e WHERE e.run_id = r.run_id) AS "return",
       round(max(iif(m.name = 'ranking.correlation', s.value, NULL)), 2) AS "rank correlation",
       round(max(iif(m.name = 'ranking.first_visits', s.value, NULL)), 2) AS "first visits",
       round(max(iif(m.name LIKE '%.root_visit_entropy', s.value, NULL)), 2) AS "visit entropy",
       iif(r.planner = 'dreamer', NULL,
           printf('%.2f of %.2f', max(iif(m.name = 'ranking.regret', s.value, NULL)),
                  max(iif(m.name = 'ranking.spread', s.value, NULL)))) AS "return missed",
       CAST(max(iif(m.name = 'ranking.decisions', s.value, NULL)) AS INTEGER) AS decisions
FROM run r
JOIN run trained ON trained.run_id = r.parent_run_id
JOIN task t ON t.task_id = r.task_id
JOIN config c ON c.config_id = r.config_id
LEFT JOIN scalar s ON s.run_id = r.run_id
     AND s.env_step = (SELECT max(env_step) FROM scalar l WHERE l.run_id = r.run_id)
LEFT JOIN metric m USING (metric_id)
WHERE t.name = :task AND r.status = 'finished'
      AND (r.planner = 'dreamer' OR json_extract(c.json, '$.evaluation.ranks.every') > 0)
GROUP BY r.run_id
ORDER BY trained.env_steps_done, r.planner, settings;
