#!/usr/bin/env bash
# LCM's Python module, which Debian 12 does not package, from PyPI into build/python-lcm, a virtual environment of its own.
# It brings LCM's tools of that version along, lcm-spy among them. Harmless when repeated.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

environment=build/python-lcm
if "$environment/bin/python" -c 'import lcm, setuptools, wheel' 2>/dev/null; then
  echo "setup: $environment has lcm"
  exit 0
fi
python3 -m venv "$environment" || { echo "setup: install python3-venv" >&2; exit 3; }
"$environment/bin/pip" install --quiet --disable-pip-version-check 'lcm==1.5.3' 'setuptools>=61' wheel
echo "setup: installed lcm 1.5.3 into $environment"
