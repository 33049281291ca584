#!/usr/bin/env bash
# The harness itself: exit statuses, output, the writable folder, modules, and that a host without QEMU is told so.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
run=$here/vm_run.sh
fail() { echo "FAILED: $*"; exit 1; }
scratch=$(mktemp -d "$HOME/.abs_hil_vm.XXXXXX")
trap 'rm -rf "$scratch"' EXIT

status=0
output=$("$run" -M 'can_raw vcan' -o "$scratch" -- \
  'uname -v; modprobe -a can_raw vcan && ip link add vcan0 type vcan && ip -brief link show vcan0
   echo kept >/out/file; touch /usr/planted && echo scratch layer; exit 42') || status=$?
[ $status != 77 ] || exit 77
[ $status = 42 ] || fail "status $status instead of the command's 42: $output"
case $output in *PREEMPT_RT*vcan0*'scratch layer'*) ;; *) fail "output: $output" ;; esac
[ "$(cat "$scratch/file")" = kept ] || fail '/out was not kept'
[ ! -e /usr/planted ] || fail "the guest wrote to this computer's files"

status=0
"$run" -- 'echo c >/proc/sysrq-trigger; sleep 60' >/dev/null 2>&1 || status=$?
[ $status = 125 ] || fail "a panic gave status $status"

# Without QEMU: skipped.
mkdir "$scratch/bin"
for program in bash dirname realpath cat; do ln -s "$(command -v $program)" "$scratch/bin/$program"; done
status=0
PATH="$scratch/bin" "$run" -- true 2>"$scratch/text" || status=$?
[ $status = 77 ] || fail "status $status without QEMU"
grep -q 'SKIPPED: qemu-system-x86_64' "$scratch/text" || fail "no reason given: $(cat "$scratch/text")"
echo 'the harness works'
