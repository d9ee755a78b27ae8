# vkt refine: structured to hierarchical within a tolerance. More about hierarchical volumes: amr.bats.
load helper

# field: a smooth ball in a non-cubic volume, smooth.nrrd.
field() { vkt make sphere --dims 84 60 50 --radius 9 --edge coverage | vkt filter gaussian --sigma 2 | vkt write smooth.nrrd; }

@test "the result comes back within the tolerance, with fewer cells" {
    field
    for method in basis nearest; do
        for tolerance in 0.2 0.01 0; do
            vkt refine smooth.nrrd --tolerance $tolerance --method $method -o tree.vkt --force
            vkt resample tree.vkt --scale 1 --method $method |
                vkt diff smooth.nrrd - --tolerance "$(awk "BEGIN { print $tolerance + 1e-6 }")" --geometry
        done
    done
    vkt refine smooth.nrrd --tolerance 0.01 | vkt stats --json >stats.json
    [ "$(sed -n 's/.*"count": \([0-9]*\).*/\1/p' stats.json)" -lt $((84 * 60 * 50 * 3 / 4)) ]
}

@test "64-bit integers are kept to the last digit" {
    python_with numpy
    /usr/bin/python3 -c '
import numpy as np
z, y, x = np.indices((64, 48, 80)); rng = np.random.default_rng(1); outside = (x - 12) ** 2 + (y - 12) ** 2 + (z - 12) ** 2 > 50
a = 1700000000000000001 + np.where(outside, 0, x + y); b = np.where(outside, 2**62 + 1, rng.integers(-2**63, 2**63 - 1, x.shape))
c = np.where(outside, 2**64 - 1, rng.integers(0, 2**64 - 1, x.shape, "u8")).astype("u8")
a.tofile("a_80x48x64_int64.raw"); b.tofile("b_80x48x64_int64.raw"); c.tofile("c_80x48x64_uint64.raw")'
    for file in a_80x48x64_int64 b_80x48x64_int64 c_80x48x64_uint64; do
        for method in basis nearest; do
            vkt refine $file.raw --tolerance 0 --method $method -o tree.vkt --force
            [ "$(vkt info tree.vkt --json | sed -n 's/.*"cells": \([0-9]*\).*/\1/p' | head -n 1)" -lt 245760 ] # it is no copy
            vkt resample tree.vkt --scale 1 --method $method | vkt write - --format raw | cmp - $file.raw
        done
    done
    # Blocks that only double takes for the background stay.
    vkt make constant --dims 16 16 16 --dtype int64 --value 9007199254740993 -o odd.vkt
    vkt refine odd.vkt --tolerance 0 --background 9007199254740992 | vkt resample --scale 1 | vkt diff odd.vkt
}

@test "the background of a volume with a value map is a physical value there and back" {
    vkt make sphere --dims 32 32 32 --edge coverage | vkt set --slope 4 --intercept 100 -o mapped.nrrd
    vkt refine mapped.nrrd --tolerance 0.01 --background 100 -o holes.vkt
    [ "$(vkt info holes.vkt --json | sed -n 's/.*"cells": \([0-9]*\).*/\1/p' | head -n 1)" -lt 32768 ]
    vkt resample holes.vkt --scale 1 | vkt diff - mapped.nrrd --tolerance 0.011
}

@test "streams, several volumes, history" {
    field
    vkt read smooth.nrrd | vkt refine --tolerance 0.01 --block-size 4 --levels 3 | vkt info >info
    grep 'kind       hierarchical' info
    grep 'refine --tolerance 0.01 --block-size 4 --levels 3' info
    vkt refine smooth.nrrd --tolerance 0.01 --background 0 | vkt resample --scale 1 |
        vkt diff smooth.nrrd - --tolerance 0.010001
}

@test "what makes no sense is refused" {
    field
    run -2 vkt refine smooth.nrrd -o x.vkt
    [[ "$output" == *'missing --tolerance'* ]]
    fails_with 2 'is negative' vkt refine smooth.nrrd --tolerance -1 -o x.vkt
    fails_with 2 'cannot promise' vkt refine smooth.nrrd --tolerance 1 --method average -o x.vkt
    vkt refine smooth.nrrd --tolerance 0.1 -o tree.vkt
    fails_with 2 'hierarchical already' vkt refine tree.vkt --tolerance 1 -o x.nrrd
    fails_with 2 'not in 1…64' vkt refine smooth.nrrd --tolerance 1 --block-size 100 -o x.nrrd
}
