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

# finds KIND: the fake is caught at it, exit code 1.
finds() {
    run --separate-stderr vkt stress 'filter box --radius 1' --vkt "$PWD/fake" --timeout 10 --json
    [ "$status" -eq 1 ] || { echo "status $status: $output $stderr" >&2; return 1; }
    echo "$output" >found.json
    /usr/bin/python3 -c '
import json, sys
found = json.load(open("found.json"))["findings"]
assert any(f["kind"] == sys.argv[1] for f in found), found
assert all(f["repeat"].startswith(("vkt stress --volume ", "ulimit")) for f in found), found' "$1"
}

@test "a result that depends on the height of slabs is found" {
    # shellcheck disable=SC2016
    fake '[ -z "$slab" ] || exec "$real" filter box --radius 2'
    finds changes
}

@test "a crash on values that are no numbers is found" {
    # shellcheck disable=SC2016
    fake 'cat >in.$$; n=$("$real" stats in.$$ --json 2>/dev/null | grep -c "\"nan\": [1-9]"); [ "$n" = 0 ] || { rm in.$$; kill -SEGV $$; }
        "$real" "$@" <in.$$; code=$?; rm in.$$; exit $code'
    finds crashes
}

@test "success on a stream that was cut is found" {
    # shellcheck disable=SC2016
    fake '"$real" "$@"; exit 0'
    finds "takes damaged input"
}

@test "a file that is left behind is found" {
    # shellcheck disable=SC2016
    fake '[ -z "$out" ] || echo part >"$out.part"'
    finds "leaves files"
}

@test "an integer that wraps is found" {
    # Sums in the type of the input: what is larger than its largest begins again at the least.
    # shellcheck disable=SC2016
    fake '"$real" convert --dtype int64 | "$real" transform "(v * 3) % 256" --dtype uint8 2>/dev/null; exit ${PIPESTATUS[1]}'
    finds wraps
}

@test "what hangs is found, and killed" {
    # shellcheck disable=SC2016
    fake '[ -z "$slab" ] || exec sleep 1000'
    run --separate-stderr vkt stress 'filter box --radius 1' --vkt "$PWD/fake" --timeout 0.2 --json
    [ "$status" -eq 1 ]
    grep -q '"kind": "hangs"' <<<"$output"
}

@test "nothing is found in what is shipped" {
    for pipeline in 'filter gaussian --sigma 1.3' 'flip x | crop --roi :,:,:'; do
        vkt stress "$pipeline" >found || { cat found >&2; false; }
        tail -1 found | grep -q 'nothing found'
    done
}

@test "volumes are listed, and written as streams" {
    vkt stress --list >names
    [ "$(wc -l <names)" -ge 40 ]
    while read -r name; do vkt stress --volume "$name" | vkt info - >/dev/null; done < <(shuf -n 6 --random-source=names names)
    vkt stress --volume nan-float32 | vkt stats --json | grep -q '"nan": [1-9]'
    fails_with 2 "there is no 'nan-uint8'" vkt stress --volume nan-uint8
    fails_with 2 "one of a pipeline" vkt stress
}
