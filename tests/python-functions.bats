# Python: every operation as a function, with the signature, the help and the stubs that the registry gives it.
load helper
load display
load python

@test "every operation is a function with a signature, types and help of its own" {
    python <<'EOF2'
import inspect, json
from vkt import _operations
seen = 0
for name in vkt.operations():
    words = name.split()
    home = vkt if len(words) == 1 else getattr(vkt, words[0])
    function = getattr(home, words[-1].replace("-", "_"))
    seen += 1
    if name == "transform":
        continue  # which takes functions of Python, too
    registered = _operations.registered(name)
    signature = inspect.signature(function)
    assert function.__module__ == home.__name__ and function.__name__ in dir(home)
    for parameter in registered["parameters"]:
        if parameter["name"] == "in":
            continue
        found = signature.parameters[_operations.python_name(parameter["name"])]
        assert found.annotation is not found.empty, (name, parameter["name"])
        assert (found.default is found.empty) == parameter["required"], (name, parameter["name"])
        assert parameter["help"] and " ".join(parameter["help"].split()) in " ".join(function.__doc__.split()), (name, parameter)
    assert function.__doc__.startswith(registered["summary"]) and registered["summary"].endswith("."), name
    assert registered["accuracy"] and "Accuracy\n--------\n" in function.__doc__, name
    assert {"device", "threads", "memory"} <= set(signature.parameters), name
assert seen == len(vkt.operations()) >= 55
gaussian = inspect.signature(vkt.filter.gaussian)
assert list(gaussian.parameters)[:2] == ["volume", "sigma"]
assert gaussian.parameters["sigma"].kind is inspect.Parameter.KEYWORD_ONLY
rotate = inspect.signature(vkt.rotate).parameters
assert rotate["angle"].annotation == float | None and rotate["expand"].default is False
assert inspect.signature(vkt.make.sphere).return_annotation is vkt.Volume
assert inspect.signature(vkt.stats).parameters["volumes"].kind is inspect.Parameter.VAR_POSITIONAL
assert list(inspect.signature(vkt.arith).parameters)[:4] == ["op", "a", "b", "c"]
assert inspect.signature(vkt.label).parameters["connectivity"].default == 6
assert gaussian.parameters["method"].annotation == __import__("typing").Literal["auto", "fir", "cascade"]
EOF2
}

