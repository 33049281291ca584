#!/usr/bin/env bash
# Makes docs/figures/report.png with a browser: the first screen of abs_report's page of two runs of the paper's experiment.
# usage: scripts/report_screenshot.sh [PICTURE.png]      (needs build/release, or ABS_BIN=FOLDER of the programs)
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
picture=$(realpath "${1:-docs/figures/report.png}")
programs=${ABS_BIN:-build/release/bin}
[ -x "$programs/abs_report" ] || { echo "$0: $programs/abs_report is missing: run scripts/build.sh first" >&2; exit 3; }
command -v chromium >/dev/null ||
  { echo "$0: chromium is missing: scripts/setup.sh packages-report.txt" >&2; exit 3; }
data=$(mktemp -d)
trap 'rm -r "$data"' EXIT

for controller in adaptive sliding-mode; do
  "$programs/abs_hil" --backend sim --fast --no-lcm --controller "$controller" --out "$data/$controller" >/dev/null
done
"$programs/abs_report" "$data/adaptive" "$data/sliding-mode" --out "$data/report.html" >/dev/null
chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir="$data/profile" \
  --virtual-time-budget=10000 --window-size=1400,900 --screenshot="$picture" "file://$data/report.html" >/dev/null 2>&1
# 64 colours show the same and need a third of the bytes. Pillow comes with the report's matplotlib.
/usr/bin/python3 -c 'import sys, PIL.Image
picture = PIL.Image.open(sys.argv[1]).convert("RGB")
picture.quantize(64, dither=PIL.Image.Dither.NONE).save(sys.argv[1], optimize=True)' "$picture"
echo "$picture"
