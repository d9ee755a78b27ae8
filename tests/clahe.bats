# vkt clahe against a slow reference (clahe_reference.py), against what must hold, and against itself however it is run.
load helper

setup_more() {
    python_with numpy
    cp "$VKT_ROOT/examples/data/phantom.nrrd" phantom.nrrd
    export PYTHONPATH="$VKT_ROOT/tests"
    cat >make.py <<'END'
import numpy as np, sys
# A smooth volume with some noise, from 0 to 1: [z, y, x] of the given extents.
def volume(nx, ny, nz, seed=3):
    r = np.random.default_rng(seed)
    z, y, x = np.meshgrid(*[np.linspace(0, 1, n) if n > 1 else np.zeros(1) for n in (nz, ny, nx)], indexing="ij")
    v = np.sin(5 * x + 1) * np.cos(4 * y) + z * z + 0.2 * r.random((nz, ny, nx))
    return (v - v.min()) / (v.max() - v.min()) if v.max() > v.min() else np.full(v.shape, 0.5)
def save(v, name):
    t = {"float16": "float16"}.get(str(v.dtype), str(v.dtype))
    v.tofile(f"{name}_{v.shape[2]}x{v.shape[1]}x{v.shape[0]}_{t}.raw")
def load(path, like):
    return np.fromfile(path, like.dtype).reshape(like.shape)
END
    export PYTHONPATH="$PYTHONPATH:$PWD"
}

py() { /usr/bin/python3 -c "
import numpy as np, sys
from make import *
from clahe_reference import *
$1"; }

raw() { vkt clahe "$@" --format raw -o out.raw --force; }

@test "float32 agrees with the reference: clip rules, bricks that divide and that do not, few and many bins" {
    py 'save(volume(31, 23, 17).astype("float32"), "f")'
    for case in "opencv 2 8,8,8 256" "opencv 3.5 3,4,2 64" "skimage 0.02 5,2,7 128" "volkit 0.85 4,4,4 32" \
        "pizer 1.5 2,3,4 100" "opencv inf 1,1,1 256" "pizer 4 31,1,17 16" "opencv 2 2,2,2 3000"; do
        read -r rule clip bricks bins <<<"$case"
        raw f_31x23x17_float32.raw --clip "$clip" --clip-as "$rule" --bricks "$bricks" --bins "$bins"
        py "
v = volume(31, 23, 17).astype('float32')
want = clahe(v, bricks=($bricks), bins=$bins, clip=float('$clip'), rule='$rule')
error = np.abs(load('out.raw', v) - want).max()
assert error < 4e-6, f'$case: {error}'
assert np.abs(want - v).max() > 0.05, 'nothing to see'"
    done
}

@test "all types agree with the reference" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        py "
v = volume(20, 13, 11)
t = np.dtype('$type')
if t.kind != 'f':
    i = np.iinfo(t)
    v = np.rint(v * 200 + (-100 if t.kind == 'i' else 20)) * (1 if t.itemsize < 4 else 5003) + (i.max - 1100000 if t.itemsize == 4 else 0)
save(v.astype(t), 'v')"
        raw v_20x13x11_$type.raw --bricks 3,2,4 --bins 64
        py "
v = np.fromfile('v_20x13x11_$type.raw', '$type').reshape(11, 13, 20)
got = load('out.raw', v).astype(np.float64)
want = clahe(v, bricks=(3, 2, 4), bins=64)
bound = {'float16': 1e-3, 'float32': 4e-6, 'float64': 1e-13}.get('$type', 0.501)
error = np.abs(got - want).max()
assert error <= bound, f'$type: {error}'"
    done
}

@test "64-bit integers far from zero lose nothing" {
    py '
v = np.rint(volume(20, 13, 11) * 1000)
save(v.astype("int64"), "near")
save(v.astype("int64") + (2**62 + 12345), "far")
save(v.astype("uint64") + np.uint64(2**63 + 98765), "high")'
    vkt clahe near_20x13x11_int64.raw --bricks 3,2,4 --format raw -o near.raw
    vkt clahe far_20x13x11_int64.raw --bricks 3,2,4 --format raw -o far.raw
    vkt clahe high_20x13x11_uint64.raw --bricks 3,2,4 --format raw -o high.raw
    py '
near = np.fromfile("near.raw", "int64")
assert len(set(near)) > 500
assert (np.fromfile("far.raw", "int64") - (2**62 + 12345) == near).all()
assert ((np.fromfile("high.raw", "uint64") - np.uint64(2**63 + 98765)).astype("int64") == near).all()'
}

