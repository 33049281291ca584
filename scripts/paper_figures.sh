#!/usr/bin/env bash
# Draws the counterparts of the paper's figures 5 to 10 from two runs on the plant paper-timing: docs/figures/paper-*.svg.
# usage: scripts/paper_figures.sh [FOLDER]      (needs build/release, or ABS_BIN=FOLDER of the programs)
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
folder=${1:-docs/figures}
programs=${ABS_BIN:-build/release/bin}
[ -x "$programs/abs_report" ] || { echo "$0: $programs/abs_report is missing: run scripts/build.sh first" >&2; exit 3; }
data=$(mktemp -d)
trap 'rm -r "$data"' EXIT

for controller in adaptive sliding-mode; do
  "$programs/abs_hil" --backend sim --fast --no-lcm --plant paper-timing --controller "$controller" \
    --out "$data/$controller" >/dev/null
done
"$programs/abs_report" --paper "$data/adaptive" "$data/sliding-mode" --output "$data/page.html" --figures "$data" >/dev/null

for figure in 5-upper-wheel 6-lower-wheel 7-slip 8-torque 9-theta 10-distance; do
  mv "$data/fig${figure%%-*}.svg" "$folder/paper-$figure.svg"
done
