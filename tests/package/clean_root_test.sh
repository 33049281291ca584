#!/usr/bin/env bash
# clean_root_test.sh [--without-vm] [ROOT]: makes a bare Debian 12 in ROOT (default: a scratch folder; one made before is
# used again), installs build/release/packages' .deb there and runs it, then tries the README's two commands in a fresh
# clone of this tree's HEAD, the second without the tests in a virtual machine if asked so. Needs root, debootstrap and a
# Debian mirror. Everything is mounted in a namespace of its own.
set -euo pipefail
source=$(realpath "$(dirname "$(realpath "$0")")/../..")

if [ "${1:-}" = --without-vm ]; then
  export ABS_HIL_CLEAN_ROOT_TESTS="release -LE 'vm|on-demand'"
  shift
fi
compgen -G "$source/build/release/packages/abs-hil_*.deb" >/dev/null ||
  { echo "clean root: no abs-hil_*.deb in $source/build/release/packages: make it first, with scripts/package.sh" >&2; exit 2; }
if [ "${ABS_HIL_CLEAN_ROOT_INNER:-}" != 1 ]; then
  root=${1:-$(mktemp -d /var/tmp/abs_hil_clean_root.XXXXXX)}
  [ $# -gt 0 ] || trap 'rm -rf --one-file-system "$root"' EXIT
  ABS_HIL_CLEAN_ROOT_INNER=1 unshare --mount --propagation private "$(realpath "$0")" "$root"
  exit
fi

root=$1
chmod 755 "$root"  # mktemp's is closed to others than root, and so were everything in it
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
step() { echo "clean root: $*, at $SECONDS s"; }
inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/srv LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive PIP_CERT=/etc/ssl/certs/ca-certificates.crt "$@"; }

if [ ! -e "$root/etc/debian_version" ]; then
  step "debootstrap"
  debootstrap --variant=minbase --include=ca-certificates,git bookworm "$root" "$mirror" >"$root.log" 2>&1 || { tail -20 "$root.log"; exit 1; }
  rm -f "$root.log"
fi
cp /etc/resolv.conf "$root/etc/resolv.conf"
# The certificates that this computer trusts: its mirrors of the package registries may have their own.
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"
# A mount of its own, as the root of a computer is one: programs in there make namespaces.
mount --bind "$root" "$root"
mount -t proc proc "$root/proc"
mount -t sysfs sys "$root/sys"
mount --rbind /dev "$root/dev"
inside apt-get update -qq

step "install the package"
cp "$source"/build/release/packages/{abs-hil,python3-abs-hil}_*.deb "$root/tmp/"
inside bash -c 'apt-get install -y -qq --no-install-recommends /tmp/*abs-hil_*.deb >/tmp/install.log 2>&1 || { tail -20 /tmp/install.log; exit 1; }'
step "run the installed program"
inside abs_hil --backend sim --fast --no-lcm --out /tmp/run | grep -m 1 completed
inside abs_hil report /tmp/run --output /tmp/report.html
inside rm -r /tmp/run
inside sh -c 'getent group abs_hil >/dev/null || { echo "the package made no group abs_hil"; exit 1; }'
inside sh -c 'test -f /usr/lib/systemd/system/abs-guardian.service && test -f /etc/abs_hil/guardian.toml' ||
  { echo "the package brought no resident guardian"; exit 1; }
inside sh -c 'timeout 3 abs_guardian serve --config /etc/abs_hil/guardian.toml --socket /tmp/guardian.sock' >"$root/tmp/guardian.log" 2>&1 || true
grep -q 'grants leases at /tmp/guardian.sock' "$root/tmp/guardian.log" || { cat "$root/tmp/guardian.log"; exit 1; }
inside apt-get purge -y -qq python3-abs-hil abs-hil >/dev/null
[ ! -e "$root/etc/abs_hil" ] || { echo "purge left /etc/abs_hil"; exit 1; }

step "fresh clone"
rm -rf "$root/srv/abs_hil"
git clone -q "file://$source" "$root/srv/abs_hil"
# A cache of compiled objects from outside is used where there is one: its path and what it holds change no result.
if [ -n "${CCACHE_DIR:-}" ] || [ -d "$HOME/.cache/ccache" ]; then
  mkdir -p "$root/srv/.cache/ccache" "$root/srv/.config/ccache"
  mount --bind "${CCACHE_DIR:-$HOME/.cache/ccache}" "$root/srv/.cache/ccache"
fi
step "first command: scripts/run.sh"
inside bash -c 'cd /srv/abs_hil && scripts/run.sh >/tmp/run.log 2>&1 || { tail -30 /tmp/run.log; exit 1; }; grep -m 1 "^completed" /tmp/run.log'
tests="scripts/test.sh ${ABS_HIL_CLEAN_ROOT_TESTS:-}"
step "second command: $tests"
inside bash -c "cd /srv/abs_hil && $tests"' >/tmp/test.log 2>&1 || { tail -40 /tmp/test.log; exit 1; }; grep -E "tests passed|Skipped" /tmp/test.log'
step "done"
