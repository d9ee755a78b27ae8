# What vkt promises about every operation: the same bytes however it runs, and whole outputs or none.
load helper

# What every test reads is made once: the inputs, and what each operation makes of a pipe when nothing is asked of it.
setup_file() {
    cd "$BATS_FILE_TMPDIR" || return 1
    mkdir inputs results
    cd inputs || return 1
    cp "$VKT_ROOT/examples/data/phantom.nrrd" phantom.nrrd
    # Odd, unequal extents; three types.
    vkt crop phantom.nrrd --roi 1:60,5:58,20:57 -o volume.nrrd
    # Other grids: fractions of voxels aside, turned, mirrored and with axes in another order.
    vkt resample volume.nrrd --dims 40 50 30 | vkt crop --roi 3:,2:,5: -o aside.nrrd
    vkt crop volume.nrrd --roi 10:22,3:20,4:14 | vkt flip x -o part.nrrd
    vkt set volume.nrrd --direction 0.96,0.28,0,-0.28,0.96,0,0,0,1 -o turned.nrrd
    echo '3 1 5  1 2 3 4 5 6 7 8 9 10 11 12 13 14 -15' >kernel.txt
    vkt set volume.nrrd --direction 0,0,1,0,-1,0,1,0,0 -o swapped.nrrd
    vkt read volume.nrrd >volume.vkt
    local i
    for i in "${!operations[@]}"; do
        # shellcheck disable=SC2086,SC2002  # words; a pipe, not a file
        cat volume.vkt | vkt ${operations[i]} -o "../results/$i.raw" 2>/dev/null && [ -s "../results/$i.raw" ] ||
            { echo "${operations[i]}: no output" >&2; return 1; }
    done
}

