#!/usr/bin/env bash
# Times dreamsearch and its peers in one run, on one core with one thread each, and
# prints the ratios: an update and the same in PyTorch, searches and Mctx's, an
# environment step and EnvPool's and dm_control's. See README.md beside this file.
#
#     tests/benchmark/peers.sh [--turns N] [--only update,search,step] [--tasks NAME,...]
#                              [--core N] [--torch-python PYTHON]
#
# PRESET=release is the build to measure, VENV=build/peers the virtual environment for
# what comes from PyPI, PYTHON=python3 what makes it. A peer that cannot be had here is
# skipped, and the table says why.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$here/../.."
preset=${PRESET:-release}
venv=${VENV:-build/peers}

{
  cmake --preset "$preset" -DDREAMSEARCH_TESTS=ON -DDREAMSEARCH_BENCHMARKS=ON
  cmake --build --preset "$preset" --target \
    model_dreamer_benchmark planner_latency env_dmc_benchmark write_golden_input
} >&2

[[ -x $venv/bin/python ]] || "${PYTHON:-python3}" -m venv "$venv" >&2
install() {
  "$venv/bin/python" -m pip install --quiet --only-binary :all: "$@" >&2 ||
    echo "could not install $*" >&2
}
install mctx==0.0.71 jax==0.10.2
install envpool==1.2.5
install dm_control==1.0.50 mujoco==3.17.0  # dm_control fails with MuJoCo 4.0.0

exec "$venv/bin/python" "$here/peers/compare.py" --programs "build/$preset/tests/bin" "$@"
