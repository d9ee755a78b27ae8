# --tolerance of rotate, scale, affine and resample: the cheapest interpolant whose estimated error keeps to it.
load helper

# field PYTHON: runs it with a smooth field, what it is anywhere, and vkt at hand.
field() {
    python_with numpy
    /usr/bin/python3 - <<PY
import json, re, subprocess, numpy as np
def vkt(*words, code=0):
    done = subprocess.run(("vkt",) + tuple(map(str, words)), capture_output=True, text=True)
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done
def at(x, y, z): return 100 * np.sin(x / 4 + .3) + 40 * np.cos(y / 5 + z / 6)
shape = (30, 44, 48)
z, y, x = np.indices(shape).astype(float)
at(x, y, z).astype(np.float32).tofile("smooth_48x44x30_float32.raw")
vkt("set", "smooth_48x44x30_float32.raw", "-o", "smooth.vkt")
def get(name):
    header = json.loads(vkt("info", "--json", name).stdout)
    vkt("write", name, "got.raw", "--force")
    return np.fromfile("got.raw", header["dtype"]).reshape(header["dims"][::-1]), header
def chosen(said):
    return re.search(r"(nearest|linear|cubic|lanczos3): estimated error ([-+.e0-9]+)", said).groups()
$1
PY
}

@test "rotate: methods from the cheapest on, and a true error within the tolerance" {
    field '
angle = np.radians(20); c, s = np.cos(angle), np.sin(angle)
px, py = x - 23.5, y - 21.5
sx, sy = c * px + s * py + 23.5, -s * px + c * py + 21.5
inside = (sx > 4) & (sx < 43) & (sy > 4) & (sy < 39)
seen = []
for tolerance in (60, 5, 1, .3):
    done = vkt("rotate", "--axis", "z", "--angle", 20, "--tolerance", tolerance, "smooth.vkt", "-o", "out.vkt", "--force")
    method, estimate = chosen(done.stderr)
    got, header = get("out.vkt")
    error = abs(got - at(sx, sy, z))[inside].max()
    print(tolerance, method, estimate, error)
    assert error <= tolerance, (tolerance, error)
    assert float(estimate) <= tolerance
    assert header["error"]["kind"] == "estimate", header["error"]
    vkt("rotate", "--axis", "z", "--angle", 20, "--method", method, "smooth.vkt", "-o", "same.vkt", "--force")
    assert (got == get("same.vkt")[0]).all()
    seen.append(method)
assert seen[0] == "nearest" and seen[1] == "linear" and "cubic" in seen, seen
'
}

@test "resample: axes that grow are interpolated, those that shrink averaged; the type stays" {
    field '
for scale, tolerance in ((2, 4), (2, .5), ("2,1,0.5", 4), ("1.5,1,1", .4)):
    done = vkt("resample", "--scale", scale, "--tolerance", tolerance, "smooth.vkt", "-o", "out.vkt", "--force")
    method, estimate = chosen(done.stderr)
    got, header = get("out.vkt")
    factor = [float(v) for v in str(scale).split(",")] if isinstance(scale, str) else [scale] * 3
    if min(factor) < 1: continue
    p = [(np.arange(n) + .5) / f - .5 for n, f in zip(header["dims"], factor)]
    Z, Y, X = np.meshgrid(p[2], p[1], p[0], indexing="ij")
    inner = (X > 4) & (X < 43) & (Y > 4) & (Y < 39) & (Z > 4) & (Z < 25)
    error = abs(got - at(X, Y, Z))[inner].max()
    print(scale, tolerance, method, estimate, error)
    assert error <= tolerance
v = np.rint(at(x, y, z) + 140).clip(0, 255).astype(np.uint8)
v.tofile("bytes_48x44x30_uint8.raw")
vkt("set", "bytes_48x44x30_uint8.raw", "-o", "bytes.vkt", "--force")
vkt("resample", "--scale", 2, "--tolerance", 1.5, "bytes.vkt", "-o", "out.vkt", "--force")
assert get("out.vkt")[1]["dtype"] == "uint8"
'
}

@test "slabs, threads, transports and pipes choose the same" {
    vkt make marschner-lobb --dims 40 37 29 -o in.vkt
    for command in 'rotate --axis 1,2,3 --angle 25' 'resample --scale 1.3' 'scale --factor 1.1' 'rotate --axis z --angle 7 --roi 3:35,4:30,5:20'; do
        # shellcheck disable=SC2086  # a list of words
        vkt $command --tolerance 0.1 in.vkt -o whole.vkt --force
        # shellcheck disable=SC2086
        vkt $command --tolerance 0.1 --slab 1 --threads 1 in.vkt -o slabs.vkt --force
        # shellcheck disable=SC2086
        vkt read in.vkt | vkt $command --tolerance 0.1 --memory 1MiB | vkt write - piped.vkt --force
        vkt diff whole.vkt slabs.vkt
        vkt diff whole.vkt piped.vkt
    done
}