@test "functions do what the words do" {
    python <<'EOF2'
same = lambda a, b: np.array_equal(a.array, b.array) and a.spacing == b.spacing and a.origin == b.origin
assert same(vkt.filter.gaussian(volume, sigma=2), volume.apply("filter gaussian", sigma=2))
assert same(vkt.filter.gaussian(volume, sigma=(1, 2, 3)), volume.apply("filter gaussian --sigma 1,2,3"))
assert same(vkt.rotate(volume, axis="z", angle=30), volume.apply("rotate --axis z --angle 30"))
assert same(vkt.flip(volume, "x"), volume.apply("flip x")) and same(vkt.flip(volume, axis="x"), volume.apply("flip x"))
assert same(vkt.make.noise(dims=(4, 5, 6), seed=3), vkt.apply("make noise --dims 4 5 6 --seed 3"))
assert same(vkt.morphology(volume, "close", radius=1), volume.apply("morphology close --radius 1"))
assert same(vkt.set(volume, attribute=["a=1", "b=2"]), volume) and vkt.set(volume, attribute=["a=1", "b=2"]).header["attributes"]["b"] == "2"
f = vkt.convert(volume, dtype=np.float32)
assert f.dtype == np.float32
smooth = vkt.filter.box(f, radius=1)
assert np.array_equal(vkt.arith("sub", f, smooth).array, f.array - smooth.array)
assert np.array_equal(vkt.arith("mul", f, 2.5).array, f.array * np.float32(2.5))
assert np.array_equal(vkt.arith("mul", -1, f).array, -f.array)
assert vkt.stats(volume) == volume.stats() and vkt.diff(f, smooth)["max_abs"] == np.abs(f.array.astype(float) - smooth.array).max()
labels = vkt.label(vkt.threshold(volume, otsu=True))
assert vkt.stats(volume, labels=labels) == vkt.apply("stats", volume, "--labels", labels)
assert len(vkt.stats(volume, f)) == 2
part = vkt.crop(volume, roi="2:9,3:9,4:9")
assert same(vkt.copy(part, volume), volume)
try:
    from scipy import ndimage
except ImportError:
    pass
else:
    want = ndimage.gaussian_filter(f.array.astype(float), 1.5, mode="reflect", truncate=9)
    assert np.abs(vkt.filter.gaussian(f, sigma=1.5, tolerance="1e-6%").array - want).max() < 1e-4

def refused(code, text, call):
    try:
        call()
    except vkt.Error as e:
        assert e.exit_code == code and text in str(e), str(e)
    except TypeError as e:
        assert code is None and text in str(e), str(e)
    else:
        assert False, text
refused(None, "sigme", lambda: vkt.filter.gaussian(volume, sigme=2))
refused(None, "volume", lambda: vkt.filter.gaussian(sigma=2))
refused(None, "multiple values", lambda: vkt.flip(volume, "x", axis="y"))
refused(None, "too many", lambda: vkt.flip(volume, "x", "y"))
refused(None, "volumes", lambda: vkt.stats(volumes=volume))
refused(2, "not ndarray", lambda: vkt.filter.gaussian(volume.array, sigma=2))
refused(2, "takes no volume in memory", lambda: vkt.resample(volume, scale=volume))
refused(2, "by how much", lambda: vkt.rotate(volume))
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    vkt.arith("mul", volume, 3)
assert len(caught) == 1 and "clipped" in str(caught[0].message) and caught[0].filename == "<stdin>", caught
EOF2
}

