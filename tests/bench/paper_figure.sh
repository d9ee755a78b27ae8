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
# A row for each operation, a column for each policy, a gap and a label for each volume.
table=$(mktemp)
trap 'rm -rf "${work:-}" "$table"' EXIT
policies=$(awk -F, '!/^#/ && $1 != "operation" && !seen[$(NF - 1)]++ { print $(NF - 1) }' "$out/paper_figure.csv")
awk -v policies="$policies" '
    BEGIN { n = split(policies, policy, "\n") }
    /^#/ || /^operation,/ { next }
    match($0, /,".*",/) {
        split(substr($0, RSTART + RLENGTH), rest, ",")
        key = substr($0, RSTART + 2, RLENGTH - 4) "\t" substr($0, 1, RSTART - 1)
        if (!(key in known)) { known[key] = 1; order[++rows] = key }
        seconds[key, rest[1]] = rest[2]
    }
    END {
        for (i = 1; i <= rows; ++i) {
            split(order[i], part, "\t")
            if (part[1] != last && i > 1) print "\"\"" (n > 2 ? " NaN NaN NaN" : " NaN NaN")
            last = part[1]
            row = "\"" part[2] "\""
            for (p = 1; p <= n; ++p) row = row " " ((order[i], policy[p]) in seconds ? seconds[order[i], policy[p]] : "NaN")
            print row "\t" part[1]
        }
    }' "$out/paper_figure.csv" >"$table"
{
    echo 'set terminal svg size 1180,480 font "sans,12" background "white"'
    echo "set output '$out/paper_figure.svg'"
    echo "set title '$(sed -n 's/^# //p' "$out/paper_figure.csv")'"
    echo 'set logscale y; set format y "%g"; set ylabel "seconds"; set grid y back lc rgb "#dddddd"'
    echo 'set style data histograms; set style histogram clustered gap 1; set style fill solid 0.9'
    echo 'set xtics rotate by -45 scale 0 font ",10"; set key outside right top; set yrange [1e-5:200]'
    awk -F'\t' '$2 != "" { if (!($2 in first)) { first[$2] = NR; order[++n] = $2 } last[$2] = NR }
        END { for (i = 1; i <= n; ++i) printf "set label \"%s\" at %g, 90 center font \",10\"\n", order[i],
            (first[order[i]] + last[order[i]]) / 2 - 1 }' "$table"
    printf 'plot '
    column=1 comma=''
    for policy in $policies; do
        column=$((column + 1))
        case $policy in
        1) title='1 thread' colour='#7f7f7f' ;;
        gpu) title=GPU colour='#2ca02c' ;;
        *) title="$policy threads" colour='#1f77b4' ;;
        esac
        printf "%s'%s' using %s:xtic(1) title '%s' lc rgb '%s'" "$comma" "$table" "$column" "$title" "$colour"
        comma=', '
    done
    echo
} | gnuplot
