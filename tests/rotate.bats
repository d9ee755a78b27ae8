# vkt rotate: SciPy, ITK and NumPy as oracles, permutations, analytic fields, and what must not depend on anything.
load helper

# turn PYTHON: runs it with volumes, vkt and SciPy at hand. Arrays are [z, y, x], vectors x, y, z.
turn() {
    python_with numpy scipy
    /usr/bin/python3 - <<PY
import json, subprocess, numpy as np, scipy.ndimage as nd
from scipy.spatial.transform import Rotation
random = np.random.default_rng(5)
def vkt(*words, code=0):
    done = subprocess.run(("vkt",) + tuple(map(str, words)), capture_output=True, text=True, errors="replace")
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done
def raw(v):
    z, y, x = v.shape
    file = f"put_{x}x{y}x{z}_{v.dtype}.raw"
    v.tofile(file)
    return file
def put(v, *options, name="in.vkt"): vkt("set", raw(v), *options, "-o", name, "--force")
def info(name="out.vkt"): return json.loads(vkt("info", "--json", name).stdout)
def get(name="out.vkt"):
    vkt("write", name, "get.npy", "--force")
    return np.load("get.npy")
def rotate(v, *options, spacing=None):
    name = raw(v)
    if spacing is not None:
        put(v, "--spacing", ",".join(map(str, spacing)))
        name = "in.vkt"
    vkt("rotate", name, *options, "-o", "out.vkt", "--force")
    return get()
def source(shape, r, spacing=(1, 1, 1), about=None):
    "Positions x, y, z in the input of every voxel, for a rotation r of the content."
    s = np.array(spacing, float)
    c = (np.array(shape[::-1]) - 1) / 2 if about is None else np.array(about, float)
    p = np.indices(shape)[::-1].reshape(3, -1)
    return (r.inv().apply((p.T - c) * s) / s + c).T
def inside(p, shape, by=1e-5):
    return np.all([(p[a] > -.5 + by) & (p[a] < n - .5 - by) for a, n in enumerate(shape[::-1])], 0)
def noise(shape, kind=np.float64):
    v = random.uniform(-100, 100, shape)
    return (v if np.dtype(kind).kind == "f" else np.rint(abs(v))).astype(kind)
$1
PY
}

@test "the sense of the turn: about z from x to y" {
    turn '
v = np.zeros((3, 9, 9), np.uint8); v[1, 4, 7] = 200  # right of the middle
assert rotate(v, "--axis", "z", "--angle", 90)[1, 7, 4] == 200  # y grows
v = np.zeros((9, 9, 9), np.uint8); v[4, 7, 4] = 200
assert rotate(v, "--axis", "x", "--angle", 90)[7, 4, 4] == 200  # from y to z
v = np.zeros((9, 9, 9), np.uint8); v[7, 4, 4] = 200
assert rotate(v, "--axis", "y", "--angle", 90)[4, 4, 7] == 200'  # from z to x
}

@test "any axis, Euler angles and quaternions, as SciPy has them; linear in all types" {
    turn '
shape = (13, 11, 17)
for kind in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float16", "float32", "float64"):
    v = noise(shape, kind)
    for options, r in ((["--axis", "1,-2,0.5", "--angle", -37], Rotation.from_rotvec(np.radians(-37) * np.array((1, -2, .5)) / 5.25**.5)),
                       (["--euler", "20,-35,130"], Rotation.from_euler("xyz", (20, -35, 130), degrees=True)),
                       (["--quaternion", "2,-4,6,1", "--about", "3,7,5.5"], Rotation.from_quat((2, -4, 6, 1)))):
        s = (0.8, 1.3, 2.1)
        p = source(shape, r, s, (3, 7, 5.5) if "--about" in options else None)
        got = rotate(v, *options, "--method", "linear", "--background", "9", spacing=s).ravel()
        want = nd.map_coordinates(v.astype(float), p[::-1], order=1, mode="nearest")
        ins, out = inside(p, shape), ~inside(p, shape, -1e-5)
        assert ins.sum() > 50 and out.sum() > 50
        assert (got[out] == 9).all()
        tolerance = {"float16": .04, "float32": 4e-5, "float64": 2e-6}.get(kind, .5 + 2e-4)
        assert (abs(got - want)[ins] <= tolerance).all(), (kind, options, abs(got - want)[ins].max())'
}

