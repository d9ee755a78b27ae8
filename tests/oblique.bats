# vkt slice --normal: planes at any angle, against SimpleITK, SciPy and the slices across axes.
load helper

# judge PYTHON: runs it with a turned volume in.nrrd, SimpleITK, SciPy and vkt at hand.
judge() {
    python_with SimpleITK scipy
    /usr/bin/python3 - <<PY
import subprocess, numpy as np, scipy.ndimage as nd, SimpleITK as itk
random = np.random.default_rng(14)
def vkt(*words, code=0):
    done = subprocess.run(("vkt",) + tuple(map(str, words)), capture_output=True, text=True, errors="replace")
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done
v = nd.gaussian_filter(random.uniform(1, 1000, (17, 21, 24)), .8)
i = itk.GetImageFromArray(v)
i.SetSpacing((1.2, 0.7, 2.1)); i.SetOrigin((-30, 12, 7))
q = np.linalg.qr(random.normal(size=(3, 3)))[0]
q *= np.sign(np.linalg.det(q))
i.SetDirection(q.ravel())
itk.WriteImage(i, "in.nrrd")
n, s, o = np.array((24, 21, 17)), np.array(i.GetSpacing()), np.array(i.GetOrigin())
middle = o + q @ (s * (n - 1) / 2)
words_of = lambda p: ",".join(repr(float(x)) for x in p)
# slice_of: the picture, and its origin, spacing and directions (columns).
def slice_of(normal, *options, name="in.nrrd"):
    vkt("slice", name, "--normal=" + words_of(normal), *options, "-o", "out.nrrd", "--force")
    r = itk.ReadImage("out.nrrd")
    assert r.GetSize()[2] == 1
    return itk.GetArrayFromImage(r)[0], np.array(r.GetOrigin()), np.array(r.GetSpacing()), np.array(r.GetDirection()).reshape(3, 3)
# places: continuous indices (z, y, x) of the pixels, moved along the normal.
def places(shape, origin, spacing, d, along=0.):
    y, x = np.indices(shape)
    world = origin[:, None, None] + d[:, 0, None, None] * spacing[0] * x + d[:, 1, None, None] * spacing[1] * y + d[:, 2, None, None] * along
    return (np.tensordot(q.T, world - o[:, None, None], 1) / s[:, None, None])[::-1]
def inside(p):
    return np.all([(p[a] >= -.5) & (p[a] < m - .5) for a, m in enumerate(v.shape)], axis=0)
def sampled(p, order):
    held = [np.clip(p[a], 0, m - 1) for a, m in enumerate(v.shape)] if order == 1 else p
    return nd.map_coordinates(v, held, order=order, mode="reflect" if order != 1 else "nearest")
$1
PY
}

@test "pixels are where the header says, and hold what SciPy finds there" {
    judge '
for normal, at, up in (((1, .3, -.2), None, None), ((.2, -1, .7), (1., -2, 3), (0, 0, 1)), ((-1, -1, -1), (-2, 1, 1), (0, -1, .2))):
    options = () if at is None else ("--at=" + words_of(middle + at),)
    options += () if up is None else ("--up=" + words_of(up),)
    unit = np.array(normal) / np.linalg.norm(normal)
    for order, method in ((1, "linear"), (0, "nearest"), (3, "bspline3")):
        # Smooth methods average where pixels are wider than voxels.
        width = .8 if order < 3 else .6
        got, origin, spacing, d = slice_of(normal, *options, "--spacing", width, "--method", method)
        assert np.allclose(d.T @ d, np.eye(3), atol=1e-9) and np.allclose(d[:, 2], unit, atol=1e-9)
        assert np.allclose(spacing[:2], width)
        # The plane goes through the point, and the pixels lie around the middle of the volume and cover it.
        point = middle + (np.zeros(3) if at is None else at)
        assert abs((origin - point) @ unit) < 1e-9
        for a in (0, 1):
            count = got.shape[1 - a]
            assert abs((origin + d[:, a] * width * (count - 1) / 2 - middle) @ d[:, a]) < 1e-9
            extent = (n * s * abs(d[:, a] @ q)).sum()
            assert count * width >= extent - 1e-5 and (count - 1) * width < extent
        if up is not None:
            assert abs(d[:, 0] @ up) < 1e-9 and d[:, 1] @ up < 0 and np.linalg.det(d) > .99
        p = places(got.shape, origin, spacing, d)
        # Away from faces and ties, where rounding decides.
        core = np.all([(p[a] > .01) & (p[a] < m - 1.01) for a, m in enumerate(v.shape)], axis=0)
        if method == "nearest": core &= np.all(abs(p - np.floor(p) - .5) > 1e-5, axis=0)
        bound = 1e-5 if method != "bspline3" else 5e-3
        if method == "bspline3": core = np.all([(p[a] > 6) & (p[a] < m - 7) for a, m in enumerate(v.shape)], axis=0)
        assert core.sum() > 30 and abs(got - sampled(p, order))[core].max() < bound, (method, abs(got - sampled(p, order))[core].max())
        assert (got[~inside(p)] == 0).all()
        if method == "linear": assert abs(got - sampled(p, 1))[inside(p)].max() < 1e-4'
}

