# vkt pipe: stages fused in one process; tests/properties.bats compares its bytes with those of pipes.
load helper

setup_more() { vkt make noise --seed 1 --dims 20 18 16 --dtype uint8 -o noise.nrrd; }

@test "runs stages and reports like the last one" {
    [ "$(vkt pipe 'read noise.nrrd | flip x | stats --json')" = "$(vkt flip x noise.nrrd | vkt stats --json)" ]
    vkt pipe 'read noise.nrrd | crop --roi 1:9,:,: | write part.nrrd'
    vkt crop noise.nrrd --roi 1:9,:,: | vkt diff - part.nrrd
}

@test "ends in a stream where nothing writes" {
    vkt pipe 'read noise.nrrd | filter gaussian --sigma 1' | vkt info --json | tr -d ' \n' | grep -q '"dims":\[20,18,16\]'
}

@test "may begin with a stream" {
    vkt read noise.nrrd | vkt pipe 'flip y | flip y' | vkt diff - noise.nrrd
}

@test "quotes and spaces are those of a shell" {
    cp noise.nrrd 'a noise.nrrd'
    vkt pipe 'read "a noise.nrrd" | set --attribute "who=a b"' | vkt info --json | grep -q '"who":"a b"'
    fails_with 2 '' vkt pipe 'read "noise.nrrd | stats'
    cp noise.nrrd "it's|x.nrrd"
    vkt pipe "read 'it'\\''s|x.nrrd' | flip x|flip x" | vkt diff - noise.nrrd
    vkt pipe 'read it\'"'"'s\|x.nrrd | flip x' | vkt diff - <(vkt flip x noise.nrrd)
}

@test "options before the pipeline reach all stages" {
    vkt pipe --dry-run 'read noise.nrrd | flip x | write out.nrrd' >plan 2>&1
    [ "$(grep -c '20 *x *18 *x *16\|20 18 16' plan)" -ge 1 ]
    [ ! -e out.nrrd ]
    [ "$(vkt pipe --slab 1 --threads 1 'read noise.nrrd | filter gaussian --sigma 1 | stats')" = \
        "$(vkt pipe 'read noise.nrrd | filter gaussian --sigma 1 | stats')" ]
}

@test "options beside the pipeline reach the stages that have them" {
    [ "$(vkt pipe --json 'read noise.nrrd | stats')" = "$(vkt stats --json noise.nrrd)" ]
    [ "$(vkt pipe 'read noise.nrrd | stats' --json)" = "$(vkt stats --json noise.nrrd)" ]
    fails_with 2 "no stage of the pipeline has an option --json" vkt pipe --json 'read noise.nrrd | flip x' -o out.vkt
    [ ! -e out.vkt ]
}

@test "options about the output reach the last stage" {
    vkt flip x noise.nrrd -o flipped.nrrd
    vkt pipe 'read noise.nrrd | flip x' -o out.vkt
    vkt diff out.vkt flipped.nrrd
    fails_with 4 "exists" vkt pipe 'read noise.nrrd | write out.vkt'
    vkt pipe --force 'read noise.nrrd | write out.vkt'
    vkt diff out.vkt noise.nrrd
    fails_with 2 "the last stage, 'stats', has no --output" vkt pipe 'read noise.nrrd | stats' -o out.txt
}

@test "a stage that fails fails the pipeline" {
    fails_with 2 'gaussian' vkt pipe 'read noise.nrrd | filter gausian | write out.nrrd'
    fails_with 2 '' vkt pipe 'read noise.nrrd | | stats'
    fails_with 2 '' vkt pipe ''
    fails_with 4 'absent.nrrd' vkt pipe 'read absent.nrrd | write out.nrrd'
    fails_with 2 '' vkt pipe 'read noise.nrrd | crop --roi 0:30,:,: | write out.nrrd'
    [ ! -e out.nrrd ]
}

@test "messages name the stage of the pipeline" {
    vkt make ramp --dims 4 4 4 -o v.nrrd
    fails_with 2 "vkt pipe: filter gaussian: unknown option '--sigm'" vkt pipe 'read v.nrrd | filter gaussian --sigm 2 | stats'
    fails_with 2 "vkt pipe: crop: --roi 0:99" vkt pipe 'read v.nrrd | crop --roi 0:99,:,: | stats'
}