@test "splines agree with SciPy, whose prefilter is recursive, under every boundary" {
    turn '
shape = (25, 23, 29)
r = Rotation.from_rotvec(np.radians(25) * np.array((1, 2, -1)) / 6**.5)
p = source(shape, r)
for kind, tolerance in (("float64", 1e-5), ("float32", 2e-4), ("uint16", .5 + 1e-3)):
    v = noise(shape, kind)
    for order in (3, 5):
        for rule, mode in (("mirror", "reflect"), ("wrap", "grid-wrap")):
            got = rotate(v, "--axis", "1,2,-1", "--angle", 25, "--method", f"bspline{order}", "--boundary", rule).ravel()
            want = nd.map_coordinates(v.astype(float), p[::-1], order=order, mode=mode)
            if kind == "uint16": want = np.clip(want, 0, 65535)
            assert abs(got - want).max() <= tolerance, (kind, order, rule, abs(got - want).max())
        # These SciPy extends by 12 voxels only before it filters.
        for rule, pad in (("clamp", dict(mode="edge")), ("border:5", dict(mode="constant", constant_values=5))):
            got = rotate(v, "--axis", "1,2,-1", "--angle", 25, "--method", f"bspline{order}", "--boundary", rule).ravel()
            want = nd.map_coordinates(np.pad(v.astype(float), 60, **pad), p[::-1] + 60, order=order)
            if kind == "uint16": want = np.clip(want, 0, 65535)
            assert abs(got - want).max() <= tolerance, (kind, order, rule, abs(got - want).max())
        # Without a rule the outermost voxels go on for half a voxel, and then there is background.
        got = rotate(v, "--axis", "1,2,-1", "--angle", 25, "--method", f"bspline{order}", "--background", "7").ravel()
        want = nd.map_coordinates(np.pad(v.astype(float), 60, mode="edge"), p[::-1] + 60, order=order)
        if kind == "uint16": want = np.clip(want, 0, 65535)
        assert abs(got - want)[inside(p, shape)].max() <= tolerance
        assert (got[~inside(p, shape, -1e-5)] == 7).all()'
}

@test "cubic and Lanczos are their definitions, nearest is SciPy's" {
    turn '
def keys(t):
    t = abs(t); return np.where(t < 1, 1.5*t**3 - 2.5*t**2 + 1, np.where(t < 2, -.5*t**3 + 2.5*t**2 - 4*t + 2, 0))
def lanczos(t): return np.where(abs(t) < 3, np.sinc(t) * np.sinc(t / 3), 0)
shape = (15, 14, 13)
v = noise(shape)
r = Rotation.from_euler("xyz", (33, 12, -70), degrees=True)
p = source(shape, r); ins = inside(p, shape); w = np.floor(p)
padded = np.pad(v, 4, "edge")
for method, kernel, taps in (("cubic", keys, range(-1, 3)), ("lanczos3", lanczos, range(-2, 4))):
    weight = [[kernel(p[a] - w[a] - i) for i in taps] for a in range(3)]
    weight = [np.array(x) / sum(x) for x in weight]
    total = 0
    for k, dz in enumerate(taps):
        for j, dy in enumerate(taps):
            for i, dx in enumerate(taps):
                at = [np.clip(w[a] + d + 4, 0, n + 7).astype(int) for a, (d, n) in enumerate(zip((dx, dy, dz), shape[::-1]))]
                total = total + weight[0][i] * weight[1][j] * weight[2][k] * padded[at[2], at[1], at[0]]
    got = rotate(v, "--euler", "33,12,-70", "--method", method).ravel()
    assert abs(got - total)[ins].max() < 2e-5, method
got = rotate(v, "--euler", "33,12,-70", "--method", "nearest").ravel()
tie = (abs(p - np.floor(p) - .5) < 1e-5).any(0)
assert (got == nd.map_coordinates(v, p[::-1], order=0, mode="nearest"))[ins & ~tie].all()'
}

@test "ITK agrees, with directions and spacings" {
    python_with SimpleITK
    turn '
import SimpleITK as itk
q = Rotation.from_euler("xyz", (10, 50, -20), degrees=True).as_matrix()
v = noise((35, 33, 37), np.float32)
i = itk.GetImageFromArray(v); i.SetOrigin((5, -80, 300)); i.SetDirection(q.ravel())
n = np.array((0.3, 0.5, -0.8)); n /= np.linalg.norm(n)
t = itk.VersorRigid3DTransform()
# Splines average where voxels of unequal spacing turn, which ITK leaves alone.
for method, how, spacing in (("linear", itk.sitkLinear, (0.7, 1.1, 1.9)), ("bspline3", itk.sitkBSpline, (1.2, 1.2, 1.2))):
    i.SetSpacing(spacing)
    itk.WriteImage(i, "in.nrrd")
    t.SetCenter(i.TransformContinuousIndexToPhysicalPoint(((37-1)/2, (33-1)/2, (35-1)/2)))
    t.SetRotation([float(x) for x in q @ n], np.radians(-41.))  # where the content comes from
    want = itk.GetArrayFromImage(itk.Resample(i, i, t, how, 0.0))
    vkt("rotate", "in.nrrd", "--axis", "0.3,0.5,-0.8", "--angle", 41, "--method", method, "-o", "out.nrrd", "--force")
    got = itk.GetArrayFromImage(itk.ReadImage("out.nrrd"))
    core = (got != 0) & (want != 0)
    if method == "bspline3": core = nd.binary_erosion(core, iterations=9)  # ITK mirrors around voxels
    assert core.sum() > 300 and abs(got - want)[core].max() < 3e-2 * (method == "bspline3") + 2e-4, (method, core.sum(), abs(got - want)[core].max())'
}

