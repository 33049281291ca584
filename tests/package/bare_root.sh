# shellcheck shell=bash
# bare_root.sh: for tests in a bare Debian 12 (debootstrap, minbase). To be sourced. It needs root, debootstrap and a mirror.

mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
step() { echo "${0##*/}: $*, at $SECONDS s"; }

# own_mounts ARGUMENT...: starts this script again with these arguments, in a mount namespace of its own.
own_mounts() {
  [ "${ABS_HIL_OWN_MOUNTS:-}" = 1 ] && return
  if [ "$(id -u)" -ne 0 ] || ! command -v debootstrap >/dev/null; then
    echo "SKIPPED: needs root and debootstrap (scripts/setup.sh packages-package.txt)"
    exit 77
  fi
  ABS_HIL_OWN_MOUNTS=1 unshare --mount --propagation private "$(realpath "$0")" "$@"
  exit
}

# make_bare_root FOLDER: a Debian in there, unless one is there already.
make_bare_root() {
  if [ ! -e "$1/etc/debian_version" ]; then
    step "debootstrap"
    debootstrap --variant=minbase --include=ca-certificates,git bookworm "$1" "$mirror" >"$1.log" 2>&1 || { tail -20 "$1.log"; exit 1; }
    rm -f "$1.log"
  fi
  echo force-unsafe-io >"$1/etc/dpkg/dpkg.cfg.d/unsafe-io"  # a scratch disk need not survive a power cut
  chmod 755 "$1"  # mktemp's is closed to others than root, and so were everything in it
  cp /etc/resolv.conf "$1/etc/resolv.conf"
  # The certificates that this computer trusts: its mirrors of the package registries may have their own.
  cp /etc/ssl/certs/ca-certificates.crt "$1/etc/ssl/certs/ca-certificates.crt"
}

# mount_system FOLDER: what programs in there expect. / stays no mount of its own, as in any chroot.
mount_system() {
  mount -t proc proc "$1/proc"
  mount -t sysfs sys "$1/sys"
  mount --rbind /dev "$1/dev"
}

# inside COMMAND...: runs it in $root, with the environment of a new user.
# shellcheck disable=SC2154  # the script that sources this sets root
inside() {
  chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/srv LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
    PIP_CERT=/etc/ssl/certs/ca-certificates.crt NODE_EXTRA_CA_CERTS=/etc/ssl/certs/ca-certificates.crt "$@"
}
