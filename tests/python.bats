# The Python package: found where it was moved to, in agreement with numpy, scipy, nibabel and the command.
load helper

setup_file() {
    [ -e "${VKT_BUILD:-}/python/vkt/_vkt.so" ] || return 0
    install_and_move
}

setup_more() {
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD does not name a build folder"
    [ -e "$VKT_BUILD/python/vkt/_vkt.so" ] || skip "this build has no Python package; configure says why"
    python_with numpy
    site=$(dirname "$(dirname "$(find "$BATS_FILE_TMPDIR/moved here" -name _vkt.so)")")
    cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
}

# Runs standard input with the moved package; vkt, numpy as np and `volume` are there already.
python() {
    { echo 'import warnings, numpy as np, vkt; volume = vkt.read("volume.nrrd")' && cat; } |
        PYTHONPATH="$site" /usr/bin/python3 -W error -
}

@test "the package is found in the moved tree, and nothing else is needed" {
    [[ "$site" == *"moved here/lib/python"*/site-packages ]]
    PYTHONPATH="$site" /usr/bin/python3 -c 'import vkt; print(vkt.__file__, vkt.__version__)' >out
    grep -qF "$site/vkt/__init__.py $(vkt --version | sed -n '1s/vkt //p')" out
}

@test "threads wait for each other asleep, unless the environment says otherwise" {
    ldd "$site/vkt/_vkt.so" | grep -q 'libgomp' || skip "this build has another OpenMP than GCC's"
    script='import os, vkt; assert "GOMP_SPINCOUNT" not in os.environ'
    PYTHONPATH="$site" OMP_DISPLAY_ENV=verbose env -u OMP_WAIT_POLICY /usr/bin/python3 -c "$script" 2>told
    grep -q "GOMP_SPINCOUNT = '1000'" told
    PYTHONPATH="$site" OMP_DISPLAY_ENV=verbose OMP_WAIT_POLICY=active /usr/bin/python3 -c "$script" 2>told
    grep "GOMP_SPINCOUNT = " told
    run ! grep -q "GOMP_SPINCOUNT = '1000'" told
}

@test "the example of the README runs" {
    sed -n '/^```python/,/^```$/p' "$VKT_ROOT/README.md" | sed '/^```/d' >example.py
    [ -s example.py ]
    PYTHONPATH="$site" /usr/bin/python3 -W error example.py
    vkt stats mask.nrrd | grep -q '^max  *1$'
}

@test "arrays and files: every type, unequal extents, geometry, no copy" {
    python <<'EOF'
rng = np.random.default_rng(1)
for dtype in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    a = rng.integers(0, 100, (4, 5, 6)).astype(dtype)
    direction = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    v = vkt.Volume(a, spacing=(1, 2, 3), origin=(-4, 5, 6.5), direction=direction, slope=2, intercept=-1, units="HU")
    assert np.array_equal(v.array, a) and v.dtype == a.dtype and v.dims == (6, 5, 4)
    if dtype == "float16":
        continue  # no file with a header holds it
    v.write(f"{dtype}.nrrd", compress=True)
    back = vkt.read(f"{dtype}.nrrd")
    for x in v, back:
        assert x.dims == (6, 5, 4) and x.dtype == a.dtype and np.array_equal(x.array, a), dtype
        assert x.spacing == (1, 2, 3) and x.origin == (-4, 5, 6.5) and np.array_equal(x.direction, direction)
        assert (x.slope, x.intercept, x.units) == (2, -1, "HU")
v = vkt.Volume(a[::2, :, ::-1])
assert np.array_equal(v, a[::2, :, ::-1]) and v.spacing == (1, 1, 1)
assert np.array_equal(vkt.Volume(a.astype(">f8")).array, a)
assert vkt.Volume(a > 50).dtype == np.uint8 and vkt.Volume(np.arange(5)).dims == (5, 1, 1)
array = v.array
assert array.ctypes.data == v.array.ctypes.data and not array.flags.writeable and not array.flags.owndata
del v
assert array.sum() == a[::2].sum()  # the array keeps the voxels alive
like = vkt.Volume(a[:2], like=back, units="")
assert like.dims == (6, 5, 2) and like.spacing == (1, 2, 3) and like.units == "" and like.space == ""
scan = back.apply("set", attribute="space=left-posterior-superior")
mask = vkt.Volume(scan.array > 50, like=scan)  # lies where the scan does, in the same frame
assert mask.space == "left-posterior-superior" and mask.header["attributes"]["space"] == mask.space
EOF
    vkt info --json int16.nrrd | grep -q '"slope": 2'
}