@test "volumes in memory in the place of files; regions and attributes as Python has them" {
    python <<'EOF2'
same = lambda a, b: np.array_equal(a.array, b.array) and a.spacing == b.spacing and a.origin == b.origin
grid = vkt.crop(volume, roi="1:9,2:12,3:13")
grid.write("grid.vkt")
assert same(vkt.resample(volume, like=grid), vkt.resample(volume, like="grid.vkt"))
assert same(vkt.crop(volume, like=grid), grid) and same(vkt.crop(like=grid, volume=volume), grid)
assert same(vkt.rotate(volume, axis="z", angle=30, like=grid), vkt.rotate(volume, axis="z", angle=30, like="grid.vkt"))
assert same(vkt.apply("crop", volume, like=grid), grid) and same(volume.apply("crop", "--like", grid), grid)
assert same(vkt.apply("crop --like", grid, volume), grid)  # in the order of the words
assert "(a volume of the program)" in vkt.crop(volume, like=grid).header["history"]["command"]
labels = vkt.label(vkt.threshold(volume, otsu=True))
assert vkt.apply("stats", volume, labels=labels) == vkt.stats(volume, labels=labels)
weights = np.arange(27, dtype=np.float32).reshape(3, 3, 3) / 351
with open("kernel.txt", "w") as file:
    print("3 3 3", *weights.ravel().astype(float).tolist(), file=file)
for kernel in weights, vkt.Volume(weights), np.asfortranarray(weights):
    assert same(vkt.filter.kernel(volume, kernel), vkt.filter.kernel(volume, "kernel.txt"))
assert same(vkt.filter.kernel(volume, vkt.Volume(weights, slope=2, intercept=0)), vkt.filter.kernel(volume, 2 * weights))

def refused(text, call):
    try:
        call()
    except vkt.Error as e:
        assert text in str(e), str(e)
    else:
        assert False, text
refused("not odd numbers", lambda: vkt.filter.kernel(volume, np.ones((2, 2, 2))))
refused("finite", lambda: vkt.filter.kernel(volume, np.full((3, 3, 3), np.nan)))
refused("does not overlap", lambda: vkt.crop(volume, like=vkt.Volume(np.zeros((2, 2, 2)), origin=(1e6, 0, 0))))
refused("lies nowhere", lambda: vkt.crop(volume, like=volume.array))
refused("takes 1 volume, not 2", lambda: vkt.apply("crop --roi 0:1,0:1,0:1", volume, volume))

# Regions are in the order x, y, z.
want = vkt.crop(volume, roi="0:2,1:3,0:5")
assert want.dims == (2, 2, 5)
for roi in np.s_[0:2, 1:3, 0:5], np.s_[:2, 1:3, :5], ((0, 2), (1, 3), (0, 5)), [[0, 2], [1, 3], [0, 5]], np.array([[0, 2], [1, 3], [0, 5]]):
    assert same(vkt.crop(volume, roi=roi), want), roi
assert same(vkt.crop(volume, roi=np.s_[::2, 4, -3:]), vkt.crop(volume, roi="::2,4,-3:"))
assert same(vkt.crop(volume, roi=((1, None), slice(None), ...)), vkt.crop(volume, roi="1:,:,:"))
assert same(vkt.read("volume.nrrd", roi=np.s_[0:2, 1:3, 0:5]), want)
assert same(vkt.pad(volume, by=((1, 2), (3, 4), slice(5, 6))), vkt.pad(volume, by="1:2,3:4,5:6"))
assert same(vkt.threshold(volume, range=(1, 3)), vkt.threshold(volume, range="1:3"))
assert same(vkt.transform(volume, "0 * v", roi=((0, 2), (1, 3), (0, 5))), vkt.fill(volume, value=0, roi="0:2,1:3,0:5"))
(x0, y0, z0), step = volume.origin, volume.spacing
world = [(x0, x0 + step[0]), (y0, y0 + step[1]), (None, None)]
assert vkt.crop(volume, roi_world=world).dims[2] == volume.dims[2] and vkt.crop(volume, roi_world=world).dims[0] <= 2
assert "order x, y, z" in vkt.crop.__doc__

named = vkt.set(volume, attribute={"a": "b", "n": 3, "c": "d e"})
attributes = named.header["attributes"]
assert (attributes["a"], attributes["n"], attributes["c"]) == ("b", "3", "d e")
assert "a" not in vkt.set(named, attribute={"a": None}).header["attributes"]
assert named.apply("set", attribute={"n": -1}).header["attributes"]["n"] == "-1"
assert same(vkt.set(volume, attribute={}, spacing=(1, 2, 3)), vkt.set(volume, spacing="1,2,3"))
# Numbers of NumPy are numbers.
assert same(vkt.filter.gaussian(volume, sigma=np.float32(1.5)), vkt.filter.gaussian(volume, sigma=1.5))
assert same(vkt.filter.gaussian(volume, sigma=np.array(1.5)), vkt.filter.gaussian(volume, sigma=1.5))
assert vkt.make.noise(dims=np.array([4, 5, 6])).dims == (4, 5, 6)
EOF2
}

@test "several volumes are measured without names, in the order in which they come" {
    python <<'EOF2'
other = vkt.make.ramp(dims=(4, 5, 6))
for one in vkt.stats(volume, other), vkt.info(volume, other), vkt.apply("stats", volume, other, per="x"):
    assert len(one) == 2 and all("name" not in report for report in one), one
assert vkt.stats(volume, other) == [vkt.stats(volume), vkt.stats(other)]
assert [report["dims"] for report in vkt.info(volume, other)] == [list(volume.dims), [4, 5, 6]]
EOF2
}

@test "an array in the place of a volume is refused in one line, whatever its size" {
    python <<'EOF2'
import numpy as np
for call in (lambda a: vkt.apply("rotate --axis z --angle 30", a), lambda a: vkt.apply("stats", volume, labels=a)):
    for array in (np.zeros((40, 40, 40)), np.zeros((2, 2, 2), np.uint8)):
        try:
            call(array)
            raise SystemExit("taken")
        except TypeError as e:
            assert "vkt.Volume(array)" in str(e) and len(str(e)) < 120, e
assert vkt.apply("crop", volume, roi=np.array([[0, 2], [0, 2], [0, 1]]).tolist()) is not None
EOF2
}

