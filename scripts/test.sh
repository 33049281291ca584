#!/usr/bin/env bash
# test.sh [quick | PRESET] [ARGUMENT...]: sets up, builds and runs the tests.
#   test.sh                  all tests of the preset release but those labelled on-demand, which take longest
#   test.sh PRESET ...       the same for another preset; ARGUMENTs go to ctest and then choose the tests alone
#   test.sh quick ...        the preset release without the labels of slow_labels below: about a minute after the build
# The script installs what the tests need, for quick only what the build and the quick tests need. It names a list of
# packages that cannot be installed; the tests that need one are skipped and say so. The last lines count the tests that
# passed, failed and were skipped, with each reason. ABS_HIL_MAY_SKIP=PATTERN makes a skipped test of another name, and a
# list that cannot be installed, a failure: .ci/run sets it.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

slow_labels='^(slow|vm|bench|docs|on-demand)$'
preset=${1:-release}
[ $# -gt 0 ] && shift
target=()
if [ "$preset" = quick ]; then
  echo "test: quick: builds the programs and the unit tests, then runs for about a minute. Left out: real-time runs," \
    "reports, network, virtual machine, long simulations (scripts/test.sh runs these too)"
  preset=release optional=() modules=python-packages.txt target=(--target abs_hil_quick_tests)
  set -- -LE "$slow_labels" "$@"
else
  optional=(vm spy mesa firmware report windows) modules=python-packages-tests.txt
  if [ $# -gt 0 ]; then
    echo "test: builds everything of the preset $preset, then runs: ctest $*"
  else
    echo "test: builds everything of the preset $preset, then runs all tests but those on demand: half an hour or more on two" \
      "processors, most of it real-time runs and tests in a virtual machine (scripts/test.sh quick: about a minute)"
    set -- -LE on-demand
  fi
fi

for list in packages.txt packages-analysis.txt packages-tests.txt; do scripts/setup.sh "$list"; done
lacking=()
for list in "${optional[@]/%/.txt}"; do scripts/setup.sh "packages-$list" || lacking+=("packages-$list"); done
scripts/setup_python.sh "$modules" || lacking+=("$modules")
scripts/build.sh "$preset" "${target[@]}"

results=build/$preset/Testing/results.xml
rm -f "$results"
status=0
ctest --preset "$preset" -j "$(nproc)" --output-junit "$PWD/$results" --test-output-size-passed 100000 "$@" || status=$?
scripts/test_summary.py "$results" "${lacking[@]}" || status=1
exit $status
