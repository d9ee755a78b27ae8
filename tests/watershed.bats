# vkt watershed: floods against a slow queue in Python, SimpleITK, SciPy, and geometry.
load helper

# against_reference CODE: Python with flood(values, options, **volumes) and the slow reference.
against_reference() {
    python_with numpy scipy
    PYTHONPATH="$VKT_ROOT/tests:${PYTHONPATH:-}" /usr/bin/python3 - <<PY
import json, subprocess
import numpy as np
from scipy import ndimage
from watershed_reference import minima, watershed

rng = np.random.default_rng(12)
TYPES = "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split()

def raw(values, stem):
    name = "%s_%dx%dx%d_%s.raw" % (stem, *values.shape[::-1], values.dtype)
    values.tofile(name)
    return name

def flood(values, options="", fails=0, **volumes):
    command = f"vkt watershed {raw(values, 'v')} {options} --format raw -o out.raw --force --report r.json"
    for option, volume in volumes.items():
        command += f" --{option} {raw(volume, option)}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.returncode == fails, done.stderr
    flood.said = done.stderr
    return np.fromfile("out.raw", np.uint32).reshape(values.shape) if fails == 0 else None

def blobs(shape, sigma, dtype=np.float32):
    return ndimage.gaussian_filter(rng.normal(size=shape), sigma).astype(dtype)
$1
PY
}

@test "markers and minima, with lines and without, are what a slow queue gives, for every type and connectivity" {
    against_reference '
for n, dtype in enumerate(TYPES):
    a = rng.integers(0, 9, (7, 9, 11)).astype(dtype)
    if a.dtype.kind != "u":
        a -= 4  # with both zeros
    if a.dtype.kind == "f":
        a = a * np.array(1.25e3, dtype)
        a[a == 0] *= np.where(rng.random((a == 0).sum()) < 0.5, -1, 1).astype(dtype)
    if dtype in ("uint64", "int64"):
        a += np.array(2**62, dtype)  # doubles would not tell them apart
    connectivity = (6, 18, 26)[n % 3]
    markers = np.where(rng.random(a.shape) < 0.02, rng.integers(1, 5, a.shape), 0).astype(TYPES[n % 8])
    mask = (rng.random(a.shape) < 0.85).astype(np.uint8)
    low = minima(a, connectivity)
    for line in (False, True):
        options = f"--connectivity {connectivity}" + (" --line" if line else "")
        assert (flood(a, options) == watershed(a, low, connectivity, line=line)).all(), (dtype, line)
        assert (flood(a, options, markers=markers) == watershed(a, markers, connectivity, line=line)).all(), (dtype, line)
        got = flood(a, options, markers=markers, mask=mask)
        assert (got == watershed(a, markers, connectivity, mask > 0, line)).all(), (dtype, line)
'
}

@test "odd shapes, and minima that are deep enough" {
    against_reference '
for shape in ((1, 1, 1), (1, 1, 17), (1, 19, 1), (23, 1, 1), (1, 13, 17), (5, 2, 31)):
    a = rng.integers(0, 20, shape).astype(np.int16)
    for depth in (0, 1, 3, 7.5, 100):
        want = watershed(a, minima(a, 6, depth=depth))
        assert (flood(a, f"--depth {depth}") == want).all(), (shape, depth)
        report = json.load(open("r.json"))
        assert report["labels"] == want.max() and report["sizes"] == [
            {"label": n, "size": int((want == n).sum())} for n in range(1, want.max() + 1)]
a = blobs((12, 15, 18), 1.5)
mask = (rng.random(a.shape) < 0.8).astype(np.uint8)
for connectivity in (6, 26):
    for depth in (0, 0.01, 0.05):
        assert (flood(a, f"--depth {depth} --connectivity {connectivity}", mask=mask)
                == watershed(a, minima(a, connectivity, mask > 0, depth), connectivity, mask > 0)).all()
'
}

