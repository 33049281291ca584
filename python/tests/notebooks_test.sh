#!/usr/bin/env bash
# notebooks_test.sh SOURCE: runs every notebook of examples/notebooks.
set -euo pipefail
export MPLBACKEND=agg
exec bash "$(dirname "$0")/in_environment.sh" "$1" nbmake -m pytest -q -p no:cacheprovider --nbmake --nbmake-timeout=120 \
  "$1/examples/notebooks"
