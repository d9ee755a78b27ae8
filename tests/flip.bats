# vkt flip and flip-range: permutations, exact for every type, on volumes of unequal extents.
load helper

setup_more() {
    # Bytes of every pattern, 7 x 6 x 5: NaN payloads and negative zeros among the floats.
    for type in uint8 int16 float16 float32 float64; do
        /usr/bin/python3 -c "
import random, sys
size = {'uint8': 1, 'int16': 2, 'float16': 2, 'float32': 4, 'float64': 8}['$type']
random.seed(size)
sys.stdout.buffer.write(bytes(random.randrange(256) for _ in range(7 * 6 * 5 * size)))" >"v_7x6x5_$type.raw"
    done
}

# numpy EXPRESSION IN OUT: applies an expression to a [z, y, x].
numpy_raw() {
    /usr/bin/python3 -c "
import numpy as np, sys
a = np.fromfile('$2', dtype=np.uint$4).reshape(5, 6, 7)
b = a.copy()
$1
b.tofile('$3')"
}

# refused TEXT COMMAND…: exit 2 and TEXT on stderr. Option errors also reach the next stage through stdout.
refused() {
    local text="$1"
    shift
    run --separate-stderr "$@"
    [ "$status" -eq 2 ] || { echo "status $status: $stderr" >&2; return 1; }
    [[ "$stderr" == *"$text"* ]] || { echo "stderr lacks '$text': $stderr" >&2; return 1; }
}

@test "each axis agrees with numpy, for every type, and twice is the identity" {
    python_with numpy
    for type in uint8:8 int16:16 float16:16 float32:32 float64:64; do
        bits=${type#*:}
        type=${type%:*}
        for axis in x:::-1 y::-1 z:-1; do
            vkt flip "${axis%%:*}" "v_7x6x5_$type.raw" --format raw -o out.raw --force
            case ${axis%%:*} in
            x) numpy_raw 'b = a[:, :, ::-1]' "v_7x6x5_$type.raw" want.raw "$bits" ;;
            y) numpy_raw 'b = a[:, ::-1, :]' "v_7x6x5_$type.raw" want.raw "$bits" ;;
            z) numpy_raw 'b = a[::-1, :, :]' "v_7x6x5_$type.raw" want.raw "$bits" ;;
            esac
            cmp out.raw want.raw
            vkt flip "${axis%%:*}" "v_7x6x5_$type.raw" | vkt flip "${axis%%:*}" | vkt write - --format raw >twice.raw
            cmp twice.raw "v_7x6x5_$type.raw"
        done
    done
}

@test "slab heights, threads and pipes make no difference" {
    for axis in x y z; do
        vkt flip $axis v_7x6x5_float32.raw --slab 5 --threads 1 --format raw -o a.raw --force
        for slab in 1 2 3; do
            vkt flip $axis v_7x6x5_float32.raw --slab $slab --threads 2 --format raw -o b.raw --force
            cmp a.raw b.raw
            vkt read v_7x6x5_float32.raw --slab 2 | vkt flip $axis --slab $slab | vkt write - --format raw >c.raw
            cmp a.raw c.raw
        done
    done
}

@test "a region is mirrored within itself, all else stays" {
    python_with numpy
    vkt flip x v_7x6x5_uint8.raw --roi 1:6,2:5,1:4 --format raw -o x.raw
    numpy_raw 'b[1:4, 2:5, 1:6] = a[1:4, 2:5, 1:6][:, :, ::-1]' v_7x6x5_uint8.raw want.raw 8
    cmp x.raw want.raw
    vkt flip z v_7x6x5_uint8.raw --roi 1:6,2:5,1:4 --slab 1 --format raw -o z.raw
    numpy_raw 'b[1:4, 2:5, 1:6] = a[1:4, 2:5, 1:6][::-1]' v_7x6x5_uint8.raw want.raw 8
    cmp z.raw want.raw
}

@test "flip-range is flip with a region" {
    for axis in x y z; do
        vkt flip-range v_7x6x5_int16.raw --axis $axis --first 1 2 1 --last 6 5 4 --format raw -o a.raw --force
        vkt flip $axis v_7x6x5_int16.raw --roi 1:6,2:5,1:4 --format raw -o b.raw --force
        cmp a.raw b.raw
    done
    fails_with 2 'is no region' vkt flip-range v_7x6x5_int16.raw --first 3 3 3 --last 3 4 4 -o c.raw
    refused '--first' vkt flip-range v_7x6x5_int16.raw --last 3 4 4 -o c.raw
    fails_with 2 'x' vkt flip-range v_7x6x5_int16.raw --first 0 0 0 --last 8 6 5 -o c.raw
    [ ! -e c.raw ]
}

@test "voxels keep their world positions" {
    vkt set v_7x6x5_uint8.raw --spacing 0.5,1,2 --origin 10,20,30 -o s.nrrd
    vkt flip x s.nrrd | vkt info | grep -x 'origin     13 20 30'
    vkt flip x s.nrrd | vkt info | grep -x 'direction  -1 0 0  0 1 0  0 0 1'
    vkt flip z s.nrrd | vkt info | grep -x 'origin     10 20 38'
    vkt flip x s.nrrd --roi 0:3,:,: | vkt info | grep -x 'origin     10 20 30'
}

@test "an axis must be named" {
    refused 'axis to mirror' vkt flip -o out.nrrd
    refused "'w' is not one of x, y, z" vkt flip w v_7x6x5_uint8.raw -o out.nrrd
}
