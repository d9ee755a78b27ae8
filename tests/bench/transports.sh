#!/bin/sh
# Times stage-to-stage hops: shared memory against memcpy and against pipes, filters in a row against one of them.
# SPDX-License-Identifier: MIT
#
#   sh tests/bench/transports.sh [build folder]      exit 1 if a bar is missed
#
# VKT_BENCH_DIR: where volumes are generated (default: a new folder in /tmp); VKT_BENCH_SLICES: 4096 (1 GiB of float32).
set -eu
# shellcheck source=tests/bench/begin.sh disable=SC1091
. "$(dirname "$0")/begin.sh"
slices=${VKT_BENCH_SLICES:-4096}
missed=0
memcpy=$(limit 'memcpy, 1 thread')
plain=$(limit 'pipe, 1 MiB')
mapped=$(limit 'pipe, 1 MiB, mapped pages')
best=$(awk -v a="$plain" -v b="$mapped" 'BEGIN { print (a > b) ? a : b }')

file=hop_256x256x${slices}_float32.raw
[ -e "$file" ] || vkt make noise --dims 256 256 "$slices" --dtype float32 --seed 1 -o "$file"
bytes=$((256 * 256 * slices * 4))

# ms TRANSPORT PIPELINE: median wall time.
ms() { VKT_TRANSPORT=$1 "$here/measure.py" --runs "${VKT_BENCH_RUNS:-9}" x "$2" 2>/dev/null | cut -f 2; }
# judged TEXT VALUE RELATION BAR
judged() {
    verdict=$(awk -v v="$2" -v bar="$4" -v most="$3" 'BEGIN { print (most == "most" ? v <= bar : v >= bar) ? "within" : "MISSED" }')
    printf '%-58s %6.2f  %s (bar: at %s %s)\n' "$1" "$2" "$verdict" "$3" "$4"
    [ "$verdict" = within ] || missed=1
}
ratio() { awk -v a="$1" -v b="$2" 'BEGIN { printf "%.3f", a / b }'; }

echo
echo "# $((bytes >> 20)) MiB of float32"
hop_shm=$(ms shm "vkt read $file | vkt info")
echo "vkt read | vkt info over shared memory: $hop_shm ms"
judged 'one hop over shared memory, of memcpy' "$(awk -v b=$bytes -v ms="$hop_shm" -v m="$memcpy" 'BEGIN { print b / ms * 1e-6 / m }')" least 0.6

hop_pipe=$(ms pipe "vkt read $file --no-checksum | vkt info")
echo "the same through a pipe, no checksums: $hop_pipe ms"
judged 'one hop through a pipe, of the best raw pipe' "$(awk -v b=$bytes -v ms="$hop_pipe" -v m="$best" 'BEGIN { print b / ms * 1e-6 / m }')" least 0.9
used=$(ms pipe "vkt make constant --value 1 --dims 256 256 $slices --dtype float32 | vkt stats")
echo "vkt make constant | vkt stats, every voxel checked and used: $used ms"
judged 'of plain writes to a pipe' "$(awk -v b=$bytes -v ms="$used" -v m="$plain" 'BEGIN { print b / ms * 1e-6 / m }')" least 0.9

five="vkt read $file | vkt arith add - 0 | vkt flip x | vkt convert --dtype float32 -q | vkt stats"
five_shm=$(ms shm "$five")
five_pipe=$(ms pipe "$five")
echo "read | arith add 0 | flip x | convert | stats: $five_shm ms shared memory, $five_pipe ms pipe"
judged 'five stages, shared memory against pipe' "$(ratio "$five_pipe" "$five_shm")" least 2.5
judged 'five stages, bytes over hops a second, of memcpy' "$(awk -v b=$bytes -v ms="$five_shm" -v m="$memcpy" 'BEGIN { print 4 * b / ms * 1e-6 / m }')" least 0.6

echo
echo '# filters in a row, one thread each, against one of them'
export VKT_THREADS=1
filter='vkt filter gaussian --sigma 2'
for transport in shm pipe; do
    one=$(ms $transport "vkt read $file | $filter | vkt info")
    row="$filter" n=1
    for n in 2 3 4; do
        row="$row | $filter"
        [ "$n" -lt "$(nproc)" ] || [ "$n" -eq 2 ] || continue
        many=$(ms $transport "vkt read $file | $row | vkt info")
        judged "$n filters over $transport: $many ms, one: $one ms" "$(ratio "$many" "$one")" most 1.25
        # What the machine gives to as many that do not wait for each other: beyond it no row can go.
        apart="" i=0
        while [ "$i" -lt "$n" ]; do apart="$apart(vkt read $file | $filter | vkt info >/dev/null) & " i=$((i + 1)); done
        echo "  $n pipelines of one filter side by side: $(ms $transport "sh -c '$apart wait'") ms"
    done
done
exit $missed