@test "raw files, regions and several volumes are read as by the command" {
    head -c 24 /dev/urandom >bare
    cat volume.nrrd >first.nrrd
    python <<'EOF'
a = np.fromfile("bare", ">i2", offset=4).reshape(2, 1, 5)
assert np.array_equal(vkt.read("bare", dims=(5, 1, 2), dtype=np.int16, skip=4, endian="big").array, a)
part = vkt.read("volume.nrrd", roi="10:20,:,-7:")
assert np.array_equal(part.array, volume.array[-7:, :, 10:20])
assert part.origin[0] == volume.origin[0] + 10 * volume.spacing[0]
v = vkt.read("[vf]*.nrrd", index=1)
assert np.array_equal(v.array, volume.array)
try:
    vkt.read("[vf]*.nrrd")
    assert False
except vkt.Error as e:
    assert "several" in str(e) and e.exit_code == 2

# Headers may name files beside them, and elsewhere if they are trusted.
import pathlib
pathlib.Path("set").mkdir()
pathlib.Path("set/h.nhdr").write_text("NRRD0004\ntype: uchar\ndimension: 1\nsizes: 24\nencoding: raw\ndata file: ../bare\n")
try:
    vkt.read("set/h.nhdr")
    assert False
except vkt.Error as e:
    assert "leads out of its directory" in str(e) and e.exit_code == 3
assert vkt.read("set/h.nhdr", trust_paths=True).array.tobytes() == pathlib.Path("bare").read_bytes()
EOF
}

@test "operations agree with numpy and scipy" {
    python_with scipy
    python <<'EOF'
from scipy import ndimage
a = volume.array
for axis, flipped in ("x", a[:, :, ::-1]), ("y", a[:, ::-1]), ("z", a[::-1]):
    assert np.array_equal(vkt.apply("flip " + axis, volume).array, flipped)
    assert np.array_equal(volume.apply("flip", axis).array, flipped)
    assert np.array_equal(volume.apply("flip", axis=axis).array, flipped)
f = volume.apply("convert", dtype="float64")
assert np.array_equal(f.array, a)
g = f.apply("filter gaussian", sigma=(1, 2, 1.5), tolerance="1e-7%")
want = ndimage.gaussian_filter(a.astype(float), (1.5, 2, 1), mode="reflect", truncate=9)
assert np.abs(g.array - want).max() < 250e-9, np.abs(g.array - want).max()
assert np.array_equal(f.apply("arith sub", g).array, f.array - g.array)
assert np.array_equal(vkt.apply("arith", "div", 1000, vkt.apply("arith add", g, 1)).array, 1000 / (g.array + 1))
half = f.apply("resample", scale=0.5, method="area")
assert np.allclose(half.array, a.reshape(48, 2, 32, 2, 32, 2).mean((1, 3, 5)), rtol=1e-12)
s = f.stats()
assert s["count"] == a.size and s["max"] == a.max() and s["argmax"][::-1] == list(np.unravel_index(a.argmax(), a.shape))
assert abs(s["mean"] - a.mean()) < 1e-12 and abs(s["variance"] - a.astype(float).var()) < 1e-9
assert f.stats(roi="0:5,:,:")["sum"] == a[:, :, :5].sum()
ball = vkt.apply("make sphere", dims=(30, 20, 10), dtype=np.float32, edge="distance")
z, y, x = np.mgrid[:10, :20, :30]
assert np.allclose(ball.array, np.sqrt((x - 14.5) ** 2 + (y - 9.5) ** 2 + (z - 4.5) ** 2) - 4, atol=1e-5)
EOF
}