@test "no turn, whole turns and quarter turns move bytes, by every method" {
    turn '
for kind, shape in ((np.uint16, (7, 7, 7)), (np.float32, (6, 6, 6)), (np.float64, (5, 8, 11)), (np.int64, (5, 8, 11))):
    v = np.frombuffer(random.bytes(int(np.prod(shape)) * np.dtype(kind).itemsize), kind).reshape(shape)  # NaN payloads too
    put(v)
    for method in ("auto", "nearest", "linear", "cubic", "bspline3", "bspline5", "lanczos3"):
        for axis, planes in (("x", (1, 0)), ("y", (0, 2)), ("z", (2, 1))):
            for quarters in (0, 1, 2, 3) if method == "auto" else (1,):
                angle = 90 * quarters + random.choice((-720, 0, 360))
                want = np.rot90(v, quarters, planes)
                vkt("rotate", "in.vkt", "--axis", axis, "--angle", angle, "--expand", "--method", method, "-o", "out.vkt", "--force")
                assert get().tobytes() == want.tobytes() and get().shape == want.shape, (kind, shape, method, axis, quarters)
                if want.shape == shape and len(set(shape)) == 1:
                    vkt("rotate", "in.vkt", "--axis", axis, "--angle", angle, "--method", method, "-o", "out.vkt", "--force")
                    assert get().tobytes() == want.tobytes()
assert "exact" in vkt("rotate", "in.vkt", "--angle", 90, "--expand", "-n").stderr
# A third of a turn about a diagonal of space changes x to y to z.
v = noise((6, 6, 6)); put(v)
vkt("rotate", "in.vkt", "--axis", "1,1,1", "--angle", 120, "-o", "out.vkt", "--force")
assert (get() == v.transpose(1, 2, 0)).all()
# Four quarter turns of a volume that is no cube, spacings and place included.
put(noise((5, 8, 11), np.uint8), "--spacing", "1,2,3", "--origin", "4,5,6")
name = "in.vkt"
for k in range(4):
    vkt("rotate", name, "--axis", "y", "--angle", 90, "--expand", "-o", f"turn{k}.vkt", "--force"); name = f"turn{k}.vkt"
assert info("turn0.vkt")["spacing"] == [3, 2, 1] and info("turn0.vkt")["dims"] == [5, 8, 11]
vkt("diff", "in.vkt", name, "--geometry")'
}

@test "half a turn keeps every voxel, and no turn every bit: defects of others" {
    turn '
for n in (8, 33):  # SciPy once lost the corners at 180 degrees: sin(pi) is not 0
    v = np.ones((n, n, n), np.uint8)
    for axis in "xyz":
        assert (rotate(v, "--axis", axis, "--angle", 180) == 1).all()
v = noise((9, 10, 11), np.float32)  # volkit moves most voxels at 0 degrees
for axis in ("x", "1,2,3"):
    for method in ("nearest", "linear", "bspline5"):
        assert rotate(v, "--axis", axis, "--angle", 0, "--method", method).tobytes() == v.tobytes()
# The centre of mass of a blob in the middle stays there: no half voxel is lost.
z, y, x = np.indices((32, 33, 34)); c = np.array((31, 32, 33)) / 2
v = np.exp(-((z - c[0])**2 + (y - c[1])**2 + (x - c[2])**2) / 18)
for angle in (1, 121.3, 300):
    for method in ("nearest", "linear", "cubic", "bspline3"):
        got = rotate(v, "--axis", "1,1,-3", "--angle", angle, "--method", method)
        assert np.abs(np.array(nd.center_of_mass(got)) - c).max() < (2e-2 if method == "nearest" else 1e-3), (angle, method)'
}

