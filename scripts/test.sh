#!/usr/bin/env bash
# The tests: sets up, builds and runs ctest on one preset (default: release); further arguments go to ctest, without any
# those labelled on-demand are left out (long ones: ctest -L on-demand runs them). Where CI=true or ABS_HIL_REQUIRE_VM=1
# the tests in a virtual machine must not be skipped; where CI=true, what the tests of abs-spy, of Python modules and of
# abs_report need is installed as well.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

preset=${1:-release}
[ $# -gt 0 ] && shift
scripts/setup.sh
# Where these cannot be installed the tests in a virtual machine are skipped and say why, unless they must not be.
scripts/setup.sh packages-vm.txt || { [ "${CI:-}" != true ] && [ "${ABS_HIL_REQUIRE_VM:-}" != 1 ]; }
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