@test "physical values are flooded: slopes turn the relief, and depths are theirs" {
    against_reference '
a = rng.integers(-30, 30, (8, 9, 10)).astype(np.int16)
name = raw(a, "v")
for slope in (2, -0.5):
    subprocess.run(f"vkt set {name} --slope {slope} --intercept 7 | vkt watershed --depth 6 | vkt write - --format raw > out.raw",
                   shell=True, check=True)
    physical = a * slope + 7.0
    got = np.fromfile("out.raw", np.uint32).reshape(a.shape)
    assert (got == watershed(physical, minima(physical, depth=6))).all(), slope
'
}

@test "NaN is flooded last, infinities are values" {
    against_reference '
for dtype in TYPES[8:]:
    a = rng.integers(0, 5, (6, 7, 8)).astype(dtype)
    a[rng.random(a.shape) < 0.2] = np.nan
    a[1, 2, 3], a[4, 4, 4] = np.inf, -np.inf
    a[0, 0, 0] = -np.array(np.nan, dtype)
    markers = np.zeros(a.shape, np.uint8)
    markers[2, 2, 2], markers[5, 5, 5] = 1, 2
    assert (flood(a, markers=markers) == watershed(a, markers)).all()
'
}

@test "SimpleITK floods the same where no two values are equal" {
    python_with SimpleITK
    against_reference '
import SimpleITK as sitk
smooth = blobs((20, 31, 27), 2)
ranks = smooth.ravel().argsort().argsort().reshape(smooth.shape).astype(np.uint32)
for connectivity in (6, 26):
    markers = np.where(rng.random(ranks.shape) < 0.003, rng.integers(1, 200, ranks.shape), 0).astype(np.uint32)
    want = sitk.GetArrayFromImage(sitk.MorphologicalWatershedFromMarkers(
        sitk.GetImageFromArray(ranks), sitk.GetImageFromArray(markers), False, connectivity == 26))
    assert (flood(ranks, f"--connectivity {connectivity}", markers=markers) == want).all()
'
}

@test "rooms with walls are what SciPy labels, and so does scikit-image if it is there" {
    against_reference '
z, y, x = np.indices((21, 22, 23))
walls = ((x % 8 == 7) | (y % 8 == 7) | (z % 8 == 7)).astype(np.uint8) * 200
markers = np.zeros(walls.shape, np.int16)
for n, p in enumerate(np.argwhere((x % 8 == 3) & (y % 8 == 3) & (z % 8 == 3))):
    markers[tuple(p)] = n + 1
got = flood(walls, markers=markers)
rooms, count = ndimage.label(walls == 0)
want = np.append(0, ndimage.maximum(markers, rooms, np.arange(count) + 1))[rooms]
assert count == 27 and (got[walls == 0] == want[walls == 0]).all() and (got > 0).all()
lines = flood(walls, "--line", markers=markers)
assert (lines[walls == 0] == got[walls == 0]).all() and (lines[walls > 0] == 0).any()
try:
    from skimage.segmentation import watershed as theirs
except ImportError:
    theirs = None
if theirs:
    a = rng.integers(0, 9, (9, 10, 11)).astype(np.uint8)
    m = np.where(rng.random(a.shape) < 0.01, 1, 0).cumsum().reshape(a.shape) * (rng.random(a.shape) < 1)
    m = np.where(np.diff(m.ravel(), prepend=0) > 0, m.ravel(), 0).reshape(a.shape).astype(np.int32)
    assert (flood(a, markers=m) == theirs(a, m)).all()
'
}