@test "what smooth fields lose in a turn, and polynomials do not" {
    turn '
z, y, x = np.indices((24, 96, 96)); r2 = (x - 47.5)**2 + (y - 47.5)**2; disc = (r2 < 35**2) & (abs(z - 11.5) < 4)
plate = np.cos(np.pi * r2 / 96 / 4)  # frequencies up to 1/8 at the rim
def psnr(a): return 10 * np.log10(4 / ((a - plate)[disc]**2).mean())
for method, there_and_back, twelve in (("linear", 32, 18), ("cubic", 56, 42), ("bspline3", 73, 60), ("bspline5", 100, 90)):
    put(plate)
    back = rotate(rotate(plate, "--angle", 30, "--method", method), "--angle", -30, "--method", method)
    assert psnr(back) > there_and_back, (method, psnr(back))
    if method != "bspline5":
        turns = plate
        for k in range(12): turns = rotate(turns, "--angle", 30, "--method", method, "--boundary", "mirror")
        assert psnr(turns) > twelve, (method, psnr(turns))
x0, y0 = x - 47.5, y - 47.5
field = x0**2 - y0**2 + 0.01 * x0**3 + 3 * x0 * (z - 11.5)
a = np.radians(30); u, w = x0 * np.cos(a) + y0 * np.sin(a), y0 * np.cos(a) - x0 * np.sin(a)
want = u**2 - w**2 + 0.01 * u**3 + 3 * u * (z - 11.5)
for method in ("bspline3", "bspline5"):
    got = rotate(field, "--angle", 30, "--method", method)
    assert abs(got - want)[(r2 < 25**2) & (z == 11)].max() < 1e-5 * np.ptp(field), method'
}

@test "expanded, all of it is there; onto another grid, where it lies in the world" {
    turn '
v = np.full((9, 12, 20), 3, np.float64)
got = rotate(v, "--angle", 30, "--expand", "--boundary", "border:0", "--method", "linear")
assert got.shape == (9, 21, 24)  # 20 cos + 12 sin, 20 sin + 12 cos, upwards
assert abs(got.sum() - v.sum()) < 2e-3 * v.sum()
i = info()
middle = np.array(i["origin"]) + (np.array(i["dims"]) - 1) / 2
assert abs(middle - (9.5, 5.5, 4)).max() < 1e-12
v = noise((9, 12, 20)); put(v, "--origin", "10,20,30")
vkt("rotate", "in.vkt", "--axis", "0,1,2", "--angle", 50, "--expand", "--method", "linear", "-o", "all.vkt")
vkt("rotate", "in.vkt", "--axis", "0,1,2", "--angle", 50, "--like", "all.vkt", "--method", "linear", "-o", "like.vkt")
vkt("diff", "all.vkt", "like.vkt", "--geometry", "--tolerance", "1e-9")
vkt("rotate", "in.vkt", "--axis", "0,1,2", "--angle", 50, "--method", "linear", "-o", "same.vkt")
vkt("rotate", "in.vkt", "--axis", "0,1,2", "--angle", 50, "--like", "in.vkt", "--method", "linear", "-o", "like.vkt", "--force")
vkt("diff", "same.vkt", "like.vkt", "--geometry")'
}

@test "a region turns in place as if it were alone, and all else stays" {
    turn '
v = noise((14, 17, 19), np.float32); put(v)
for roi in ("3:12,4:13,2:11", "0:19,0:17,0:14", "5:6,2:15,3:12"):
    for options in (["--angle", 30], ["--axis", "1,2,0", "--angle", 77, "--method", "bspline3", "--boundary", "wrap"],
                    ["--angle", 45, "--method", "cubic", "--boundary", "mirror", "--about", "7,8,6"],
                    ["--angle", 90], ["--angle", 90, "--boundary", "wrap", "--about", "4,9,5"], ["--axis", "x", "--angle", -20, "--background", "5"]):
        vkt("rotate", "in.vkt", "--roi", roi, *options, "-o", "out.vkt", "--force", "--slab", 3)
        got = get()
        alone = list(options)
        if "--about" in alone:
            k = alone.index("--about") + 1
            low = [int(part.split(":")[0]) for part in roi.split(",")]
            alone[k] = ",".join(str(float(c) - l) for c, l in zip(alone[k].split(","), low))
        vkt("crop", "in.vkt", "--roi", roi, "-o", "part.vkt", "--force")
        vkt("rotate", "part.vkt", *alone, "-o", "part2.vkt", "--force")
        box = tuple(slice(*map(int, part.split(":"))) for part in roi.split(","))[::-1]
        want = v.copy(); want[box] = get("part2.vkt")
        assert got.tobytes() == want.tobytes(), (roi, options)
        assert info()["origin"] == info("in.vkt")["origin"]'
}

