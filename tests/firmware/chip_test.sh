#!/usr/bin/env bash
# usage: chip_test.sh [SECONDS]. The node's firmware in an emulated RP2040, counted pieces of SECONDS (0.5). Status 77
# where compiler, node or npm is missing.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/../.."
missing() {
  echo "SKIPPED: no $1 (scripts/setup.sh packages-firmware.txt)"
  exit 77
}
for program in arm-none-eabi-gcc node npm; do command -v "$program" >/dev/null || missing "$program"; done
scripts/firmware.sh 7I92
scripts/firmware.sh
modules=build/firmware/chip
mkdir -p "$modules"
cp tests/firmware/chip/* "$modules"/
(cd "$modules" && npm ci --silent --no-audit --no-fund) || missing "rp2040js from the npm registry"
size=$(stat -c %s build/firmware/abs-node.bin)
[ "$size" -le 16384 ] || { echo "the image has $size bytes, more than 16384"; exit 1; }
node "$modules/chip_test.mjs" build/firmware/7I92.bin 0 7I92 # its identity only
node "$modules/chip_test.mjs" build/firmware/abs-node.bin "${1:-0.5}"
