# vkt stress: planted faults are found, each with a command that repeats it; what is shipped shows none.
load helper

# fake BODY: a vkt whose filter box does BODY; all else is passed on. $slab: --slab was given, $out: file behind -o.
fake() {
    {
        echo '#!/bin/bash'
        echo "real=$(command -v vkt)"
        # shellcheck disable=SC2016
        echo 'slab=; out=; last=; for w in "$@"; do [ "$w" != --slab ] || slab=1; [ "$last" != -o ] || out=$w; last=$w; done'
        echo '[ "$1 $2" = "filter box" ] || exec "$real" "$@"'
        echo "$1"
        # shellcheck disable=SC2016
        echo 'exec "$real" "$@"'
    } >fake
    chmod +x fake
}

# finds KIND VOLUME,...: the fake is caught at it, exit code 1.
finds() {
    run --separate-stderr vkt stress 'filter box --radius 1' --vkt "$PWD/fake" --volume "$2" --json
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

# A few volumes here; all 61 are for whoever has a minute for each pipeline.
@test "nothing is found in what is shipped" {
    some=noise-uint16,extremes-int8,extremes-int64,infinite-float32,denormal-float32,offset-float64,single,flat-z,mapped
    for pipeline in 'filter gaussian --sigma 1.3' 'affine 0.9,0.1,0,0,-0.1,0.9,0,0,0,0,1,0' 'flip x | stats'; do
        vkt stress "$pipeline" --volume "$some" >found || { cat found >&2; false; }
        tail -1 found | grep -q 'on 9 volumes: nothing found'
    done
}

@test "volumes are listed, and written as streams" {
    vkt stress --list >names
    [ "$(wc -l <names)" -ge 40 ]
    while read -r name; do vkt stress --volume "$name" | vkt info - >/dev/null; done < <(shuf -n 6 --random-source=names names)
    vkt stress --volume nan-float32 | vkt stats --json | grep -q '"nan": [1-9]'
    [ "$(vkt stress --volume extremes-uint64 | vkt stats --json | grep -c 18446744073709551615)" -ge 1 ]
    fails_with 2 "there is no 'nan-uint8'" vkt stress --volume nan-uint8
    fails_with 2 "there is no 'nose-uint8'" vkt stress 'flip x' --volume noise-uint8,nose-uint8
    fails_with 2 "one of a pipeline" vkt stress
    fails_with 2 "one of a pipeline" vkt stress --list --volume single
    fails_with 2 "filter gaussian" vkt stress 'filter gausian --sigma 1'
}
