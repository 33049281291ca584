#!/usr/bin/env bash
# The tests: sets up, builds and runs ctest on one preset (default: release); further arguments go to ctest, without any
# those labelled on-demand are left out (long ones: ctest -L on-demand runs them). Where
# CI=true or ABS_HIL_REQUIRE_VM=1 the tests in a virtual machine must not be skipped, and what they need is installed;
# where CI=true, what the tests of abs-spy, of LCM's Python module and of abs_report need as well.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

preset=${1:-release}
[ $# -gt 0 ] && shift
scripts/setup.sh
if [ "${CI:-}" = true ] || [ "${ABS_HIL_REQUIRE_VM:-}" = 1 ]; then scripts/setup.sh packages-vm.txt; fi
if [ "${CI:-}" = true ]; then
  scripts/setup.sh packages-spy.txt
  scripts/setup.sh packages-report.txt
  scripts/setup_python.sh
fi
scripts/build.sh "$preset"
[ $# -gt 0 ] || set -- -LE on-demand
# Some tests run in real time, on whatever machine this is: there a failure counts only if it repeats itself.
if [ "${CI:-}" = true ]; then set -- --repeat until-pass:2 "$@"; fi
ctest --preset "$preset" -j "$(nproc)" "$@"
