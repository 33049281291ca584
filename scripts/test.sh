#!/usr/bin/env bash
# test.sh [all | rest | PRESET [ARGUMENT...]]: sets up, builds and runs the tests.
#   test.sh                  the quick tests, and those of level key (tests/claims.txt): three minutes after the build
#   test.sh all              all tests but those labelled on-demand, which take longest: half an hour
#   test.sh rest             all without those that passed when test.sh last ran
#   test.sh PRESET ...       all of another preset; ARGUMENTs go to ctest and then choose the tests alone
# The script installs what the tests need; without an argument only what the build and its tests need. It names a list of
# packages that cannot be installed; the tests that need one are skipped and say so. The last lines say what was shown, and
# count the tests that passed, failed and were skipped, with each reason. ABS_HIL_MAY_SKIP=PATTERN makes a skipped test of
# another name, and a list that cannot be installed, a failure: .ci/run sets it.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

# Tests with none of these labels are quick.
slow_labels='^(slow|vm|bench|docs|on-demand)$'
level=${1:-key}
[ $# -gt 0 ] && shift
preset=release optional=(vm spy mesa firmware report windows) modules=python-packages-tests.txt target=()
case $level in
  key)
    echo "test: builds the programs, the quick and the key tests, and runs them: three minutes after the build on two" \
      "processors (scripts/test.sh all: everything else, half an hour)"
    optional=() modules=python-packages.txt target=(--target abs_hil_quick_tests)
    ;;
  all | rest) echo "test: builds everything and runs $level tests, many of them in real time or in a virtual machine" ;;
  *)
    preset=$level level=named
    if [ $# -gt 0 ]; then
      echo "test: builds everything of the preset $preset, then runs: ctest $*"
    else
      set -- -LE on-demand
    fi
    ;;
esac

for list in packages.txt packages-analysis.txt packages-tests.txt; do scripts/setup.sh "$list"; done
lacking=()
for list in "${optional[@]/%/.txt}"; do scripts/setup.sh "packages-$list" || lacking+=("packages-$list"); done
scripts/setup_python.sh "$modules" || lacking+=("$modules")
scripts/build.sh "$preset" "${target[@]}"

key_results=build/$preset/Testing/key_results.xml
names() { ctest --preset "$preset" -N "$@" | sed -n 's/^ *Test *#[0-9]*: //p'; }
if [ "$level" != named ]; then
  scripts/test_summary.py --check < <(names -LE on-demand)
  quick=$({ names -LE "$slow_labels" && names -R "$(scripts/test_summary.py --key)" -LE on-demand; } | sort -u | paste -sd'|')
  case $level in
    key) set -- -R "^($quick)\$" "$@" ;;
    all) set -- -LE on-demand "$@" ;;
    rest) set -- -LE on-demand -E "^($(scripts/test_summary.py --passed "$key_results" | paste -sd'|'))\$" "$@" ;;
  esac
fi

results=build/$preset/Testing/results.xml
rm -f "$results"
status=0
ctest --preset "$preset" -j "$(nproc)" --output-junit "$PWD/$results" --test-output-size-passed 100000 "$@" || status=$?
ABS_HIL_TEST_LEVEL=${level/named/} scripts/test_summary.py "$results" "${lacking[@]}" || status=1
[ "$level" != key ] || cp "$results" "$key_results"
[ "$level" != key ] || echo "test: the rest takes half an hour: scripts/test.sh all; what takes hours: scripts/test.sh release -L on-demand"
exit $status
