# vkt scan: prefix sums against numpy.cumsum, exact integers, and slabs.
load helper

# with_numpy CODE: Python with scan(values, options) and expected(values).
with_numpy() {
    python_with numpy
    /usr/bin/python3 - <<PY
import subprocess
import numpy as np

rng = np.random.default_rng(7)
TYPES = "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split()

def run(command):
    return subprocess.run(command, shell=True, check=True, capture_output=True, text=True)

def scan(values, options="", pipe=""):
    name = "v_%dx%dx%d_%s.raw" % (*values.shape[::-1], values.dtype)
    values.tofile(name)
    done = run(f"vkt read {name} {pipe} | vkt scan {options} -o out.nrrd --force; vkt write out.nrrd - --format raw > out.raw;"
               " vkt info --json out.nrrd")
    dtype = next(t for t in ("uint64", "int64", "float64") if f'"{t}"' in done.stdout)
    return np.fromfile("out.raw", dtype).reshape(values.shape), done.stderr

def whole(values):
    """Exact sums, as Python's integers."""
    return np.cumsum(np.cumsum(np.cumsum(values.astype(object), 2), 1), 0)

def before(sums):
    result = np.zeros_like(sums)
    result[1:, 1:, 1:] = sums[:-1, :-1, :-1]
    return result
$1
PY
}