# What is guaranteed on plateaus, of these floods and of those of scikit-image; and that these differ only where the
# latter leaves the order open.
@test "plateaus: regions hang together, and no path comes lower; scikit-image divides them alike but for what it leaves open" {
    against_reference '
from watershed_reference import offsets, passes
try:
    from skimage.segmentation import _watershed as theirs
except ImportError:
    theirs = None

def judge(got, image, markers, connectivity, mask):
    structure = ndimage.generate_binary_structure(3, {6: 1, 18: 2, 26: 3}[connectivity])
    lowest = passes(image, markers > 0, connectivity, mask)
    assert ((got > 0) == (lowest < np.inf)).all()
    for label in np.unique(got[got > 0]):
        region = got == label
        parts, count = ndimage.label(region, structure)
        assert len(np.unique(parts[region & (markers == label)])) == count, label
        assert (passes(image, markers == label, connectivity, region)[region] == lowest[region]).all(), label

def lines(got, markers, connectivity):
    for d in offsets(connectivity):
        at = tuple(slice(max(0, -k), n - max(0, k)) for k, n in zip(d, got.shape))
        to = tuple(slice(max(0, k), n - max(0, -k)) for k, n in zip(d, got.shape))
        touch = (got[at] != got[to]) & (got[at] > 0) & (got[to] > 0)
        assert not (touch & ((markers[at] == 0) | (markers[to] == 0))).any()

shape = (12, 14, 16)
reliefs = {"noise": rng.integers(0, 5, shape), "steps": ndimage.zoom(rng.integers(0, 6, (3, 2, 4)), (4, 7, 4), order=0),
           "flat": np.zeros(shape, int), "smooth": (blobs(shape, 1.5) * 60).round()}
for name, relief in reliefs.items():
    image = relief.astype(np.float32)
    points = np.zeros(shape, np.int32)
    places = rng.random(shape) < 0.006
    points[places] = rng.permutation(places.sum()) + 1
    patches = ndimage.grey_dilation(points, size=(1, 3, 3)).astype(np.int32)
    for connectivity in (6, 18, 26):
        for markers in (points, patches):
            mask = rng.random(shape) < 0.9
            judge(flood(image, f"--connectivity {connectivity}", markers=markers, mask=mask.astype(np.uint8)),
                  image, markers * mask, connectivity, mask)
            lined = flood(image, f"--line --connectivity {connectivity}", markers=markers)
            lines(lined, markers, connectivity)
            if not theirs:
                continue
            near = ndimage.generate_binary_structure(3, {6: 1, 18: 2, 26: 3}[connectivity])
            judge(theirs.watershed(image, markers, near, mask=mask), image, markers * mask, connectivity, mask)
            # Markers of different values, somewhere between the steps, and neighbours in the order of the page.
            apart = image.astype(np.float64)
            apart[markers > 0] += rng.permutation((markers > 0).sum()) / 1e4 - 0.02
            order = theirs._offsets_to_raveled_neighbors
            theirs._offsets_to_raveled_neighbors = lambda shape, footprint, center, **_: np.array(
                [(z * shape[1] + y) * shape[2] + x for z, y, x in offsets(connectivity)], np.intp)
            assert (flood(apart, f"--connectivity {connectivity}", markers=markers)
                    == theirs.watershed(apart, markers, near)).all(), (name, connectivity)
            if markers is points:
                assert (flood(apart, f"--line --connectivity {connectivity}", markers=markers)
                        == theirs.watershed(apart, markers, near, watershed_line=True)).all(), (name, connectivity)
            theirs._offsets_to_raveled_neighbors = order
            # As it is, where no two values are equal.
            apart = rng.permutation(image.size).reshape(shape).astype(np.float64)
            assert (flood(apart, f"--connectivity {connectivity}", markers=markers)
                    == theirs.watershed(apart, markers, near)).all()
'
}

@test "balls that touch come apart by their distances; a depth of none would make more" {
    against_reference '
z, y, x = np.indices((30, 32, 60)).astype(float)
left, right = [(x - c) ** 2 + (y - 16) ** 2 + (z - 15) ** 2 <= 12 ** 2 for c in (18.0, 38.0)]
mask = (left | right).astype(np.uint8)
got = flood(mask, "--on distance --depth 1 --connectivity 26")
assert set(np.unique(got)) == {0, 1, 2} and ((got > 0) == (mask > 0)).all()
inside = mask > 0
assert (got[inside & (x < 27.5)] == 1).all() and (got[inside & (x > 28.5)] == 2).all()
assert json.load(open("r.json"))["unreached"] == 0
# By hand: minus the distance, in the mask.
from scipy.ndimage import distance_transform_edt
d = -distance_transform_edt(mask).astype(np.float32)
assert (got == watershed(d, minima(d, 26, inside, 1), 26, inside)).all()
'
}

