/* A row a task: scores of the seeds, their mean and its standard error (of one seed alone, over its
   evaluation episodes), what a run takes, evaluation left out, and beside it the preset before with
   seed 10 (results/published/fast_100k.md and fast_100k_further.md) and published scores at 100,000
   steps: DreamerV3's from TD-MPC2's repository and from its own, `best` of any method. The last row
   is the mean over the tasks that have a run. */
WITH elsewhere(task, before, tdmpc2, bmpc, dreamerv3, best) AS (
  VALUES
    ('acrobot_swingup', 188, 179, 204, '101 / 30', 216),
    ('cartpole_balance', 983, 998, 943, '913 / 840', 1000),
    ('cartpole_balance_sparse', 1000, 1000, 996, '971 / 559', 1000),
    ('cartpole_swingup', 839, 839, 770, '677 / 528', 880),
    ('cartpole_swingup_sparse', 0, 0, 270, '315 / 25', 798),
    ('cheetah_run', 548, 519, 506, '336 / 283', 722),
    ('cup_catch', 956, 981, 939, '870 / 730', 981),
    ('finger_spin', 718, 948, 944, '328 / 766', 979),
    ('finger_turn_easy', 582, 488, 559, '228 / 395', 662),
    ('finger_turn_hard', 201, 484, 215, '190 / 218', 602),
    ('hopper_hop', 0, 14, 58, '10 / 0', 200),
    ('hopper_stand', 1, 28, 213, '150 / 59', 862),
    ('pendulum_swingup', 823, 724, 795, '699 / 830', 830),
    ('quadruped_run', 234, 239, 232, '126', 845),
    ('quadruped_walk', 336, 487, 343, '46', 920),
    ('reacher_easy', 917, 937, 794, '872 / 693', 967),
    ('reacher_hard', 910, 414, 649, '813 / 768', 939),
    ('walker_run', 578, 723, 751, '245 / 243', 751),
    ('walker_stand', 966, 981, 976, '885 / 767', 981),
    ('walker_walk', 956, 962, 962, '630 / 475', 971)),
cost AS (
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
  FROM scored GROUP BY task),
compared AS (SELECT * FROM by_task JOIN elsewhere USING (task))
SELECT task, seeds, scores,
       CAST(round(mean) AS INTEGER) || ' ± ' || CAST(round(error) AS INTEGER) AS mean,
       before AS "before, seed 10", tdmpc2 AS "TD-MPC2", bmpc AS "BMPC", dreamerv3 AS "DreamerV3",
       best AS "best published", CAST(round(minutes) AS INTEGER) AS "core-minutes",
       CAST(round(gflop / 1000) * 1000 AS INTEGER) AS GFLOP
FROM compared
UNION ALL
SELECT 'mean of ' || count(*), '', '', CAST(round(avg(mean)) AS INTEGER),
       CAST(round(avg(before)) AS INTEGER), CAST(round(avg(tdmpc2)) AS INTEGER),
       CAST(round(avg(bmpc)) AS INTEGER), '', CAST(round(avg(best)) AS INTEGER),
       CAST(round(avg(minutes)) AS INTEGER), CAST(round(avg(gflop) / 1000) * 1000 AS INTEGER)
FROM compared;
