# vkt filter nlmeans against the definition in NumPy, for every type, and however it is run.
load helper
load filters

setup_more() { make_volumes; }

# against_numpy CODE: Python with nlmeans(values, …), what must come out, and run(name, options).
against_numpy() {
    python_with numpy
    /usr/bin/python3 - <<PY
import itertools, json, subprocess
import numpy as np

TYPES = "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split()

def load(name):
    x, y, z = (int(n) for n in name.split("_")[1].split("x"))
    return np.fromfile(name, name.split("_")[2].split(".")[0]).reshape(z, y, x)

def nlmeans(v, patch, search, strength, noise=0, pad="symmetric", **more):
    """patch and search along x, y, z; in float64, from the definition."""
    p, s = [np.broadcast_to(r, 3)[::-1] for r in (patch, search)]
    f = v.astype(np.float64)
    around = np.pad(f, [(a + b, a + b) for a, b in zip(p, s)], pad, **more)
    shape = [n + 2 * a for n, a in zip(f.shape, p)]
    part = lambda d: around[tuple(slice(b + k, b + k + n) for b, k, n in zip(s, d, shape))]
    inner = tuple(slice(a, a + n) for a, n in zip(p, f.shape))
    here, total, change, most = part((0, 0, 0)), np.zeros(f.shape), np.zeros(f.shape), np.zeros(f.shape)
    for d in itertools.product(*(range(-k, k + 1) for k in s)):
        if d == (0, 0, 0):
            continue
        with np.errstate(invalid="ignore", over="ignore"):
            square = (here - part(d)) ** 2
            distance = np.lib.stride_tricks.sliding_window_view(square, [2 * a + 1 for a in p]).mean((3, 4, 5))
            w = np.exp(-np.maximum(distance - 2 * noise ** 2, 0) / strength ** 2)
            w = np.where(np.isfinite(distance), w, 0)
            change += w * np.where(w > 0, part(d)[inner] - f, 0)
        total += w
        most = np.maximum(most, w)
    return f + np.where(total > 0, change / np.where(total > 0, total + most, 1), 0)

def run(name, options):
    subprocess.run(f"vkt filter nlmeans {name} {options} --format raw -o out.raw --force --report r.json", shell=True, check=True)
    return np.fromfile("out.raw", load(name).dtype).reshape(load(name).shape)

def check(got, want, dtype, extent):
    eps = {"float16": 1e-3, "float32": 4e-6, "float64": 1e-13}
    if np.dtype(dtype).kind == "f":
        same = (got == want.astype(got.dtype)) | (np.isnan(got) & np.isnan(want)) | (np.abs(got.astype(float) - want) <= eps[dtype] * extent)
    else:
        near = 3e-4 if np.dtype(dtype).itemsize == 1 else 1e-5 * extent if np.dtype(dtype).itemsize == 2 else 1e-13 * extent
        same = np.abs(got.astype(float) - want) <= 0.5 + near + np.abs(want) * 2.0 ** -52
    assert same.all(), (dtype, np.abs(got.astype(float) - want)[~same].max())
$1
PY
}

@test "all types are the definition's, in float64" {
    against_numpy '
for dtype in TYPES:
    name = f"v_13x11x7_{dtype}.raw"
    v = load(name)
    extent = float(v.astype(float).max() - v.astype(float).min())
    for patch, search, part, noise in (([1, 1, 1], [2, 2, 2], 0.2, 0), ([0, 2, 1], [3, 0, 1], 0.1, 0.1)):
        want = nlmeans(v, patch, search, part * extent, noise * extent)
        words = f"--patch {patch[0]},{patch[1]},{patch[2]} --search {search[0]},{search[1]},{search[2]}"
        got = run(name, f"{words} --strength {part * extent!r} --noise {noise * extent!r}")
        check(got, want, dtype, extent)
'
}

@test "boundaries are NumPy'\''s; strengths and noise are physical" {
    against_numpy '
name = "v_13x11x7_int16.raw"
v = load(name)
for rule, pad in (("clamp", {"pad": "edge"}), ("wrap", {"pad": "wrap"}), ("border:700", {"pad": "constant", "constant_values": 700})):
    check(run(name, f"--search 2 --strength 9000 --boundary {rule}"), nlmeans(v, 1, 2, 9000, **pad), "int16", 65536)
subprocess.run(f"vkt set {name} --slope -0.5 --intercept 100 | vkt filter nlmeans --search 2 --strength 4500 --noise 2000"
               " | vkt write - --format raw > out.raw", shell=True, check=True)
check(np.fromfile("out.raw", np.int16).reshape(v.shape), nlmeans(v, 1, 2, 9000, 4000), "int16", 65536)
'
}

@test "patches with NaN or infinities have no weight" {
    against_numpy '
for dtype in TYPES[8:]:
    name = f"n_13x11x7_{dtype}.raw"
    got = run(name, "--patch 1,0,0 --search 2,2,1 --strength 1")
    check(got, nlmeans(load(name), [1, 0, 0], [2, 2, 1], 1), dtype, 6)
    assert (np.isfinite(got) == np.isfinite(load(name))).all()
'
}

