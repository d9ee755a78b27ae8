# vkt convert --dtype auto: the smallest type within a tolerance; NumPy as oracle.
load helper

raw() { vkt write - --format raw; }
check() {
    python_with numpy
    /usr/bin/python3 -c "import numpy as np, json
$1"
}

type_of() { vkt info "$1" --json | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)["dtype"])'; }

@test "whole numbers go into the smallest integers, exactly" {
    check 'np.array([0, 255, 7], "f4").tofile("a_3x1x1_float32.raw")
np.array([-128, 127], "i4").tofile("b_2x1x1_int32.raw")
np.array([-1, 255, 0], "i4").tofile("c_3x1x1_int32.raw")
np.array([0, 65535, 1], "f8").tofile("d_3x1x1_float64.raw")
np.array([-40000, 90000, 7], "i8").tofile("e_3x1x1_int64.raw")
np.array([1 - 2**62, 2**62, 7], "i8").tofile("f_3x1x1_int64.raw")
np.array([5, 2000, 6], "u2").tofile("g_3x1x1_uint16.raw")'
    while read -r file type; do
        vkt convert "$file"_*.raw --dtype auto -q -o $file.nrrd
        [ "$(type_of $file.nrrd)" = $type ] || { vkt info $file.nrrd; false; }
        vkt diff "$file"_*.raw $file.nrrd
    done <<'END'
a uint8
b int8
c int16
d uint16
e int32
f int64
g uint16
END
}

@test "offsets and common steps become a value map, bit for bit" {
    check 'np.array([1000, 1255, 1003], "u2").tofile("a_3x1x1_uint16.raw")
(np.arange(256, dtype="i4") * 4096 - 70000).tofile("b_256x1x1_int32.raw")
np.full(5, 3.7).tofile("c_5x1x1_float64.raw")
(np.arange(3000, dtype="i8") * 49 + 2**61).tofile("d_3000x1x1_int64.raw")
(np.arange(200, dtype="f4") * 7 - 12345).tofile("e_200x1x1_float32.raw")'
    for file in a b c e; do
        vkt convert "$file"_*.raw --dtype auto -o $file.nrrd 2>said
        grep -q 'stored as uint8, slope .*: exactly, 1 byte a voxel' said
        vkt diff "$file"_*.raw $file.nrrd
    done
    # 2^61 is beyond what slope and intercept give exactly
    vkt convert d_*.raw --dtype auto -q -o d.nrrd
    [ "$(type_of d.nrrd)" = int64 ]
}

@test "within the tolerance, never beyond it, and a type below would be" {
    check 'rng = np.random.default_rng(4)
rng.normal(100, 30, 24000).astype("f4").tofile("n_40x30x20_float32.raw")
(1e6 + rng.random(24000)).tofile("o_40x30x20_float64.raw")
(10.0 ** rng.uniform(-3, 4, 24000)).astype("f4").tofile("l_40x30x20_float32.raw")'
    for file in n o l; do
        for t in 1 0.5 0.01 0.0001; do
            vkt convert "$file"_*.raw --dtype auto --tolerance $t -o $file.$t.nrrd 2>$file.$t.said
            vkt info $file.$t.nrrd --json >$file.$t.json
            vkt read $file.$t.nrrd | raw >$file.$t.raw
        done
    done
    check 'size = {}
for f, kind in (("n", "f4"), ("o", "f8"), ("l", "f4")):
    v = np.fromfile(f + "_40x30x20_" + {"f4": "float32", "f8": "float64"}[kind] + ".raw", kind).astype("f8")
    for t in ("1", "0.5", "0.01", "0.0001"):
        i = json.load(open(f"{f}.{t}.json")); got = np.fromfile(f"{f}.{t}.raw", i["dtype"]).astype("f8")
        p = got * i.get("slope", 1) + i.get("intercept", 0); error = abs(p - v).max()
        assert error <= float(t), (f, t, i, error)
        n = np.dtype(i["dtype"]).itemsize; size[f, t] = n
        if n > 1: # no smaller integer spread over the range would do
            below = {2: 255, 4: 65535, 8: 2**32 - 1}[n]
            assert (v.max() - v.min()) / below / 2 > float(t) * (1 - 1e-6), (f, t, i)
assert size["n", "0.5"] == 1 and size["n", "0.01"] == 2 and size["n", "0.0001"] == 4, size
assert size["o", "0.01"] == 1 and size["o", "0.0001"] == 2, size'
}

