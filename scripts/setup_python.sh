#!/usr/bin/env bash
# setup_python.sh [LIST]: installs the Python packages of scripts/LIST from PyPI into the virtual environment
# build/python, which sees Debian's packages too. LIST is python-packages-tests.txt by default, which includes those of
# python-packages.txt: what the programs need. The script may be repeated without harm.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

lists=(scripts/python-packages.txt)
[ "${1:-python-packages-tests.txt}" = python-packages.txt ] || lists+=("scripts/${1:-python-packages-tests.txt}")
mapfile -t wanted < <(sed 's/#.*//; s/[[:space:]]*$//; /^$/d' "${lists[@]}")

environment=build/python
stamp=$environment/$(basename "${lists[-1]}")
if [ -e "$stamp" ] && [ "$(cat "$stamp")" = "${wanted[*]}" ]; then
  echo "setup: $environment has ${wanted[*]}"
  exit 0
fi
python=/usr/bin/python3
[ -x "$python" ] || python=python3
if ! grep -q '^include-system-site-packages = true' "$environment/pyvenv.cfg" 2>/dev/null; then
  "$python" -m venv --clear --system-site-packages "$environment" || { echo "setup: install python3-venv" >&2; exit 3; }
fi
"$environment/bin/pip" install --quiet --disable-pip-version-check "${wanted[@]}"
echo "${wanted[*]}" >"$stamp"
echo "setup: installed ${wanted[*]} into $environment"
