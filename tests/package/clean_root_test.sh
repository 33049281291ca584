#!/usr/bin/env bash
# clean_root_test.sh package|commands [ROOT]: makes a bare Debian 12 in ROOT (default: a scratch folder; one made before is
# used again). package: installs build/release/packages' .deb there and runs it. commands: the README's two commands as they
# stand, in a fresh clone of this tree's HEAD; half an hour or more.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
# shellcheck source=tests/package/bare_root.sh
. "$here/bare_root.sh"
source=$(realpath "$here/../..") what=${1:?give package or commands}

[ "$what" != package ] || compgen -G "$source/build/release/packages/abs-hil_*.deb" >/dev/null ||
  { echo "clean root: no abs-hil_*.deb in $source/build/release/packages: make it first, with scripts/package.sh" >&2; exit 2; }
root=${2:-$(mktemp -d /var/tmp/abs_hil_clean_root.XXXXXX)}
if [ "${ABS_HIL_OWN_MOUNTS:-}" != 1 ]; then
  [ $# -gt 1 ] || trap 'rm -rf --one-file-system "$root"' EXIT
  own_mounts "$what" "$root"
fi
make_bare_root "$root"
mount_system "$root"
inside apt-get update -qq

if [ "$what" = package ]; then
  step "install the package"
  cp "$source"/build/release/packages/{abs-hil,python3-abs-hil}_*.deb "$root/tmp/"
  inside bash -c 'apt-get install -y -qq --no-install-recommends /tmp/*abs-hil_*.deb >/tmp/install.log 2>&1 || { tail -20 /tmp/install.log; exit 1; }'
  step "run the installed program"
  inside abs_hil --backend sim --fast --no-lcm --out /tmp/run | grep -m 1 completed
  inside abs_hil report /tmp/run --out /tmp/report.html
  inside rm -r /tmp/run
  inside sh -c 'getent group abs_hil >/dev/null || { echo "the package made no group abs_hil"; exit 1; }'
  inside sh -c 'test -f /usr/lib/systemd/system/abs-guardian.service && test -f /etc/abs_hil/guardian.toml' ||
    { echo "the package brought no resident guardian"; exit 1; }
  inside sh -c 'timeout 3 abs_guardian serve --config /etc/abs_hil/guardian.toml --socket /tmp/guardian.sock' >"$root/tmp/guardian.log" 2>&1 || true
  grep -q 'grants leases at /tmp/guardian.sock' "$root/tmp/guardian.log" || { cat "$root/tmp/guardian.log"; exit 1; }
  inside apt-get purge -y -qq python3-abs-hil abs-hil >/dev/null
  [ ! -e "$root/etc/abs_hil" ] || { echo "purge left /etc/abs_hil"; exit 1; }
  step "done"
  exit
fi

step "fresh clone"
rm -rf "$root/srv/abs_hil"
git clone -q "file://$source" "$root/srv/abs_hil"
# A cache of compiled objects from outside is used where there is one: it changes the time and no result. The second command
# installs ccache, too; by then the build folder has its compiler.
if [ -n "${CCACHE_DIR:-}" ] || [ -d "$HOME/.cache/ccache" ]; then
  inside apt-get install -y -qq --no-install-recommends ccache >/dev/null
  mkdir -p "$root/srv/.cache/ccache" "$root/srv/.config/ccache"
  mount --bind "${CCACHE_DIR:-$HOME/.cache/ccache}" "$root/srv/.cache/ccache"
fi
for command in scripts/run.sh scripts/test.sh "scripts/test.sh rest"; do
  step "$command"
  status=0
  inside bash -c "cd /srv/abs_hil && $command" >"$root.log" 2>&1 || status=$?
  grep -E '^(completed|test: )' "$root.log" || true
  [ $status = 0 ] || { tail -40 "$root.log"; step "status $status of $command; all of its output is in $root.log"; exit 1; }
done
rm "$root.log"
step "done"
