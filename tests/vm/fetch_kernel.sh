#!/usr/bin/env bash
# fetch_kernel.sh: unpacks Debian's PREEMPT_RT kernel into the cache (nothing is installed) and prints the folder:
# vmlinux, and lib/modules/VERSION. Quick when it is there already. Status 77, reason on stderr, where it cannot be had.
#   ABS_HIL_VM_KERNEL=DIR   a folder made before, taken as it is
set -euo pipefail
here=$(dirname "$(realpath "$0")")

skip() { echo "SKIPPED: $*" >&2; exit 77; }

if [ -n "${ABS_HIL_VM_KERNEL:-}" ]; then
  [ -f "$ABS_HIL_VM_KERNEL/vmlinux" ] || skip "no vmlinux in ABS_HIL_VM_KERNEL=$ABS_HIL_VM_KERNEL"
  realpath "$ABS_HIL_VM_KERNEL"
  exit
fi

command -v apt-get >/dev/null || skip "no apt-get to fetch linux-image-rt-amd64 with"
package=$(apt-cache depends linux-image-rt-amd64 2>/dev/null | awk '/Depends: linux-image/ { print $2; exit }')
[ -n "$package" ] || skip "apt does not know linux-image-rt-amd64 (apt-get update)"
version=${package#linux-image-}
cache=${XDG_CACHE_HOME:-$HOME/.cache}/abs_hil/kernel-$version
if [ -f "$cache/complete" ]; then
  echo "$cache"
  exit
fi

mkdir -p "$cache"
exec 9>"$cache/lock"
flock 9  # tests run in parallel
if [ ! -f "$cache/complete" ]; then
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  (cd "$scratch" && apt-get download -q "$package" >&2) || skip "cannot download $package"
  dpkg -x "$scratch"/*.deb "$scratch/unpacked"
  rm -rf "${cache:?}/lib" && cp -r "$scratch/unpacked/lib" "$cache/lib"
  PATH=$PATH:/sbin depmod -b "$cache" "$version"
  # A decompressed kernel boots three seconds sooner under emulation.
  python3 "$here/extract_vmlinux.py" "$scratch/unpacked/boot/vmlinuz-$version" "$cache/vmlinux"
  touch "$cache/complete"
fi
echo "$cache"
