# vkt threshold: masks, exact for every type; Otsu's threshold against its definition.
load helper

types='uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'

# The same voxels for every type: two classes, values that repeat; in v also extremes, NaN and infinities.
setup_more() {
    python_with numpy
    /usr/bin/python3 - <<'EOF'
import numpy as np
rng = np.random.default_rng(5)
for name in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    type_ = np.dtype(name)
    a = np.where(rng.random((5, 7, 11)) < 0.4, rng.normal(30, 8, (5, 7, 11)), rng.normal(80, 12, (5, 7, 11)))
    a = (a if type_.kind == "f" else a.round().clip(0, 127)).astype(type_)
    a.tofile(f"two_11x7x5_{name}.raw")
    if type_.kind == "f":
        a.flat[:6] = [np.nan, np.inf, -np.inf, -0.0, np.finfo(type_).max, np.finfo(type_).tiny]
    else:
        a.flat[:2] = [np.iinfo(type_).min, np.iinfo(type_).max]
    a.tofile(f"v_11x7x5_{name}.raw")
EOF
}

# mask IN OPTIONS…: the bytes of the mask; digits IN OPTIONS…: as a word of digits.
mask() { vkt threshold "$@" --format raw -o -; }
digits() { mask "$@" 2>/dev/null | od -An -tu1 | tr -d ' \n'; }

@test "every type agrees with numpy, for every rule" {
    for type in $types; do
        mask v_11x7x5_$type.raw --above 50 >above.raw
        mask v_11x7x5_$type.raw --below 50.5 >below.raw
        mask v_11x7x5_$type.raw --above 20 --below 64 >between.raw
        mask v_11x7x5_$type.raw --range 20:64 >range.raw
        mask v_11x7x5_$type.raw --range 33.3: >open.raw
        mask v_11x7x5_$type.raw --range=:-0 >under.raw
        /usr/bin/python3 - $type <<'EOF'
import numpy as np, sys
v = np.fromfile(f"v_11x7x5_{sys.argv[1]}.raw", sys.argv[1])
for name, want in {"above": v > 50, "below": v < 50.5, "between": (v > 20) & (v < 64), "range": (v >= 20) & (v <= 64),
                   "open": v.astype(float) >= 33.3, "under": v <= 0}.items():
    got = np.fromfile(name + ".raw", np.uint8)
    assert np.array_equal(got, want), (sys.argv[1], name)
EOF
    done
}

@test "numbers that the type does not hold are not rounded" {
    /usr/bin/python3 -c "
import numpy as np
f = np.float32(0.1)
np.array([f, np.nextafter(f, np.float32(1)), np.nextafter(f, np.float32(0))], np.float32).tofile('f_3x1x1_float32.raw')
np.array([2**63 - 1, 2**63 - 2, 2**53, 2**53 + 1], np.int64).tofile('i_4x1x1_int64.raw')
np.array([2**64 - 1, 2**64 - 2, 0, 1], np.uint64).tofile('u_4x1x1_uint64.raw')"
    # float32's nearest to 0.1 is greater than 0.1.
    [ "$(digits f_3x1x1_float32.raw --above 0.1)" = 110 ]
    [ "$(digits f_3x1x1_float32.raw --range :0.1)" = 001 ]
    [ "$(digits i_4x1x1_int64.raw --above 9223372036854775806)" = 1000 ]
    [ "$(digits i_4x1x1_int64.raw --below 9007199254740993)" = 0010 ]
    [ "$(digits u_4x1x1_uint64.raw --range 18446744073709551615:)" = 1000 ]
    [ "$(digits u_4x1x1_uint64.raw --above 1e30)" = 0000 ]
    [ "$(digits u_4x1x1_uint64.raw --range -1e30:0.5)" = 0010 ]
}

@test "values are physical" {
    for map in '0.25 -3' '-2 100'; do
        # shellcheck disable=SC2086
        set -- $map
        vkt set two_11x7x5_int16.raw --slope "$1" --intercept "$2" -o mapped.nrrd --force
        vkt threshold mapped.nrrd --above 5.25 -o m.nrrd --force
        vkt info m.nrrd --json | grep -q '"dtype": "uint8"'
        vkt info m.nrrd --json | grep -q '"slope": 1.0,'
        vkt write m.nrrd - --format raw >m.raw
        /usr/bin/python3 -c "
import numpy as np
v = np.fromfile('two_11x7x5_int16.raw', np.int16) * ($1) + ($2)
assert np.array_equal(np.fromfile('m.raw', np.uint8), v > 5.25)"
    done
}

@test "NaN is outside, and counted" {
    run --separate-stderr vkt threshold v_11x7x5_float32.raw --range -1e30:1e30 -o m.nrrd
    [ "$status" -eq 0 ]
    [[ "$stderr" == *"1 of 385 voxels (0.26 %) not a number"* ]]
    fails_with 3 'not a number' vkt threshold v_11x7x5_float32.raw --above 0 --strict -o n.nrrd
    [ ! -e n.nrrd ]
}

