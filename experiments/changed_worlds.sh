#!/usr/bin/env bash
# Does search bear a changed world better than the actor alone? Plays trained agents of MuJoCo
# tasks in worlds that they were not trained in: three factors at three strengths, each under three
# planners, and the world as it was. Prints a table of returns, beside each the share of what the
# same planner has in the world as it was. Given again it goes on where it stopped.
#   experiments/changed_worlds.sh DATABASE RUN...
# RUN: trained runs of the database, `runner status` lists them. For example
#   experiments/changed_worlds.sh results/three_planners.db 1 4
# EPISODES, PLANNERS and JOBS change how many episodes (20), under whom, how many at once (1).
set -euo pipefail

if [ $# -lt 2 ]; then
  sed -n '/^# Does/,/^# EPISODES/p' "${BASH_SOURCE[0]}" | sed 's/^# \?//' >&2
  exit 2
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=${DREAMSEARCH_BIN:-$root/build/release/bin}
db=$1
shift

worlds=(
  ""
  env.mass_scale={1.5,2,3}
  env.actuator_scale={0.75,0.5,0.25}
  env.action_delay={1,2,3}
)
for run in "$@"; do
  for world in "${worlds[@]}"; do
    change=()
    [ -z "$world" ] || change=(--set "$world")
    "$bin/runner" eval "$run" --planner "${PLANNERS:-dreamer,rollout,mcts_pw}" \
      --episodes "${EPISODES:-20}" --jobs "${JOBS:-1}" --db "$db" "${change[@]}" >/dev/null
  done
done

runs=$(printf '%s,' "$@")
"$bin/results" sql --db "$db" --format markdown \
  "$(sed "s/:runs/${runs%,}/; s/:episodes/${EPISODES:-20}/" "$root/experiments/changed_worlds.sql")"
