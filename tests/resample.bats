# vkt resample: cell-centred grids, exact averages, SciPy and NumPy as oracles.
load helper

setup_more() {
    vkt make noise --dims 23 17 11 --seed 3 -o noise.vkt
    vkt make noise --dims 24 18 12 --dtype uint16 --seed 4 -o labels.vkt
}

# check PYTHON: runs it with raw(name, dtype, dims as z y x) defined.
check() {
    python_with numpy scipy
    /usr/bin/python3 - <<PY
import numpy as np, scipy.ndimage as nd
def raw(name, dtype, dims): return np.fromfile(name, dtype).reshape(dims)
def edges(n_in, n_out): return np.arange(n_out + 1) * n_in / n_out
def area(v, axis, n_out):
    v = np.moveaxis(v, axis, -1); n = v.shape[-1]; e = edges(n, n_out)
    c = np.concatenate([np.zeros(v.shape[:-1] + (1,)), np.cumsum(v, -1)], -1)
    i = np.minimum(e.astype(int), n - 1); at = c[..., i] + (e - i) * v[..., i]
    return np.moveaxis(np.diff(at, axis=-1) * n_out / n, -1, axis)
$1
PY
}
raw() { vkt write - --format raw; }

@test "a ramp is resampled at cell centres" {
    vkt make ramp --dims 4 1 1 | vkt resample --dims 8 1 1 | raw >up
    vkt make ramp --dims 8 1 1 | vkt resample --dims 4 1 1 | raw >down
    check 'assert raw("up", "f4", 8).tolist() == [0, .25, .75, 1.25, 1.75, 2.25, 2.75, 3]
assert raw("down", "f4", 4).tolist() == [.5, 2.5, 4.5, 6.5]'
}

@test "averages of bytes round half to even" {
    vkt make ramp --dims 8 1 1 --dtype uint8 | vkt resample --dims 4 1 1 | raw >down
    check 'assert raw("down", "u1", 4).tolist() == [0, 2, 4, 6]'
}

@test "linear agrees with scipy's map_coordinates" {
    vkt resample noise.vkt --dims 31 40 29 --method linear | raw >up
    vkt resample noise.vkt --dims 13 9 29 --method linear --boundary mirror | raw >down
    vkt read noise.vkt | raw >in
    check 'v = raw("in", "f4", (11, 17, 23)).astype(float)
for name, dims in (("up", (29, 40, 31)), ("down", (29, 9, 13))):
    at = np.meshgrid(*[(np.arange(m) + .5) * n / m - .5 for n, m in zip(v.shape, dims)], indexing="ij")
    want = nd.map_coordinates(v, at, order=1, mode="nearest")
    assert abs(raw(name, "f4", dims) - want).max() < 1e-6, name'
}

@test "a change of the type alone is exact, and plans say what is not" {
    vkt make constant --dims 4 4 2 --dtype int64 | vkt fill --value 9007199254740993 -o wide.vkt
    vkt resample wide.vkt --dtype uint64 | vkt stats --json | grep -q '"min": 9007199254740993,'
    fails_with 3 'clipped to' vkt resample wide.vkt --dtype int32 --strict -o less.vkt
    vkt make ramp --dims 64 40 20 --dtype uint8 -o bytes.vkt
    vkt resample bytes.vkt --scale 1.3 --explain -o out.vkt 2>&1 | grep -q ' exact,'
    vkt resample wide.vkt --dtype uint64 --explain -o out.vkt --force 2>&1 | grep -q ' exact,'
    vkt resample wide.vkt --scale 0.5 --explain -o out.vkt --force 2>&1 | grep -q ' exact,'
    vkt resample wide.vkt --scale 0.7 --explain -o out.vkt --force 2>&1 | grep -q ' exact,'
    vkt resample wide.vkt --scale 0.7 --method cubic --explain -o out.vkt --force 2>&1 | grep -q 'error at most .* of the largest magnitude (.* in values)'
    vkt resample bytes.vkt --voxel-mapping 0 3 --explain -o out.vkt --force 2>&1 | grep -q 'error at most .* of the largest magnitude (.* in values)'
}

@test "64-bit integers are averaged and interpolated as exact arithmetic does, and keep their range" {
    python_with numpy
    /usr/bin/python3 -c 'import numpy as np
r = np.random.default_rng(2)
(1700000000000000000 + r.integers(0, 1001, (5, 6, 8))).astype("i8").tofile("near_8x6x5_int64.raw")
r.integers(-2**63, 2**63 - 1, (5, 6, 8), "i8", endpoint=True).tofile("all_8x6x5_int64.raw")
r.integers(0, 2**64 - 1, (5, 6, 8), "u8", endpoint=True).tofile("all_8x6x5_uint64.raw")'
    for file in near_8x6x5_int64 all_8x6x5_int64 all_8x6x5_uint64; do
        vkt resample $file.raw --dims 3 4 2 --explain 2>plan | raw >down.$file
        grep -q ' exact,' plan
        vkt resample $file.raw --dims 11 9 2 --slab 1 --threads 2 | raw >mixed.$file
        vkt resample $file.raw --dims 12 6 5 --boundary border:1700000000000000512 | raw >border.$file
    done
    check 'from fractions import Fraction as F
import math
def axis_weights(n, m, border):
    for o in range(m):
        if m < n: yield {i: max(F(0), min(F((o + 1) * n, m), i + 1) - max(F(o * n, m), i)) * F(m, n) for i in range(n)}
        elif m == n: yield {o: F(1)}
        else:
            p = F((2 * o + 1) * n, 2 * m) - F(1, 2); k = math.floor(p); w = {}
            for i, f in ((k, 1 - (p - k)), (k + 1, p - k)):
                at = i if 0 <= i < n else None if border is not None else min(max(i, 0), n - 1)
                w[at] = w.get(at, 0) + f
            yield w
def want(v, dims, border=None):
    v = v.astype(object)
    for axis, m in enumerate(dims):
        v = np.moveaxis(v, axis, 0); n = len(v)
        v = np.stack([sum(f * (border if i is None else v[i]) for i, f in w.items() if f) for w in axis_weights(n, m, border)])
        v = np.moveaxis(v, 0, axis)
    return v
for name, t in (("near_8x6x5_int64", "i8"), ("all_8x6x5_int64", "i8"), ("all_8x6x5_uint64", "u8")):
    v = raw(name + ".raw", t, (5, 6, 8))
    for out, dims, border in (("down", (2, 4, 3), None), ("mixed", (2, 9, 11), None), ("border", (5, 6, 12), 1700000000000000512)):
        w = want(v, dims, border); got = raw(f"{out}.{name}", t, dims)
        assert all(int(g) == round(x) for g, x in zip(got.flat, w.flat)), (name, out)
        if border is None: assert got.min() >= v.min() and got.max() <= v.max()'
}

