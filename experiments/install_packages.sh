#!/usr/bin/env bash
# Installs the Debian packages that are missing here: those for building and
# running, and with --tests also those that only the tests need. Does nothing, and
# needs no rights, when all are there.
set -euo pipefail

packages=(
  g++ cmake ninja-build git
  pkg-config libhwy-dev libmujoco-dev
  libboost-dev libboost-program-options-dev
  libsqlite3-dev libssl-dev nlohmann-json3-dev zlib1g-dev
  libeigen3-dev libcairo2-dev libegl-dev libegl1 libgl1-mesa-dri
  sqlite3 gnuplot-nox libjs-chart.js ffmpeg
)
if [[ "${1:-}" == --tests ]]; then
  packages+=(libgtest-dev libgmock-dev libbenchmark-dev
             libdnnl-dev libxsmm-dev abigail-tools
             python3 python3-numpy python3-pandas python3-scipy python3-venv chromium clang-format clang-tidy
             slurm-wlm munge strace)
elif [[ $# -gt 0 ]]; then
  echo "usage: $0 [--tests]" >&2
  exit 2
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ "$status" == installed ]] || missing+=("$package")
done
[[ ${#missing[@]} -eq 0 ]] && exit 0

echo "installing ${missing[*]}"
as_root=()
if [[ $(id -u) -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "error: packages are missing and there is no sudo; as root, run:" >&2
    echo "  apt-get install ${missing[*]}" >&2
    exit 77
  fi
  as_root=(sudo)
fi
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
