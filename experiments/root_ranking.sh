#!/usr/bin/env bash
# Does a search rank its actions rightly, and from when on? Trains an agent under `mcts_pw`, stops at
# several budgets, and lets the simulator judge each search's ranking of the actions at its root
# (`runner eval --rank-every`): rank correlation, share of the visits that the first action has, and
# how much of the return the played action misses; as the paper has it, and with each remedy and all
# of them. Prints a table. Given again it goes on where it stopped.
#   experiments/root_ranking.sh [DATABASE]
# DATABASE: results/root_ranking.db; TASK names another than walker_walk, BUDGETS others than 6000
# 10000 20000 40000 environment steps.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=${1:-$root/results/root_ranking.db}
task=${TASK:-walker_walk}

run=
for budget in ${BUDGETS:-6000 10000 20000 40000}; do
  if [ -z "$run" ]; then
    "$bin/runner" --env "$task" --planner mcts_pw --steps "$budget" --keep-replay \
      --set run.eval_every=10000 --db "$db"
  else
    "$bin/runner" extend "$run" --steps "$budget" --db "$db"
  fi
  run=$("$bin/results" sql --db "$db" --format csv "SELECT max(run_id) AS run FROM run \
    JOIN task USING (task_id) WHERE name = '$task' AND env_steps_target = $budget" | tail -1)
  play() {
    "$bin/runner" eval "$run" --rank-every 20 --rank-decisions 25 --db "$db" "$@" >/dev/null
  }
  play --planner dreamer,rollout,mcts_pw,mcts_fixed,mcts_gumbel
  play --planner mcts_pw --set mcts_pw.equal_depth=10
  play --planner mcts_pw --set mcts_pw.root_actions=20
  play --planner mcts_pw --set mcts_pw.root_uniform=0.33
  play --planner mcts_pw --set mcts_pw.equal_depth=10 --set mcts_pw.root_actions=20 \
    --set mcts_pw.root_uniform=0.33
done

"$bin/results" sql --db "$db" --format markdown \
  "$(sed "s/:task/'$task'/" "$root/experiments/root_ranking.sql")"
