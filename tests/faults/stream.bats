# What can go wrong between two stages and at the ends of a pipeline.
load ../helper

setup_more() { vkt make noise --dims 21 17 13 --dtype uint16 --seed 2 -o in.vkt; }

@test "a damaged byte anywhere in a small stream is noticed or harmless" {
    vkt make ramp --dims 3 2 4 --dtype uint8 -o small.vkt
    size=$(stat -c %s small.vkt)
    for i in $(seq 0 7 $((size - 1))); do
        python3 - "$i" <<'P'
import sys
data = bytearray(open("small.vkt", "rb").read())
data[int(sys.argv[1])] ^= 0x5A
open("damaged.vkt", "wb").write(data)
P
        code=0
        vkt read damaged.vkt 2>/dev/null >copy.vkt || code=$?
        if [ "$code" -eq 0 ]; then
            vkt diff small.vkt copy.vkt >/dev/null
        else
            [ "$code" -eq 3 ] || { echo "byte $i: exit $code"; return 1; }
        fi
    done
}

@test "a reader that is slower than its writer, and the reverse" {
    vkt read in.vkt | (sleep 0.3; vkt flip x) | vkt flip x | vkt diff in.vkt - >/dev/null
    (sleep 0.3; cat in.vkt) | vkt flip x | (sleep 0.2; vkt flip x) | vkt diff in.vkt - >/dev/null
}

@test "one byte at a time" {
    python3 -c '
import sys, os
data = open("in.vkt", "rb").read()
for i in range(len(data)): os.write(1, data[i:i+1])' | vkt read | vkt diff in.vkt - >/dev/null
}

@test "a full disk is exit 4, said once, and leaves nothing" {
    mkdir small
    mount -t tmpfs -o size=64k tmpfs small 2>/dev/null || skip "mounting a tmpfs needs root"
    run --separate-stderr vkt make noise --dims 64 64 64 --dtype float32 --seed 1 -o small/out.nrrd
    left=$(ls -A small)
    umount small
    [ "$status" -eq 4 ]
    [[ "${stderr,,}" == *"no space left"* ]]
    [ -z "$left" ]
}

@test "a full spool directory is exit 4 and names TMPDIR" {
    mkdir small
    mount -t tmpfs -o size=64k tmpfs small 2>/dev/null || skip "mounting a tmpfs needs root"
    vkt make noise --dims 64 64 64 --dtype float32 --seed 1 -o big.vkt
    run --separate-stderr bash -c 'cat big.vkt | TMPDIR=small vkt flip z --memory 64k -o out.nrrd'
    left=$(ls -A small)
    umount small
    [ "$status" -eq 4 ]
    # Before anything is spooled: what is needed is known.
    [[ "$stderr" == *"no space left on device: 1.0 MiB are needed, 64.0 KiB are free"*"TMPDIR"* ]]
    [ -z "$left" ]
    [ ! -e out.nrrd ]
}

@test "a volume beyond --memory is spooled with one notice and the same result" {
    cat in.vkt | vkt flip z >whole.vkt
    run --separate-stderr bash -c 'cat in.vkt | vkt flip z --memory 2k >spooled.vkt'
    [ "$status" -eq 0 ]
    [[ "$stderr" == *"spooling"* ]]
    vkt diff whole.vkt spooled.vkt >/dev/null
}

@test "a directory that cannot be written" {
    mkdir closed
    if [ "$(id -u)" -eq 0 ]; then # root writes into any directory, but not on a read-only file system
        mount -t tmpfs -o ro tmpfs closed 2>/dev/null || skip "root cannot mount a read-only tmpfs here"
    else
        chmod 500 closed
    fi
    run --separate-stderr vkt read in.vkt -o closed/out.nrrd
    [ "$(id -u)" -ne 0 ] || umount closed
    [ "$status" -eq 4 ]
    [[ "$stderr" == *"closed"* ]]
    [ "$(grep -c '^vkt' <<<"$stderr")" -le 2 ]
}

@test "a stream of another version is refused" {
    { printf 'VKT2'; tail -c +5 in.vkt; } >other.vkt
    fails_with 3 "version" vkt flip x other.vkt
    # Line ends that were rewritten as text tell of themselves.
    sed '1s/\r$//' in.vkt >text.vkt
    fails_with 3 "binary" vkt flip x text.vkt
    run --separate-stderr bash -c 'vkt flip x <other.vkt | vkt write out.nrrd'
    [ "$status" -eq 3 ]
    [ ! -e out.nrrd ]
}

@test "nothing at all on standard input is exit 3" {
    fails_with 3 "" vkt flip x </dev/null
    run --separate-stderr bash -c 'vkt write out.nrrd </dev/null'
    [ "$status" -eq 3 ]
    [ ! -e out.nrrd ]
}

