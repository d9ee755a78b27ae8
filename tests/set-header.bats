# vkt set-header: volkit's spelling of set; voxels stay as they are.
load helper

setup_more() { vkt make ramp --dims 9 7 5 --dtype uint16 -o ramp.nrrd; }

@test "changes what set changes" {
    vkt set ramp.nrrd --spacing 0.5,0.5,2 --units HU --slope 2 --intercept -3 | vkt info --json |
        grep -v history >a.json
    vkt set-header ramp.nrrd --spacing 0.5,0.5,2 --units HU --slope 2 --intercept -3 | vkt info --json |
        grep -v history >b.json
    diff <(grep -v '"vkt set' a.json) <(grep -v '"vkt set' b.json)
    grep -q '"slope": 2' b.json
}

@test "edit is set, too" {
    vkt edit ramp.nrrd --spacing 2 --units K -o a.nrrd
    vkt set ramp.nrrd --spacing 2 --units K -o b.nrrd
    diff <(vkt info a.nrrd --json | grep -v '"vkt \|history') <(vkt info b.nrrd --json | grep -v '"vkt \|history')
    vkt diff a.nrrd b.nrrd
}

@test "the voxels stay" {
    vkt read ramp.nrrd | vkt write - --format raw >a.raw
    vkt set-header ramp.nrrd --dist 1 2 3 --voxel-mapping 0 1 | vkt write - --format raw | cmp - a.raw
}

@test "dims may change if the count of voxels stays" {
    vkt set-header ramp.nrrd --dims 21 5 3 | vkt info --json | tr -d ' \n' | grep -q '"dims":\[21,5,3\]'
    fails_with 2 '' vkt set-header ramp.nrrd --dims 21 5 4 -o out.nrrd
    [ ! -e out.nrrd ]
}

@test "what cannot be a header is refused" {
    fails_with 2 '' vkt set-header ramp.nrrd --spacing 0 -o out.nrrd
    fails_with 2 '' vkt set-header ramp.nrrd --spacing nan -o out.nrrd
    fails_with 2 '' vkt set-header ramp.nrrd --slope 0 -o out.nrrd
    [ ! -e out.nrrd ]
}
