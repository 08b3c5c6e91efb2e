#!/usr/bin/env bash
# Makes packages and tries each on a fresh machine: tests/packages/run.sh [deb] [tarball] [wheel]
#
# Without arguments all of them. Needs what the build needs, the network and, for the first two,
# root and mmdebstrap; what cannot be tried here is said, and the exit is then 77. Packages and
# root folders are kept in FOLDER, build/packages by default. From any folder, as often as you like.
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/../.."
mkdir -p "${FOLDER:-build/packages}"
folder=$(cd "${FOLDER:-build/packages}" && pwd)
kinds=("$@")
[[ $# -gt 0 ]] || kinds=(deb tarball wheel)

experiments/install_packages.sh
cmake --preset release -DDREAMSEARCH_TESTS=OFF
cmake --build --preset release
rm -f "$folder"/dreamsearch[-_]*.{deb,tar.gz,whl}  # of another build
status=0
tried=()
for kind in "${kinds[@]}"; do
  made=0
  case "$kind" in
    deb) cpack --config build/release/CPackConfig.cmake -G DEB -B "$folder" ;;
    tarball) cpack --config build/release/CPackConfig.cmake -G TGZ -B "$folder" ;;
    wheel) packaging/build_wheel.sh "$folder" || made=$? ;;
    *) echo "expected deb, tarball or wheel, found $kind" >&2; exit 2 ;;
  esac
  case "$made" in
    0) tried+=("$kind") ;;
    77) status=77 ;;
    *) exit "$made" ;;
  esac
done
if [[ ${#tried[@]} -gt 0 ]]; then
  python3 tests/packages/packages_test.py "$folder" "${tried[@]}" || status=$?
fi
exit "$status"
