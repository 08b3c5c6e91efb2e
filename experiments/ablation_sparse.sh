#!/usr/bin/env bash
# Which choice of the preset `fast` lets it learn where random actions meet little or no reward? One
# choice at a time is taken back; three tasks, the actor alone, seeds 0 and 1, 60,000 environment
# steps, seeds outermost. Studies are named after what they change. Given again it goes on where it
# stopped. Prints a table.
#   experiments/ablation_sparse.sh [DATABASE [STUDY ...]]
# TASKS and SEEDS change what runs.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=${1:-$root/results/ablation_sparse.db}
shift || true

# A space separates settings.
studies=("$@")
if [ ${#studies[@]} -eq 0 ]; then
  studies=(
    fast
    dreamer.noise_on=mode
    run.exploration_hold=1
    run.train_every=3
    "model.horizon=12 model.imagination_starts=128"
    "model.actor_layers=4 model.value_layers=3"
  )
fi

for seed in ${SEEDS:-0 1}; do
  for study in "${studies[@]}"; do
    settings=()
    for setting in $study; do
      [ "$setting" = fast ] || settings+=(--set "$setting")
    done
    "$bin/runner" --env "${TASKS:-cartpole_swingup_sparse,hopper_stand,pendulum_swingup}" \
      --planner dreamer --seed-list "$seed" --steps 60000 --study "$study" --db "$db" \
      "${settings[@]}"
  done
done

"$bin/results" sql --db "$db" --format markdown "$(<"$root/experiments/ablation_sparse.sql")"
