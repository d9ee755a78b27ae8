# vkt affine: matrices and ITK transforms, with ITK and SciPy as oracles.
load helper

# itk PYTHON: runs it with a turned volume in.nrrd, ITK and vkt at hand.
itk() {
    python_with SimpleITK scipy
    /usr/bin/python3 - <<PY
import subprocess, numpy as np, scipy.ndimage as nd, SimpleITK as itk
random = np.random.default_rng(8)
def vkt(*words, code=0):
    done = subprocess.run(("vkt",) + tuple(map(str, words)), capture_output=True, text=True, errors="replace")
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done
v = random.uniform(1, 100, (14, 15, 16))
i = itk.GetImageFromArray(v)
i.SetSpacing((1.2, 0.9, 1.1)); i.SetOrigin((-30, 12, 7))
q = np.linalg.qr(random.normal(size=(3, 3)))[0]
i.SetDirection((q * np.sign(np.linalg.det(q))).ravel())
itk.WriteImage(i, "in.nrrd")
middle = i.TransformContinuousIndexToPhysicalPoint((7.5, 7, 6.5))
def affine(*options, name="in.nrrd"):
    vkt("affine", *options, name, "-o", "out.nrrd", "--force")
    return itk.GetArrayFromImage(itk.ReadImage("out.nrrd"))
def same(t, got):
    want = itk.GetArrayFromImage(itk.Resample(i, i, t, itk.sitkLinear, 0.0))
    core = (got != 0) & (want != 0)
    assert (got != 0).sum() == (want != 0).sum() or abs((got != 0).sum() - (want != 0).sum()) < 5
    assert core.sum() > 200 and abs(got - want)[core].max() < 1e-5, (core.sum(), abs(got - want)[core].max())
$1
PY
}

@test "ITK's transform files mean what ITK does with them" {
    itk '
affine3 = itk.AffineTransform(3); affine3.SetMatrix((1.1, .1, 0, -.2, .9, .05, .1, 0, 1.05)); affine3.SetTranslation((1, -2, .5)); affine3.SetCenter(middle)
euler = itk.Euler3DTransform(middle, .2, -.3, .4, (1, 0, -1))
zyx = itk.Euler3DTransform(middle, .2, -.3, .4, (1, 0, -1)); zyx.SetComputeZYX(True)
rigid = itk.VersorRigid3DTransform(); rigid.SetCenter(middle); rigid.SetRotation((1., 2., -1.), .4); rigid.SetTranslation((0, 1, 0))
similar = itk.Similarity3DTransform(1.2, (1., 0., -1.), .3, (1, 2, 0), middle)
versor = itk.VersorTransform((0., 1., 1.), .5, middle)
shift = itk.TranslationTransform(3, (2.5, -1.25, 3))
larger = itk.ScaleTransform(3, (1.2, .8, 1.1)); larger.SetCenter(middle)
both = itk.CompositeTransform([affine3, euler, shift])
for t in (affine3, euler, zyx, rigid, similar, versor, shift, larger, both, itk.Transform(3, itk.sitkIdentity)):
    itk.WriteTransform(t, "t.tfm")
    same(t, affine("t.tfm", "--method", "linear"))
itk.WriteTransform(rigid, "t.tfm")
vkt("affine", "t.tfm", "in.nrrd", "-o", "there.nrrd", "--like", "in.nrrd", "--method", "linear")
same(rigid, itk.GetArrayFromImage(itk.ReadImage("there.nrrd")))
# The same volume seen in another frame moves to the same place.
vkt("affine", "t.tfm", "in.nrrd", "--method", "linear", "-o", "lps.nrrd")
place = [[f"{s * float(x)!r}" for s, x in zip((-1, -1, 1), triple)] for triple in (i.GetOrigin(), *np.array(i.GetDirection()).reshape(3, 3).T)]
vkt("set", "in.nrrd", "--attribute", "space=right-anterior-superior", "--origin=" + ",".join(place[0]), "--direction=" + ",".join(sum(place[1:], [])), "-o", "ras.nrrd")
vkt("affine", "t.tfm", "ras.nrrd", "--method", "linear", "-o", "ras2.nrrd")
vkt("diff", "lps.nrrd", "ras2.nrrd", "--tolerance", "1e-9")'
}

