# vkt mesh: closed, counted and measured against VTK, digital topology and analytic bodies; its files against VTK's readers.
load helper

setup_more() {
    python_with numpy scipy vtkmodules
    cat >check.py <<'END'
import json, subprocess
import numpy as np
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D, vtkMassProperties
from vtkmodules.vtkIOGeometry import vtkOBJReader, vtkSTLReader
from vtkmodules.vtkIOPLY import vtkPLYReader
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
def vkt(*words, fails=0):
    r = subprocess.run(["vkt", *words], capture_output=True, text=True)
    assert r.returncode == fails, (words, r.returncode, r.stderr)
    return r.stdout
def save(v, name):
    v.tofile(f"{name}_{v.shape[2]}x{v.shape[1]}x{v.shape[0]}_{v.dtype}.raw")
    return f"{name}_{v.shape[2]}x{v.shape[1]}x{v.shape[0]}_{v.dtype}.raw"
def report(*words):
    return json.loads(vkt("mesh", *words, "--json"))
def flying_edges(a, value):
    image = vtkImageData()
    image.SetDimensions(*a.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(a.ravel(), deep=1))
    f = vtkFlyingEdges3D()
    f.SetInputData(image)
    f.SetValue(0, value)
    f.Update()
    return f.GetOutput()
def area_and_volume(poly):
    m = vtkMassProperties()
    m.SetInputData(poly)
    m.Update()
    return m.GetSurfaceArea(), m.GetVolume()
readers = {"stl": vtkSTLReader, "ply": vtkPLYReader, "obj": vtkOBJReader, "vtp": vtkXMLPolyDataReader}
def load(name):
    reader = readers[name.rsplit(".")[-1]]()
    reader.SetFileName(name)
    reader.Update()
    return reader.GetOutput()
def arrays(poly):
    points = vtk_to_numpy(poly.GetPoints().GetData()).astype(float)
    return points, vtk_to_numpy(poly.GetPolys().GetData()).reshape(-1, 4)[:, 1:]
def counts(points, t):
    """Euler characteristic; asserts that every edge has one triangle on each side, and that links are single rings."""
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]).astype(np.int64)
    key = directed[:, 0] << 32 | directed[:, 1]
    back = directed[:, 1] << 32 | directed[:, 0]
    assert len(np.unique(key)) == len(key), "an edge is used twice in one direction"
    assert np.array_equal(np.sort(key), np.sort(back)), "an edge has a triangle on one side only"
    # Around each corner of a triangle, what follows what: one cycle a vertex.
    follows = {}
    for a, b, c in t:
        for v, p, q in (a, b, c), (b, c, a), (c, a, b):
            follows.setdefault(v, {})[p] = q
    assert len(follows) == len(points), "a vertex without triangles"
    for v, ring in follows.items():
        first = at = next(iter(ring))
        for _ in range(len(ring)):
            at = ring[at]
            if at == first: break
        n = 1
        at = ring[first]
        while at != first: at, n = ring[at], n + 1
        assert n == len(ring), "two rings around a vertex"
    return len(points) - len(key) // 2 + len(t)
def digital_euler(m):
    """Of the solid of 6-connected voxels; a cell that lacks two opposite corners has its hole filled by the surface."""
    m = np.pad(m, 1)
    def both(a, axis):
        return np.take(a, range(1, a.shape[axis]), axis) & np.take(a, range(a.shape[axis] - 1), axis)
    e = [both(m, a) for a in range(3)]
    faces = [both(e[0], 1), both(e[0], 2), both(e[1], 2)]
    cubes = both(both(both(m, 0), 1), 2)
    chi = m.sum() - sum(x.sum() for x in e) + sum(x.sum() for x in faces) - cubes.sum()
    n = [s - 1 for s in m.shape]
    corners = {(i, j, k): m[i:i + n[0], j:j + n[1], k:k + n[2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)}
    number = sum(c.astype(int) for c in corners.values())
    for a in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)):
        b = tuple(1 - x for x in a)
        chi += ((number == 6) & ~corners[a] & ~corners[b]).sum()
    return int(chi)
