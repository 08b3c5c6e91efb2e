#!/usr/bin/env bash
# From a fresh Debian 12 to a learning curve: installs what is missing, builds,
# trains three small agents that search while they learn, and draws the curve.
# Give it again and it goes on where it stopped. More steps: STEPS=100000.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
steps=${STEPS:-16000}
db=results/quickstart.db
figure=results/quickstart.png

echo "== 1 of 4: packages"
experiments/install_packages.sh
echo "== 2 of 4: build (in build/release)"
mkdir -p build
cmake --preset release -DDREAMSEARCH_TESTS=OFF >build/configure.log 2>&1 ||
  { cat build/configure.log >&2; exit 1; }
cmake --build --preset release
bin=build/release/bin
echo "== 3 of 4: walker_walk with mcts_pw, 3 seeds, $steps environment steps each"
"$bin/runner" --config experiments/quickstart.cfg --steps "$steps" --db "$db"
echo "== 4 of 4: the learning curve"
"$bin/results" list --db "$db"
"$bin/results" curves --db "$db" --out "$figure"
"$bin/results" curves --db "$db" --out "${figure%.png}.svg"

cat <<EOT

Done.
  database      $root/$db
  curve         $root/$figure (and .svg)
  logs          $root/$db.files/

What to type next:
  $bin/runner --env walker_walk --planner dreamer,mcts_pw --seeds 3    compare with Dreamer (about an hour)
  $bin/runner list                                                     tasks, models, planners
  $bin/runner describe mcts_pw                                         what can be set
  $bin/results curves --db $db --out curve.csv    the numbers behind the curve
EOT
