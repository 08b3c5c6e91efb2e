#!/usr/bin/env bash
# Every table of the published pages is what its command prints today.
#   pages_check.sh PROJECT PROGRAMS
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failed=0
pages=$(grep -l '^<!-- \$ ' -r "$1/results/published" --include='*.md')
for page in $pages; do
  cp "$page" "$folder/page.md"
  DREAMSEARCH_BIN=$2 "$1/experiments/publish.sh" "$folder/page.md"
  diff -u "$page" "$folder/page.md" || failed=1
done
exit $failed
