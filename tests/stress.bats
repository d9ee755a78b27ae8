# vkt stress: planted faults are found, each with a command that repeats it; what is shipped shows none.
load helper

# fake BODY [VERB]: a vkt whose VERB, filter box, does BODY; all else is passed on. $slab: --slab was given, $out: file behind -o.
fake() {
    {
        echo '#!/bin/bash'
        echo "real=$(command -v vkt)"
        # shellcheck disable=SC2016
        echo 'slab=; out=; last=; for w in "$@"; do [ "$w" != --slab ] || slab=1; [ "$last" != -o ] || out=$w; last=$w; done'
        echo "[[ \"\$* \" = \"${2:-filter box} \"* ]] || exec \"\$real\" \"\$@\""
        echo "$1"
        # shellcheck disable=SC2016
        echo 'exec "$real" "$@"'
    } >fake
    chmod +x fake
}

# finds KIND VOLUME,... [PIPELINE]: the fake is caught at it, exit code 1.
finds() {
    run --separate-stderr vkt stress "${3:-filter box --radius 1}" --vkt "$PWD/fake" --volume "$2" --json
    [ "$status" -eq 1 ] || { echo "status $status: $output $stderr" >&2; return 1; }
    echo "$output" >found.json
    /usr/bin/python3 -c '
import json, sys
found = json.load(open("found.json"))["findings"]
assert any(f["kind"] == sys.argv[1] for f in found), found
assert all(f["repeat"].startswith(("vkt stress --volume ", "ulimit")) for f in found), found' "$1"
}

@test "a result that depends on the height of slabs is found, and its command repeats it" {
    # shellcheck disable=SC2016
    fake '[ -z "$slab" ] || exec "$real" filter box --radius 2'
    finds changes noise-uint16,constant-uint8,single
    /usr/bin/python3 -c '
import json
found, = [f for f in json.load(open("found.json"))["findings"] if f["kind"] == "changes"]
print(found["repeat"])' >again.sh
    sh again.sh
    vkt stress --volume noise-uint16 | ./fake filter box --radius 1 >plain.vkt
    run vkt diff out.vkt plain.vkt
    [ "$status" -eq 1 ]
}

@test "a crash on values that are no numbers is found" {
    # shellcheck disable=SC2016
    fake 'cat >in.$$; n=$("$real" stats in.$$ --json 2>/dev/null | grep -c "\"nan\": [1-9]"); [ "$n" = 0 ] || { rm in.$$; kill -SEGV $$; }
        "$real" "$@" <in.$$; code=$?; rm in.$$; exit $code'
    finds crashes noise-uint16,nan-float32
}

@test "success on a stream that was cut is found" {
    # shellcheck disable=SC2016
    fake '"$real" "$@"; exit 0'
    finds "takes damaged input" noise-uint16
    grep -q '"kind": "ignores a full disk"' found.json
    # Whoever does not look at a slab need not see what is wrong with its voxels, but has to see that it is missing.
    vkt stress 'crop --roi :,:,8:9' --volume noise-uint16
    vkt stress --volume noise-uint16 --damage bit-in-voxels | vkt crop --roi :,:,8:9 >/dev/null
    fails_with 3 "out of order" vkt crop --roi :,:,8:9 <(vkt stress --volume noise-uint16 --damage slab-missing)
}

@test "a file that is left behind is found" {
    # shellcheck disable=SC2016
    fake '[ -z "$out" ] || echo part >"$out.part"'
    finds "leaves files" noise-uint16
}

@test "an integer that wraps is found, and a voxel that is off by more than rounding" {
    # Three times the value in the type of the input: what is larger than its largest begins again at the least.
    # shellcheck disable=SC2016
    fake '"$real" convert --dtype int64 | "$real" transform "3*v-256*floor(3*v/256)" --dtype uint8 2>/dev/null; exit ${PIPESTATUS[1]}'
    finds "loses accuracy" checkerboard-uint8
    # shellcheck disable=SC2016
    fake '"$real" "$@" | "$real" fill --value 7 --roi 3:4,3:4,3:4; exit ${PIPESTATUS[1]}'
    finds "loses accuracy" noise-uint16
}