@test "every registered operation runs by its name, as the command does, and a dry run tells its plan" {
    printf '3 1 1  1 2 3\n' >kernel.txt
    vkt resample volume.nrrd --dims 12 11 10 --dtype uint8 -o small.nrrd
    python <<'EOF'
import json, os, subprocess
small = vkt.read("small.nrrd")
# {v}: the volume. What is not named here runs on one volume and nothing else, or the test fails and asks for words.
calls = {
    "affine": "1,0.1,0,0,0,1,0,0,0,0,1,0 {v}", "arith": "add {v} 2", "convert": "{v} --dtype uint16",
    "copy": "{v} {v}", "crop": "{v} --roi 1:-1,:,2:", "declare-sv": "--dims 4 5 6", "delete": "{v} --roi 1:-1,:,2:",
    "diff": "{v} {v} --ssim", "dump-range": "{v} --first 1 0 0 --last 3 2 2", "fill": "{v} --value 3",
    "fill-range": "{v} --first 1 0 0 --last 3 2 2 --value 9", "filter bilateral": "{v} --sigma 1 --range-sigma 9",
    "filter box": "{v} --radius 1", "filter dog": "{v} --sigma 0.5", "filter gaussian": "{v} --sigma 1",
    "filter kernel": "kernel.txt {v}", "filter log": "{v} --sigma 0.5", "filter median": "{v} --radius 1",
    "filter nlmeans": "{v} --search 1 --strength 9", "filter sharpen": "{v} --sigma 0.5", "flip": "x {v}",
    "flip-range": "{v} --axis y --first 1 0 0 --last 3 2 2", "histogram": "{v} --bins 7", "make amr": "--blocks 9 --levels 3",
    "mesh": "{v} --iso 100", "morphology": "close {v} --radius 1", "pad": "{v} --by 1", "permute": "zyx {v}", "project": "max {v}",
    "refine": "{v} --tolerance 20", "reorient": "zyx {v}", "edit": "{v} --spacing 1,2,3",
    "resample": "{v} --scale 0.5", "rotate": "{v} --axis z --angle 90", "scale": "{v} --factor 0.5",
    "set": "{v} --spacing 1,2,3", "slice": "{v} --z 4", "stats": "{v} --percentiles 50", "threshold": "{v} --otsu",
    "transform": "v*2+a {v} {v}"}
calls |= {name: "--dims 4 5 6" for name in vkt.operations() if name.startswith("make ") and name not in calls}
reports = []
for name in vkt.operations():
    words = calls.get(name, "{v}").split()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore") # values that are clipped
        result = vkt.apply(name, *(small if word == "{v}" else word for word in words))
    command = ["vkt", *name.split(), *(word.replace("{v}", "small.nrrd") for word in words)]
    plan = subprocess.run([*command, "-n", *([] if isinstance(result, dict) else ["-o", "planned.vkt"])], capture_output=True, text=True)
    # info prints what is planned.
    assert plan.returncode == 0 and (plan.stderr.startswith("vkt " + name.split()[0] + ": ") or name == "info"), (name, plan)
    assert not os.path.exists("planned.vkt"), name
    if isinstance(result, vkt.Volume):
        subprocess.run([*command, "-q", "-o", "want.vkt", "--force"], check=True)
        info = lambda file: {k: v for k, v in json.loads(subprocess.run(["vkt", "info", "--json", file], check=True, capture_output=True).stdout).items() if k not in ("format", "history")}
        header = {k: v for k, v in result.header.items() if k != "history"}
        assert {k: v for k, v in info("want.vkt").items() if k in header} == header, (name, header, info("want.vkt"))
        if not result.hierarchical:
            subprocess.run(["vkt", "convert", "want.vkt", "-o", "want.nrrd", "--force"], check=True)
            assert np.array_equal(result.array, vkt.read("want.nrrd").array), name
        continue
    reports.append(name)
    text = name in ("dump", "dump-range")
    ran = subprocess.run([*command, *([] if text else ["--json"])], capture_output=True, text=True)
    want = {"text": ran.stdout} if text else json.loads(ran.stdout)
    for key in ("format", "history"):
        if name == "info":
            want.pop(key, None), result.pop(key, None)
    assert ran.returncode == 0 and result == want, (name, result, want)
assert set(reports) >= {"stats", "diff", "info", "dump", "dump-range", "histogram"}, reports
EOF
}

