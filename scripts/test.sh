#!/usr/bin/env bash
# The tests: sets up, builds and runs ctest on one preset (default: release); further arguments go to ctest.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

preset=${1:-release}
[ $# -gt 0 ] && shift
scripts/setup.sh
scripts/build.sh "$preset"
ctest --preset "$preset" -j "$(nproc)" "$@"
