#!/usr/bin/env bash
# Does it help to train on what the searches found? Both models under `mppi`, two tasks, seeds 10 to
# 12, 50,000 environment steps, taught (`run.search_targets`) and untaught, else the same: `tdmpc`
# with the settings of tdmpc_100k.cfg, whose runs, read at half their way, are the taught ones,
# `dreamer` with its own and the same search. Seeds go outermost, so what is finished is balanced at
# any moment. Given again it goes on where it stopped. 8 to 15 core-minutes a run, 18 runs beside
# those of tdmpc_100k.cfg. Prints a table.
#   experiments/search_as_teacher.sh [DATABASE]
# DATABASE: results/tdmpc_100k.db; TASKS, MODELS and SEEDS name others than walker_walk,quadruped_walk,
# tdmpc dreamer and 10 11 12.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=${1:-$root/results/tdmpc_100k.db}

# The sizes and updates of the preset as it was then.
old_sizes=(--set run.train_every=3 --set run.exploration_hold=1 --set model.horizon=12
  --set model.imagination_starts=128 --set model.actor_layers=4 --set model.value_layers=3)
half=(--steps 50000 --set run.eval_every=10000)  # evaluated where the whole runs are
tdmpc_taught() { "$bin/runner" --config "$root/experiments/tdmpc_100k.cfg" "$@"; }
tdmpc_untaught() { tdmpc_taught "${half[@]}" --set run.search_targets=false --study untaught "$@"; }
dreamer() {
  "$bin/runner" --model dreamer --planner mppi --set mppi.candidates=64 --set mppi.iterations=2 \
    --set mppi.elites=8 "${old_sizes[@]}" "${half[@]}" "$@"
}
dreamer_taught() { dreamer --set run.search_targets=true --study taught "$@"; }
dreamer_untaught() { dreamer --study untaught "$@"; }

for seed in ${SEEDS:-10 11 12}; do
  for model in ${MODELS:-tdmpc dreamer}; do
    common=(--env "${TASKS:-walker_walk,quadruped_walk}" --seed-list "$seed" --db "$db")
    "${model}_taught" "${common[@]}"
    "${model}_untaught" "${common[@]}"
  done
done

"$bin/results" sql --db "$db" --format markdown "$(<"$root/experiments/search_as_teacher.sql")"
