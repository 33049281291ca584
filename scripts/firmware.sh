#!/usr/bin/env bash
# firmware.sh [NAME]: builds the node's firmware into build/firmware/NAME.{elf,bin,uf2} and prints its size. NAME is
# abs-node by default; 7I92 makes an image that presents itself as that board, for tests with LinuxCNC. Needs
# gcc-arm-none-eabi (scripts/setup.sh packages-firmware.txt).
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
name=${1:-abs-node}
case $name in
  abs-node) idrom=ABS-NODE ;;
  7I92) idrom=MESA7I92 ;;
  *) echo "firmware: no image \"$name\": give abs-node or 7I92" >&2; exit 2 ;;
esac
command -v arm-none-eabi-gcc >/dev/null ||
  { echo "firmware: no arm-none-eabi-gcc (scripts/setup.sh packages-firmware.txt)" >&2; exit 77; }
out=build/firmware/$name
mkdir -p build/firmware
arm-none-eabi-gcc -std=c99 -mcpu=cortex-m0plus -mthumb -O2 -ffreestanding -nostdlib -fno-tree-loop-distribute-patterns -ffunction-sections -fdata-sections \
  -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror -DNODE_NAME="\"$name\"" -DNODE_IDROM_NAME="\"$idrom\"" -Ifirmware \
  -T firmware/rp2040.ld -Wl,--gc-sections -Wl,-Map="$out.map" firmware/{boot.S,rp2040.c,w5500.c,node_core.c} -lgcc -o "$out.elf"
arm-none-eabi-objcopy -O binary "$out.elf" "$out.raw"
python3 scripts/firmware_image.py "$out.raw" "$out.bin" "$out.uf2"
rm "$out.raw"
arm-none-eabi-size "$out.elf"
echo "firmware: $out.uf2, $(stat -c %s "$out.bin") bytes of flash"