# One voxel that is wrong in the same way whatever the slabs, threads and transports are.
@test "a wrong label and a wrong voxel of CLAHE are found by what these are defined as" {
    # shellcheck disable=SC2016
    local wrong='"$real" "$@" | "$real" fill --value 77 --roi 3:4,3:4,3:4; exit ${PIPESTATUS[1]}'
    fake "$wrong" label
    finds "is not as defined" noise-uint16 'label --connectivity 26'
    finds "is not as defined" nan-float32 'label --by-value'
    fake "$wrong" clahe
    finds "is not as defined" noise-uint16 clahe
    finds "is not as defined" noise-float32 'clahe --clip-as pizer --bricks 3,2,4 --clip 3'
    # Two components under one name, and one under two.
    # shellcheck disable=SC2016
    fake '"$real" "$@" | "$real" transform "min(v, 1)" --dtype uint32; exit ${PIPESTATUS[1]}' label
    finds "is not as defined" noise-uint16 'label --by-value'
    # The command that repeats it shows the voxel.
    /usr/bin/python3 -c '
import json
found, = [f for f in json.load(open("found.json"))["findings"] if f["kind"] == "is not as defined"]
print(found["repeat"])' >again.sh
    sh again.sh >dumped
    [ -s dumped ]
}

@test "of several stages that compute each is looked at by itself" {
    # shellcheck disable=SC2016
    local wrong='"$real" "$@" | "$real" fill --value 77 --roi 3:4,3:4,3:4; exit ${PIPESTATUS[1]}'
    fake "$wrong"
    finds "loses accuracy" noise-uint16 'filter box --radius 1 | filter gaussian --sigma 1'
    finds "loses accuracy" noise-uint16 'filter gaussian --sigma 1 | filter box --radius 1'
    fake "$wrong" label
    finds "is not as defined" noise-uint16 'filter gaussian --sigma 1 | threshold --above 50 | label'
    # What a pipe does to the result is found by files.
    # shellcheck disable=SC2016
    fake '[ -f /dev/stdin ] || exec "$real" filter box --radius 2'
    finds changes noise-uint16 'flip x | filter box --radius 1'
    /usr/bin/python3 -c '
import json
found = [f for f in json.load(open("found.json"))["findings"] if f["kind"] == "changes"]
assert any("stage by stage" in f["what"] for f in found), found'
}

@test "a stream without its end under exit code 0 is found" {
    # shellcheck disable=SC2016
    fake '[ -n "$out" ] || { "$real" "$@" | head -c 500; exit 0; }'
    finds "not whole" noise-uint16
}

@test "what hangs is found, and killed" {
    # shellcheck disable=SC2016
    fake '[ -z "$slab" ] || exec sleep 1000'
    run --separate-stderr vkt stress 'filter box --radius 1' --vkt "$PWD/fake" --volume single --timeout 2 --json
    [ "$status" -eq 1 ]
    grep -q '"kind": "hangs"' <<<"$output"
}

# A few volumes here; all of them are for whoever has a minute for each pipeline.
@test "nothing is found in what is shipped" {
    vkt stress 'filter gaussian --sigma 1.3' --volume noise-uint16,extremes-int64,infinite-float32,denormal-float32,single,mapped >found ||
        { cat found >&2; false; }
    tail -1 found | grep -q 'on 6 volumes: nothing found'
    vkt stress 'affine 0.9,0.1,0,0,-0.1,0.9,0,0,0,0,1,0' --volume offset-float64,large,flat-z >found || { cat found >&2; false; }
    # The median of an even number of voxels may be halfway between two.
    vkt stress 'project median' --volume large,noise-float32 >found || { cat found >&2; false; }
    vkt stress 'flip x | stats' --volume extremes-int8 >found || { cat found >&2; false; }
    vkt stress 'label --connectivity 18 --min-size 3 --by-value' --volume noise-uint8,nan-float32,infinite-float16,mapped,flat-y >found || { cat found >&2; false; }
    vkt stress 'clahe | filter median --radius 1' --volume noise-int64,offset-float32,extremes-uint64,mapped >found || { cat found >&2; false; }
    # Sums over many bins are as exact as is promised in float64.
    vkt stress 'clahe --clip-as skimage --bricks 2,2,2 --bins 1000' --volume nan-float64 >found || { cat found >&2; false; }
}

