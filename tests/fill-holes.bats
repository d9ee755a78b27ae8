# vkt fill-holes: what SciPy fills is filled, and nothing else changes.
load helper

# against_scipy CODE: Python with fill(values, options) and the report of the last call in `report`.
against_scipy() {
    python_with numpy scipy
    /usr/bin/python3 - <<EOF
import json, subprocess
import numpy as np
from scipy import ndimage

rng = np.random.default_rng(5)
report = None

def fill(values, options=""):
    global report
    name = "v_%dx%dx%d_%s.raw" % (*values.shape[::-1], values.dtype)
    values.tofile(name)
    subprocess.run(f"vkt fill-holes {name} {options} --format raw -o out.raw --force --report report.json", shell=True,
                   check=True)
    report = json.load(open("report.json"))
    report = report[0] if isinstance(report, list) else report
    return np.fromfile("out.raw", values.dtype).reshape(values.shape)

def expected(mask, connectivity=6):
    return ndimage.binary_fill_holes(mask, ndimage.generate_binary_structure(3, {6: 1, 18: 2, 26: 3}[connectivity]))
$1
EOF
}

@test "holes are SciPy's, for each connectivity and odd extents, however the volume is cut" {
    against_scipy '
for shape in ((23, 29, 37), (7, 5, 64), (3, 3, 3), (11, 2, 130)):
    for density in (0.3, 0.6, 0.8, 0.95):
        a = (rng.random(shape) < density).astype(np.uint8) * 200
        for connectivity in (6, 18, 26):
            want = expected(a, connectivity)
            for options in ("", "--slab 1 --threads 5", "--slab 3 --threads 2"):
                got = fill(a, f"--connectivity {connectivity} {options}")
                assert (got == np.where(want, 200, 0)).all(), (shape, density, connectivity, options)
            assert report["voxels"] == (want & (a == 0)).sum()
'
}

@test "every type keeps its bits; NaN is no hole and closes one" {
    against_scipy '
for dtype in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    a = (rng.random((9, 8, 71)) < 0.85).astype(dtype) * 3
    if a.dtype.itemsize == 8 and a.dtype.kind != "f":
        a[a != 0] += 1 << 60
    if a.dtype.kind == "f":
        a[a != 0] = np.nan
        a[:, :, ::3] *= -1
    bits = a.view(f"u{a.dtype.itemsize}")
    want = expected(a != 0)
    got = fill(a).view(bits.dtype)
    assert (got[a != 0] == bits[a != 0]).all() and (got[~want] == bits[~want]).all(), dtype
    filled = want & (a == 0)
    assert filled.any() and np.isin(got[filled], bits[a != 0]).all() and (got[filled] != 0).all(), dtype
'
}

@test "a hole in a label gets that label; a value may be given, and sizes limited" {
    against_scipy '
a = np.zeros((12, 13, 30), np.int16)
a[2:9, 2:9, 2:9] = 7
a[3:8, 3:8, 3:8] = 0
a[2:6, 2:6, 15:22] = -4
a[3:5, 3:5, 17] = 0
want = a.copy()
want[3:8, 3:8, 3:8] = 7
want[3:5, 3:5, 17] = -4
assert (fill(a) == want).all() and report == {"holes": 2, "voxels": 129}
want[3:8, 3:8, 3:8] = 0
assert (fill(a, "--max-size 4") == want).all() and report["holes"] == 1
want[3:5, 3:5, 17] = 9
assert (fill(a, "--max-size 4 --value 9") == want).all()
'
}

