#!/usr/bin/env bash
# The main job: sets up, builds, and runs the paper's experiment in real time on the simulated rig, or whatever the
# arguments ask of abs_hil. Without a route for LCM's multicast it says what to type and records to a log instead.
set -euo pipefail
root=$(realpath "$(dirname "$(realpath "$0")")/..")

"$root/scripts/setup.sh"
"$root/scripts/build.sh" release
program="$root/build/release/bin/abs_hil"

arguments=("$@")
[ $# -gt 0 ] || arguments=(--backend sim)
says_lcm=no
for argument in "${arguments[@]}"; do
  case "$argument" in
    --no-lcm | --lcm-url | --lcm-url=* | --fast | --help | --version) says_lcm=yes ;;
    list | doctor | latency | compare | commission) says_lcm=yes ;;
  esac
done
if [ "$says_lcm" = no ] && ! "$program" doctor --only lcm; then
  mkdir -p "$root/runs"
  log="$root/runs/$(date +%Y-%m-%dT%H-%M-%S).lcmlog"
  echo "run: no LCM over UDP, see above; this run's telemetry goes to $log (lcm-logplayer replays it)"
  arguments+=(--no-lcm)
  case " ${arguments[*]} " in *" --log"*) ;; *) arguments+=(--log "$log") ;; esac
fi
exec "$program" "${arguments[@]}"