@test "hints name what Python has: keywords, and calls" {
    python <<'EOF2'
def hint(call):
    try:
        call()
    except vkt.Error as e:
        assert "--" not in e.hint and e.hint in str(e), e
        return e.hint
    raise SystemExit("nothing was refused")
assert hint(lambda: volume.write("volume.nrrd")) == "overwrite it with force=True"
assert 'vkt.resample(like=VOLUME, method="nearest")' in hint(lambda: vkt.stats(volume, labels=vkt.make.ramp(dims=(2, 2, 2))))
assert hint(lambda: vkt.crop(volume)) == 'use one of roi="X0:X1,Y0:Y1,Z0:Z1", roi_world=, like=FILE'
assert 'range="LO:HI" or otsu=True' in hint(lambda: vkt.threshold(volume))
from vkt._hints import in_python
for said, want in (("take a larger --dtype, or fewer components by --min-size or --keep-largest",
                    "take a larger dtype=, or fewer components by min_size= or keep_largest="),
                   ("vkt stats --labels counts them", "vkt.stats(labels=...) counts them"),
                   ("vkt label numbers the components of a mask; vkt convert --dtype uint32 changes the type",
                    'vkt.label() numbers the components of a mask; vkt.convert(dtype="uint32") changes the type'),
                   ("say for example --first 0 0 0 --last 8 8 8", "say for example first=(0, 0, 0) last=(8, 8, 8)"),
                   ("or put it there with 'vkt resample --like'", "or put it there with 'vkt.resample(like=...)'"),
                   ("choose one: vkt read 'a b.h5' --variable vxin | ...", 'choose one: vkt.read("a b.h5", variable="vxin")'),
                   ("all the same: vkt read d3 --force-uniform | ...", 'all the same: vkt.read("d3", force_uniform=True)'),
                   ("name one: --variable scale0/image", 'name one: variable="scale0/image"'),
                   ("--first/--last say the same", "first=/last= say the same"), ("nothing of it", "nothing of it")):
    assert in_python(said) == want, in_python(said)
EOF2
}

@test "stubs are current, and py.typed says that there are some" {
    PYTHONPATH="$site" /usr/bin/python3 "$VKT_ROOT/libvkt/python/stubs.py" --check
    [ -e "$site/vkt/py.typed" ]
    for stub in __init__ filter make; do
        cmp "$VKT_ROOT/libvkt/python/vkt/$stub.pyi" "$site/vkt/$stub.pyi"
        /usr/bin/python3 -c 'import ast, sys; ast.parse(open(sys.argv[1]).read())' "$site/vkt/$stub.pyi"
    done
}

@test "stubs type a program, says mypy" {
    with_peer mypy
    cat >program.py <<'EOF2'
import vkt
smooth = vkt.filter.gaussian(vkt.read("a.nrrd"), sigma=(1, 2, 3), boundary="mirror")
turned: vkt.Volume = vkt.rotate(smooth, axis="z", angle=30)
mean: float = vkt.stats(turned, smooth, mask=smooth)["mean"]
vkt.flip(turned, "x").write("b.nrrd", force=True)
import numpy as np
vkt.filter.gaussian(turned, sigma=np.float32(2))
vkt.threshold(turned, above=np.float32(2))
vkt.make.noise(dims=np.array([4, 5, 6]), seed=np.int64(3))
vkt.resample(turned, like=smooth, scale=np.array([1.0, 2.0, 3.0]))
vkt.filter.kernel(turned, np.ones((3, 3, 3)))
vkt.crop(turned, roi=np.s_[0:2, 1:3, :])
vkt.crop(turned, roi=((0, 2), (1, 3), (0, None)))
vkt.set(turned, attribute={"a": "b"})
rows: int = vkt.render(turned, size=(64, 48)).shape[0] + turned.render(format="float").shape[1]
picture: bytes = vkt.render(turned, format="png") + turned.render(format="png")
vkt.write_stream(open("a.vkt", "wb"), np.ones((3, 3, 3)))
series: vkt.Series = vkt.read_series("a.nrrd")[1:]
vkt.write_series((vkt.reorient(one, to="RAS") for one in series), "b.nrrd", force=True)
one: vkt.Volume = vkt.merge(vkt.brick(vkt.stack(vkt.split(series[0])), size=32))
EOF2
    MYPYPATH="$site" /usr/bin/python3 -m mypy --strict program.py
    printf 'vkt.flip(turned, "q")\nvkt.rotate(smooth, angel=3)\nvkt.threshold(turned, above="x")\n' >>program.py
    MYPYPATH="$site" run -1 /usr/bin/python3 -m mypy --strict program.py
    [[ "$output" == *'Literal["x"'* || "$output" == *"Literal['x'"* ]]
    [[ "$output" == *angel* ]]
    [[ "$output" == *'"threshold" has incompatible type "str"'* ]]
}

