# vkt refine: structured to hierarchical within a tolerance. More about hierarchical volumes: amr.bats.
load helper

# field: a smooth ball in a non-cubic volume, smooth.nrrd.
field() { vkt make sphere --dims 84 60 50 --radius 9 --edge coverage | vkt filter gaussian --sigma 2 | vkt write smooth.nrrd; }

@test "the result comes back within the tolerance, with fewer cells" {
    field
    for method in basis nearest; do
        for tolerance in 0.2 0.01 0; do
            vkt refine smooth.nrrd --tolerance $tolerance --method $method -o tree.vkt --force
            vkt resample tree.vkt --scale 1 --method $method |
                vkt diff smooth.nrrd - --tolerance "$(awk "BEGIN { print $tolerance + 1e-6 }")" --geometry
        done
    done
    vkt refine smooth.nrrd --tolerance 0.01 | vkt stats --json >stats.json
    [ "$(sed -n 's/.*"count": \([0-9]*\).*/\1/p' stats.json)" -lt $((84 * 60 * 50 * 3 / 4)) ]
}

@test "64-bit integers are kept to the last digit" {
    python_with numpy
    /usr/bin/python3 -c '
import numpy as np
z, y, x = np.indices((64, 48, 80)); rng = np.random.default_rng(1); outside = (x - 12) ** 2 + (y - 12) ** 2 + (z - 12) ** 2 > 50
a = 1700000000000000001 + np.where(outside, 0, x + y); b = np.where(outside, 2**62 + 1, rng.integers(-2**63, 2**63 - 1, x.shape))
c = np.where(outside, 2**64 - 1, rng.integers(0, 2**64 - 1, x.shape, "u8")).astype("u8")
a.tofile("a_80x48x64_int64.raw"); b.tofile("b_80x48x64_int64.raw"); c.tofile("c_80x48x64_uint64.raw")'
    for file in a_80x48x64_int64 b_80x48x64_int64 c_80x48x64_uint64; do
        for method in basis nearest; do
            vkt refine $file.raw --tolerance 0 --method $method -o tree.vkt --force
            [ "$(vkt info tree.vkt --json | sed -n 's/.*"cells": \([0-9]*\).*/\1/p' | head -n 1)" -lt 245760 ] # it is no copy
            vkt resample tree.vkt --scale 1 --method $method | vkt write - --format raw | cmp - $file.raw
        done
    done
    # Blocks that only double takes for the background stay.
    vkt make constant --dims 16 16 16 --dtype int64 --value 9007199254740993 -o odd.vkt
    vkt refine odd.vkt --tolerance 0 --background 9007199254740992 | vkt resample --scale 1 | vkt diff odd.vkt
}

@test "the background of a volume with a value map is a physical value there and back" {
    vkt make sphere --dims 32 32 32 --edge coverage | vkt set --slope 4 --intercept 100 -o mapped.nrrd
    vkt refine mapped.nrrd --tolerance 0.01 --background 100 -o holes.vkt
    [ "$(vkt info holes.vkt --json | sed -n 's/.*"cells": \([0-9]*\).*/\1/p' | head -n 1)" -lt 32768 ]
    vkt resample holes.vkt --scale 1 | vkt diff - mapped.nrrd --tolerance 0.011
}

@test "streams, several volumes, history" {
    field
    vkt read smooth.nrrd | vkt refine --tolerance 0.01 --block-size 4 --levels 3 | vkt info >info
    grep 'kind       hierarchical' info
    grep 'refine --tolerance 0.01 --block-size 4 --levels 3' info
    vkt refine smooth.nrrd --tolerance 0.01 --background 0 | vkt resample --scale 1 |
        vkt diff smooth.nrrd - --tolerance 0.010001
}