@test "not a number stays near, infinity too, and integers saturate" {
    turn '
v = np.ones((30, 30, 30), np.float32); v[15, 15, 15] = np.nan
for method, reach in (("linear", 2), ("cubic", 4), ("lanczos3", 6)):
    got = rotate(v, "--axis", "1,1,0", "--angle", 20, "--method", method, "--boundary", "clamp")
    z, y, x = np.nonzero(np.isnan(got))
    assert 0 < len(z) and max(np.ptp(z), np.ptp(y), np.ptp(x)) <= 2 * reach
    assert abs(got[~np.isnan(got)] - 1).max() < 1e-6
v = np.ones((80, 8, 8), np.float32); v[40] = np.nan
got = rotate(v, "--axis", "z", "--angle", 20, "--boundary", "clamp")
assert np.isnan(got[40]).all() and (got[[39, 41]] == 1).all()
got = rotate(v, "--axis", "x", "--angle", 20, "--boundary", "clamp", "--method", "bspline3")
assert np.isnan(got[40]).any() and (abs(got[[0, 1, 2, 77, 78, 79]] - 1) < 1e-6).all()
v = np.zeros((20, 20, 20), np.uint8); v[:, :, 10:] = 255
done = subprocess.run(["sh", "-c", "vkt rotate step.vkt --angle 10 --method cubic -o out.vkt --force"], capture_output=True, text=True) if put(v, name="step.vkt") is None else None
assert "clipped to [0,255]" in done.stderr and get().max() == 255, done.stderr
for value, kind in ((255, np.uint8), (np.float32(.1), np.float32), (2**62, np.int64), (-1.7e308, np.float64)):
    for method in ("linear", "nearest"):
        got = rotate(np.full((9, 9, 9), value, kind), "--euler", "10,20,30", "--boundary", "mirror", "--method", method)
        assert (got == np.array(value, kind)).all(), (value, method)
for kind in (np.uint8, np.uint16, np.int32):
    for method in ("cubic", "bspline3", "bspline5", "lanczos3"):
        assert (rotate(np.full((9, 9, 9), 100, kind), "--euler", "10,20,30", "--boundary", "mirror", "--method", method) == 100).all()'
}

@test "values near the largest number turn as smaller ones, and none becomes infinite or not a number" {
    turn '
most = np.finfo(float).max
volumes = dict(noise=random.uniform(-1, 1, (14, 15, 16)) * most, one=np.full((14, 15, 16), most),
               waves=(0.9 + 0.1 * np.sin(np.indices((14, 15, 16)).sum(0) / 5)) * most)
volumes["waves"][3, 4, 5] = -most
for name, v in volumes.items():
    for about in (("--axis", "z", "--angle", 30), ("--axis", "1,1,0", "--angle", 20), ("--axis", "x", "--angle", 10)):
        for method in "linear", "cubic", "lanczos3", "bspline3", "bspline5":
            for how in (("--boundary", "mirror"), ("--boundary", "border:-1e308"), ()):
                small = ("--boundary", f"border:{-1e308 * 2.0**-12!r}") if "border:-1e308" in how else how
                got = rotate(v, *about, *how, "--method", method)
                want = rotate(v * 2.0**-12, *about, *small, "--method", method)
                assert np.isfinite(got).all(), (name, about, method, how)
                assert np.array_equal(got, np.clip(want, -most * 2.0**-12, most * 2.0**-12) * 2.0**12), (name, about, method, how)
v = volumes["noise"]
v[7, 7, 7] = np.nan # stays what it is
for method in "cubic", "lanczos3", "bspline3":
    got, want = (rotate(w, "--axis", "z", "--angle", 30, "--boundary", "clamp", "--method", method) for w in (v, v * 2.0**-12))
    assert np.array_equal(np.isnan(got), np.isnan(want)) and np.isnan(got).any() and not np.isinf(got).any()
'
}

@test "single voxels, lines and planes; values with a scale and an offset" {
    turn '
for shape in ((1, 1, 1), (1, 1, 7), (1, 7, 1), (7, 1, 1), (1, 9, 8), (8, 1, 9), (2, 2, 2)):
    v = noise(shape)
    for method in ("linear", "cubic", "bspline3", "bspline5", "lanczos3"):
        for rule in ("mirror", "wrap", "clamp"):
            got = rotate(v, "--axis", "1,2,3", "--angle", 30, "--method", method, "--boundary", rule)
            assert np.isfinite(got).all() and (v.size > 1 or abs(got - v).max() < 1e-10)
v = noise((9, 10, 11), np.int16); put(v, "--slope", 0.5, "--intercept", 10)
vkt("rotate", "in.vkt", "--angle", 33, "--background", "12", "-o", "out.vkt", "--force")
assert get()[0, 0, 0] == 4 and info()["slope"] == 0.5
vkt("rotate", "in.vkt", "--angle", 33, "--boundary", "border:12", "-o", "out.vkt", "--force")
assert get()[0, 0, 0] == 4
# A background of 0 that cannot be stored is the nearest that can, and said; one that was asked for is refused.
v = noise((9, 10, 11), np.uint8); put(v, "--slope", 2, "--intercept", -1024)
said = vkt("rotate", "in.vkt", "--angle", 33, "-o", "out.vkt", "--force").stderr
assert get()[0, 0, 0] == 255 and "background -514, the nearest" in said, said
vkt("rotate", "in.vkt", "--angle", 33, "--background", 0, "-o", "never.vkt", code=2)
said = vkt("affine", "1 0 0 4  0 1 0 0.5  0 0 1 0", "in.vkt", "--unit", "voxel", "-o", "out.vkt", "--force").stderr
assert get()[0, 0, 10] == 255 and "background -514, the nearest" in said, said'
}

