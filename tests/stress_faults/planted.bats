# vkt stress on a build with faults of its own (planted.cpp, planted-read.cpp): each is found, by the volume that is made
# for it and with a command that shows it again; the same code without a fault shows none.
load ../helper

setup_more() {
    mkdir bin
    ln -s "$VKT_BUILD/tests/vkt_planted" bin/vkt
    PATH="$PWD/bin:$PATH"
    vkt help planted >/dev/null
}

# finds KIND VOLUME PIPELINE: vkt stress ends with 1 and tells of nothing but that; on stdout the command that shows it.
finds() {
    run --separate-stderr vkt stress "$3" --volume "$2" --json
    [ "$status" -eq 1 ] || { echo "status $status: $output $stderr" >&2; return 1; }
    echo "$output" >found.json
    /usr/bin/python3 -c '
import json, sys
found = json.load(open("found.json"))["findings"]
assert found and {f["kind"] for f in found} == {sys.argv[1]}, found
assert all(f["repeat"].startswith("vkt stress --volume " + sys.argv[2]) for f in found), found
print(found[0]["repeat"])' "$1" "$2"
}

# values_differ VOLUME: what again.sh prints of it is not what comes out without the fault.
values_differ() {
    sh again.sh >wrong
    vkt stress --volume "$1" | vkt planted | vkt dump >right
    run ! cmp -s wrong right
}

# shows_nothing VOLUME,... PIPELINE
shows_nothing() {
    vkt stress "$2" --volume "$1" >found || { cat found >&2; return 1; }
    grep -q ': nothing found$' found
}

@test "without a fault nothing is found, on any volume" {
    vkt stress planted >found || { cat found >&2; false; }
    grep -q ' on [67][0-9] volumes: nothing found$' found
    shows_nothing noise-uint16 planted-read
}

@test "a halo that is one slice short: results depend on the height of slabs" {
    finds changes noise-uint16 'planted --fault halo' >again.sh
    grep -q -- '--slab 1' again.sh
    sh again.sh
    vkt stress --volume noise-uint16 | vkt planted --fault halo >plain.vkt
    run vkt diff out.vkt plain.vkt
    [ "$status" -eq 1 ]
    # In one piece it has its neighbours, but for the slices that only a halo reaches.
    shows_nothing flat-z 'planted --fault halo'
}

@test "parts that do not see each other: results depend on the number of threads" {
    finds changes noise-uint16 'planted --fault threads' >again.sh
    grep -q -- '--threads [15]' again.sh
    sh again.sh
    vkt stress --volume noise-uint16 | vkt planted --fault threads --threads 3 >other.vkt
    run vkt diff out.vkt other.vkt
    [ "$status" -eq 1 ]
    shows_nothing flat-y 'planted --fault threads'
}

@test "an integer that wraps where it should saturate" {
    finds "loses accuracy" extremes-uint8 'planted --fault wraps' >again.sh
    values_differ extremes-uint8
    shows_nothing constant-uint8,noise-float32 'planted --fault wraps'
}

@test "NaN that is lost, and NaN that stays in a running sum" {
    finds "loses NaN" nan-float32 'planted --fault loses-nan' >again.sh
    sh again.sh >wrong
    run ! grep -q nan wrong
    finds "spreads NaN" nan-float32 'planted --fault spreads-nan' >again.sh
    sh again.sh >wrong
    vkt stress --volume nan-float32 | vkt planted | vkt dump >right
    [ "$(grep -o nan wrong | wc -l)" -gt "$(grep -o nan right | wc -l)" ]
    finds "spreads NaN" nan-float16 'planted --fault spreads-nan'
    shows_nothing noise-float32,nan-float64 'planted --fault loses-nan'
    shows_nothing checkerboard-float32 'planted --fault spreads-nan'
}

@test "sums in float32, which an offset of 1e8 shows" {
    finds "loses accuracy" offset-int32 'planted --fault float32' >again.sh
    values_differ offset-int32
    shows_nothing noise-uint16,noise-int32 'planted --fault float32'
}

@test "a reader that takes what is cut for a volume" {
    finds "takes damaged input" noise-uint16 'planted-read --lenient' >again.sh
    sh again.sh
    vkt info out.vkt >/dev/null
    grep -q -- '--damage cut-50%' found.json
    grep -q -- '--damage slab-missing' found.json
}

@test "faults are found within a pipeline, too" {
    finds changes noise-uint16 'flip x | planted --fault halo | filter box --radius 1'
    run --separate-stderr vkt stress 'filter box --radius 1 | planted --fault float32' --volume offset-int32 --json
    [ "$status" -eq 1 ]
    grep -q '"kind": "loses accuracy"' <<<"$output"
}

@test "no installation has these commands" {
    run grep -rl planted "$VKT_BUILD" --include=cmake_install.cmake
    [ "$status" -eq 1 ]
    fails_with 2 "'planted' is not a command" "$VKT_BUILD/vkt" planted
}
