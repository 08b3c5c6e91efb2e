#!/usr/bin/env bash
# Planners on the true dynamics, with no learning: does each beat random actions, and what
# does it cost? Proposals are uniform and values zero. About 45 min on one core; given again
# it goes on where it stopped. Prints the table of results/published/oracle.md.
#   experiments/oracle.sh [DATABASE]
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=${1:-$root/results/oracle.db}

play() { "$bin/runner" eval --model oracle --study oracle --db "$db" --jobs 1 "$@" >/dev/null; }

# What every task shares; sequences are few, so that a decision takes milliseconds.
all=random,random_shooting,cem,icem,mppi,rollout,mcts_pw,mcts_fixed,mcts_gumbel,hoot
mppi=(--set mppi.actor_candidates=2 --set mppi.play=mean)
shared=(
  "${mppi[@]}" --set mppi.iterations=2 --set mppi.min_std=0.3
  --set mcts_pw.widening_exponent=0.25
  --set random_shooting.horizon=10
  --set cem.horizon=10 --set cem.iterations=2
  --set icem.horizon=10 --set icem.iterations=2  # its candidates: as many transitions as cem
  --set rollout.actor_candidates=10 --set rollout.uniform_candidates=20
  --set rollout.continuation=sample --set rollout.lambda=1
)

# Two tasks in which what pays is within ten decisions of 80 ms and 40 ms.
play --env reacher_easy,finger_spin --planner "$all" --episodes 20 --set run.action_repeat=4 \
  "${shared[@]}" --set planner.simulations=100 --set mcts_fixed.children=5 \
  --set random_shooting.candidates=60 --set cem.candidates=30 --set cem.elites=5 \
  --set icem.candidates=33 --set icem.elites=5 \
  --set mppi.candidates=30 --set mppi.elites=6 --set mppi.horizon=10

# Swinging up takes more than a second, so actions are held for 80 ms.
play --env cartpole_swingup --planner "$all" --episodes 20 --set run.action_repeat=8 \
  "${shared[@]}" --set planner.simulations=400 --set mcts_fixed.children=3 \
  --set random_shooting.candidates=100 --set cem.candidates=50 --set cem.elites=8 \
  --set icem.candidates=55 --set icem.elites=8 \
  --set mppi.candidates=40 --set mppi.elites=8 --set mppi.horizon=15

# Pumping up takes five seconds, and nothing pays before the top is reached.
play --env pendulum_swingup --planner random,mppi --episodes 10 --set run.action_repeat=16 \
  --set mppi.actor_candidates=2 --set mppi.candidates=200 --set mppi.elites=8 \
  --set mppi.iterations=2 --set mppi.horizon=60 --set mppi.min_std=0.3

# With the usual action repeat: 60 decisions ahead are 1.2 seconds.
play --env cartpole_swingup --planner random,mppi --episodes 5 --set run.action_repeat=2 \
  "${mppi[@]}" --set mppi.candidates=64 --set mppi.elites=10 --set mppi.iterations=2 \
  --set mppi.horizon=60 --set mppi.min_std=0.3

"$bin/results" sql --db "$db" --format markdown "$(<"$root/experiments/oracle.sql")"
