#!/usr/bin/env bash
# test.sh [quick | PRESET] [ARGUMENT...]: sets up, builds and runs the tests.
#   test.sh                  all tests of the preset release but those labelled on-demand, which take longest
#   test.sh PRESET ...       the same for another preset; ARGUMENTs go to ctest and then choose the tests alone
#   test.sh quick ...        the preset release without the labels of slow_labels below: about a minute after the build
# With CI=true or ABS_HIL_REQUIRE_VM=1 the tests in a virtual machine must not be skipped. With CI=true the script also
# installs what the tests of abs-spy, of mesaflash, of the Python modules and of abs_report need.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

slow_labels='^(slow|vm|bench|docs|on-demand)$'
preset=${1:-release}
[ $# -gt 0 ] && shift
set_up() {
  for list in packages.txt packages-analysis.txt packages-tests.txt; do scripts/setup.sh "$list"; done
  # The report's page needs plotly. The first of the README's commands installs it too, but nobody has to run that before.
  scripts/setup_python.sh python-packages.txt || echo "test: no plotly from PyPI, see above: tests of the report will fail" >&2
}

if [ "$preset" = quick ]; then
  echo "test: quick: builds the programs and the unit tests, then runs for about a minute. Left out: real-time runs," \
    "reports, network, virtual machine, long simulations (scripts/test.sh runs these too)"
  set_up
  scripts/build.sh release --target abs_hil_quick_tests
  ctest --preset release -j "$(nproc)" -LE "$slow_labels" "$@"
  exit
fi

if [ $# -gt 0 ]; then
  echo "test: builds everything of the preset $preset, then runs: ctest $*"
else
  echo "test: builds everything of the preset $preset, then runs all tests but those on demand: 10 minutes or more," \
    "most of it real-time runs and tests in a virtual machine (scripts/test.sh quick: about a minute)"
fi
echo "test: a test is skipped and says why if its tools are missing: a virtual machine (packages-vm.txt), abs-spy" \
  "(packages-spy.txt), mesaflash (packages-mesa.txt), the firmware (packages-firmware.txt), a browser and Octave (packages-report.txt), Windows (packages-windows.txt), Python modules (setup_python.sh), FUSE," \
  "network namespaces"
set_up
# Without these packages the tests in a virtual machine are skipped, unless they must not be.
scripts/setup.sh packages-vm.txt || { [ "${CI:-}" != true ] && [ "${ABS_HIL_REQUIRE_VM:-}" != 1 ]; }
if [ "${CI:-}" = true ]; then
  scripts/setup.sh packages-spy.txt
  scripts/setup.sh packages-mesa.txt
  scripts/setup.sh packages-firmware.txt
  scripts/setup.sh packages-report.txt
  scripts/setup.sh packages-windows.txt
  scripts/setup_python.sh
fi
scripts/build.sh "$preset"
[ $# -gt 0 ] || set -- -LE on-demand
# Some tests run in real time, on whatever machine this is. In CI a failure counts only if the test fails twice.
if [ "${CI:-}" = true ]; then set -- --repeat until-pass:2 "$@"; fi
ctest --preset "$preset" -j "$(nproc)" "$@"
