-- Every evaluation of every run, one line each: what results/published/tuning_fast.csv holds.
--   results sql --db DATABASE --format csv "$(<experiments/tuning_fast.sql)"
select s.name as study, t.name as task, r.seed, r.status, e.env_step,
       round(avg(e.episode_return), 1) as mean_return,
       round(standard_error(e.episode_return), 1) as standard_error, count(*) as episodes
from episode e join run r using (run_id) join study s using (study_id) join task t using (task_id)
where e.phase > 0
group by r.run_id, e.env_step
order by s.name, t.name, r.seed, r.run_id, e.env_step
