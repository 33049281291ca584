#!/usr/bin/env bash
# in_environment.sh SOURCE MODULE ARGUMENT...: runs the virtual environment's Python with these arguments. Status 77 if it
# lacks the module; a failure where CI=true.
set -euo pipefail
python=$1/build/python/bin/python module=$2
shift 2
if ! "$python" -c "import $module" 2>/dev/null; then
  echo "SKIPPED: build/python has no $module: scripts/setup_python.sh"
  if [ "${CI:-}" = true ]; then exit 1; else exit 77; fi
fi
exec "$python" "$@"
