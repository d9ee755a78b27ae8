# vkt scale: content resized on its grid; SciPy and NumPy as oracles.
load helper

# magnify PYTHON: runs it with vkt and SciPy at hand. Arrays are [z, y, x].
magnify() {
    python_with numpy scipy
    /usr/bin/python3 - <<PY
import json, subprocess, numpy as np, scipy.ndimage as nd
random = np.random.default_rng(6)
def vkt(*words): subprocess.run(("vkt",) + tuple(map(str, words)), check=True)
def scale(v, *options):
    z, y, x = v.shape
    v.tofile(f"put_{x}x{y}x{z}_{v.dtype}.raw")
    vkt("scale", f"put_{x}x{y}x{z}_{v.dtype}.raw", *options, "-o", "out.vkt", "--force", "-q")
    vkt("write", "out.vkt", "get.raw", "--force", "-q")
    i = json.loads(subprocess.run(("vkt", "info", "--json", "out.vkt"), capture_output=True, check=True).stdout)
    return np.fromfile("get.raw", i["dtype"]).reshape(i["dims"][::-1])
shape = (13, 12, 17)
v = random.uniform(-100, 100, shape)
def positions(f, about=None):
    c = (np.array(shape[::-1]) - 1) / 2 if about is None else np.array(about)
    p = np.indices(shape)[::-1].reshape(3, -1).astype(float)
    return ((p.T - c) / np.array(f) + c).T
def inside(p): return np.all([(p[a] > -.5 + 1e-5) & (p[a] < n - .5 - 1e-5) for a, n in enumerate(shape[::-1])], 0)
$1
PY
}

@test "magnified about the middle or a point, as SciPy interpolates" {
    magnify '
for f, about in (((1.3, 2, 1.7), None), ((1.5, 1.5, 1.5), (3, 0, 7.25))):
    options = ["--factor", ",".join(map(str, f))] + ([] if about is None else ["--about", ",".join(map(str, about))])
    p = positions(f, about)
    for method, order in (("nearest", 0), ("linear", 1), ("bspline3", 3), ("bspline5", 5)):
        got = scale(v, *options, "--method", method, "--boundary", "mirror").ravel()
        clear = ~(abs(p - np.floor(p) - .5) < 1e-5).any(0) if order == 0 else slice(None)
        # Padded: where SciPy reflects itself, its order 5 is good to 1e-7 only.
        want = nd.map_coordinates(np.pad(v, 80, "symmetric"), p[::-1] + 80, order=order)
        assert abs(got - want)[clear].max() < 1e-9, method'
}

@test "what shrinks is averaged, and leaves a background" {
    magnify '
p = positions((.5, .5, .5))
got = scale(v, "--factor", 0.5, "--background", 7).ravel()
assert (got[~inside(p)] == 7).all()
even = random.uniform(0, 1, (12, 16, 8))
got = scale(even, "--factor", 0.5, "--expand")
assert got.shape == (6, 8, 4) and abs(got - even.reshape(6, 2, 8, 2, 4, 2).mean((1, 3, 5))).max() < 1e-12
board = (np.indices((24, 24, 24)).sum(0) % 2).astype(np.float32)  # plain interpolation keeps a checkerboard as an alias
for method in ("auto", "cubic", "bspline3", "lanczos3"):
    assert abs(scale(board, "--factor", 0.45, "--expand", "--method", method)[2:-2, 2:-2, 2:-2] - .5).max() < .12, method'
}

@test "by 1 nothing moves; by whole numbers about a voxel every such voxel is one of the input" {
    magnify '
bits = np.frombuffer(random.bytes(v.size * 8), np.float64).reshape(shape)
for method in ("auto", "nearest", "cubic", "bspline5", "lanczos3"):
    assert scale(bits, "--factor", 1, "--method", method).tobytes() == bits.tobytes()
    assert scale(bits, "--factor", 1, "--expand", "--method", method).tobytes() == bits.tobytes()
got = scale(bits, "--factor", 3, "--about", "4,5,6", "--method", "nearest")
assert got[::3, 2::3, 1::3].tobytes() == bits[4:9, 4:8, 3:9].tobytes()
assert (scale(np.full(shape, 0.1, np.float32), "--factor", "0.3,2,1.1", "--boundary", "clamp") == np.float32(0.1)).all()'
}

@test "a region in place, expanded geometry, and requests that make no sense" {
    vkt make noise --dims 12 14 16 --seed 2 --spacing 1,2,3 -o in.vkt
    vkt crop in.vkt --roi 2:9,3:10,4:14 | vkt scale --factor 1.5 -o part.vkt
    vkt scale in.vkt --roi 2:9,3:10,4:14 --factor 1.5 -o all.vkt
    vkt crop all.vkt --roi 2:9,3:10,4:14 | vkt diff - part.vkt --geometry
    vkt crop all.vkt --roi :,:,0:4 | vkt diff - <(vkt crop in.vkt --roi :,:,0:4)
    vkt scale in.vkt --factor 2 --expand | vkt info --json | tr -d ' \n' | grep -q '"dims":.24,28,32.*"spacing":.1.0,2.0,3.0'
    vkt scale in.vkt --factor 1.7 --slab 1 --threads 2 | vkt diff - <(vkt scale in.vkt --factor 1.7 --slab 99 --threads 1)
    fails_with 2 'factor' vkt scale in.vkt -o x.vkt
    fails_with 2 'between 1e-12' vkt scale in.vkt --factor 0 -o x.vkt
    fails_with 2 'vkt flip mirrors' vkt scale in.vkt --factor=-1 -o x.vkt
    fails_with 2 'voxels along an axis' vkt scale in.vkt --factor 1e12 --expand -o x.vkt
    fails_with 2 'between 1e-12' vkt scale in.vkt --factor 1e300 --expand -o x.vkt
    # Shrunk beyond all sense: at once, or not at all, and the nearest voxel at any scale.
    for factor in 3e-8 1e-12; do
        fails_with 5 'times as wide' vkt scale in.vkt --factor $factor -o x.vkt
        fails_with 5 'times as wide' vkt scale in.vkt --factor $factor --expand --method lanczos3 -o x.vkt
        vkt scale in.vkt --factor $factor --method nearest --expand | vkt info --json | tr -d ' \n' | grep -q '"dims":.1,1,1'
    done
    vkt scale in.vkt --factor 2e-5 --memory 16MiB --background 3 -q | vkt stats --json | grep -q '"max": 3'
    [ ! -e x.vkt ]
}