@test "a remark tells how many voxels were asked for where these are fewer than it speaks of" {
    vkt make ramp --dims 300 1 1 --dtype int16 -o r.vkt
    vkt pipe 'read r.vkt | convert --dtype uint8 | crop --roi 250:290,:,:' -o c.vkt 2>said
    [ "$(cat said)" = 'vkt pipe: convert: 34 of 300 voxels (11.33 %) clipped to [0,255]; 40 were asked for' ] || { cat said >&2; false; }
    vkt pipe 'read r.vkt | convert --dtype uint8 | flip x' -o c.vkt --force 2>said
    [ "$(cat said)" = 'vkt pipe: convert: 44 of 300 voxels (14.67 %) clipped to [0,255]' ] || { cat said >&2; false; }
}

@test "what several passes look at is counted once" {
    vkt make noise --dims 40 40 20 --dtype uint16 --low 0 --high 1000 --seed 3 -o n.nrrd
    vkt arith mul n.nrrd 100 -o many.nrrd 2>said
    share=$(grep -o '[0-9]* of 32000 voxels' said)
    [ -n "$share" ]
    for next in clahe 'threshold --otsu | label' fill-holes 'convert --range p1:p99 --dtype uint8' 'filter gaussian --sigma 2'; do
        vkt pipe "arith mul n.nrrd 100 | $next | stats" 2>said >/dev/null
        grep -q "arith: $share" said || { echo "$next, not $share: $(cat said)" >&2; false; }
    done
}

@test "a loss with --strict leaves no file, whoever would write it" {
    vkt make noise --dims 20 20 20 --dtype uint8 --low 0 --high 255 --seed 3 -o n.nrrd
    for next in 'write o.nrrd' 'write o.nii.gz' 'render -o o.png' 'histogram -o o.csv' 'label -o o.nrrd' 'flip x -o o.vkt' 'mesh -o o.ply --iso 100' \
        'brick --size 8 -o o' 'brick --size 8 | merge -o o.nrrd' 'slice --z 3 -o o.png'; do
        fails_with 3 "arith: --strict: " vkt pipe "read n.nrrd | arith mul 100 --strict | $next"
        [ -z "$(find . -name 'o*' -print -quit)" ] || { echo "$next leaves $(find . -name 'o*')" >&2; false; }
    done
    vkt pipe 'read n.nrrd | arith mul 100 | brick --size 8 -o bricks' 2>said
    grep -q 'arith: .* clipped' said
}

@test "so do those of files, of --strict and of trees, hints and remarks" {
    vkt make ramp --dims 300 4 4 -o v.nrrd
    fails_with 4 "vkt pipe: read: cannot open 'absent.nrrd'" vkt pipe 'read absent.nrrd | flip x | stats'
    fails_with 4 "vkt pipe: arith: cannot open 'absent.nrrd'" vkt pipe 'read v.nrrd | arith add - absent.nrrd'
    fails_with 4 "vkt pipe: flip: cannot open 'absent.nrrd'" vkt pipe 'flip x absent.nrrd'
    fails_with 4 "vkt pipe: read: cannot open 'absent.nrrd'" vkt pipe --tolerance 1 'read absent.nrrd | flip x'
    fails_with 4 "vkt pipe: write: cannot write 'v.nrrd'" vkt pipe 'read v.nrrd | flip x | write v.nrrd'
    fails_with 4 "vkt pipe: flip: cannot write 'v.nrrd'" vkt pipe 'read v.nrrd | flip x' -o v.nrrd
    fails_with 2 "vkt pipe: render: 'v.txt'" vkt pipe 'read v.nrrd | render -o v.txt'
    head -c 3000 v.nrrd >cut.nrrd
    fails_with 3 "vkt pipe: read: 'cut.nrrd' ended early" vkt pipe 'read cut.nrrd | filter box --radius 1 | stats'
    vkt make amr --blocks 20 --levels 3 -o t.vkt
    head -c 30000 t.vkt >cut.vkt
    fails_with 3 "vkt pipe: read: the volume on cut.vkt ended early" vkt pipe 'read cut.vkt | arith mul - 2 | write w.vkt'
    run -0 --separate-stderr vkt pipe 'read v.nrrd | convert --dtype uint8 | flip x | write a.nrrd'
    [[ "$stderr" == "vkt pipe: convert: "*clipped* ]]
    fails_with 3 "vkt pipe: convert: --strict: " vkt pipe --strict 'read v.nrrd | convert --dtype uint8 | flip x | write b.nrrd'
    fails_with 2 "see 'vkt filter box --help'" vkt pipe 'read v.nrrd | filter box --nothing 1 | stats'
    fails_with 2 "see 'vkt pipe --help'" vkt pipe 'read v.nrrd | stats' --nothing
    fails_with 2 "'make noise' can only begin a pipeline" vkt pipe 'read v.nrrd | make noise --dims 4 4 4'
    # What reads on is told once.
    run -3 --separate-stderr bash -o pipefail -c "vkt pipe 'read absent.nrrd | flip x' | vkt stats"
    [ "$stderr" = "vkt pipe: read: cannot open 'absent.nrrd': no such file or directory" ]
}

