#!/bin/sh
# All GPUs of a host make the bytes and the remarks of one: several.sh VKT
# SPDX-License-Identifier: MIT
set -eu
vkt=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
count=$(nvidia-smi -L 2>/dev/null | grep -c '^GPU' || true)
if [ "${count:-0}" -lt 2 ]; then
    echo "skipped: several GPUs: this host has ${count:-0}"
    exit 77
fi
# alike WORDS…: the pipeline, a text for a shell in which $DEVICE stands for the device, makes the same file and says the
# same with one GPU and with all. They are noted, and run several at a time.
alike() { echo "$*" >>pipelines; }
cat >compare.sh <<'END'
here=$(mktemp -d here.XXXXXX)
trap 'rm -rf "$here"' EXIT
for device in gpu gpu:all; do
    DEVICE=$device sh -c "$1" >"$here/$device.out" 2>"$here/$device.err" || {
        echo "FAILED on $device: $1"
        cat "$here/$device.err"
        exit 0
    }
    # Shares have less memory, and spool where one has room.
    grep -v 'spooling' "$here/$device.err" >"$here/$device.said" || true
done
if cmp "$here/gpu.out" "$here/gpu:all.out" && cmp "$here/gpu.said" "$here/gpu:all.said"; then exit 0; fi
echo "FAILED: differs: $1"
END

for type in uint8 int16 float32; do
    high=$([ $type = float32 ] && echo 700 || echo 120)
    "$vkt" make noise --dims 190 140 120 --dtype $type --high "$high" --seed 5 -o in_$type.nrrd
    "$vkt" read in_$type.nrrd >in_$type.vkt
done
for type in uint8 int16 float32; do
    for stages in 'filter gaussian --sigma 2' 'filter median' 'resample --scale 0.5 | arith mul 3' \
        'arith mul 5 | convert --dtype uint8 | filter box --radius 2' 'convert --dtype uint8 | resample --dims 90,80,300' \
        'crop --roi 5:150,:,7:110 | filter sobel | arith add 1' 'arith mul 9 | flip z' 'rotate --axis z --angle 20' \
        'label' 'filter gaussian --sigma 12'; do
        alike "$vkt pipe 'read in_$type.nrrd | $stages' --device \$DEVICE --no-history --transport pipe"
        alike "$vkt pipe 'read - | $stages' --device \$DEVICE --no-history --transport pipe <in_$type.vkt"
        alike "cat in_$type.nrrd | $vkt pipe 'read - | $stages' --device \$DEVICE --no-history --transport pipe --memory 96M"
        alike "$vkt pipe 'read in_$type.nrrd | $stages | stats' --device \$DEVICE"
    done
    alike "$vkt filter gaussian in_$type.nrrd --sigma 1.5 --device \$DEVICE --no-history --transport pipe"
    for what in '--render-algo ray-marching' '--render-algo implicit-iso --iso 60' '--render-algo maximum' '--render-algo multi-scattering --spp 20'; do
        alike "$vkt render in_$type.nrrd --size 203x177 $what --device \$DEVICE -q -o -"
    done
done
tr '\n' '\0' <pipelines | xargs -0 -n 1 -P 8 sh compare.sh >results 2>&1
cat results
failed=$(grep -c '^FAILED' results || true)
echo "$(wc -l <pipelines) comparisons of all $count GPUs with one, $failed failed"

# seconds_of DEVICE WORDS…: the least of two.
seconds_of() {
    device=$1
    shift
    least=
    for _ in 1 2; do
        begin=$(date +%s%N)
        DEVICE=$device sh -c "$*" >/dev/null
        took=$((($(date +%s%N) - begin) / 1000000))
        if [ -z "$least" ] || [ "$took" -lt "$least" ]; then least=$took; fi
    done
    echo "$least"
}
free=$(df -k . | awk 'NR == 2 { print $4 }')
if [ "$free" -gt 20000000 ]; then
    dims=${VKT_SEVERAL_DIMS:-1024 1024 1024}
    # shellcheck disable=SC2086  # three numbers
    "$vkt" make noise --dims $dims --dtype uint16 --high 60000 --seed 1 -o big.nrrd
    # shellcheck disable=SC2016  # a shell with a device expands it
    for words in 'pipe "read big.nrrd | filter gaussian --sigma 4 | filter median | filter gaussian --sigma 4 | stats" --device $DEVICE' \
        'pipe "read big.nrrd | filter nlmeans --search 3 --patch 1 --strength 20 --noise 10 | stats" --device $DEVICE'; do
        one=$(seconds_of gpu "$vkt $words") all=$(seconds_of gpu:all "$vkt $words")
        echo "$one ms on one, $all ms on all, $(awk "BEGIN { printf \"%.2f\", $one / $all }") times: $words"
    done
fi
[ "$failed" -eq 0 ]
