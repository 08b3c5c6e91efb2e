#!/usr/bin/env bash
# Does each choice of the preset `fast` earn its place? Choices are changed one at a time: taken
# back to the preset `paper` or to what is usual. Two tasks, the actor alone, seeds 0 to 2, 50,000
# environment steps. The base is "norm=none", the preset as it was then (November 2026) with an
# update every 5 steps rather than 3, which lets a study take 20 core-minutes rather than 35;
# studies are named after what they change. Given again it goes on where it stopped. Prints the
# table of results/published/ablation.md.
#   experiments/ablation.sh [DATABASE [STUDY ...]]
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=${1:-$root/results/ablation.db}
shift || true

# A space separates settings; without a prefix they are the model's.
studies=("$@")
if [ ${#studies[@]} -eq 0 ]; then
  studies=(
    norm=none
    norm=layer
    "norm=layer precision=float"
    precision=float
    run.train_every=3
    run.train_every=10
    slow_critic_weight=0
    entropy_scale=0
    normalise_observations=false
    "observation_weight=1 reward_weight=1"
    "kl_posterior_factor=1 free_nats=3 free_nats_over=batch"
    "actor_learning_rate=8e-5 value_learning_rate=8e-5"
    "value_scale=1 zero_heads=false"
    return_scale=none
    "actor_initial_std=5 actor_min_std=1e-4"
    start_skip=0
    imagination_starts=256
    horizon=15
    "deterministic=200 hidden=200"
  )
fi

for study in "${studies[@]}"; do
  declare -A value=([run.train_every]=5 [run.exploration_hold]=1 [dreamer.noise_on]=mode
    [model.norm]=none [model.horizon]=12 [model.imagination_starts]=128 [model.actor_layers]=4
    [model.value_layers]=3)
  for setting in $study; do
    name=${setting%%=*}
    [[ $name == run.* ]] || name=model.$name
    value[$name]=${setting#*=}
  done
  settings=()
  for name in "${!value[@]}"; do settings+=(--set "$name=${value[$name]}"); done
  "$bin/runner" --env walker_walk,cartpole_swingup --planner dreamer --seeds 3 --steps 50000 \
    --study "$study" --db "$db" "${settings[@]}"
done

"$bin/results" sql --db "$db" --format markdown "$(<"$root/experiments/ablation.sql")"
