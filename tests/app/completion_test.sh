#!/usr/bin/env bash
# completion_test.sh PROGRAM SCRIPT: what completion/abs_hil.bash offers at some places of a command line.
set -euo pipefail
program=$1
# shellcheck source=/dev/null
source "$2"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"
mkdir runs paper_notes
failures=0

offers() { # EXPECTED WORD...: the last word is the one to complete
  local expected=$1
  shift
  COMP_WORDS=("$program" "$@") COMP_CWORD=$# COMPREPLY=()
  _abs_hil || true
  if [ "${COMPREPLY[*]}" != "$expected" ]; then
    echo "abs_hil $*: offers \"${COMPREPLY[*]}\", expected \"$expected\"" >&2
    failures=$((failures + 1))
  fi
}

offers validate va
offers paper validate pa
offers "replay report" re
offers "--controller --controllers" --contr
offers "--config --controller --controllers" --plant paper-table1 --co
offers adaptive,pi compare --controllers adaptive,p
offers control.adaptive.gamma= --set control.adaptive.g
offers slip-sweep --experiment slip-s
offers "sim rig" --experiment paper --backend ""
offers "merge status submit" study ""
offers runs study status ru
offers runs report ru
offers "stop start" send st
offers "--config --help --insist --set" safe --
[ $failures -eq 0 ]