@test "SimpleITK resamples the same picture" {
    judge '
got, origin, spacing, d = slice_of((1, 2, 3), "--method", "linear", "--background", "-7")
grid = itk.Image(got.shape[1], got.shape[0], 1, itk.sitkFloat64)
grid.SetOrigin(tuple(origin)); grid.SetSpacing(tuple(spacing)); grid.SetDirection(tuple(d.ravel()))
want = itk.GetArrayFromImage(itk.Resample(i, grid, itk.Transform(), itk.sitkLinear, -7.))[0]
core = (got != -7) & (want != -7)
assert core.sum() > 200 and abs(got - want)[core].max() < 1e-5 and abs(core.sum() - (want != -7).sum()) < 4'
}

@test "along the axes planes are slices, bit for bit" {
    judge '
for a, axis in enumerate("xyz"):
    for number in (0, 5, n[a] - 1):
        at = o + q[:, a] * s[a] * number
        vkt("slice", "in.nrrd", "--" + axis, number, "-o", "want.nrrd", "--force")
        for sign in (1, -1):
            for method in ("auto", "linear", "bspline5"):
                vkt("slice", "in.nrrd", "--normal=" + words_of(sign * q[:, a]), "--at=" + words_of(at), "--method", method, "-o", "got.nrrd", "--force")
                want, got = itk.ReadImage("want.nrrd"), itk.ReadImage("got.nrrd")
                assert itk.GetArrayFromImage(want).tobytes() == itk.GetArrayFromImage(got).tobytes(), (axis, number)
                assert got.GetSpacing() == want.GetSpacing() and np.allclose(got.GetOrigin(), want.GetOrigin(), atol=1e-9)
                w, g = (np.array(r.GetDirection()).reshape(3, 3) for r in (want, got))
                assert np.array_equal(w[:, :2], g[:, :2]) and np.array_equal(g[:, 2], sign * w[:, 2])
            vkt("diff", "want.nrrd", "got.nrrd", *(("--geometry",) if sign > 0 else ()))'
    for type in uint8 int64 float16; do
        vkt make noise --dims 9 8 7 --dtype $type --high 100 -o $type.vkt
        vkt slice $type.vkt --normal 0,1,0 --at 0,3,0 --format raw -o got.raw --force
        vkt slice $type.vkt --y 3 --format raw -o - | cmp - got.raw
    done
}

@test "a slab is the mean, maximum or minimum of its layers, without what lies outside" {
    judge '
v32 = v.astype(np.float32).astype(np.float64)
for kind, name in ((np.uint16, "u"), (np.float32, "f")):
    j = itk.GetImageFromArray(v.astype(kind)); j.CopyInformation(i); itk.WriteImage(j, name + ".nrrd")
for project in ("mean", "max", "min"):
    for name, dtype in (("in", None), ("f", np.float32), ("u", np.uint16)):
        got, origin, spacing, d = slice_of((1, .4, -.3), "--thickness", 6, "--project", project, "--spacing", 1, "--method", "linear", name=name + ".nrrd")
        assert dtype is None or got.dtype == dtype
        assert abs(spacing[2] - 6) < 1e-9
        unit = d[:, 2]
        step = 1 / np.linalg.norm(q.T @ unit / s)
        k = int(np.ceil(6 / step - 1e-6))
        data = v if dtype is None else v.astype(dtype).astype(float)
        layers = []
        for l in range(k):
            p = places(got.shape, origin, spacing, d, ((l + .5) / k - .5) * 6)
            values = nd.map_coordinates(data, [np.clip(p[a], 0, m - 1) for a, m in enumerate(v.shape)], order=1, mode="nearest")
            layers.append(np.where(inside(p), values, np.nan))
        layers = np.array(layers); none = np.isnan(layers).all(axis=0)
        with np.errstate(all="ignore"):
            import warnings; warnings.simplefilter("ignore")
            want = {"mean": np.nanmean, "max": np.nanmax, "min": np.nanmin}[project](layers, axis=0)
        assert none.any() and not none.all() and (got[none] == 0).all()
        error = abs(got.astype(float) - want)[~none]
        # A sample at a face is in or out by rounding.
        assert np.percentile(error, 99) < (.5001 if name == "u" else 1e-3), (project, name, np.percentile(error, 99))
mean = slice_of((1, .4, -.3), "--thickness", 6)[0]
assert (mean == slice_of((1, .4, -.3), "--thickness", 6, "--project", "mean")[0]).all()
# Of layers that are voxels a slab is what vkt project makes of them.
vkt("crop", "in.nrrd", "--roi", ":,:,4:9", "-o", "part.nrrd")
for project in ("max", "min", "mean"):
    vkt("project", project, "part.nrrd", "-o", "want.nrrd", "--force")
    vkt("slice", "in.nrrd", "--normal=" + words_of(q[:, 2]), "--at=" + words_of(o + q[:, 2] * s[2] * 6), "--thickness", 5 * s[2], "--project", project, "-o", "got.nrrd", "--force")
    vkt("diff", "want.nrrd", "got.nrrd", "--geometry", "--tolerance", "1e-9")'
    # Where more means less.
    vkt make noise --dims 9 8 7 --dtype uint8 --high 255 -o n.nrrd
    vkt set n.nrrd --slope -1 --intercept 255 -o m.nrrd
    vkt slice m.nrrd --normal 0,0,1 --thickness 7 --project max -o a.nrrd
    vkt project max m.nrrd | vkt diff - a.nrrd
}