@test "integers of all types are exact, inclusive and exclusive; signed ones stay signed" {
    with_numpy '
for dtype in TYPES[:8]:
    info = np.iinfo(dtype)
    low, high = (info.min, info.max) if info.bits < 64 else (info.min // 2**14, info.max // 2**14)
    for shape in ((7, 11, 13), (1, 1, 1), (1, 37, 1), (5, 1, 131), (3, 130, 2)):
        a = rng.integers(low, high, shape, dtype, endpoint=True)
        got, said = scan(a)
        assert got.dtype == (np.int64 if info.min < 0 else np.uint64) and said == ""
        assert (got.astype(object) == whole(a)).all(), (dtype, shape)
        got, _ = scan(a, "--exclusive")
        assert (got.astype(object) == before(whole(a))).all(), (dtype, shape)
'
}

@test "sums beyond 64 bits are the nearest end, counted" {
    with_numpy '
for dtype, value in (("uint64", 2**63 - 3), ("int64", 2**62), ("int64", -2**62 - 1)):
    a = np.full((3, 4, 5), value, dtype)
    info = np.iinfo(dtype)
    want = whole(a)
    got, said = scan(a)
    assert (got.astype(object) == np.clip(want, info.min, info.max)).all()
    count = ((want < info.min) | (want > info.max)).sum()
    assert f"{count} of 60 voxels" in said and "beyond 64 bits" in said, said
    # What exceeds 64 bits on the way does not spoil what comes back.
    a[1:] *= -1 if dtype == "int64" else 1
    a[2:] = 0
    got, _ = scan(a)
    assert (got.astype(object) == np.clip(whole(a), info.min, info.max)).all()
a = np.zeros((2, 2, 2), np.uint64)
assert run("vkt make constant --dims 2 2 2 --dtype uint64 --value 0 | vkt scan | vkt stats").stderr == ""
'
}

@test "floats are within the stated bound of exact sums" {
    with_numpy '
for dtype in TYPES[8:]:
    a = (rng.normal(size=(19, 23, 61)) * 10.0 ** rng.integers(-3, 3, (19, 23, 61))).astype(dtype)
    # Integers of a common unit are exact.
    unit = 2.0 ** -24 if dtype == "float16" else 2.0 ** -40 if dtype == "float32" else 2.0 ** -70
    parts = np.rint(a.astype(np.float64) / unit)
    a = (parts * unit).astype(dtype)
    exact = whole(np.vectorize(int, [object])(a.astype(np.float64) / unit))
    sizes = whole(np.vectorize(int, [object])(np.abs(a.astype(np.float64)) / unit))
    for options, map_ in (("", lambda s: s), ("--exclusive", before)):
        got, said = scan(a, options)
        assert got.dtype == np.float64 and said == ""
        steps = 19 + 23 + 61
        for g, e, s in zip(got.ravel(), map_(exact).ravel(), map_(sizes).ravel()):
            off = abs(int(g * 2 ** 100) - int(e * int(unit * 2 ** 100))) / 2 ** 100
            size, total = float(s) * unit, abs(float(e)) * unit
            assert off <= (total * 2 ** -53 + steps ** 2 * 2 ** -106 * size if dtype == "float64" else steps * 2 ** -53 * size)
'
}

@test "large and small in turn: float64 keeps what plain sums lose" {
    with_numpy '
a = np.ones((40, 30, 20)) * 1e-3
a[0, 0, 0] = 1e16
got, _ = scan(a)
k, j, i = np.indices(a.shape)
from fractions import Fraction
exact = [Fraction(1e16) + Fraction(1e-3) * (n - 1) for n in ((i + 1) * (j + 1) * (k + 1)).ravel().tolist()]
off = lambda sums: max(abs(Fraction(s) - e) / e for s, e in zip(sums.ravel().tolist(), exact))
assert off(got) <= Fraction(1.0001 * 2 ** -53)
assert off(np.cumsum(np.cumsum(np.cumsum(a, 2), 1), 0)) > 5 * 2 ** -53  # or the test shows nothing
'
}

@test "box sums of 3^3 from float32 noise are right to 1e-9" {
    with_numpy '
a = rng.random((64, 64, 64)).astype(np.float32)
t = np.zeros((65, 65, 65))
t[1:, 1:, 1:], _ = scan(a)
box = sum(s * t[3 * x:65 - 3 + 3 * x, 3 * y:65 - 3 + 3 * y, 3 * z:65 - 3 + 3 * z]
          for x, sx in ((1, 1), (0, -1)) for y, sy in ((1, 1), (0, -1)) for z, sz in ((1, 1), (0, -1)) for s in (sx * sy * sz,))
want = np.lib.stride_tricks.sliding_window_view(a.astype(np.float64), (3, 3, 3)).sum((3, 4, 5))
assert (np.abs(box - want) <= 1e-9 * want).all()
'
}

@test "NaN and infinities reach what has them in its box, and that is told" {
    with_numpy '
for dtype in TYPES[8:]:
    a = np.ones((6, 7, 9), dtype)
    a[2, 3, 4] = np.nan
    a[4, 0, 7] = np.inf
    a[5, 6, 7] = -np.inf
    want = np.cumsum(np.cumsum(np.cumsum(a.astype(np.float64), 0), 2), 1)
    got, said = scan(a)
    assert np.array_equal(got, want, equal_nan=True)
    assert f"{(~np.isfinite(want)).sum()} of 378 voxels" in said and "not finite" in said, said
    assert "from the first value on that is not" in said, said
'
}

@test "sums beyond float64 are told as such, whatever the slabs, and are a loss" {
    with_numpy '
a = np.ones((6, 7, 9))
a[1, 2, 3:] = np.finfo(np.float64).max / 2
for options in ("", "--slab 1 --threads 1", "--slab 2 --threads 3"):
    got, said = scan(a, options)
    assert np.isfinite(got[0]).all() and np.isinf(got[5, 6, 8])
    assert f"{(~np.isfinite(got)).sum()} of 378 voxels" in said and "from the first on that is beyond float64" in said, said
    b = a.copy()
    b[5, 6, 0] = np.nan
    _, said = scan(b, options)
    assert "from the first value on that is not" in said, said
    _, said = scan(a, options + " --exclusive")
    assert "of values that are not, or beyond float64" in said, said
a.tofile("big_9x7x6_float64.raw")
'
    fails_with 3 'beyond float64' vkt scan big_9x7x6_float64.raw --strict -o no.vkt
}

@test "a slope is kept, an intercept is summed" {
    with_numpy '
a = rng.integers(-500, 500, (5, 6, 7), np.int16)
name = "v_7x6x5_int16.raw"
a.tofile(name)
run(f"vkt set {name} --slope 0.5 | vkt scan -o out.nrrd --force; vkt write out.nrrd - --format raw > out.raw")
assert (np.fromfile("out.raw", np.int64) == whole(a).ravel()).all()
assert "0.5" in run("vkt info out.nrrd").stdout
run(f"vkt set {name} --slope 0.5 --intercept -1024 | vkt scan | vkt write - --format raw > out.raw")
want = np.cumsum(np.cumsum(np.cumsum(a * 0.5 - 1024, 0), 1), 2)
assert (np.fromfile("out.raw", np.float64) == want.ravel()).all()  # halves: exact
'
}

@test "nor do slabs and threads for sums that are no numbers, sign included" {
    with_numpy '
for dtype in "float16", "float32", "float64":
    for seed in range(4):
        a = rng.normal(size=(33, 3, 8)).astype(dtype)
        at = rng.random(a.shape)
        a[at < 0.06], a[(at > 0.06) & (at < 0.1)], a[at > 0.96] = np.nan, np.inf, -np.inf
        for first in "", "--exclusive":
            want, _ = scan(a, first + " --slab 33 --threads 1")
            for options in "--slab 1 --threads 1", "--slab 1 --threads 3", "--slab 2", "":
                assert scan(a, f"{first} {options}")[0].tobytes() == want.tobytes(), (dtype, seed, first, options)
'
}

@test "slabs, rows, threads, pipes and who asks for parts make no difference" {
    with_numpy '
for dtype in ("uint8", "float32", "float64", "int64"):
    a = (rng.normal(size=(53, 61, 70)) * 50).astype(dtype)
    want, _ = scan(a, "--threads 1 --slab 53")
    for options in ("--slab 1 --threads 2", "--slab 3 --threads 5", "--slab 7", "--memory 1M", ""):
        got, _ = scan(a, options, "--slab 5")
        assert got.tobytes() == want.tobytes(), (dtype, options)
    # Threads that follow one another through the slices, and through no more than they have rows for.
    for threads in 2, 3, 5, 40:
        for first in "", "--exclusive":
            got, _ = scan(a, f"{first} --slab 53 --threads {threads}")
            assert got.tobytes() == scan(a, f"{first} --slab 2 --threads 1")[0].tobytes(), (dtype, first, threads)
            if not first:
                assert got.tobytes() == want.tobytes(), (dtype, threads)
    name = f"v_70x61x53_{dtype}.raw"
    # Out of order, from the middle, in parts of rows; and rows of slices that are too large.
    for then, part in (("flip z", want[::-1]), ("crop --roi 3:-7,2:50,9:40", want[9:40, 2:50, 3:-7]),
                       ("crop --roi 60:,50:,52:", want[52:, 50:, 60:]), ("slice --y 7", want[:, 7, :])):
        run(f"vkt pipe \"read {name} | scan | {then} | write - --format raw\" > part.raw")
        assert np.fromfile("part.raw", want.dtype).tobytes() == part.tobytes(), (dtype, then)
large = rng.integers(0, 65535, (3, 640, 1200), np.uint16)
want, _ = scan(large)
assert (want == np.cumsum(np.cumsum(np.cumsum(large.astype(np.uint64), 0), 1), 2)).all()
got, _ = scan(large, "--memory 12M", "--memory 4M")
assert (got == want).all()
run("vkt pipe \"read v_1200x640x3_uint16.raw | scan | crop --roi 5:1100,100:300,1:3 | write - --format raw\" --memory 12M > part.raw")
assert (np.fromfile("part.raw", np.uint64).reshape(2, 200, 1095) == want[1:, 100:300, 5:1100]).all()
'
}

@test "the plan tells type, error and memory; trees are refused" {
    vkt make ramp --dims 9 8 7 --dtype float32 -o v.nrrd
    vkt scan v.nrrd --explain -o o.nrrd 2>plan
    grep -q 'sums in float64' plan
    grep -q 'error at most' plan
    vkt convert v.nrrd --dtype uint8 --range minmax | vkt scan --explain 2>plan | vkt info | grep -q uint64
    grep -qi exact plan
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical volume' vkt scan t.vkt -o o.vkt
    [ ! -e o.vkt ]
}

@test "with --roi the region is summed as if it were the volume; all else keeps its values, in the type of the sums" {
    python_with numpy
    /usr/bin/python3 - <<'EOF'
import numpy as np
rng = np.random.default_rng(4)
for t in "uint8 int16 uint64 int64 float16 float32 float64".split():
    v = rng.integers(0, 200, (9, 11, 13)) if t[0] != "f" else rng.normal(size=(9, 11, 13))
    v.astype(t).tofile(f"r_13x11x9_{t}.raw")
EOF
    for type in uint8 int16 uint64 int64 float16 float32 float64; do
        for exclusive in '' --exclusive; do
            for how in '--slab 9 --threads 1' '--slab 1 --threads 3' '--slab 4'; do
                # shellcheck disable=SC2086
                vkt read r_13x11x9_$type.raw --slab 2 | vkt scan --roi 2:12,3:9,1:8 $exclusive $how | vkt write - --format raw >got.raw
                /usr/bin/python3 - $type "$exclusive" <<'EOF'
import sys
import numpy as np
type_, exclusive = sys.argv[1:]
v = np.fromfile(f"r_13x11x9_{type_}.raw", type_).reshape(9, 11, 13)
wide = {"u": "uint64", "i": "int64", "f": "float64"}[np.dtype(type_).kind]
want = v.astype(wide)
part = want[1:8, 3:9, 2:12]
sums = part.cumsum(0).cumsum(1).cumsum(2)
if exclusive:
    sums = np.pad(sums[:-1, :-1, :-1], ((1, 0),) * 3)
want[1:8, 3:9, 2:12] = sums
got = np.fromfile("got.raw", wide).reshape(v.shape)
assert np.allclose(got, want, rtol=0, atol=1e-11 if wide == "float64" else 0), type_
outside = np.ones(v.shape, bool)
outside[1:8, 3:9, 2:12] = False
assert np.array_equal(got[outside], want[outside])
EOF
            done
        done
    done
    # Physical values, where an intercept is summed; a slope is kept.
    vkt read r_13x11x9_uint8.raw | vkt set --slope 0.5 --intercept 3 -o m.vkt
    vkt scan m.vkt --roi 2:12,3:9,1:8 | vkt crop --roi :,:,0:1 | vkt diff - <(vkt crop m.vkt --roi :,:,0:1 | vkt transform 'v*1.0' --dtype float64 | vkt arith mul - 1 --dtype float64 | vkt filter kernel <(echo 1 1 1 1) --dtype float64)
    fails_with 2 'leaves the volume' vkt scan r_13x11x9_uint8.raw --roi 3:40,:,: -o x.vkt
    # What a voxel may be off is summed up over the region alone.
    error_of() { vkt info --json | /usr/bin/python3 -c 'import json, sys; print("%.9g" % json.load(sys.stdin)["error"]["at_most"])'; }
    vkt filter box r_13x11x9_uint8.raw --radius 1 -o rough.vkt
    vkt crop rough.vkt --roi 2:12,3:9,1:8 | vkt scan | error_of >part
    vkt scan rough.vkt --roi 2:12,3:9,1:8 | error_of | cmp - part
}