@test "other threads of Python run while an operation computes" {
    python <<'EOF2'
import threading, time
big = vkt.make.noise(dims=(192, 192, 192))
steps, running = 0, threading.Event()
def count():
    global steps
    while not running.is_set():
        steps += 1
        time.sleep(0.0005)
thread = threading.Thread(target=count)
thread.start()
before, begin = steps, time.perf_counter()
vkt.filter.median(big, radius=2, threads=1)
took, during = time.perf_counter() - begin, steps - before
running.set()
thread.join()
# Who held the lock for all that time would have let the other do nothing.
assert took > 0.05 and during > 10, (took, during)
EOF2
}

@test "surfaces: arrays of vertices and triangles, reports, files and labels" {
    PYTHONPATH="$site" /usr/bin/python3 -W error - <<'END'
import numpy as np, vkt, warnings
z, y, x = np.mgrid[0:20, 0:20, 0:20]
ball = vkt.Volume((8 - np.sqrt((x - 9.5) ** 2 + (y - 9.5) ** 2 + (z - 9.5) ** 2)).astype("f4"))
s = vkt.surface(ball, iso=0)
v, t = s.vertices(), s.triangles()
assert len(s) == 1 and v.shape == (s.report["vertices"], 3) and t.shape == (s.report["triangles"], 3) and s.report["euler"] == 2
assert np.abs(np.linalg.norm(v - 9.5, axis=1) - 8).max() < 0.05
a, b, c = v[t[:, 0]], v[t[:, 1]], v[t[:, 2]]
assert abs(np.einsum("ij,ij->", a - 9.5, np.cross(b - 9.5, c - 9.5)) / 6 - s.report["volume"]) < 1e-6 * s.report["volume"]
s.write("ball.vtp"); s.write("ball.ply", normals=True)
for path in "ball.vtp", "ball.xyz":
    try: s.write(path)
    except vkt.Error as e: assert path in str(e)
    else: raise AssertionError(path)
try: vkt.surface(np.zeros((3, 3, 3)), iso=1)
except TypeError as e: assert "takes a vkt.Volume" in str(e)
else: raise AssertionError("an array")
two = np.zeros((9, 9, 9), "u1"); two[1:4, 1:4, 1:4] = 3; two[5:8, 5:8, 5:8] = 7
parts = vkt.surface(vkt.Volume(two), labels=True)
assert [parts.label(i) for i in range(len(parts))] == [3, 7] and [p["label"] for p in parts.report["labels"]] == [3, 7]
assert np.allclose(parts.vertices(1).mean(axis=0), 6)
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    assert len(vkt.surface(ball, iso=1e9).vertices()) == 0
assert "no surface" in str(said[0].message)
END
}