@test "every linear transform that ITK writes moves points as ITK does, of float and double, alone and composed" {
    itk '
# Volumes whose values are places: at p the result shows T(p), as linear interpolation has it exactly.
shape = (41, 43, 45)
grid = np.indices(shape).astype(float)[::-1] # x, y, z
places = np.einsum("ij,jzyx->izyx", np.diag((1.2, 0.9, 1.1)), grid) + np.array((-30, 12, 7.)).reshape(3, 1, 1, 1)
for axis in range(3):
    part = itk.GetImageFromArray(places[axis]); part.SetSpacing((1.2, 0.9, 1.1)); part.SetOrigin((-30, 12, 7))
    itk.WriteImage(part, f"place{axis}.nrrd")
low, high = places.min((1, 2, 3)), places.max((1, 2, 3))
def moved(name):
    return np.array([affine(name, "--method", "linear", "--background", "1e6", name=f"place{axis}.nrrd") for axis in range(3)])
def judge(transform, name, bound=1e-9):
    got, compared = moved(name), 0
    for at in random.integers(0, shape, (600, 3)):
        want = np.array(transform.TransformPoint(tuple(places[:, at[0], at[1], at[2]].tolist())))
        if ((want < low + 1e-6) | (want > high - 1e-6)).any():
            continue
        compared += 1
        assert abs(got[:, at[0], at[1], at[2]] - want).max() < bound, (name, transform, got[:, at[0], at[1], at[2]], want)
    assert compared > 60, (name, compared)
centre, turn, move = (-3.5, 31.25, 29.), (0.11, -0.07, 0.2), (1.5, -2.25, 0.75)
scale, skew3, skew6 = (1.1, 0.9, 1.05), (0.05, -0.1, 0.07), (0.05, -0.1, 0.07, 0.02, -0.03, 0.04)
made = {
    "AffineTransform": (1.1, .1, 0, -.2, .9, .05, .1, 0, 1.05) + move, "Euler3DTransform": turn + move, "VersorTransform": turn,
    "VersorRigid3DTransform": turn + move, "Similarity3DTransform": turn + move + (1.1,), "ScaleTransform": scale,
    "ScaleVersor3DTransform": turn + move + scale, "ScaleSkewVersor3DTransform": turn + move + scale + skew6,
    "ComposeScaleSkewVersor3DTransform": turn + move + scale + skew3, "TranslationTransform": move}
of = {}
for name, parameters in made.items():
    t = itk.TranslationTransform(3) if name == "TranslationTransform" else itk.AffineTransform(3) if name == "AffineTransform" else itk.ScaleTransform(3) if name == "ScaleTransform" else getattr(itk, name)()
    if name != "TranslationTransform":
        t.SetCenter(centre)
    t.SetParameters(parameters)
    itk.WriteTransform(t, name + ".tfm")
    judge(t, name + ".tfm")
    of[name] = t
    text = open(name + ".tfm").read().replace("_double_", "_float_")
    open("f.tfm", "w").write(text)
    judge(t, "f.tfm")
# Composites of them, and what SimpleITK only reads.
for names in (("ScaleSkewVersor3DTransform", "Similarity3DTransform", "TranslationTransform"), ("ComposeScaleSkewVersor3DTransform", "ScaleVersor3DTransform", "AffineTransform")):
    both = itk.CompositeTransform([of[n] for n in names])
    itk.WriteTransform(both, "composite.tfm")
    judge(both, "composite.tfm")
def written(name, parameters, fixed):
    words = lambda v: " ".join(map(repr, v))
    open(name + ".tfm", "w").write(f"#Insight Transform File V1.0\n#Transform 0\nTransform: {name}_double_3_3\nParameters: {words(parameters)}\nFixedParameters: {words(fixed)}\n")
    return name + ".tfm"
quaternion = np.array((0.1, -0.2, 0.15, -0.9)); quaternion /= np.linalg.norm(quaternion)
for name, parameters in (("MatrixOffsetTransformBase", made["AffineTransform"]), ("QuaternionRigidTransform", tuple(quaternion.tolist()) + move), ("ScaleLogarithmicTransform", (0.1, -0.05, 0.02))):
    judge(itk.ReadTransform(written(name, parameters, centre)), name + ".tfm")
# Centres among the parameters.
judge(of["Euler3DTransform"], written("CenteredEuler3DTransform", turn + centre + move, (0., 0., 0.)))
judge(of["AffineTransform"], written("CenteredAffineTransform", made["AffineTransform"][:9] + centre + move, (0., 0., 0.)))
# What is not linear is refused by its name, however many numbers it has, also among others.
spline = itk.BSplineTransform(3, 3); spline.SetTransformDomainMeshSize((4, 4, 4))
itk.WriteTransform(spline, "spline.tfm")
mixed = itk.CompositeTransform([of["Euler3DTransform"], spline]); itk.WriteTransform(mixed, "mixed.tfm")
field = itk.DisplacementFieldTransform(itk.Image((6, 5, 4), itk.sitkVectorFloat64, 3)); itk.WriteTransform(field, "field.tfm")
for name, kind in (("spline.tfm", "BSplineTransform"), ("mixed.tfm", "BSplineTransform"), ("field.tfm", "DisplacementFieldTransform")):
    assert kind + " is not linear" in vkt("affine", name, "in.nrrd", "-o", "x.nrrd", code=3).stderr
assert "length 1" in vkt("affine", written("QuaternionRigidTransform", (1., 0., 0., 1.) + move, centre), "in.nrrd", "-o", "x.nrrd", code=3).stderr'
}

