#!/usr/bin/env bash
# Keeps a page of results/published true. Runs of the databases that are given are merged into the
# one beside the page, finished ones alone and without their decisions, and checked; then every
# table of the page is printed anew. A table stands below the command that prints it,
#   <!-- $ results sql --db results/published/NAME.db ... -->
# and ends at `<!-- end -->`. Commands run in the project's folder, by bash, with the programs of
# build/release. Stop a `runner` that still works on a database first.
#   experiments/publish.sh PAGE [DATABASE ...]
#   experiments/publish.sh results/published/twenty_100k.md results/twenty_100k.db
set -euo pipefail

if [ $# -lt 1 ] || [ ! -f "$1" ]; then
  sed -n '/^# Keeps/,/^#   experiments.*db$/p' "${BASH_SOURCE[0]}" | sed 's/^# \?//' >&2
  exit 2
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
export PATH="${DREAMSEARCH_BIN:-$root/build/release/bin}:$PATH"
page=$(realpath "$1")
shift

# A page NAME.md has its runs in NAME.db, a page in a folder of its own in runs.db.
runs=${page%.md}.db
[ "$(basename "$page")" != README.md ] || runs=$(dirname "$page")/runs.db

if [ $# -gt 0 ]; then
  results merge "$@" --db "$runs" --without-decisions
  results delete --db "$runs" --status queued,running,interrupted --yes
  results verify --db "$runs"
fi

new=$(mktemp "$page.XXXXXX")
trap 'rm -f "$new"' EXIT
copying=true
while IFS= read -r line; do
  if [[ $line == '<!-- $ '*' -->' ]]; then
    command=${line#'<!-- $ '}
    printf '%s\n' "$line"
    (cd "$root" && bash -euo pipefail -c "${command%' -->'}")
    copying=false
  elif [[ $line == '<!-- end -->' ]]; then
    copying=true
  fi
  if $copying; then printf '%s\n' "$line"; fi
done <"$page" >"$new"
if ! $copying; then
  echo "$page: a table has no <!-- end -->" >&2
  exit 65
fi
cat "$new" >"$page"