@test "the stated bound holds for data with an offset, of any type and method" {
    python_with numpy
    /usr/bin/python3 -c 'import numpy as np
r = np.random.default_rng(3).random((9, 10, 14))
(1e6 + r).astype("f4").tofile("a_14x10x9_float32.raw"); (1e9 + r).tofile("b_14x10x9_float64.raw")
(1000 + r).astype("f2").tofile("c_14x10x9_float16.raw"); (r * 2**32).astype("u4").tofile("d_14x10x9_uint32.raw")'
    local file args
    for file in a_14x10x9_float32 b_14x10x9_float64 c_14x10x9_float16 d_14x10x9_uint32; do
        for args in "7 5 9 area" "9 10 4 area" "21 13 9 linear" "5 7 30 cubic" "21 13 30 cubic"; do
            set -- $args
            vkt resample $file.raw --dims $1 $2 $3 --method $4 --explain 2>plan | vkt convert --dtype float64 | raw >out
            check 'import re, pathlib
text = pathlib.Path("plan").read_text(); name = "'$file'"; dims = ('$3', '$2', '$1'); method = "'$4'"
share = 0 if " exact," in text else float(re.search(r"at most (\S+) of the largest magnitude", text)[1])
v = raw(name + ".raw", {"float32": "f4", "float64": "f8", "float16": "f2", "uint32": "u4"}[name.split("_")[-1]], (9, 10, 14)).astype(np.longdouble)
def k(t):
    t = abs(t); return np.where(t < 1, 1.5*t**3 - 2.5*t**2 + 1, np.where(t < 2, -.5*t**3 + 2.5*t**2 - 4*t + 2, 0))
def matrix(n, m):
    o = np.arange(m, dtype=np.longdouble)[:, None]; i = np.arange(n, dtype=np.longdouble)[None]
    if n == m: return np.eye(n, dtype=np.longdouble)
    if method == "area": return np.maximum(0, np.minimum((o + 1) * n / m, i + 1) - np.maximum(o * n / m, i)) * m / n
    j = np.arange(-8 * n, 9 * n, dtype=np.longdouble)[None]; p = (o + .5) * n / m - .5; s = max(np.longdouble(1), np.longdouble(n) / m)
    w = np.maximum(0, 1 - abs(p - j)) if method == "linear" else k((p - j) / s)
    w = w / w.sum(1, keepdims=True); at = np.clip(j[0], 0, n - 1).astype(int); out = np.zeros((m, n), np.longdouble)
    for c, a in enumerate(at): out[:, a] += w[:, c]
    return out
want = np.einsum("zc,yb,xa,cba->zyx", *[matrix(n, m) for n, m in zip(v.shape, dims)], v)
error = abs(raw("out", "f8", dims).astype(np.longdouble) - want).max()
step = .5 + 1e-6 if "uint" in name and method != "cubic" else 0
assert error <= share * v.max() + step, (name, method, dims, float(error), float(share * v.max()))'
        done
    done
}