@test "matrices of voxels are SciPy's, and the inverse moves what the other moves back" {
    itk '
m = np.array(((1.05, .2, 0), (-.1, .95, .1), (0, -.2, 1.1))); t = np.array((1.5123, -2.017, .2571))
words = " ".join(map(str, np.c_[m, t].ravel()))
for order, method in ((0, "nearest"), (1, "linear"), (3, "bspline3"), (5, "bspline5")):
    # Wider than a voxel of the input: smooth methods would average.
    k = m * .9 if order > 1 else m
    words = " ".join(map(str, np.c_[k, t].ravel()))
    got = affine(words, "--unit", "voxel", "--method", method, "--boundary", "mirror")
    want = nd.affine_transform(v, k[::-1, ::-1], t[::-1], order=order, mode="reflect")
    assert abs(got - want).max() < 1e-5, (method, abs(got - want).max())
x = np.c_[m, t]; inverse = np.linalg.inv(np.r_[x, ((0, 0, 0, 1),)])
a = affine(words, "--unit", "voxel", "--method", "linear")
b = affine(",".join(map(repr, map(float, np.linalg.inv(np.r_[np.c_[k, t], ((0, 0, 0, 1),)]).ravel()))), "--inverse", "--unit", "voxel", "--method", "linear")
assert abs(a - b).max() < 1e-6
np.savetxt("m.txt", np.r_[np.c_[k, t], ((0, 0, 0, 1),)], header="x y z shift")
assert (affine("m.txt", "--unit", "voxel", "--method", "linear") == a).all()
# World coordinates: the matrix of the index map, through the geometry.
d = np.array(i.GetDirection()).reshape(3, 3) * i.GetSpacing(); o = np.array(i.GetOrigin())
w = d @ k @ np.linalg.inv(d); s = d @ t + o - w @ o
got = affine(" ".join(map(repr, map(float, np.c_[w, s].ravel()))), "--method", "linear")
assert abs(got - a)[(got != 0) & (a != 0)].max() < 1e-5'
}

