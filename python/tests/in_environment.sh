#!/usr/bin/env bash
# in_environment.sh SOURCE MODULE,... ARGUMENT...: runs the virtual environment's Python with these arguments. Status 77 if it
# lacks one of the modules.
set -euo pipefail
python=$1/build/python/bin/python modules=$2
shift 2
if ! reason=$("$python" -c "import $modules" 2>&1); then
  echo "SKIPPED: build/python does not give $modules: ${reason##*$'\n'}: scripts/setup_python.sh"
  exit 77
fi
exec "$python" "$@"