@test "as exact as the noise: its level is found, and kept to" {
    python_with numpy scipy
    /usr/bin/python3 -c '
import numpy as np
from scipy import ndimage
rng = np.random.default_rng(5)
z, y, x = np.indices((64, 64, 64))
smooth = 500 * np.exp(-((x - 30) ** 2 + (y - 34) ** 2 + (z - 31) ** 2) / 800) + np.where(x > 50, 300, 0)
for s in (3, 12): (smooth + rng.normal(0, s, smooth.shape)).astype("f4").tofile(f"n{s}_64x64x64_float32.raw")
masked = (smooth + rng.normal(0, 5, smooth.shape)); masked[:40] = 0; masked.astype("f4").tofile("m5_64x64x64_float32.raw")'
    for name in n3 n12 m5; do
        vkt refine "$name"_64x64x64_float32.raw --tolerance noise -o $name.vkt 2>said
        cat said
        sigma=${name:1}
        found=$(sed -n 's/.*noise \([0-9.e-]*\) (robust estimate).*/\1/p' said)
        tolerance=$(sed -n 's/.*tolerance \([0-9.e-]*\): .*/\1/p' said)
        awk "BEGIN { exit !($found > 0.95 * $sigma && $found < 1.05 * $sigma) }"
        vkt resample $name.vkt --scale 1 | vkt diff "$name"_64x64x64_float32.raw - --tolerance "$(awk "BEGIN { print $tolerance * 1.000001 }")"
        [ "$(vkt info $name.vkt --json | sed -n 's/.*"cells": \([0-9]*\).*/\1/p' | head -n 1)" -lt $((64 * 64 * 64 / 2)) ]
    done
    vkt make constant --dims 16 16 16 --value 3 -o flat.nrrd
    vkt refine flat.nrrd --tolerance noise -n -o planned.vkt 2>&1 | grep -q 'no bound of the error' # until it is read
    vkt refine flat.nrrd --tolerance noise -q | vkt resample --scale 1 | vkt diff flat.nrrd
}

@test "bricks in the smallest type, and of the best size, keep to the tolerance" {
    field
    vkt arith mul smooth.nrrd 1000 -o large.nrrd
    for words in '--dtype auto' '--block-size auto' '--dtype auto --block-size auto --method nearest' '--block-size mixed'; do
        # shellcheck disable=SC2086
        vkt refine large.nrrd --tolerance 10 $words -o tree.vkt --force 2>said
        method=basis
        if [[ "$words" = *nearest* ]]; then method=nearest; fi
        vkt resample tree.vkt --scale 1 --method $method --dtype float32 | vkt diff large.nrrd - --tolerance 10.001
        if [[ "$words" = *dtype* ]]; then vkt info tree.vkt | grep -q uint8; fi
        grep -q 'bricks, .* with their places instead of' said
    done
    # The error of what is found later travels, too.
    vkt make noise --dims 32 32 32 --dtype uint8 --high 255 | vkt refine --tolerance noise -q | vkt info --json >i
    grep -q '"error": {"kind":"bound","at_most":' i
}

@test "by gradient: each component stays within the tolerance" {
    python_with numpy
    field
    vkt set smooth.nrrd --spacing 0.5,1,2 -o spaced.nrrd
    for tolerance in 0.02 0.002; do
        vkt refine spaced.nrrd --metric gradient --tolerance $tolerance -o tree.vkt --force
        [ "$(vkt info tree.vkt --json | sed -n 's/.*"cells": \([0-9]*\).*/\1/p' | head -n 1)" -lt $((84 * 60 * 50)) ]
        vkt resample tree.vkt --scale 1 | vkt convert --dtype float64 | vkt write a_84x60x50_float64.raw --format raw --force
        vkt convert smooth.nrrd --dtype float64 | vkt write b_84x60x50_float64.raw --format raw --force
        /usr/bin/python3 -c "
import numpy as np
a, b = (np.fromfile(f + '_84x60x50_float64.raw').reshape(50, 60, 84) for f in 'ab')
worst = max(abs(g).max() for g in np.gradient(a - b, 2, 1, 0.5))
assert worst <= $tolerance * 1.001 + 1e-6, worst"
    done
}

@test "by transfer function: what it does not show costs nothing, what it shows stays" {
    vkt make sphere --dims 80 64 48 --radius 9 --edge coverage | vkt filter gaussian --sigma 2 | vkt arith mul - 1000 |
        vkt arith add - <(vkt make noise --dims 80 64 48 --low -90 --high 90) -o noisy.nrrd
    tf='{"points": [[200, 1, 0.5, 0.2, 0], [900, 1, 1, 1, 0.5]]}'
    vkt refine noisy.nrrd --metric transfer --transfer "$tf" --tolerance 4 -o tree.vkt
    vkt refine noisy.nrrd --tolerance 20 -o by-value.vkt
    cells() { vkt info "$1" --json | sed -n 's/.*"cells": \([0-9]*\).*/\1/p' | head -n 1; }
    [ "$(cells tree.vkt)" -lt "$(($(cells by-value.vkt) / 2))" ]
    # Opacity runs in extinctions, from 0 at 200 to -ln(0.5) at 900.
    vkt resample tree.vkt --scale 1 | vkt convert --dtype float64 -q | vkt write a_80x64x48_float64.raw --format raw
    vkt convert noisy.nrrd --dtype float64 | vkt write b_80x64x48_float64.raw --format raw
    /usr/bin/python3 -c "
import numpy as np
a, b = (255 * (1 - 0.5 ** np.clip((np.fromfile(f + '_80x64x48_float64.raw') - 200) / 700, 0, 1)) for f in 'ab')
assert abs(a - b).max() <= 4.02, abs(a - b).max()"
}