@test "reports: a dict of what measures, a property of what was made, inputs in the order in which they are said" {
    python <<'EOF'
a = volume.array
labels = volume.apply("threshold", otsu=True).apply("label")
assert [row["size"] for row in labels.report["labels"]] == np.bincount(labels.array.ravel())[1:].tolist()
assert volume.report is None
assert volume.apply("threshold", otsu=True).report["above"] > 0
rows = vkt.apply("stats", volume, "--labels", labels)["labels"]
assert [row["label"] for row in rows] == list(range(labels.array.max() + 1))
for row in rows:
    assert row["sum"] == a[labels.array == row["label"]].astype(np.int64).sum()
# Options in either order: the mask is the mask.
mask = vkt.Volume((np.arange(a.size).reshape(a.shape) % 3 == 0).astype(np.uint8), like=volume)
one = vkt.apply("stats", volume, "--labels", labels, "--mask", mask)
assert one == vkt.apply("stats", volume, "--mask", mask, "--labels", labels)
assert one["labels"][0]["count"] == ((labels.array == 0) & (mask.array > 0)).sum()
b = volume.apply("filter gaussian", sigma=1)
found = volume.apply("diff", b)
assert found["max_abs"] == np.abs(a.astype(float) - b.array).max() and found["differing"] == (a != b.array).sum()
counts = volume.apply("histogram", bins=16, range="0:256")
assert counts["counts"] == np.histogram(a, 16, (0, 256))[0].tolist()
parts = [volume.apply("stats", roi=f":,:,{z}", mergeable=True) for z in ("0:9", "9:")]
import json
for i, part in enumerate(parts):
    json.dump(part, open(f"part{i}.json", "w"))
assert vkt.apply("stats", "--merge", "part0.json", "part1.json") == volume.stats()
try:
    vkt.apply("stats", volume, "--mask", "file.nrrd")
    assert False
except vkt.Error as error:
    assert error.exit_code == 2 and "pass the volume beside the words" in error.hint
EOF
}

@test "voxels stay where they are in the world, says nibabel" {
    python_with nibabel
    python <<'EOF'
import nibabel
def image(v):
    affine = np.eye(4)
    affine[:3, :3] = v.direction * v.spacing
    affine[:3, 3] = v.origin
    return nibabel.Nifti1Image(v.array.T, affine)
angle = 0.3
turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
v = vkt.Volume(volume.array, spacing=(1, 2, 3), origin=(4, 5, 6), direction=turn)
for name, theirs in (
    ("flip x", image(v).as_reoriented(np.array([[0, -1], [1, 1], [2, 1]]))),
    ("flip z", image(v).as_reoriented(np.array([[0, 1], [1, 1], [2, -1]]))),
    ("crop --roi 3:9,5:,:-7", image(v).slicer[3:9, 5:, :-7]),
):
    mine = image(v.apply(name))
    assert np.allclose(mine.affine, theirs.affine, atol=1e-12), name
    assert np.array_equal(np.asarray(mine.dataobj), np.asarray(theirs.dataobj)), name
EOF
}

