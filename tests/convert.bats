# vkt convert: rounding, saturation, ranges, percentiles; NumPy as oracle.
load helper

raw() { vkt write - --format raw; }
check() {
    python_with numpy
    /usr/bin/python3 -c "import numpy as np, json
$1"
}

@test "floats to bytes: half to even, saturated, NaN to 0, all of it counted" {
    check 'np.array([-.5, .5, 1.5, 2.5, 254.5, 255.49, 255.5, 1e20, -1e20, np.nan, np.inf], "f4").tofile("v_11x1x1_float32.raw")'
    vkt read v_11x1x1_float32.raw | vkt convert --dtype uint8 2>remarks | raw >out
    check 'assert np.fromfile("out", "u1").tolist() == [0, 0, 2, 2, 254, 255, 255, 255, 0, 0, 255]'
    grep -q '4 of 11 voxels (36.36 %) clipped to \[0,255\]' remarks
    grep -q '1 of 11 voxels (9.09 %) not a number, stored as 0' remarks
}

@test "loss is an error with --strict" {
    vkt make ramp --dims 300 1 1 --dtype int16 -o r.vkt
    run vkt convert r.vkt --dtype uint8 --strict -o out.vkt
    [ "$status" -ne 0 ]
    [ ! -e out.vkt ]
}

@test "what was clipped is told once the output is there, not before an error" {
    vkt make ramp --dims 300 1 1 --dtype int16 -o r.vkt
    vkt convert r.vkt --dtype uint8 -o out.vkt 2>said
    grep -q 'vkt convert: 44 of 300 voxels' said
    [ -w /dev/full ] || skip "there is no /dev/full"
    run -4 vkt convert r.vkt --dtype uint8 -o /dev/full --format nrrd
    [[ $output == *"no space left on device"* ]]
    [[ $output != *clipped* ]]
    run -3 vkt convert r.vkt --dtype uint8 --strict -o strict.vkt
    [ "$(grep -c clipped <<<"$output")" -eq 1 ]
}

@test "every code survives a wider type and the way back" {
    vkt make ramp --dims 256 16 16 --dtype uint8 -o u8.vkt
    vkt make ramp --dims 65536 2 1 --dtype uint16 -o u16.vkt
    vkt make noise --dims 17 18 19 --dtype uint32 -o u32.vkt
    vkt make noise --dims 17 18 19 --dtype int64 --low -9e18 --high 9e18 -o i64.vkt
    vkt convert u8.vkt --dtype float32 | vkt convert --dtype uint8 | vkt diff u8.vkt
    vkt convert u8.vkt --dtype float16 | vkt convert --dtype uint8 | vkt diff u8.vkt
    vkt convert u16.vkt --dtype float32 | vkt convert --dtype uint16 | vkt diff u16.vkt
    vkt convert u32.vkt --dtype float64 | vkt convert --dtype uint32 | vkt diff u32.vkt
    vkt convert u32.vkt --dtype int64 | vkt convert --dtype uint32 | vkt diff u32.vkt
    vkt convert i64.vkt --dtype int64 | vkt diff i64.vkt
}

@test "all pairs of types agree with numpy" {
    check 'rng = np.random.default_rng(1)
v = np.concatenate([rng.normal(0, 300, 500), rng.uniform(-3e9, 3e9, 300), [0, -0.0, .5, -.5, 65504, 1e5, 127.5, 32767.5]])
v[:808 - 8] = v[:800]; v.reshape(101, 2, 4).tofile("v_4x2x101_float64.raw")'
    for from in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt read v_4x2x101_float64.raw | vkt convert --dtype $from -q | tee from.vkt | raw >from.$from
        for to in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
            vkt convert from.vkt --dtype $to -q | raw >from.$from.$to
        done
    done
    check 'types = "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split()
import warnings; warnings.simplefilter("ignore")
for f in types:
    v = np.fromfile("from." + f, f)
    for t in types:
        got = np.fromfile(f"from.{f}.{t}", t)
        if t[0] == "f": want = v.astype(t)
        else:
            i = np.iinfo(t)
            want = np.array([min(max(int(np.rint(x)) if f[0] == "f" and np.isfinite(x) else int(x) if f[0] != "f" else i.max if x > 0 else i.min, i.min), i.max) for x in v], t)
        assert (got == want).all(), (f, t, v[got != want][:3], got[got != want][:3], want[got != want][:3])'
}

