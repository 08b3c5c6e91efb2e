#!/usr/bin/env bash
# Does each choice of the preset `fast` earn its place? One choice at a time goes back to the
# preset `paper` or to what is usual; two tasks, the actor alone, seeds 0 to 2, 50,000
# environment steps. A study is named after what it changes. About 25 core-minutes a study;
# given again it goes on where it stopped. Prints the table of results/ablation.md.
#   experiments/ablation.sh [DATABASE [STUDY ...]]
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=${1:-$root/results/ablation.db}
shift || true

# Settings of the model unless a folder is named; a space separates settings.
studies=("$@")
if [ ${#studies[@]} -eq 0 ]; then
  studies=(
    fast
    norm=none
    "norm=none slow_critic_weight=0"
    "norm=none entropy_scale=0"
    normalise_observations=false
    "actor_learning_rate=8e-5 value_learning_rate=8e-5"
    precision=float
    slow_critic_weight=0
    entropy_scale=0
    "kl_posterior_factor=1 free_nats=3 free_nats_over=batch"
    "observation_weight=1 reward_weight=1"
    value_scale=1
    zero_heads=false
    return_scale=none
    "actor_initial_std=5 actor_min_std=1e-4"
    start_skip=0
    run.train_every=3
    run.train_every=10
    imagination_starts=256
    horizon=15
    "deterministic=200 hidden=200"
  )
fi

for study in "${studies[@]}"; do
  settings=()
  for setting in $study; do
    case $setting in
      fast) ;;
      run.*) settings+=(--set "$setting") ;;
      *) settings+=(--set "model.$setting") ;;
    esac
  done
  "$bin/runner" --env walker_walk,cartpole_swingup --planner dreamer --seeds 3 --steps 50000 \
    --study "$study" --db "$db" "${settings[@]}"
done

"$bin/results" sql --db "$db" --format markdown "$(<"$root/experiments/ablation.sql")"
