#!/usr/bin/env bash
# Prints the lines and branches that the tests reach, room by room, and keeps the table in build/coverage/coverage.md.
# build/coverage/html/index.html shows every line. The script builds with clang's source-based coverage. It leaves out
# the tests in a virtual machine and the long ones. Status 1 if the tests reach fewer of the lines outside apps than
# coverage_table.py requires.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

scripts/setup.sh packages-coverage.txt >&2
scripts/build.sh coverage >&2
build=$PWD/build/coverage
# Counters are in mapped files (%c), so the counts of a killed program are kept. Some tests drop their privileges.
export LLVM_PROFILE_FILE=$build/profiles/%m%c.profraw
rm -rf "$build/profiles" "$build/html"
mkdir "$build/profiles"
chmod 777 "$build/profiles"
# Status 8: a test failed. It fails in release too, unless it judges optimised code. Its lines count in both cases.
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
python3 scripts/coverage_table.py "$build/lines.lcov" | tee "$build/coverage.md"
