# vkt label: components and their numbers are SciPy's, for every type, however the volume is cut.
load helper

# against_scipy CODE: Python with label(values, options) and the report of the last call in `report`.
against_scipy() {
    python_with numpy scipy
    /usr/bin/python3 - <<EOF
import json, subprocess
import numpy as np
from scipy import ndimage

rng = np.random.default_rng(5)
report = None

def label(values, options="", dtype=np.uint32):
    global report
    n = values.shape[::-1]
    name = "v_%dx%dx%d_%s.raw" % (*n, values.dtype)
    values.tofile(name)
    subprocess.run(f"vkt label {name} {options} --format raw -o out.raw --force --report report.json", shell=True,
                   check=True)
    report = json.load(open("report.json"))
    report = report[0] if isinstance(report, list) else report
    return np.fromfile("out.raw", dtype).reshape(values.shape)

def expected(values, connectivity):
    return ndimage.label(values != 0, ndimage.generate_binary_structure(3, {6: 1, 18: 2, 26: 3}[connectivity]))
$1
EOF
}

# noise DIMS SHARE: a mask in which that share of the voxels is set, v.nrrd.
noise() {
    python_with numpy
    /usr/bin/python3 -c "
import sys, numpy as np
n = [int(w) for w in '$1'.split()]
(np.random.default_rng(3).random(n[::-1]) < $2).astype(np.uint8).tofile('v_%dx%dx%d_uint8.raw' % tuple(n))"
    vkt write "v_${1// /x}_uint8.raw" v.nrrd
}

@test "numbers are SciPy's for each connectivity, at all densities, for odd extents" {
    against_scipy '
for shape in ((23, 29, 37), (7, 5, 64), (17, 13, 1), (11, 1, 130), (1, 11, 65), (1, 1, 1), (1, 1, 200)):
    for density in (0.05, 0.3, 0.6, 0.95):
        a = (rng.random(shape) < density).astype(np.uint8)
        for connectivity in (6, 18, 26):
            want, count = expected(a, connectivity)
            assert (label(a, f"--connectivity {connectivity}") == want).all(), (shape, density, connectivity)
            assert report["components"] == report["labelled"] == count
'
}

@test "slabs, threads, pipes and consumers of parts make no difference" {
    noise "70 61 53" 0.3
    for connectivity in 6 18 26; do
        vkt label v.nrrd --connectivity $connectivity --format raw -o want.raw --force --threads 1
        for options in '--slab 1 --threads 2' '--slab 3 --threads 5' '--slab 7' '--slab 53 --threads 5'; do
            # shellcheck disable=SC2086
            vkt label v.nrrd --connectivity $connectivity $options --format raw -o out.raw --force
            cmp out.raw want.raw
            # shellcheck disable=SC2086
            vkt read v.nrrd --slab 5 | vkt label --connectivity $connectivity $options | vkt write - --format raw |
                cmp - want.raw
        done
        # A consumer that takes parts of rows, and one that starts at the end.
        vkt pipe "read v.nrrd | label --connectivity $connectivity | crop --roi 3:-7,2:,9:40 | write part.raw --force"
        vkt label v.nrrd --connectivity $connectivity | vkt crop --roi 3:-7,2:,9:40 | vkt write - --format raw |
            cmp - part.raw
        vkt pipe "read v.nrrd | label --connectivity $connectivity | flip z | flip z | write twice.raw --force"
        cmp twice.raw want.raw
    done
}

@test "slices that are cut into rows are joined again" {
    noise "700 900 3" 0.25
    vkt label v.nrrd --connectivity 18 -o whole.nrrd
    vkt label v.nrrd --connectivity 18 --memory 32M --threads 5 -o rows.nrrd
    vkt diff whole.nrrd rows.nrrd
}

@test "every type; NaN belongs to nothing, and is told" {
    against_scipy '
for dtype in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    a = (rng.integers(0, 3, (9, 8, 71)) == 1).astype(dtype)
    a[a != 0] = rng.integers(1, 100, a.shape)[a != 0]
    if a.dtype.kind == "i":
        a[::2] *= -1
    if a.dtype.kind == "f":
        a[::2, 1::2] *= -1
        a[0, 0, 0] = -0.0
        a[2, 2, 60:70] = np.inf
    if a.dtype.itemsize == 8 and a.dtype.kind != "f":
        a[a != 0] += 1 << 60
    want, _ = expected(a, 6)
    assert (label(a) == want).all(), dtype
a = rng.random((9, 8, 71)).astype(np.float32)
a[a < 0.5] = 0
a[rng.random(a.shape) < 0.1] = np.nan
want, _ = expected(np.nan_to_num(a), 6)
assert (label(a) == want).all()
'
    printf '\0\0\300\177\0\0\200\077' >n_2x1x1_float32.raw
    vkt label n_2x1x1_float32.raw -o o.nrrd 2>err
    grep -q '1 of 2 voxels .* not a number' err
}