@test "what is lost is a warning, what is refused an error with the exit code of the command" {
    cp volume.nrrd there.nrrd
    python <<'EOF'
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    volume.apply("arith mul", 3)
assert len(caught) == 1 and "clipped to [0,255]" in str(caught[0].message) and caught[0].filename == "<stdin>"

def refused(code, text, call):
    try:
        call()
    except vkt.Error as e:
        assert e.exit_code == code and text in str(e), (e.exit_code, str(e))
    else:
        assert False, text
refused(2, "did you mean 'filter gaussian'", lambda: volume.apply("filtr gaussian"))
refused(2, "did you mean 'sigma='", lambda: volume.apply("filter gaussian", sigme=2))
refused(2, "missing AXIS", lambda: volume.apply("flip"))
refused(2, "flip takes 1 volume, not 2", lambda: volume.apply("flip x", volume))
refused(2, "make noise takes 0 volumes, not 1", lambda: volume.apply("make noise", dims=(2, 2, 2)))
refused(2, "complex", lambda: vkt.Volume(np.zeros((2, 2), complex)))
refused(2, "shape", lambda: vkt.Volume(np.zeros((2, 2, 2, 2))))
refused(4, "nowhere.nrrd", lambda: vkt.read("nowhere.nrrd"))
refused(4, "there.nrrd", lambda: volume.write("there.nrrd"))
refused(5, "memory", lambda: vkt.apply("make ramp", dims=(999, 999, 999), memory="1MiB"))
volume.write("there.nrrd", force=True)
EOF
    head -c 20000 volume.nrrd >cut.nrrd
    python <<<'
try: vkt.read("cut.nrrd")
except vkt.Error as e: assert e.exit_code == 3
else: assert False'
}

@test "what files and arguments say comes as one line that terminals show" {
    python <<'EOF'
import unicodedata
open("evil.nrrd", "wb").write(b"NRRD0004\ntype: \x1b[31m\xff\xc2\x9b\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\na")
volume = vkt.apply("make noise", dims=(4, 4, 4))
for attempt in (lambda: vkt.read("no\033[31m\nsuch"), lambda: vkt.read("evil.nrrd"), lambda: volume.apply("flip \033[2J"),
                lambda: volume.apply("filter gaussian", sigma="\u202e\n"), lambda: volume.write("no\033/x.nrrd")):
    try:
        attempt()
        raise AssertionError("no error")
    except vkt.Error as e:
        said = str(e) + e.hint
        assert not any(unicodedata.category(c) in ("Cc", "Cf", "Cs") for c in said), repr(said)
EOF
}

@test "a copy of a volume is the volume" {
    python <<'EOF'
import copy, gc
for v in copy.copy(volume), copy.deepcopy([volume])[0]:
    assert np.array_equal(v.array, volume.array)
    del v
    gc.collect()
want = vkt.read("volume.nrrd").array.sum()
assert volume.array.sum() == want
EOF
}

@test "processes that Python forks, and threads, compute too" {
    cat >script.py <<'EOF'
import multiprocessing, concurrent.futures, vkt
volume = vkt.read("volume.nrrd")
def smooth(sigma):
    return int(volume.apply("filter gaussian", sigma=sigma, threads=2).array.sum())
def refused(_):
    try:
        volume.apply("flop x")
    except vkt.Error as e:
        return e.exit_code
want = [smooth(s) for s in (1, 2, 3)]
with multiprocessing.get_context("fork").Pool(2) as pool:
    assert pool.map(smooth, (1, 2, 3)) == want and pool.map(refused, (1,)) == [2]
with concurrent.futures.ThreadPoolExecutor(3) as pool:
    assert list(pool.map(smooth, (1, 2, 3))) == want
EOF
    PYTHONPATH="$site" timeout 60 /usr/bin/python3 script.py
}

@test "hierarchical volumes have no array until they are a grid" {
    sample=amr/flash/synth3d_cubic_hdf5_plt_cnt_0000
    needs_data "$sample"
    [ -n "$(find "$BATS_FILE_TMPDIR/moved here" -name vkt_hdf5.so)" ] || skip "this build has no HDF5 module"
    vkt read "$VKT_DATA/$sample" --variable dens | vkt resample --cells 20k -o want.nrrd
    cp "$VKT_DATA/$sample" flash
    python <<'EOF'
tree = vkt.read("flash", variable="dens")
assert tree.hierarchical and tree.stats()["volume"] > 0
try:
    tree.array
    assert False
except vkt.Error as e:
    assert e.exit_code == 2 and "resample" in e.hint
assert np.array_equal(tree.apply("resample", cells="20k").array, vkt.read("want.nrrd").array)
EOF
}