@test "nothing depends on slabs, threads, pipes, memory or the instruction set" {
    vkt make noise --dims 41 37 29 --seed 7 --spacing 1,1.2,1.4 -o in.vkt
    vkt convert in.vkt --dtype uint8 --range 0:1 -o bytes.vkt
    for args in "--angle 30" "--axis x --angle 30" "--axis y --angle 30" "--axis 1,2,3 --angle 40" "--angle 90 --expand" \
        "--axis 1,2,3 --angle 40 --method bspline3" "--angle 30 --method bspline5 --boundary mirror" \
        "--euler 10,20,30 --method lanczos3" "--euler 10,20,30 --method nearest" \
        "--angle 30 --roi 3:30,4:33,5:25 --method bspline3 --boundary wrap"; do
        for file in in bytes; do
            vkt rotate $file.vkt $args --slab 100 --threads 1 -q | vkt write all.raw --force
            for cut in "--slab 1 --threads 2" "--slab 3 --threads 5" "--slab 7"; do
                vkt rotate $file.vkt $args $cut -q | vkt write cut.raw --force
                cmp all.raw cut.raw
            done
            vkt read $file.vkt --slab 1 | vkt rotate $args --slab 1 -q | vkt write cut.raw --force
            cmp all.raw cut.raw
            VKT_INSTRUCTION_SET=baseline vkt rotate $file.vkt $args -q | vkt write cut.raw --force
            cmp all.raw cut.raw
        done
    done
}

@test "slices that are turned together turn as each by itself" { # sixteen at a time, where there are as many
    for type in float32 uint8 int16; do
        vkt make noise --dims 90 70 37 --dtype "$type" --seed 5 -o v.vkt --force
        vkt permute xzy v.vkt -q -o w.vkt --force
        [ "$type" != float32 ] || cp v.vkt floats.vkt
        for what in 'rotate --angle 30' 'rotate --angle 100 --expand' 'rotate --angle 45 --boundary wrap' \
            'rotate --angle 30 --roi 11:80,3.5:66,4:33' 'affine 1.3,-0.6,0,9,0.7,1.1,0,-20,0,0,1,-3' 'affine 0.04,0,0,9,0,1,0,3,0,0,1,0'; do
            # shellcheck disable=SC2086
            vkt $what v.vkt -q --slab 5 | vkt diff - <(vkt $what v.vkt -q --slab 100)
            case $what in *affine*|*roi*) continue ;; esac
            # shellcheck disable=SC2086
            vkt $what --axis y w.vkt -q --slab 100 | vkt permute xzy | vkt diff - <(vkt ${what/--angle /--angle -} --axis z v.vkt -q) --tolerance 1e-4
        done
    done
    # By every method, about both axes, whatever is cut.
    for method in nearest cubic lanczos3 bspline3 bspline5; do
        for axis in z y; do
            vkt rotate --axis $axis --angle 25 --method $method floats.vkt -q --threads 1 -o whole.vkt --force
            for cut in '--slab 5' '--slab 1 --threads 3' '--memory 1M'; do
                # shellcheck disable=SC2086
                vkt rotate --axis $axis --angle 25 --method $method floats.vkt -q $cut | vkt diff - whole.vkt
            done
        done
    done
    # Numbers that are none stay where they are, whether their slices are turned together or not.
    vkt transform 'mod(x*7+y*3+z, 11) == 0 ? (z > 20 ? 0/0 : 1/0) : v' floats.vkt -q | vkt rotate --angle 20 -q --slab 5 -o few.vkt
    vkt transform 'mod(x*7+y*3+z, 11) == 0 ? (z > 20 ? 0/0 : 1/0) : v' floats.vkt -q | vkt rotate --angle 20 -q --slab 100 -o all.vkt
    vkt diff few.vkt all.vkt
}

