# vkt fill and fill-range: physical values, regions, what does not fit.
load helper

setup_more() { vkt make ramp --dims 9 7 5 --dtype uint8 -o ramp.nrrd; }

raw() { vkt read "${1:--}" | vkt write - --format raw; }

@test "all voxels take the value" {
    vkt fill ramp.nrrd --value 200 | raw >out.raw
    [ "$(stat -c %s out.raw)" = 315 ]
    [ "$(tr -d '\310' <out.raw | wc -c)" = 0 ]
}

@test "a region takes the value, all else stays" {
    python_with numpy
    raw ramp.nrrd >in.raw
    vkt fill ramp.nrrd --value 77 --roi 2:8,1:-1,:3 --slab 2 | raw >out.raw
    /usr/bin/python3 -c "
import numpy as np
a = np.fromfile('in.raw', np.uint8).reshape(5, 7, 9)
a[:3, 1:6, 2:8] = 77
assert (a == np.fromfile('out.raw', np.uint8).reshape(5, 7, 9)).all()"
    vkt fill ramp.nrrd --value 77 --first 2 1 0 --last 8 6 3 | raw | cmp - out.raw
    vkt fill-range ramp.nrrd --value 77 --first 2 1 0 --last 8 6 3 | raw | cmp - out.raw
}

@test "the value is physical and rounds half to even" {
    vkt set ramp.nrrd --slope 2 --intercept -10 -o mapped.nrrd
    vkt fill mapped.nrrd --value 31 | raw | od -An -tu1 -N1 | grep -wq 20   # 20.5
    vkt fill mapped.nrrd --value 33 | raw | od -An -tu1 -N1 | grep -wq 22   # 21.5
}

@test "what does not fit is clipped and reported" {
    run --separate-stderr bash -c 'vkt fill ramp.nrrd --value 300 | vkt write - --format raw | od -An -tu1 -N1'
    [ "${output// /}" = 255 ]
    [[ "$stderr" == *"the value 300 does not fit uint8: stored as 255 in 315 voxels"* ]]
    run vkt fill ramp.nrrd --value 300 --strict -o out.nrrd
    [ "$status" -ne 0 ]
    [ ! -e out.nrrd ]
}

@test "64-bit integers take every value they hold, exactly" {
    for pair in uint64:18446744073709551615 int64:9223372036854775807 int64:-9223372036854775808 int64:9007199254740993; do
        vkt make constant --dims 2 1 1 --dtype ${pair%:*} | vkt fill --value ${pair#*:} --strict -o full.vkt --force
        vkt stats full.vkt --json | grep -q "\"max\": ${pair#*:},"
    done
    vkt make constant --dims 2 1 1 --dtype uint64 -o zero.vkt
    fails_with 3 'does not fit' vkt fill zero.vkt --value 18446744073709551616 --strict -o out.vkt
    fails_with 3 'does not fit' vkt fill zero.vkt --value -1 --strict -o out.vkt
}

@test "every type takes a value" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make ramp --dims 9 7 5 --dtype $type | vkt fill --value 100 | vkt stats --json >stats.json
        grep -Eq '"min(imum)?": *100(\.0)?[,}]' stats.json || { cat stats.json >&2; false; }
    done
}

@test "regions are checked" {
    fails_with 2 'go together' vkt fill ramp.nrrd --first 0 0 0 -o out.nrrd
    fails_with 2 'give one of them' vkt fill ramp.nrrd --roi 0:1,:,: --first 0 0 0 --last 1 1 1 -o out.nrrd
    fails_with 2 'no range is given' vkt fill-range ramp.nrrd --value 1 -o out.nrrd
    fails_with 2 'x' vkt fill ramp.nrrd --roi 0:10,:,: -o out.nrrd
    [ ! -e out.nrrd ]
}