@test "Otsu's threshold is the one of its definition, for every type" {
    for type in $types; do
        for map in '1 0' '0.5 10' '-3 7'; do
            # shellcheck disable=SC2086
            set -- $map
            vkt set two_11x7x5_$type.raw --slope "$1" --intercept "$2" -o in.vkt --force
            vkt threshold in.vkt --otsu --report report.json --format raw -o m.raw --force
            /usr/bin/python3 - $type "$1" "$2" <<'EOF'
import json, sys
import numpy as np
from fractions import Fraction
v = np.fromfile(f"two_11x7x5_{sys.argv[1]}.raw", sys.argv[1]).astype(float) * float(sys.argv[2]) + float(sys.argv[3])
floats = sys.argv[1].startswith("float")
if floats:
    counts, edges = np.histogram(v, bins=256)
    values = (edges[1:] + edges[:-1]) / 2
else: # a bin for every value
    values, counts = np.unique(v, return_counts=True)
n = [int(c) for c in counts]
x = [Fraction(c) for c in (range(256) if floats else values)]
best, at = -1, 0
for i in range(len(n) - 1):
    low, high = slice(i + 1), slice(i + 1, None)
    w1, w2 = sum(n[low]), sum(n[high])
    m1, m2 = (sum(c * p for c, p in zip(n[s], x[s])) / w for s, w in ((low, w1), (high, w2)))
    if w1 * w2 * (m1 - m2) ** 2 > best:
        best, at = w1 * w2 * (m1 - m2) ** 2, i
found = json.load(open("report.json"))["above"]
assert abs(found - values[at]) <= 1e-12 * abs(values[at]), (sys.argv, found, values[at])
assert np.array_equal(np.fromfile("m.raw", np.uint8), v > found), sys.argv
assert 0.2 < (v > found).mean() < 0.8
EOF
        done
    done
}

@test "Otsu: SimpleITK cuts 8-bit volumes at the same place" {
    PYTHONPATH=$VKT_BUILD/oracles
    export PYTHONPATH
    python_with SimpleITK
    mask two_11x7x5_uint8.raw --otsu >m.raw
    /usr/bin/python3 -c "
import SimpleITK as sitk, numpy as np
a = np.fromfile('two_11x7x5_uint8.raw', np.uint8).reshape(5, 7, 11)
f = sitk.OtsuThresholdImageFilter()
f.SetNumberOfHistogramBins(int(a.max()) - int(a.min()) + 1)
f.SetInsideValue(0); f.SetOutsideValue(1)
want = sitk.GetArrayFromImage(f.Execute(sitk.GetImageFromArray(a)))
assert np.array_equal(np.fromfile('m.raw', np.uint8).reshape(a.shape), want)"
}

@test "Otsu: constant volumes, single voxels, wide integers, infinities, none finite" {
    vkt make constant --dims 3 3 3 --dtype uint16 --value 7 -o c.nrrd
    [ "$(digits c.nrrd --otsu --report r.json)" = 000000000000000000000000000 ]
    grep -q '"above": 7' r.json
    vkt make constant --dims 1 1 1 --value 0.3 -o one.nrrd
    [ "$(digits one.nrrd --otsu)" = 0 ]
    # A bin for every value around 2^62, and 256 bins over all of 64 bits.
    /usr/bin/python3 -c "
import numpy as np
np.array([2**62 + i for i in (0, 1, 1, 2, 90, 91, 91, 92)], np.int64).tofile('i_8x1x1_int64.raw')
np.array([0, 1, 2**40, 2**64 - 1, 2**64 - 1, 2**64 - 9], np.uint64).tofile('u_6x1x1_uint64.raw')
np.array([np.nan, np.inf, -np.inf, 1, 1, 100, 101], np.float32).tofile('f_7x1x1_float32.raw')
np.array([np.nan, np.inf], np.float32).tofile('n_2x1x1_float32.raw')
np.array([-1.7e308, 1.7e308], np.float64).tofile('w_2x1x1_float64.raw')"
    [ "$(digits i_8x1x1_int64.raw --otsu --report r.json --force)" = 00001111 ]
    grep -q '"above": 4611686018427387906' r.json
    [ "$(digits u_6x1x1_uint64.raw --otsu)" = 000111 ]
    [ "$(digits f_7x1x1_float32.raw --otsu)" = 0100011 ]
    fails_with 3 'no voxel is a finite number' vkt threshold n_2x1x1_float32.raw --otsu -o x.nrrd
    fails_with 3 'too far' vkt threshold w_2x1x1_float64.raw --otsu -o x.nrrd
    [ ! -e x.nrrd ]
}