@test "float16 where it is close enough; NaN and infinities stay what they are" {
    check 'np.array([0.5, np.nan, np.inf, 2.25, 60001], "f4").tofile("a_5x1x1_float32.raw")
np.array([0.5, np.nan, 0.1], "f8").tofile("b_3x1x1_float64.raw")
np.array([np.nan, 1e39], "f8").tofile("c_2x1x1_float64.raw")
np.array([np.nan, np.nan], "f8").tofile("d_2x1x1_float64.raw")'
    while read -r file tolerance type; do
        vkt convert "$file"_*.raw --dtype auto --tolerance $tolerance -q -o $file.vkt --force
        [ "$(type_of $file.vkt)" = $type ]
    done <<'END'
a 16 float16
a 0 float32
b 1e-4 float16
b 1e-8 float32
b 0 float64
c 1e30 float64
d 0 float16
END
    vkt convert a_*.raw --dtype auto --tolerance 16 -q | vkt convert --dtype float32 | raw >out
    check 'a = np.fromfile("out", "f4"); assert np.isnan(a[1]) and np.isinf(a[2]) and a[3] == 2.25, a'
}

@test "a pipe, a file, slabs, threads, both kinds of volume and vkt pipe give the same" {
    vkt make noise --dims 40 41 42 --low -3 --high 5 --dtype float32 -o v.nrrd
    vkt convert v.nrrd --dtype auto --tolerance 0.02 -q -o a.nrrd
    vkt read v.nrrd | vkt convert --dtype auto --tolerance 0.02 -q | vkt write b.nrrd
    vkt convert v.nrrd --dtype auto --tolerance 0.02 --slab 1 --threads 3 -q -o c.nrrd
    vkt pipe -q 'read v.nrrd | convert --dtype auto --tolerance 0.02 | write d.nrrd'
    for other in b c d; do vkt diff a.nrrd $other.nrrd; done
    [ "$(type_of a.nrrd)" = uint8 ]
    # What follows sees the type that was found.
    vkt read v.nrrd | vkt convert --dtype auto --tolerance 0.02 -q | vkt flip x | vkt info | grep -q uint8
    vkt make amr --blocks 40 --levels 3 -o t.vkt
    vkt convert t.vkt --dtype auto --tolerance 0.01 -q -o small.vkt
    [[ "$(type_of small.vkt)" = uint* ]]
    vkt resample t.vkt --cells 20000 -o g.nrrd
    vkt resample small.vkt --cells 20000 -o s.nrrd
    vkt diff g.nrrd s.nrrd --tolerance 0.011
}

@test "the error travels, and a dry run tells the most there can be" {
    vkt make noise --dims 20 20 20 --low 0 --high 1 --dtype float32 -o v.nrrd
    vkt convert v.nrrd --dtype auto --tolerance 0.01 -q | vkt info --json >i
    check 'e = json.load(open("i"))["error"]; assert 0 < e["at_most"] <= 0.01, e'
    vkt convert v.nrrd --dtype auto --tolerance 0.01 --dry-run 2>plan
    grep -q 'smallest type within 0.01' plan
}

@test "what contradicts itself is refused" {
    vkt make ramp --dims 4 4 4 -o r.vkt
    for words in '--dtype uint8 --tolerance 1' '--tolerance 1' '--dtype auto --range minmax' '--dtype auto --tolerance -1' '--dtype auto --tolerance nan'; do
        run vkt convert r.vkt $words -o out.vkt
        [ "$status" -eq 2 ]
        [ ! -e out.vkt ]
    done
}
