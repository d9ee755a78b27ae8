# The examples of the README: its commands run, make the pictures it shows, and find what SciPy finds.
load helper

# All of them once, as the README says them, in a directory with the examples in it.
setup_file() {
    cd "$BATS_FILE_TMPDIR" || exit 1
    ln -s "$VKT_ROOT/examples" examples
    sed -n '/^## Examples/,/^## Commands/p' "$VKT_ROOT/README.md" | grep -E '^(sh|make) ' >commands
    while IFS= read -r command; do
        env -u VKT_DATA bash -c "$command" >>said 2>>complaints </dev/null || echo "$command fails" >>complaints
    done <commands
}

setup_more() { cd "$BATS_FILE_TMPDIR" || exit 1; }

# py CODE: with pixels(file), rows from the bottom, [y, x, channel].
py() { /usr/bin/python3 -c "
import glob, json, os, sys
import numpy as np, vtk
from vtk.util.numpy_support import vtk_to_numpy
def pixels(name):
    reader = vtk.vtkPNGReader(); reader.SetFileName(name); reader.Update()
    image = reader.GetOutput(); width, height, _ = image.GetDimensions()
    values = vtk_to_numpy(image.GetPointData().GetScalars())
    assert values.dtype == np.uint8, name
    return values.reshape(height, width, -1).astype(float)
$1" "${@:2}"; }

# In Python: voxels of a NRRD file, [z, y, x].
voxels='
import gzip
def voxels(name, dtype, dims):
    header, data = open(name, "rb").read().split(b"\n\n", 1)
    return np.frombuffer(gzip.decompress(data) if b"encoding: gzip" in header else data, dtype).reshape(dims[::-1])
'

@test "every example of the README runs, without a word but the last, which names what it made" {
    [ ! -s complaints ] || { cat complaints >&2; false; }
    [ "$(wc -l <commands)" -eq 4 ]
    ls "$VKT_ROOT"/examples/*.sh | sed 's,.*/,,' | grep -v -e quickstart -e amr-zoom | sort >there
    sed -n 's,^sh examples/,,p' commands | sort | diff there -
    grep -v '^ *vkt ' said >last
    [ "$(wc -l <last)" -eq 4 ]
    for file in $(grep -oE '[a-z-]+\.(png|nrrd)' last); do [ -s "$file" ]; done
    grep -qx 'prepared 2 volumes in prepared' last
}

@test "the pictures of the README are those that its examples make, small, and not empty" {
    python_with vtk numpy
    cp prepared/ct.nrrd.png prepare-ct.png
    cp prepared/phantom.nrrd.png prepare-phantom.png
    grep -oE 'examples/pictures/[a-z-]+\.png' "$VKT_ROOT/README.md" | sed 's,.*/,,' | sort >shown
    ls "$VKT_ROOT/examples/pictures" | sort | diff shown -
    # Rounding differs between instruction sets: a root mean square of half a grey level of 255 is allowed.
    py '
total = 0
for name in open("shown").read().split():
    path = os.path.join(sys.argv[1], name)
    a, b = pixels(name), pixels(path)
    assert a.shape == b.shape, name
    error = np.sqrt(((a - b) ** 2).mean())
    assert error <= 0.5, f"{name}: RMSE {error}"
    shades = len(np.unique(a.reshape(-1, a.shape[2]), axis=0))
    assert shades >= 100 and a.std() > 10, f"{name}: {shades} colours, deviation {a.std()}"
    assert os.path.getsize(path) <= 150000, name
    total += os.path.getsize(path)
assert 0 < total <= 500000, total
a, b, c = (pixels(f"teaser-{n}.png") for n in ("volume", "fill", "rotate"))
for one, other in ((a, b), (b, c), (a, c)):
    assert np.sqrt(((one - other) ** 2).mean()) > 10' "$VKT_ROOT/examples/pictures"
    # And by the same steps.
    for name in teaser-fill teaser-rotate ct-bone ct-depth prepare-ct; do
        vkt history "$VKT_ROOT/examples/pictures/$name.png" | diff - <(vkt history $name.png)
    done
}

@test "the small CT is what its script makes" {
    python_with vtk numpy
    # The last bit of a square root may differ between machines, and a step of the CT is 4 HU.
    py "$voxels"'
import runpy
a = runpy.run_path("examples/data/make-phantom.py")["ct"]().astype(int)
b = voxels("examples/data/ct.nrrd", "<i2", (72, 60, 40))
assert np.abs(a - b).max() <= 4 and (a != b).mean() < 1e-4'
    [ "$(stat -c %s examples/data/ct.nrrd)" -le 200000 ]
}

@test "the largest bone is the one that SciPy finds, and as deep" {
    python_with vtk numpy scipy
    vkt write depth.nrrd depth.raw --force
    py "$voxels"'
import re
from scipy import ndimage
spacing = (2.4, 1.5, 1.5)
ct = voxels("examples/data/ct.nrrd", "<i2", (72, 60, 40)).astype(float)
smooth = np.rint(ndimage.gaussian_filter(ct, [1 / s for s in spacing], mode="reflect", truncate=8))
smooth = np.maximum(smooth, 0).astype(int)
# Otsu: the threshold of the greatest variance between what is not above and what is.
counts = np.bincount(smooth.ravel()).astype(float)
values = np.arange(counts.size)
below, mass = np.cumsum(counts), np.cumsum(counts * values)
with np.errstate(divide="ignore", invalid="ignore"):
    between = (mass[-1] * below / below[-1] - mass) ** 2 / (below * (below[-1] - below))
threshold = int(np.nanargmax(between[:-1]))
labels, n = ndimage.label(smooth > threshold)
sizes = np.bincount(labels.ravel())[1:]
bone = labels == 1 + sizes.argmax()
assert n >= 3 and np.sort(sizes)[-2] < sizes.max(), sizes
got = voxels("bone.nrrd", "u1", (72, 60, 40))
assert set(np.unique(got)) == {0, 1}
# Rounding of the Gaussian may tip voxels whose value is the threshold.
on_edge = (np.abs(smooth - threshold) <= 1) & ndimage.binary_dilation(bone)
assert ((got != 0) != bone).sum() <= on_edge.sum() and abs(int(got.sum()) - int(bone.sum())) <= 10, (got.sum(), bone.sum())
depth = ndimage.distance_transform_edt(got, sampling=spacing)
assert np.abs(np.fromfile("depth.raw", "<f4").reshape(got.shape) - depth).max() < 1e-5
said = re.search(r"bone.nrrd \((\d+) voxels\), depth.nrrd \(up to ([\d.]+)\)", open("said").read())
assert int(said[1]) == got.sum() and float(said[2]) == round(float(depth.max()), 2), said[0]'
}

@test "CLAHE parts what was alike: liver from belly fat by twice as many greys and more" {
    python_with vtk numpy
    # Four pixels a voxel; rows of the picture from the bottom, 60 voxels high.
    py '
def contrast(name):
    grey = pixels(name)[:, :, 0]
    at = lambda x, y: grey[4 * (60 - y) - 20:4 * (60 - y), 4 * x:4 * x + 20].mean()
    return at(46, 15) - at(12, 20)
before, after = contrast("clahe-before.png"), contrast("clahe-after.png")
assert 5 < before and after > 2 * before, (before, after)'
}

@test "the session in Python: components as NumPy and the command find them, and a picture" {
    [ -e "${VKT_BUILD:-}/python/vkt/_vkt.so" ] || skip "this build has no Python package; configure says why"
    python_with numpy
    grep -qx 'PYTHONPATH=build/python python3 examples/python-session.py' "$VKT_ROOT/README.md"
    PYTHONPATH="$VKT_BUILD/python" /usr/bin/python3 -W error examples/python-session.py session >said.session
    vkt filter gaussian examples/data/phantom.nrrd --sigma 1 | vkt threshold --above 80 | vkt label --min-size 10 -o want.nrrd
    vkt diff want.nrrd session/session.nrrd
    voxels=$(vkt threshold want.nrrd --range 1:1 | vkt stats --json | sed -n 's/.*"sum": \([0-9]*\),.*/\1/p')
    [[ "$(grep components said.session)" == *"[$voxels"* ]]
    head -c 4 session/session.png | grep -q PNG
    tail -n 1 said.session | grep -qx 'wrote session.nrrd and session.png to session'
}

@test "real volumes where they are, a word where they are not" {
    mkdir -p empty
    VKT_DATA=$PWD/empty run --separate-stderr sh examples/clahe.sh absent
    [ "$status" -eq 0 ]
    [[ "$stderr" == *"there is no $PWD/empty/"* ]]
    cmp absent/clahe-after.png clahe-after.png
    needs_data nrrd/template_T2.nrrd
    needs_data raw/stent_128x128x256_int16.raw
    needs_data raw/fuel_64x64x64_uint8.raw
    sh examples/clahe.sh real
    sh examples/teaser.sh real
    sh examples/segment-ct.sh real >real/said
    run ! cmp -s real/clahe-after.png clahe-after.png
    run ! cmp -s real/teaser-fill.png teaser-fill.png
    # The aorta: nothing in the CT is larger.
    [ "$(sed 's/.*bone.nrrd (\([0-9]*\) voxels.*/\1/' real/said)" -gt 100000 ]
}

@test "a directory is prepared: only what is new, after a change of settings all, and never by halves" {
    python_with numpy
    prepare() { make -f examples/prepare/Makefile IN=in OUT="$1" "${@:2}"; }
    mkdir -p in/sub
    cp examples/data/phantom.nrrd in/a.nrrd
    vkt make sphere --dims 20 20 10 --spacing 1,1,2 -o in/sub/slices.mhd
    vkt make ramp --dims 20 20 10 --dtype uint16 --format raw -o in/sub/r_20x20x10_uint16.raw
    cp in/a.nrrd in/sub/c.nrrd
    truncate -s -100 in/sub/c.nrrd
    # A damaged volume fails, leaves nothing under its name, and does not stop the others; one more run mends it.
    run prepare out -j3 -k
    [ "$status" -eq 2 ]
    [[ "$output" == *"c.nrrd"* ]]
    (cd out && find . -type f | sort) >found
    printf './%s\n' .settings a.nrrd.nrrd a.nrrd.png sub/r_20x20x10_uint16.raw.nrrd sub/r_20x20x10_uint16.raw.png \
        sub/slices.mhd.nrrd sub/slices.mhd.png | diff - found
    cp examples/data/phantom.nrrd in/sub/c.nrrd
    prepare out -j3 -s >said.prepare
    grep -qx 'prepared 4 volumes in out' said.prepare
    # The same with one job as with three.
    prepare one -j1 -s
    diff -r out one
    vkt info out/sub/slices.mhd.nrrd --json >i
    py 'i = json.load(open("i"))
assert i["dims"] == [20, 20, 20] and i["spacing"] == [1, 1, 1] and i["dtype"] == "uint8", i'
    # The range is that of the percentiles: half a per cent lies at either end and beyond.
    vkt convert out/a.nrrd.nrrd --format raw -o a.raw
    py 'v = np.fromfile("a.raw", np.uint8)
assert v.min() == 0 and v.max() == 255 and 0.004 < (v == 255).mean() < 0.02, (v == 255).mean()'
    # Nothing to do; then what depends on one file, the voxels beside a header; then, with other settings, all.
    changed() { find out -name '*.nrrd' -newer mark -o -name '*.png' -newer mark | wc -l; }
    touch mark
    prepare out -j3 -s
    [ "$(changed)" -eq 0 ]
    touch in/sub/slices.raw
    prepare out -j3 -s
    [ "$(changed)" -eq 2 ]
    touch mark
    prepare out -j3 -s SPACING=2
    [ "$(changed)" -eq 8 ]
    # Results below the input are no inputs.
    prepare in/out -j3 -s
    prepare in/out -j3 -s | grep -q 'prepared 4 volumes'
    run make -f examples/prepare/Makefile IN=in
    [ "$status" -eq 2 ]
    [[ "$output" == *"IN=DIRECTORY OUT=DIRECTORY"* ]]
    run make -f examples/prepare/Makefile IN=empty OUT=out
    [ "$status" -eq 2 ] && [[ "$output" == *"no volumes below"* ]]
}