@test "slices are filled in two dimensions; an open ring is not" {
    against_scipy '
a = (rng.random((1, 60, 70)) < 0.7).astype(np.uint8)
assert (fill(a)[0] == ndimage.binary_fill_holes(a[0])).all() and report["voxels"] > 0
for shape in ((60, 1, 70), (60, 70, 1)):
    b = a[0].reshape(shape)
    assert (fill(b).ravel() == ndimage.binary_fill_holes(a[0]).ravel()).all(), shape
line = np.array([0, 1, 0, 1, 0, 0, 2, 0], np.uint8)
assert (fill(line.reshape(1, 1, 8)).ravel() == [0, 1, 1, 1, 1, 1, 2, 0]).all()
assert (fill(line.reshape(8, 1, 1), "--slab 1").ravel() == [0, 1, 1, 1, 1, 1, 2, 0]).all()
ring = np.ones((5, 5, 5), np.uint8)
ring[2, 2, 2] = ring[2, 2, 3] = ring[2, 2, 4] = 0
assert (fill(ring) == ring).all() and report["holes"] == 0
empty = np.zeros((5, 5, 5), np.uint8)
assert (fill(empty) == 0).all()
'
}

@test "zero is the physical zero, and values are physical" {
    against_scipy '
a = np.full((7, 7, 7), 3, np.uint8)
a[3, 3, 3] = 10
a.tofile("m_7x7x7_uint8.raw")
subprocess.run("vkt set m_7x7x7_uint8.raw --slope 2 --intercept -20 | vkt fill-holes --value 4 | vkt write o.raw",
               shell=True, check=True)
a[3, 3, 3] = 12
assert (np.fromfile("o.raw", np.uint8).reshape(a.shape) == a).all()
'
}

@test "consumers of parts get the same" {
    against_scipy '
(rng.random((33, 41, 70)) < 0.75).astype(np.uint8).tofile("v_70x41x33_uint8.raw")
'
    vkt fill-holes v_70x41x33_uint8.raw | vkt crop --roi 3:-7,2:,9:30 | vkt write - --format raw >want.raw
    vkt pipe 'read v_70x41x33_uint8.raw | fill-holes | crop --roi 3:-7,2:,9:30 | write part.raw'
    cmp part.raw want.raw
    run ! vkt diff v_70x41x33_uint8.raw <(vkt fill-holes v_70x41x33_uint8.raw)
}

@test "requests that make no sense are refused; values that do not fit are told" {
    vkt make ramp --dims 4 4 4 -o v.nrrd
    fails_with 2 'none of 6, 18, 26' vkt fill-holes v.nrrd --connectivity 4 -o o.nrrd
    fails_with 2 '--max-size' vkt fill-holes v.nrrd --max-size 0 -o o.nrrd
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical volume' vkt fill-holes t.vkt -o o.vkt
    [ ! -e o.nrrd ]
    [ ! -e o.vkt ]
    vkt make constant --dims 5 5 5 --value 1 --dtype uint8 | vkt fill --value 0 --roi 2:3,2:3,2:3 -o h.nrrd
    vkt fill-holes h.nrrd --value 300 -o o.nrrd 2>err
    grep -q '300 does not fit uint8' err
    vkt stats o.nrrd | grep -qx 'max  *255'
}

@test "with --roi holes are those of the region, and all other voxels stay" {
    against_scipy '
region = (slice(2, 9), slice(1, 11), slice(3, 60))
for dtype in (np.uint8, np.float32, np.int64):
    for connectivity in (6, 26):
        a = (rng.random((11, 13, 71)) < (0.6 if connectivity == 6 else 0.9)).astype(dtype) * 7
        filled = a.copy()
        filled[region] = np.where(expected(a[region], connectivity), 7, 0)
        for options in ("", "--slab 1 --threads 3", "--slab 4"):
            got = fill(a, f"--connectivity {connectivity} --roi 3:60,1:11,2:9 {options}")
            assert (got == filled).all(), (dtype, connectivity, options)
        assert report["voxels"] == (filled != a).sum() > 0
        assert (expected(a, connectivity) * 7 != filled).any()
'
    vkt make sphere --dims 12 12 12 -o s.vkt
    fails_with 2 'leaves the volume' vkt fill-holes s.vkt --roi 3:40,:,: -o x.vkt
}
