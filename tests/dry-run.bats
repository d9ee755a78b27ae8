# --dry-run, --explain and --timing: every stage says what it would do, or what it did, and nothing else happens.
load helper

setup_more() {
    vkt make noise --dims 20 30 40 --dtype uint8 --high 255 -o v.nrrd
}

@test "every stage of a pipeline tells of its plan; nothing is written" {
    : >plan # what a shell would empty may come after what others wrote
    vkt read v.nrrd -n 2>>plan | vkt crop --roi 2:18,:,: 2>>plan | vkt resample --scale 0.5 2>>plan | vkt write x.nrrd 2>>plan
    [ ! -e x.nrrd ]
    for stage in read crop resample write; do
        grep -q "^vkt $stage: .*, peak memory about .*\(streaming\|holds the whole volume\)" plan || { cat plan >&2; false; }
    done
    grep -q 'vkt read: -> 20x30x40 uint8, 23.4 KiB' plan
    grep -q 'vkt crop: 20x30x40 uint8 -> 16x30x40 uint8' plan
    grep -q 'vkt resample: 16x30x40 uint8 -> 8x15x20 uint8' plan
    grep -q 'vkt write: 8x15x20 uint8, 2.3 KiB -> x.nrrd' plan
}

@test "consumers of voxels tell of their plan too, from a pipe as with -n" {
    for command in 'diff - v.nrrd' dump stats 'render -o x.png' 'write x.nrrd' info; do
        # shellcheck disable=SC2086
        vkt read v.nrrd -n 2>/dev/null | vkt $command >out 2>plan || { cat plan >&2; false; }
        [ ! -e x.png ]
        [ ! -e x.nrrd ]
        [ "$command" = info ] || grep -q "^vkt ${command%% *}: " plan || { echo "$command" >&2; cat plan >&2; false; }
        [ "$command" = info ] || [ ! -s out ] || { echo "$command:" >&2; cat out >&2; false; }
    done
    vkt write v.nrrd x.nrrd -n 2>plan
    grep -q -e '-> x.nrrd' plan
    vkt stats v.nrrd -n 2>plan >out
    grep -q 'vkt stats: 20x30x40 uint8, peak memory' plan
    [ ! -s out ]
    vkt diff v.nrrd v.nrrd -n
    [ ! -e x.nrrd ]
}

@test "the plan of a tree is what comes out" {
    vkt make amr --blocks 50 --levels 3 -o t.vkt
    vkt resample t.vkt --dims 5000000 1 1 -n -o x.vkt 2>plan
    grep -q 'resample: .* in 50 bricks on 2 levels -> 5000000x1x1 float32, 19.1 MiB, peak memory about .* MiB' plan
    grep -q 'method basis' plan
    vkt resample t.vkt --cells 20k --dtype uint8 -n -o x.vkt 2>plan
    grep -q 'uint8, 19.2 KiB' plan
    [ "$(vkt resample t.vkt --cells 20k --dtype uint8 | vkt info --json | grep -c '"dtype": "uint8"')" -eq 1 ]
    for region in 0:16,0:16,0:16 8:32,:,:; do
        vkt crop t.vkt --roi "$region" -n 2>/dev/null | vkt info --json >planned
        vkt crop t.vkt --roi "$region" | vkt info --json >done
        for key in kind dims dtype spacing origin '"roi"'; do
            [ "$(grep -o "\"${key//\"/}\": *[^}]*" planned)" = "$(grep -o "\"${key//\"/}\": *[^}]*" done)" ]
        done
    done
    vkt refine v.nrrd --tolerance 1 -n 2>plan | vkt info --json >planned
    grep -q '"kind": "hierarchical"' planned
    grep -q 'refine: .*holds the whole volume' plan
    vkt make amr --blocks 50 --levels 3 -n -o x.vkt 2>plan
    grep -q 'make: .* in 50 bricks' plan
    [ ! -e x.vkt ]
}

@test "--explain on a run names method, bound and cost, on trees as well" {
    vkt make amr --blocks 50 --levels 3 -o t.vkt
    vkt filter gaussian --sigma 1 t.vkt --explain -o g.vkt 2>plan
    grep -q 'method direct FIR, radius 4,4,4, float32' plan
    grep -q 'no bound of the error' plan
    vkt resample t.vkt --cells 20k --explain -o r.vkt 2>plan
    grep -q 'error about 1e-06 of the largest magnitude,' plan
    vkt stats t.vkt --explain 2>plan >/dev/null
    grep -q 'method shifted sums' plan
}

@test "the output of a tree's resampling keeps to --memory; a tree that does not is refused" {
    vkt make amr --blocks 50 --levels 3 -o t.vkt
    for slab in 1 7 64; do vkt resample t.vkt --dims 60 50 90 --slab $slab --format raw -o - | cksum; done | sort -u >sums
    [ "$(wc -l <sums)" -eq 1 ]
    peak() { /usr/bin/python3 -c '
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024)' "$@"; }
    if [ -z "$VKT_SANITIZED" ]; then
        [ "$(peak vkt resample t.vkt --cells 24M --memory 10M -o big.raw)" -lt 60 ]
    fi
    fails_with 5 'budget' vkt resample t.vkt --cells 20k --memory 50k -o x.vkt
    [ ! -e x.vkt ]
}

@test "--mask says where a tree has cells" {
    vkt make sphere --dims 32 32 32 | vkt refine --tolerance 0.01 --background 0 -o holes.vkt
    vkt resample holes.vkt --scale 1 --mask -o mask.nrrd
    vkt resample holes.vkt --scale 1 --background -5 -o values.nrrd
    vkt info mask.nrrd | grep -q 'uint8'
    vkt stats mask.nrrd --json >s
    grep -q '"min": 0' s
    grep -q '"max": 1' s
    # A hole is what has the background and nothing else has.
    vkt arith mul mask.nrrd 1 --dtype float32 | vkt arith add - 0 -o m.nrrd
    vkt arith sub mask.nrrd 1 --dtype float32 | vkt arith mul - 5 -o expected.nrrd
    vkt arith min values.nrrd 0 | vkt diff - expected.nrrd
    fails_with 2 'mask' vkt resample holes.vkt --scale 1 --mask --dtype uint8 -o x.nrrd
    fails_with 2 'structured' vkt resample v.nrrd --scale 1 --mask -o x.nrrd
}

@test "--timing: one table with a row per stage, with the bytes of files too" {
    vkt read v.nrrd --timing | vkt flip x | vkt write x.nrrd 2>table
    grep -q '^stage .*wall s .*cpu s .*wait in .*wait out .*bytes in .*bytes out' table
    [ "$(grep -c '^\(read\|flip\|write\) ' table)" -eq 3 ]
    # 24000 bytes of voxels and a header.
    [ "$(awk '$1 == "read" { print ($6 >= 23.4 && $7 == "KiB") }' table)" -eq 1 ] || { cat table >&2; false; }
    [ "$(awk '$1 == "write" { print ($8 >= 23.4 && $9 == "KiB") }' table)" -eq 1 ] || { cat table >&2; false; }
    vkt pipe 'read v.nrrd --timing | flip x | write y.nrrd' 2>table
    grep -q 'KiB .*KiB' table || { cat table >&2; false; }
}