@test "coefficients of splines are kept where memory does not hold them, and change nothing" {
    vkt make noise --dims 150 110 90 --dtype uint8 --seed 3 -o in.vkt
    for args in "--axis 1,2,3 --angle 25 --method bspline3" "--angle 30 --method bspline5 --boundary border:7"; do
        vkt rotate in.vkt $args -q | vkt write all.raw --force
        for memory in 1MiB 8MiB; do
            vkt rotate in.vkt $args --memory $memory -q | vkt write little.raw --force
            cmp all.raw little.raw
        done
    done
}

@test "what is asked for must make sense" {
    vkt make noise --dims 8 8 8 -o in.vkt
    fails_with 2 'by how much' vkt rotate in.vkt -o x.vkt
    fails_with 2 'only one of' vkt rotate in.vkt --angle 3 --euler 1,2,3 -o x.vkt
    fails_with 2 'no direction' vkt rotate in.vkt --axis 0,0,0 --angle 3 -o x.vkt
    fails_with 2 'three numbers' vkt rotate in.vkt --axis 1,2 --angle 3 -o x.vkt
    fails_with 2 'no rotation' vkt rotate in.vkt --quaternion 0,0,0,0 -o x.vkt
    fails_with 2 'goes with --angle' vkt rotate in.vkt --axis x --euler 1,2,3 -o x.vkt
    fails_with 2 'does not apply' vkt rotate in.vkt --angle 3 --roi 0:4,0:4,0:4 --expand -o x.vkt
    fails_with 2 'does not apply' vkt rotate in.vkt --angle 3 --like in.vkt --expand -o x.vkt
    fails_with 2 'does not apply' vkt rotate in.vkt --angle 3 --boundary wrap --background 3 -o x.vkt
    fails_with 2 'cannot be stored in uint8' sh -c 'vkt convert in.vkt --dtype uint8 | vkt rotate --angle 3 --background=-1 -o x.vkt'
    fails_with 2 'make it a grid first' sh -c 'vkt make amr --blocks 20 --levels 2 -o tree.vkt && vkt rotate tree.vkt --angle 3 -o x.vkt'
    fails_with 2 "not one of" vkt rotate in.vkt --angle 3 --method area -o x.vkt
    [ ! -e x.vkt ]
    vkt rotate in.vkt --axis 0,0,-5e300 --angle -90 | vkt diff - <(vkt rotate in.vkt --angle 90) # any length will do
}

@test "what does not move in parts of voxels stays, to the last bit" {
    turn '
v = random.normal(0, 1, (20, 24, 28))
for method in ("nearest", "linear", "cubic", "bspline3", "lanczos3", "auto"):
    for roi in ("1.5:20.25,2.75:19.5,3.3:15.8", "2.7:12.9,2.1:12.3,2.5:12.5"):
        rotate(v, "--angle", 0, "--roi", roi, "--method", method)
        assert (get() == v).all(), (method, roi, (get() != v).sum())
# Half a turn of a single value is this value, as far as shares that are the same on both sides go.
rotate(np.full(v.shape, 0.1), "--angle", 180, "--roi", "1.5:20.25,2.75:19.5,3.3:15.8")
assert (get() == 0.1).all(), np.unique(get())'
}

