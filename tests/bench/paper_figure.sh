#!/bin/sh
# The evaluation figure of the Volkit paper: six algorithms, five volumes, one thread, all threads, the GPU.
# SPDX-License-Identifier: MIT
#
#   sh tests/bench/paper_figure.sh [build folder]     measures here, then draws
#   sh tests/bench/paper_figure.sh --draw             draws the table that is there
#
# Table and picture are tests/charts/results/paper_figure.csv and .svg. The build folder is configured with
# -DVKT_BENCH=ON; the picture needs gnuplot. Volumes that take more than a fifth of the memory are left out, and said;
# so is the GPU where there is none. OUT: another folder for both.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
out=${OUT:-$root/tests/charts/results}
mkdir -p "$out"
if [ "${1:-}" != --draw ]; then
    bench=$(cd "${1:-$root/build}" && pwd)/tests/vkt_paper_figure
    [ -x "$bench" ] || {
        echo "paper_figure.sh: $bench is absent: configure with -DVKT_BENCH=ON and build vkt_paper_figure" >&2
        exit 2
    }
    limit=$(awk '/^MemAvailable/ { print $2 * 1024 / 5 }' /proc/meminfo)
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    trap 'exit 130' INT TERM
    cd "$work"
    {
        echo "# $(date +%F), $(awk -F': ' '/^model name/ { print $2; exit }' /proc/cpuinfo), $(nproc) threads, $(
            nvidia-smi --query-gpu=name --format=csv,noheader 2>/dev/null | head -1 | grep . || echo 'no GPU')"
        echo operation,volume,policy,seconds
        "$bench" 1 "$limit"
        [ "$(nproc)" = 1 ] || "$bench" "$(nproc)" "$limit"
        result=0
        "$bench" gpu "$limit" || result=$?
        [ "$result" = 0 ] || [ "$result" = 77 ] || exit "$result"
    } >figure.csv
    mv figure.csv "$out/paper_figure.csv"
fi
command -v gnuplot >/dev/null || {
    echo 'paper_figure.sh: there is no gnuplot to draw with; the table stands' >&2
    exit 0
}
# A row of the table for each operation and volume, a column for each policy.
policies=$(awk -F, '!/^#/ && $1 != "operation" && !seen[$3]++ { print $3 }' "$out/paper_figure.csv")
awk -v policies="$policies" '
    function quoted(text) { gsub(/"/, "", text); return "\"" text "\"" }
    BEGIN { n = split(policies, policy, "\n") }
    /^#/ || /^operation,/ { next }
    match($0, /,".*",/) {
        operation = substr($0, 1, RSTART - 1)
        volume = substr($0, RSTART + 2, RLENGTH - 4)
        split(substr($0, RSTART + RLENGTH), rest, ",")
        key = volume "\t" operation
        if (!(key in known)) { known[key] = 1; order[++rows] = key }
        seconds[key, rest[1]] = rest[2]
    }
    END {
        for (i = 1; i <= rows; ++i) {
            split(order[i], part, "\t")
            if (part[1] != last) { if (i > 1) print ""; last = part[1] }
            row = quoted(part[2] (i == 1 || part[1] != before ? "\\n" part[1] : ""))
            before = part[1]
            for (p = 1; p <= n; ++p) row = row " " ((order[i], policy[p]) in seconds ? seconds[order[i], policy[p]] : "NaN")
            print row
        }
    }' "$out/paper_figure.csv" | grep . >"${TMPDIR:-/tmp}/paper_figure.$$"
{
    echo 'set terminal svg size 1180,520 font "sans,12" background "white"'
    echo "set output '$out/paper_figure.svg'"
    echo "set title '$(sed -n 's/^# //p' "$out/paper_figure.csv")'"
    echo 'set logscale y; set format y "%g"; set ylabel "seconds"; set grid y back lc rgb "#dddddd"'
    echo 'set style data histograms; set style histogram clustered gap 1; set style fill solid 0.9'
    echo 'set xtics rotate by -60 font ",9"; set key top left; set bmargin 9; set yrange [1e-5:*]'
    printf 'plot '
    column=1 comma=''
    for policy in $policies; do
        column=$((column + 1))
        case $policy in 1) title='1 thread' colour='#7f7f7f' ;; gpu) title=GPU colour='#2ca02c' ;; *) title="$policy threads" colour='#1f77b4' ;; esac
        printf "%s'%s' using %s:xtic(1) title '%s' lc rgb '%s'" "$comma" "${TMPDIR:-/tmp}/paper_figure.$$" "$column" "$title" "$colour"
        comma=', '
    done
    echo
} | gnuplot
rm -f "${TMPDIR:-/tmp}/paper_figure.$$"
