# vkt set, set-header, declare-sv: headers change, voxels do not.
load helper

setup_more() { vkt make noise --dims 6 5 4 -o n.vkt; }
raw() { vkt write - --format raw; }

@test "every field of the header" {
    python_with numpy
    vkt set n.vkt --spacing 1,2,3 --origin 4,5,6 --direction 0,1,0,-2,0,0,0,0,1 --units HU --slope 2 --intercept -7 --attribute a=b c=d=e | vkt info --json >i
    /usr/bin/python3 -c '
import json; i = json.load(open("i"))
assert i["spacing"] == [1, 2, 3] and i["origin"] == [4, 5, 6] and i["direction"] == [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], i
assert i["slope"] == 2 and i["intercept"] == -7 and i["units"] == "HU" and i["attributes"] == {"a": "b", "c": "d=e"}, i'
}

@test "voxels stay as they are, also under new dims" {
    vkt read n.vkt | raw >before
    vkt set n.vkt --spacing 2 | raw | cmp - before
    for slab in 1 3 100; do vkt set-header n.vkt --dims 3 8 5 --slab $slab | raw | cmp - before; done
    vkt set n.vkt --dims 120 1 1 | raw | cmp - before
    fails_with 2 "121 voxels, but the volume has 120" vkt set n.vkt --dims 121 1 1 -o x.vkt
}

@test "volkit's declare-sv stores what its mapping says" {
    vkt declare-sv --dims 3 4 5 --data-format uint8 | vkt arith add - 1 | raw | od -An -tu1 -v | tr -s ' ' '\n' | sort -u | grep -qx 255
    vkt declare-sv --dims 3 4 5 -bpv 2 --dist 1 2 3 -vm -1 1 | vkt info --json >i
    grep -q uint16 i
    vkt declare-sv --dims 3 4 5 -bpv 2 -vm -1 1 | vkt stats --json | grep -q '"max": -1,'
    [ "$(vkt declare-sv --dims 3 4 5 | raw | wc -c)" = 60 ]
    fails_with 2 "contradicts" vkt declare-sv --dims 1 1 1 -bpv 2 --data-format uint8 -o x.vkt
    fails_with 2 "ascending" vkt declare-sv --dims 1 1 1 -vm 1 1 -o x.vkt
    fails_with 2 "--bytes-per-voxel: 3" vkt declare-sv --dims 1 1 1 -bpv 3 -o x.vkt
}

@test "headers that make no sense" {
    fails_with 2 "not a positive length" vkt set n.vkt --spacing 0 -o x.vkt
    fails_with 2 "nine numbers" vkt set n.vkt --direction 1,0,0 -o x.vkt
    fails_with 2 "dependent" vkt set n.vkt --direction 1,0,0,1,0,0,0,0,1 -o x.vkt
    fails_with 2 "--slope: 0" vkt set n.vkt --slope 0 -o x.vkt
    fails_with 2 "KEY=VALUE" vkt set n.vkt --attribute nonsense -o x.vkt
    fails_with 2 "give one of them" vkt set n.vkt --spacing 1 --dist 1 1 1 -o x.vkt
}
