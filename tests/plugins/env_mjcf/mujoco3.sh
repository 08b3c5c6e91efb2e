#!/usr/bin/env bash
# mujoco3.sh FOLDER [CMAKE_FLAG...] - builds the plugin env_mjcf3 against PyPI's package mujoco, in a
# virtual environment in FOLDER, and tests it beside env_mjcf. Exits 77, "skipped", where PyPI cannot
# be reached.
set -euo pipefail
folder=$1
shift
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)
package=mujoco==3.17.0
mkdir -p "$folder"
if [[ ! -e "$folder/complete" ]]; then
  /usr/bin/python3 -m venv "$folder/venv" || { echo "skipped: cannot make a virtual environment"; exit 77; }
  "$folder/venv/bin/pip" install -q --disable-pip-version-check --no-deps --only-binary :all: \
    "$package" || { echo "skipped: cannot install $package"; exit 77; }
  touch "$folder/complete"
fi
wheel=$("$folder/venv/bin/python" -c \
  'import importlib.util; print(importlib.util.find_spec("mujoco").submodule_search_locations[0])')
cmake -S "$root" -B "$folder/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DDREAMSEARCH_TESTS=ON \
  -DDREAMSEARCH_BENCHMARKS=OFF -DDREAMSEARCH_MUJOCO_WHEEL="$wheel" "$@" >/dev/null
cmake --build "$folder/build" --target two_engines_test
"$folder/build/tests/bin/two_engines_test"
