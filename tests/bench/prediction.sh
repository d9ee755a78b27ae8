#!/usr/bin/env bash
# What `vkt pipe -n` predicts against what it takes: arith, convert, gaussian, median, resample, rotate, stats.
# SPDX-License-Identifier: MIT
#
# usage: prediction.sh [SIDE [REPEATS]]   (256, 7), vkt in PATH. Prints a line a pipeline, with the median and the least
# of the repeats; exit code 1 if the least, which others on the machine disturb least, is further than a factor of 1.5
# from its prediction. Files in the page cache, a calibration of its own. The result is new each time: to replace a file,
# ext4 waits for the disk, which no prediction knows.
set -eu
side=${1:-256} repeats=${2:-7}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export XDG_CACHE_HOME="$work/cache"
cd "$work"
TIMEFORMAT=%R

time vkt doctor --calibrate >report
sed -n 's/^processor *//p;s/^threads */threads /p' report
code=0
printf '%-8s %-36s %10s %10s %10s %7s %7s\n' type pipeline predicted median least factor 'of least'
for type in uint16 float32; do
    vkt make noise --dims "$side" "$side" "$side" --dtype $type --low 0 --high 1000 -o v.vkt --force
    sync v.vkt
    while read -r stage; do
        last='write out.vkt --force'
        [ "$stage" = stats ] && line="read v.vkt | stats" || line="read v.vkt | $stage | $last"
        predicted=$(vkt pipe -n "$line" 2>&1 | sed -n 's/^vkt [a-z-]*:   all stages: about \(.*\) s, .*/\1/p')
        i=0
        : >seconds
        while [ $i -lt "$repeats" ]; do
            rm -f out.vkt
            { time vkt pipe -q "$line" >/dev/null </dev/null; } 2>>seconds
            i=$((i + 1))
        done
        measured=$(sort -n seconds | sed -n "$(((repeats + 1) / 2))p") least=$(sort -n seconds | head -n 1)
        awk "BEGIN { f = $least / $predicted; printf \"%-8s %-36s %10.3f %10.3f %10.3f %7.2f %7.2f\n\", \"$type\", \"$stage\", $predicted, $measured, $least, $measured / $predicted, f
            exit !(f <= 1.5 && f >= 1 / 1.5) }" || code=1
    done <<'END'
arith mul - 3
convert --dtype uint8
filter gaussian --sigma 1
filter gaussian --sigma 3
filter median --radius 1
resample --scale 0.5
resample --scale 1.2
rotate --angle 20
stats
END
done
exit $code