# Half an hour on two processors.
@test "nothing is found in what is shipped, on any volume (VKT_LONG=1)" {
    [ -n "${VKT_LONG:-}" ] || skip "takes many minutes: set VKT_LONG=1"
    local pipeline
    for pipeline in 'arith add 3' 'arith mul 0.1' 'arith div 3' 'affine 0.9,0.1,0,0,-0.1,0.9,0,0,0,0,1,0' clahe \
        'clahe --bricks 2,2,2 --bins 100' 'convert --dtype float16' 'convert --dtype uint8' 'crop --roi 25%:75%,:,:' distance \
        fill-holes 'filter bilateral --sigma 1 --range-sigma 20' 'filter box --radius 1' 'filter dog --sigma 1' \
        'filter gaussian --sigma 1' 'filter gaussian --sigma 4 --tolerance 1%' 'filter gradient' 'filter laplacian' \
        'filter log --sigma 1' 'filter median --radius 1' 'filter median --radius 2,1,0' 'filter nlmeans --strength 10' \
        'filter sharpen --sigma 1' 'filter sobel' 'flip x' histogram label 'morphology open --radius 1' \
        'morphology gradient --shape box --radius 2' 'pad --by 2' 'permute zxy' 'project mean' 'project max' 'project median' \
        'refine --tolerance 1 | resample --scale 1' 'resample --scale 0.5' 'resample --scale 1.7 --method lanczos3' \
        'resample --scale 1.3 --method bspline3' 'rotate --axis z --angle 30' 'rotate --axis x --angle 90' \
        'scale --factor 1.5' scan stats 'threshold --above 50' 'transform "sqrt(v)+x"' watershed; do
        vkt stress "$pipeline" >found || [ "$(grep -c '^never works' found)" -eq 1 ] || { echo "$pipeline" >&2; cat found >&2; false; }
    done
}

@test "volumes that are refused are told with the command that shows it, and are no faults" {
    vkt stress 'crop --roi 3:5,:,:' --volume noise-uint16,flat-x,single --json >found.json
    /usr/bin/python3 -c '
import json
found = json.load(open("found.json"))
refusal, = found["refusals"]
assert found["findings"] == [] and refusal["volume"] == "flat-x" and refusal["more"] == 1, found
assert refusal["what"].startswith("exit code 2, vkt crop: --roi 3:5 leaves the volume"), refusal
print(refusal["repeat"])' >again.sh
    fails_with 2 "leaves the volume" sh again.sh
    # What is refused always has not been tried.
    run --separate-stderr vkt stress 'crop --roi 30:50,:,:' --volume noise-uint16,single
    [ "$status" -eq 1 ]
    [[ "$output" == *"never works noise-uint16: exit code 2"* ]]
}

