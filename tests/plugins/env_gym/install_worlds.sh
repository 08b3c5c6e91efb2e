#!/usr/bin/env bash
# install_worlds.sh FOLDER - a virtual environment with Gymnasium and dm_control, for the tests.
# Does nothing if it is there. Exits 77, "skipped", where PyPI cannot be reached.
set -euo pipefail
folder=$1
packages=(gymnasium[mujoco]==1.4.0 mujoco==3.17.0 dm_control==1.0.50 numpy==2.4.6)
[[ -e "$folder/complete" ]] && exit 0
rm -rf "$folder"
/usr/bin/python3 -m venv "$folder" || { echo "cannot make a virtual environment"; exit 77; }
"$folder/bin/pip" install -q --disable-pip-version-check --only-binary :all: "${packages[@]}" || {
  echo "cannot install ${packages[*]}"
  exit 77
}
touch "$folder/complete"
