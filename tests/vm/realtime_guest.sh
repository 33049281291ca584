#!/usr/bin/env bash
# realtime_guest.sh ABS_HIL: within the virtual machine, wake-up latencies of cyclictest and of abs_hil's own cycle, one
# after the other at the same rate and priority, idle and with CPU-bound programs running. Results go to /out.
set -euo pipefail
program=$1
cycles=20000

measure() {  # name rate_Hz
  cyclictest -m -p80 -i$((1000000 / $2)) -l$cycles -q >"/out/$1.cyclictest"
  # A second more than needed, as the duration is counted from the first cycle.
  "$program" latency --rt require --rate "$2" --duration $((cycles / $2 + 1)) --json >"/out/$1.json"
}

measure idle_1kHz 1000
measure idle_5kHz 5000
for _ in 1 2; do
  while :; do :; done &
done
measure loaded_1kHz 1000
measure loaded_5kHz 5000
kill $(jobs -p)
