#!/bin/sh
# Times whole pipelines against their bars, the machine's limits and other programs, all in one run.
# SPDX-License-Identifier: MIT
#
#   sh tests/bench/pipelines.sh [build folder]      exit 1 if a bar is missed
#
# VKT_BENCH_DIR: where volumes are generated (default: a new folder in /tmp); VKT_BENCH_N: extent (512).
set -eu
# shellcheck source=tests/bench/begin.sh disable=SC1091
. "$(dirname "$0")/begin.sh"
n=${VKT_BENCH_N:-512}
missed=0
memcpy=$(limit 'memcpy, all threads')

big=big_${n}x${n}x${n}_float32.raw
[ -e "$big" ] || vkt make noise --dims "$n" "$n" "$n" --dtype float32 --seed 1 -o "$big"
q=$((n / 4))
roi=$q:$((3 * q)),$q:$((3 * q)),$q:$((3 * q))
# Voxels that the pipelines must touch: the region read, and an eighth of it written.
touched=$((8 * q * q * q * 4 + q * q * q * 4))

# row NAME BAR-MS BAR-MIB PIPELINE: one line of the table; a bar of 0 is none.
row() {
    result=$("$here/measure.py" --runs "${VKT_BENCH_RUNS:-7}" "$1" "$4") || {
        echo "$1: failed"
        missed=1
        return
    }
    verdict=$(echo "$result" | awk -F '\t' -v ms="$2" -v mib="$3" -v touched="$touched" -v memcpy="$memcpy" '{
        over = (ms && $2 > ms) || (mib && $5 > mib)
        printf "%-42s %6d %6d %7d %8d %8d %9.3f  %s\n", $1, $2, $3, $4, $5, $6, touched / ($2 * 1e-3) / (memcpy * 1e9),
            ms ? (over ? "MISSED (bar " ms " ms" : "within (bar " ms " ms") (mib ? ", " mib " MiB)" : ")") : ""
    }')
    echo "$verdict"
    case $verdict in *MISSED*) missed=1 ;; esac
}

echo
echo "# $n^3 float32: crop half, gaussian 2, halve, flip x, write"
printf '%-42s %6s %6s %7s %8s %8s %9s\n' pipeline 'ms' 'least' 'cpu ms' 'sum MiB' 'max MiB' '/memcpy'
steps="vkt filter gaussian --sigma 2 | vkt resample --scale 0.5 | vkt flip x"
out=out_${q}x${q}x${q}_float32.raw
row 'vkt read | crop | gaussian | … | write' 350 200 "vkt read $big | vkt crop --roi $roi | $steps | vkt write --force $out"
row 'vkt crop FILE | gaussian | … | write' 150 200 "vkt crop $big --roi $roi | $steps | vkt write --force $out"
row 'vkt pipe (one process)' 150 0 \
    "vkt pipe 'crop $big --roi $roi | filter gaussian --sigma 2 | resample --scale 0.5 | flip x | write --force $out'"
if /usr/bin/python3 -c 'import scipy.ndimage' 2>/dev/null; then
    row 'SciPy, one process, mapped' 0 0 "/usr/bin/python3 $here/scipy_pipeline.py $big scipy.raw $n"
fi
unu=$(command -v unu || command -v teem-unu || true)
if [ -n "$unu" ]; then
    last=$((3 * q - 1))
    row 'unu, 5 processes' 0 0 "$unu make -i $big -t float -s $n $n $n -e raw -en little | $unu crop -min $q $q $q -max $last $last $last | $unu resample -s = = = -k gauss:2,4 -b bleed | $unu resample -s x0.5 x0.5 x0.5 -k box | $unu flip -a 0 -o unu.nrrd"
fi

echo
echo "# one pass over a large file: 2048 x 2048 x 1920 uint8, sparse"
large=large_2048x2048x1920_uint8.raw
truncate -s $((2048 * 2048 * 1920)) $large
cat_result=$("$here/measure.py" --runs 3 --pipe 1048576 'cat | cat' "cat $large | cat")
stats_result=$("$here/measure.py" --runs 3 --pipe 1048576 'vkt read | vkt stats' "vkt read $large | vkt stats")
direct_result=$("$here/measure.py" --runs 3 'vkt stats FILE' "vkt stats $large")
printf '%s\n' "$cat_result" "$stats_result" "$direct_result" | awk -F '\t' -v bytes=$((2048 * 2048 * 1920)) -v memcpy="$memcpy" '
    NR == 1 { cat = $2 }
    {
        verdict = ""
        if (NR == 2) verdict = (cat / $2 >= 0.8 && $6 <= 128) ? "within (bar 0.8 of cat, 128 MiB)" : "MISSED (bar 0.8 of cat, 128 MiB)"
        printf "%-42s %6d ms %6.2f GB/s %6.2f of cat %6.3f of memcpy %5d MiB  %s\n", $1, $2, bytes / $2 * 1e-6, cat / $2,
            bytes / $2 * 1e-6 / memcpy, $6, verdict
    }' | tee large.txt
rm -f "$large"
if grep -q MISSED large.txt; then missed=1; fi

echo
echo '# what a crop reads of its file'
if command -v strace >/dev/null; then
    strace -f -e trace=read,pread64,preadv,readv -o trace.txt vkt crop "$big" --roi 0:16,0:16,0:16 -o small.nrrd --force
    awk -v whole=$((n * n * n * 4)) '/ = [0-9]+$/ { sum += $NF } END { printf "%d bytes of %d\n", sum, whole }' trace.txt
fi

echo
echo '# starting'
row 'vkt --help' 20 0 'vkt --help'
exit $missed
