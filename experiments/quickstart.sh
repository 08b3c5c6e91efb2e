#!/usr/bin/env bash
# From a fresh Debian 12 to a learning curve: installs what is missing, builds,
# trains three small agents that search while they learn, and draws the curve.
# Give it again and it goes on where it stopped. More steps: STEPS=100000.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
steps=${STEPS:-14000}
db=results/quickstart.db
figure=results/quickstart.png
cores=$(nproc)
began=$SECONDS

# "about 7 min" from seconds.
minutes() { awk -v s="$1" 'BEGIN { m = int(s / 60 + 0.5); printf "about %d min", m < 1 ? 1 : m }'; }

echo "== 1 of 4: packages"
experiments/install_packages.sh

# How fast this machine is, from one file of ours: the whole build takes 340 times the
# processor time, a thousand environment steps of an agent 13 times (measured on two cores
# of a Zen 4 server).
probe=$({ TIMEFORMAT=%U; time g++ -std=c++20 -O2 -I. -Isdk/include \
            -c plugins/planner_mcts/search_tree.cc -o /dev/null; } 2>&1)
build_seconds=$(awk -v p="$probe" -v c="$cores" 'BEGIN { print 340 * p / c }')
train_seconds=$(awk -v p="$probe" -v c="$cores" -v n="$steps" \
  'BEGIN { print 13 * p * 3 * n / 1000 / (c < 3 ? c : 3) }')
echo "this machine ($cores cores) takes $(minutes "$build_seconds") to build, if nothing is built" \
     "yet, and $(minutes "$train_seconds") to train; it is measured again after the build"

echo "== 2 of 4: build (in build/release)"
mkdir -p build
cmake --preset release -DDREAMSEARCH_TESTS=OFF >build/configure.log 2>&1 ||
  { cat build/configure.log >&2; exit 1; }
cmake --build --preset release
bin=build/release/bin
echo "built after $((SECONDS - began)) s"

echo "== 3 of 4: walker_walk with mcts_pw, 3 seeds, $steps environment steps each"
run=("$bin/runner" --config experiments/quickstart.cfg --steps "$steps" --db "$db")
"${run[@]}" --dry-run 2>/dev/null | grep '^total' || true
"${run[@]}"
echo "trained after $((SECONDS - began)) s"

echo "== 4 of 4: the learning curve"
"$bin/results" list --db "$db"
"$bin/results" curves --db "$db" --out "$figure"
"$bin/results" curves --db "$db" --out "${figure%.png}.svg"

cat <<EOT

Done after $((SECONDS - began)) s.
  database      $root/$db
  curve         $root/$figure (and .svg)
  logs          $root/$db.files/

What to type next:
  $bin/runner --env walker_walk --planner dreamer,mcts_pw --seeds 3    compare with Dreamer (about an hour)
  $bin/runner list                                                     tasks, models, planners
  $bin/runner describe mcts_pw                                         what can be set
  $bin/results curves --db $db --out curve.csv    the numbers behind the curve
EOT
