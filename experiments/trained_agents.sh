#!/usr/bin/env bash
# Where is the error: in the model, or in the search? Plays trained agents under the actor alone and
# under searches, in the learned model and in the simulator itself (the model `oracle`, with the
# trained actor and critic), and with more and less search: simulations 10, 50 and 200, rollouts of
# 5, 10 and 20 transitions, and trees whose leaves are compared at equal depth. Prints a table of
# returns. Given again it goes on where it stopped.
#   experiments/trained_agents.sh DATABASE RUN...
# RUN: trained runs of the database, `runner status` lists them. For example
#   experiments/trained_agents.sh results/three_planners.db 1 4
# EPISODES and JOBS change how many episodes (10) and how many at once (1). ORACLE names the planners
# that also play in the simulator (dreamer,mcts_pw,mcts_fixed; a decision of rollout simulates 1,500
# transitions, a second for a walker).
set -euo pipefail

if [ $# -lt 2 ]; then
  sed -n '/^# Where/,/^# transitions/p' "${BASH_SOURCE[0]}" | sed 's/^# \?//' >&2
  exit 2
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=$1
shift

for run in "$@"; do
  play() {
    "$bin/runner" eval "$run" --episodes "${EPISODES:-10}" --jobs "${JOBS:-1}" --db "$db" "$@" >/dev/null
  }
  play --planner dreamer,rollout,mcts_pw,mcts_fixed
  play --planner "${ORACLE:-dreamer,mcts_pw,mcts_fixed}" --model oracle
  for simulations in 10 200; do play --planner mcts_pw --set mcts_pw.simulations=$simulations; done
  for depth in 5 20; do play --planner rollout --set rollout.depth=$depth; done
  for depth in 5 10; do play --planner mcts_pw --set mcts_pw.equal_depth=$depth; done
done

runs=$(printf '%s,' "$@")
"$bin/results" sql --db "$db" --format markdown \
  "$(sed "s/:runs/${runs%,}/; s/:episodes/${EPISODES:-10}/" "$root/experiments/trained_agents.sql")"
