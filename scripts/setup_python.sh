#!/usr/bin/env bash
# Installs Python modules that Debian 12 does not package from PyPI into the virtual environment build/python: lcm, with
# its version of LCM's tools (lcm-spy and others), and cantools, with which tests read config/can/abs_rig.dbc. The
# script may be repeated without harm.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

environment=build/python
if "$environment/bin/python" -c 'import lcm, cantools, setuptools, wheel' 2>/dev/null; then
  echo "setup: $environment has lcm and cantools"
  exit 0
fi
python3 -m venv "$environment" || { echo "setup: install python3-venv" >&2; exit 3; }
"$environment/bin/pip" install --quiet --disable-pip-version-check 'lcm==1.5.3' 'cantools==45.1.0' 'setuptools>=61' wheel
echo "setup: installed lcm 1.5.3 and cantools 45.1.0 into $environment"