@test "a range is spread over the type and physical values stay" {
    vkt make ramp --dims 11 3 2 -o r.vkt
    vkt convert r.vkt --dtype uint8 --range 2:7 >c.vkt 2>remark
    raw <c.vkt >out
    check 'v = np.clip(np.arange(11.), 2, 7); assert np.fromfile("out", "u1")[:11].tolist() == np.rint((v - 2) * 51).tolist()'
    grep -q '30 of 66 voxels (45.45 %) clipped to \[0,255\]' remark
    vkt stats c.vkt --json >s
    check 's = json.load(open("s")); assert abs(s["min"] - 2) < 1e-12 and abs(s["max"] - 7) < 1e-12, s'
    [ "$(vkt convert r.vkt --dtype uint8 --range 0:10 --to 100:200 -q | raw | od -An -tu1 -N11 | tr -s ' ')" = ' 100 110 120 130 140 150 160 170 180 190 200' ]
}

@test "a range spread over 64-bit integers counts only what was outside, once" {
    vkt make ramp --dims 8 1 1 -o r.vkt
    for dtype in int64 uint64; do
        vkt convert r.vkt --dtype $dtype --range minmax --strict -o all.vkt --force
        vkt convert r.vkt --dtype $dtype --range 0:3 -o some.vkt --force 2>remark
        grep -q '4 of 8 voxels (50.00 %) clipped' remark
    done
}

@test "minmax and percentiles agree with numpy, from a pipe and from a file" {
    vkt make noise --dims 30 31 32 --dtype uint16 --seed 1 | vkt write u16.nrrd
    vkt make noise --dims 30 31 32 --low 1000 --high 1001 --dtype float32 --seed 2 | vkt write f32.nrrd
    for name in u16 f32; do
        for range in minmax p1:p99 p0.5:p90; do
            vkt convert $name.nrrd --dtype float64 --range $range -q | vkt stats --json >$name.$range
            vkt read $name.nrrd | vkt convert --dtype float64 --range $range -q | vkt stats --json >piped
            cmp piped $name.$range
        done
        vkt read $name.nrrd | raw >$name.raw
    done
    check 'for name, t in (("u16", "u2"), ("f32", "f4")):
    v = np.fromfile(name + ".raw", t).astype(float)
    for r, p in (("minmax", (0, 100)), ("p1:p99", (1, 99)), ("p0.5:p90", (.5, 90))):
        s = json.load(open(name + "." + r)); lo, hi = np.percentile(v, p)
        tol = 1e-9 * hi
        assert abs(s["min"] - lo) < tol and abs(s["max"] - hi) < tol, (name, r, s, lo, hi)'
}

