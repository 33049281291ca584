#!/usr/bin/env bash
# realtime_guest.sh ABS_HIL: within the virtual machine, wake-up latencies of cyclictest and of abs_hil's own cycle by
# turns, at the same rate and priority, idle and with CPU-bound programs running. The worst case depends on how a
# run's ticks lie to the kernel's own: four turns, each with both programs' ticks in the same place. Results go to /out.
set -euo pipefail
program=$1
turns=4
cycles=5000  # in each

measure() {  # name rate_Hz
  for turn in $(seq $turns); do
    local interval_us=$((1000000 / $2)) offset_us
    offset_us=$((interval_us * (turn - 1) / turns))
    cyclictest -m -p80 -i$interval_us -l$cycles -q --secaligned=$offset_us >"/out/$1.$turn.cyclictest"
    # A second more than needed, as the duration is counted from the first cycle.
    "$program" latency --rt require --rate "$2" --duration $((cycles / $2 + 1)) --secaligned $offset_us \
      --json >"/out/$1.$turn.json"
  done
}

measure idle_1kHz 1000
measure idle_5kHz 5000
for _ in 1 2; do
  while :; do :; done &
done
measure loaded_1kHz 1000
measure loaded_5kHz 5000
# shellcheck disable=SC2046  # a list of numbers; the guest has no /dev/fd for a process substitution
kill $(jobs -p)