setup_more() { cp "$BATS_FILE_TMPDIR"/inputs/* .; }

# Operations of every kind: pointwise, neighbourhood, scaled, jumping, two passes.
operations=(
    "crop --roi 3:50,:,2:-3"
    "fill --value 7"
    "fill-range --first 3 2 1 --last 30 20 10 --value 9"
    "flip x"
    "flip y"
    "flip z"
    "resample --scale 0.5"
    "resample --scale 1.7"
    "resample --dims 33 71 20 --method nearest"
    "resample --dims 33 71 20 --method linear"
    "resample --dims 70 31 44 --method cubic"
    "resample --like aside.nrrd"
    "resample --like turned.nrrd --method cubic"
    "resample --like swapped.nrrd --boundary mirror"
    "filter gaussian --sigma 1.3"
    "filter gaussian --sigma 4 --boundary wrap"
    "filter gaussian --sigma 2 --boundary border:3"
    "filter gaussian --sigma 3 --method cascade --tolerance 1%"
    "filter box --radius 4,0,2"
    "filter gradient"
    "filter kernel kernel.txt"
    "filter laplacian --boundary wrap"
    "filter sobel --component y --dtype int16"
    "filter log --sigma 1.5"
    "filter dog --sigma 1"
    "filter sharpen --sigma 1,2,0 --boundary wrap"
    "filter bilateral --sigma 0.8 --range-sigma 30"
    "filter nlmeans --search 1,2,1 --strength 20"
    "filter nlmeans --search 1,1,0 --noise auto --boundary wrap"
    "filter median --radius 1"
    "filter median --radius 3,2,4 --boundary border:3"
    "convert --dtype float32"
    "convert --dtype int16 --range minmax"
    "convert --dtype uint8 --range p1:p99"
    "arith mul - 1.5"
    "threshold --above 40"
    "pad --by 2:3,4:1,5:6 --value 3"
    "pad --by 2:3,4:1,5:6 --boundary clamp"
    "pad --by 2:3,4:1,5:6 --boundary mirror"
    "pad --by 70,1,50 --boundary wrap"
    "permute zyx"
    "permute yzx"
    "permute xzy"
    "permute yxz"
    "slice --z 4"
    "slice --axis x --range p1:p99"
    "slice --y 3"
    "project max"
    "project mean --axis y"
    "project std --axis x"
    "project median"
    "delete --roi 3:20,:,2:-3"
    "copy part.nrrd --at 5,6,7"
    "threshold --otsu"
    "label --connectivity 18 --min-size 2"
    "distance --signed"
    "fill-holes --connectivity 6 --max-size 50"
    "morphology close --radius 2"
    "morphology tophat --radius 1,3,2 --shape box"
    "clahe --bricks 3,4,2"
    "transform v*sin(x/9)+wz"
    "transform v[2,0,-3]-v[0,1,0]/3 --boundary wrap"
    "scan"
    "scan --exclusive"
    "watershed --depth 2 --connectivity 18"
    "watershed --on distance --line"
    "watershed --on gradient --depth 3"
)

raw_sum() { vkt write - --format raw | sha256sum; }

# as_ever I FILE WHAT: the file holds what operation I made of a pipe.
as_ever() { cmp "$2" "$BATS_FILE_TMPDIR/results/$1.raw" || { echo "${operations[$1]}: $3 differs" >&2; return 1; }; }

# chosen: the operations of a run, by number. Under a sanitizer, where starting takes most of the time, each run has a third
# of them, another one than the run before.
runs=0
chosen() {
    local step=1
    if [ -n "${VKT_SANITIZED:-}" ] && [ -z "${VKT_LONG:-}" ]; then step=3; fi
    seq $(((BATS_TEST_NUMBER + runs) % step)) $step $((${#operations[@]} - 1))
}

# same_with OPTIONS: every operation gives the same bytes with them.
same_with() {
    local i
    runs=$((runs + 1))
    for i in $(chosen); do
        [[ "$1 ${operations[i]}" != *memory*watershed* ]] || continue # refused: works on whole volumes
        # shellcheck disable=SC2086,SC2002  # words; a pipe, not a file
        cat volume.vkt | vkt ${operations[i]} $1 -o out.raw --force 2>/dev/null
        as_ever "$i" out.raw "$1"
    done
}

@test "slab heights 1, 7 and more than there are slices give the same" {
    same_with "--slab 7"
    same_with "--slab 1000"
    for i in $(chosen); do # what leaves slice by slice is put together again
        # shellcheck disable=SC2086
        vkt read volume.nrrd --slab 1 | vkt ${operations[i]} --slab 1 2>/dev/null | vkt write - out.raw --force
        as_ever "$i" out.raw "slab height 1"
    done
}

@test "one thread gives what three give" {
    same_with "--threads 1"
    same_with "--threads 3"
}

@test "a small memory budget, which spools, gives the same" { same_with "--memory 1MiB"; }

@test "slices cut into rows give the same, from files and pipes" {
    # Rows of a slice of 380 KiB come in two pieces where 4 MiB are the budget; the wide filter works band by band.
    step=1 depth=30
    # Voxels by the million, slowly: as few slices as every operation has room in, and the budget has none for.
    if [ -n "${VKT_SANITIZED:-}" ] && [ -z "${VKT_LONG:-}" ]; then step=4 depth=18; fi
    vkt make noise --dims 640 304 $depth --dtype uint16 --seed 3 -o large.nrrd
    vkt read large.nrrd >large.vkt
    vkt read large.nrrd --memory 4M >rows.vkt
    all=("${operations[@]}" "filter gaussian --sigma 0,0,6" "filter gaussian --sigma 1,1,2" "resample --dims 5 4 2"
        "resample --dims 600 500 3")
    for ((i = 0; i < ${#all[@]}; i += step)); do
        operation=${all[i]}
        [[ $operation != distance* && $operation != watershed* ]] || continue # whole volumes: 4 MiB do not hold this one
        [[ $operation != *wrap* ]] || continue    # refused: rows of this sigma from both edges need 6 MiB
        # shellcheck disable=SC2086,SC2002
        cat large.vkt | vkt $operation -o whole.raw --force 2>/dev/null
        # shellcheck disable=SC2086,SC2002
        cat rows.vkt | vkt $operation --memory 4M 2>/dev/null | vkt write - piped.raw --force
        cmp piped.raw whole.raw || { echo "$operation: a pipe of rows differs" >&2; false; }
        vkt pipe "read large.nrrd | $operation | write - --format raw" --memory 4M 2>/dev/null | cmp - whole.raw ||
            { echo "$operation: rows of a file differ" >&2; false; }
    done
    [ "$("$VKT_ROOT/tests/frames.py" rows.vkt | wc -l)" -gt $((2 * depth)) ]
    vkt diff rows.vkt large.nrrd
    vkt diff rows.vkt large.nrrd --memory 4M
    for report in 'stats --json' 'stats --roi 3:300,5:299,:' 'dump --roi 0:9,0:300,2:4'; do
        # shellcheck disable=SC2086
        diff <(vkt $report large.nrrd) <(vkt $report rows.vkt --memory 4M)
    done
    [ "$(vkt read large.nrrd --memory 4M --transport shm | vkt flip y --memory 4M --transport shm | vkt flip y | raw_sum)" = \
        "$(vkt read large.nrrd | raw_sum)" ]
}

@test "shared memory gives what pipes give" {
    for i in $(chosen); do
        # shellcheck disable=SC2086
        vkt read volume.nrrd --transport shm | vkt ${operations[i]} --transport shm 2>/dev/null | vkt write - out.raw --force
        as_ever "$i" out.raw "shared memory"
    done
}

@test "from a pipe, from a file and fused in one process give the same" {
    for i in $(chosen); do
        operation=${operations[i]}
        verb=${operation%% *}
        rest=${operation#"$verb"}
        if [ "$verb" = filter ]; then
            verb=$(cut -d' ' -f1-2 <<<"$operation")
            rest=${operation#"$verb"}
        fi
        case $operation in
        flip* | arith* | copy* | permute* | project* | morphology* | transform* | 'filter kernel'*) ;; # their positional words come first
        *)
            # shellcheck disable=SC2086
            vkt $verb volume.nrrd $rest -o out.raw --force 2>/dev/null
            as_ever "$i" out.raw "a file"
            ;;
        esac
        vkt pipe "read volume.nrrd | $operation | write - --format raw" 2>/dev/null >out.raw
        as_ever "$i" out.raw "fused"
    done
}

@test "long pipelines, fused and piped, give the same" {
    piped=$(vkt read volume.nrrd | vkt crop --roi 5:,2:-3,: | vkt filter gaussian --sigma 1.5 | vkt flip z |
        vkt resample --scale 1.5 | vkt convert --dtype uint16 --range minmax | raw_sum)
    fused=$(vkt pipe 'read volume.nrrd | crop --roi 5:,2:-3,: | filter gaussian --sigma 1.5 | flip z |
        resample --scale 1.5 | convert --dtype uint16 --range minmax | write - --format raw' | sha256sum)
    [ "$piped" = "$fused" ]
}

@test "flipping twice gives the volume back, geometry included" {
    for axis in x y z; do
        vkt flip $axis volume.nrrd 2>/dev/null | vkt flip $axis | vkt diff - volume.nrrd
    done
}

@test "flips of different axes commute" {
    a=$(vkt read volume.nrrd | vkt flip x | vkt flip z | raw_sum)
    b=$(vkt read volume.nrrd | vkt flip z | vkt flip x | raw_sum)
    [ "$a" = "$b" ]
}

@test "a crop of a crop is a crop" {
    vkt crop volume.nrrd --roi 4:50,3:40,5:30 | vkt crop --roi 2:20,1:+9,3:-4 -o twice.nrrd
    vkt crop volume.nrrd --roi 6:24,4:13,8:26 | vkt diff - twice.nrrd
}

@test "what was enlarged without interpolation and cropped back is the volume" {
    vkt read volume.nrrd | vkt resample --scale 2 --method nearest | vkt crop --roi 10:+40,20:+30,6:+20 -o large.nrrd
    vkt crop volume.nrrd --roi 5:+20,10:+15,3:+10 | vkt resample --scale 2 --method nearest | vkt diff - large.nrrd
}

@test "a crop commutes with a flip" {
    a=$(vkt crop volume.nrrd --roi 3:20,:,: | vkt flip x | raw_sum)
    b=$(vkt read volume.nrrd | vkt flip x | vkt crop --roi 39:56,:,: | raw_sum)
    [ "$a" = "$b" ]
}

# cut_at N: a stage that gets only N bytes fails, says so, and leaves nothing.
cut_at() {
    local status=0
    head -c "$1" stream.vkt | vkt flip x -o "$BATS_TEST_TMPDIR/out/cut.nrrd" >stdout 2>stderr || status=$?
    [ "$status" -eq 3 ] || { echo "cut at $1: status $status, $(cat stderr)" >&2; return 1; }
    grep -q 'ended early' stderr || { echo "cut at $1: $(cat stderr)" >&2; return 1; }
    [ ! -s stdout ] || { echo "cut at $1: something on stdout" >&2; return 1; }
    [ -z "$(ls -A out)" ] || { echo "cut at $1: left $(ls -A out)" >&2; return 1; }
}

# A stream of many small frames, and a folder for outputs.
make_stream() {
    mkdir out
    vkt read volume.nrrd --slab 4 >stream.vkt
    "$VKT_ROOT/tests/frames.py" stream.vkt >boundaries
    [ "$(wc -l <boundaries)" -ge 5 ]
}

@test "a stream cut at any frame boundary is an error, and leaves no file" {
    make_stream
    while read -r offset state; do
        if [ "$state" = cut ]; then cut_at "$offset"; fi
    done <boundaries
}

@test "a stream cut at 200 random bytes is an error, and leaves no file" {
    make_stream
    size=$(stat -c %s stream.vkt)
    RANDOM=20 # the same positions every time
    for _ in $(seq 200); do
        cut_at $((1 + (RANDOM * 32768 + RANDOM) % (size - 1)))
    done
}

@test "an empty stream is an error, and leaves no file" {
    mkdir out
    run --separate-stderr vkt flip x -o out/cut.nrrd </dev/null
    [ "$status" -eq 3 ]
    [ -n "$stderr" ]
    [ -z "$(ls -A out)" ]
}

@test "a cut stream fails every later stage, and is reported once" {
    make_stream
    run bash -c 'head -c 20000 stream.vkt | vkt flip x | vkt filter gaussian --sigma 1 | vkt write out/cut.nrrd 2>&1;
        echo "${PIPESTATUS[*]}"'
    [[ "${lines[-1]}" == *" 3 3 3" ]]
    run bash -c '{ head -c 20000 stream.vkt | vkt flip x | vkt filter gaussian --sigma 1 | vkt write out/cut.nrrd; } 2>&1'
    [ "$(grep -c 'ended early' <<<"$output")" -eq 1 ]
    [ -z "$(ls -A out)" ]
}

@test "a flipped bit anywhere in the voxels is noticed" {
    make_stream
    size=$(stat -c %s stream.vkt)
    for offset in 9000 40001 $((size / 2)); do
        /usr/bin/python3 - "$offset" <<'EOF'
import sys
data = bytearray(open("stream.vkt", "rb").read())
data[int(sys.argv[1])] ^= 16
open("damaged.vkt", "wb").write(data)
EOF
        run --separate-stderr vkt flip x damaged.vkt -o out/damaged.nrrd
        [ "$status" -eq 3 ]
        [ -z "$(ls -A out)" ]
    done
}

@test "an upstream killed in the middle fails the stages after it, and leaves nothing" {
    make_stream
    mkdir tmp
    export TMPDIR="$BATS_TEST_TMPDIR/tmp"
    mkfifo first second third
    { head -c 60000 stream.vkt; exec sleep 20; } >first &
    feeder=$!
    vkt filter gaussian --sigma 1 <first >second 2>/dev/null &
    victim=$!
    tee seen <second >third &
    vkt flip z -o out/killed.nrrd <third 2>stderr &
    last=$!
    # In the middle: it has begun to write.
    for _ in $(seq 400); do
        [ ! -s seen ] || break
        sleep 0.05
    done
    kill -9 $victim
    status=0
    wait $last || status=$?
    kill $feeder 2>/dev/null || true
    [ "$status" -eq 3 ]
    grep -q 'ended early' stderr
    [ -z "$(ls -A out)" ]
    [ -z "$(ls -A tmp)" ]
}

@test "a killed writer leaves no file" {
    make_stream
    mkfifo first
    { head -c 60000 stream.vkt; exec sleep 20; } >first &
    feeder=$!
    vkt write out/killed.nrrd <first 2>/dev/null &
    victim=$!
    sleep 0.5
    kill -9 $victim
    wait $victim || true
    kill $feeder 2>/dev/null || true
    [ -z "$(ls -A out)" ]
}

@test "an interrupted writer leaves no file" {
    make_stream
    for signal in TERM HUP; do
        mkfifo first
        { head -c 60000 stream.vkt; exec sleep 20; } >first &
        feeder=$!
        vkt write out/killed.nrrd <first 2>/dev/null &
        victim=$!
        sleep 0.5
        kill -$signal $victim
        status=0
        wait $victim || status=$?
        kill $feeder 2>/dev/null || true
        [ "$status" -gt 128 ]
        [ -z "$(ls -A out)" ]
        rm first
    done
}

@test "no shared memory stays behind when a stage is killed" {
    make_stream
    names_in_shm >before
    mkfifo first second
    { head -c 60000 stream.vkt; exec sleep 20; } >first &
    feeder=$!
    vkt filter gaussian --sigma 1 --transport shm <first >second 2>/dev/null &
    victim=$!
    vkt flip x <second >/dev/null 2>&1 &
    last=$!
    sleep 0.5
    kill -9 $victim
    wait $last || true
    kill $feeder 2>/dev/null || true
    names_in_shm >after
    comm -13 before after | grep vkt >left || true
    [ ! -s left ]
}

@test "a reader that goes away ends the writer by a silent SIGPIPE" {
    run --separate-stderr bash -c 'vkt resample volume.nrrd --scale 4 | head -c 100 >/dev/null; exit "${PIPESTATUS[0]}"'
    [ "$status" -eq 141 ]
    [ -z "$stderr" ]
}

@test "a reader that goes away ends the whole pipeline silently" {
    # More than all buffers between the stages hold together, so that the first cannot have finished before.
    run --separate-stderr bash -c 'vkt resample volume.nrrd --scale 10 | vkt flip x | vkt filter gaussian --sigma 1 |
        head -c 100 >/dev/null; echo "${PIPESTATUS[*]}"'
    [ "$output" = "141 141 141 0" ]
    [ -z "$stderr" ]
}

@test "a full disk is an error, and leaves no file" {
    mkdir small
    mount -t tmpfs -o size=256k vkt-test small 2>/dev/null || skip "cannot mount a tmpfs (needs root)"
    status=0
    vkt resample volume.nrrd --scale 3 -o small/full.nrrd 2>stderr || status=$?
    left=$(ls -A small)
    umount small
    [ "$status" -eq 4 ]
    grep -qi 'no space' stderr
    [ -z "$left" ]
}

@test "a full spool directory is an error, and keeps no file" {
    [ "${VKT_SANITIZED:-}" != thread ] || skip "the thread sanitizer puts files of its own into the full directory"
    mkdir small
    mount -t tmpfs -o size=256k vkt-test small 2>/dev/null || skip "cannot mount a tmpfs (needs root)"
    spool=0
    TMPDIR="$PWD/small" vkt read volume.nrrd |
        TMPDIR="$PWD/small" vkt resample --scale 4 | TMPDIR="$PWD/small" vkt flip z --memory 64KiB >/dev/null 2>spooled || spool=$?
    left=$(ls -A small)
    umount small
    [ "$spool" -eq 4 ]
    grep -qi 'no space' spooled
    [ -z "$left" ]
}

@test "a full device on standard output is an error" {
    run bash -c 'vkt resample volume.nrrd --scale 3 >/dev/full'
    [ "$status" -eq 4 ]
    [[ "$output" == *"o space"* ]]
}

@test "an existing file is not replaced without --force" {
    echo precious >out.nrrd
    fails_with 4 "out.nrrd" vkt flip x volume.nrrd -o out.nrrd
    [ "$(cat out.nrrd)" = precious ]
    fails_with 4 "out.nrrd" bash -c 'vkt read volume.nrrd | vkt write out.nrrd'
    [ "$(cat out.nrrd)" = precious ]
    vkt flip x volume.nrrd -o out.nrrd --force
    vkt info out.nrrd >/dev/null
}

@test "a failed --force keeps the old file" {
    make_stream
    echo precious >out/old.nrrd
    head -c 30000 stream.vkt >cut.vkt
    run vkt flip x cut.vkt -o out/old.nrrd --force
    [ "$status" -eq 3 ]
    [ "$(cat out/old.nrrd)" = precious ]
    [ "$(ls -A out)" = old.nrrd ]
}

@test "a volume may be replaced by what is made of it" {
    cp volume.nrrd same.nrrd
    vkt flip z same.nrrd -o same.nrrd --force
    vkt flip z same.nrrd | vkt diff - volume.nrrd
}

@test "a binary volume is not written to a terminal" {
    command -v script >/dev/null || skip "script(1) is not installed"
    run script -qec 'vkt read volume.nrrd' /dev/null </dev/null
    [ "$status" -eq 2 ]
    [[ "$output" == *terminal* ]]
    [ "${#output}" -lt 500 ]
}

@test "the same command gives the same file, byte for byte" {
    vkt filter gaussian volume.nrrd --sigma 2 -o a.nrrd
    sleep 1.1
    vkt filter gaussian volume.nrrd --sigma 2 -o b.nrrd
    cmp a.nrrd b.nrrd
}
