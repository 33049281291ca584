#!/usr/bin/env bash
# Runs a command in a private network namespace with a multicast route over its loopback, so that LCM's messages stay
# inside. Needs root or unprivileged user namespaces. Status 77 if the kernel does not permit it.
set -euo pipefail
enter=(unshare -n)
[ "$(id -u)" -eq 0 ] || enter=(unshare -rn)
"${enter[@]}" true 2>/dev/null ||
  { echo "SKIPPED: cannot make a private network namespace here (unshare -n); run as root" >&2; exit 77; }
# shellcheck disable=SC2016  # expanded by the inner shell
exec "${enter[@]}" sh -c 'ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"' -- "$@"
