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
  expect 2 "no flag .--no-such-option.\. .results $command --help. lists" "$results" "$command" --no-such-option
done
expect 0 "results " "$results" --version
expect 0 "^Usage" "$results" --help
expect 2 "Did you mean curves" "$results" curvs
expect 2 "Did you mean mcts_pw" "$results" list --db "$database" --planner mcts_wp
expect 66 "no such database" "$results" list --db "$folder/none.db"
printf 'no database at all, but a text that is longer than a header of a hundred bytes, so that SQLite reads it' > "$folder/text.db"
expect 65 "not an SQLite file" "$results" list --db "$folder/text.db"
expect 65 "found a folder" "$results" list --db "$folder"
: > "$folder/empty.db"
expect 65 "is empty" "$results" list --db "$folder/empty.db"

expect 0 "walker_walk" "$results" list --db "$database"
expect 0 '"planner"' "$results" list --db "$database" --format json
expect 0 "Settings" "$results" show 1 --db "$database"
if "$results" list --db "$database" --format json | grep '"last eval."' | grep -q '[0-9.]\{6\}'; then
  failures=$((failures + 1)); echo "FAILED: an evaluation of more than four digits"
fi
expect 0 "nothing is missing" "$results" list --db "$database" --missing
expect 2 "expected --missing or --status, found both" "$results" list --db "$database" --missing --status failed
expect 66 "no run 'zzzz'" "$results" show zzzz --db "$database"

expect 0 "wrote" "$results" curves --db "$database" --out "$folder/a.svg" --out "$folder/a.png" --out "$folder/a.csv"
expect 0 "n = 5" cat "$folder/a.svg"
expect 0 "PNG" head -c 8 "$folder/a.png"
expect 0 "task,line,env_step,x,mean,lo,hi,n" head -1 "$folder/a.csv"
expect 2 "suffix" "$results" curves --db "$database" --out "$folder/a.bmp"
expect 73 "cannot create" "$results" curves --db "$database" --out "$folder/none/a.svg"
expect 2 "results curves: --phase: expected evaluation, training (0)" "$results" curves --db "$database" --phase 9
expect 0 "wrote" "$results" curves --db "$database" --kind mean --x seconds --out "$folder/b.svg"
expect 0 "wrote" "$results" curves --db "$database" --kind time --out "$folder/c.svg"
# The table of the figure that is drawn.
expect 0 "wrote" "$results" curves --db "$database" --kind mean --out "$folder/mean.csv"
expect 0 "^line,env_step,x,mean,lo,hi,n" head -1 "$folder/mean.csv"
expect 0 "wrote" "$results" curves --db "$database" --kind time --out "$folder/time.csv"
expect 0 "^line,runs,activity,seconds_for_1000_env_steps" head -1 "$folder/time.csv"
for points in 2 0 1001 9223372036854775807 x; do
  expect 2 "--smooth" "$results" curves --db "$database" --smooth $points --out "$folder/d.svg"
done
expect 0 "wrote" "$results" curves --db "$database" --smooth 3 --out "$folder/d.svg"
expect 66 "Known: none" "$results" curves --db "$database" --published all --out "$folder/d.svg"
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
# Files that a merged run has in another database's folder are not this one's to delete.
kept="$folder/$(dirname "$(sqlite3 "$folder/merged.db" "SELECT log_path FROM run WHERE run_id = 3")")"
mkdir -p "$kept"
expect 0 "kept .*/$(basename "$kept"): it belongs" "$results" delete 3 --files --yes --db "$folder/merged.db"
if [ ! -d "$kept" ]; then failures=$((failures + 1)); echo "FAILED: files of a merged run's source are gone"; fi
rm -r "$kept"

expect 0 "would delete run 1" "$results" delete 1 --db "$folder/copy.db"
expect 0 "walker_walk" "$results" show 1 --db "$folder/copy.db"
expect 0 "deleted run 1" "$results" delete 1 --yes --db "$folder/copy.db"
expect 66 "no run '1'" "$results" show 1 --db "$folder/copy.db"
expect 2 "no run status" "$results" delete --status gone --db "$folder/copy.db"
expect 2 "no run status" "$results" list --status gone --db "$folder/copy.db"
# With a run go its evaluations, named and counted, and their files; unless one is active.
sqlite3 "$folder/copy.db" "INSERT INTO run SELECT 900, '00000000-0000-4000-8000-000000000900', study_id, task_id, planner, model,
  env_plugin, model_plugin, planner_plugin, config_id, preset, seed, action_repeat, 0, 0, 'running', 2, log_path, NULL, '', argv,
  build_id, created_utc, NULL, strftime('%Y-%m-%dT%H:%M:%fZ', 'now'), NULL, log_path_sha256 FROM run WHERE run_id = 2"
