# vkt write: formats by name, whole files or none, nothing overwritten unasked.
load helper

setup_more() {
    for i in $(seq 0 104); do printf '%b' "$(printf '\\x%02x\\x00' "$i")"; done >ramp_7x5x3_int16.raw
    vkt read ramp_7x5x3_int16.raw --spacing 0.5,1,2 -o ramp.vkt
}

voxels() { vkt write - --format raw; }
count_files() { find . -mindepth 1 | wc -l; }

@test "every format gives the voxels and the geometry back" {
    for name in a.nrrd a.nhdr a.mha a.mhd a.vkt; do
        for flag in "" --compress; do
            if [ "$name$flag" = a.vkt--compress ]; then continue; fi
            # shellcheck disable=SC2086
            vkt write "$name" ramp.vkt --force $flag
            vkt read "$name" | voxels | cmp - ramp_7x5x3_int16.raw
            vkt info "$name" --json | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["dims"] == [7, 5, 3] and info["dtype"] == "int16" and info["spacing"] == [0.5, 1, 2], info'
        done
    done
    vkt write b_7x5x3_int16.raw ramp.vkt
    cmp b_7x5x3_int16.raw ramp_7x5x3_int16.raw
    vkt write b_7x5x3_int16.raw.gz ramp.vkt
    gzip -dc b_7x5x3_int16.raw.gz | cmp - ramp_7x5x3_int16.raw
}

@test "standard output takes a named format" {
    vkt write - ramp.vkt --format nrrd | vkt read | voxels | cmp - ramp_7x5x3_int16.raw
    vkt write - ramp.vkt --format metaimage | vkt read | voxels | cmp - ramp_7x5x3_int16.raw
    vkt write - ramp.vkt --format vkt | vkt read | voxels | cmp - ramp_7x5x3_int16.raw
    vkt write - ramp.vkt --format nrrd --compress | vkt read | voxels | cmp - ramp_7x5x3_int16.raw
    fails_with 2 "cannot tell the format" vkt write - ramp.vkt
    fails_with 2 "its size comes first" vkt write - ramp.vkt --format metaimage --compress
}

@test "the value map, units and history survive NRRD and MetaImage" {
    printf 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nsample units: "HU"\nvkt slope:=0.5\nvkt intercept:=-1000\nnote:=kept\n\nabcdefgh' >in.nrrd
    for name in a.nrrd a.mha; do
        vkt read in.nrrd | vkt write $name
        vkt info $name --json | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["slope"] == 0.5 and info["intercept"] == -1000 and info["units"] == "HU", info
assert info["attributes"]["note"] == "kept", info
assert info["history"]["command"][0] == "read", info'
    done
}

@test "an existing file is kept, unless --force says otherwise" {
    echo precious >a.nrrd
    fails_with 4 "--force" vkt write a.nrrd ramp.vkt
    [ "$(cat a.nrrd)" = precious ]
    vkt write a.nrrd ramp.vkt --force
    vkt read a.nrrd | voxels | cmp - ramp_7x5x3_int16.raw
    # A file that appears meanwhile is kept as well.
    mkfifo slow
    vkt write b.nrrd slow 2>err &
    writer=$!
    { sleep 0.3; echo precious >b.nrrd; cat ramp.vkt; } >slow
    status=0
    wait $writer || status=$?
    [ $status -eq 4 ]
    [ "$(cat b.nrrd)" = precious ]
    grep -q -e --force err
    # Overwriting the input is safe: it is replaced when it has been read.
    vkt read a.nrrd | vkt write a.nrrd --force
    vkt read a.nrrd | voxels | cmp - ramp_7x5x3_int16.raw
}