@test "the largest floats do not overflow" {
    python_with numpy
    /usr/bin/python3 -c 'import numpy as np
r = np.random.default_rng(4); most = np.finfo("f8").max
((r.random((6, 7, 9)) * 2 - 1) * 1e306).tofile("large_9x7x6_float64.raw")
np.full((6, 7, 9), most).tofile("most_9x7x6_float64.raw"); np.where(r.random((6, 7, 9)) < .5, -most, most).tofile("both_9x7x6_float64.raw")'
    for dims in "4 3 2" "13 9 11" "5 9 1"; do
        for method in linear area cubic; do
            for file in large_9x7x6_float64 most_9x7x6_float64; do
                vkt resample $file.raw --dims $dims --method $method | raw >$file.$method.${dims// /_}
            done
        done
        vkt resample both_9x7x6_float64.raw --dims $dims --method linear | raw >both.${dims// /_}
        vkt arith mul large_9x7x6_float64.raw 1e-300 | vkt resample --dims $dims --method cubic | raw >small.${dims// /_}
    done
    check 'for dims in ("4_3_2", "13_9_11", "5_9_1"):
    for method in ("linear", "area", "cubic"):
        most = raw(f"most_9x7x6_float64.{method}.{dims}", "f8", -1)
        assert np.isfinite(most).all() and (most / np.finfo("f8").max > 1 - 1e-14).all()
        assert np.isfinite(raw(f"large_9x7x6_float64.{method}.{dims}", "f8", -1)).all()
    assert np.isfinite(raw(f"both.{dims}", "f8", -1)).all()
    want = raw(f"small.{dims}", "f8", -1); got = raw(f"large_9x7x6_float64.cubic.{dims}", "f8", -1) * 1e-300
    assert abs(got - want).max() < 1e-8'
}

@test "borders: wrap and a constant agree with scipy" {
    vkt resample noise.vkt --dims 46 34 22 --boundary wrap | raw >wrap
    vkt resample noise.vkt --dims 46 34 22 --boundary border:2 | raw >two
    vkt read noise.vkt | raw >in
    check 'v = raw("in", "f4", (11, 17, 23)).astype(float)
dims = (22, 34, 46)
at = np.array(np.meshgrid(*[(np.arange(m) + .5) * n / m - .5 + 1 for n, m in zip(v.shape, dims)], indexing="ij"))
for name, padded in (("wrap", np.pad(v, 1, "wrap")), ("two", np.pad(v, 1, constant_values=2))):
    want = nd.map_coordinates(padded, at, order=1)
    assert abs(raw(name, "f4", dims) - want).max() < 1e-6, name'
}

@test "a border value is not rounded to the type of the volume, nor clipped unless the result is" {
    vkt make constant --dims 4 3 2 --dtype uint8 --value 100 -o c.vkt
    vkt resample c.vkt --dims 8 3 2 --boundary border:-100 --strict | raw >far
    vkt resample c.vkt --dims 8 3 2 --boundary border:0.5 --dtype float64 | raw >half
    vkt resample c.vkt --dims 8 6 4 --boundary border:-100.5 --method cubic --dtype float32 | raw >cubic
    vkt set c.vkt --slope 0.5 --intercept 1 | vkt resample --dims 8 3 2 --boundary border:-49 --strict | raw >mapped
    fails_with 3 'clipped to [0,255]' vkt resample c.vkt --dims 8 6 4 --boundary border:-1000 --strict -o out.vkt
    vkt resample labels.vkt --dims 46 34 22 --method linear --boundary border:-7.5 --slab 100 --threads 1 | raw >whole
    vkt resample labels.vkt --dims 46 34 22 --method linear --boundary border:-7.5 --slab 3 --threads 2 | raw | cmp - whole
    check 'assert raw("far", "u1", (2, 3, 8))[0, 0].tolist() == [50, 100, 100, 100, 100, 100, 100, 50]
assert (raw("mapped", "u1", (2, 3, 8)) == raw("far", "u1", (2, 3, 8))).all()
assert raw("half", "f8", (2, 3, 8))[1, 2, [0, 1, 7]].tolist() == [75.125, 100, 75.125]
v = np.pad(np.full((2, 3, 4), 100.), 3, constant_values=-100.5)
def k(t):
    t = abs(t); return np.where(t < 1, 1.5*t**3 - 2.5*t**2 + 1, np.where(t < 2, -.5*t**3 + 2.5*t**2 - 4*t + 2, 0))
def m(n): return k((np.arange(2 * n)[:, None] + .5) / 2 - .5 + 3 - np.arange(n + 6)[None])
want = np.einsum("zc,yb,xa,cba->zyx", m(2), m(3), m(4), v)
assert abs(raw("cubic", "f4", (4, 6, 8)) - want).max() < 1e-4'
}

@test "area agrees with exact averages at any ratio" {
    vkt resample noise.vkt --dims 7 17 5 | raw >out
    vkt read noise.vkt | raw >in
    check 'v = raw("in", "f4", (11, 17, 23)).astype(float)
want = area(area(v, 2, 7), 0, 5)
got = raw("out", "f4", (5, 17, 7))
assert abs(got - want).max() < 1e-6
assert abs(got.mean(dtype=float) - v.mean()) < 1e-7'
}

@test "integer averages are rounded correctly, whole and fractional ratios" {
    for dims in "12 9 6" "8 6 4" "12 18 12" "10 7 5"; do
        vkt resample labels.vkt --dims $dims | raw >out.${dims// /_}
    done
    vkt read labels.vkt | raw >in
    check 'from fractions import Fraction
v = raw("in", "u2", (12, 18, 24))
for x, y, z in ((12, 9, 6), (8, 6, 4), (12, 18, 12), (10, 7, 5)):
    want = area(area(area(v.astype(float), 2, x), 1, y), 0, z)
    got = raw(f"out.{x}_{y}_{z}", "u2", (z, y, x))
    tie = abs(want - np.floor(want) - .5) < 1e-6
    assert (got[~tie] == np.rint(want)[~tie]).all() and abs(got - want).max() <= .5 + 1e-6'
}

@test "cubic reproduces linear fields and agrees with the formula" {
    vkt make ramp --dims 16 5 5 --dtype float64 | vkt resample --dims 24 5 5 --method cubic | raw >up
    vkt resample noise.vkt --dims 46 17 11 --method cubic | raw >fine
    vkt read noise.vkt | raw >in
    check 'u = raw("up", "f8", (5, 5, 24)); x = (np.arange(24) + .5) * 16 / 24 - .5
assert abs(u - x)[..., 4:-4].max() < 1e-12
v = np.pad(raw("in", "f4", (11, 17, 23)).astype(float), ((0, 0), (0, 0), (2, 2)), "edge")
def k(t):
    t = abs(t); return np.where(t < 1, 1.5*t**3 - 2.5*t**2 + 1, np.where(t < 2, -.5*t**3 + 2.5*t**2 - 4*t + 2, 0))
p = (np.arange(46) + .5) / 2 - .5
want = sum(k(p - i)[None, None] * v[..., [i + 2]] for i in range(-2, 25))
assert abs(raw("fine", "f4", (11, 17, 46)) - want).max() < 1e-6'
}

@test "cubic makes floats of unsigned types, unless a type is asked for" {
    [ "$(vkt resample labels.vkt --dims 30 18 12 --method cubic | vkt info --json | grep -o float32)" = float32 ]
    vkt make checkerboard --dims 8 8 8 --period 4 --dtype uint8 | vkt resample --dims 16 16 16 --method cubic --dtype uint8 2>remark >c.vkt
    grep -q 'clipped to \[0,255\]' remark
    vkt stats c.vkt --json | grep -q '"max": 255'
}

@test "nearest takes labels from the input only" {
    vkt resample labels.vkt --dims 33 7 12 --method nearest | raw >out
    vkt read labels.vkt | raw >in
    check 'v = raw("in", "u2", (12, 18, 24))
i = [((2 * np.arange(m) + 1) * n) // (2 * m) for n, m in zip(v.shape, (12, 7, 33))]
assert (raw("out", "u2", (12, 7, 33)) == v[np.ix_(*i)]).all()'
}

@test "constants stay what they are" {
    for dtype in uint8:255 uint16:65535 int16:-32768 float32:0.1 float16:0.1; do
        for method in nearest linear area cubic; do
            for dims in "5 9 3" "17 3 12" "7 7 7" "4 4 4"; do
                vkt make constant --dims 7 7 7 --dtype ${dtype%:*} --value ${dtype#*:} -o c.vkt --force
                vkt resample c.vkt --dims $dims --method $method | vkt stats --json >stats
                vkt stats c.vkt --json >want
                [ "$(grep '"min"\|"max"' stats)" = "$(grep '"min"\|"max"' want)" ] ||
                    { echo "$dtype $method $dims: $(cat stats)" >&2; false; }
            done
        done
    done
}

@test "the same size is the same volume" {
    for method in nearest linear area cubic auto; do
        vkt resample noise.vkt --scale 1 --method $method | vkt diff noise.vkt
        vkt resample labels.vkt --scale 1 --method $method | vkt diff labels.vkt
    done
}

@test "to one voxel and from one voxel" {
    mean=$(vkt stats noise.vkt --json | grep '"mean"')
    vkt resample noise.vkt --dims 1 1 1 | vkt stats --json >one
    check 'import json; m = json.loads("{" + """'"$mean"'""".strip().rstrip(",") + "}")["mean"]
assert abs(json.load(open("one"))["mean"] - m) < 1e-6'
    vkt make constant --dims 1 1 5 --value 3 | vkt resample --dims 4 4 10 | vkt stats --json | grep -q '"max": 3'
}

@test "a checkerboard is averaged away when it shrinks" {
    vkt make checkerboard --dims 64 64 64 | vkt resample --dims 27 27 27 | vkt stats --json >s
    check 'import json; s = json.load(open("s")); assert s["max"] - s["min"] <= 0.2'
}

@test "a NaN stays in its neighbourhood" {
    python_with numpy
    /usr/bin/python3 -c 'import numpy as np; v = np.ones((6, 6, 6), "f4"); v[3, 3, 3] = np.nan; v.tofile("nan_6x6x6_float32.raw")'
    vkt read nan_6x6x6_float32.raw | vkt resample --dims 3 3 3 | vkt stats --json | grep -q '"nan": 1,'
    vkt read nan_6x6x6_float32.raw | vkt resample --dims 12 12 12 | vkt stats --json | grep -q '"nan": 64,'
    vkt read nan_6x6x6_float32.raw | vkt resample --dims 6 6 2 | vkt stats --json | grep -q '"nan": 1,'
}

@test "results do not depend on slabs, threads or instruction set" {
    for args in "--scale 0.5" "--dims 9 22 40" "--dims 9 22 5 --method cubic" "--dims 30 30 30 --method nearest" "--dims 9 22 5 --boundary wrap --method linear"; do
        for file in noise.vkt labels.vkt; do
            vkt resample $file $args --slab 100 --threads 1 | vkt write all.raw --force
            for cut in "--slab 1 --threads 2" "--slab 7 --threads 3"; do
                vkt resample $file $args $cut | vkt write cut.raw --force
                cmp all.raw cut.raw
            done
            for set in baseline avx2; do
                VKT_INSTRUCTION_SET=$set vkt resample $file $args | vkt write set.raw --force
                cmp all.raw set.raw
            done
        done
    done
}

@test "the extent in the world stays" {
    vkt make ramp --dims 10 20 30 --spacing 1,2,3 --origin 5,6,7 | vkt resample --dims 5 40 30 | vkt info --json >i
    check 'import json; i = json.load(open("i")); assert i["spacing"] == [2, 1, 3] and i["origin"] == [5.5, 5.5, 7], i'
}

@test "ways to say the size" {
    vkt make ramp --dims 10 20 30 --spacing 1,2,3 -o r.vkt
    dims() { vkt info --json | tr -d ' \n' | grep -o '"dims":\[[0-9,]*\]'; }
    [ "$(vkt resample r.vkt --scale 0.5 | dims)" = '"dims":[5,10,15]' ]
    [ "$(vkt resample r.vkt --scale 2,1,0.1 | dims)" = '"dims":[20,20,3]' ]
    [ "$(vkt resample r.vkt -dims 7 8 9 | dims)" = '"dims":[7,8,9]' ]
    [ "$(vkt resample r.vkt --dims 20,auto,auto | dims)" = '"dims":[20,40,60]' ]
    [ "$(vkt resample r.vkt --spacing 2 | dims)" = '"dims":[5,20,45]' ]
    vkt make ramp --dims 3 4 5 | vkt write like.nrrd
    [ "$(vkt resample r.vkt --like like.nrrd | dims)" = '"dims":[3,4,5]' ]
    vkt read like.nrrd -o like.vkt
    [ "$(vkt resample r.vkt --like like.vkt | dims)" = '"dims":[3,4,5]' ]
    [ "$(vkt resample r.vkt --like <(vkt read like.nrrd) | dims)" = '"dims":[3,4,5]' ]
    fails_with 3 'empty' vkt resample r.vkt --like /dev/null -o out.nrrd
}

@test "volkit's options" {
    vkt declare-sv --dims 8 8 8 --data-format uint8 | vkt arith add - 1 | vkt resample --data-format uint16 -dims 4 4 4 -vm 0 2 --dist 1 2 3 >v.vkt
    vkt stats v.vkt --json >s
    vkt info v.vkt --json >i
    check 'import json; s = json.load(open("s")); i = json.load(open("i"))
assert abs(s["max"] - 1) < 2e-5 and i["dtype"] == "uint16" and i["spacing"] == [1, 2, 3], (s, i)'
    [ "$(vkt resample noise.vkt -bpv 1 --dims 4 4 4 2>/dev/null | vkt info --json | grep -o uint8)" = uint8 ]
}

@test "requests that make no sense" {
    fails_with 2 "no new size" vkt resample noise.vkt
    fails_with 2 "--scale: 0" vkt resample noise.vkt --scale 0
    fails_with 2 "positive number of voxels" vkt resample noise.vkt --dims 0 1 1
    fails_with 2 "only one of" vkt resample noise.vkt --dims 1 1 1 --scale 2
    fails_with 2 "--boundary does not apply" vkt resample noise.vkt --scale 0.5 --method nearest --boundary wrap
    fails_with 2 "did you mean 'linear'" vkt resample noise.vkt --scale 2 --method linaer
    fails_with 2 "voxels along an axis" vkt resample noise.vkt --scale 1e300 -o never.vkt
}

# onto PYTHON: runs it with lattices, vkt, ITK and SciPy at hand.
onto() {
    python_with SimpleITK scipy
    /usr/bin/python3 - <<PY
import subprocess, numpy as np, scipy.ndimage as nd, SimpleITK as itk
random = np.random.default_rng(11)
def vkt(*words, code=0):
    done = subprocess.run(("vkt",) + words, capture_output=True, text=True, errors="replace")
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done
def turned(): return np.linalg.qr(random.normal(size=(3, 3)))[0]
def image(voxels, origin=(0, 0, 0), spacing=(1, 1, 1), direction=np.eye(3)):
    i = itk.GetImageFromArray(voxels)
    i.SetOrigin([float(v) for v in origin]); i.SetSpacing([float(v) for v in spacing])
    i.SetDirection([float(v) for v in np.asarray(direction).ravel()])
    return i
def noise(dims, kind=np.float32):
    values = random.uniform(-100, 100, dims[::-1])
    return (values if np.dtype(kind).kind == "f" else np.rint(abs(values))).astype(kind)
def read(name):
    i = itk.ReadImage(name)
    return itk.GetArrayFromImage(i), i
def place(i): return np.array(i.GetOrigin() + i.GetSpacing() + i.GetDirection())
def positions(ref, inp):
    "Index coordinates (x, y, z) in inp of every voxel of ref."
    d = lambda i: np.array(i.GetDirection()).reshape(3, 3) * np.array(i.GetSpacing())
    at = np.indices(ref.GetSize()[::-1])[::-1].reshape(3, -1)
    world = np.array(ref.GetOrigin())[:, None] + d(ref) @ at
    return np.linalg.solve(d(inp), world - np.array(inp.GetOrigin())[:, None])
def resample(inp, ref, *options, to="out.nrrd"):
    itk.WriteImage(inp, "in.nrrd"); itk.WriteImage(ref, "ref.nrrd")
    vkt("resample", "in.nrrd", "--like", "ref.nrrd", "-o", to, "--force", *options)
    got, out = read(to)
    assert out.GetSize() == ref.GetSize() and abs(place(out) - place(ref)).max() < 1e-12
    return got
def by_itk(inp, ref, how, background=0.0):
    wide = itk.Cast(inp, itk.sitkFloat64)
    return itk.GetArrayFromImage(itk.Resample(wide, ref, itk.Transform(), how, background))
# Grids around a volume of 17 x 13 x 11 voxels: shifted, flipped, finer, with axes in another order, oblique.
inp_origin, inp_spacing = (5, -3, 8), (0.7, 1.1, 1.6)
def centre(direction): return np.array(inp_origin) + direction @ (np.array(inp_spacing) * (8, 6, 5))
def lattices(direction):
    flip, order = np.diag((1, -1, -1)), np.eye(3)[[2, 0, 1]]
    for name, size, spacing, turn in (("shifted", (15, 14, 9), inp_spacing, np.eye(3)),
                                      ("flipped", (15, 14, 9), inp_spacing, flip),
                                      ("finer", (24, 23, 22), (0.6, 0.53, 0.81), np.eye(3)),
                                      ("permuted", (12, 20, 14), (0.9, 0.5, 0.8), order),
                                      ("oblique", (19, 18, 17), (0.6, 1.0, 1.4), turned()),
                                      ("slightly oblique", (17, 13, 11), inp_spacing,
                                       np.array(((np.cos(.1), -np.sin(.1), 0), (np.sin(.1), np.cos(.1), 0), (0, 0, 1))))):
        q = direction @ turn
        origin = centre(direction) + (0.31, 0.17, -0.23) - q @ (np.array(spacing) * (np.array(size) - 1) / 2)
        yield name, image(np.zeros(size[::-1], np.uint8), origin, spacing, q)
$1
PY
}

@test "onto another's grid: linear and nearest agree with ITK on every kind of grid" {
    onto '
for base in (np.eye(3), turned()):
    for kind in (np.float32, np.float64, np.uint8, np.int16):
        inp = image(noise((17, 13, 11), kind), inp_origin, inp_spacing, base)
        for name, ref in lattices(base):
            p = positions(ref, inp).reshape((3,) + ref.GetSize()[::-1])
            clear = np.ones(ref.GetSize()[::-1], bool)  # of faces, where rounding decides what is outside
            for a, n in enumerate((17, 13, 11)): clear &= (abs(p[a] + .5) > 1e-5) & (abs(p[a] - n + .5) > 1e-5)
            got = resample(inp, ref, "--method", "linear", "--background", "7")
            want = by_itk(inp, ref, itk.sitkLinear, 7)
            assert (want == 7).any() or name in ("finer", "permuted"), name
            if np.dtype(kind).kind == "f":
                assert abs(got - want)[clear].max() < (3e-5 if kind == np.float32 else 2e-6), (name, kind)
            else:  # ties of rounding
                assert (abs(got - want)[clear] <= 0.5 + 1e-6).all(), (name, kind)
            got = resample(inp, ref, "--method", "nearest", "--background", "7")
            tie = (abs(p - np.floor(p) - .5) < 1e-5).any(0)
            want = by_itk(inp, ref, itk.sitkNearestNeighbor, 7).astype(kind)
            assert (got == want)[clear & ~tie].all(), (name, kind)'
}

@test "onto another's grid: SciPy agrees with linear, and the definition with cubic" {
    onto '
def keys(t):
    t = abs(t); return np.where(t < 1, 1.5*t**3 - 2.5*t**2 + 1, np.where(t < 2, -.5*t**3 + 2.5*t**2 - 4*t + 2, 0))
base = turned()
v = noise((17, 13, 11), np.float64)
inp = image(v, inp_origin, inp_spacing, base)
for name, ref in lattices(base):
    p = positions(ref, inp)
    inside = np.all([(p[a] > -.5 + 1e-5) & (p[a] < n - .5 - 1e-5) for a, n in enumerate((17, 13, 11))], 0)
    got = resample(inp, ref, "--method", "linear").ravel()
    d = lambda i: np.array(i.GetDirection()).reshape(3, 3) * np.array(i.GetSpacing())
    m = np.linalg.solve(d(inp), d(ref))  # x, y, z
    t = np.linalg.solve(d(inp), np.array(ref.GetOrigin()) - inp.GetOrigin())
    want = nd.affine_transform(v, m[::-1, ::-1], t[::-1], ref.GetSize()[::-1], order=1, mode="nearest").ravel()
    assert abs(got - want)[inside].max() < 2e-6, name
    assert (got[np.any([(p[a] < -.5 - 1e-5) | (p[a] > n - .5 + 1e-5) for a, n in enumerate((17, 13, 11))], 0)] == 0).all()
    if name in ("permuted", "finer", "oblique", "slightly oblique", "shifted", "flipped") and max(np.linalg.norm(m, axis=0)) <= 1:
        got = resample(inp, ref, "--method", "cubic").ravel()
        w = np.floor(p); total = 0
        padded = np.pad(v, 3, "edge")
        for k in range(-1, 3):
            for j in range(-1, 3):
                for i in range(-1, 3):
                    at = [np.clip(w[a] + o + 3, 0, n + 5).astype(int) for a, (o, n) in enumerate(zip((i, j, k), (17, 13, 11)))]
                    total = total + keys(p[0]-w[0]-i) * keys(p[1]-w[1]-j) * keys(p[2]-w[2]-k) * padded[at[2], at[1], at[0]]
        assert abs(got - total)[inside].max() < 1e-5, name'
}

@test "onto another's grid: a smooth field agrees with ITK's B-spline" {
    onto '
z, y, x = np.indices((28, 30, 32))
inp = image(np.sin(x / 4.) * np.cos(y / 5.) + np.sin(z / 6. + 1), (0, 0, 0), (1, 1, 1), turned())
base = np.array(inp.GetDirection()).reshape(3, 3)
ref = image(np.zeros((15, 15, 15)), base @ np.array((8.2, 7.7, 6.9)), (0.9, 0.8, 0.7), base @ np.array(((np.cos(.2), -np.sin(.2), 0), (np.sin(.2), np.cos(.2), 0), (0, 0, 1))))
want = by_itk(inp, ref, itk.sitkBSpline)
assert abs(resample(inp, ref, "--method", "cubic") - want).max() < 3e-3
assert abs(resample(inp, ref, "--method", "linear") - want).max() > 1e-2'
}

@test "onto the same place every bit stays, whatever is asked and however it is said" {
    python_with numpy
    /usr/bin/python3 -c '
import numpy as np
bits = np.random.default_rng(3).integers(0, 256, 9 * 7 * 5 * 8, np.uint8)  # NaN payloads and all
bits.tofile("b_9x7x5_float64.raw"); bits.tofile("b_9x7x5_uint64.raw")'
    for type in float64 uint64; do
        vkt set b_9x7x5_$type.raw --origin 1,2,3 --spacing 0.1,0.3,7 --direction 0.6,0.8,0,-0.8,0.6,0,0,0,1 --attribute space=LPS -o b.nrrd --force
        vkt set b.nrrd --origin=-1,-2,3 --direction=-0.6,-0.8,0,0.8,-0.6,0,0,0,1 --attribute space=RAS -o ras.nrrd --force
        for method in auto nearest linear area cubic; do
            for like in b.nrrd ras.nrrd; do
                vkt resample b.nrrd --like $like --method $method | tee out.vkt | raw | cmp - b_9x7x5_$type.raw
                vkt diff --geometry out.vkt $like
            done
        done
        vkt info ras.nrrd | grep '^direction' >want
        vkt resample b.nrrd --like ras.nrrd | vkt info | grep '^direction' | cmp - want # as the other has it
    done
}

@test "whole voxels aside, mirrored or with axes swapped, voxels are bytes that move" {
    onto '
for kind in (np.uint16, np.float64):
    v = random.integers(0, 2**15, (11, 13, 17)).astype(kind)
    if kind == np.float64: v.view(np.uint64)[0, 0, 0] = 0x7ff8000000001234
    base = turned()
    inp = image(v, inp_origin, inp_spacing, base)
    padded = np.pad(v, 4)
    step = base * np.array(inp_spacing)
    for method in ("auto", "linear", "nearest", "cubic", "area"):
        part = image(np.zeros((4, 5, 6)), np.array(inp_origin) + step @ (3, 2, 1), inp_spacing, base)
        assert resample(inp, part, "--method", method).tobytes() == v[1:5, 2:7, 3:9].tobytes()
        more = image(np.zeros((14, 16, 20)), np.array(inp_origin) + step @ (-2, -1, -4), inp_spacing, base)
        assert resample(inp, more, "--method", method).tobytes() == padded[0:14, 3:19, 2:22].tobytes()
        back = image(np.zeros((11, 13, 19)), np.array(inp_origin) + step @ (17, 12, 0), inp_spacing, base * (-1, -1, 1))
        assert resample(inp, back, "--method", method).tobytes() == padded[4:-4, 4:-4, 3:-3][:, ::-1, ::-1][:, :, :19].tobytes()
        swap = image(np.zeros((17, 11, 13)), inp_origin, np.array(inp_spacing)[[1, 2, 0]], base[:, [1, 2, 0]])
        assert resample(inp, swap, "--method", method).tobytes() == v.transpose(2, 0, 1).tobytes()
    assert "exact" in vkt("resample", "in.nrrd", "--like", "ref.nrrd", "-n").stderr'
}

@test "a coarser grid averages, along its axes exactly and turned by samples" {
    onto '
v = noise((24, 18, 12), np.float64)
base = turned()
inp = image(v, (1, 2, 3), (1, 1, 1), base)
# Cells of 2 x 3 x 2 voxels, from voxel (2, 3, 2) on: their means.
ref = image(np.zeros((4, 4, 8)), np.array((1, 2, 3)) + base @ (2.5, 4, 2.5), (2, 3, 2), base)
want = v[2:10, 3:15, 2:18].reshape(4, 2, 4, 3, 8, 2).mean((1, 3, 5))
assert abs(resample(inp, ref) - want).max() < 1e-5
assert abs(resample(inp, ref, "--method", "area") - want).max() < 1e-5
# The same cells, axes in another order.
turn = [2, 0, 1]
ref = image(np.zeros((4, 8, 4)), ref.GetOrigin(), np.array((2, 3, 2))[turn], base[:, turn])
assert abs(resample(inp, ref) - want.transpose(1, 2, 0)).max() < 1e-5
# Turned: the mean of 2 x 3 x 2 samples.
q = base @ np.array(((np.cos(.3), -np.sin(.3), 0), (np.sin(.3), np.cos(.3), 0), (0, 0, 1)))
ref = image(np.zeros((3, 3, 4)), np.array((1, 2, 3)) + base @ (8., 4, 3), (2, 3, 2), q)
want = 0
for k in range(2):
    for j in range(3):
        for i in range(2):
            shifted = itk.Image(ref)
            shifted.SetOrigin(np.array(ref.GetOrigin()) + q @ (np.array((2, 3, 2)) * ((i+.5)/2-.5, (j+.5)/3-.5, (k+.5)/2-.5)))
            want = want + nd.map_coordinates(v, positions(shifted, inp)[::-1], order=1, mode="nearest") / 12
assert abs(resample(inp, ref).ravel() - want).max() < 1e-5
assert "mean of 2x3x2 samples" in vkt("resample", "in.nrrd", "--like", "ref.nrrd", "-n").stderr
assert "samples" not in vkt("resample", "in.nrrd", "--like", "ref.nrrd", "-n", "--method", "linear").stderr'
}

@test "what lies outside another's grid: background, or as the boundary says" {
    onto '
v = noise((9, 8, 7), np.float64)
for q in (np.eye(3), np.array(((np.cos(.3), -np.sin(.3), 0), (np.sin(.3), np.cos(.3), 0), (0, 0, 1)))):
    inp = image(v, (0, 0, 0), (1, 1, 1), np.eye(3))
    ref = image(np.zeros((25, 26, 27)), q @ (-9.3, -8.6, -9.1), (1, 1, 1), q)
    p = positions(ref, inp)[::-1]
    pad = 40
    for rule, mode, more in (("mirror", "symmetric", {}), ("clamp", "edge", {}), ("wrap", "wrap", {}), ("border:3.5", "constant", {"constant_values": 3.5})):
        want = nd.map_coordinates(np.pad(v, pad, mode, **more), p + pad, order=1)
        got = resample(inp, ref, "--method", "linear", "--boundary", rule).ravel()
        assert abs(got - want).max() < 2e-6, (rule, abs(got - want).max())
    done = vkt("resample", "in.nrrd", "--like", "ref.nrrd", "-o", "out.nrrd", "--force", "--background=-2.5")
    inside = np.all([(p[a] > -.5) & (p[a] < n - .5) for a, n in enumerate((7, 8, 9))], 0)
    assert (read("out.nrrd")[0].ravel()[~inside] == -2.5).all()
    assert f"{(~inside).sum()} of {inside.size} voxels" in done.stderr and "outside" in done.stderr, done.stderr
    assert "outside" not in vkt("resample", "in.nrrd", "--like", "in.nrrd", "-o", "out.nrrd", "--force").stderr
far = image(np.zeros((3, 3, 3)), (1000, 0, 0))
assert (resample(inp, far, "--background", "4") == 4).all()
small = image(noise((9, 8, 7), np.uint8))
itk.WriteImage(small, "small.nrrd")
assert "cannot be stored in uint8" in vkt("resample", "small.nrrd", "--like", "ref.nrrd", "--background=-1", "-o", "never.nrrd", code=2).stderr
assert "does not apply" in vkt("resample", "small.nrrd", "--like", "ref.nrrd", "--background=1", "--boundary", "wrap", "-o", "never.nrrd", code=2).stderr
import os; assert not os.path.exists("never.nrrd")'
}

@test "a background is what a volume names, or what is asked for, and fits the type" {
    vkt make constant --dims 4 4 4 --value 9 --dtype uint8 | vkt set --attribute background=7 -o named.nrrd
    vkt set named.nrrd --origin 2,0,0 -o moved.nrrd
    vkt resample named.nrrd --like moved.nrrd | vkt stats --json | grep -q '"min": 7'
    vkt resample named.nrrd --like moved.nrrd --background 5 | vkt stats --json | grep -q '"min": 5'
    fails_with 2 'background 300' vkt resample named.nrrd --like moved.nrrd --background 300 -o never.nrrd
    # Of structured volumes it is anybody's attribute.
    vkt set named.nrrd --attribute background=white -o white.nrrd
    vkt resample white.nrrd --like moved.nrrd | vkt stats --json | grep -q '"min": 0'
    # The same of hierarchical ones, which a cell cannot hold either.
    vkt make sphere --dims 16 16 16 --dtype uint8 | vkt refine --tolerance 0 --background 0 -o tree.vkt
    for method in basis nearest average auto; do
        fails_with 2 'background 300' vkt resample tree.vkt --method $method --background 300 -o never.nrrd
        vkt resample tree.vkt --method $method --background 200 -o high.nrrd --force
    done
    vkt set tree.vkt --attribute background=white -o white.vkt
    fails_with 3 'background' vkt resample white.vkt -o never.nrrd
    [ ! -e never.nrrd ]
}

@test "onto another's grid the frames count, and unknown ones are refused" {
    vkt set noise.vkt --origin 1,2,3 --attribute space=left-posterior-superior -o lps.nrrd
    vkt set lps.nrrd --attribute space=right-anterior-superior -o ras.nrrd # another place
    vkt resample lps.nrrd --like ras.nrrd --background 9 -o there.nrrd 2>remark
    vkt diff --geometry there.nrrd ras.nrrd --tolerance 9
    grep -q outside remark
    vkt write ras.nrrd ras.mha
    vkt resample lps.nrrd --like ras.mha --background 9 | vkt diff there.nrrd --geometry
    fails_with 2 'mean different things' vkt resample noise.vkt --like lps.nrrd -o out.nrrd
    fails_with 2 'mean different things' vkt resample lps.nrrd --like noise.vkt -o out.nrrd
    [ ! -e out.nrrd ]
}

@test "onto another's grid nothing depends on slabs, threads, pipes or memory" {
    vkt make noise --dims 41 37 29 --seed 7 --spacing 1,1.2,1.4 -o in.vkt
    vkt convert in.vkt --dtype uint8 --range 0:1 -o bytes.vkt
    s=0.5 c=0.8660254037844386
    vkt make ramp --dims 45 43 39 --spacing 0.9,1,1.1 --origin 3,-7,5 -o straight.vkt
    vkt set straight.vkt --direction "$c,$s,0,-$s,$c,0,0,0,1" -o z.vkt
    vkt set straight.vkt --direction "$c,0,$s,0,1,0,-$s,0,$c" -o y.vkt
    vkt set straight.vkt --direction "0,0.6,0.8,1,0,0,0,-0.8,0.6" -o turned.vkt
    vkt set straight.vkt --direction=0,0,1,1,0,0,0,1,0 -o swapped.vkt
    vkt set straight.vkt --origin 3,-7,45 --direction=1,0,0,0,1,0,0,0,-1 -o down.vkt
    for like in straight z y turned swapped down; do
        for args in "" "--method cubic" "--method nearest" "--boundary mirror --method linear"; do
            for file in in bytes; do
                vkt resample $file.vkt --like $like.vkt $args --slab 100 --threads 1 -q | vkt write all.raw --force
                for cut in "--slab 1 --threads 2" "--slab 7 --threads 3" "--slab 64 --memory 20k"; do
                    vkt resample $file.vkt --like $like.vkt $args $cut -q | vkt write cut.raw --force
                    cmp all.raw cut.raw
                done
                vkt read $file.vkt --slab 1 | vkt resample --like $like.vkt $args --slab 1 -q | vkt write cut.raw --force
                cmp all.raw cut.raw
                VKT_INSTRUCTION_SET=baseline vkt resample $file.vkt --like $like.vkt $args -q | vkt write cut.raw --force
                cmp all.raw cut.raw
            done
        done
    done
}

@test "onto another's grid: constants, holes and extremes" {
    onto '
q = turned()
ref = image(np.zeros((20, 20, 20)), centre(q) - q @ (5, 5, 5.), (0.5, 0.5, 0.5), q)
for kind, value in ((np.uint8, 255), (np.float32, np.float32(0.1)), (np.float64, 1.7e308), (np.int64, 2**62)):
    for method in ("auto", "linear", "nearest", "area"):
        got = resample(image(np.full((30, 30, 30), value, kind), centre(q) - (15, 15, 15)), ref, "--method", method)
        assert (got == np.array(value, kind)).all(), (kind, method, got.min(), got.max())
extreme = np.where(random.random((30, 30, 30)) < .5, -1.7e308, 1.7e308)
got = resample(image(extreme, centre(q) - (15, 15, 15)), ref)
assert np.isfinite(got).all() and abs(got).max() <= 1.7e308
# On whole positions along z a NaN of the next slice is not looked at.
v = np.ones((8, 8, 8)); v[4] = np.nan
turn = np.array(((np.cos(.3), -np.sin(.3), 0), (np.sin(.3), np.cos(.3), 0), (0, 0, 1)))
got = resample(image(v), image(np.zeros((8, 3, 3)), (3, 3, 0), (1, 1, 1), turn), "--method", "linear")
assert np.isnan(got[4]).all() and (got[[0, 1, 2, 3, 5, 6, 7]] == 1).all()'
}

@test "another's grid with other options" {
    vkt make ramp --dims 8 8 8 --dtype uint8 -o r.vkt
    vkt make ramp --dims 4 4 4 --origin 1.3,1,1 -o g.vkt
    vkt resample r.vkt --like g.vkt --dtype float32 | vkt dump 2>/dev/null | head -c 0
    vkt resample r.vkt --like g.vkt --dtype float32 --method linear | vkt stats --json | tee s | grep -q '"max": 4.3'
    vkt resample r.vkt --like g.vkt --voxel-mapping 0 510 --method linear -o v.vkt
    vkt stats v.vkt --json | grep -q '"max": 4,' # 4.3 in steps of 2
    fails_with 2 'do not apply' vkt resample r.vkt --like g.vkt --roi 0:1,0:1,0:1 -o x.vkt
    fails_with 2 'with --like it says' vkt resample r.vkt --scale 2 --background 3 -o x.vkt
    fails_with 2 'only one of' vkt resample r.vkt --like g.vkt --scale 2 -o x.vkt
}

@test "a hierarchical volume onto a grid" {
    vkt make amr --blocks 50 --levels 3 -o tree.vkt
    vkt resample tree.vkt --dims 40 40 40 --method average -o whole.vkt
    vkt resample tree.vkt --like whole.vkt --method average | vkt diff --geometry whole.vkt
    vkt crop whole.vkt --roi 5:20,10:30,7:33 -o part.vkt
    for method in average basis nearest; do
        vkt resample tree.vkt --dims 40 40 40 --method $method | vkt crop --roi 5:20,10:30,7:33 -o want.vkt --force
        vkt resample tree.vkt --like part.vkt --method $method | vkt diff --geometry want.vkt --tolerance 1e-6
    done
    fails_with 2 'turned against' vkt resample tree.vkt --like <(vkt flip x whole.vkt) -o x.vkt
}

# Slices of 512 KiB at a budget of which a piece may have 256.
@test "every boundary rule is the same bit for bit where slices are cut, wrapped rows too" {
    vkt make noise --dims 512 256 12 --dtype float32 --seed 3 -o in.nrrd
    for rule in wrap mirror clamp border:0.3; do
        for args in "--dims 700 300 9 --method cubic" "--dims 512 512 12 --method linear" "--dims 512 100 12 --method cubic"; do
            # shellcheck disable=SC2086
            vkt resample in.nrrd $args --boundary $rule --memory 1G --format raw -o whole.raw --force
            # shellcheck disable=SC2086
            vkt resample in.nrrd $args --boundary $rule --memory 4M --format raw -o cut.raw --force
            cmp whole.raw cut.raw
        done
        # shellcheck disable=SC2086
        vkt read in.nrrd | vkt resample $args --boundary $rule --memory 4M --format raw -o cut.raw --force -q
        cmp whole.raw cut.raw
    done
}

@test "onto another's grid every boundary rule keeps a budget that cuts slices" {
    vkt make noise --dims 512 256 40 --dtype float32 --seed 3 -o in.nrrd # 20 MiB
    s=0.0998334166468282 c=0.995004165278026
    vkt make ramp --dims 520 280 48 --origin=-4,-20,-3 -o straight.nrrd
    vkt set straight.nrrd --direction "$c,$s,0,-$s,$c,0,0,0,1" -o turned.nrrd
    vkt set straight.nrrd --direction "1,0,0,0,$c,$s,0,-$s,$c" -o tilted.nrrd
    vkt set straight.nrrd --origin=-4,260,-3 --direction=1,0,0,0,-1,0,0,0,1 -o flipped.nrrd
    vkt set straight.nrrd --origin=-4,-600,90 -o far.nrrd
    for like in straight turned tilted flipped far; do
        for rule in wrap mirror clamp border:0.3; do
            for method in linear cubic nearest; do
                vkt resample in.nrrd --like $like.nrrd --method $method --boundary $rule --memory 1G --format raw -o whole.raw --force
                vkt resample in.nrrd --like $like.nrrd --method $method --boundary $rule --memory 4M --format raw -o cut.raw --force
                cmp whole.raw cut.raw
            done
        done
    done
}

@test "a region whose ends lie between voxels is what SciPy finds there, and where it lies; of whole ones it is a crop" {
    python_with numpy scipy
    vkt make noise --dims 20 15 10 --spacing 0.5,2,3 --origin -10,5.5,100 -o v.nrrd
    vkt write v.nrrd v.npy
    vkt resample v.nrrd --roi 1.5:15.25,2:9.75,0.125:-1.5 --dims 11 12 7 --method linear -o r.npy
    vkt resample v.nrrd --roi 1.5:15.25,2:9.75,0.125:-1.5 --dims 11 12 7 | vkt info --json >info.json
    /usr/bin/python3 - <<'END'
import json, numpy as np
from scipy import ndimage
v = np.load("v.npy").reshape(10, 15, 20)
r, info = np.load("r.npy").reshape(7, 12, 11), json.load(open("info.json"))
info = info[0] if isinstance(info, list) else info
low, high, n = np.array([1.5, 2, 0.125]), np.array([15.25, 9.75, 8.5]), np.array([11, 12, 7])
width = (high - low) / n
at = [low[a] - 0.5 + (np.arange(n[a]) + 0.5) * width[a] for a in (2, 1, 0)]
assert abs(r - ndimage.map_coordinates(v, np.meshgrid(*at, indexing="ij"), np.float64, 1, "nearest")).max() < 2e-7
assert np.allclose(info["spacing"], width * [0.5, 2, 3], rtol=1e-14)
assert np.allclose(info["origin"], [-10, 5.5, 100] + (low - 0.5 + width / 2) * [0.5, 2, 3], rtol=1e-14)
END
    vkt resample v.nrrd --roi 2.0:19,3:+5,: | vkt diff - <(vkt crop v.nrrd --roi 2:19,3:8,:) --geometry
    vkt resample v.nrrd --roi 2:18,:,: --scale 0.5,1,1 | vkt diff - <(vkt crop v.nrrd --roi 2:18,:,: | vkt resample --scale 0.5,1,1) --geometry --tolerance 1e-7
    for options in '--slab 1 --threads 7' '--slab 3 --threads 2' '--memory 200k'; do
        # shellcheck disable=SC2086
        vkt resample v.nrrd --roi 1.5:15.25,2:9.75,0.125:-1.5 --scale 1.7 $options | vkt diff - <(vkt resample v.nrrd --roi 1.5:15.25,2:9.75,0.125:-1.5 --scale 1.7)
    done
    # However near to a face, nothing of a region lies outside.
    vkt make noise --dims 4 4 4 --dtype uint8 --low 1 --high 9 -o e.vkt
    for method in nearest linear area; do
        for roi in 3.9999:4,:,: 0:0.0001,:,: 3.999999:4,:,3.9999:4; do
            vkt resample e.vkt --roi $roi --dims 200 4 5 --method $method -o near.vkt --force 2>said
            vkt stats near.vkt --json >near.json
            grep -q '"min": [1-9]' near.json
            run ! grep background said
        done
    done
    # A region that is all of the volume is the volume: integers in exact arithmetic.
    vkt make noise --dims 40 40 1 --dtype uint16 -o w.vkt
    vkt resample w.vkt --dims 60 60 1 --method linear --roi 0:40,:,0:1 | vkt diff - <(vkt resample w.vkt --dims 60 60 1 --method linear)
    # Splines are planned as quickly as others, however much is averaged.
    vkt make constant --dims 100000 1 1 --value 7 --dtype uint8 -o l.vkt
    timeout 20 vkt resample l.vkt --dims 7 1 1 --method bspline3 | vkt stats --json | grep -q '"max": 7'
    fails_with 2 "leaves the volume" vkt resample v.nrrd --roi 1.5:20.25,:,:
    fails_with 2 "is empty along x" vkt resample v.nrrd --roi 2.5:2.5,:,:
    fails_with 2 "'nan' is not a number" vkt resample v.nrrd --roi 1.5:nan,:,:
    fails_with 2 "vkt resample, rotate, scale and affine" vkt crop v.nrrd --roi 1.5:3,:,:
}

@test "rows of any length are stored, also where values are clipped" {
    vkt make noise --dims 3 3 2 --dtype int16 -o small.vkt
    for method in linear cubic bspline5; do
        vkt resample small.vkt --dims 5000 3 2 --method $method --dtype uint8 -o wide.vkt
        vkt resample small.vkt --dims 5000 3 2 --method $method --dtype int32 -o whole.vkt --force
        vkt arith clamp whole.vkt 0 255 | vkt convert --dtype uint8 | vkt diff - wide.vkt --json | grep -q '"max_abs": 0'
        rm wide.vkt
    done
}

@test "slices of a stream are asked for in order where some of the result are slices of the input" {
    vkt make noise --dims 40 70 70 --dtype float64 -o small.vkt
    for method in cubic lanczos3 bspline3; do
        for dims in '40 70 90' '9 8 350' '20 30 31'; do
            # shellcheck disable=SC2086
            vkt resample small.vkt --dims $dims --method $method --boundary mirror --format raw -o want.raw --force
            # shellcheck disable=SC2086
            cat small.vkt | vkt resample --dims $dims --method $method --boundary mirror --slab 1 --format raw -o got.raw --force
            cmp want.raw got.raw
        done
    done
}

@test "smooth kernels are SciPy's splines, whatever is summed up at once" {
    python_with scipy numpy
    # Enough rows and columns for several tiles, and a footprint wider than many of them.
    for type in uint8 float32 float64; do
        vkt make noise --dims 40 70 9 --dtype $type -o from.vkt --force
        for dims in '700 90 11' '41 300 9' '40 70 30' '25 20 4'; do
            # shellcheck disable=SC2086
            vkt resample from.vkt --dims $dims --method bspline3 --boundary mirror --dtype float64 --format raw -o to.raw --force
            vkt write from.vkt --format raw -o from.raw --force
            # shellcheck disable=SC2086
            /usr/bin/python3 - $type $dims <<'EOF'
import sys
import numpy as np
from scipy import ndimage
x, y, z = map(int, sys.argv[2:])
v = np.fromfile("from.raw", {"uint8": "u1", "float32": "f4", "float64": "f8"}[sys.argv[1]]).reshape(9, 70, 40).astype(float)
got = np.fromfile("to.raw").reshape(z, y, x)
c = ndimage.spline_filter(v, 3, mode="reflect")
at = lambda n, m, sub: (np.arange(m * sub) + 0.5) / sub * n / m - 0.5
# Axes that shrink are sampled several times a voxel.
subs = [max(1, -(-n // m)) for n, m in zip(v.shape, (z, y, x))]
grid = np.meshgrid(*(at(n, m, s) for n, m, s in zip(v.shape, (z, y, x), subs)), indexing="ij")
want = ndimage.map_coordinates(c, grid, order=3, mode="reflect", prefilter=False)
want = want.reshape(z, subs[0], y, subs[1], x, subs[2]).mean(axis=(1, 3, 5))
error = abs(got - want).max() / abs(v).max()
assert error < 1e-10, (sys.argv, error)
EOF
        done
    done
}

@test "units of lengths are seen as frames are: two volumes meet in one of them" {
    vkt make ramp --dims 8 7 6 --dtype int16 | vkt set --origin 3,0,-2 -o a.nrrd
    for unit in mm um; do vkt edit a.nrrd --attribute "space units=\"$unit\" \"$unit\" \"$unit\"" -o $unit.nrrd; done
    vkt edit a.nrrd --spacing 0.001,0.001,0.001 --origin 0.003,0,-0.002 --attribute 'space units="mm" "mm" "mm"' -o same.nrrd
    run -1 vkt diff mm.nrrd um.nrrd --geometry
    vkt diff um.nrrd same.nrrd --geometry
    vkt diff same.nrrd um.nrrd --geometry
    fails_with 2 "different places" vkt arith sub mm.nrrd um.nrrd -o o.nrrd
    fails_with 2 "--mask lies at another place" vkt stats mm.nrrd --mask um.nrrd
    vkt arith sub same.nrrd um.nrrd | vkt stats --json | grep '"max": 0'
    vkt resample um.nrrd --like same.nrrd -o on.nrrd
    vkt diff on.nrrd same.nrrd --geometry
    vkt info on.nrrd | grep 'space units: "mm" "mm" "mm"'
    vkt affine '1 0 0 0 0 1 0 0 0 0 1 0' um.nrrd --like same.nrrd | vkt diff - same.nrrd --geometry
    # Who says no unit is taken by its numbers.
    vkt diff a.nrrd um.nrrd --geometry
    # Of a series the first one's unit is kept.
    vkt write '[us]*m*.nrrd' series.nrrd
    vkt read series.nrrd --index 1 | vkt diff - um.nrrd --geometry
}