@test "slabs, threads, pipes and files give the same" {
    for rule in '--above 50' --otsu; do
        for type in uint8 int32 float64; do
            # shellcheck disable=SC2086
            mask v_11x7x5_$type.raw $rule >want.raw 2>/dev/null
            for options in '--slab 1' '--slab 3' '--slab 7' '--threads 1' '--threads 5'; do
                # shellcheck disable=SC2086
                mask v_11x7x5_$type.raw $rule $options 2>/dev/null | cmp - want.raw
                # shellcheck disable=SC2086
                vkt read v_11x7x5_$type.raw --slab 2 | mask - $rule $options 2>/dev/null | cmp - want.raw
            done
        done
    done
}

@test "geometry stays; trees keep their bricks" {
    vkt set two_11x7x5_uint8.raw --spacing 0.5,1,2 --origin 1,2,3 -o s.nrrd
    for key in origin spacing direction; do
        [ "$(vkt threshold s.nrrd --above 50 | vkt info | grep "^$key")" = "$(vkt info s.nrrd | grep "^$key")" ]
    done
    vkt make amr --blocks 50 --levels 3 -o t.vkt
    for rule in '--above 0.5' --otsu; do
        # shellcheck disable=SC2086
        vkt threshold t.vkt $rule --report r.json --force -o m.vkt
        above=$(/usr/bin/python3 -c 'import json; print(json.load(open("r.json"))["above"])')
        # What is nearest in the tree, and then compared, is what is compared first.
        vkt resample t.vkt --cells 20k --method nearest | vkt threshold --above "$above" -o a.nrrd --force
        vkt resample m.vkt --cells 20k --method nearest | vkt diff - a.nrrd
    done
}

@test "rules are checked" {
    local v=two_11x7x5_uint8.raw
    fails_with 2 'one way to choose' vkt threshold $v -o x.nrrd
    fails_with 2 'one way to choose' vkt threshold $v --above 3 --otsu -o x.nrrd
    fails_with 2 'one way to choose' vkt threshold $v --above 3 --range 1:2 -o x.nrrd
    fails_with 2 'nothing is above 9 and below 5' vkt threshold $v --above 9 --below 5 -o x.nrrd
    fails_with 2 'is empty' vkt threshold $v --range 9:5 -o x.nrrd
    fails_with 2 'not a range' vkt threshold $v --range 9 -o x.nrrd
    fails_with 2 'not a finite number' vkt threshold $v --above inf -o x.nrrd
    [ ! -e x.nrrd ]
}

@test "with --roi all outside of the region is 0, and Otsu does not see it" {
    vkt make noise --dims 23 19 17 --dtype float32 | vkt fill --value 1e6 --roi 0:2,:,: -o in.nrrd
    for region in 3:20,2:11,5:16 22:23,:,1:3; do
        for how in '--above 0.3' --otsu; do
            # shellcheck disable=SC2086
            vkt threshold in.nrrd $how --roi "$region" --slab 3 --report whole.json -o mask.nrrd --force
            # shellcheck disable=SC2086
            vkt crop in.nrrd --roi "$region" | vkt threshold $how --report part.json -o part.nrrd --force
            vkt crop mask.nrrd --roi "$region" | vkt diff - part.nrrd
            vkt delete mask.nrrd --roi "$region" | vkt stats --json | grep -q '"max": 0[,.]'
            cmp whole.json part.json
        done
    done
    vkt make amr --blocks 20 --levels 2 -o tree.vkt
    vkt threshold tree.vkt --above 0.1 --roi 0:16,:,: | vkt resample --method nearest -o tree.nrrd
    vkt resample tree.vkt --method nearest | vkt threshold --above 0.1 --roi 0:16,:,: | vkt diff - tree.nrrd
    run -2 vkt threshold in.nrrd --above 1 --roi 0:24,:,:
}

@test "how a tree is cut into blocks does not move Otsu's threshold" {
    vkt make noise --dims 40 36 32 --seed 3 --low 0 --high 1 --dtype float32 -o noise.nrrd
    vkt transform 'x>12 && x<26 && y<20 && z<21 ? v+1+floor(z/11) : 0' noise.nrrd -o part.nrrd
    for size in 4 8 16; do
        vkt refine part.nrrd --tolerance 0 --levels 1 --background 0 --block-size $size | vkt threshold --otsu --report $size.json -o $size.vkt
        cmp 4.json $size.json
    done
    vkt transform 'v > 0 ? v : 0/0' part.nrrd -q | vkt threshold --otsu --report grid.json -o grid.vkt -q
    cmp grid.json 4.json
    # Nothing but background is no foreground.
    vkt arith mul part.nrrd 0 | vkt refine --tolerance 0 --levels 1 --background 0 --block-size 8 | vkt threshold --otsu --report none.json -o none.vkt
    grep -q '"above": 0' none.json
}
