#!/usr/bin/env bash
# Runs a test that mounts FUSE trees. Status 77, skipped, with the reason, where that is not possible.
set -euo pipefail
[ -w /dev/fuse ] || { echo "SKIPPED: /dev/fuse is not there or not writable (modprobe fuse)"; exit 77; }
[ "$(id -u)" -eq 0 ] || command -v fusermount3 >/dev/null || { echo "SKIPPED: no fusermount3 (package fuse3)"; exit 77; }
exec "$@"