@test "a missing directory is exit 4" { fails_with 4 "nowhere" vkt read in.vkt -o nowhere/out.nrrd; }

@test "absurd dims are refused, not allocated" {
    fails_with 2 "" vkt make constant --dims 0 4 4 --value 1 -o x.nrrd
    for dims in 1099511627777,1,1 1099511627776,1099511627776,1 -4,4,4; do
        run --separate-stderr vkt make constant --dims "$dims" --value 1 -o x.nrrd
        [ "$status" -eq 2 ] || [ "$status" -eq 3 ]
        [ ! -e x.nrrd ]
    done
}

@test "shared memory gives the same bytes as the pipe, also through several stages" {
    vkt read in.vkt | vkt filter gaussian --sigma 1 | vkt flip z | vkt convert --dtype float32 >a.vkt
    VKT_TRANSPORT=shm bash -c 'vkt read in.vkt | vkt filter gaussian --sigma 1 | vkt flip z | vkt convert --dtype float32' >b.vkt 2>notice
    cmp a.vkt b.vkt
}

@test "a consumer that is no vkt makes shm fall back with one notice" {
    run --separate-stderr bash -c 'vkt read in.vkt --transport shm | cat >copy.vkt'
    [ "$status" -eq 0 ]
    [ "$(grep -c 'through the pipe' <<<"$stderr")" -eq 1 ]
    vkt diff in.vkt copy.vkt >/dev/null
}

@test "tee between two stages is served through the pipe" {
    vkt read in.vkt --transport shm 2>/dev/null | tee >(vkt flip x -o flipped.vkt) | vkt diff - in.vkt >/dev/null
    for _ in $(seq 50); do [ -e flipped.vkt ] && break; sleep 0.1; done
    vkt flip x flipped.vkt | vkt diff - in.vkt >/dev/null
}

@test "GPU memory gives the same bytes, a reader may leave early, and what was cut off stays that" {
    local stage="$VKT_BUILD/tests/vkt_gpu_stage" # its GPU is a file in memory
    [ -x "$stage" ] || skip "vkt_gpu_stage is not built"
    vkt make noise --dims 128 128 200 --dtype float32 --seed 4 -o large.vkt
    $stage copy <large.vkt 2>notices | $stage pass 2>>notices | $stage copy 2>>notices | vkt diff - large.vkt >/dev/null
    # The first two leave voxels there; vkt diff reads none of it.
    [ "$(cat notices)" = 'vkt_gpu_stage: the next stage reads no GPU memory: voxels go through shared memory' ]
    $stage copy <large.vkt 2>/dev/null | cat | $stage copy 2>/dev/null | vkt diff - large.vkt >/dev/null
    run --separate-stderr bash -c "$stage copy <large.vkt | $stage copy | head -c 1000 | wc -c; echo \${PIPESTATUS[*]}"
    [[ "$output" == $'1000\n'*' 0 0' ]]
    run ! grep -v 'voxels go through' <<<"$stderr"
    head -c 9000000 large.vkt >cut.vkt
    run --separate-stderr bash -c "$stage copy <cut.vkt | $stage pass | $stage copy | vkt write out.nrrd; echo \${PIPESTATUS[*]}"
    [ "$output" = '3 3 3 3' ]
    [ "$(grep -c 'ended early' <<<"$stderr")" -eq 1 ]
    [ ! -e out.nrrd ]
}

@test "geometry that is no number is refused" {
    vkt make ramp --dims 3 4 5 --dtype uint8 -o good.vkt
    for option in spacing origin slope intercept; do
        for value in nan inf -inf; do
            fails_with 2 '' vkt set good.vkt --$option=$value -o out.nrrd
        done
    done
    # NRRD says with NaN that a spacing is unknown.
    printf 'NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspacings: nan 2 2\nencoding: raw\n\n12345678' >unknown.nrrd
    vkt info unknown.nrrd --json | grep -q '"spacing": \[1.0,2.0,2.0\]'
    printf 'NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspacings: inf 2 2\nencoding: raw\n\n12345678' >bad.nrrd
    fails_with 3 'bad.nrrd' vkt read bad.nrrd -o out.nrrd
    printf 'NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspace: left-posterior-superior\nspace directions: (1,0,0) (0,nan,0) (0,0,1)\nencoding: raw\n\n12345678' >bad.nrrd
    fails_with 3 'bad.nrrd' vkt read bad.nrrd -o out.nrrd
    printf 'ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementSpacing = 1 nan 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n12345678' >bad.mha
    fails_with 3 'bad.mha' vkt read bad.mha -o out.nrrd
    [ ! -e out.nrrd ]
}
