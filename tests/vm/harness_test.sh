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
if [ $status = 77 ] || { [ $status = 1 ] && [ -z "$output" ]; }; then exit $status; fi
[ $status = 42 ] || fail "status $status instead of the command's 42: $output"
case $output in *PREEMPT_RT*vcan0*'scratch layer'*) ;; *) fail "output: $output" ;; esac
[ "$(cat "$scratch/file")" = kept ] || fail '/out was not kept'
[ ! -e /usr/planted ] || fail "the guest wrote to this computer's files"

status=0
"$run" -- 'echo c >/proc/sysrq-trigger; sleep 60' >/dev/null 2>&1 || status=$?
[ $status = 125 ] || fail "a panic gave status $status"

# Without QEMU: skipped, and a failure where it is demanded.
mkdir "$scratch/bin"
for program in bash dirname realpath cat; do ln -s "$(command -v $program)" "$scratch/bin/$program"; done
status=0
env -u CI -u ABS_HIL_REQUIRE_VM PATH="$scratch/bin" "$run" -- true 2>"$scratch/text" || status=$?
[ $status = 77 ] || fail "status $status without QEMU"
grep -q 'SKIPPED: qemu-system-x86_64' "$scratch/text" || fail "no reason given: $(cat "$scratch/text")"
status=0
CI=true PATH="$scratch/bin" "$run" -- true 2>/dev/null || status=$?
[ $status = 1 ] || fail "status $status without QEMU where CI=true"
echo 'the harness works'