@test "components by value are those of each value alone" {
    against_scipy '
for shape, dtype in (((13, 17, 19), np.uint8), ((5, 6, 130), np.int64), ((6, 7, 70), np.float32)):
    a = rng.integers(0, 4, shape).astype(dtype)
    if dtype == np.float32:
        a[a == 3] = -0.5
    for connectivity in (6, 18, 26):
        # Each value by itself, numbered anew by first voxels.
        own = np.zeros(shape, np.int64)
        for value in np.unique(a[a != 0]):
            part, count = expected(a == value, connectivity)
            own[part > 0] = part[part > 0] + own.max()
        _, first = np.unique(own[own > 0], return_index=True)
        order = np.argsort(np.argsort(first)) + 1
        want = np.concatenate(([0], order))[own]
        for options in ("", "--slab 1", "--slab 3 --threads 5"):
            got = label(a, f"--by-value --connectivity {connectivity} {options}")
            assert (got == want).all(), (shape, connectivity, options)
'
}

@test "zero is the physical zero" {
    against_scipy '
a = rng.integers(9, 12, (22, 21, 20)).astype(np.uint8)
a.tofile("z_20x21x22_uint8.raw")
def mapped(intercept):
    subprocess.run(f"vkt set z_20x21x22_uint8.raw --slope 2 --intercept {intercept} --units HU | vkt label |"
                   " vkt write m.nrrd --force && vkt write m.nrrd m.raw --force", shell=True, check=True)
    return np.fromfile("m.raw", np.uint32).reshape(a.shape)
# Physically 2 v - 20: voxels of 10 are nothing.
assert (mapped(-20) == expected(a != 10, 6)[0]).all()
assert "\nunits" not in subprocess.run("vkt info m.nrrd", shell=True, capture_output=True, text=True).stdout
assert (mapped(-19) == 1).all()  # no voxel is 9.5
'
}

@test "the report has sizes, bounding boxes and centroids" {
    against_scipy '
a = (rng.random((21, 19, 70)) < 0.2).astype(np.uint8)
got = label(a, "--slab 4")
numbers = range(1, report["components"] + 1)
rows = report["labels"]
assert [r["label"] for r in rows] == list(numbers)
assert [r["size"] for r in rows] == list(ndimage.sum_labels(a, got, numbers).astype(int))
for row, box in zip(rows, ndimage.find_objects(got)):
    assert row["lower"] == [s.start for s in box][::-1] and row["upper"] == [s.stop for s in box][::-1]
centroids = np.array(ndimage.center_of_mass(a, got, numbers))[:, ::-1]
assert np.abs(np.array([r["centroid"] for r in rows]) - centroids).max() < 1e-12
'
    vkt make constant --dims 3 4 5 --value 1 | vkt set --spacing 2,3,4 --origin 10,20,30 |
        vkt label -o all.nrrd --report all.json
    grep -q '"centroid_world": \[12, 24.5, 38\]' all.json
    vkt make constant --dims 3 4 5 --value 0 | vkt label -o none.nrrd --report none.json
    grep -q '"components": 0' none.json
    grep -q '"labels": \[\]' none.json
    vkt stats none.nrrd | grep -qx 'max  *0'
}

@test "the largest, and those that are large enough" {
    against_scipy '
a = (rng.random((21, 19, 40)) < 0.2).astype(np.uint8)
all_, count = expected(a, 6)
size = np.bincount(all_.ravel())
size[0] = 0
for options, kept in (
    ("--keep-largest 1", np.argsort(-size, kind="stable")[:1]),
    ("--keep-largest 9", np.argsort(-size, kind="stable")[:9]),
    ("--keep-largest 100000", np.arange(1, count + 1)),
    ("--min-size 4", np.flatnonzero(size >= 4)),
    ("--min-size 2 --keep-largest 50", np.argsort(-size, kind="stable")[:50]),
    ("--min-size 1000000", np.array([], int)),
):
    names = np.zeros(count + 1, int)
    names[np.sort(kept)] = np.arange(1, len(kept) + 1)
    assert (label(a, options) == names[all_]).all(), options
    assert report["components"] == count and report["labelled"] == len(kept)
'
}