@test "borders of the gradient are where the values change, in world units" {
    against_reference '
a = (blobs((11, 12, 13), 1) * 100).astype(np.float32)
name = raw(a, "v")
subprocess.run(f"vkt set {name} --spacing 1,0.5,3 | vkt watershed --on gradient --depth 2 | vkt write - --format raw > out.raw",
               shell=True, check=True)
got = np.fromfile("out.raw", np.uint32).reshape(a.shape)
p = np.pad(a.astype(float), 1, "edge")
gz, gy, gx = ((p[2:, 1:-1, 1:-1] - p[:-2, 1:-1, 1:-1]) / 6, (p[1:-1, 2:, 1:-1] - p[1:-1, :-2, 1:-1]) / 1,
              (p[1:-1, 1:-1, 2:] - p[1:-1, 1:-1, :-2]) / 2)
g = np.sqrt(gx * gx + gy * gy + gz * gz).astype(np.float32)
assert (got == watershed(g, minima(g, depth=2))).all()
'
}

@test "what no flood reaches stays 0, and is told; slabs, threads and pipes make no difference" {
    against_reference '
a = np.zeros((5, 6, 20), np.uint8)
markers = a.copy()
markers[2, 2, 2] = 9
mask = a + 1
mask[:, :, 10] = 0
got = flood(a, markers=markers, mask=mask)
assert (got[:, :, :10] == 9).all() and not got[:, :, 10:].any()
assert "270 of 600 voxels" in flood.said and "no marker" in flood.said, flood.said
assert json.load(open("r.json")) == {"labels": 1, "line": 0, "unreached": 270, "sizes": [{"label": 9, "size": 300}]}
a = blobs((23, 24, 25), 1)
name = raw(a, "v")
want = flood(a, "--depth 0.01 --threads 1")
for options in ("--slab 1 --threads 2", "--slab 3 --threads 5", "--slab 7"):
    subprocess.run(f"vkt read {name} --slab 5 | vkt watershed --depth 0.01 {options} | vkt write - --format raw > out.raw",
                   shell=True, check=True)
    assert np.fromfile("out.raw", np.uint32).tobytes() == want.tobytes()
'
}

@test "requests that make no sense are refused" {
    vkt make ramp --dims 6 5 4 -o v.nrrd
    vkt convert v.nrrd --dtype float32 -o f.nrrd
    vkt make constant --dims 6 5 4 --dtype uint8 --value 0 -o zero.nrrd
    vkt make constant --dims 6 5 4 --dtype int16 --value -3 -o minus.nrrd
    vkt make constant --dims 6 5 5 --dtype uint8 --value 1 -o other.nrrd
    fails_with 2 'none of 6, 18, 26' vkt watershed v.nrrd --connectivity 8 -o o.nrrd
    fails_with 2 'not a depth' vkt watershed v.nrrd --depth -1 -o o.nrrd
    fails_with 2 'leave one of them out' vkt watershed v.nrrd --depth 1 --markers v.nrrd -o o.nrrd
    fails_with 2 'cannot be float32' vkt watershed v.nrrd --markers f.nrrd -o o.nrrd
    fails_with 2 'differ in size' vkt watershed v.nrrd --markers other.nrrd -o o.nrrd
    fails_with 2 'differ in size' vkt watershed v.nrrd --mask other.nrrd -o o.nrrd
    vkt set zero.nrrd --origin 9,9,9 -o moved.nrrd
    fails_with 2 '--mask lies at another place' vkt watershed v.nrrd --mask moved.nrrd -o o.nrrd
    fails_with 2 '--markers lies at another place' vkt watershed v.nrrd --markers moved.nrrd -o o.nrrd
    fails_with 3 'no marker' vkt watershed v.nrrd --markers zero.nrrd -o o.nrrd
    vkt make constant --dims 6 5 4 --dtype uint8 --value 1 -o one.nrrd
    fails_with 3 'no marker where' vkt watershed v.nrrd --markers one.nrrd --mask zero.nrrd -o o.nrrd
    fails_with 3 'no label' vkt watershed v.nrrd --markers minus.nrrd -o o.nrrd
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical' vkt watershed t.vkt -o o.vkt
    vkt make ramp --dims 256 256 64 -o large.nrrd
    fails_with 5 'whole volumes' vkt watershed large.nrrd --memory 64M -o o.nrrd
    [ ! -e o.nrrd ] && [ ! -e o.vkt ]
}

