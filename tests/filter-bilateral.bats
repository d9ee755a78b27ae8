# vkt filter bilateral against NumPy and SimpleITK, for every type, and however it is run.
load helper
load filters

setup_more() { make_volumes; }

# against_numpy CODE: Python with bilateral(values, …), what must come out, and run(name, options).
against_numpy() {
    python_with numpy
    /usr/bin/python3 - <<PY
import subprocess, math
import numpy as np

TYPES = "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split()

def load(name):
    x, y, z = (int(n) for n in name.split("_")[1].split("x"))
    return np.fromfile(name, name.split("_")[2].split(".")[0]).reshape(z, y, x)

def bilateral(v, sigma, value_sigma, pad="symmetric", radius=None, **more):
    """sigma and radius along x, y, z; in float64, from the definition."""
    sigma = np.broadcast_to(sigma, 3)[::-1]
    radius = [math.ceil(2.5 * s) for s in sigma] if radius is None else [min(r, r * 10**9 * s) for r, s in zip(np.broadcast_to(radius, 3)[::-1], sigma)]
    radius = [int(r) for r in radius]
    f = v.astype(np.float64)
    p = np.pad(f, [(r, r) for r in radius], pad, **more)
    w = np.lib.stride_tricks.sliding_window_view(p, [2 * r + 1 for r in radius])
    d = np.indices([2 * r + 1 for r in radius]).astype(float)
    far = sum(((d[k] - radius[k]) / sigma[k]) ** 2 for k in range(3) if radius[k] > 0) + np.zeros(d[0].shape)
    with np.errstate(invalid="ignore", over="ignore"):
        change = w - f[..., None, None, None]
        weight = np.exp(-far / 2 - (change / value_sigma) ** 2 / 2)
    weight = np.where(np.isfinite(change), weight, 0)
    total = weight.sum((3, 4, 5))
    return f + np.where(total > 0, (weight * np.where(np.isfinite(change), change, 0)).sum((3, 4, 5)) / np.where(total > 0, total, 1), 0)

def run(name, options):
    subprocess.run(f"vkt filter bilateral {name} {options} --format raw -o out.raw --force", shell=True, check=True)
    return np.fromfile("out.raw", load(name).dtype).reshape(load(name).shape)

def check(got, want, dtype, extent):
    eps = {"float16": 1e-3, "float32": 2e-6, "float64": 1e-13}
    if np.dtype(dtype).kind == "f":
        same = (got == want.astype(got.dtype)) | (np.isnan(got) & np.isnan(want)) | (np.abs(got.astype(float) - want) <= eps[dtype] * extent)
    else:
        near = {1: 1e-4, 2: 0.01}.get(np.dtype(dtype).itemsize, 1e-13 * extent)
        same = np.abs(got.astype(float) - want) <= 0.5 + near + np.abs(want) * 2.0 ** -52
    assert same.all(), (dtype, np.abs(got.astype(float) - want)[~same].max())
$1
PY
}

@test "all types are the definition's, in float64" {
    against_numpy '
for dtype in TYPES:
    name = f"v_13x11x7_{dtype}.raw"
    v = load(name)
    extent = float(v.astype(float).max() - v.astype(float).min())
    for sigma, part in ((1, 0.3), (0.5, 0.05), ("2,0.7,0", 1)):
        axes = [float(s) for s in str(sigma).split(",")]
        want = bilateral(v, axes if len(axes) == 3 else axes[0], part * extent)
        check(run(name, f"--sigma {sigma} --range-sigma {part * extent!r}"), want, dtype, extent)
'
}

@test "boundaries are NumPy'\''s, radii cut the window, world units count voxels by their size" {
    against_numpy '
name = "v_13x11x7_int16.raw"
v = load(name)
for rule, pad in (("mirror", {}), ("clamp", {"pad": "edge"}), ("wrap", {"pad": "wrap"}), ("border", {"pad": "constant"}),
                  ("border:700", {"pad": "constant", "constant_values": 700})):
    check(run(name, f"--sigma 1.2 --range-sigma 9000 --boundary {rule}"), bilateral(v, 1.2, 9000, **pad), "int16", 65536)
check(run(name, "--sigma 3 --range-sigma 9000 --radius 2,1,0"), bilateral(v, 3, 9000, radius=[2, 1, 0]), "int16", 65536)
subprocess.run(f"vkt set {name} --spacing 1,2,0.5 --slope 0.5 --intercept 100 | vkt filter bilateral --sigma 1 --unit world"
               " --range-sigma 4500 | vkt write - --format raw > out.raw", shell=True, check=True)
check(np.fromfile("out.raw", np.int16).reshape(v.shape), bilateral(v, [1, 0.5, 2], 9000), "int16", 65536)
'
}

@test "NaN and infinities have no weight and stay" {
    against_numpy '
for dtype in TYPES[8:]:
    name = f"n_13x11x7_{dtype}.raw"
    v = load(name)
    got = run(name, "--sigma 1 --range-sigma 0.7")
    check(got, bilateral(v, 1, 0.7), dtype, 6)
    assert (np.isfinite(got) == np.isfinite(v)).all()
'
}