@test "operations that report end a pipeline of one process as they end one of many" {
    vkt flip z noise.nrrd -o other.nrrd
    while read -r last; do
        # shellcheck disable=SC2086
        vkt read noise.nrrd | vkt crop --roi 2:18,:,3: | vkt $last >want
        [ -s want ]
        vkt pipe "read noise.nrrd | crop --roi 2:18,:,3: | $last" | cmp - want
    done <<'EOF'
stats
stats --json
stats --per z --csv
stats --mergeable
stats --percentiles 1,50
histogram --json
histogram --bins 5 --csv
info
info --json
dump --roi 0:3,0:2,0:2
dump-range --first 0 0 0 --last 3 2 2
EOF
    vkt pipe 'read noise.nrrd | diff - other.nrrd --json' >got || [ $? -eq 1 ]
    cmp got <(vkt diff noise.nrrd other.nrrd --json)
    vkt pipe 'make amr --blocks 20 --levels 3 | stats --json' | cmp - <(vkt make amr --blocks 20 --levels 3 | vkt stats --json)
    fails_with 2 "'stats' yields no volume for the stage after it" vkt pipe 'read noise.nrrd | stats | flip x'
}

@test "stages after one another read the file once, also where one of them looks at slices in its own order" {
    vkt make noise --dims 96 96 400 --dtype float32 -o in.nrrd
    for turn in 'rotate --axis z --angle 20' 'flip z' 'rotate --axis x --angle 5'; do
        run -0 --separate-stderr vkt pipe "read in.nrrd | filter gaussian --sigma 4 | filter median | $turn | resample --scale 0.5" \
            --timing -o out.nrrd --force
        # shellcheck disable=SC2154  # set by run
        read_mib=$(tail -n 1 <<<"$stderr" | grep -o '[0-9.]* MiB' | head -n 1 | cut -d ' ' -f 1)
        awk -v read="$read_mib" 'BEGIN { exit !(read > 14 && read < 1.6 * 14.1) }' || { echo "$turn: $read_mib MiB of 14.1" >&2; false; }
    done
}

@test "a budget for a volume of floats says how its values become known, and that works" {
    vkt make noise --dims 16 16 16 --dtype float32 -o f.nrrd
    fails_with 2 "arith clamp - LOW HIGH" vkt pipe --tolerance 0.1 'read f.nrrd | filter gaussian --sigma 2' -o x.nrrd
    read -r low high <<<"$(vkt stats f.nrrd --json | /usr/bin/python3 -c '
import json, sys
found = json.load(sys.stdin)
print(found["min"], found["max"])')"
    vkt pipe --tolerance 0.1 "read f.nrrd | arith clamp - $low $high | filter gaussian --sigma 2" -o x.nrrd
    vkt info x.nrrd --json | /usr/bin/python3 -c '
import json, sys
error = json.load(sys.stdin)["error"]
assert error["kind"] == "bound" and error["at_most"] <= 0.1, error'
    vkt arith clamp f.nrrd "$low" "$high" | vkt diff - f.nrrd
    # Of integers it is something else that is not known.
    vkt make noise --dims 16 16 16 --dtype uint8 --high 200 -o i.nrrd
    run --separate-stderr vkt pipe --tolerance 0.1 'read i.nrrd | transform "v*v"' -o y.nrrd
    [ "$status" -eq 2 ]
    [[ "$stderr" != *"arith clamp"* ]]
}