@test "where nothing can be flooded all labels are 0" {
    vkt make constant --dims 8 7 6 --value 0 -o zero.nrrd
    vkt make noise --dims 8 7 6 -o noise.nrrd
    vkt make constant --dims 1 1 1 --value 0 -o one.nrrd
    for words in 'zero.nrrd --on distance' 'zero.nrrd --on distance --depth 1' 'noise.nrrd --mask zero.nrrd' \
        'noise.nrrd --mask zero.nrrd --on gradient' 'one.nrrd --on distance'; do
        # shellcheck disable=SC2086
        vkt watershed $words -o labels.nrrd --force
        vkt stats labels.nrrd --json | grep -q '"max": 0[,.]'
    done
}

@test "the history names markers and mask where they were said" {
    vkt make noise --dims 8 7 6 -o noise.nrrd
    vkt threshold noise.nrrd --above 0.5 | vkt label -o labels.nrrd
    vkt threshold noise.nrrd --above 0.1 -o mask.nrrd
    vkt watershed noise.nrrd --markers labels.nrrd --mask mask.nrrd -o basins.nrrd
    [ "$(vkt history basins.nrrd | grep -c -- '--markers')" -eq 1 ]
    run -0 vkt history basins.nrrd
    [[ "$output" != *"--mask mask.nrrd"* && "$output" == *"vkt watershed - --markers"*"--mask"* ]]
    # A volume without a history is named.
    vkt write mask.nrrd plain_8x7x6_uint8.raw
    vkt watershed noise.nrrd --mask plain_8x7x6_uint8.raw -o basins.nrrd --force
    vkt history basins.nrrd | grep -q -- 'vkt watershed - --mask plain_8x7x6_uint8.raw'
}

@test "with --roi the region is flooded as if there were no other voxels, which become 0, from markers and masks as from minima" {
    vkt make noise --dims 17 15 13 --dtype uint8 --seed 3 -o v.vkt
    vkt arith gt v.vkt 250 | vkt label -o markers.vkt
    vkt arith gt v.vkt 60 -o mask.vkt
    region=3:14,2:12,4:11
    for name in v markers mask; do vkt crop $name.vkt --roi $region -o $name.part.vkt; done
    for options in '--depth 3' '--on gradient' '--on distance' '--markers markers.vkt --line' '--markers markers.vkt --mask mask.vkt --connectivity 26'; do
        # shellcheck disable=SC2086
        vkt watershed v.vkt --roi $region --report whole.json -o whole.vkt --force $options
        # shellcheck disable=SC2086
        vkt watershed v.part.vkt ${options//.vkt/.part.vkt} --report part.json -o part.vkt --force
        vkt crop whole.vkt --roi $region | vkt diff - part.vkt
        cmp <(grep -v region whole.json) <(grep -v region part.json)
        vkt delete whole.vkt --roi $region --value 0 | vkt stats --json | grep -q '"max": 0,'
    done
    vkt read v.vkt --slab 2 | vkt watershed --roi $region --depth 3 --slab 5 | vkt diff - <(vkt watershed v.vkt --roi $region --depth 3)
    fails_with 2 'leaves the volume' vkt watershed v.vkt --roi 3:40,:,: -o x.vkt
}