@test "the history makes the volume again" {
    python <<'EOF'
volume.apply("crop", roi="8:-8,:,:").apply("filter gaussian", sigma=1.5).apply("flip y").write("made.nrrd")
EOF
    vkt history --as-shell made.nrrd >again
    bash -c "$(cat again)" >again.vkt
    vkt diff made.nrrd again.vkt --geometry
}

@test "memory of volumes that are gone serves the next result, and trim gives it back" {
    python <<'EOF'
def resident():
    return int(open("/proc/self/statm").read().split()[1]) * 4096

vkt.trim()
noise = vkt.apply("make noise", dims=(256, 256, 128))  # 32 MiB
want = noise.array[:, :, ::-1].copy()
places = set()
for _ in range(3):
    flipped = noise.apply("flip x")
    assert np.array_equal(flipped.array, want)
    places.add(flipped.array.ctypes.data)
    del flipped
assert len(places) == 1, places
before = resident()
assert vkt.trim() == 32 << 20
assert resident() < before - (24 << 20)
assert vkt.trim() == 0
assert np.array_equal(noise.apply("flip x").array, want)
EOF
}

@test "what is kept is within the budget, together with what comes" {
    VKT_MEMORY=40M python <<'EOF'
a = vkt.apply("make noise", dims=(256, 256, 128))  # 32 MiB
del a
b = vkt.apply("make noise", dims=(256, 256, 64))  # 16 MiB beside 32 would be more than 40
del b
assert 0 < vkt.trim() <= 40 << 20
EOF
}

@test "transform: expressions, and functions of index and value" {
    python <<'EOF'
a = np.arange(24, dtype=np.float32).reshape(2, 3, 4) - 12
v = vkt.Volume(a, spacing=(1, 2, 3))
z, y, x = np.indices(a.shape)
assert np.array_equal(v.transform("v * 2 + x").array, a * 2 + x)
assert np.array_equal(vkt.transform(v, "-v").array, -a)
assert np.array_equal(vkt.transform(v, "v - a * b", v, vkt.Volume(x, like=v), dtype="float64").array, a - a * x)
assert np.array_equal(v.transform("v[1,0,0]", boundary="wrap").array, np.roll(a, -1, 2))
assert v.transform("v > 3").dtype == np.uint8
calls = []
def shifted(x, y, z, value):
    calls.append((x, y, z))
    return value + 100 * x + 10 * y + z
result = vkt.transform(v, shifted)
assert np.array_equal(result.array, a + 100 * x + 10 * y + z) and result.spacing == (1, 2, 3)
assert calls == [(i, j, k) for k in range(2) for j in range(3) for i in range(4)]
part = v.transform(shifted, roi="1:2,:,:", dtype=np.int16)
assert np.array_equal(part.array, np.where(x == 1, a + 100 * x + 10 * y + z, a)) and part.dtype == np.int16
assert "transform" in str(part.header["history"])
calls.clear()
def fails(x, y, z, value):
    calls.append(x)
    raise KeyError("no")
try:
    v.transform(fails)
    raise SystemExit("nothing was raised")
except KeyError:
    assert len(calls) == 1
for wrong, code in ((lambda: v.transform("v +"), 2), (lambda: v.transform(shifted, v), 2), (lambda: v.transform("v + a"), 2),
                    (lambda: v.transform(shifted, roi="90:,:,:"), 2)):
    try:
        wrong()
        raise SystemExit("nothing was refused")
    except vkt.Error as error:
        assert error.exit_code == code, error
for clip in "v * 100", lambda x, y, z, value: value * 100:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        v.transform(clip, dtype="int8")
    assert len(caught) == 1 and "clipped to [-128,127]" in str(caught[0].message), caught
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    vkt.transform(v, "1 / 0 * v"), vkt.transform(v, lambda *_: 999, dtype="uint8")
    assert [w.filename for w in caught] == ["<stdin>"] * 2, [w.filename for w in caught]
EOF
}