@test "percentiles are numpy's, wherever an outlier lies and however the values are spread" {
    check 'rng = np.random.default_rng(3)
for n, dims in (("small", (40, 30, 20)), ("large", (150, 140, 130))): # the large ones are counted, not sorted
    v = rng.random(dims[::-1]); name = n + "_%dx%dx%d" % dims
    v.tofile(name + "_float64.raw"); (v * 1e51).tofile(name + ".wide_%dx%dx%d_float64.raw" % dims)
    for i, outlier in enumerate((-1e6, -1e30, 1e30)):
        for j, at in enumerate((0, v.size // 2, v.size - 1)):
            w = v.astype("f4"); w.flat[at] = outlier; w.tofile(f"{n}.{i}{j}_%dx%dx%d_float32.raw" % dims)
    (10.0 ** rng.uniform(-300, 300, v.shape) * rng.choice([-1, 1], v.shape)).tofile(name + ".spread_%dx%dx%d_float64.raw" % dims)
    (1e9 + v).tofile(name + ".far_%dx%dx%d_float64.raw" % dims)'
    for file in *.raw; do
        vkt convert $file --dtype float64 --range p1:p99 -q | vkt stats --json >$file.json
        vkt convert $file --dtype float64 --range p1:p99 -q --slab 3 --threads 3 | vkt stats --json | cmp - $file.json
    done
    check 'import glob
for f in glob.glob("*.raw"):
    v = np.fromfile(f, f[:-4].rsplit("_", 1)[1]).astype(float); s = json.load(open(f + ".json")); want = np.percentile(v, (1, 99))
    assert np.allclose((s["min"], s["max"]), want, rtol=1e-14, atol=0), (f, s["min"], s["max"], want)'
}

@test "64-bit integers far from zero are spread by their differences" {
    check 'np.array([1700000000000000001 + i for i in range(1001)]).tofile("i_1001x1x1_int64.raw")
np.array([2**64 - 1001 + i for i in range(1001)], "u8").tofile("u_1001x1x1_uint64.raw")'
    for range in minmax p0:p100 1700000000000000001:1700000000000001001; do
        vkt convert i_1001x1x1_int64.raw --dtype uint16 --range $range --to 0:1000 --strict | raw >out
        check 'assert np.fromfile("out", "u2").tolist() == list(range(1001))'
    done
    vkt convert u_1001x1x1_uint64.raw --dtype uint16 --range minmax --to 0:1000 --strict | raw >out
    check 'assert np.fromfile("out", "u2").tolist() == list(range(1001))'
    vkt convert i_1001x1x1_int64.raw --dtype uint16 --range p10:p90 --to 0:800 -q | raw >out
    check 'assert np.fromfile("out", "u2").tolist() == [min(max(i - 100, 0), 800) for i in range(1001)]'
    vkt convert i_1001x1x1_int64.raw --dtype uint8 --range minmax --explain -o x.vkt 2>&1 | grep -q 'error at most [56][.0-9]*e-16'
}

@test "a range as wide as double is spread too" {
    check 'v = np.linspace(-1, 1, 256) * 1.5e308; v.tofile("w_256x1x1_float64.raw")'
    for range in minmax p0:p100 -1.5e308:1.5e308; do
        vkt convert w_256x1x1_float64.raw --dtype uint8 --range $range --strict -o wide.vkt --force
        vkt read wide.vkt | raw >out
        check 'assert np.fromfile("out", "u1").tolist() == list(range(256))'
    done
    vkt stats wide.vkt --json >s
    check 's = json.load(open("s")); assert abs(s["min"] / -1.5e308 - 1) < 1e-12 and abs(s["max"] / 1.5e308 - 1) < 1e-12, s'
}

@test "infinities and NaN do not count for extremes" {
    check 'np.array([1, np.inf, 3, np.nan, 4, -np.inf], "f4").tofile("v_6x1x1_float32.raw"); np.full(6, np.inf, "f4").tofile("w_6x1x1_float32.raw")'
    vkt convert v_6x1x1_float32.raw --dtype uint8 --range minmax -q | raw >out
    check 'assert np.fromfile("out", "u1").tolist() == [0, 255, 170, 0, 255, 0]'
    vkt set v_6x1x1_float32.raw --slope -2 | vkt convert --dtype uint8 --range minmax -q | raw >out
    check 'assert np.fromfile("out", "u1").tolist() == [255, 0, 85, 0, 0, 255], np.fromfile("out", "u1")'
    fails_with 3 "no voxel is a finite number" vkt convert w_6x1x1_float32.raw --dtype uint8 --range minmax -o out.vkt
}

@test "slabs and threads do not matter" {
    vkt make noise --dims 33 15 21 --low -5 --high 300 | vkt write n.nrrd
    for args in "--dtype uint8" "--dtype uint8 --range p2:p98" "--dtype int16 --range minmax" "--dtype float16"; do
        vkt convert n.nrrd $args -q --slab 50 --threads 1 | raw >all
        vkt convert n.nrrd $args -q --slab 1 --threads 3 | raw >cut
        cmp all cut
        VKT_INSTRUCTION_SET=baseline vkt convert n.nrrd $args -q | raw >cut
        cmp all cut
    done
}

@test "ranges that make no sense" {
    vkt make constant --dims 4 4 4 --value 5 -o c.vkt
    fails_with 2 "is empty" vkt convert c.vkt --dtype uint8 --range 3:3
    fails_with 2 "not a range" vkt convert c.vkt --dtype uint8 --range 3
    fails_with 2 "percentile" vkt convert c.vkt --dtype uint8 --range p1:p101
    fails_with 2 "--to needs --range" vkt convert c.vkt --dtype uint8 --to 0:10
    fails_with 3 "range to map is empty" vkt convert c.vkt --dtype uint8 --range minmax -o out.vkt
    fails_with 2 "does not fit" vkt convert c.vkt --dtype uint8 --range 0:1 --to 0:300 -o out.vkt
}

@test "the bound of a range holds for what is stored" {
    python_with numpy
    /usr/bin/python3 -c "
import numpy as np
np.random.default_rng(5).random((8, 16, 16)).tofile('u_16x16x8_float64.raw')"
    for options in '--dtype float32 --range 0:1' '--dtype float16 --range 0:1' '--dtype float32 --range 0:1 --to 1000000:1000001' \
        '--dtype float32 --range minmax' '--dtype float64 --range minmax'; do
        # shellcheck disable=SC2086
        vkt convert u_16x16x8_float64.raw $options --explain -o out.vkt --force 2>plan
        vkt convert out.vkt --dtype float64 -o stored.nrrd --force
        vkt info stored.nrrd --json >info.json
        vkt write stored.nrrd - --format raw >stored.raw
        /usr/bin/python3 - "$options" <<'EOF2'
import json, re, sys, numpy as np
i = json.load(open('info.json'))
exact = np.fromfile('u_16x16x8_float64.raw').astype(np.longdouble)
got = np.fromfile('stored.raw').astype(np.longdouble) * np.longdouble(i.get('slope', 1)) + np.longdouble(i.get('intercept', 0))
line = next(l for l in open('plan') if 'error' in l)
bound = 0.0
for number, what in re.findall(r'([0-9.e+-]+) (of the value range|of the largest magnitude|in values)', line):
    bound += float(number) * {'of the value range': float(np.ptp(exact)), 'of the largest magnitude': 1.0, 'in values': 1.0}[what]
error = float(abs(got - exact).max())
assert error <= bound, (sys.argv[1], error, bound, line)
EOF2
    done
}

@test "without a type it is the format that changes" {
    vkt make noise --dims 7 6 5 --dtype int16 | vkt set --spacing 1,2,3 --units HU -o v.nrrd
    vkt convert v.nrrd -o a.mha
    vkt convert v.nrrd b.mha
    vkt convert v.nrrd c.nhdr --dtype float32
    cmp a.mha b.mha
    [ "$(vkt info b.mha | sed -n 's/^format *//p')" = metaimage ]
    vkt diff --geometry v.nrrd b.mha
    vkt info c.nhdr | grep -qx 'dtype      float32'
    vkt convert v.nrrd | vkt diff v.nrrd -
    [ "$(vkt convert v.nrrd --dtype uint8 - 2>/dev/null | vkt info --json | grep -c uint8)" -ge 1 ]
    fails_with 4 "the file exists" vkt convert v.nrrd b.mha
    fails_with 2 "two outputs" vkt convert v.nrrd d.mha -o e.mha
    fails_with 2 "unexpected argument 'x'" vkt convert v.nrrd d.mha x
    [ ! -e d.mha ]
    vkt pipe 'read v.nrrd | convert - f.mha'
    cmp f.mha a.mha || vkt diff --geometry f.mha a.mha
}

@test "how a tree is cut into blocks does not move the range that percentiles and extremes give" {
    vkt make noise --dims 40 36 32 --seed 3 --low 0 --high 1 --dtype float32 -o noise.nrrd
    vkt transform 'x>12 && x<26 && y<20 && z<21 ? v+1+floor(z/11) : 0' noise.nrrd -o part.nrrd
    map() { vkt refine part.nrrd --tolerance 0 --levels 1 --background 0 --block-size "$1" | vkt convert -q --dtype uint8 --range "$2" | vkt info --json | grep -E '"(slope|intercept)"'; }
    for range in minmax p1:p99 p0:p90; do
        [ "$(map 4 $range)" = "$(map 16 $range)" ]
    done
    # Percentiles are those of the foreground; holes keep their value where the extremes are mapped.
    [ "$(map 8 p1:p99)" = "$(vkt transform 'v > 0 ? v : 0/0' part.nrrd -q | vkt convert -q --dtype uint8 --range p1:p99 | vkt info --json | grep -E '"(slope|intercept)"')" ]
    vkt transform 'x>12 && x<26 && y<20 && z<21 ? v : -1' part.nrrd | vkt refine --tolerance 0 --levels 1 --background -1 --block-size 1 |
        vkt convert --dtype uint8 --range minmax 2>&1 >bytes.vkt | cmp - /dev/null
    vkt info bytes.vkt --json | grep '"intercept": -1.0,'
}