@test "patterns that are hard to join" {
    against_scipy '
z, y, x = np.indices((16, 17, 66))
checker = ((x + y + z) % 2).astype(np.uint8)
assert (label(checker) == expected(checker, 6)[0]).all() and report["components"] == checker.size // 2
assert label(checker, "--connectivity 18").max() == 1
# A serpentine through rows and slices, combs that meet only at the end, walls.
snake = ((y % 2 == 0) | (x == np.where(y % 4 == 1, 65, 0))).astype(np.uint8)
snake[1::2] = 0
snake[1::4, 16, 0] = 1
snake[3::4, 0, 0] = 1
combs = (x % 2 == 0).astype(np.uint8)
combs[-1, -1] = 1
walls = ((z % 2 == 0) & (y % 2 == 0)).astype(np.uint8)
walls[:, :, 33] = 1
for volume in (snake, combs, walls):
    for connectivity in (6, 18, 26):
        for options in ("--slab 1 --threads 2", "--slab 5 --threads 5"):
            got = label(volume, f"--connectivity {connectivity} {options}")
            assert (got == expected(volume, connectivity)[0]).all()
'
}

@test "more labels than the type has room for are an error, not wrapped" {
    vkt make checkerboard --dims 16 16 16 -o c.nrrd
    vkt label c.nrrd --dtype uint16 -o o.nrrd
    fails_with 1 'components are more than uint8' vkt label c.nrrd --dtype uint8 -o o8.nrrd
    [ ! -e o8.nrrd ]
    vkt label c.nrrd --dtype uint8 --keep-largest 255 -o o8.nrrd
    vkt label c.nrrd --dtype uint64 -o o64.nrrd
    vkt convert o64.nrrd --dtype uint16 | vkt diff - o.nrrd
}

@test "requests that make no sense are refused" {
    vkt make ramp --dims 4 4 4 -o v.nrrd
    fails_with 2 'none of 6, 18, 26' vkt label v.nrrd --connectivity 8 -o o.nrrd
    fails_with 2 '--keep-largest' vkt label v.nrrd --keep-largest 0 -o o.nrrd
    fails_with 2 '--min-size' vkt label v.nrrd --min-size 0 -o o.nrrd
    fails_with 2 'labels cannot be float32' vkt label v.nrrd --dtype float32 -o o.nrrd
    fails_with 2 'labels cannot be int32' vkt label v.nrrd --dtype int32 -o o.nrrd
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical volume' vkt label t.vkt -o o.vkt
    [ ! -e o.nrrd ] && [ ! -e o.vkt ]
}

@test "tables that outgrow the budget are refused" {
    vkt make checkerboard --dims 128 128 64 -o c.nrrd
    fails_with 5 'components' vkt label c.nrrd --memory 8M -o o.nrrd
    [ ! -e o.nrrd ]
}

@test "with --roi only the region counts: labels are those of the cropped volume, all else is 0" {
    vkt make noise --dims 23 19 17 | vkt threshold --above 0.4 -o mask.nrrd
    for region in 3:20,2:11,5:16 :,7:8,: 22:23,18:19,16:17 0:1,:,:; do
        for slab in 1 5; do
            vkt label mask.nrrd --roi "$region" --slab $slab --report whole.json -o labels.nrrd --force
            vkt crop mask.nrrd --roi "$region" | vkt label --report part.json -o part.nrrd --force
            vkt crop labels.nrrd --roi "$region" | vkt diff - part.nrrd
            vkt delete labels.nrrd --roi "$region" | vkt stats --json | grep -q '"max": 0[,.]'
        done
        /usr/bin/python3 - "$region" <<'EOF'
import json, sys
first = [int(axis.split(":")[0] or 0) for axis in sys.argv[1].split(",")]
whole, part = (json.load(open(f))["labels"] for f in ("whole.json", "part.json"))
assert len(whole) == len(part)
for a, b in zip(whole, part):
    assert a["size"] == b["size"]
    for key in "lower", "upper", "centroid":
        assert all(abs(p - q - f) < 1e-9 for p, q, f in zip(a[key], b[key], first)), (key, a, b)
    assert all(abs(p - q) < 1e-9 for p, q in zip(a["centroid_world"], b["centroid_world"]))
EOF
    done
    run -2 vkt label mask.nrrd --roi 0:24,:,:
}
