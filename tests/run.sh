#!/usr/bin/env bash
# Installs what is missing, builds everything and runs every test. From any
# folder, as root or with sudo, as often as you like. PRESET=asan tests/run.sh
# runs them under a sanitizer; arguments go to ctest: tests/run.sh -L fast.
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
preset=${PRESET:-release}
experiments/install_packages.sh --tests
cmake --preset "$preset" -DDREAMSEARCH_TESTS=ON
cmake --build --preset "$preset"
ctest --preset "$preset" "$@"
