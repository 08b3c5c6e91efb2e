#!/usr/bin/env bash
# Runs clang-tidy (.clang-tidy) over our own sources: tests/tidy.sh [part of a path...].
# Takes about five seconds a file and core.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
experiments/install_packages.sh --tests
# With an entry for each file.
cmake --preset debug -B build/tidy -DDREAMSEARCH_JOINT_UNITS=OFF >/dev/null
if [[ $# -eq 0 ]]; then set -- /sdk/ /host/ /results/ /plugins/ /tests/; fi
cmake --build build/tidy --target dreamsearch_build_info >/dev/null
# clang does not know some of g++'s warnings, which are switched off by name.
exec run-clang-tidy -quiet -p build/tidy -extra-arg=-Wno-unknown-warning-option "$@"
