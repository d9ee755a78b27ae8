#!/bin/sh
# Error against seconds of the reconstructions of hierarchical volumes, on an analytic field held as cell averages.
# SPDX-License-Identifier: MIT
#
#   sh tests/bench/amr_accuracy.sh [-o CHART.png] [build folder]     a CSV table on stdout
#
# 1, 4 and 16 samples per finest cell are compared with the field at the sample, 1/64 and 1/8 with the field's mean over
# the voxel. Errors are shares of the field's standard deviation. The build folder is configured with -DVKT_BENCH=ON.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
chart=
if [ "${1:-}" = -o ]; then
    chart=$2
    shift 2
fi
bench=${1:-$here/../../build}/tests/vkt_amr_bench
[ -x "$bench" ] || {
    echo "amr_accuracy.sh: $bench is absent: configure with -DVKT_BENCH=ON and build vkt_amr_bench" >&2
    exit 2
}
table=$(mktemp)
trap 'rm -f "$table"' EXIT
"$bench" accuracy "${VKT_THREADS:-2}" >"$table"
cat "$table"
if [ -n "$chart" ]; then
    if /usr/bin/python3 -c 'import matplotlib' 2>/dev/null; then
        /usr/bin/python3 "$here/amr_accuracy.py" "$table" "$chart"
    else
        echo 'amr_accuracy.sh: python3 has no matplotlib: no chart' >&2
    fi
fi
