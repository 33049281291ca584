#!/usr/bin/env bash
# Makes the paper's comparison, adaptive against sliding mode, on the plant with the timing of the paper's plots: once
# on the nominal plant and 200 times on varied plants. Options go to abs_hil compare (for example --threads 1).
# usage: scripts/paper_comparison.sh [OPTION...]      (needs build/release, or ABS_BIN=FOLDER of the programs)
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
program=${ABS_BIN:-build/release/bin}/abs_hil
[ -x "$program" ] || { echo "$0: $program is missing: run scripts/build.sh first" >&2; exit 3; }

"$program" compare --plant paper-timing --controllers adaptive,sliding-mode --repeat 1 --vary none "$@"
echo
"$program" compare --plant paper-timing --controllers adaptive,sliding-mode --repeat 200 --seed 1 "$@"