@test "each kind of damage is refused by a reader, and is what its name says" {
    vkt stress --list | sed -n 's/^damage  //p' >kinds
    [ "$(wc -l <kinds)" -ge 20 ]
    vkt stress --volume noise-float32 >whole.vkt
    vkt read whole.vkt >/dev/null
    while read -r kind; do
        vkt stress --volume noise-float32 --damage "$kind" >"$kind.vkt"
        run ! cmp -s whole.vkt "$kind.vkt"
        if vkt read "$kind.vkt" >/dev/null 2>error; then echo "$kind passes" >&2; false; fi
        head -1 error | sed 's/^/'"$kind"': /' >>errors
    done <kinds
    [ ! -s cut-0%.vkt ]
    # What is wrong is found for what it is: checksums fit, where they are not the damage.
    grep -q '^slab-missing: .*out of order' errors
    grep -q '^spacing-0: .*spacing' errors
    grep -q '^type-unknown: .*int128' errors
    run ! grep -E '^(slab-[mt]|slabs-|more|fewer|dims|type|spacing|frame|slope).*checksum' errors
    fails_with 2 "cannot have the damage" vkt stress --volume flat-z --damage slabs-swapped
    fails_with 2 "did you mean 'slab-twice'" vkt stress --volume single --damage slab-twize
    fails_with 2 "name it with --volume" vkt stress 'flip x' --damage slab-twice
}

@test "volumes are listed, and written as streams" {
    vkt stress --list | sed -n 's/^volume  //p' >names
    [ "$(wc -l <names)" -ge 60 ]
    while read -r name; do vkt stress --volume "$name" | vkt info - >/dev/null; done < <(shuf -n 6 --random-source=names names)
    vkt stress --volume nan-float32 | vkt stats --json | grep -q '"nan": [1-9]'
    [ "$(vkt stress --volume extremes-uint64 | vkt stats --json | grep -c 18446744073709551615)" -ge 1 ]
    fails_with 2 "there is no 'nan-uint8'" vkt stress --volume nan-uint8
    fails_with 2 "there is no 'nose-uint8'" vkt stress 'flip x' --volume noise-uint8,nose-uint8
    fails_with 2 "one of a pipeline" vkt stress
    fails_with 2 "one of a pipeline" vkt stress --list --volume single
    fails_with 2 "filter gaussian" vkt stress 'filter gausian --sigma 1'
    fails_with 2 "leave out -o" vkt stress 'flip x -o x.nrrd' --volume single
    vkt stress 'flip x' --volume single -n 2>plan >out
    grep -q "'flip x' would run on single" plan
    [ ! -s out ]
}

# Waits up to 10 s for COMMAND… to succeed.
soon() {
    local tries
    for tries in {1..100}; do
        if "$@"; then return; fi
        sleep 0.1
    done
    echo "not within $tries tries: $*" >&2
    return 1
}

@test "a stress that is interrupted or killed leaves neither files nor processes" {
    mkdir tmp
    cat >slow <<EOF2
#!/bin/bash
[ "\$1" != flip ] || { echo \$\$ >$PWD/there; sleep 1000; }
exec $(command -v vkt) "\$@"
EOF2
    chmod +x slow
    holds() { [ -s there ]; }
    empty() { [ -z "$(ls -A tmp)" ]; }
    ended() { ! kill -0 "$1" 2>/dev/null; }
    for signal in TERM KILL; do
        rm -f there
        TMPDIR=$PWD/tmp vkt stress 'flip x' --vkt "$PWD/slow" --volume single >/dev/null 2>&1 3>&- &
        local stress=$!
        soon holds
        [ -n "$(ls -A tmp)" ]
        kill -"$signal" "$stress"
        wait "$stress" || true
        soon empty
        soon ended "$(cat there)"
    done
}

@test "what crashes or hangs at every volume is found" {
    # shellcheck disable=SC2016
    for fault in 'kill -SEGV $$' 'exit 7' 'sleep 60'; do
        fake "$fault" 'flip x'
        run -1 vkt stress 'flip x' --vkt "$PWD/fake" --volume noise-uint8,single --timeout 1
        [[ "$output" == *crashes* || "$output" == *hangs* ]]
        [[ "$output" == *"2 runs on 2 volumes: 1 found"* ]]
    done
    run -1 vkt stress 'flip x' --vkt "$PWD/nobody" --volume noise-uint8
    [[ "$output" == *"exit code 127"* ]]
}
