#!/usr/bin/env bash
# privileges_test.sh ABS_HIL: what --rt require and prefer do without privileges, and that each fix which the program
# names really mends it. Needs root, to step down from; status 77 otherwise.
set -euo pipefail
[ "$(id -u)" -eq 0 ] || { echo 'SKIPPED: needs root, to run the program as nobody'; exit 77; }
command -v setpriv >/dev/null || { echo 'SKIPPED: no setpriv'; exit 77; }

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
chmod 777 "$scratch"
cp "$1" "$scratch/abs_hil"  # nobody need not be able to see the build tree
fail() { echo "FAILED: $*"; exit 1; }
run=(--no-lcm --set experiment.start_speed_rad_s=20)
as_nobody() { setpriv --reuid=65534 --regid=65534 --clear-groups --inh-caps=-all "$@"; }
without_capabilities() { as_nobody --bounding-set=-all "$@"; }
# Status of a run into $status, its texts into $scratch/out and $scratch/err.
try() { status=0; "$@" >"$scratch/out" 2>"$scratch/err" || status=$?; }
says() { grep -q -- "$1" "$scratch/err" || fail "no '$1' in: $(cat "$scratch/err")"; }

echo '-- require: refused with what, why and the fix; nothing has moved'
try without_capabilities "$scratch/abs_hil" "${run[@]}" --rt require --csv "$scratch/require.csv"
[ $status = 3 ] || fail "require without privileges gave $status: $(cat "$scratch/err")"
says 'not obtained: SCHED_FIFO priority 80: Operation not permitted (RLIMIT_RTPRIO'
says 'not obtained: memory locked (mlockall)'
says 'rtprio 98'
! grep -q ': Success' "$scratch/err" || fail 'a reason is an errno read too late'
says '/etc/security/limits.d/'
says "setcap cap_sys_nice,cap_ipc_lock+ep \"$scratch/abs_hil\""
[ ! -e "$scratch/require.csv" ] || fail 'a file was opened although real time was required and not to be had'

echo '-- prefer: runs, says so once and loudly, and in the summary'
try without_capabilities "$scratch/abs_hil" "${run[@]}" --rt prefer --summary "$scratch/prefer.json"
[ $status = 0 ] || fail "prefer without privileges gave $status: $(cat "$scratch/err")"
[ "$(grep -c 'NOT IN REAL TIME' "$scratch/err")" = 1 ] || fail "not said once: $(cat "$scratch/err")"
grep -q '"realtime": false' "$scratch/prefer.json" || fail 'the summary does not say so'

echo '-- off: runs and says nothing of it'
try without_capabilities "$scratch/abs_hil" "${run[@]}" --rt off --summary "$scratch/off.json"
[ $status = 0 ] || fail "off gave $status: $(cat "$scratch/err")"
! grep -q 'REAL TIME' "$scratch/err" || fail 'off warns'
grep -q '"realtime": false' "$scratch/off.json" || fail 'off claims real time'

# What follows needs a machine that grants root itself real time.
try "$scratch/abs_hil" "${run[@]}" --rt require
if [ $status != 0 ]; then
  echo "the fixes cannot be tried: root itself gets no real time here: $(cat "$scratch/err")"
  exit 0
fi

# In a container root may lack CAP_SYS_RESOURCE, and so cannot raise limits; the virtual machine's can (tests/vm).
if prlimit --rtprio=98:98 --memlock=unlimited:unlimited true 2>/dev/null; then
  echo '-- the fix by limits mends it, even without /dev/cpu_dma_latency'
  with_limit() {  # RTPRIO and then arguments of abs_hil
    local rtprio=$1
    shift
    try prlimit --rtprio="$rtprio:$rtprio" --memlock=unlimited:unlimited setpriv --reuid=65534 --regid=65534 \
      --clear-groups --inh-caps=-all --bounding-set=-all "$scratch/abs_hil" "${run[@]}" --rt require "$@"
  }
  with_limit 98 --summary "$scratch/limits.json"
  [ $status = 0 ] || fail "with the limits require gave $status: $(cat "$scratch/err")"
  grep -q '"realtime": true' "$scratch/limits.json" || fail 'with the limits: no real time'

  echo '-- a limit below the priority is named, and the priority it allows works'
  with_limit 40
  [ $status = 3 ] || fail "with RLIMIT_RTPRIO 40 priority 80 gave $status"
  says '--set realtime.priority=40'
  with_limit 40 --set realtime.priority=40
  [ $status = 0 ] || fail "priority 40 gave $status: $(cat "$scratch/err")"
elif [ -n "${ABS_HIL_ALL_FIXES:-}" ]; then
  fail 'limits cannot be raised here'
else
  echo '-- the fix by limits: not tried, limits cannot be raised here (tests/vm does)'
fi

echo '-- the fix by setcap mends it'
if setcap cap_sys_nice,cap_ipc_lock+ep "$scratch/abs_hil" 2>/dev/null; then
  try as_nobody "$scratch/abs_hil" "${run[@]}" --rt require
  [ $status = 0 ] || fail "with setcap require gave $status: $(cat "$scratch/err")"
elif [ -n "${ABS_HIL_ALL_FIXES:-}" ]; then
  fail 'setcap does not work here'
else
  echo 'setcap does not work here: not tried (tests/vm does)'
fi
echo 'all well'
