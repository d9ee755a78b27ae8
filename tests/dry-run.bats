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

# On eight bits, so that the range of values is known before any is read.
@test "--budget divides an error among the stages of a dry run and prints the pipeline, which keeps to it" {
    vkt make noise --dims 24 20 22 --dtype uint8 --high 255 --no-history -o grey.nrrd
    for budget in 1 0.3 0.05; do
        vkt convert grey.nrrd --dtype float32 -n 2>/dev/null | vkt filter gaussian --sigma 2 2>/dev/null |
            vkt filter gaussian --sigma 3 -o 'smooth it.nrrd' --budget $budget >line 2>plan
        [ "$(wc -l <line)" -eq 1 ]
        [ ! -e 'smooth it.nrrd' ]
        grep -q "^vkt filter:   the result is within 0.* of exact" plan
        sh line
        vkt info 'smooth it.nrrd' --json >info
        /usr/bin/python3 -c '
import json, sys
error = json.load(open("info"))["error"]
assert error["kind"] == "bound" and 0 < error["at_most"] <= float(sys.argv[1]), error' $budget
        # What vkt pipe chooses.
        vkt pipe --tolerance $budget 'convert grey.nrrd --dtype float32 | filter gaussian --sigma 2 | filter gaussian --sigma 3' -o one.nrrd
        vkt history one.nrrd --as-shell >one
        sed "s/ --output 'smooth it.nrrd'//" line >many
        diff one many
        vkt diff one.nrrd 'smooth it.nrrd'
        rm one.nrrd 'smooth it.nrrd'
    done
    [ "$(tr -s ' ' '\n' <line | grep -c -- '^--tolerance')" -eq 2 ]
}

@test "--budget is about the stages that are planned, and keeps what they say" {
    # What made the file is no stage; its error counts.
    vkt make noise --dims 20 20 20 --dtype uint8 --high 255 | vkt convert --dtype float32 |
        vkt filter gaussian --sigma 1.5 --tolerance 1% -o before.vkt
    vkt read before.vkt -n 2>/dev/null | vkt filter gaussian --sigma 2 2>/dev/null | vkt stats --json --budget 5 >line 2>/dev/null
    grep -qE "^vkt read before.vkt \| vkt filter gaussian --sigma 2(,2,2)? --tolerance [^ ]+% \| vkt stats (- )?--json$" line || { cat line >&2; false; }
    sh line | grep -q '"mean"'
    fails_with 2 "within" bash -c 'vkt read before.vkt -n 2>/dev/null | vkt stats --budget 1e-9'
    # A tolerance that is given stays; sources and the end of one process, too.
    vkt make sphere --dims 16 16 16 --dtype uint8 -n 2>/dev/null | vkt convert --dtype float32 2>/dev/null |
        vkt filter gaussian --sigma 1 --tolerance 0.5% 2>/dev/null | vkt write s.nrrd --budget 10 >line 2>/dev/null
    [ "$(cat line)" = "vkt make sphere --dims 16 16 16 --dtype uint8 | vkt convert --dtype float32 | vkt filter gaussian --sigma 1,1,1 --tolerance 0.5% | vkt write - s.nrrd" ] || { cat line >&2; false; }
    vkt filter gaussian v.nrrd --sigma 2 -n -o x.nrrd --budget 1 >line 2>/dev/null
    grep -qE "^vkt filter gaussian v.nrrd --sigma 2,2,2 --output x.nrrd --tolerance [^ ]+%$" line || { cat line >&2; false; }
    sh line
    vkt info x.nrrd | grep -q 'within'
}

@test "what --budget printed is no volume, and the next command says so" {
    for next in 'rotate --angle 3 -o x.nrrd' 'rotate --angle 3 -n' stats 'write - x.nrrd' 'flip x --budget 1'; do
        fails_with 2 "the pipeline that --budget printed, not a volume" \
            bash -c "vkt filter gaussian v.nrrd --sigma 2 -n --budget 1 2>/dev/null | vkt $next"
        [[ "$stderr" == *"belongs to the last command of a dry run"* ]]
    done
    [ ! -e x.nrrd ]
    # Whoever runs it may read it from a pipe.
    vkt filter gaussian v.nrrd --sigma 2 -n -o x.nrrd --budget 1 2>/dev/null | sh
    vkt info x.nrrd | grep -q 'within'
}

@test "--budget refuses what is not planned, has several inputs or no known error" {
    fails_with 2 "give -n to the first command" vkt stats v.nrrd --budget 1
    fails_with 2 "give -n to the first command" vkt flip x v.nrrd --budget 1
    fails_with 2 "several inputs" vkt diff v.nrrd v.nrrd -n --budget 1
    fails_with 2 "takes more than what comes to it" bash -c 'vkt arith sub v.nrrd v.nrrd -n 2>/dev/null | vkt stats --budget 1'
    fails_with 2 "begins with no file" bash -c 'vkt stack v.nrrd v.nrrd -n 2>/dev/null | vkt flip x 2>/dev/null | vkt stats --budget 1'
    fails_with 2 "unknown" bash -c 'vkt read v.nrrd -n 2>/dev/null | vkt threshold --above 3 2>/dev/null | vkt transform "v*v" 2>/dev/null | vkt stats --budget 1'
    fails_with 2 "leave out --no-history" bash -c 'vkt read v.nrrd -n 2>/dev/null | vkt flip x --no-history --budget 1'
    fails_with 2 "not a finite number" bash -c 'vkt read v.nrrd -n 2>/dev/null | vkt flip x --budget inf'
}

@test "a dry run refuses the name of the output as the run would" {
    cp v.nrrd taken.nrrd
    refused_and_foretold 4 "taken.nrrd" vkt flip x v.nrrd -o taken.nrrd
    [[ "$stderr" == *"method mirrored copy"* ]]
    refused_and_foretold 4 "missing" vkt flip x v.nrrd -o missing/out.nrrd
    refused_and_foretold 4 "taken.nrrd" vkt pipe 'read v.nrrd | flip x | write taken.nrrd'
    vkt flip x v.nrrd -o taken.nrrd --force -n
    vkt flip x v.nrrd -o free.nrrd -n
    cmp v.nrrd taken.nrrd
    [ ! -e free.nrrd ]
    # Directories and parts of files are their writers' matter.
    vkt flip x v.nrrd -o a.zarr
    vkt flip x v.nrrd -o a.zarr --force -n
}
