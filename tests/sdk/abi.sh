#!/usr/bin/env bash
# Is the plugin boundary what tests/sdk/sdk_1.abi says? Compiles abi_subject.cc against the headers
# and compares it with that description, by Debian's abidiff. --remake writes the description anew:
# after the boundary has grown as version.h allows, with a higher minor version.
#
#     tests/sdk/abi.sh [--remake] [COMPILER]      COMPILER is g++ unless given
#     exit code: 0 equal, 1 changed, 77 abidiff or g++ is not there
#
# INCLUDE names another folder of headers than sdk/include.
set -euo pipefail

source=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
remake=
[[ "${1:-}" == --remake ]] && { remake=yes; shift; }
compiler=${1:-g++}
for tool in abidw abidiff "$compiler"; do
  command -v "$tool" >/dev/null || { echo "skipped: $tool is not there (abigail-tools)"; exit 77; }
done
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
# Every class with its virtual functions, though none is defined here.
"$compiler" -std=c++20 -g -O0 -fPIC -shared -femit-class-debug-always \
  -I"${INCLUDE:-$source/sdk/include}" "$source/tests/sdk/abi_subject.cc" -o "$folder/subject.so"
if [[ -n "$remake" ]]; then
  abidw --no-show-locs --no-comp-dir-path --no-corpus-path "$folder/subject.so" \
    >"$source/tests/sdk/sdk_1.abi"
  exit 0
fi
if ! abidiff --no-show-locs "$source/tests/sdk/sdk_1.abi" "$folder/subject.so"; then
  echo "The plugin boundary is not what tests/sdk/sdk_1.abi describes. What sdk/include/dreamsearch/version.h"
  echo "forbids must be undone; after growth, raise DREAMSEARCH_SDK_MINOR and run tests/sdk/abi.sh --remake."
  exit 1
fi