@test "whole shifts, mirrors and axes that change places move bytes" {
    itk '
for kind in (np.uint16, np.float64):
    b = np.frombuffer(random.bytes(9 * 9 * 9 * np.dtype(kind).itemsize), kind).reshape(9, 9, 9)
    b.tofile(f"b_9x9x9_{np.dtype(kind)}.raw")
    for words, want in (("1 0 0 2 0 1 0 -1 0 0 1 0", np.pad(b, ((0, 0), (1, 0), (0, 2)))[:, :9, 2:]),
                        ("-1 0 0 8 0 1 0 0 0 0 1 0", b[:, :, ::-1]), ("0 1 0 0 0 0 1 0 1 0 0 0", b.transpose(1, 0, 2).transpose(0, 2, 1).transpose(0, 1, 2))):
        for method in ("auto", "linear", "bspline3"):
            vkt("affine", words, f"b_9x9x9_{np.dtype(kind)}.raw", "--unit", "voxel", "--method", method, "-o", "out.vkt", "--force")
            vkt("write", "out.vkt", "out.raw", "--force")
            got = np.fromfile("out.raw", kind).reshape(9, 9, 9)
            if words.startswith("0 1"):  # input x, y, z are output y, z, x
                want = np.empty_like(b)
                z, y, x = np.indices(b.shape)
                want = b[x, z, y]
            assert got.tobytes() == want.tobytes(), (words, method)
done = vkt("affine", "1 0 0 2 0 1 0 0 0 0 1 0", "in.nrrd", "--expand", "--unit", "voxel", "-o", "moved.nrrd")
out = itk.ReadImage("moved.nrrd")
assert (itk.GetArrayFromImage(out) == v).all() and np.allclose(out.GetOrigin(), i.TransformIndexToPhysicalPoint((-2, 0, 0)))'
}

@test "what is no affine transform is refused with a reason" {
    vkt make noise --dims 6 6 6 -o in.vkt
    fails_with 2 '3 numbers are no affine map' vkt affine '1 2 3' in.vkt -o x.vkt
    fails_with 2 'cannot be inverted' vkt affine '1 0 0 0 1 0 0 0 0 0 1 0' in.vkt -o x.vkt
    fails_with 2 'last of the four rows' vkt affine '1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2' in.vkt -o x.vkt
    fails_with 4 'nowhere.tfm' vkt affine nowhere.tfm in.vkt -o x.vkt
    printf 'one two\n' >words.txt
    fails_with 3 'is not a number' vkt affine words.txt in.vkt -o x.vkt
    printf '1 0 0 nan 0 1 0 0 0 0 1 0\n' >nan.txt
    fails_with 3 'nan' vkt affine nan.txt in.vkt -o x.vkt
    head -c 2000000 /dev/zero >large.txt
    fails_with 3 'too long' vkt affine large.txt in.vkt -o x.vkt
    itk_file() { printf '#Insight Transform File V1.0\n#Transform 0\nTransform: %s\nParameters: %s\nFixedParameters: %s\n' "$@" >t.tfm; }
    itk_file BSplineTransform_double_3_3 '1 2 3' '0 0 0'
    fails_with 3 'BSplineTransform is not linear' vkt affine t.tfm in.vkt -o x.vkt
    itk_file AffineTransform_double_2_2 '1 0 0 1 0 0' '0 0'
    fails_with 3 'three dimensions' vkt affine t.tfm in.vkt -o x.vkt
    itk_file AffineTransform_double_3_3 '1 0 0 1' '0 0 0'
    fails_with 3 '4 parameters instead of 12' vkt affine t.tfm in.vkt -o x.vkt
    itk_file TranslationTransform_double_3_3 '1 0 0' ''
    fails_with 2 '--unit voxel does not apply' vkt affine t.tfm in.vkt --unit voxel -o x.vkt
    printf '#Insight Transform File V1.0\n' >t.tfm
    fails_with 3 'no transform' vkt affine t.tfm in.vkt -o x.vkt
    [ ! -e x.vkt ]
}

@test "a matrix with a mistake is a matrix" {
    vkt make noise --dims 4 4 4 -o v.nrrd
    for matrix in '1 0 0 0 0 1 0 0 0 0 1 x' '1 0 0 0 0 1 0 0 0 0 1 nan' '1,2' ''; do
        run -2 vkt affine "$matrix" v.nrrd -o x.nrrd
    done
    run -4 vkt affine none.tfm v.nrrd -o x.nrrd
}
