# vkt stats: against NumPy, exact where it must be, the same for every cut.
load helper

check() {
    python_with numpy
    /usr/bin/python3 -c "import numpy as np, json
$1"
}

@test "all types agree with numpy" {
    for dtype in uint8 int8 uint16 int16 uint32 int32 uint64 int64; do
        vkt make noise --dims 37 19 11 --dtype $dtype --seed 5 | vkt write v.$dtype --format raw
        vkt read v.$dtype --dims 37 19 11 --dtype $dtype | vkt stats --json >s.$dtype
    done
    for dtype in float16 float32 float64; do
        vkt make noise --dims 37 19 11 --dtype $dtype --low -3 --high 5 --seed 6 | vkt write v.$dtype --format raw
        vkt read v.$dtype --dims 37 19 11 --dtype $dtype | vkt stats --json >s.$dtype
    done
    check 'for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    v = np.fromfile("v." + t, t); s = json.load(open("s." + t)); w = v.astype(np.longdouble)
    at = lambda i: [int(i % 37), int(i // 37 % 19), int(i // 703)]
    assert s["count"] == v.size and s["nan"] == 0 and s["inf"] == 0
    assert s["min"] == (int(v.min()) if t[0] != "f" else float(v.min())) and s["max"] == (int(v.max()) if t[0] != "f" else float(v.max())), (t, s)
    assert s["argmin"] == at(v.argmin()) and s["argmax"] == at(v.argmax()), (t, s)
    if t[0] != "f": assert s["sum"] == sum(int(x) for x in v), t
    else: assert abs(s["sum"] - w.sum()) < 1e-12 * abs(w).sum()
    assert abs(s["mean"] - w.mean()) <= 1e-12 * abs(w).max(), t
    assert abs(s["variance"] - w.var()) <= 1e-12 * w.var(), (t, s["variance"], w.var())
    assert abs(s["stddev"] - w.std()) <= 1e-12 * w.std()'
}

@test "large offsets do not cost the variance" {
    check 'rng = np.random.default_rng(7)
(1e6 + rng.normal(0, 1, (20, 30, 40))).astype("f4").tofile("a_40x30x20_float32.raw")
(1e9 + rng.normal(0, 1, (20, 30, 40))).tofile("b_40x30x20_float64.raw")'
    vkt read a_40x30x20_float32.raw | vkt stats --json >a
    vkt read b_40x30x20_float64.raw | vkt stats --json >b
    check 'for n, t in (("a", "f4"), ("b", "f8")):
    v = np.fromfile({"a": "a_40x30x20_float32.raw", "b": "b_40x30x20_float64.raw"}[n], t).astype(np.longdouble)
    assert abs(json.load(open(n))["variance"] / v.var() - 1) < 1e-9'
    vkt make constant --dims 64 64 64 --value 1 | vkt stats --json >one
    grep -q '"mean": 1,' one
    grep -q '"variance": 0,' one
}

@test "NaN and infinities" {
    check 'v = np.arange(24, dtype="f4"); v[[3, 5]] = np.nan; v.tofile("n_4x3x2_float32.raw"); v[7] = np.inf; v.tofile("i_4x3x2_float32.raw")
np.full(24, np.nan, "f4").tofile("a_4x3x2_float32.raw")
np.array([0, -0.0, 1, 1], "f4").tofile("z_4x1x1_float32.raw")'
    vkt stats n_4x3x2_float32.raw --json >n
    vkt stats i_4x3x2_float32.raw --json >i
    vkt stats a_4x3x2_float32.raw --json >a
    vkt stats z_4x1x1_float32.raw --json >z
    check 'n, i, a, z = (json.load(open(x)) for x in "niaz")
assert n["count"] == 24 and n["nan"] == 2 and n["sum"] == 276 - 8 and n["mean"] == 268 / 22, n
assert i["inf"] == 1 and i["max"] is None and i["argmax"] == [3, 1, 0] and i["variance"] is None, i
assert a["nan"] == 24 and a["min"] is None and a["mean"] is None and a["argmin"] is None, a
assert z["argmin"] == [0, 0, 0] and z["argmax"] == [2, 0, 0], z'
}

@test "values near the ends of double" {
    check 'rng = np.random.default_rng(5)
for e in (308, 307, 200, 160, -160, -200, -300, -320):
    v = rng.uniform(-1.7, 1.7, (9, 20, 30)) * 10.0 ** e; v.tofile(f"e{e}_30x20x9_float64.raw")
    (abs(v) / 4 + 1e308 * (e == 308)).tofile(f"p{e}_30x20x9_float64.raw")
v = rng.uniform(0, 1, (9, 20, 30)); v.flat[17] = 1e300; v.flat[4000] = -1e-300; v.tofile("mixed_30x20x9_float64.raw")
np.where(np.arange(5400) % 2, 1.5e308, -1.5e308).tofile("ends_30x20x9_float64.raw")
np.full(5400, 1.5e308).tofile("same_30x20x9_float64.raw")'
    for f in *.raw; do
        vkt stats $f --json --threads 1 --slab 9 >$f.json
        vkt stats $f --json --threads 3 --slab 2 | cmp - $f.json
    done
    check 'import glob, math
from fractions import Fraction
def root(x): # of a rational, to 60 bits
    shift = 2 * max(0, 200 - x.numerator.bit_length() + x.denominator.bit_length()); shift += shift % 2
    return Fraction(math.isqrt((x.numerator << shift) // x.denominator), 2 ** (shift // 2)) if x else Fraction(0)
def near(got, want, scale, name):
    if abs(want) > Fraction(1.7976931348623157e308): assert got is None, (name, got)
    else: assert abs(Fraction(got) - want) <= scale * Fraction(1e-14) + Fraction(5e-324), (name, got, float(want))
for f in glob.glob("*.raw"):
    v = [Fraction(x) for x in np.fromfile(f).tolist()]; s = json.load(open(f + ".json")); n = len(v)
    mean = sum(v) / n; variance = sum((x - mean) ** 2 for x in v) / n; largest = max(map(abs, v))
    near(s["mean"], mean, largest, (f, "mean")); near(s["sum"], sum(v), n * largest, (f, "sum"))
    near(s["variance"], variance, variance, (f, "variance")); near(s["stddev"], root(variance), root(variance), (f, "stddev"))'
}

@test "physical values and regions" {
    vkt make ramp --dims 10 4 3 | vkt set --slope -2 --intercept 1 | vkt stats --json >s
    vkt make ramp --dims 10 4 3 | vkt stats --roi 2:5,:,1:2 --json >r
    check 's, r = json.load(open("s")), json.load(open("r"))
assert s["min"] == -17 and s["max"] == 1 and s["argmin"] == [9, 0, 0] and s["mean"] == -8 and s["variance"] == 33, s
assert r["count"] == 12 and r["mean"] == 3 and r["argmin"] == [2, 0, 1], r'
    fails_with 2 "--roi" vkt stats --roi 5:5,:,: <(vkt make ramp --dims 10 4 3)
}

@test "the same bits for every slab height, thread count and instruction set" {
    vkt make noise --dims 100 37 23 --low -1 --high 1 | vkt write n.nrrd
    vkt make noise --dims 100 37 23 --dtype int64 | vkt write i.nrrd
    for name in n i; do
        vkt stats $name.nrrd --json --threads 1 --slab 23 >want
        for args in "--slab 1" "--slab 7 --threads 2" "--slab 5 --threads 5"; do vkt stats $name.nrrd --json $args | cmp - want; done
        for set in baseline avx2; do VKT_INSTRUCTION_SET=$set vkt stats $name.nrrd --json | cmp - want; done
    done
}

@test "a table for people" {
    vkt make ramp --dims 4 3 2 | vkt stats >table
    grep -qx 'mean *1.5' table
}

@test "of a region no more is read than that" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers need no tracer"
    command -v strace >/dev/null || skip "strace is not installed"
    truncate -s 512M big_512x1024x512_uint16.raw
    strace -f -y -e trace=read,pread64,preadv -o trace vkt stats big_512x1024x512_uint16.raw --roi :,10:20,7:9 --json >s.json
    grep -q '"count": 10240,' s.json
    grep -q '"argmin": \[0, 10, 7\]' s.json
    grep big_512 trace | sed -n 's/.*= \([0-9]*\)$/\1/p' | python3 -c '
import sys
total = sum(map(int, sys.stdin))
assert 20480 <= total < 20480 + 65536, total'
}

@test "a region gives the same through every path and slab" {
    vkt make noise --dims 37 29 23 --dtype float32 --seed 4 -o n.nrrd
    expected=$(vkt crop n.nrrd --roi 3:30,4:20,5:21 | vkt stats --json | grep -v arg)
    for slab in 1 3 7 64; do
        [ "$(vkt stats n.nrrd --roi 3:30,4:20,5:21 --slab $slab --json | grep -v arg)" = "$expected" ]
        [ "$(vkt read n.nrrd --slab $slab | vkt stats --roi 3:30,4:20,5:21 --json | grep -v arg)" = "$expected" ]
        [ "$(vkt read n.nrrd --slab $slab --transport shm | vkt stats --roi 3:30,4:20,5:21 --json | grep -v arg)" = "$expected" ]
    done
}

@test "several volumes are numbered as vkt info does" {
    vkt make ramp --dims 4 4 4 -o a1.nrrd
    vkt make ramp --dims 4 4 4 -o a2.nrrd
    diff <(vkt stats 'a?.nrrd' | sed -n 's/^volume  *//p') <(vkt info 'a?.nrrd' | sed -n 's/^volume  *//p')
    [ "$(vkt stats 'a?.nrrd' | sed -n 's/^volume  *//p')" = "$(printf '1 of 2\n2 of 2')" ]
}

@test "percentiles are NumPy's, of all types, of parts, and whichever way they are read" {
    for dtype in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make noise --dims 37 19 11 --dtype $dtype --seed 5 -o p.vkt --force
        vkt read p.vkt | vkt write - --format raw >p.raw
        vkt stats p.vkt --json --percentiles 0,1,37.5,50,100 >p.json
        check "v = np.fromfile('p.raw', '$dtype'); s = json.load(open('p.json'))
for p in (0, 1, 37.5, 50, 100):
    want = np.percentile(v.astype(np.longdouble), p)
    assert abs(np.longdouble(str(s['p%g' % p])) - want) <= 1e-15 * abs(want), ('$dtype', p, s['p%g' % p], want)
assert s['p0'] == s['min'] and s['p100'] == s['max']"
        vkt stats p.vkt --json | diff - <(grep -v '"p[0-9.]*":' p.json | sed 's/\("product_sign": .*\),$/\1/')
    done
    # Many voxels of 32 bits take several passes, of a pipe too.
    vkt make noise --dims 170 160 130 --seed 2 -o q.nrrd
    vkt stats q.nrrd --json --roi 3:,:,:-1 --percentiles 25,75 >q.json
    vkt read q.nrrd | vkt stats --json --roi 3:,:,:-1 --percentiles 25,75 --memory 16M --slab 7 --threads 3 2>spooled | cmp - q.json
    grep -q spooling spooled
    vkt read q.nrrd | vkt write - --format raw >q.raw
    check 'v = np.fromfile("q.raw", "f4").reshape(130, 160, 170)[:-1, :, 3:].astype(float); s = json.load(open("q.json"))
for p in (25, 75): assert abs(s["p%d" % p] - np.percentile(v, p)) < 1e-15 * 2'
}

@test "percentiles under a value map, without finite values, and of trees" {
    check 'np.arange(101, dtype="u1").tofile("s_101x1x1_uint8.raw")'
    vkt set s_101x1x1_uint8.raw --slope -2 --intercept 7 -o m.nrrd
    vkt stats m.nrrd --json --percentiles 10,50 >m.json
    check 's = json.load(open("m.json")); assert (s["p10"], s["p50"]) == (7 - 2 * 90, 7 - 2 * 50), s'
    check 'np.full(24, np.nan, "f4").tofile("n_4x3x2_float32.raw")'
    vkt stats n_4x3x2_float32.raw --json --percentiles 50 | grep -q '"p50": null'
    vkt make amr --blocks 50 --levels 3 -o t.vkt
    vkt stats t.vkt --json --percentiles 0,100 >t.json
    check 's = json.load(open("t.json")); assert s["p0"] == s["min"] and s["p100"] == s["max"]'
    fails_with 2 "not between 0 and 100" vkt stats m.nrrd --percentiles 1,101
    fails_with 2 "a number is missing after a comma" vkt stats m.nrrd --percentiles 1,,2
}

@test "the product, its logarithm and its sign are those of exact rationals" {
    check '
r = np.random.default_rng(3)
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64".split():
    i = np.iinfo(t); v = r.integers(i.min, i.max, (5, 17, 23), dtype=t, endpoint=True); v[v == 0] = 3; v.tofile(f"p_23x17x5_{t}.raw")
for t in "float16", "float32", "float64":
    v = (r.normal(0, 1, (5, 17, 23)) * 10.0 ** r.uniform(-4, 4, (5, 17, 23))).astype(t); v[v == 0] = 1
    if t == "float64": v *= 10.0 ** r.uniform(-200, 200, v.shape); v[0, 0, 0] = 5e-324
    if t == "float32": v[0, 0, 0] = 1e-45
    v.tofile(f"p_23x17x5_{t}.raw")'
    for dtype in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt stats p_23x17x5_$dtype.raw --json >p.$dtype
        vkt set p_23x17x5_$dtype.raw --slope -0.5 --intercept 0.25 -o m.vkt --force
        vkt stats m.vkt --json >m.$dtype
        for options in '--memory 1k --threads 1' '--threads 5'; do
            vkt stats p_23x17x5_$dtype.raw --json $options | cmp - p.$dtype
        done
    done
    check '
from fractions import Fraction
import math
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    v = [Fraction(int(x)) if t[0] in "ui" else Fraction(float(x)) for x in np.fromfile(f"p_23x17x5_{t}.raw", t)]
    for name, w in ("p", v), ("m", [Fraction(1, 4) - x / 2 for x in v]):
        if name == "m" and t in ("int64", "uint64", "float64"): w = [Fraction(float(x)) for x in w] # as float64 has them
        s = json.load(open(f"{name}.{t}")); p = math.prod(w)
        log = math.log(abs(p.numerator)) - math.log(p.denominator) if p else -math.inf
        assert s["product_sign"] == (p > 0) - (p < 0), (t, name)
        if p: assert abs(s["product_log"] - log) <= 1e-12 * abs(log) + 1e-11, (t, name, s["product_log"], log)
        else: assert s["product_log"] is None and s["product"] == 0
        if abs(log) < 700: assert abs(s["product"] / float(p) - 1) < 1e-12'
    # What double holds is the number itself; zeros, NaN and infinities.
    check 'np.array([3, -5, 7, np.nan], "f4").tofile("a_4x1x1_float32.raw"); np.array([3, 0, np.inf, 1], "f4").tofile("b_4x1x1_float32.raw")
np.array([-3, 2, np.inf, 1], "f4").tofile("c_4x1x1_float32.raw"); np.array([2, 0, -4, 1], "i2").tofile("d_4x1x1_int16.raw")'
    for i in a_4x1x1_float32 b_4x1x1_float32 c_4x1x1_float32 d_4x1x1_int16; do vkt stats $i.raw --json >${i%%_*}.json; done
    check 'a, b, c, d = (json.load(open(n + ".json")) for n in "abcd")
assert (a["product"], a["product_sign"]) == (-105, -1) and abs(a["product_log"] - np.log(105)) < 1e-14
assert b["product"] is None and b["product_sign"] is None and c["product"] is None and c["product_sign"] == -1
assert (d["product"], d["product_sign"], d["product_log"]) == (0, 0, None)'
}

grouped_volumes() {
    python_with numpy scipy
    check '
r = np.random.default_rng(4)
labels = np.repeat(np.repeat(np.repeat(r.integers(0, 9, (4, 6, 8)), 5, 0), 4, 1), 4, 2)[:19, :23, :31].copy()
mask = (r.random(labels.shape) < .3)
labels.astype("u2").tofile("labels_31x23x19_uint16.raw"); mask.astype("f4").tofile("mask_31x23x19_float32.raw")
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    if t[0] == "f": v = r.normal(100, 3, labels.shape).astype(t)
    else: v = r.integers(1, min(np.iinfo(t).max, 2**62), labels.shape).astype(t)
    v.tofile(f"v_31x23x19_{t}.raw")'
}

@test "masks, labels and slices agree with SciPy and NumPy, for any cut" {
    grouped_volumes
    for dtype in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        v=v_31x23x19_$dtype.raw
        vkt stats $v --labels labels_31x23x19_uint16.raw --json >labels.$dtype
        vkt stats $v --labels labels_31x23x19_uint16.raw --json --memory 1k --threads 1 | cmp - labels.$dtype
        vkt read $v | vkt stats --labels labels_31x23x19_uint16.raw --json --threads 5 | cmp - labels.$dtype
        vkt stats $v --mask mask_31x23x19_float32.raw --json >mask.$dtype
        vkt stats $v --mask mask_31x23x19_float32.raw --labels labels_31x23x19_uint16.raw --json >both.$dtype
        for axis in x y z; do vkt stats $v --per $axis --json >$axis.$dtype; done
        vkt stats $v --per y --roi 3:20,4:9,2:15 --json >roi.$dtype
    done
    check '
from scipy import ndimage
l = np.fromfile("labels_31x23x19_uint16.raw", "u2").reshape(19, 23, 31); m = np.fromfile("mask_31x23x19_float32.raw", "f4").reshape(l.shape) != 0
def same(row, v, where, t):
    picked = v[where]; w = picked.astype(np.longdouble)
    assert row["count"] == picked.size and row["min"] == picked.min().item() and row["max"] == picked.max().item(), (t, row)
    at = np.argwhere(where & (v == picked.min()))[0][::-1].tolist(); assert row["argmin"] == at, (t, row, at)
    at = np.argwhere(where & (v == picked.max()))[0][::-1].tolist(); assert row["argmax"] == at, (t, row, at)
    if t[0] != "f": assert row["sum"] == sum(int(x) for x in picked)
    else: assert abs(row["sum"] - w.sum()) <= 1e-14 * abs(w).sum()
    assert abs(row["mean"] - w.mean()) <= 1e-14 * abs(w).max() and abs(row["variance"] - w.var()) <= 1e-11 * w.var()
    assert abs(row["stddev"] - w.std()) <= 1e-11 * w.std()
    log = np.log(abs(w)).sum(); assert abs(row["product_log"] - log) <= 1e-12 * abs(log) + 1e-12, (t, row["product_log"], log)
    assert row["product_sign"] == np.prod(np.sign(w))
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    v = np.fromfile(f"v_31x23x19_{t}.raw", t).reshape(l.shape)
    rows = json.load(open("labels." + t))["labels"]
    assert [r["label"] for r in rows] == np.unique(l).tolist()
    for r in rows: same(r, v, l == r["label"], t)
    if t in ("float32", "float64", "uint8"):
        means = ndimage.mean(v.astype("f8"), l, np.unique(l)); assert np.allclose([r["mean"] for r in rows], means, rtol=1e-13)
        assert np.allclose([r["stddev"] for r in rows], ndimage.standard_deviation(v.astype("f8"), l, np.unique(l)), rtol=1e-9)
    same(json.load(open("mask." + t)), v, m, t)
    for r in json.load(open("both." + t))["labels"]: same(r, v, m & (l == r["label"]), t)
    for axis, n in ("x", 31), ("y", 23), ("z", 19):
        rows = json.load(open(f"{axis}.{t}"))["slices"]; assert [r[axis] for r in rows] == list(range(n))
        for r in rows: same(r, v, np.indices(v.shape)["zyx".index(axis)] == r[axis], t)
    z, y, x = np.indices(v.shape); inside = (x >= 3) & (x < 20) & (y >= 4) & (y < 9) & (z >= 2) & (z < 15)
    rows = json.load(open("roi." + t))["slices"]; assert [r["y"] for r in rows] == list(range(4, 9))
    for r in rows: same(r, v, inside & (y == r["y"]), t)'
}

@test "a mask is what its values mean, not what is stored" {
    vkt make ramp --dims 6 1 1 -o v.vkt # 0 to 5
    vkt convert v.vkt --dtype uint8 | vkt set --slope 2 --intercept -4 -o mask.vkt # 0 where 2 is stored
    [ "$(vkt stats v.vkt --mask mask.vkt --json | grep -o '"sum": [0-9]*')" = '"sum": 13' ]
    [ "$(vkt stats v.vkt --mask mask.vkt --percentiles 100 --json | grep -o '"count": [0-9]*')" = '"count": 5' ]
    vkt set mask.vkt --intercept -3 -o never.vkt # no voxel means 0
    [ "$(vkt stats v.vkt --mask never.vkt --json | grep -o '"count": [0-9]*')" = '"count": 6' ]
}

@test "percentiles of masks, labels and slices are NumPy's, for any cut, budget and way" {
    grouped_volumes
    check '
r = np.random.default_rng(6)
for t in "float16 float32 float64".split():
    v = np.fromfile(f"v_31x23x19_{t}.raw", t); v[r.random(v.size) < .05] = np.nan; v[r.random(v.size) < .03] = -np.inf
    v.tofile(f"v_31x23x19_{t}.raw")'
    local v options name
    for dtype in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        v=v_31x23x19_$dtype.raw
        while read -r name options; do
            # shellcheck disable=SC2086
            vkt stats $v $options --json --percentiles 0,2.5,50,33,99,100 >$name.$dtype
            # shellcheck disable=SC2086
            vkt stats $v $options --json --percentiles 0,2.5,50,33,99,100 --memory 1k --threads 1 | cmp - $name.$dtype
            # shellcheck disable=SC2086
            vkt read $v --slab 2 | vkt stats $options --json --percentiles 0,2.5,50,33,99,100 --threads 5 | cmp - $name.$dtype
        done <<'EOF'
labels --labels labels_31x23x19_uint16.raw
mask --mask mask_31x23x19_float32.raw
both --mask mask_31x23x19_float32.raw --labels labels_31x23x19_uint16.raw
x --per x
y --per y --roi 3:20,4:9,2:15
z --per z
EOF
    done
    check '
l = np.fromfile("labels_31x23x19_uint16.raw", "u2").reshape(19, 23, 31); m = np.fromfile("mask_31x23x19_float32.raw", "f4").reshape(l.shape) != 0
z, y, x = np.indices(l.shape); inside = (x >= 3) & (x < 20) & (y >= 4) & (y < 9) & (z >= 2) & (z < 15)
def same(row, v, where, t):
    w = v[where]
    if t[0] == "f": w = w[np.isfinite(w)]
    sizes = max(1e-300, abs(w.astype("f8")).max())
    for p in 0, 2.5, 50, 33, 99, 100:
        want = np.percentile(w.astype("f8"), p, method="linear")
        assert abs(row["p%g" % p] - want) <= 4e-16 * sizes, (t, p, row, want)
    assert row["p0"] == w.min() and row["p100"] == w.max() # 64 bits of them, too
    s = np.sort(w)
    if w.size % 2: assert row["p50"] == s[w.size // 2]
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    v = np.fromfile(f"v_31x23x19_{t}.raw", t).reshape(l.shape)
    rows = json.load(open("labels." + t))["labels"]; assert len(rows) == len(np.unique(l))
    for r in rows: same(r, v, l == r["label"], t)
    same(json.load(open("mask." + t)), v, m, t)
    for r in json.load(open("both." + t))["labels"]: same(r, v, m & (l == r["label"]), t)
    for r in json.load(open("x." + t))["slices"]: same(r, v, x == r["x"], t)
    for r in json.load(open("y." + t))["slices"]: same(r, v, inside & (y == r["y"]), t)
    for r in json.load(open("z." + t))["slices"]: same(r, v, z == r["z"], t)'
}

@test "percentiles of large groups in little memory, of value maps, and of groups without a number" {
    python_with numpy
    check '
r = np.random.default_rng(8)
(r.normal(0, 1, (130, 160, 170)) ** 3).astype("f4").tofile("v_170x160x130_float32.raw")
(r.random((130, 160, 170)) * 9).astype("u1").tofile("l_170x160x130_uint8.raw")'
    v=v_170x160x130_float32.raw l=l_170x160x130_uint8.raw p='--percentiles 1,50,99.9 --json'
    little='--memory 4M --threads 3' # tables of fewer bits, and what is read again is spooled
    vkt stats $v --labels $l $p >labels.json
    vkt stats $v --mask $l $p >mask.json
    vkt stats $v --per z $p >z.json
    vkt read $v | vkt stats --labels <(vkt read $l) $p $little 2>err | cmp - labels.json
    [ "$(grep -c spooling err)" -eq 2 ]
    vkt read $v | vkt stats --mask <(vkt read $l) $p $little 2>err | cmp - mask.json
    [ "$(grep -c spooling err)" -eq 2 ]
    vkt read $v | vkt stats --per z $p $little -q | cmp - z.json
    vkt stats $v --per x --percentiles 1,50,99.9 --csv --memory 1G >x.csv
    vkt stats $v --per x --percentiles 1,50,99.9 --csv $little | cmp - x.csv
    check '
import csv
v = np.fromfile("v_170x160x130_float32.raw", "f4").reshape(130, 160, 170); l = np.fromfile("l_170x160x130_uint8.raw", "u1").reshape(v.shape)
def same(row, w):
    for p, q in zip((1, 50, 99.9), np.percentile(w.astype("f8"), (1, 50, 99.9))): assert abs(float(row["p%g" % p]) - q) <= 1e-15 * abs(q), (p, q, row)
for r in json.load(open("labels.json"))["labels"]: same(r, v[l == r["label"]])
same(json.load(open("mask.json")), v[l != 0])
for r in json.load(open("z.json"))["slices"]: same(r, v[r["z"]])
for r in csv.DictReader(open("x.csv")): same(r, v[:, :, int(r["x"])])'
    # Physical values; a group of NaN only; as text; labels far apart.
    check '
v = np.array([[1, 2, 3, 50], [5, 6, 7, 8], [9, 1, 1, 1]], "f4"); v.tofile("t_4x3x1_float32.raw"); v[1] = np.nan; v.tofile("n_4x3x1_float32.raw")
np.array([[-2**62, -2**62, 7, 7], [0, 0, 2**62, 2**62], [7, 7, 7, 7]], "i8").tofile("far_4x3x1_int64.raw")'
    vkt set t_4x3x1_float32.raw --slope -2 --intercept 7 | vkt stats --per y --percentiles 0,100,25 --json >map.json
    vkt stats n_4x3x1_float32.raw --per y --percentiles 50 --json >nan.json
    vkt stats t_4x3x1_float32.raw --labels far_4x3x1_int64.raw --percentiles 50 --json >far.json
    vkt stats n_4x3x1_float32.raw --per y --percentiles 50,0.5 >table
    check 'rows = json.load(open("map.json"))["slices"]
for r, v in zip(rows, [[1, 2, 3, 50], [5, 6, 7, 8], [9, 1, 1, 1]]):
    assert [r["p0"], r["p100"], r["p25"]] == np.percentile(7 - 2.0 * np.array(v), (0, 100, 25)).tolist(), r
assert [r["p50"] for r in json.load(open("nan.json"))["slices"]] == [2.5, None, 1]
assert [(r["label"], r["p50"]) for r in json.load(open("far.json"))["labels"]] == [(-2**62, 1.5), (0, 5.5), (7, 2), (2**62, 7.5)]
lines = [x.split() for x in open("table").read().splitlines()]
assert lines[0][-2:] == ["p50", "p0.5"] and [x[-2] for x in lines[1:]] == ["2.5", "nan", "1"], lines'
    vkt make constant --dims 4 3 1 --value 0 -o zero.vkt
    vkt stats t_4x3x1_float32.raw --mask zero.vkt --percentiles 50 --json | tr -d ' \n' | grep -q '"count":0.*"p50":null'
}

@test "percentiles of very many groups take little, or are refused" {
    python_with numpy
    check '
r = np.random.default_rng(8)
r.integers(0, 2**63, (40, 60, 120)).astype("u8").tofile("v_120x60x40_uint64.raw")
(np.arange(288000) // 9).astype("u4").tofile("l_120x60x40_uint32.raw")' # 32000 groups of nine
    vkt stats v_120x60x40_uint64.raw --labels l_120x60x40_uint32.raw --percentiles 0,50,100 --memory 512M --json >p.json
    vkt stats v_120x60x40_uint64.raw --labels l_120x60x40_uint32.raw --percentiles 0,50,100 --memory 256M --json | cmp - p.json
    check 'rows = json.load(open("p.json"))["labels"]; s = np.sort(np.fromfile("v_120x60x40_uint64.raw", "u8").reshape(-1, 9))
assert [[r["p0"], r["p50"], r["p100"]] for r in rows] == s[:, [0, 4, 8]].tolist()'
    fails_with 5 'labels are more than --memory has room for' \
        vkt stats v_120x60x40_uint64.raw --labels l_120x60x40_uint32.raw --percentiles 50 --memory 64M
    # Of 300 slices half of 4 MiB has room, but not for twenty per cents of each.
    vkt make noise --dims 300 200 30 --dtype uint64 -o w.nrrd
    vkt stats w.nrrd --per x --memory 4M --csv >/dev/null
    fails_with 5 'more than --memory has room for' vkt stats w.nrrd --per x --percentiles "$(seq -s , 0 5 100)" --memory 4M
}

@test "partial statistics add up to those of the whole" {
    grouped_volumes
    for dtype in uint8 int16 uint32 int64 float16 float32 float64; do
        v=v_31x23x19_$dtype.raw
        for options in '' '--labels labels_31x23x19_uint16.raw' '--mask mask_31x23x19_float32.raw' '--per x'; do
            vkt stats $v $options --json >whole
            n=0
            for z in 0:3 3:4 4:19; do
                vkt stats $v $options --roi :,:,$z --mergeable >part$n
                n=$((n + 1))
            done
            vkt stats --merge part0 part1 part2 --json >sum
            # Merging in two steps changes nothing.
            vkt stats --merge part0 part1 --mergeable >first
            vkt stats --merge first part2 --json | cmp - sum
            check "
def flat(o): return [x for r in (o.get('labels') or o.get('slices') or [o]) for x in r.items()]
a, b = flat(json.load(open('whole'))), flat(json.load(open('sum')))
assert len(a) == len(b) > 10
for (k, x), (l, y) in zip(a, b):
    exact = k not in ('mean', 'variance', 'stddev', 'product', 'product_log') and not ('$dtype'[0] == 'f' and k == 'sum')
    assert k == l and (x == y if exact or x is None or isinstance(x, list) else abs(x - y) <= 1e-12 * abs(x)), (k, x, y, '$dtype', '$options')
    if '$dtype' in ('uint8', 'int16', 'uint32') and k in ('mean', 'variance', 'stddev'): assert x == y"
        done
    done
    fails_with 3 "of different volumes: float64 and uint8" vkt stats --merge part0 <(vkt stats v_31x23x19_uint8.raw --per x --mergeable)
    fails_with 3 "of different things" vkt stats --merge part0 <(vkt stats v_31x23x19_float64.raw --mergeable)
    fails_with 3 "is no partial statistics" vkt stats --merge sum
    fails_with 3 "is no partial statistics" vkt stats --merge v_31x23x19_uint8.raw
    fails_with 2 "cannot be joined" vkt stats v_31x23x19_uint8.raw --percentiles 5 --mergeable
}

@test "several files have names, tables and CSV have columns, and what does not go together is refused" {
    grouped_volumes
    cp v_31x23x19_uint8.raw 'a,b_31x23x19_uint8.raw'
    vkt stats v_31x23x19_uint8.raw v_31x23x19_float32.raw 'a,b_31x23x19_uint8.raw' --json >several
    vkt stats v_31x23x19_uint8.raw v_31x23x19_float32.raw 'a,b_31x23x19_uint8.raw' --csv >several.csv
    vkt stats v_31x23x19_uint8.raw v_31x23x19_float32.raw >text
    [ "$(grep -c '^name ' text)" -eq 2 ]
    vkt stats v_31x23x19_float32.raw --json >one
    vkt stats v_31x23x19_float32.raw --labels labels_31x23x19_uint16.raw >table
    vkt stats v_31x23x19_float32.raw --labels labels_31x23x19_uint16.raw --csv >labels.csv
    vkt stats v_31x23x19_float32.raw --labels labels_31x23x19_uint16.raw --json >labels.json
    check '
import csv
s, one = json.load(open("several")), json.load(open("one"))
assert [r.pop("name") for r in s] == ["v_31x23x19_uint8.raw", "v_31x23x19_float32.raw", "a,b_31x23x19_uint8.raw"] and s[1] == one and s[0] == s[2]
rows = list(csv.DictReader(open("several.csv")))
assert [r["name"] for r in rows] == ["v_31x23x19_uint8.raw", "v_31x23x19_float32.raw", "a,b_31x23x19_uint8.raw"]
assert float(rows[1]["mean"]) == one["mean"] and int(rows[1]["argmin_y"]) == one["argmin"][1]
rows, want = list(csv.DictReader(open("labels.csv"))), json.load(open("labels.json"))["labels"]
assert [(int(r["label"]), float(r["mean"]), int(r["count"])) for r in rows] == [(r["label"], r["mean"], r["count"]) for r in want]
lines = open("table").read().splitlines()
assert lines[0].split()[:3] == ["label", "count", "nan"] and len(lines) == 10'
    fails_with 2 "--mask has 4 1 1 voxels" vkt stats v_31x23x19_uint8.raw --mask <(vkt make ramp --dims 4 1 1)
    fails_with 2 "labels are integers, these are float32" vkt stats v_31x23x19_uint8.raw --labels mask_31x23x19_float32.raw
    fails_with 2 "give one" vkt stats v_31x23x19_uint8.raw --labels labels_31x23x19_uint16.raw --per z
    fails_with 2 "not one of x, y, z" vkt stats v_31x23x19_uint8.raw --per w
    fails_with 2 "cannot be joined" vkt stats v_31x23x19_uint8.raw --percentiles 5 --per z --mergeable
    fails_with 2 "go with one input" vkt stats v_31x23x19_uint8.raw v_31x23x19_uint8.raw --mask mask_31x23x19_float32.raw
    fails_with 2 "hierarchical" bash -c 'vkt make amr --blocks 20 --levels 2 | vkt stats --per z'
    fails_with 5 "labels are more than --memory" vkt stats v_31x23x19_float64.raw --labels v_31x23x19_uint32.raw --memory 1M
    # A mask of nothing.
    vkt make constant --dims 31 23 19 --value 0 -o zero.vkt
    vkt stats v_31x23x19_uint8.raw --mask zero.vkt --json >empty
    check 's = json.load(open("empty")); assert s["count"] == 0 and s["mean"] is None and s["product"] is None'
    vkt stats v_31x23x19_uint8.raw --mask zero.vkt --labels labels_31x23x19_uint16.raw --json | tr -d ' \n' | grep -q '"labels":\[\]'
}

@test "masks and labels lie where the volume does, in whatever frame" {
    vkt make ramp --dims 4 3 2 --dtype uint8 --spacing 1,2,3 --origin 1,2,3 -o v.nrrd
    vkt set v.nrrd --attribute space=right-anterior-superior -o ras.nrrd
    vkt set v.nrrd --attribute space=left-posterior-superior -o lps.nrrd
    vkt set v.nrrd --origin 1,2,4 -o moved.nrrd
    vkt write ras.nrrd ras.mha # left-posterior-superior, and the same place
    for option in --mask --labels; do
        fails_with 2 "$option lies at another place" vkt stats v.nrrd $option moved.nrrd
        fails_with 2 "$option lies at another place" vkt stats ras.nrrd $option lps.nrrd
        fails_with 2 "the frame of one volume is right-anterior-superior" vkt stats ras.nrrd $option v.nrrd
        [ "$(vkt stats ras.nrrd $option ras.mha --json)" = "$(vkt stats ras.nrrd $option ras.nrrd --json)" ]
    done
}

@test "a product of 0 has no sign" {
    vkt make ramp --dims 4 4 4 | vkt transform 'x == 0 ? 0 : x == 1 and y == 0 and z == 0 ? 0 - 3 : 2' --dtype int8 -o v.nrrd
    vkt stats v.nrrd --json | tr -d ' ' | grep -q '"product":0[,.]'
}

@test "one mask goes with each volume of a series, several one by one; too many or too few are refused" {
    vkt make ramp --dims 6 5 4 -o a.nrrd
    vkt arith mul a.nrrd 3 -o b.nrrd
    for name in a b; do vkt threshold $name.nrrd --above 2 -o m$name.nrrd; done
    vkt stack a.nrrd b.nrrd -o two.vkt
    vkt stack ma.nrrd mb.nrrd -o masks.vkt
    vkt stack ma.nrrd mb.nrrd ma.nrrd -o three.vkt
    alone() { vkt stats "$1.nrrd" --mask "$2.nrrd" --csv; }
    vkt stats two.vkt --mask ma.nrrd --csv | cmp - <(alone a ma && alone b ma | tail -n 1)
    vkt stats two.vkt --mask masks.vkt --csv | cmp - <(alone a ma && alone b mb | tail -n 1)
    vkt stats two.vkt --labels ma.nrrd --csv | cmp - <(vkt stats two.vkt --labels <(vkt stack ma.nrrd ma.nrrd) --csv)
    fails_with 3 "more volumes than the input" vkt stats a.nrrd --mask masks.vkt
    fails_with 3 "more volumes than the input" vkt stats two.vkt --labels three.vkt
    fails_with 3 "fewer volumes than the input" vkt stats three.vkt --mask masks.vkt
    fails_with 3 "fewer volumes than the input" vkt stats two.vkt --mask <(vkt read ma.nrrd)
}

@test "a whole axis of a tree that was cropped is what is left of it" {
    vkt make amr --blocks 200 | vkt crop --roi 10:100,20:90,0:200 -o part.vkt
    left=$(vkt stats part.vkt --json)
    [ "$(vkt stats part.vkt --roi :,:,: --json)" = "$left" ]
    [ "$(vkt stats part.vkt --roi 10:100,20:90,0:200 --json)" = "$left" ]
    [ "$(vkt stats part.vkt --roi 10:100,:,30:70 --json)" = "$(vkt stats part.vkt --roi :,20:90,30:70 --json)" ]
}

@test "steps in a region: stats, histogram and diff look at every n-th voxel, as behind crop, and name its place in the whole" {
    python_with numpy
    for dtype in uint8 int16 float32; do
        vkt make noise --dims 23 17 11 --dtype $dtype --seed 3 | vkt set --spacing 0.5,1,2 --origin 1,2,3 -o v_$dtype.nrrd
        vkt make noise --dims 23 17 11 --dtype $dtype --seed 4 | vkt set --spacing 0.5,1,2 --origin 1,2,3 -o w_$dtype.nrrd
    done
    vkt transform 'floor(v / 40)' v_uint8.nrrd --dtype uint8 -o labels.nrrd
    vkt threshold v_uint8.nrrd --otsu -o mask.nrrd
    /usr/bin/python3 - <<'END'
import json, subprocess, numpy as np
def told(line): return json.loads(subprocess.run(line, shell=True, capture_output=True, check=False).stdout)
def box(roi): return tuple(slice(*(int(n) if n else None for n in part.split(":"))) for part in reversed(roi.split(",")))
for dtype in ("uint8", "int16", "float32"):
    v = f"v_{dtype}.nrrd"
    a, b = (np.frombuffer(subprocess.check_output(f"vkt write {n}_{dtype}.nrrd - --format raw -q", shell=True), dtype).reshape(11, 17, 23) for n in "vw")
    for roi in ("::2,::2,::2", "3::5,2:15,1::3", ":,:,4::6", "1:2,::16,:"):
        part = a[box(roi)].astype("f8")
        got = told(f"vkt stats {v} --roi {roi} --percentiles 5,50 --json")
        want = told(f"vkt crop {v} --roi {roi} | vkt stats --percentiles 5,50 --json")
        places = {key: (got.pop(key), want.pop(key)) for key in ("argmin", "argmax")}
        assert got == want, (dtype, roi, got, want)
        assert got["count"] == part.size and got["min"] == part.min() and np.isclose(got["mean"], part.mean())
        for key, extreme in (("argmin", part.min()), ("argmax", part.max())):
            x, y, z = places[key][0]
            assert a[z, y, x] == extreme and (z, y, x) in {tuple(i) for i in np.argwhere(np.isin(np.arange(a.size).reshape(a.shape), np.arange(a.size).reshape(a.shape)[box(roi)]))}, (roi, key)
        assert told(f"vkt read {v} | vkt stats --roi {roi} --percentiles 5,50 --json --slab 1 --threads 2")["mean"] == got["mean"]
        for range in ("minmax", "p5:p95", "0:1"):
            assert told(f"vkt histogram {v} --roi {roi} --range {range} --json") == told(f"vkt crop {v} --roi {roi} | vkt histogram --range {range} --json"), (roi, range)
        w = f"w_{dtype}.nrrd"
        for options in ("", "--mutual-information", "--ssim"):
            got = told(f"vkt diff {v} {w} --roi {roi} {options} --json")
            want = told(f"vkt diff <(vkt crop {v} --roi {roi}) <(vkt crop {w} --roi {roi}) {options} --json".join(("bash -c '", "'")))
            first = got.pop("first", None); want.pop("first", None)
            assert got == want, (roi, options, got, want)
            differs = (a != b)[box(roi)]
            assert got["differing"] == differs.sum()
            if first: assert first == [sl.indices(n)[0] + i * sl.indices(n)[2] for sl, n, i in zip(reversed(box(roi)), a.shape[::-1], np.argwhere(differs)[0][::-1])], first
        # Rows, masks and parts that are joined.
        for axis in "xyz":
            rows = told(f"vkt stats {v} --roi {roi} --per {axis} --json")["slices"]
            along = {"x": 2, "y": 1, "z": 0}[axis]
            assert [r[axis] for r in rows] == list(range_ for range_ in np.arange(a.shape[along])[box(roi)[along]]), (roi, axis)
            assert np.allclose([r["mean"] for r in rows], part.mean(tuple(i for i in (0, 1, 2) if i != along)))
        masked = told(f"vkt stats {v} --roi {roi} --mask mask.nrrd --labels labels.nrrd --json")
        want = told(f"bash -c 'vkt stats <(vkt crop {v} --roi {roi}) --mask <(vkt crop mask.nrrd --roi {roi}) --labels <(vkt crop labels.nrrd --roi {roi}) --json'")
        strip = lambda report: [{k: x for k, x in row.items() if not k.startswith("arg")} for row in report["labels"]]
        assert strip(masked) == strip(want), (masked, want)
    subprocess.check_call(f"vkt stats {v} --roi ::2,:,0:5 --mergeable --json >a.json && vkt stats {v} --roi ::2,:,5: --mergeable --json >b.json", shell=True)
    joined, whole = told("vkt stats --merge a.json b.json --json"), told(f"vkt stats {v} --roi ::2,:,: --json")
    assert joined["argmin"] == whole["argmin"] and joined["argmax"] == whole["argmax"] and joined["count"] == whole["count"], (joined, whole)
END
}

@test "regions with steps along z are read from compressed files and pipes as from files" {
    vkt make noise --dims 90 100 80 --dtype uint16 -o plain.nrrd
    vkt convert plain.nrrd -o packed.nrrd --compress
    for slab in 1 2 3; do
        for step in 5 7 11; do
            vkt stats plain.nrrd --roi :,:,::$step --json >want
            for again in 1 2; do vkt stats packed.nrrd --slab $slab --roi :,:,::$step --json | cmp - want; done
            cat plain.nrrd | vkt stats - --slab $slab --roi :,:,::$step --json | cmp - want
            vkt diff plain.nrrd packed.nrrd --slab $slab --roi :,:,::$step >/dev/null
        done
    done
}