@test "the smallest type keeps to a tolerance of gradients, and of what a transfer function shows" {
    python_with numpy
    # physical: what resample makes of the tree, as physical values.
    physical() {
        vkt resample tree.vkt --scale 1 --dtype float64 -q -o back.vkt --force
        vkt info back.vkt --json >info.json
        vkt write back.vkt stored_84x60x50_float64.raw --format raw --force -q
        /usr/bin/python3 -c '
import json
import numpy as np
info = json.load(open("info.json"))
stored = np.fromfile("stored_84x60x50_float64.raw")
(info.get("slope", 1) * stored + info.get("intercept", 0)).tofile("a_84x60x50_float64.raw")'
    }
    field
    vkt arith mul smooth.nrrd 1000 | vkt set - --spacing 0.5,1,2 -o spaced.nrrd
    vkt convert spaced.nrrd --dtype float64 | vkt write b_84x60x50_float64.raw --format raw
    for tolerance in 40 4 0.4; do
        vkt refine spaced.nrrd --metric gradient --tolerance $tolerance --dtype auto -o tree.vkt --force -q
        vkt info tree.vkt | grep -Eq '(uint8|uint16|float16)'
        physical
        /usr/bin/python3 -c "
import numpy as np
a, b = (np.fromfile(f + '_84x60x50_float64.raw').reshape(50, 60, 84) for f in 'ab')
worst = max(abs(g).max() for g in np.gradient(a - b, 2, 1, 0.5))
assert $tolerance / 10 < worst <= $tolerance * 1.001 + 1e-4, worst"
    done
    ramp='{"points": [[200, 1, 1, 1, 0], [900, 1, 1, 1, 0.5]]}'
    step='{"points": [[200, 1, 1, 1, 0], [500, 1, 1, 1, 0], [500, 1, 1, 1, 0.5], [900, 1, 1, 1, 0.5]]}'
    for tolerance in 8 2 0.2; do
        vkt refine spaced.nrrd --metric transfer --transfer "$ramp" --tolerance $tolerance --dtype auto -o tree.vkt --force -q
        vkt info tree.vkt | grep -Eq '(uint8|uint16|float16)'
        physical
        /usr/bin/python3 -c "
import numpy as np
a, b = (255 * (1 - 0.5 ** np.clip((np.fromfile(f + '_84x60x50_float64.raw') - 200) / 700, 0, 1)) for f in 'ab')
assert 0 < abs(a - b).max() <= $tolerance * 1.001 + 1e-3, abs(a - b).max()"
    done
    # No rounding may carry a value over a jump.
    vkt refine spaced.nrrd --metric transfer --transfer "$step" --tolerance 8 --dtype auto -o tree.vkt --force -q
    physical
    /usr/bin/python3 -c "
import numpy as np
a, b = (np.fromfile(f + '_84x60x50_float64.raw') >= 500 for f in 'ab')
assert b.any() and (a == b).all(), (a != b).sum()"
}

@test "what makes no sense is refused" {
    field
    run -2 vkt refine smooth.nrrd -o x.vkt
    [[ "$output" == *'missing --tolerance'* ]]
    fails_with 2 'is negative' vkt refine smooth.nrrd --tolerance -1 -o x.vkt
    fails_with 2 'cannot promise' vkt refine smooth.nrrd --tolerance 1 --method average -o x.vkt
    vkt refine smooth.nrrd --tolerance 0.1 -o tree.vkt
    fails_with 2 'hierarchical already' vkt refine tree.vkt --tolerance 1 -o x.nrrd
    fails_with 2 'needs --transfer' vkt refine smooth.nrrd --tolerance 1 --metric transfer -o x.vkt
    fails_with 2 'is for --metric transfer' vkt refine smooth.nrrd --tolerance 1 --transfer '{}' -o x.vkt
    fails_with 2 'one of values' vkt refine smooth.nrrd --tolerance noise --metric gradient -o x.vkt
    fails_with 2 'not one of keep, auto' vkt refine smooth.nrrd --tolerance 1 --dtype uint8 -o x.vkt
    fails_with 2 'not in 1…64' vkt refine smooth.nrrd --tolerance 1 --block-size 100 -o x.nrrd
}

