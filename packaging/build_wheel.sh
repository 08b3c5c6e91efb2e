#!/usr/bin/env bash
# Builds the wheel into a folder, dist/ by default: packaging/build_wheel.sh [FOLDER]
#
# It carries all libraries but glibc, libstdc++ and libgcc; its tag says how new a glibc it needs.
# Needs Python 3.11 or newer and PyPI, for the tools that build it; ends with 77 where there is none.
set -euo pipefail

source=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
mkdir -p "${1:-dist}"
folder=$(cd "${1:-dist}" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python3 -m venv "$work/tools" || {
  echo "expected Python 3.11 or newer with its module venv; Debian: apt-get install python3-venv" >&2
  exit 69
}
"$work/tools/bin/pip" install -q build auditwheel wheel || {
  echo "skipped: the tools that build a wheel cannot be had from PyPI" >&2
  exit 77
}
export PATH="$work/tools/bin:$PATH"
export CXX=${CXX:-c++}  # as CMake chooses, so that a cache of objects knows them
python -m build --wheel --outdir "$work" "$source"
wheel=$(echo "$work"/*.whl)

# Of the versions of the symbols that it needs.
auditwheel show "$wheel" >"$work/audit"
tag=$(grep -o 'manylinux_2_[0-9]*_x86_64' "$work/audit" | head -1)
wheel tags --remove --platform-tag "$tag" "$wheel" >/dev/null
rm -f "$folder"/dreamsearch-*.whl
cp "$work"/dreamsearch-*.whl "$folder"
ls "$folder"/dreamsearch-*.whl