@test "slabs, threads, pipes and small budgets make no difference to a plane" {
    vkt make noise --dims 40 33 27 --dtype uint16 --high 60000 -o v.nrrd
    for options in '--spacing 0.7' '--thickness 9 --project max' '--method bspline3 --thickness 4'; do
        # shellcheck disable=SC2086
        vkt slice v.nrrd --normal 1,2,-1 $options --format raw -o want.raw --force
        for more in '--slab 1' '--slab 3' '--threads 1' '--threads 5' '--memory 300k'; do
            # shellcheck disable=SC2086
            vkt slice v.nrrd --normal 1,2,-1 $options $more --format raw -o - | cmp - want.raw
            # shellcheck disable=SC2086
            vkt read v.nrrd --slab 2 | vkt slice --normal 1,2,-1 $options $more --format raw -o - | cmp - want.raw
        done
    done
}

@test "pictures of planes, with a range or without" {
    vkt make noise --dims 30 20 10 --low -3 --high 8 -o n.nrrd
    for range in 0:5 minmax p1:p99; do
        vkt slice n.nrrd --normal 1,1,3 --range $range -o a.nrrd --force
        vkt slice n.nrrd --normal 1,1,3 | vkt convert --dtype uint8 --range $range 2>/dev/null | vkt diff - a.nrrd
        vkt slice n.nrrd --normal 1,1,3 --range $range -o a.png --force
        vkt write a.nrrd - --format png | cmp - a.png
    done
    for i in 1 2; do vkt make noise --dims 9 8 7 --dtype uint8 --high 255 --seed $i -o in-$i.nrrd; done
    vkt read 'in-*.nrrd' | vkt slice --normal 1,0,2 -o 'p-%d.png'
    for i in 1 2; do vkt slice in-$i.nrrd --normal 1,0,2 -o - --format png | cmp - p-$((i - 1)).png; done
}

@test "planes say their method, their error and what is outside" {
    vkt make noise --dims 30 20 10 -o n.nrrd
    vkt slice n.nrrd --normal 1,1,3 --thickness 4 --explain -o x.nrrd 2>explained
    grep -q 'linear, mean of 4 layers' explained
    vkt slice n.nrrd --normal 1,1,3 -o o.vkt 2>remarks
    grep -q 'outside the volume: background' remarks
    # Cubes stay cubes.
    vkt info o.vkt | grep -x 'spacing    1 1 1.*'
    vkt convert n.nrrd --range 0:1 --dtype uint16 -o u.vkt
    for range in '' '--range 0:1'; do
        # shellcheck disable=SC2086
        vkt slice u.vkt --normal 1,1,3 $range | vkt info >information
        grep '^error ' information
        ! grep 'error.*unknown' information || false
    done
    vkt history o.vkt | grep -- '--normal 1,1,3'
}

@test "planes that cannot be are refused" {
    vkt make noise --dims 9 8 7 -o v.nrrd
    fails_with 2 'does not meet the volume' vkt slice v.nrrd --normal 1,1,1 --at 99,0,0 -o x.nrrd
    vkt slice v.nrrd --normal 1,0,0 --at 12,0,0 --thickness 20 -o thick.nrrd
    fails_with 2 'no direction' vkt slice v.nrrd --normal 0,0,0 -o x.nrrd
    fails_with 2 'no direction in the plane' vkt slice v.nrrd --normal 1,2,3 --up -2,-4,-6 -o x.nrrd
    fails_with 2 '--normal says where' vkt slice v.nrrd --normal 1,0,0 --x 3 -o x.nrrd
    fails_with 2 '--thickness is for planes' vkt slice v.nrrd --z 3 --thickness 3 -o x.nrrd
    fails_with 2 'needs --thickness' vkt slice v.nrrd --normal 1,0,0 --project max -o x.nrrd
    fails_with 2 'no length above 0' vkt slice v.nrrd --normal 1,0,0 --spacing 0 -o x.nrrd
    fails_with 2 'no length above 0' vkt slice v.nrrd --normal 1,0,0 --thickness -1 -o x.nrrd
    fails_with 2 'voxels along an axis' vkt slice v.nrrd --normal 1,1,0 --spacing 1e-14 -o x.nrrd
    fails_with 2 'cannot be stored' bash -c "vkt convert v.nrrd --dtype uint8 | vkt slice --normal 1,1,0 --background 300 -o x.nrrd"
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical' vkt slice t.vkt --normal 1,1,0 -o x.nrrd
    [ ! -e x.nrrd ]
}
