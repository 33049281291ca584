#!/usr/bin/env bash
# Draws the counterparts of the paper's figures 5 to 10 from two runs on the plant paper-timing: docs/figures/paper-*.svg.
# usage: scripts/paper_figures.sh [FOLDER]      (needs gnuplot-nox and build/release, or ABS_BIN=FOLDER of the programs)
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
folder=${1:-docs/figures}
program=${ABS_BIN:-build/release/bin}/abs_hil
[ -x "$program" ] || { echo "$0: $program is missing: run scripts/build.sh first" >&2; exit 3; }
command -v gnuplot >/dev/null || { echo "$0: gnuplot is missing: apt-get install gnuplot-nox" >&2; exit 3; }
data=$(mktemp -d)
trap 'rm -r "$data"' EXIT

for controller in adaptive sliding-mode; do
  "$program" --backend sim --fast --no-lcm --plant paper-timing --controller "$controller" --csv "$data/all.csv" >/dev/null
  # From 0.2 s before braking, every other millisecond: the chatter's frequency stays visible, the file small.
  awk -F, -v OFS=, 'NR == 1 || ($1 >= 6.0 && $1 <= 7.8 && NR % 2 == 0)' "$data/all.csv" >"$data/$controller.csv"
done

theta=$(awk '$1 == "theta_N" {print $3}' config/plants/paper-timing.toml)

# draw NAME HEIGHT AXIS-LABEL EXPRESSION [SETTING]
draw() {
  gnuplot <<PLOT
set terminal svg size 720,$2 dynamic font 'sans,12' background 'white'
set output "$folder/paper-$1.svg"
set datafile separator ","
set datafile missing "NaN"
set grid lc rgb "#dddddd"
set key top right samplen 2
set xrange [6:7.8]
set xlabel "time / s"
set ylabel "$3"
${5:-}
plot "$data/sliding-mode.csv" using "time_s":($4) with lines lw 1.5 lc rgb "#999999" title "sliding-mode", \
     "$data/adaptive.csv" using "time_s":($4) with lines lw 1.5 lc rgb "#000000" title "adaptive"
PLOT
}

draw 5-upper-wheel 300 "upper wheel / (rad/s)" 'column("omega1_rad_s")'
draw 6-lower-wheel 300 "lower wheel / (rad/s)" 'column("omega2_rad_s")'
draw 7-slip 300 "slip" 'strcol("phase") eq "brake" ? column("slip") : NaN' \
  'set yrange [0:0.5]; set arrow 1 from 6,0.15 to 7.8,0.15 nohead dt 2 lc rgb "#0072b2"'
draw 8-torque 300 "torque asked for / (N m)" 'strcol("phase") eq "brake" ? column("brake_torque_ref_Nm") : NaN' \
  'set yrange [0:10]'
draw 9-theta 300 "estimate of theta / N" 'strcol("phase") eq "brake" ? column("theta_est_N") : NaN' \
  "set yrange [0:110]; set arrow 1 from 6,$theta to 7.8,$theta nohead dt 2 lc rgb '#0072b2'"
draw 10-distance 300 "distance / m" 'column("distance_m")' 'set key bottom right'