END
    export PYTHONPATH="$PWD"
}

py() { /usr/bin/python3 -c "
from check import *
$1"; }

@test "a value without a surface is noted, and refused with --strict before a file is there" {
    vkt make sphere --dims 12 12 12 --edge coverage -o ball.vkt
    vkt mesh ball.vkt --iso 0.5 --strict 2>said
    [ ! -s said ]
    for what in '999 no is_empty' '-999 every is_the_end_of_the_volume'; do
        read -r value who mesh <<<"$what"
        vkt mesh ball.vkt --iso=$value -o none.ply --force 2>said
        grep -qx "vkt mesh: no surface of $value is there: $who voxel is at or above it, and the mesh ${mesh//_/ }" said
        rm none.ply
        fails_with 3 "no surface of $value is there" vkt mesh ball.vkt --iso=$value -o none.ply --strict
        [ ! -e none.ply ]
    done
    vkt mesh ball.vkt --iso=-999 --open 2>said
    grep -q "every voxel is at or above it, and the mesh is empty" said
}

@test "spheres and tori: closed, Euler characteristic, area and volume of the bodies" {
    py '
n = 48
z, y, x = np.mgrid[:n, :n, :n] - (n - 1) / 2
bodies = {
    "ball": (15 - np.sqrt(x * x + y * y + z * z), 2, 4 * np.pi * 15 ** 2, 4 / 3 * np.pi * 15 ** 3),
    "torus": (6 - np.sqrt((np.sqrt(x * x + y * y) - 14) ** 2 + z * z), 0, 4 * np.pi ** 2 * 14 * 6, 2 * np.pi ** 2 * 14 * 36)}
for name, (v, euler, area, volume) in bodies.items():
    file = save(v.astype("f4"), name)
    r = report(file, "--iso", "0", "-o", name + ".ply")
    assert r["euler"] == euler, r
    assert abs(r["area"] / area - 1) < 0.005 and abs(r["volume"] / volume - 1) < 0.01, (r, area, volume) # chords of a tube of radius 6
    points, t = arrays(load(name + ".ply"))
    assert counts(points, t) == euler and len(points) == r["vertices"] and len(t) == r["triangles"]
    # Inside out: what was outside is inside, closed by the faces of the volume.
    other = report(save(-v.astype("f4"), "n" + name), "--iso", "0")
    assert abs(other["volume"] + r["volume"] - n ** 3) / n ** 3 < 0.002 and other["euler"] == euler + 2, other
'
}

@test "noise: a manifold whose topology is that of the voxels, for every slab height and number of threads" {
    py '
r = np.random.default_rng(3)
for dims, share in ((13, 11, 17), 0.5), ((9, 20, 130), 0.3), ((8, 8, 8), 0.8), ((1, 7, 5), 0.6), ((1, 1, 1), 1):
    v = (r.random(dims) < share).astype("u1") * 200
    file = save(v, "noise")
    one = report(file, "--iso", "100", "-o", "a.vtp")
    points, t = arrays(load("a.vtp"))
    assert counts(points, t) == one["euler"] == 2 * digital_euler(v > 0), (dims, one, digital_euler(v > 0))
    data = open("a.vtp", "rb").read()
    for how in ("--slab", "1"), ("--slab", "3"), ("--threads", "1"), ("--threads", "3"):
        vkt("mesh", file, "--iso", "100", "-o", "b.vtp", "--force", *how)
        assert open("b.vtp", "rb").read() == data, how
    subprocess.run("rm *.vtp", shell=True)
# Integers that are equal to the value: no two vertices coincide, so that STL, which has no numbers, is closed as well.
v = r.integers(0, 4, (12, 12, 12)).astype("i2")
one = report(save(v, "equal"), "--iso", "2", "-o", "e.stl")
points, t = arrays(load("e.stl"))
assert len(points) == one["vertices"] and counts(points, t) == one["euler"] == 2 * digital_euler(v >= 2)
'
}

@test "open surfaces have the vertices and triangles of VTK's flying edges, area and positions" {
    py '
from scipy.spatial import cKDTree
r = np.random.default_rng(4)
z, y, x = np.mgrid[:30, :34, :70].astype("f4")
smooth = np.sin(x / 5) * np.cos(y / 4) + np.sin(y / 5) * np.cos(z / 6)
for name, v, value, close in ("smooth", smooth.astype("f4"), 0.3, 1e-4), ("noise", r.integers(0, 255, (15, 14, 13)).astype("u1"), 99.5, 0.02):
    theirs = flying_edges(v, value)
    ours = report(save(v, name), "--iso", str(value), "--open", "-o", name + ".ply")
    assert ours["vertices"] == theirs.GetNumberOfPoints() and ours["triangles"] == theirs.GetNumberOfPolys(), ours
    assert abs(ours["area"] / area_and_volume(theirs)[0] - 1) < close, (ours, area_and_volume(theirs))
    a, b = arrays(load(name + ".ply"))[0], arrays(theirs)[0]
    far = cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max()
    assert max(far) < 1.01 / 1024, far # where the value lies on a voxel, or nearly
'
}

@test "closed surfaces agree with VTK's of the padded volume" {
    py '
r = np.random.default_rng(5)
v = r.normal(size=(12, 13, 14)).astype("f4")
padded = np.full((14, 15, 16), -1e30, "f4")
padded[1:-1, 1:-1, 1:-1] = v
ours = report(save(v, "v"), "--iso", "0.25", "-o", "v.ply")
theirs = flying_edges(padded, 0.25)
assert ours["vertices"] == theirs.GetNumberOfPoints() and ours["triangles"] == theirs.GetNumberOfPolys()
# Where the volume ends the surface lies half a voxel beyond the last one.
points, _ = arrays(load("v.ply"))
assert points.min() == -0.5 and np.allclose(points.max(0), [13.5, 12.5, 11.5])
assert abs(area_and_volume(load("v.ply"))[1] - ours["volume"]) < 1e-3 * ours["volume"]
'
}

@test "the world: spacing, origin, turned and mirrored directions, value maps, regions" {
    vkt make sphere --dims 32 32 32 --edge coverage -o s.nrrd
    sed 's/space origin:.*/space origin: (100,-20,5)/; s/space directions:.*/space directions: (0,2,0) (1,0,0) (0,0,3)/' s.nrrd >w.nrrd
    py '
one, two = report("s.nrrd", "--iso", "0.5", "-o", "s.ply"), report("w.nrrd", "--iso", "0.5", "-o", "w.ply")
a, b = arrays(load("s.ply")), arrays(load("w.ply"))
assert np.allclose(b[0], a[0][:, [1, 0, 2]] * [1, 2, 3] + [100, -20, 5], atol=1e-4)
assert abs(two["volume"] / one["volume"] - 6) < 1e-6, (one, two) # mirrored, and not inside out
assert counts(*b) == 2
v = np.arange(1000, dtype="u2").reshape(10, 10, 10)
save(v, "ramp")
vkt("set", "ramp_10x10x10_uint16.raw", "--slope", "-2", "--intercept", "100", "-o", "down.nrrd")
r = report("down.nrrd", "--iso", "-900")
assert abs(r["volume"] - report(save((v <= 500).astype("u1"), "low"), "--iso", "0.5")["volume"]) < 10, r
assert report("s.nrrd", "--iso", "0.5", "--roi", "16:,:,:") == json.loads(subprocess.run("vkt crop s.nrrd --roi 16:,:,: | vkt mesh --iso 0.5 --json", shell=True, capture_output=True).stdout)
assert report("s.nrrd", "--iso", "7")["triangles"] == 0
' || return 1
}

@test "labels: surfaces of each, closed, as files, groups and numbers" {
    py '
r = np.random.default_rng(6)
v = r.integers(0, 4, (9, 10, 11)).astype("u2") * 7
file = save(v, "l")
rows = report(file, "--labels", "-o", "part-%d.ply")["labels"]
assert [row["label"] for row in rows] == [7, 14, 21]
for row in rows:
    alone = report(save((v == row["label"]).astype("u1"), "alone"), "--iso", "0.5")
    assert {k: row[k] for k in ("vertices", "triangles", "euler")} == {k: alone[k] for k in ("vertices", "triangles", "euler")}
    assert abs(row["volume"] / alone["volume"] - 1) < 1e-6
    assert counts(*arrays(load("part-%d.ply" % row["label"]))) == row["euler"]
assert report(file, "--label", "21", "7")["labels"] == [rows[0], rows[2]]
vkt("mesh", file, "--labels", "-o", "all.vtp")
labels = vtk_to_numpy(load("all.vtp").GetCellData().GetArray("label"))
assert [(labels == row["label"]).sum() for row in rows] == [row["triangles"] for row in rows]
vkt("mesh", file, "--labels", "-o", "all.obj")
text = open("all.obj").read()
assert [l for l in text.splitlines() if l[0] == "g"] == ["g label_7", "g label_14", "g label_21"]
vkt("mesh", file, "--label", "5", fails=3)
vkt("mesh", file, "--labels", "--iso", "3", fails=2)
'
}

@test "every format, binary and text, is what VTK reads; normals point outwards" {
    vkt make sphere --dims 20 20 20 --edge coverage -o s.nrrd
    py '
want = report("s.nrrd", "--iso", "0.5")
for name in readers:
    for words in ([], ["--ascii"], ["--normals"], ["--normals", "--ascii"]):
        if name == "stl" and "--normals" in words: continue
        vkt("mesh", "s.nrrd", "--iso", "0.5", "-o", "s." + name, "--force", *words)
        poly = load("s." + name)
        points, t = arrays(poly)
        assert len(points) == want["vertices"] and counts(points, t) == 2, (name, words)
        assert abs(area_and_volume(poly)[1] / want["volume"] - 1) < 1e-4
        if "--normals" in words:
            normals = vtk_to_numpy(poly.GetPointData().GetNormals())
            outward = points - points.mean(0)
            assert (np.sum(normals * outward, 1) / np.linalg.norm(outward, axis=1) > 0.9).all(), name
assert open("s.ply", "rb").read() == subprocess.run(["vkt", "mesh", "s.nrrd", "--iso", "0.5", "-o", "-", "--format", "ply", "--normals", "--ascii"], capture_output=True).stdout
# Far from the origin PLY and VTP have float64, and STL says that it rounds.
vkt("set", "s.nrrd", "--origin", "1000000,0,0", "-o", "far.nrrd")
vkt("mesh", "far.nrrd", "--iso", "0.5", "-o", "far.ply")
assert b"property double x" in open("far.ply", "rb").read(400)
r = subprocess.run(["vkt", "mesh", "far.nrrd", "--iso", "0.5", "-o", "far.stl"], capture_output=True, text=True)
assert r.returncode == 0 and "float32" in r.stderr, r
'
}

@test "what cannot be is said, and leaves nothing" {
    vkt make noise --dims 40 40 40 --dtype uint8 -o n.nrrd
    fails_with 2 'say --iso' vkt mesh n.nrrd
    fails_with 2 'name it .stl' vkt mesh n.nrrd --iso 100 -o x.nrrd
    fails_with 2 'labels are integers' vkt mesh <(vkt make sphere --dims 8 8 8) --labels
    fails_with 5 'more than --memory' vkt mesh n.nrrd --iso 100 --memory 1M -o x.ply
    touch there.ply
    fails_with 4 'exists' vkt mesh n.nrrd --iso 100 -o there.ply
    fails_with 4 '' vkt mesh n.nrrd --iso 100 -o nowhere/x.ply
    head -c 30000 n.nrrd >short.nrrd
    fails_with 3 'ended early' vkt mesh short.nrrd --iso 100 -o x.ply
    [ ! -e x.ply ]
    [ ! -s there.ply ]
    vkt mesh n.nrrd --iso 100 --dry-run
}
