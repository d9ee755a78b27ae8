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
