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
        vkt stats p.vkt --json | diff - <(grep -v '"p[0-9.]*":' p.json | sed 's/\("stddev": .*\),$/\1/')
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
    fails_with 2 "not a number" vkt stats m.nrrd --percentiles 1,,2
}
