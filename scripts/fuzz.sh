#!/usr/bin/env bash
# fuzz.sh [SECONDS] [TARGET...]: builds the fuzz targets with clang and libFuzzer (preset asan: with address and
# undefined-behaviour sanitizers) and runs each for SECONDS (default 60) from its kept corpus. Failing inputs stay in
# build/asan/findings/TARGET. A crash ends the script with status 1. With ABS_HIL_KEEP_CORPUS=1 the script merges inputs
# that reach new code into the kept corpus.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

seconds=${1:-60}
[ $# -gt 0 ] && shift
scripts/setup.sh packages-clang.txt
scripts/build.sh asan --target abs_hil_fuzz_targets
targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  for program in build/asan/fuzz/fuzz_*; do targets+=("${program##*/fuzz_}"); done
fi

run_one() { # TARGET
  local program=build/asan/fuzz/fuzz_$1 kept=tests/fuzz/corpus/$1
  local found=build/asan/findings/$1 grown=build/asan/corpus/$1
  [ -x "$program" ] || { echo "fuzz: no target $1; known: $(ls build/asan/fuzz)" >&2; return 2; }
  mkdir -p "$found" "$grown"
  "$program" -max_total_time="$seconds" -max_len=65536 -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 -verbosity=0 \
    -artifact_prefix="$found/" "$grown" "$kept" >"build/asan/$1.log" 2>&1 || { tail -40 "build/asan/$1.log"; return 1; }
  echo "fuzz: $1: $(sed -n 's/stat::number_of_executed_units: *//p' "build/asan/$1.log") inputs in $seconds s, no finding"
  if [ "${ABS_HIL_KEEP_CORPUS:-}" = 1 ]; then
    "$program" -merge=1 -verbosity=0 "$kept" "$grown" >>"build/asan/$1.log" 2>&1
  fi
}

# One target for each core at a time.
export seconds
export -f run_one
status=0
# shellcheck disable=SC2016  # expanded by the inner bash
printf '%s\n' "${targets[@]}" | xargs -P "$(nproc)" -I{} bash -c 'run_one "$1"' run_one {} || status=1
[ $status -eq 0 ] || { echo "fuzz: findings in build/asan/findings" >&2; exit 1; }
