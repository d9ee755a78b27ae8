# vkt dump and dump-range: volkit's layout, byte for byte.
load helper

@test "the layout of a small volume" {
    vkt make ramp --dims 3 2 2 --spacing 1,0.5,2 --dtype uint8 | vkt dump >out
    diff out - <<'END'
Object: StructuredVolume
  dims: (3,2,2)
  bytesPerVoxel: 1
  dist: (1.0,0.5,2.0)
  voxelMapping: (0.0,255.0)
data:
[0]
{
  [0] {0.0, 1.0, 2.0}
  [1] {0.0, 1.0, 2.0}
}

[1]
{
  [0] {0.0, 1.0, 2.0}
  [1] {0.0, 1.0, 2.0}
}
END
}

@test "ranges in both spellings keep absolute indices" {
    vkt make ramp --dims 6 5 4 --axis z -o r.vkt
    vkt dump r.vkt --roi 1:3,4:5,2:4 >a
    vkt dump r.vkt --first 1 4 2 --last 3 5 4 >b
    vkt dump-range -i r.vkt --first 1 4 2 --last 3 5 4 >c
    vkt dump-range -first 1 4 2 -last 3 5 4 <r.vkt >d
    cmp a b
    cmp a c
    cmp a d
    [ "$(tail -n 8 a | tr -d '\n')" = "{  [4] {2.0, 2.0}}[3]{  [4] {3.0, 3.0}}" ]
}

@test "every n-th voxel of a range: the values of the cropped volume at their places in the whole" {
    vkt make noise --dims 9 8 7 --dtype uint8 -o n.vkt
    for roi in ::2,::3,::4 1:8:3,2:3,: :,:7:5,5:7; do
        vkt dump n.vkt --roi $roi >stepped
        vkt crop n.vkt --roi $roi | vkt dump >cropped
        grep -o '{.*}' stepped >a
        grep -o '{.*}' cropped | diff a -
        vkt read n.vkt | vkt dump --roi $roi --memory 100k | diff stepped -
    done
    vkt dump --help | grep -q 'under their numbers in the whole volume'
    [ "$(vkt dump n.vkt --roi ::2,1::3,2::4 | grep -o '^ *\[[0-9]*\]' | tr -d ' \n')" = "[2][1][4][7][6][1][4][7]" ]
}

@test "values are physical" {
    vkt declare-sv --dims 2 1 1 --data-format uint8 -vm -1 1 | vkt dump >out
    grep -q 'voxelMapping: (-1.0,1.0)' out
    grep -q '{-1.0, -1.0}' out
}

@test "ranges that make no sense" {
    vkt make ramp --dims 6 5 4 -o r.vkt
    fails_with 2 "no range" vkt dump-range r.vkt
    fails_with 2 "go together" vkt dump r.vkt --first 0 0 0
    run vkt dump r.vkt --first 0 0 0 --last 7 1 1
    [ "$status" -eq 2 ]
    run vkt dump r.vkt --first 2 0 0 --last 2 1 1
    [ "$status" -eq 2 ]
}

@test "values are printed with all their digits" {
    while read -r dtype value shown; do
        vkt make constant --dims 1 1 1 --dtype "$dtype" --value "$value" | vkt dump | grep -qF "{$shown}" ||
            { echo "$dtype $value" >&2; false; }
    done <<'END'
float32 3.1e-7 3.1e-07
float64 0.1234567890123456 0.1234567890123456
float64 -1e-300 -1e-300
float64 1e300 1e+300
float32 1e30 1e+30
float64 9007199254740992 9007199254740992.0
float32 100000 100000.0
int64 -9007199254740993 -9007199254740993.0
uint64 18446744073709551615 18446744073709551615.0
END
}
