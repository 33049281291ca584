#!/usr/bin/env bash
# Measures the line and branch coverage of the command gate and its plausibility checks by the test `gate` alone.
# Status 1 below 100 %. Builds only these files, without optimisation. Needs gcovr (packages-coverage.txt); status 77
# without it.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
command -v gcovr >/dev/null || { echo "SKIPPED: gcovr is not installed (scripts/setup.sh packages-coverage.txt)"; exit 77; }

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
objects=()
for source in src/runtime/{command_gate,run_latch,encoder_check,response_check,speed_window,plausibility_limits}.cpp src/rig/safety_class.cpp tests/runtime/gate/*.cpp; do
  object=$folder/$(basename "$source" .cpp).o
  flags=()
  case $source in src/*) flags=(--coverage) ;; esac
  "${CXX:-g++}" -std=c++20 -O0 "${flags[@]}" -Iinclude -Isrc -Itests -c "$PWD/$source" -o "$object"
  objects+=("$object")
done
"${CXX:-g++}" --coverage -o "$folder/test_gate" "${objects[@]}" -lCatch2WithMain
"$folder/test_gate" | tail -2
gcovr --root . --object-directory "$folder" "$folder" --filter 'src/runtime/' \
  --exclude-throw-branches --exclude-unreachable-branches --branches --fail-under-line 100 --fail-under-branch 100 ||
  { echo "gate coverage: below 100 %"; exit 1; }