files="$folder/copy.db.files/00000000-0000-4000-8000-000000000900"
mkdir -p "$files"
expect 2 "run 900, an evaluation of run 2, is running" "$results" delete 2 --yes --db "$folder/copy.db"
sqlite3 "$folder/copy.db" "UPDATE run SET status = 'failed' WHERE run_id = 900"
expect 0 "would delete run 900 .*evaluation of run 2" "$results" delete 2 --db "$folder/copy.db"
expect 0 "2 runs, 1 of them evaluations" "$results" delete 2 --files --yes --db "$folder/copy.db"
expect 66 "no run '900'" "$results" show 900 --db "$folder/copy.db"
if [ -d "$files" ]; then failures=$((failures + 1)); echo "FAILED: files of an evaluation stay"; fi
# What is missing, of what was asked for.
expect 0 "dreamer" "$results" list --missing --planner dreamer --db "$folder/copy.db"
expect 0 "nothing is missing" "$results" list --missing --planner rollout --db "$folder/copy.db"
# Settings that tell runs apart, without the path that they share.
sqlite3 "$folder/copy.db" "INSERT INTO config VALUES (900, 'x', '{\"run\":{\"depth\":3}}');
  UPDATE run SET config_id = 900 WHERE run_id = 3"
expect 0 " depth=3 " "$results" list --db "$folder/copy.db"
sqlite3 "$folder/copy.db" "UPDATE config SET json = '{\"run\":{\"sha\":\"' || hex(zeroblob(32)) || '\"}}' WHERE config_id = 900"
expect 0 ' sha="000000000000000000000000\.\.\. ' "$results" list --db "$folder/copy.db"
expect 2 "expected either" "$results" delete --yes --db "$folder/copy.db"

for format in csv jsonl dreamer; do
  expect 0 "wrote" "$results" export --db "$database" --format $format --out "$folder/out.$format"
done
for rows in curves episodes finals runs scalars steps times; do
  expect 0 "" "$results" export --db "$database" --rows $rows --out "$folder/rows"
done
for rows in curves episodes finals; do
  "$results" export --db "$database" --rows $rows --phase evaluation --out "$folder/some" 2>/dev/null
  "$results" export --db "$database" --rows $rows --out "$folder/every" 2>/dev/null
  if [ "$(wc -l < "$folder/some")" -ge "$(wc -l < "$folder/every")" ]; then
    failures=$((failures + 1)); echo "FAILED: --phase leaves out no $rows"
  fi
done
expect 2 "rows of 'steps' have no phase" "$results" export --db "$database" --rows steps --phase 1
expect 0 "points" "$results" import "$folder/out.dreamer" --db "$folder/imported.db"
expect 66 "Did you mean dreamer" "$results" curves --db "$folder/imported.db" --published dremer --out "$folder/d.svg"
expect 0 "files below" "$results" export --db "$database" --format tdmpc2 --out "$folder/scores"
expect 0 "wrote 1 file below" "$results" export --db "$database" --format tdmpc2 --env walker_walk --planner rollout --out "$folder/score"
expect 0 "points" "$results" import "$folder/scores/rollout/walker-walk.csv" --db "$folder/imported.db"
expect 0 "rollout" "$results" sql "SELECT DISTINCT method FROM published" --db "$folder/imported.db"
printf 'step,reward,seed\n1,x,0\n' > "$folder/bad.csv"
expect 65 "bad.csv:2" "$results" import "$folder/bad.csv" --db "$folder/imported.db"
# What a query or a file loses is said.
expect 2 "two columns are called 'name'" "$results" sql "SELECT s.name, t.name FROM study s, task t" --format json --db "$database"
expect 0 "name  *name" "$results" sql "SELECT s.name, t.name FROM study s, task t" --db "$database"
gzip -c "$folder/out.dreamer" > "$folder/dmc_proprio-ours.json.gz"
expect 0 "points" "$results" import "$folder/dmc_proprio-ours.json.gz" --db "$folder/packed.db"
expect 0 "^obs state " sh -c "'$results' sql \"SELECT DISTINCT obs FROM published\" --db '$folder/packed.db' | tr '\n' ' '"
expect 0 "does not say what the method observes" "$results" import "$folder/out.dreamer" --db "$folder/packed.db"
# Text loses the two marks of a database; its rows are the same.
sqlite3 "$database" .dump | sqlite3 "$folder/dumped.db"
expect 0 "as they were written" "$results" verify --db "$folder/dumped.db"
# A copy, with other UUIDs, is the same experiments done twice.
sqlite3 "$database" ".backup '$folder/twice.db'"
sqlite3 "$folder/twice.db" "UPDATE run SET uuid = 'ffffffff' || substr(uuid, 9, 20) || printf('%08d', run_id)"
"$results" compare --format csv --db "$database" > "$folder/once.csv" 2>/dev/null
"$results" compare --format csv --db "$database,$folder/twice.db" > "$folder/both.csv" 2>/dev/null
cmp "$folder/once.csv" "$folder/both.csv" || failures=$((failures + 1))
expect 0 "was run twice" "$results" curves --db "$database,$folder/twice.db" --out "$folder/both.svg"
expect 0 "was run twice" "$results" compare --db "$database,$folder/twice.db" --repetitions 100
"$results" export --rows finals --db "$database" > "$folder/once.csv" 2>/dev/null
"$results" export --rows finals --db "$database,$folder/twice.db" > "$folder/both.csv" 2>/dev/null
cmp "$folder/once.csv" "$folder/both.csv" || failures=$((failures + 1))
# A list on a full standard output fails loudly.
expect 74 "standard output" sh -c "'$results' list --db '$database' > /dev/full"

echo "$failures failures"
[ "$failures" -eq 0 ]