@test "a constant volume is left as it is" {
    for pair in uint16:0 uint16:65535 float32:0.3 float32:1 int64:9223372036854775807 float64:1e300; do
        vkt make constant --dims 9 8 7 --dtype float64 --value 0 |
            vkt convert --dtype ${pair%:*} | vkt fill --value ${pair#*:} -o c.nrrd --force
        vkt clahe c.nrrd | vkt diff - c.nrrd
    done
    vkt clahe c.nrrd -o d.nrrd 2>stderr
    grep -q "single value" stderr
    py 'save(np.full((4, 5, 6), np.nan, "float32"), "n")'
    raw n_6x5x4_float32.raw
    cmp out.raw n_6x5x4_float32.raw
}

@test "a mirrored volume gives the mirrored result, also where bricks are of odd width or cut voxels" {
    for dims in "24 16 8" "33 25 11" "11 11 11"; do
        read -r nx ny nz <<<"$dims"
        for bricks in 2,2,2 3,4,5 8,8,8; do
            py "
v = volume($nx, $ny, $nz).astype('float32')
save(v, 'a')
v[::-1, ::-1, ::-1].tofile('b_${nx}x${ny}x${nz}_float32.raw')"
            vkt clahe a_${nx}x${ny}x${nz}_float32.raw --bricks $bricks --format raw -o a.raw --force
            vkt clahe b_${nx}x${ny}x${nz}_float32.raw --bricks $bricks --format raw -o b.raw --force
            py "
a = np.fromfile('a.raw', 'float32').reshape($nz, $ny, $nx)
b = np.fromfile('b.raw', 'float32').reshape($nz, $ny, $nx)[::-1, ::-1, ::-1]
error = np.abs(a - b).max()
assert error <= 1e-6, error"
        done
    done
}

@test "without a limit and with one brick it is the equalisation by the cumulative histogram" {
    py 'save((np.random.default_rng(1).integers(0, 256, (12, 17, 19)) ** 2 // 300).astype(np.uint8), "u")'
    raw u_19x17x12_uint8.raw --clip inf --bricks 1,1,1
    py '
v = np.fromfile("u_19x17x12_uint8.raw", np.uint8)
lo, hi = int(v.min()), int(v.max())
counts, edges = np.histogram(v, 256, (lo, hi))
curve = np.concatenate([[0], np.cumsum(counts) / v.size])
want = np.rint(lo + (hi - lo) * np.interp(np.arange(256), edges, curve))
assert (np.fromfile("out.raw", np.uint8) == want[v]).all()'
}

@test "the smallest limit changes nothing" {
    py 'save(np.random.default_rng(1).integers(0, 65536, (12, 17, 19), np.uint16), "u")'
    for clip in "--clip 1 --clip-as pizer" "--clip 1e-9" "--clip 1e-12 --clip-as skimage"; do
        # shellcheck disable=SC2086
        raw u_19x17x12_uint16.raw $clip --bricks 4,4,4
        py 'd = np.fromfile("out.raw", np.uint16).astype(int) - np.fromfile("u_19x17x12_uint16.raw", np.uint16)
assert np.abs(d).max() <= 1, np.abs(d).max()'
    done
}

@test "more bricks than voxels, prime extents, single slices, rows and voxels" {
    for dims in "31 37 41" "7 5 3" "40 30 1" "1 1 50" "1 9 1" "2 1 1"; do
        read -r nx ny nz <<<"$dims"
        py "save(volume($nx, $ny, $nz).astype('float32') if $nx * $ny * $nz > 2 else np.float32([[[0, 1]]]), 'p')"
        raw p_${nx}x${ny}x${nz}_float32.raw --bricks 13,64,9 --bins 32
        py "
v = np.fromfile('p_${nx}x${ny}x${nz}_float32.raw', 'float32').reshape($nz, $ny, $nx)
error = np.abs(load('out.raw', v) - clahe(v, bricks=(13, 64, 9), bins=32)).max()
assert error < 4e-6, error"
    done
    vkt make constant --dims 1 1 1 --value 5 | vkt clahe | vkt stats | grep -q 'max *5'
}

@test "greater values stay greater with one brick, and none leaves the window" {
    py '
r = np.random.default_rng(7)
save(np.sort(np.concatenate([r.normal(0, 1, 4000), r.normal(8, 0.01, 4000), [-900, 1e4]])).astype("float32").reshape(1, 1, -1), "m")'
    for clip in 1.1 4 inf; do
        raw m_8002x1x1_float32.raw --bricks 1,1,1 --clip $clip
        py 'w = np.fromfile("out.raw", "float32")
assert (np.diff(w) >= 0).all() and w[0] == -900 and w[-1] == 10000'
    done
}

@test "of an outlier a window of percentiles takes care: it is clipped, and a line says so" {
    py '
v = np.rint(volume(30, 29, 28) * 60).astype("uint16")
v[3, 4, 5] = 60000
save(v, "o")'
    vkt convert o_30x29x28_uint16.raw --dtype float32 | vkt clahe --clip inf --range p0.1:p99.9 -o w.nrrd 2>stderr
    grep -q "clipped to \[" stderr
    vkt read w.nrrd | vkt write - --format raw >out.raw
    py 'n = len(np.unique(np.fromfile("out.raw", "float32"))); assert n > 200, n'
    fails_with 3 "clipped to" vkt clahe o_30x29x28_uint16.raw --range 5:50 --strict -o strict.nrrd
    [ ! -e strict.nrrd ]
}

@test "values outside the window count and become its ends" {
    py 'save(volume(21, 20, 19).astype("float32"), "f")'
    raw f_21x20x19_float32.raw --range 0.25:0.5 --bricks 3,3,3
    py "
v = volume(21, 20, 19).astype('float32')
got = load('out.raw', v)
assert np.abs(got - clahe(v, (0.25, 0.5), (3, 3, 3))).max() < 1e-6
assert (got[v <= 0.25] == 0.25).all() and (got[v >= 0.5] == 0.5).all()"
}

@test "scaled and shifted values give the same contrast" {
    py '
v = volume(23, 22, 21)
save(v, "a"); save(0.5 * v + 0.25, "b"); save(-3e5 * v + 7, "c")'
    for n in a b c; do vkt clahe ${n}_23x22x21_float64.raw --bricks 4,4,4 --format raw -o $n.raw; done
    py '
a, b, c = (np.fromfile(n + ".raw") for n in "abc")
assert np.abs((b - 0.25) * 2 - a).max() < 1e-12
assert np.abs((c - 7) / -3e5 - a).max() < 1e-12'
}

@test "a value map changes nothing but what the window's numbers mean" {
    vkt clahe phantom.nrrd --range 10:90 --format raw -o plain.raw 2>/dev/null
    for map in "2 5 25:185" "-0.5 100 55:95"; do
        read -r slope intercept range <<<"$map"
        vkt set phantom.nrrd --slope $slope --intercept $intercept -o mapped.nrrd --force
        vkt clahe mapped.nrrd --range $range --format raw -o mapped.raw --force 2>/dev/null
        cmp plain.raw mapped.raw
    done
}

@test "NaN stays, and neither it nor infinities disturb the others" {
    py '
v = volume(20, 19, 18).astype("float32")
v[2:9, 3:8, 4:7] = np.nan
v[10, 10, 10], v[11, 11, 11] = np.inf, -np.inf
save(v, "n")'
    raw n_20x19x18_float32.raw --bricks 2,2,2
    py '
v = np.fromfile("n_20x19x18_float32.raw", "float32").reshape(18, 19, 20)
got = load("out.raw", v)
assert (np.isnan(got) == np.isnan(v)).all()
finite = v[np.isfinite(v)]
assert got[10, 10, 10] == finite.max() and got[11, 11, 11] == finite.min()
assert np.nanmin(got) >= finite.min() and np.nanmax(got) <= finite.max()'
}

@test "a region is worked on as if it were the volume; the others keep every bit" {
    vkt crop phantom.nrrd --roi 5:40,7:51,11:30 -o part.nrrd
    vkt clahe part.nrrd --bricks 3,3,3 -o want.nrrd
    vkt clahe phantom.nrrd --bricks 3,3,3 --roi 5:40,7:51,11:30 -o got.nrrd
    vkt crop got.nrrd --roi 5:40,7:51,11:30 | vkt diff - want.nrrd
    vkt fill got.nrrd --roi 5:40,7:51,11:30 --value 0 -o a.nrrd
    vkt fill phantom.nrrd --roi 5:40,7:51,11:30 --value 0 | vkt diff - a.nrrd
}

@test "slabs, threads, memory, pipes and files give equal bytes" {
    py 'save(volume(40, 37, 33).astype("float32"), "s"); save((volume(40, 37, 33) * 255).astype("uint8"), "s")'
    for file in s_40x37x33_float32.raw s_40x37x33_uint8.raw; do
        for options in "--bricks 5,3,4" "--bricks 1,1,1 --bins 1000 --range p1:p99"; do
            # shellcheck disable=SC2086
            want=$(vkt clahe $file $options 2>/dev/null | vkt write - --format raw | sha256sum)
            for how in "--slab 1" "--slab 3" "--slab 7" "--threads 1" "--threads 2" "--threads 5" "--memory 8M"; do
                # shellcheck disable=SC2086
                got=$(vkt read $file | vkt clahe $options $how 2>/dev/null | vkt write - --format raw | sha256sum)
                [ "$got" = "$want" ] || { echo "$file $options $how" >&2; return 1; }
            done
        done
    done
}

@test "what cannot be is refused" {
    fails_with 2 "not between 2 and" vkt clahe phantom.nrrd --bins 1
    fails_with 2 "not between 2 and" vkt clahe phantom.nrrd --bins 70000
    fails_with 2 "not above 0" vkt clahe phantom.nrrd --clip 0
    fails_with 2 "not a number" vkt clahe phantom.nrrd --clip nan
    fails_with 2 "share of a brick" vkt clahe phantom.nrrd --clip 2 --clip-as skimage
    fails_with 2 "share of the tallest" vkt clahe phantom.nrrd --clip 2 --clip-as volkit
    fails_with 2 "--bricks 0" vkt clahe phantom.nrrd --bricks 8,0,8
    fails_with 2 "not one of" vkt clahe phantom.nrrd --clip-as matlab
    fails_with 5 "memory" vkt clahe phantom.nrrd --bricks 64,64,64 --bins 65536 --memory 64M
    vkt make amr --blocks 20 --levels 2 -o tree.vkt
    fails_with 2 "looks at all values first" vkt clahe tree.vkt -o t.vkt
}
