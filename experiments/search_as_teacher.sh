#!/usr/bin/env bash
# Does it help to train on what the searches found? Both models under `mppi`, two tasks, seeds 0 to
# 2, 50,000 environment steps, with `run.search_targets` (studies "MODEL, taught") and without it
# ("MODEL"); everything else is the same, and the search that acts is that of tdmpc_100k.cfg. Seeds
# go outermost, so what is finished is balanced at any moment. Given again it goes on where it
# stopped. About 12 core-minutes a run, 24 runs. Prints a table.
#   experiments/search_as_teacher.sh [DATABASE]
# TASKS, MODELS and SEEDS name others (walker_walk,cheetah_run, tdmpc dreamer, 0 1 2).
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=${1:-$root/results/search_as_teacher.db}

for seed in ${SEEDS:-0 1 2}; do
  for model in ${MODELS:-tdmpc dreamer}; do
    learn() {
      "$bin/runner" --env "${TASKS:-walker_walk,cheetah_run}" --model "$model" --planner mppi \
        --seed-list "$seed" --steps 50000 --set mppi.candidates=64 --set mppi.iterations=2 \
        --set mppi.elites=8 --db "$db" "$@"
    }
    learn --study "$model"
    learn --study "$model, taught" --set run.search_targets=true
  done
done

"$bin/results" sql --db "$db" --format markdown "$(<"$root/experiments/search_as_teacher.sql")"
