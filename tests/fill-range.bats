# vkt fill-range: volkit's name for fill with a region, which must be given.
load helper

setup_more() { vkt make ramp --dims 9 7 5 --dtype uint8 -o ramp.nrrd; }

@test "is fill --roi" {
    vkt fill ramp.nrrd --value 9 --roi 1:4,2:6,0:3 | vkt write - --format raw >a.raw
    vkt fill-range ramp.nrrd --value 9 --first 1 2 0 --last 4 6 3 | vkt write - --format raw | cmp - a.raw
    vkt fill-range ramp.nrrd --value 9 --roi 1:4,2:6,0:3 | vkt write - --format raw | cmp - a.raw
}

@test "counts only the region" {
    vkt make constant --value 5 --dims 9 7 5 --dtype uint8 |
        vkt fill-range --value 0 --first 0 0 0 --last 2 2 2 | vkt stats --json | tr -d ' ' >s.json
    grep -q '"sum":1535,' s.json   # 5 * (315 - 8)
    grep -q '"argmin":\[0,0,0\]' s.json
}

@test "a region is needed and must lie inside" {
    fails_with 2 'no range is given' vkt fill-range ramp.nrrd --value 1 -o out.nrrd
    fails_with 2 '--first, --last 0:10 leaves the volume' vkt fill-range ramp.nrrd --value 1 --first 0 0 0 --last 10 7 5 -o out.nrrd
    fails_with 2 '' vkt fill-range ramp.nrrd --value 1 --first 3 0 0 --last 3 7 5 -o out.nrrd
    [ ! -e out.nrrd ]
}