@test "SimpleITK gives the same but for its table of values" {
    python_with SimpleITK
    against_numpy '
import SimpleITK as sitk
rng = np.random.default_rng(4)
v = (rng.normal(size=(12, 14, 18)) + 5 * (np.indices((12, 14, 18))[2] > 8)).astype(np.float32)
v.tofile("s_18x14x12_float32.raw")
got = run("s_18x14x12_float32.raw", "--sigma 1 --range-sigma 2 --boundary clamp")
theirs = sitk.GetArrayFromImage(sitk.Bilateral(sitk.GetImageFromArray(v), 1.0, 2.0, 1000))
inside = (slice(3, -3),) * 3
assert np.abs(got - theirs)[inside].max() < 0.02  # 1000 samples of weights, cut off at 4 sigma
assert np.abs(got - v).max() > 1
'
}

@test "an edge much higher than the range stays, noise beside it goes; a very wide range is the Gaussian" {
    against_numpy '
rng = np.random.default_rng(2)
edge = np.where(np.indices((16, 16, 16))[2] < 8, 0, 100)
v = (edge + rng.normal(size=edge.shape)).astype(np.float32)
v.tofile("e_16x16x16_float32.raw")
got = run("e_16x16x16_float32.raw", "--sigma 1.5 --range-sigma 8")
assert np.abs(got - edge).max() < 1.2 and (got - edge).std() < 0.25
got = run("e_16x16x16_float32.raw", "--sigma 1.5 --range-sigma 1e30 --radius 4")
from numpy import exp
taps = exp(-np.arange(-4, 5) ** 2 / 4.5)
taps /= taps.sum()
want = np.pad(v.astype(float), 4, "symmetric")
for axis in range(3):
    want = np.apply_along_axis(lambda line: np.convolve(line, taps, "valid"), axis, want)
assert np.abs(got - want).max() < 1e-4
got = run("e_16x16x16_float32.raw", "--sigma 1.5 --range-sigma 1e-30")
assert (got == v).all()
'
}

@test "slabs, threads, memory, pipes and regions make no difference" {
    for type in uint8 float32 float64; do
        same_however_run dtype=$type vkt filter bilateral --sigma 1.2,0.5,1 --range-sigma 0.2
    done
    same_however_run dtype=int16 vkt filter bilateral --sigma 1 --range-sigma 4000 --boundary wrap
    same_however_run dtype=int16 vkt filter bilateral --sigma 0.4,1,2 --range-sigma 4000 --boundary border:3
}

@test "a constant stays, thin volumes work, a sigma of nothing copies, and trees are filtered level by level" {
    for dims in '1 1 1' '31 1 2' '1 9 1' '1030 2 1'; do
        # shellcheck disable=SC2086
        vkt make constant --dims $dims --dtype float32 --value 0.1 -o c.vkt --force
        vkt filter bilateral c.vkt --sigma 2 --range-sigma 1 | vkt diff c.vkt
    done
    vkt filter bilateral v_13x11x7_float32.raw --sigma 0 --range-sigma 1 | vkt diff v_13x11x7_float32.raw
    vkt make marschner-lobb --dims 16 16 16 | vkt refine --tolerance 0 --levels 1 -o t.vkt
    vkt filter bilateral t.vkt --range-sigma 0.2 | vkt resample --method nearest | vkt write - --format raw >a.raw
    vkt resample t.vkt --method nearest | vkt filter bilateral --range-sigma 0.2 | vkt write - --format raw >b.raw
    cmp a.raw b.raw
}

@test "what makes no sense is refused with a line that says what does" {
    fails_with 2 'range-sigma' vkt filter bilateral v_13x11x7_uint8.raw -o o.vkt
    fails_with 2 'not a finite number above 0' vkt filter bilateral v_13x11x7_uint8.raw --range-sigma 0 -o o.vkt
    fails_with 2 'not a finite number >= 0' vkt filter bilateral v_13x11x7_uint8.raw --range-sigma 1 --sigma -1 -o o.vkt
    fails_with 2 'further than 32' vkt filter bilateral v_13x11x7_uint8.raw --range-sigma 1 --sigma 20 -o o.vkt
    fails_with 2 'is not in 0 to 32' vkt filter bilateral v_13x11x7_uint8.raw --range-sigma 1 --radius 40 -o o.vkt
    fails_with 2 'is no voxel' vkt filter bilateral v_13x11x7_uint8.raw --range-sigma 1 --boundary border:0.5 -o o.vkt
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'structured volumes only' vkt filter bilateral t.vkt --range-sigma 1 --roi 0:4,:,: -o o.vkt
    [ ! -e o.vkt ]
    vkt filter bilateral v_13x11x7_uint8.raw --range-sigma 9 -n 2>plan >/dev/null -o x.vkt
    grep -q 'every weight of 7x7x7' plan
}