@test "the stream holds the cells that numpy makes of the voxels, and where they are in 4 bytes a brick" {
    python_with numpy
    vkt make sphere --dims 84 61 50 --radius 20 --edge coverage | vkt filter gaussian --sigma 2 | vkt arith mul - 4000 |
        vkt convert --dtype uint16 -o v.nrrd
    vkt write v.nrrd v_84x61x50_uint16.raw --format raw
    for words in '' '--block-size 4' '--block-size 4 --background 0' '--block-size 7 --levels 3' '--block-size mixed' '--block-size mixed --background 0'; do
        # shellcheck disable=SC2086
        vkt refine v.nrrd --tolerance 20 $words -o tree.vkt --force
        vkt info tree.vkt --json >info.json
        PYTHONPATH="$VKT_ROOT/tests" /usr/bin/python3 - <<'EOF'
import json
import numpy as np
from tree_content import contents
(header, bricks, cells, kinds), = contents(open("tree.vkt", "rb").read())
assert b"PACK" in kinds and b"TREE" not in kinds, kinds
v = np.fromfile("v_84x61x50_uint16.raw", "<u2").reshape(50, 61, 84).astype(float)
cells = np.frombuffer(cells, "<u2")
met = np.zeros(v.shape, int)
levels = set()
for x, y, z, nx, ny, nz, level in bricks:
    w = 1 << level
    levels.add(level)
    part = np.s_[z : z + nz * w, y : y + ny * w, x : x + nx * w]
    met[part] += 1
    assert v[part].shape == (nz * w, ny * w, nx * w), (x, y, z, level)
    mean = v[part].reshape(nz, w, ny, w, nx, w).mean((1, 3, 5))
    own, cells = np.split(cells, [nx * ny * nz])
    assert abs(own - mean.ravel()).max() <= 0.5, (x, y, z, level)
assert cells.size == 0 and len(levels) > 1
sparse = "background" in header.get("attributes", {})
assert met.max() == 1 and (met.min() == 1 or sparse) and v[met == 0].max(initial=0) <= 20
info = json.load(open("info.json"))
# 4 bytes a brick, and where every 16th begins, as bricks at the end are short.
assert 4 * len(bricks) <= info["table_bytes"] <= 4.5 * len(bricks) + 16, info
assert info["grid_bytes"] == 2 * v.size, info
EOF
    done
    # Turned, the short bricks come first: records.
    vkt flip y tree.vkt -o turned.vkt
    grep -aq TREE turned.vkt
    vkt flip y turned.vkt -o again.vkt
    for file in again tree; do
        PYTHONPATH="$VKT_ROOT/tests" /usr/bin/python3 "$VKT_ROOT/tests/tree_content.py" $file.vkt | awk '{ print $(NF - 1), $NF }' >$file
    done
    cmp again tree
}

@test "at the level of the noise trees are a fraction of the scans, bricks and their places" {
    needs_data raw
    needs_data nifti
    needs_data nrrd
    for case in 'raw/stent_128x128x256_int16.raw 8388608 6' 'nifti/MNI152_2009_template.nii.gz 17059922 4' \
        'nrrd/template_T2.nrrd 9375912 4'; do
        read -r file bytes times <<<"$case"
        vkt refine "$VKT_DATA/$file" --tolerance noise -o tree.vkt --force 2>said # with no option but that
        cat said
        found=$(sed -n 's/.* instead of .*, \([0-9.]*\) times as small$/\1/p' said)
        awk "BEGIN { exit !($found >= $times && $bytes / $(stat -c %s tree.vkt) >= $times) }"
    done
}

@test "what noise chooses may be said otherwise, and a tolerance in values keeps type and blocks" {
    vkt make ramp --dims 48 40 32 --to 900 | vkt arith add - <(vkt make noise --dims 48 40 32 --high 60) |
        vkt convert --dtype uint16 -o v.nrrd
    vkt refine v.nrrd --tolerance noise -o small.vkt 2>said
    grep -q 'uint8 in' said
    vkt refine v.nrrd --tolerance noise --dtype keep --block-size 8 -o kept.vkt 2>said
    grep -q 'uint16 in' said
    [ "$(stat -c %s small.vkt)" -lt "$(stat -c %s kept.vkt)" ]
    vkt refine v.nrrd --tolerance 100 -n -o x.vkt 2>&1 | grep -q 'blocks of 8 cells'
    vkt refine v.nrrd --tolerance noise -n -o x.vkt 2>&1 | grep -q 'blocks of 2 to 16 cells'
    vkt refine v.nrrd --tolerance 100 -o x.vkt
    vkt info x.vkt | grep -q uint16
    fails_with 2 "'uint8' is not one of keep, auto" vkt refine v.nrrd --tolerance 1 --dtype uint8
}