@test "names that people look for are functions: reorient is permute, edit is set" {
    python <<'EOF2'
lps = vkt.edit(volume, attribute="space=LPS", units="HU")
assert lps.units == "HU" and lps.space == "LPS" or lps.space == "left-posterior-superior"
ras = vkt.reorient(lps, to="RAS")
assert np.array_equal(ras.array, vkt.permute(lps, "ras").array) and np.array_equal(ras.array, volume.array[:, ::-1, ::-1])
assert np.array_equal(vkt.apply("reorient --to RAS", lps).array, ras.array)
assert np.array_equal(vkt.apply("edit", lps, units="mm").array, lps.array)
assert ras.header["history"]["command"][0] == "permute"
assert np.array_equal(vkt.permute(volume, to="zyx").array, volume.array.transpose(2, 1, 0))
assert "permute() by another name" in vkt.reorient.__doc__ and "Also by the name to." in vkt.reorient.__doc__
for wrong in dict(order="zyx", to="zyx"), dict(ordre="zyx"), {}:
    try:
        vkt.reorient(volume, **wrong)
        raise SystemExit(f"taken: {wrong}")
    except TypeError:
        pass
try:
    vkt.apply("reorent", volume)
    raise SystemExit("taken")
except vkt.Error as e:
    assert "did you mean 'reorient'" in str(e), e
EOF2
}

