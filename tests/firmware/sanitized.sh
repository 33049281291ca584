#!/usr/bin/env bash
# usage: sanitized.sh COUNT. Tests of firmware/node_core.c and COUNT random datagrams under the address and
# undefined-behaviour sanitizers.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/../.."
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
flags=(-O1 -g "-fsanitize=address,undefined" -fno-sanitize-recover=all -Ifirmware -Itests)
gcc -std=c99 "${flags[@]}" -c firmware/node_core.c -o "$folder/node_core.o"
for source in tests/firmware/node_*_test.cpp tests/firmware/node_core_fuzz.cpp; do
  g++ -std=c++20 "${flags[@]}" -c "$source" -o "$folder/$(basename "$source" .cpp).o"
done
g++ "${flags[@]}" "$folder/node_core.o" "$folder"/*_test.o -lCatch2WithMain -o "$folder/test"
g++ "${flags[@]}" "$folder/node_core.o" "$folder/node_core_fuzz.o" -o "$folder/fuzz"
"$folder/test" | tail -2
"$folder/fuzz" "$1"
