# vkt declare-sv: zeros with a header in volkit's words.
load helper

@test "makes zeros of every integer type" {
    for type in uint8 int8 uint16 int16 uint32 int32; do
        vkt declare-sv --dims 5 4 3 --data-format $type | vkt stats --json >s.json
        grep -q '"count": 60,' s.json
        [ "$(vkt declare-sv --dims 5 4 3 --data-format $type | vkt write - --format raw | tr -d '\0' | wc -c)" = 0 ]
        vkt declare-sv --dims 5 4 3 --data-format $type | vkt info --json | grep -q "\"dtype\": \"$type\""
    done
}

@test "bytes per voxel choose an unsigned type" {
    for pair in 1:uint8 2:uint16 4:uint32; do
        vkt declare-sv --dims 3 2 2 --bpv ${pair%:*} | vkt info --json | grep -q "\"dtype\": \"${pair#*:}\""
    done
    fails_with 2 'bytes' vkt declare-sv --dims 3 2 2 --bytes-per-voxel 3 -o a.nrrd
}

@test "the range of the type stands for the voxel mapping" {
    vkt declare-sv --dims 4 4 4 | vkt fill --value 1 | vkt write - --format raw | od -An -tu1 -N1 | grep -qw 255
    vkt declare-sv --dims 4 4 4 --voxel-mapping -10 10 | vkt fill --value 10 | vkt stats --json | grep -q '"max": 10,'
    vkt declare-sv --dims 4 4 4 --voxel-mapping -10 10 | vkt stats --json | grep -q '"min": -10,'
    vkt declare-sv --dims 4 4 4 --voxel-mapping -10 10 | vkt fill --value 10 | vkt write - --format raw |
        od -An -tu1 -N1 | grep -qw 255
}

@test "spacing is what --dist says" {
    vkt declare-sv --dims 4 4 4 --dist 1 2.5 3 | vkt info --json | grep -q '"spacing": \[1.0,2.5,3.0\]'
}

@test "what makes no volume is refused" {
    fails_with 2 'dims' vkt declare-sv -o a.nrrd
    fails_with 2 '' vkt declare-sv --dims 0 4 4 -o a.nrrd
    fails_with 2 '' vkt declare-sv --dims 4 4 4 --dtype bits -o a.nrrd
    fails_with 2 '' vkt declare-sv --dims 4 4 4 --voxel-mapping 1 1 -o a.nrrd
    [ ! -e a.nrrd ]
}

@test "a stored 0 of a signed type lies in the middle of its range, and fill makes it 0" {
    vkt declare-sv --dims 4 4 4 --data-format int8 | vkt stats --json | grep -q '"min": 0.50196'
    vkt declare-sv --dims 4 4 4 --data-format int8 | vkt fill --value 0 --strict | vkt stats --json | grep -q '"max": 0,'
}
