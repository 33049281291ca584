#!/usr/bin/env bash
# The main job: sets up, builds, runs the paper's experiment in real time on the simulated rig and makes a report of it,
# below runs/; with arguments, whatever they ask of abs_hil. Without a route for LCM's multicast it says what to type and
# records to a log instead.
set -euo pipefail
root=$(realpath "$(dirname "$(realpath "$0")")/..")

"$root/scripts/setup.sh"
# The programs alone, half of what there is to build; the tests can wait.
"$root/scripts/build.sh" release --target abs_hil_programs
program="$root/build/release/bin/abs_hil"

arguments=("$@")
folder=""
if [ $# -eq 0 ]; then
  folder="$root/runs/$(date +%Y%m%d-%H%M%S)-paper"
  arguments=(--backend sim --out "$folder")
fi
says_lcm=no
for argument in "${arguments[@]}"; do
  case "$argument" in
    --no-lcm | --lcm-url | --lcm-url=* | --fast | --help | --version) says_lcm=yes ;;
    list | doctor | latency | compare | validate | commission | watch | send | replay | convert) says_lcm=yes ;;
  esac
done
if [ "$says_lcm" = no ] && ! "$program" doctor --only lcm; then
  arguments+=(--no-lcm)
  log="${folder:+$folder/run.lcmlog}"
  if [ -z "$log" ]; then
    mkdir -p "$root/runs"
    log="$root/runs/$(date +%Y-%m-%dT%H-%M-%S).lcmlog"
    case " ${arguments[*]} " in *" --log"*) ;; *) arguments+=(--log "$log") ;; esac
  fi
  echo "run: no LCM over UDP, see above; this run's telemetry goes to $log (lcm-logplayer replays it)"
fi
[ -n "$folder" ] || exec "$program" "${arguments[@]}"
"$program" "${arguments[@]}" &
pid=$!
# Ctrl-C reaches the program by itself; a second signal would stop it at once. The others are handed on.
trap : INT
trap 'kill -TERM "$pid"' TERM
trap 'kill -HUP "$pid"' HUP
status=0
wait "$pid" || status=$?
while kill -0 "$pid" 2>/dev/null; do  # a signal interrupts the waiting, not the run
  status=0
  wait "$pid" || status=$?
done
# A run that a fault ended has something to show as well; one that never began has nothing.
if [ -s "$folder/run.csv" ]; then "$root/build/release/bin/abs_report" "$folder" --output "$folder/report.html" || true; fi
exit "$status"
