#!/usr/bin/env bash
# Puts the paper's claim to the test (docs/paper.md): searches the gains of all laws, computes the map of the claim, and
# writes page and map: config/paper, docs/paper.md, docs/figures/paper-map.*, and the numbers of docs/theory*.md.
# usage: research/paper_comparison.sh [--quick] [--check] [--only-pages] [--out DIR] [--threads N]
#        --quick: small search, map and series into runs/paper-quick; --check: changes nothing, status 1 if the pages differ
#        from fresh runs       (needs build/release, or ABS_BIN=FOLDER of the programs)
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
programs=${ABS_BIN:-$PWD/build/release/bin}
[ -x "$programs/abs_hil" ] || { echo "$0: $programs/abs_hil is missing: run scripts/build.sh first" >&2; exit 3; }
export ABS_BIN=$programs OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=1
PYTHONPATH=$PWD/research:$programs/../share/abs_hil/python exec /usr/bin/python3 -m claim "$@"