@test "a region whose ends lie between voxels turns about its middle, as SciPy turns the voxels it touches; those it covers partly get their share" {
    python_with numpy scipy
    vkt make noise --dims 20 15 10 --dtype float32 -o v.nrrd
    vkt convert v.nrrd --dtype uint8 --range 0:1 | vkt set --slope 1 --intercept 0 -o u.nrrd
    vkt write u.nrrd u.npy
    vkt write v.nrrd v.npy
    roi=1.5:15.25,2.75:9.6,1:
    vkt rotate v.nrrd --roi $roi --angle 25 --boundary clamp -o clamp.npy
    vkt rotate v.nrrd --roi $roi --angle 25 --background -3 -o background.npy 2>said
    vkt rotate u.nrrd --roi $roi --angle 25 -o bytes.npy
    vkt scale v.nrrd --roi $roi --factor 0.7,0.7,0.9 --method linear -o scaled.npy
    vkt rotate v.nrrd --roi $roi --angle 180 -o turned.npy
    vkt rotate v.nrrd --roi $roi --angle 25 --method nearest -o nearest.npy
    /usr/bin/python3 - <<'END'
import re
import numpy as np
from scipy import ndimage
v, u = (np.load(n).reshape(10, 15, 20).astype(float) for n in ("v.npy", "u.npy"))
low, high = np.array([1, 2.75, 1.5]), np.array([10, 9.6, 15.25]) # z, y, x, from outer faces
touched = [(int(np.floor(a)), int(np.ceil(b))) for a, b in zip(low, high)]
box = tuple(slice(*t) for t in touched)
first = np.array([t[0] for t in touched])
begin = [np.clip(np.arange(*t), a, None) for t, a in zip(touched, low)]
end = [np.clip(np.arange(*t) + 1, None, b) for t, b in zip(touched, high)]
share = np.einsum("i,j,k", *(e - b for b, e in zip(begin, end)))
centres = np.stack(np.meshgrid(*((b + e) / 2 for b, e in zip(begin, end)), indexing="ij"), -1)
def moved(v, m, background=None):
    """m: from places of the result to places it comes from, about the middle of the region."""
    middle = (low + high) / 2 - 0.5 - first
    inside = ndimage.affine_transform(v[box], m, middle - m @ middle, order=1, mode="nearest")
    if background is not None:
        source = (centres - (low + high) / 2) @ m.T + (low + high) / 2
        inside[((source < low - 1e-6) | (source >= high - 1e-6)).any(-1)] = background
    want = v.copy()
    want[box] = inside * share + v[box] * (1 - share)
    return want
def turn(angle):
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
load = lambda name: np.load(name + ".npy").reshape(v.shape)
for name, want in (("clamp", moved(v, turn(25))), ("background", moved(v, turn(25), -3)), ("scaled", moved(v, np.diag([1 / 0.9, 1 / 0.7, 1 / 0.7]), 0)),
                   ("turned", moved(v, turn(180), 0))):
    assert abs(load(name) - want).max() < 2e-6, (name, abs(load(name) - want).max())
assert not (load("turned") == 0).any()
assert abs(load("bytes") - moved(u, turn(25), 0)).max() <= 0.5 + 1e-5
# As many are told of as got background.
outside = int(((moved(v, turn(25), -1e9) < -1e6)).sum())
assert int(re.search(r"(\d+) of", open("said").read())[1]) == outside, (open("said").read(), outside)
# Nearest makes no means: the region has the voxels whose centres lie in it.
same = load("nearest") == v
centre_in = [np.array([a <= i + 0.5 < b for i in range(n)]) for a, b, n in zip(low, high, v.shape)]
assert same[~np.einsum("i,j,k", *centre_in).astype(bool)].all() and np.isin(load("nearest"), np.append(v, 0).astype("f4")).all()
END
    # What a region loses to the background is its volume, exactly.
    vkt make constant --dims 20 15 10 --dtype float64 --value 1 -o one.nrrd
    vkt affine '1 0 0 100  0 1 0 0  0 0 1 0' one.nrrd --roi 1.5:15.25,2.75:9.625,1.125:1.375 -q | vkt stats --json | /usr/bin/python3 -c '
import json, sys
assert json.load(sys.stdin)["sum"] == 20 * 15 * 10 - 13.75 * 6.875 * 0.25'
    # Slabs, threads and pipes make no difference; errors that travel stay true.
    for options in '--angle 25' '--angle 30 --axis 1,1,0 --method bspline3 --boundary wrap' '--angle 90 --boundary mirror'; do
        for dtype in uint8 float32; do
            vkt convert u.nrrd --dtype $dtype -o in.nrrd --force
            # shellcheck disable=SC2086
            vkt rotate in.nrrd --roi $roi $options --slab 10 --threads 1 -o whole.nrrd --force -q
            for slab in 1 3; do
                # shellcheck disable=SC2086
                vkt read in.nrrd --slab 2 | vkt rotate --roi $roi $options --slab $slab --threads 3 -q | vkt diff - whole.nrrd
            done
        done
    done
    vkt write u.nrrd u_20x15x10_uint8.raw
    vkt rotate u_20x15x10_uint8.raw --roi $roi --angle 25 -q | vkt info | grep -q '^error      within 0\.5'
    # Ends on faces are the same region, bit for bit, and in the other operations too.
    for what in 'rotate --angle 20' 'scale --factor 1.3'; do
        # shellcheck disable=SC2086
        vkt $what v.nrrd --roi 2.0:15,3:9.0,: | vkt diff - <(vkt $what v.nrrd --roi 2:15,3:9,:)
    done
    vkt affine '1 0 0 1  0 1 0 0  0 0 1 0' v.nrrd --roi 1.5:15.4,:,: --method nearest | vkt diff - <(vkt affine '1 0 0 1  0 1 0 0  0 0 1 0' v.nrrd --roi 1:15,:,:)
    fails_with 2 "holds no voxel's centre" vkt scale v.nrrd --roi 1.6:2.4,:,: --factor 2 --method nearest
    fails_with 2 "does not name three ranges" vkt rotate v.nrrd --roi 1.5:3 --angle 3
}