@test "render gives the picture of the command, as bytes, light or a file; a volume shows itself" {
    vkt render volume.nrrd --size 40x30 --view x --background 0,0,0,0 -o command.png
    vkt render volume.nrrd --size 90x80 --annotate --caption 'two words' -o written.png 2>said || true
    python <<'EOF2'
import os, struct, zlib
def rows_of(png):
    at, idat = 8, b""
    while at < len(png):
        n, kind = struct.unpack(">I4s", png[at:at + 8])
        if kind == b"IDAT": idat += png[at + 8:at + 8 + n]
        at += n + 12
    return idat
options = dict(size=(40, 30), view="x", background="0,0,0,0")
png = vkt.render(volume, format="png", **options)
assert rows_of(png) == rows_of(open("command.png", "rb").read()) and b"Quality" not in png and b"--view" in png
p = vkt.render(volume, **options)
f = volume.render(format="float", **options)
assert p.shape == f.shape == (30, 40, 4) and p.dtype == np.uint8 and f.dtype == np.float32
assert (p[0, 0] == 0).all() and p[..., 3].max() == 255 and p[15, 20, :3].max() > 30
# Bytes are the light in sRGB with straight alpha.
a = f[..., 3:]
light = np.where(a > 0, f[..., :3] / np.maximum(a, 1e-9), 0).clip(0, 1)
srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
assert np.abs(255 * srgb - p[..., :3])[a[..., 0] > 0.01].max() <= 0.51
assert np.abs(255 * a - p[..., 3:]).max() <= 0.51
assert (vkt.render(volume, size=8)[..., 3] == 255).all()
# Annotated as on the command line, where there is a font.
if os.path.exists("written.png"):
    written = vkt.render(volume, size=(90, 80), annotate=True, caption="two words", format="png")
    assert rows_of(written) == rows_of(open("written.png", "rb").read())
else:
    said = open("said").read()
    assert "no font" in said or "without it" in said, said
# In notebooks it is seen, and so is a part of it, with alpha or without; what is no picture is an array as others.
shown = p._repr_png_()
assert shown[:8] == b"\x89PNG\r\n\x1a\n" and struct.unpack(">II5B", shown[16:29]) == (40, 30, 8, 6, 0, 0, 0)
rows = np.frombuffer(zlib.decompress(rows_of(shown)), np.uint8).reshape(30, 1 + 4 * 40)
assert (rows[:, 0] == 0).all() and (rows[:, 1:].reshape(30, 40, 4) == p).all()
part = p[5:9, 3:, :3]
assert struct.unpack(">II5B", part._repr_png_()[16:29]) == (37, 4, 8, 2, 0, 0, 0)
rows = np.frombuffer(zlib.decompress(rows_of(part._repr_png_())), np.uint8).reshape(4, 1 + 3 * 37)
assert (rows[:, 1:].reshape(4, 37, 3) == part).all()
assert all(a._repr_png_() is None for a in (f, p[..., 0], p[:0], p == p)) and isinstance(p, np.ndarray)
ball = np.zeros((12, 14, 16), np.uint8)
ball[3:9, 3:9, 3:9] = 200
assert (vkt.render(ball, size=16) == vkt.render(vkt.Volume(ball), size=16)).all()
try:
    vkt.render("volume.nrrd")
    raise SystemExit("a name was taken for a volume")
except TypeError as error:
    assert "vkt.read" in str(error), error
two = vkt.render(volume, size=16, render_algo="implicit-iso", iso=[volume.array.max() / 4, volume.array.max() / 2])
assert two.shape == (16, 16, 4)
for bad, code in ((dict(step=9), 2), (dict(sizes=3), 2), (dict(format="jpeg"), 2), (dict(noise=1), 2)):
    try:
        vkt.render(volume, **bad)
        raise SystemExit(f"{bad} was accepted")
    except vkt.Error as error:
        assert error.exit_code == code
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    vkt.render(volume, size=8, render_algo="implicit-iso", iso=1e6)
assert len(said) == 1 and "no surface" in str(said[0].message)
html = volume._repr_html_()
assert html.count("data:image/png;base64,") == 4 and "vkt.Volume" in html
nothing = vkt.Volume(np.full((3, 4, 5), np.nan, "float32"))._repr_html_()
assert nothing.count("data:image/png;base64,") == 3 and "no finite voxel" in nothing
tree = volume.apply("refine", tolerance=50)
assert tree.hierarchical and tree._repr_html_().count("data:image/png;base64,") == 1
EOF2
}