@test "slices and bricks: taken apart and put together, as the commands do" {
    python <<'EOF2'
import subprocess
slices = vkt.split(volume)
assert len(slices) == volume.dims[2] and all(s.dims == (*volume.dims[:2], 1) for s in slices)
assert np.array_equal(slices[7].array[0], volume.array[7])
assert np.allclose(slices[7].origin, np.array(volume.origin) + volume.direction[:, 2] * volume.spacing[2] * 7)
again = vkt.stack(slices)
assert np.array_equal(again.array, volume.array) and again.spacing == volume.spacing and again.origin == volume.origin
thick = vkt.stack([vkt.crop(volume, roi=":,:,:10"), vkt.crop(volume, roi=":,:,10:")])
assert np.array_equal(thick.array, volume.array)
bricks = vkt.brick(volume, size=(20, 30, 16), ghost=2)
counts = [-(-n // size) for n, size in zip(volume.dims, (20, 30, 16))]
assert len(bricks) == np.prod(counts) and bricks[0].dims == (22, 32, 18)
assert np.array_equal(bricks[0].array, volume.array[:18, :32, :22])
whole = vkt.merge(reversed(bricks))
assert np.array_equal(whole.array, volume.array) and whole.spacing == volume.spacing
assert whole.header.get("attributes") == volume.header.get("attributes")
# A filter brick by brick, ghosts as wide as it reaches.
median = vkt.merge(vkt.filter.median(brick, radius=2) for brick in vkt.brick(volume, size=24, ghost=2))
assert np.array_equal(median.array, vkt.filter.median(volume, radius=2).array)
subprocess.run(["sh", "-c", "vkt brick volume.nrrd --size 20,30,16 --ghost 2 -o bricks"], check=True)
of_command = [one for one in vkt.read_series("bricks/*.nrrd")]
assert all(np.array_equal(a.array, b.array) for a, b in zip(bricks, of_command, strict=True))
for call, kind, text in (
        (lambda: vkt.merge(bricks[1:]), vkt.Error, "a brick is missing"), (lambda: vkt.merge([volume, volume]), vkt.Error, "brick"),
        (lambda: vkt.stack([]), vkt.Error, "no volumes"), (lambda: vkt.stack([slices[0], slices[2], slices[3]]), vkt.Error, "does not fit"),
        (lambda: vkt.stack(volume), TypeError, "several"), (lambda: vkt.split(volume.array), TypeError, "vkt.Volume"),
        (lambda: vkt.brick(volume, sise=3), vkt.Error, "sise"), (lambda: vkt.merge([]), vkt.Error, "no bricks")):
    try:
        call()
        raise SystemExit(f"taken: {text}")
    except kind as e:
        assert text in str(e), e
assert vkt.stack([slices[0], slices[2], slices[3]], force_uniform=True).dims[2] == 3
tree = vkt.make.amr(blocks=9, levels=3)
for function in vkt.split, vkt.brick:
    try:
        function(tree)
        raise SystemExit("taken")
    except vkt.Error as e:
        assert "hierarchical" in str(e)
EOF2
}

@test "every command of the program is a function, a method, or run by vkt.command()" {
    vkt help --list >verbs
    python <<'END'
import vkt.filter, vkt.make
def known(verb):
    words = [word.replace("-", "_") for word in verb.split()]
    place = getattr(vkt, words[0], None)
    return hasattr(place, words[1]) or hasattr(vkt, "_".join(words)) if len(words) == 2 else place is not None
others = {verb for verb in open("verbs").read().splitlines() if not known(verb)}
assert hasattr(volume, "write") and hasattr(vkt, "set")
# vkt.set; what is about the program itself and the machine; what makes several files or text.
assert others == {"set-header", "completion", "doctor", "help", "shm list", "shm remove", "stress", "chart", "history", "pipe"}, others
END
}

@test "what only the program does: models for a picture, pictures compared and averaged, any command" {
    vkt slim volume.nrrd --for 'render --size 64 --domain 0:500 --opacity 0,0.2 --unit-distance 1' --within 0.5 -o small.vkt
    vkt render volume.nrrd --size 32 -o a.png
    vkt render volume.nrrd --size 32 --step 2 -o b.png
    vkt image mean a.png b.png -o mean.png
    vkt image diff a.png b.png --json >diff.json || [ $? -eq 1 ]
    vkt render volume.nrrd --size 32 --tiles 1/2 -o one.png
    vkt render volume.nrrd --size 32 --tiles 2/2 -o two.png
    vkt filter median volume.nrrd -o median.nrrd
    mkdir scratch
    export TMPDIR=$PWD/scratch
    python <<'END'
import json, pathlib, subprocess
told = []
small = vkt.slim(volume, for_="render --size 64 --domain 0:500 --opacity 0,0.2 --unit-distance 1", within=0.5, told=told)
want = vkt.read("small.vkt")
about = [{key: value for key, value in vkt.info(v).items() if key not in ("history", "volume", "format")} for v in (small, want)]
assert about[0] == about[1] and len(told) == 3 and "times smaller" in told[0], (about, told)
assert vkt.diff(vkt.resample(small, like=volume), vkt.resample(want, like=volume))["differing"] == 0
def refused(code, words, call, *arguments, **options):
    try: call(*arguments, **options)
    except vkt.Error as error: assert error.exit_code == code and words in str(error), (error.exit_code, str(error))
    else: raise AssertionError(words)
refused(2, "--within -1", vkt.slim, volume, for_="filter gaussian --sigma 1", within=-1)
refused(2, "did you mean", vkt.slim, volume, for_="filter gausian --sigma 1", within=1)
# Pictures as files, bytes and arrays.
d = json.loads(pathlib.Path("diff.json").read_text())
a, b = vkt.render(volume, size=32), vkt.render(volume, size=32, step=2)
for one, two in ("a.png", "b.png"), (pathlib.Path("a.png"), pathlib.Path("b.png").read_bytes()), (a, b), (a[..., :], "b.png"):
    got = vkt.image_diff(one, two)
    assert got.pop("equal") is False and got == d, (got, d)
assert vkt.image_diff(a, a)["equal"] and vkt.image_diff("a.png", "b.png", tolerance=1)["equal"]
refused(4, "cannot open", vkt.image_diff, "a.png", "none.png")
assert vkt.image_diff(vkt.image_mean("a.png", "b.png"), "mean.png")["max_abs"] == 0
assert vkt.image_mean(a, b, output="again.png") is None and vkt.image_diff("again.png", "mean.png")["max_abs"] == 0
refused(4, "exists", vkt.image_mean, a, b, output="again.png")
assert vkt.image_diff(vkt.image_join("one.png", "two.png"), "a.png")["max_abs"] == 0
for bad in a.astype("f4"), a[0], 3:
    try: vkt.image_diff(bad, a)
    except TypeError: pass
    else: raise AssertionError(bad)
# Any command.
assert vkt.command("history", "median.nrrd").strip() == subprocess.check_output(["vkt", "history", "median.nrrd"], text=True).strip()
assert vkt.command("stats", volume, json=True)["mean"] == vkt.stats(volume)["mean"]
assert vkt.diff(vkt.command("pipe", "flip x | crop --roi :,:,4:8", volume), vkt.crop(vkt.flip(volume, "x"), roi=":,:,4:8"))["differing"] == 0
assert vkt.diff(vkt.command("flip", "x", volume.array), vkt.flip(vkt.Volume(volume.array), "x"))["differing"] == 0
assert vkt.info(vkt.command("read", "small.vkt"))["dims"] == about[1]["dims"]
refused(2, "did you mean 'vkt flip'", vkt.command, "flop", volume)
refused(2, "there are two", vkt.command, "copy", volume, volume)
END
    # Nothing is left behind, and who has no program hears of it.
    [ -z "$(ls scratch)" ]
    mkdir alone
    cp -r "$site/vkt" alone/
    PATH=/nowhere PYTHONPATH=$PWD/alone LD_LIBRARY_PATH=$VKT_BUILD/libvkt /usr/bin/python3 -c '
import vkt
try: vkt.command("help")
except vkt.Error as error: assert "the program vkt is not there" in str(error) and error.hint, error
else: raise AssertionError'
}

@test "view opens a window, and says so where there is no display" {
    (unset DISPLAY WAYLAND_DISPLAY; python <<'END'
try: vkt.view(volume)
except vkt.Error as error: assert error.exit_code == 2 and ("no display" in str(error) or "without the viewer" in str(error)), error
else: raise AssertionError
END
    )
    starts_display vkt view volume.nrrd
    for call in 'vkt.view(volume, size="64x48")' 'assert vkt.view("volume.nrrd", size="64x48", wait=False).wait() == 0'; do
        echo "$call" | python 3>&- >log 2>&1 &
        command=$!
        finds_window
        xdotool key q
        wait "$command" || { cat log >&2; false; }
    done
}

@test "what is not taken is refused, and what is lent is given back" {
    python <<'END'
import sys, threading
# Directions of another length are spacing: the same places.
long = vkt.Volume(volume.array, direction=2 * np.eye(3), spacing=1)
assert np.array_equal(long.direction, np.eye(3)) and long.spacing == (2, 2, 2), (long.direction, long.spacing)
# An order of bytes that would be lost.
np.arange(12, dtype=">i2").tofile("big.raw")
try: vkt.read("big.raw", dims=(2, 3, 2), dtype=np.dtype(">i2"))
except vkt.Error as error: assert error.exit_code == 2 and "endian='big'" in error.hint, error
else: raise AssertionError
assert vkt.read("big.raw", dims=(2, 3, 2), dtype=np.dtype("i2"), endian="big").array.max() == 11
for wrong in dict(threads=2**32 + 1), dict(memory=-1), dict(memory=2**70):
    try: vkt.policy(**wrong)
    except vkt.Error as error: assert str(next(iter(wrong.values()))) in str(error), error
    else: raise AssertionError(wrong)
# Mistakes name their column.
try: vkt.transform(volume, "foo(v)")
except vkt.Error as error: assert "column 1" in str(error), error
else: raise AssertionError
assert np.array_equal(vkt.transform(volume, "-v + 1", dtype="int16").array, 1 - volume.array.astype("i2"))
# The interpreter's hook is the one that it was, whatever threads did.
hook, small = sys.unraisablehook, vkt.crop(volume, roi="0:12,0:12,0:12")
threads = [threading.Thread(target=lambda: [vkt.transform(small, lambda x, y, z, v: v) for _ in range(10)]) for _ in range(4)]
for thread in threads: thread.start()
for thread in threads: thread.join()
assert sys.unraisablehook is hook
END
    # The interpreter ends while a thread is in the library.
    for again in 1 2 3; do
        python <<'END'
import threading, time
large = vkt.make.noise(dims=(100, 100, 100))
threading.Thread(target=lambda: vkt.transform(large, lambda x, y, z, v: v), daemon=True).start()
time.sleep(0.3)
END
    done
}
