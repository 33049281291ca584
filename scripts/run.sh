#!/usr/bin/env bash
# run.sh [ARGUMENT...]: the main job. Installs packages of Debian and plotly of PyPI and builds the programs. Without arguments it
# then runs the paper's experiment in real time on the simulated rig and makes a report, in a folder below runs/. Arguments go to
# abs_hil. Without a route for LCM's multicast the script says which command adds one and records to a log instead.
# scripts/packages-analysis.txt is left out: no run and no report needs it.
set -euo pipefail
root=$(realpath "$(dirname "$(realpath "$0")")/..")

"$root/scripts/setup.sh"
# The report shows its figures with plotly.js, which comes while the compiler works. Without it the run goes on and has no page.
("$root/scripts/setup_python.sh" python-packages.txt || echo "run: no plotly from PyPI, see above: no report" >&2) &
# The programs only. They are half of the whole build; a run does not need the tests.
status=0
"$root/scripts/build.sh" release --target abs_hil_programs || status=$?
wait
[ "$status" = 0 ] || exit "$status"
program="$root/build/release/bin/abs_hil"

arguments=("$@")
folder=""
if [ $# -eq 0 ]; then
  folder="$root/runs/$(date +%Y%m%d-%H%M%S)-paper"
  arguments=(--backend sim --out "$folder")
fi
says_lcm=no
case "${arguments[0]}" in -*) ;; *) says_lcm=yes ;; esac  # a subcommand
for argument in "${arguments[@]}"; do
  case "$argument" in
    --no-lcm | --lcm-url | --lcm-url=* | --fast | --help | --version) says_lcm=yes ;;
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
# The terminal sends Ctrl-C to the program too; a second SIGINT would end it at once. Pass on the other signals only.
trap : INT
trap 'kill -TERM "$pid"' TERM
trap 'kill -HUP "$pid"' HUP
status=0
wait "$pid" || status=$?
while kill -0 "$pid" 2>/dev/null; do  # a signal interrupts `wait`, not the run
  status=0
  wait "$pid" || status=$?
done
# A run that a fault ended gets a report too. A run that never began has no rows.
if [ -s "$folder/run.csv" ]; then "$root/build/release/bin/abs_report" "$folder" --out "$folder/report.html" || true; fi
exit "$status"