@test "calls are interrupted as Python is: by Ctrl-C and by handlers that raise, with nothing left" {
    python <<'EOF2'
import os, signal, threading, time

def interrupted(call, number=signal.SIGINT, kind=KeyboardInterrupt):
    threading.Thread(target=lambda: (time.sleep(0.2), os.kill(os.getpid(), number))).start()
    start = time.monotonic()
    try:
        call()
        raise SystemExit("the call was not interrupted")
    except kind:
        assert time.monotonic() - start < 10

noise = vkt.make.noise(dims=(128, 128, 128))
interrupted(lambda: vkt.render(noise, render_algo="multi-scattering", size=1024, spp=65536))
interrupted(lambda: [vkt.surface(noise, iso=0.5) for _ in range(1000)])
interrupted(lambda: [noise.write("noise.nii.gz", force=True) for _ in range(1000)])
interrupted(lambda: [noise.stats(percentiles=50) for _ in range(10000)])
interrupted(lambda: vkt.filter.median(vkt.make.noise(dims=(400, 400, 400)), radius=7))
for _ in range(12):  # wherever between two calls of the function the signal comes
    interrupted(lambda: vkt.transform(noise, lambda x, y, z, v: v + 1))

def late(*_):
    raise TimeoutError("late")

signal.signal(signal.SIGUSR1, late)
interrupted(lambda: vkt.render(noise, render_algo="multi-scattering", size=1024, spp=65536), signal.SIGUSR1, TimeoutError)
seen = []
signal.signal(signal.SIGUSR1, lambda *_: seen.append(1))  # one that does not raise ends nothing
threading.Thread(target=lambda: (time.sleep(0.05), os.kill(os.getpid(), signal.SIGUSR1))).start()
assert vkt.render(volume, render_algo="multi-scattering", size=128, spp=16).shape == (128, 128, 4)
while not seen:
    time.sleep(0.01)
assert [name for name in os.listdir(".") if "noise" in name and name != "noise.nii.gz"] == []

# The program that a call runs ends, too.
interrupted(lambda: vkt.command("render", noise, render_algo="multi-scattering", size=1024, spp=65536, output="n.png"))
try:
    os.waitpid(-1, os.WNOHANG)
    raise SystemExit("the program is still there")
except ChildProcessError:
    pass
EOF2
}

@test "words and names with a NUL, and geometry of another size, are refused" {
    touch a
    python <<'EOF2'
for call in (lambda: vkt.read("volume.nrrd\0.mha"), lambda: volume.write("new.nrrd\0.mha"),
             lambda: vkt.transform(volume, "v * 2\0 + 1"), lambda: vkt.render(volume, caption="one\0two"),
             lambda: list(vkt.read_series("volume.nrrd\0")), lambda: vkt.Volume(volume.array, spacing=(1, 2)),
             lambda: vkt.Volume(volume.array, origin=3)):
    try:
        call()
        raise SystemExit("accepted")
    except vkt.Error as error:
        assert error.exit_code == 2 and ("NUL" in str(error) or "three numbers" in str(error)), error
EOF2
    [ ! -e new.nrrd ]
}

@test "vkt.write() takes volumes and arrays" {
    python <<'END'
vkt.write(volume, "w.nrrd")
assert np.array_equal(vkt.read("w.nrrd").array, volume.array)
vkt.write(np.arange(24, dtype=np.uint8).reshape(2, 3, 4), "w.nrrd", force=True)
assert vkt.read("w.nrrd").array[1, 2, 3] == 23
END
}
