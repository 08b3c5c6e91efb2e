#!/usr/bin/env bash
# Return against core-hours, ours beside the published agents': experiments/return_vs_compute.csv as
# a picture. Needs gnuplot.
#   experiments/return_vs_compute.sh PICTURE [six|twenty]
# PICTURE ends in .png or .svg; six (default) or twenty tasks.
set -euo pipefail

if [ $# -lt 1 ]; then
  sed -n '/^# Return/,/^# PICTURE/p' "${BASH_SOURCE[0]}" | sed 's/^# \?//' >&2
  exit 2
fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
case ${2:-six} in
  six) column=3 label=5 tasks="six tasks" ;;
  twenty) column=4 label=6 tasks="twenty tasks" ;;
  *) echo "expected six or twenty, found '$2'" >&2; exit 2 ;;
esac
case $1 in
  *.svg) terminal="svg size 900,520 font 'Helvetica,15' background rgb 'white'" ;;
  *.png) terminal="pngcairo size 1350,780 font 'Helvetica,22' background rgb 'white'" ;;
  *) echo "expected a name that ends in .png or .svg, found '$1'" >&2; exit 2 ;;
esac

gnuplot <<GNUPLOT
set terminal $terminal
set output "$1"
set datafile separator comma
set datafile missing "-"
set title "After 100,000 environment steps: return against compute, $tasks"
set xlabel "hours on one core (evaluation left out)"
set ylabel "mean return"
set logscale x
set xrange [0.25:200]
set yrange [0:1000]
set xtics (0.5, 1, 2, 5, 10, 20, 50, 100)
set grid xtics ytics linecolor rgb "#e4e4e4" linetype 1
set border 3
set tics nomirror
unset key
file = "<grep -v '^#' '$root/experiments/return_vs_compute.csv' | tail -n +2"
ours(name) = substr(name, 1, 11) eq "dreamsearch"
plot file using 2:(ours(strcol(1)) ? NaN : column($column)) with points pointtype 7 pointsize 1.6 linecolor rgb "#777777", \
     file using 2:(ours(strcol(1)) ? column($column) : NaN) with points pointtype 7 pointsize 2.2 linecolor rgb "#1f6fb2", \
     file using 2:(column($column) + column($label)):1 with labels center textcolor rgb "#333333"
GNUPLOT