@test "noise is found to 8 percent, beside edges too, and taken away" {
    against_numpy '
rng = np.random.default_rng(8)
z, y, x = np.indices((24, 40, 42))
clean = np.where((x - 20) ** 2 + (y - 19) ** 2 + (z - 12) ** 2 < 100, 180.0, 60.0)
for dtype, sigma in (("float32", 6.0), ("uint8", 6.0), ("int16", 12.0), ("float64", 0.003)):
    noisy = clean + rng.normal(size=clean.shape) * sigma
    noisy = (np.rint(noisy) if dtype in ("uint8", "int16") else noisy).astype(dtype)
    noisy.tofile(f"b_42x40x24_{dtype}.raw")
    got = run(f"b_42x40x24_{dtype}.raw", "--noise auto --search 3")
    found = json.load(open("r.json"))
    assert abs(found["noise"] / sigma - 1) < 0.08, (dtype, found)
    assert abs(found["strength"] / (0.8 * found["noise"]) - 1) < 1e-12
    before, after = np.sqrt(((noisy - clean) ** 2).mean()), np.sqrt(((got - clean) ** 2).mean())
    assert after < 0.45 * before, (dtype, before, after)
v = np.where(x < 20, 3, 4).astype(np.float32)  # no noise: nothing to do
v.tofile("q_42x40x24_float32.raw")
assert (run("q_42x40x24_float32.raw", "--noise auto") == v).all()
'
    vkt filter nlmeans q_42x40x24_float32.raw --noise auto -o o.vkt 2>err
    grep -q 'no noise was found' err
}

@test "slabs, threads, memory, pipes and regions make no difference" {
    for type in uint8 float32 float64; do
        same_however_run dtype=$type vkt filter nlmeans --search 2,1,2 --strength 0.2
    done
    same_however_run dtype=int16 vkt filter nlmeans --search 1 --patch 0,1,2 --strength 4000 --boundary wrap
    same_however_run dtype=int16 vkt filter nlmeans --search 1,2,0 --noise auto --boundary border:3
}

@test "a constant stays, thin volumes work, a search of nothing copies, and trees are filtered level by level" {
    for dims in '1 1 1' '31 1 2' '1 9 1' '1030 2 1'; do
        # shellcheck disable=SC2086
        vkt make constant --dims $dims --dtype float32 --value 0.1 -o c.vkt --force
        vkt filter nlmeans c.vkt --search 2 --strength 1 | vkt diff c.vkt
    done
    vkt filter nlmeans v_13x11x7_float32.raw --search 0 --strength 1 | vkt diff v_13x11x7_float32.raw
    vkt make marschner-lobb --dims 16 16 16 | vkt refine --tolerance 0 --levels 1 -o t.vkt
    vkt filter nlmeans t.vkt --search 2 --strength 0.2 | vkt resample --method nearest | vkt write - --format raw >a.raw
    vkt resample t.vkt --method nearest | vkt filter nlmeans --search 2 --strength 0.2 | vkt write - --format raw >b.raw
    cmp a.raw b.raw
}

@test "what makes no sense is refused with a line that says what does" {
    fails_with 2 'how strongly' vkt filter nlmeans v_13x11x7_uint8.raw -o o.vkt
    fails_with 2 'not a finite number above 0' vkt filter nlmeans v_13x11x7_uint8.raw --strength 0 -o o.vkt
    fails_with 2 'not a finite number >= 0' vkt filter nlmeans v_13x11x7_uint8.raw --noise -1 -o o.vkt
    fails_with 2 'needs --strength' vkt filter nlmeans v_13x11x7_uint8.raw --noise 0 -o o.vkt
    fails_with 2 '--patch 9 is not in 0 to 8' vkt filter nlmeans v_13x11x7_uint8.raw --strength 1 --patch 9 -o o.vkt
    fails_with 2 '--search 17 is not in 0 to 16' vkt filter nlmeans v_13x11x7_uint8.raw --strength 1 --search 17 -o o.vkt
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'levels would differ' vkt filter nlmeans t.vkt --noise auto -o o.vkt
    [ ! -e o.vkt ]
    vkt filter nlmeans v_13x11x7_uint8.raw --strength 9 -n 2>plan >/dev/null -o x.vkt
    grep -q '11x11x11 patches of 3x3x3' plan
}

@test "small and large values are those of others times a power of two, to the bit" {
    vkt make noise --dims 20 11 7 --dtype float32 --low 0 --high 255 --seed 3 -o v.vkt
    vkt filter nlmeans v.vkt --noise 20 >want.vkt
    vkt filter nlmeans v.vkt --noise auto >want_auto.vkt
    for k in -80 -66 60; do
        factor=$(/usr/bin/python3 -c "print(repr(2.0 ** $k))") back=$(/usr/bin/python3 -c "print(repr(2.0 ** -$k))")
        noise=$(/usr/bin/python3 -c "print(repr(20 * 2.0 ** $k))")
        vkt arith mul v.vkt "$factor" >scaled.vkt
        vkt filter nlmeans scaled.vkt --noise "$noise" | vkt arith mul - "$back" | vkt diff want.vkt -
        vkt filter nlmeans scaled.vkt --noise auto | vkt arith mul - "$back" | vkt diff want_auto.vkt -
    done
}