@test "what no method reaches is said, and --strict refuses it" {
    vkt make noise --dims 24 20 18 --dtype float32 -o noise.vkt
    run -0 --separate-stderr vkt rotate --axis z --angle 10 --tolerance 1e-6 noise.vkt -o out.vkt
    # shellcheck disable=SC2154  # set by run
    [[ $stderr == *"not as good as asked for: "*": estimated error"*"beyond --tolerance 1e-06"* ]]
    run -0 --separate-stderr vkt rotate --axis z --angle 10 --tolerance 0.0001% noise.vkt -o out.vkt --force
    [[ $stderr == *"not as good as asked for: "*"beyond --tolerance 1e-04%, 1e-06 in values"* ]]
    run -3 vkt rotate --axis z --angle 10 --tolerance 1e-6 --strict noise.vkt -o strict.vkt
    [ ! -e strict.vkt ]
}

@test "voxels that fall on voxels are moved; constants and single voxels are nearest" {
    vkt make noise --dims 12 12 5 --dtype int16 -o in.vkt
    vkt rotate --axis z --angle 90 --tolerance 0.5 in.vkt -o turned.vkt
    vkt rotate --axis z --angle 90 in.vkt | vkt diff turned.vkt -
    vkt make ramp --dims 1 1 1 -o one.vkt
    vkt resample --dims 3 3 3 --tolerance 0.5 one.vkt | vkt stats
    vkt make noise --dims 9 8 7 --dtype uint8 | vkt arith mul - 0 -o flat.vkt
    run -0 --separate-stderr vkt rotate --axis 1,1,1 --angle 10 --tolerance 0.001 flat.vkt -o out.vkt
    [[ $stderr == *"nearest: estimated error 0"* ]]
}

@test "with % it is a share of the value range: of the same voxels elsewhere and larger the same method" {
    vkt make marschner-lobb --dims 40 37 29 --dtype float32 -o in.vkt
    vkt arith mul in.vkt 1024 | vkt arith add - 65536 --dtype float64 -o large.vkt
    range=$(vkt stats in.vkt --json | /usr/bin/python3 -c 'import json, sys; s = json.load(sys.stdin); print(repr(s["max"] - s["min"]))')
    methods=''
    for percent in 60 10 3 1; do
        vkt rotate --axis z --angle 10 --tolerance $percent% in.vkt -o share.vkt --force 2>share
        method=$(grep -o '[a-z0-9]*: estimated' share)
        vkt rotate --axis z --angle 10 --tolerance "$(/usr/bin/python3 -c "print($percent / 100 * $range)")" in.vkt -o value.vkt --force 2>value
        vkt diff share.vkt value.vkt
        for command in 'rotate --axis z --angle 10' 'scale --factor 1.1' 'resample --scale 1.3'; do
            # shellcheck disable=SC2086
            vkt $command --tolerance $percent% large.vkt -o out.vkt --force 2>large
            grep -q "within $percent%, \|beyond --tolerance $percent%, " large
        done
        vkt rotate --axis z --angle 10 --tolerance $percent% large.vkt -o out.vkt --force 2>large
        grep -q "$method" large
        methods+=" $method"
    done
    [[ $methods == *nearest*linear* ]]
    run -0 --separate-stderr vkt rotate --axis z --angle 10 --tolerance 1% --explain -n in.vkt -o out.vkt --force
    [[ $stderr == *"lanczos3 within 1% of the value range"*"error about 0.01"*" of the value range"* && $stderr != *"estimated error"* ]]
}

@test "a tolerance stands alone, is a finite number above 0, and is for grids" {
    vkt make ramp --dims 8 8 8 -o in.vkt
    run ! vkt rotate --axis z --angle 10 --tolerance 1 --method cubic in.vkt -o out.vkt
    [[ $output == *"--tolerance chooses the method"* ]]
    for bad in 0 -1 inf; do
        run ! vkt resample --scale 2 --tolerance $bad in.vkt -o out.vkt
        [[ $output == *"finite number above 0"* ]]
    done
    fails_with 2 'not below 100%' vkt rotate --axis z --angle 10 --tolerance 100% in.vkt -o out.vkt
    vkt make amr --blocks 8 --levels 2 -o tree.vkt
    run ! vkt resample --cells 1k --tolerance 1 tree.vkt -o out.vkt
    [[ $output == *"hierarchical"* ]]
    vkt chart 'rotate --axis z --angle 10 --tolerance 1' in.vkt -o chart.csv
    grep -q 'tolerance' chart.csv
    run -0 vkt rotate --axis z --angle 10 --tolerance 1 --explain -n in.vkt
    [[ $output == *"cheapest of nearest, linear, cubic and lanczos3 within 1"* ]]
}
