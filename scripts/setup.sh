#!/usr/bin/env bash
# setup.sh [LIST]: installs the Debian packages of scripts/LIST that are not there yet. LIST is packages.txt by default;
# packages-vm.txt holds those of the tests in a virtual machine. A line PACKAGE|PROGRAM is there as soon as PROGRAM is in
# the path: Node.js of another source brings npm itself, and Debian's npm refuses to stand beside it. What apt prints goes
# to build/setup.log. The script may be repeated without harm.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
list=${1:-packages.txt}

mapfile -t wanted < <(sed 's/#.*//; s/[[:space:]]*$//; /^$/d' "$here/$list")
missing=()
for line in "${wanted[@]}"; do
  package=${line%|*}
  if [[ $line == *"|"* ]] && command -v "${line#*|}" >/dev/null; then continue; fi
  [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)" = installed ] || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "setup: all ${#wanted[@]} packages are installed"
  exit 0
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "setup: run as root, or install: ${missing[*]}" >&2; exit 3; }
  as_root=(sudo)
fi
log=$(realpath "$here/..")/build/setup.log
mkdir -p "$(dirname "$log")"
echo "setup: installing ${missing[*]} (log: $log)"

install_missing() {
  "${as_root[@]}" apt-get update -qq &&
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
}
echo "== $(date '+%Y-%m-%d %H:%M:%S') $list: ${missing[*]}" >>"$log"
status=0
install_missing >>"$log" 2>&1 || status=$?
if [ $status -eq 0 ]; then
  # What build/python got from PyPI may stand before a package that is new now. Its owner's next call looks after it otherwise.
  if [ "${ABS_HIL_SETUP:-}" != python ] && [[ " ${missing[*]}" == *" python3-"* ]] && [ -O "$here/../build/python" ]; then
    "$here/setup_python.sh" --again || true
  fi
  exit 0
fi
tail -n 20 "$log" >&2
echo "setup: apt-get failed with status $status; the end of its output is above, all of it in $log" >&2
exit $status
