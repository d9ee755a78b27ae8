# vkt delete: a region becomes background, all else stays.
load helper

setup_more() { vkt make ramp --dims 9 7 5 --dtype uint8 --from 1 -o ramp.nrrd; }

raw() { vkt write "${1:--}" - --format raw; }

@test "the region is 0, or the value; all else stays, for every type" {
    python_with numpy
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt convert ramp.nrrd --dtype $type 2>/dev/null | vkt write - in.vkt --force
        raw in.vkt >in.raw
        vkt delete in.vkt --roi 2:8,1:-1,:3 --slab 2 | raw >out.raw
        vkt delete in.vkt --roi 2:8,1:-1,:3 --value 7 --threads 1 | raw >seven.raw
        /usr/bin/python3 -c "
import numpy as np
a = np.fromfile('in.raw', '$type').reshape(5, 7, 9)
for value, name in (0, 'out.raw'), (7, 'seven.raw'):
    a[:3, 1:6, 2:8] = value
    assert a.tobytes() == open(name, 'rb').read(), name"
    done
}

@test "the background is physical; pipes and files agree" {
    vkt set ramp.nrrd --slope 2 --intercept -10 -o mapped.nrrd
    vkt delete mapped.nrrd --roi 0:1,:,: | raw | od -An -tu1 -N1 | grep -wq 5
    vkt delete mapped.nrrd --roi 0:1,:,: --value 31 | raw >a.raw
    od -An -tu1 -N1 a.raw | grep -wq 20 # 20.5, half to even
    vkt read mapped.nrrd | vkt delete --roi 0:1,:,: --value 31 | raw | cmp - a.raw
}

@test "trees: cells with centres in the region get the tree's own background" {
    vkt make sphere --dims 32 32 32 | vkt refine --tolerance 0.01 --background -3 -o t.vkt
    vkt delete t.vkt --roi 0:16,:,: -o d.vkt
    [ "$(vkt resample d.vkt --scale 1 --method nearest --background -3 | vkt crop --roi 0:16,:,: | vkt stats --json | grep -c '"\(min\|max\)": -3')" -eq 2 ]
    vkt resample t.vkt --scale 1 --method nearest | vkt crop --roi 16:,:,: -o want.nrrd
    vkt resample d.vkt --scale 1 --method nearest | vkt crop --roi 16:,:,: | vkt diff - want.nrrd
}

@test "what cannot be is refused" {
    fails_with 2 'roi' vkt delete ramp.nrrd -o x.nrrd
    fails_with 2 'x' vkt delete ramp.nrrd --roi 0:10,:,: -o x.nrrd
    fails_with 3 'does not fit' vkt delete ramp.nrrd --roi 0:1,:,: --value -1 --strict -o x.nrrd
    [ ! -e x.nrrd ]
}
