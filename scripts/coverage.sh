#!/usr/bin/env bash
# Lines and branches that the tests reach, room by room, into the tables of docs/quality.md; every line is shown in
# build/coverage/html/index.html. Builds with clang's source-based coverage and runs the tests that need no virtual machine
# and are not long ones. Status 1 where fewer of the lines outside apps are reached than coverage_table.py asks for.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

scripts/setup.sh packages-coverage.txt >&2
scripts/build.sh coverage >&2
build=$PWD/build/coverage
# Counters live in mapped files (%c), so that a program that is killed has counted too. Some tests give up their rights.
export LLVM_PROFILE_FILE=$build/profiles/%m%c.profraw
rm -rf "$build/profiles" "$build/html"
mkdir "$build/profiles"
chmod 777 "$build/profiles"
# A test that fails (8) fails in release as well, unless it judges optimised code: its lines are counted either way.
(umask 0 && ctest --preset coverage -j "$(nproc)" -LE 'vm|docs|on-demand') >&2 || [ $? -eq 8 ]

llvm-profdata-16 merge -sparse -failure-mode=all -o "$build/all.profdata" "$build"/profiles/*.profraw
programs=()
while IFS= read -r program; do
  if [ "$(head -c 4 "$program" | tail -c 3)" = ELF ]; then programs+=(-object "$program"); fi
done < <(find "$build/bin" "$build/tests" "$build/fuzz" -maxdepth 1 -type f -perm -u+x)
shared=("${programs[@]:1}" -instr-profile "$build/all.profdata" -compilation-dir "$build"
  -ignore-filename-regex '/(build|tests|usr)/')
llvm-cov-16 export -format=lcov "${shared[@]}" >"$build/lines.lcov"
llvm-cov-16 show -format=html -show-branches=count -output-dir "$build/html" "${shared[@]}"
python3 scripts/coverage_table.py "$build/lines.lcov" docs/quality.md