@test "a tree that is larger than its volume says so, and what may help" {
    vkt make noise --dims 32 32 32 --dtype uint8 --high 255 -o v.nrrd
    vkt refine v.nrrd --tolerance 0 -o tree.vkt 2>said
    grep -q 'the result takes .* more than the volume.s 32.0 KiB.*--block-size mixed' said || { cat said >&2; false; }
    # No loss, and nothing where the tree is smaller.
    vkt refine v.nrrd --tolerance 0 --strict -q -o tree.vkt --force
    vkt make sphere --dims 64 48 48 --edge coverage | vkt refine --tolerance 0.2 -o ball.vkt 2>said
    [ ! -s said ] || { cat said >&2; false; }
}

@test "what is found in a tree does not depend on its bricks" {
    vkt make noise --dims 48 40 33 --dtype uint8 --high 3 | vkt filter median --radius 1 -o few.nrrd
    for size in 2 4 8 mixed; do
        vkt refine few.nrrd --tolerance 0 --method nearest --block-size $size -q -o $size.vkt
        vkt stats $size.vkt --json | grep -E '"(count|min|max|argmin|argmax|sum)"' >$size
        cmp 2 $size
    done
    vkt stats few.nrrd --json | grep -E '"(count|min|max|argmin|argmax|sum)"' | cmp - 2
}

@test "a background that the type does not hold is refused before blocks are left out for it" {
    vkt make constant --dims 8 8 8 --dtype uint8 --value 9 | vkt set --slope 0.5 --intercept 3 -o v.nrrd
    fails_with 2 'the background 0 cannot be stored in uint8' vkt refine v.nrrd --background 0 --tolerance 1 -o x.vkt
    vkt refine v.nrrd --background 7.5 --tolerance 1 -o x.vkt
    vkt resample x.vkt --scale 1 | vkt diff v.nrrd - --tolerance 1
}

@test "--explain says what its error is one of" {
    vkt make ramp --dims 20 20 20 --dtype float32 -o ramp.nrrd
    vkt refine ramp.nrrd --tolerance 0.5 -n -o x.vkt 2>plan
    grep -q 'error at most 0.5 in values,' plan
    vkt refine ramp.nrrd --tolerance 0.5 --metric gradient -n -o x.vkt 2>plan
    grep -q 'error at most 0.5 in gradients,' plan
    vkt refine ramp.nrrd --tolerance 0.5 --metric transfer --transfer '{"points": [[0, 1, 1, 1, 0], [20, 1, 1, 1, 0.5]]}' -n -o x.vkt 2>plan
    grep -q 'error at most 0.5 in display levels,' plan
    # A bound on gradients is none on values.
    vkt chart 'refine --tolerance 0.5 --metric gradient | resample --scale 1' ramp.nrrd --budget 0.1 --keep threads --csv >chart.csv
    /usr/bin/python3 -c '
import csv
rows = list(csv.DictReader(open("chart.csv")))
assert len(rows) > 1 and all(row["bound"] == "" for row in rows), rows'
}

@test "masks, labels and thin things have no noise, whatever their edges" {
    vkt make sphere --dims 48 48 48 --radius 15 --dtype uint8 --inside 1 --outside 0 -o mask.nrrd
    vkt make sphere --dims 48 48 48 --radius 15 --dtype uint8 -o white.nrrd
    vkt make sphere --dims 64 64 64 --radius 20 --edge coverage -o smooth.nrrd
    vkt fill <(vkt make constant --dims 40 40 40 --dtype int16) --value 500 --roi 7:9,:,11:12 | vkt fill --value 300 --roi :,20:21,30:31 -o vessels.nrrd
    for volume in mask white smooth vessels; do
        vkt refine $volume.nrrd --tolerance noise -o tree.vkt --force 2>said
        grep -q 'noise 0 ' said
        vkt resample tree.vkt --scale 1 -q | vkt diff $volume.nrrd
    done
    # Noise within a mask is found, and that of air beside a padding, too.
    for size in 300 0; do
        vkt arith add <(vkt make noise --dims 64 64 64 --low -90 --high 90 --seed 3) $size |
            vkt fill --value 0 --roi :,:,:20 -o noisy.nrrd --force
        vkt refine noisy.nrrd --tolerance noise -o tree.vkt --force 2>said
        awk '{ for (i = 1; i < NF; ++i) if ($i == "noise") exit !($(i + 1) > 45 && $(i + 1) < 60) }' said
    done
}
