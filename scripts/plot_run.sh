#!/usr/bin/env bash
# Draws a run's CSV as a picture: speeds, slip, brake torque and theta over time.
# usage: scripts/plot_run.sh RUN.csv PICTURE.svg|PICTURE.png      (needs the package gnuplot-nox)
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: $0 RUN.csv PICTURE.svg|PICTURE.png" >&2; exit 2; }
csv=$1 picture=$2
case "$picture" in
  *.svg) terminal="svg size 900,760 dynamic font 'sans,13' background 'white'" ;;
  *.png) terminal="pngcairo size 900,760 font 'sans,11'" ;;
  *) echo "$0: $picture: give a file ending in .svg or .png" >&2; exit 2 ;;
esac
command -v gnuplot >/dev/null || { echo "$0: gnuplot is missing: apt-get install gnuplot-nox" >&2; exit 3; }
start=$(awk -F, '$2 == "brake" {print $1; exit}' "$csv")

gnuplot <<PLOT
set terminal $terminal
set output "$picture"
set datafile separator ","
set datafile missing "NaN"
set multiplot layout 4,1 margins 0.10,0.97,0.07,0.98 spacing 0,0.02
set grid lc rgb "#dddddd"
set key top left horizontal samplen 2
set arrow 1 from $start, graph 0 to $start, graph 1 nohead dt 3 lc rgb "#888888"
set style line 1 lw 2 lc rgb "#0072b2"
set style line 2 lw 2 lc rgb "#d55e00" dt 4
set style line 3 lw 1 lc rgb "#444444" dt 2
stats "$csv" using 1 skip 1 nooutput
set xrange [0:STATS_max]
set format x ""
set ylabel "speed / (rad/s)"
plot "$csv" using "time_s":"omega2_rad_s" with lines ls 1 title "lower wheel {/Symbol w}_2", \
     "" using "time_s":"omega1_rad_s" with lines ls 2 title "upper wheel {/Symbol w}_1"
set ylabel "slip"
set yrange [-0.02:0.4]
plot "$csv" using "time_s":(strcol("phase") eq "brake" ? column("slip") : NaN) with lines ls 1 title "slip {/Symbol l}", \
     "" using "time_s":(strcol("phase") eq "brake" ? column("slip_ref") : NaN) with lines ls 3 title "reference"
set autoscale y
set ylabel "brake torque / (N m)"
plot "$csv" using "time_s":"brake_torque_Nm" with lines ls 1 title "acting", \
     "" using "time_s":"brake_torque_ref_Nm" with lines ls 2 title "asked for"
set key bottom left
set ylabel "theta / N"
set yrange [0:*]
set format x "%g"
set xlabel "time / s" offset 0,0.5
plot "$csv" using "time_s":"theta_est_N" with lines ls 1 title "estimate", \
     "" using "time_s":"theta_N" with lines ls 3 title "plant"
PLOT
