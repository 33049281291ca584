#!/usr/bin/env bash
# Measures which lines and branches of firmware/node_core.c the test node_core takes. Status 1 if it misses one.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/../.."
command -v gcov >/dev/null || { echo "SKIPPED: no gcov"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
gcc -std=c99 -O0 --coverage -c "$PWD/firmware/node_core.c" -o "$folder/node_core.o"
for source in tests/firmware/node_*_test.cpp; do
  g++ -std=c++20 -O0 -Ifirmware -Itests -c "$source" -o "$folder/$(basename "$source").o"
done
g++ --coverage "$folder"/*.o -lCatch2WithMain -o "$folder/node_test"
cd "$folder"
./node_test | tail -2
gcov -b node_core.o | tee report | head -5
grep -q 'Lines executed:100.00%' report && grep -q 'Taken at least once:100.00%' report && exit 0
grep -E '#####|(never executed|taken 0%)' node_core.c.gcov
echo "node_core branches: below 100 %"
exit 1
