#!/bin/sh
# Exit codes and outputs of the program `results`.
#
# usage: program_check.sh RESULTS_PROGRAM DATABASE
set -u
results=$1
database=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failures=0

# expect CODE PATTERN COMMAND...: the exit code, and a pattern in what is printed.
expect() {
  code=$1 pattern=$2
  shift 2
  output=$("$@" 2>&1 </dev/null)
  status=$?
  if [ "$status" -ne "$code" ] || ! printf '%s' "$output" | grep -q -- "$pattern"; then
    failures=$((failures + 1))
    printf 'FAILED: %s\n  expected exit %s and "%s", found exit %s:\n%s\n' \
      "$*" "$code" "$pattern" "$status" "$output" | cut -c1-500
  fi
}

for command in list show curves compare report export import merge verify delete sql; do
  expect 0 "results $command" "$results" "$command" --help
  expect 2 "unrecognised option" "$results" "$command" --no-such-option
done
expect 0 "results " "$results" --version
expect 0 "usage" "$results" --help
expect 2 "Did you mean 'curves'" "$results" curvs
expect 2 "Did you mean 'mcts_pw'" "$results" list --db "$database" --planner mcts_wp
expect 66 "no such database" "$results" list --db "$folder/none.db"
printf 'no database at all, but a text that is longer than a header of a hundred bytes, so that SQLite reads it' > "$folder/text.db"
expect 65 "not an SQLite file" "$results" list --db "$folder/text.db"
expect 65 "found a folder" "$results" list --db "$folder"
: > "$folder/empty.db"
expect 65 "is empty" "$results" list --db "$folder/empty.db"

expect 0 "walker_walk" "$results" list --db "$database"
expect 0 '"planner"' "$results" list --db "$database" --format json
expect 0 "Settings" "$results" show 1 --db "$database"
expect 66 "no run 'zzzz'" "$results" show zzzz --db "$database"

expect 0 "wrote" "$results" curves --db "$database" --out "$folder/a.svg" --out "$folder/a.png" --out "$folder/a.csv"
expect 0 "n = 5" cat "$folder/a.svg"
expect 0 "PNG" head -c 8 "$folder/a.png"
expect 0 "task,line,env_step,x,mean,lo,hi,n" head -1 "$folder/a.csv"
expect 2 "suffix" "$results" curves --db "$database" --out "$folder/a.bmp"
expect 73 "cannot be created" "$results" curves --db "$database" --out "$folder/none/a.svg"
expect 2 "no phase" "$results" curves --db "$database" --phase 9
expect 0 "wrote" "$results" curves --db "$database" --kind mean --x seconds --out "$folder/b.svg"
expect 0 "wrote" "$results" curves --db "$database" --kind time --out "$folder/c.svg"
# Not the picture of before under a new name: a changed request is a changed picture.
if cmp -s "$folder/a.svg" "$folder/b.svg"; then failures=$((failures + 1)); echo "FAILED: equal pictures"; fi

expect 0 "interquartile mean" "$results" compare --db "$database"
"$results" compare --db "$database" --format json --bootstrap-seed 3 > "$folder/1.json"
"$results" compare --db "$database" --format json --bootstrap-seed 3 > "$folder/2.json"
cmp "$folder/1.json" "$folder/2.json" || failures=$((failures + 1))

expect 0 "3" "$results" sql "SELECT 1 + 2 AS three" --db "$database"
for query in "DELETE FROM run" "PRAGMA query_only = OFF" "ATTACH 'x' AS y" "SELECT 1; SELECT 2" "nonsense"; do
  expect 2 "quer" "$results" sql "$query" --db "$database"
done

cp "$database" "$folder/copy.db"
expect 0 "as they were written" "$results" verify --db "$folder/copy.db"
expect 0 "runs added" "$results" merge --db "$folder/merged.db" "$folder/copy.db"
expect 0 " 0 runs added, 0 replaced" "$results" merge --db "$folder/merged.db" "$folder/copy.db"
expect 0 "as they were written" "$results" verify --db "$folder/merged.db"
expect 66 "no such database" "$results" merge --db "$folder/merged.db" "$folder/none.db"
sqlite3 "$folder/merged.db" "UPDATE episode SET length = length + 1 WHERE run_id = 2 AND phase = 0 AND episode = 3"
expect 78 "run 2" "$results" verify --db "$folder/merged.db"

expect 0 "would delete run 1" "$results" delete 1 --db "$folder/copy.db"
expect 0 "walker_walk" "$results" show 1 --db "$folder/copy.db"
expect 0 "deleted run 1" "$results" delete 1 --yes --db "$folder/copy.db"
expect 66 "no run '1'" "$results" show 1 --db "$folder/copy.db"
expect 2 "expected either" "$results" delete --yes --db "$folder/copy.db"

for format in csv jsonl dreamer; do
  expect 0 "wrote" "$results" export --db "$database" --format $format --out "$folder/out.$format"
done
for rows in curves episodes finals runs scalars steps times; do
  expect 0 "" "$results" export --db "$database" --rows $rows --out "$folder/rows"
done
expect 0 "points" "$results" import "$folder/out.dreamer" --db "$folder/imported.db"
expect 0 "files below" "$results" export --db "$database" --format tdmpc2 --out "$folder/scores"
expect 0 "points" "$results" import "$folder/scores/rollout/walker-walk.csv" --db "$folder/imported.db"
expect 0 "rollout" "$results" sql "SELECT DISTINCT method FROM published" --db "$folder/imported.db"
printf 'step,reward,seed\n1,x,0\n' > "$folder/bad.csv"
expect 65 "bad.csv:2" "$results" import "$folder/bad.csv" --db "$folder/imported.db"
# A list on a full standard output fails loudly.
expect 74 "standard output" sh -c "'$results' list --db '$database' > /dev/full"

echo "$failures failures"
[ "$failures" -eq 0 ]
