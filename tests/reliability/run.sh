#!/usr/bin/env bash
# Every reliability harness in full, one after the other, with what each printed. Takes hours; from
# any folder. tests/README.md says what each shows. `tests/reliability/run.sh build/release` for
# another build than that; `tests/reliability/run.sh build/release kill` for those whose names
# begin with a word.
set -uo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
build=$(cd "${1:-$here/../../build/release}" && pwd)
only=${2:-}
status=0

harness() {
  local name=$1
  shift
  [[ $name == "$only"* ]] || return 0
  echo "== $name: $*"
  local begin=$SECONDS
  "$@"
  local code=$?
  echo "== $name: exit $code after $((SECONDS - begin)) s"
  [[ $code == 0 || $code == 77 ]] || status=1
}

python=${PYTHON:-/usr/bin/python3}
harness kill_points "$python" "$here/kill_points.py" "$build/bin" --steps 2000
harness kill_points_journal_off "$python" "$here/kill_points.py" "$build/bin" --points 40 \
  --journal-off "$build/tests/reliability/libno_journal.so"
harness kill_cycles "$python" "$here/kill_cycles.py" "$build/bin" --cycles 200
harness disk_faults "$python" "$here/disk_faults.py" "$build/bin" --points 100
harness flipped_bytes "$python" "$here/flipped_bytes.py" "$build/bin" --flips 1000
harness resigned_checkpoints "$python" "$here/resigned_checkpoints.py" "$build/bin" --changes 1000
harness hostile_databases "$python" "$here/hostile_databases.py" "$build/bin"
harness growth "$python" "$here/growth.py" "$build/bin" --seconds 600
harness determinism "$python" "$here/determinism.py" "$build/bin" --full
fuzz=${FUZZ_BUILD:-$here/../../build/debug}
for target in configuration descriptor checkpoint importer model_file; do
  if [[ -x $fuzz/tests/bin/fuzz ]]; then
    harness "fuzz_$target" "$fuzz/tests/bin/fuzz" "$target" --executions 1000000
  else
    echo "== fuzz_$target: skipped, $fuzz/tests/bin/fuzz is not built (preset debug or asan)"
  fi
done
exit $status
