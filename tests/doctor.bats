# vkt doctor: what there is, the calibration, who may have written it, and what plans make of it.
load helper

setup_more() {
    export XDG_CACHE_HOME="$BATS_TEST_TMPDIR/cache" VKT_THREADS=2
    vkt make noise --dims 20 30 40 --dtype uint16 --high 1000 -o v.nrrd
}

# kept: a calibration that doctor made.
kept() { vkt doctor --calibrate >said; }

@test "what this build can do" {
    vkt doctor >said
    for name in version processor threads instructions memory GPUs reads writes hdf5 openvdb tiff gdcm openexr freetype; do
        grep -q "^$name  *[^ ]" said
    done
    grep -q '^reads .*nrrd' said
    grep -q 'none of this machine and build: vkt doctor --calibrate' said
    vkt doctor --json | /usr/bin/python3 -c 'import json, sys; assert "nrrd" in json.load(sys.stdin)["writes"]'
    fails_with 2 unexpected vkt doctor now
}

@test "a calibration is its owner's, and -n and --explain predict from it" {
    vkt pipe -n 'read v.nrrd | filter gaussian --sigma 1 | stats' 2>plan
    run ! grep -q 'on this machine' plan
    kept
    # Each setting of each operation took time, and ways to do it are told apart.
    awk '/ ns a voxel, / { n++; split($0, part, "threads: "); if ($0 !~ /[1-9].* ns a voxel/ || part[2] + 0 < 0.01) bad = 1 }
        END { exit !(n == 24 && !bad) }' said
    [ "$(grep -c '^resample .*(area\|^resample .*(linear' said)" -eq 6 ]
    [ "$(stat -c %a "$XDG_CACHE_HOME/vkt")" = 700 ]
    [ "$(stat -c %a "$XDG_CACHE_HOME/vkt/calibration")" = 600 ]
    vkt pipe -n 'read v.nrrd | filter gaussian --sigma 1 | stats' 2>plan
    for stage in read 'filter gaussian' stats; do grep -q "^vkt pipe: $stage:   about .* s on this machine" plan; done
    # With the start of the program, which the report tells in milliseconds. Reading and writing overlap with computing,
    # but what needs all of its input waits for it.
    truncate -s 256M big_512x512x256_float32.raw
    total() { # all stages without the start, their sum, and the longest
        awk -v start="$(sed -n 's/^start  *\(.*\) ms until.*/\1/p' said)" '
            /on this machine$/ { sum += $(NF - 4); if ($(NF - 4) > most) most = $(NF - 4) }
            /all stages: about/ { all = $6; n++ }
            END { if (n == 1 && start > 0.5) print all - 1e-3 * start, sum, most }' "$1"
    }
    vkt pipe -n 'read big_512x512x256_float32.raw | arith mul - 2 | write out.vkt' 2>plan
    total plan | awk '{ exit !($1 > 0.98 * $3 && $1 < 0.95 * $2) }'
    vkt pipe -n 'read big_512x512x256_float32.raw | rotate --angle 20 | stats' 2>plan
    total plan | awk -v read="$(sed -n 's/^vkt pipe: read:   about \(.*\) s on.*/\1/p' plan)" -v rotate="$(sed -n 's/^vkt pipe: rotate:   about \(.*\) s on.*/\1/p' plan)" \
        '{ exit !($1 > 0.98 * (read + rotate)) }'
    # What a command reads and writes by itself counts, too; what cannot be told is named.
    vkt arith mul big_512x512x256_float32.raw 2 -o big.vkt -n 2>plan
    grep -q '^vkt arith:   reading about' plan
    grep -q '^vkt arith:   writing about' plan
    total() { sed -n 's/.*all stages: about \(.*\) s, .*/\1/p'; }
    vkt pipe -n 'read big_512x512x256_float32.raw | arith mul - 2 | write big.vkt' 2>&1 | total >staged
    awk -v one="$(total <plan)" '{ exit !(one > 0.9 * $1 && one < 1.1 * $1) }' staged
    vkt pipe -n 'read big_512x512x256_float32.raw | arith mul - 2 | render -o x.png' 2>plan
    grep -q 'all stages but render: about' plan
    vkt filter gaussian v.nrrd --sigma 1 --explain -o g.nrrd 2>plan
    grep -q 'about .* s on this machine' plan
    vkt refine v.nrrd --tolerance 3 -n -o x.vkt 2>&1 | grep -q '^vkt refine:   time not predicted'
    vkt refine v.nrrd --tolerance 3 -o tree.vkt
    vkt stats tree.vkt -n 2>&1 | grep -q '^vkt stats:   time not predicted'
    # Whatever the operation and its method, there is a time.
    for stage in 'scan' 'clahe' 'histogram --bins 20' 'filter box --radius 5' 'rotate --angle 3 --method lanczos3' 'label' \
        'filter median --radius 3' 'reorient zyx' 'stats --percentiles 1' 'threshold --otsu' 'project std' 'watershed'; do
        vkt $stage v.nrrd -n 2>&1 | grep -q 'about .* s on this machine' || { echo "$stage: no time" >&2; false; }
    done
    # Ten times the voxels take ten times as long.
    seconds() { sed -n 's/^vkt filter:   about \(.*\) s on.*/\1/p'; }
    vkt make noise --dims 200 30 40 --dtype uint16 --high 1000 | vkt filter gaussian --sigma 1 -n -o x.vkt 2>&1 | seconds >ten
    vkt filter gaussian v.nrrd --sigma 1 -n -o x.vkt 2>&1 | seconds >one
    awk "BEGIN { r = $(cat ten) / $(cat one); exit !(r > 9.8 && r < 10.2) }"

    file="$XDG_CACHE_HOME/vkt/calibration"
    predicts() { vkt filter gaussian v.nrrd --sigma 1 -n -o x.vkt 2>&1 | grep -q 'on this machine'; }
    predicts
    cp -p "$file" good
    # Of another machine or build, damaged, open to others, or a link: it is no calibration.
    sed -i '2s/vkt [0-9]/vkt 99/' "$file"
    run ! predicts
    sed '4s/ [0-9].*/ nan 1/' good >"$file"
    run ! predicts
    head -c 100 good >"$file"
    run ! predicts
    cat good >"$file"
    predicts
    chmod 666 "$file"
    run ! predicts
    chmod 600 "$file"
    chmod 777 "$XDG_CACHE_HOME/vkt"
    run ! predicts
    fails_with 4 'others may write' vkt doctor --calibrate
    chmod 700 "$XDG_CACHE_HOME/vkt"
    mv "$file" elsewhere
    ln -s "$PWD/elsewhere" "$file"
    run ! predicts
}

@test "a plan says how far its result may be from exact" {
    vkt filter box v.nrrd --radius 1 -n -o x.nrrd 2>plan
    grep -q '^vkt filter:   result within 0.5 of exact' plan
    vkt set v.nrrd --units HU | vkt filter box --radius 1 --explain -o x.nrrd 2>plan
    grep -q 'result within 0.5 HU of exact' plan
    vkt flip x v.nrrd -n -o x.nrrd 2>&1 | grep -q 'result exact'
}
