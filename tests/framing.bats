# The camera that frames what is visible: boxes at any place fill the picture but for its margin, to a voxel.
load helper

# What is judged here: [lower, upper) of voxels of 100 in zeros; pictures are PFM, the margin is that of 1.04.
framing() {
    cat >framing.py <<'END'
import subprocess, numpy as np
margin, pixels = 1.04, 400
def vkt(*words): subprocess.run(["vkt", *map(str, words), "-q"], check=True)
def box(seed, dtype):
    rng = np.random.default_rng(seed)
    dims = rng.integers(30, 60, 3)
    lower = rng.integers(1, 12, 3)
    upper = dims - rng.integers(1, 12, 3)
    a = np.zeros(dims[::-1], dtype)
    a[lower[2]:upper[2], lower[1]:upper[1], lower[0]:upper[0]] = 100
    np.save("box.npy", a)
    vkt("read", "box.npy", "-o", "box.vkt", "--force")
    return lower, upper
look = ("--size %d --domain 0:100 --opacity 0,1 --colormap grey --unit-distance 0.01 --background 0,0,0 --shade none" % pixels).split()
def seen(volume, *words):
    """First and last column and row (exclusive) in which something can be seen."""
    vkt("render", volume, "-o", "p.pfm", "--force", *words)
    with open("p.pfm", "rb") as f:
        assert f.readline().strip() == b"PF"
        w, h = map(int, f.readline().split())
        f.readline()
        shown = np.frombuffer(f.read(), "<f4").reshape(h, w, 3)[::-1].max(axis=2) > 0
    x, y = np.where(shown.any(axis=0))[0], np.where(shown.any(axis=1))[0]
    return np.array([x[0], x[-1] + 1, y[0], y[-1] + 1])
def expect(found, width, height):
    """As wide and high as that in the middle of the picture, to two pixels of it."""
    per = pixels / margin / max(width, height)
    want = np.array([pixels - per * width, pixels + per * width, pixels - per * height, pixels + per * height]) / 2
    assert (abs(found - want) <= 1.5).all(), (found, want)
END
}

@test "a box fills the picture but for its margin, wherever it begins and ends, of every type" {
    framing
    /usr/bin/python3 -c '
from framing import *
for seed, dtype in enumerate("u1 i1 u2 i2 u4 i4 f2 f4 f8".split()):
    lower, upper = box(seed, dtype)
    n = upper - lower
    for view, across, up in (("-y", 0, 2), ("x", 1, 2), ("z", 0, 1)):
        found = seen("box.vkt", *look, "--projection", "orthographic", "--view=" + view)
        expect(found, n[across] + 1, n[up] + 1) # interpolated values end at the next voxels'"'"' centres
'
}

@test "trees are framed as closely, however they are drawn" {
    framing
    /usr/bin/python3 -c '
from framing import *
for seed, dtype in enumerate("u1 i2 f4 f8".split()):
    lower, upper = box(100 + seed, dtype)
    n = upper - lower
    vkt("refine", "box.vkt", "--tolerance", 0, "--block-size", 4, "-o", "tree.vkt", "--force")
    for way in "bricks", "blocks", "grid":
        for view, across, up in (("-y", 0, 2), ("x", 1, 2)):
            found = seen("tree.vkt", *look, "--projection", "orthographic", "--view=" + view, "--tree", way)
            expect(found, n[across] + 1, n[up] + 1)
'
}

@test "perspective: all sides of the nearest faces are at the margin; surfaces and labels end where they are" {
    framing
    /usr/bin/python3 -c '
from framing import *
lower, upper = box(7, "u1")
n = upper - lower
found = seen("box.vkt", *look, "--view=-y")
expect(found, n[0] + 1, n[2] + 1) # what is furthest out is the face in front
found = seen("box.vkt", "--render-algo", "implicit-iso", "--iso", "50", "--size", str(pixels), "--background", "0,0,0",
             "--projection", "orthographic", "--view=-y", "--spp", "1")
# A surface is framed by the cells that it lies in: it takes half of those at both ends.
per = pixels / margin / (max(n[0], n[2]) + 1)
assert abs((found[1] - found[0]) - per * n[0]) <= 3 and abs((found[3] - found[2]) - per * n[2]) <= 3, (found, per * n)
found = seen("box.vkt", "--labels", "always", "--size", str(pixels), "--background", "0,0,0",
             "--projection", "orthographic", "--view=-y")
expect(found, n[0], n[2])
'
}

# Two blobs of which slanting views see slanting ends: nothing is cut off, and on two sides little is left over.
@test "slanting views hold all that can be seen, and little more" {
    framing
    /usr/bin/python3 -c '
from framing import *
z, y, x = np.mgrid[0:52, 0:47, 0:61]
a = np.maximum(0, 9 - np.sqrt((x - 15) ** 2 + (y - 19) ** 2 + (z - 22) ** 2)) + np.maximum(0, 6 - np.sqrt((x - 44) ** 2 + (y - 27) ** 2 + (z - 35) ** 2))
np.save("blobs.npy", (10 * a).astype("u1"))
vkt("read", "blobs.npy", "-o", "blobs.vkt", "--force")
vkt("refine", "blobs.vkt", "--tolerance", 0, "--block-size", 4, "-o", "tree.vkt", "--force")
for volume, ways in (("blobs.vkt", ((),)), ("tree.vkt", (("--tree", "bricks"), ("--tree", "blocks")))):
    for way in ways:
        for azimuth, elevation, projection in ((32, 22, "perspective"), (75, -40, "perspective"), (200, 61, "orthographic")):
            found = seen(volume, *look, *way, "--azimuth", str(azimuth), "--elevation=%d" % elevation, "--projection", projection)
            left = np.array([found[0], pixels - found[1], found[2], pixels - found[3]])
            least = pixels * (1 - 1 / margin) / 2
            assert (left >= least - 1).all(), (volume, way, azimuth, left)
            two = min(left[:2].max(), left[2:].max()) # opposite ones
            assert two <= least + 12, (volume, way, azimuth, left) # a voxel is about 11 pixels wide
'
}