@test "what goes wrong leaves nothing" {
    mkdir d && cd d
    for n in 0 10 100 300 $(($(stat -c %s ../ramp.vkt) - 1)); do
        for name in a.nrrd a.nhdr a.mha a.mhd a.raw a.vkt a.raw.gz; do
            head -c "$n" ../ramp.vkt >../cut
            fails_with 3 "" vkt write $name - <../cut
        done
    done
    [ "$(count_files)" -eq 0 ]
    fails_with 4 "no such file or directory" vkt write no/such/directory/a.nrrd ../ramp.vkt
    fails_with 4 "is a directory" vkt write . ../ramp.vkt --format raw
    fails_with 4 "no space left" vkt write /dev/full ../ramp.vkt --format raw
    fails_with 2 "--format" vkt write a.unknown ../ramp.vkt
    fails_with 2 "did you mean 'nrrd'" vkt write a.x ../ramp.vkt --format nrdd
    fails_with 2 "missing OUT" vkt write
    [ "$(count_files)" -eq 0 ]
}

@test "a disk that is full leaves nothing" {
    mkdir small
    mount -t tmpfs -o size=64k tmpfs small 2>/dev/null || skip "a tmpfs cannot be mounted here"
    truncate -s 1M big_128x128x64_uint8.raw
    failed=0
    for name in a.nrrd a.nhdr a.mha a.mhd a.raw a.vkt; do
        fails_with 4 "space left" vkt write small/$name big_128x128x64_uint8.raw || failed=1
        [ -z "$(ls -A small)" ] || failed=1
    done
    umount small
    [ $failed -eq 0 ]
}

@test "kill -9 leaves nothing" {
    mkdir d
    mkfifo slow
    for name in a.nrrd a.mhd a.raw; do
        vkt write d/$name slow &
        writer=$!
        { head -c 400 ramp.vkt; sleep 0.2; kill -9 $writer; } >slow || true
        wait $writer || true
        [ -z "$(ls -A d)" ] || { ls -A d >&2; false; }
    done
}

@test "devices and pipes are written as they are" {
    vkt write /dev/null ramp.vkt --format raw
    vkt write /dev/stdout ramp.vkt --format raw | cmp - ramp_7x5x3_int16.raw
    vkt write >(cat >copy) ramp.vkt --format raw
    for _ in $(seq 50); do
        if cmp -s copy ramp_7x5x3_int16.raw; then break; fi
        sleep 0.1
    done
    cmp copy ramp_7x5x3_int16.raw
}

@test "several volumes become a fourth axis" {
    printf 'NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 2 1 3\nkinds: domain domain domain time\nencoding: raw\n\nabcdefghijkl' >series.nrrd
    [ "$(vkt read series.nrrd | voxels)" = abcdefghijkl ]
    for name in a.nrrd a.nhdr a.mha b.mhd; do
        vkt read series.nrrd | vkt write $name
        [ "$(vkt read $name | voxels)" = abcdefghijkl ]
        vkt info $name --json | python3 -c 'import json, sys; assert len(json.load(sys.stdin)) == 3'
        vkt read series.nrrd | vkt write $name --force --compress
        [ "$(vkt read $name | voxels)" = abcdefghijkl ]
    done
    run -2 bash -o pipefail -c 'vkt read series.nrrd | vkt write - --format nrrd | cat >/dev/null'
    [[ "$output" == *"cannot hold several volumes"* ]]
}

@test "types that a format cannot hold are named" {
    head -c 210 /dev/zero >half_7x5x3_float16.raw
    fails_with 2 "NRRD cannot hold float16" vkt write a.nrrd half_7x5x3_float16.raw
    fails_with 2 "MetaImage cannot hold float16" vkt write a.mha half_7x5x3_float16.raw
    [ ! -e a.nrrd ] && [ ! -e a.mha ]
}

@test "files carry neither a date nor anything random" {
    vkt make noise --dims 12 10 8 -o v.nrrd
    for turn in 1 2; do
        mkdir $turn
        for name in a.nrrd a.mha a.vkt a.raw a.raw.gz; do vkt write $turn/$name v.nrrd; done
        vkt write $turn/b.nrrd v.nrrd --compress
        vkt render v.nrrd --size 8 -o $turn/a.png
        sleep 1.1
    done
    diff -r 1 2
}
