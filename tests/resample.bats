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
    vkt resample wide.vkt --scale 0.7 --explain -o out.vkt --force 2>&1 | grep -q 'error at most 1e-15'
    vkt resample bytes.vkt --voxel-mapping 0 3 --explain -o out.vkt --force 2>&1 | grep -q 'error at most 1e-15'
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
    [ "$(vkt resample r.vkt --size 20,auto,auto | dims)" = '"dims":[20,40,60]' ]
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
