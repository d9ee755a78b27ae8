# vkt filter gaussian against SciPy, and against itself however it is run.
load helper

setup_more() {
    python_with numpy scipy
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(5)
r.random((20, 31, 45), np.float32).tofile('f_45x31x20_float32.raw')
r.integers(0, 256, (20, 31, 45), np.uint8).tofile('b_45x31x20_uint8.raw')
r.integers(0, 65536, (20, 31, 45), np.uint16).tofile('w_45x31x20_uint16.raw')
r.random((2, 5, 40), np.float32).tofile('thin_40x5x2_float32.raw')"
}

# refused TEXT COMMAND…: exit 2 and TEXT on stderr. Option errors also reach the next stage through stdout.
refused() {
    local text="$1"
    shift
    run --separate-stderr "$@"
    [ "$status" -eq 2 ] || { echo "status $status: $stderr" >&2; return 1; }
    [[ "$stderr" == *"$text"* ]] || { echo "stderr lacks '$text': $stderr" >&2; return 1; }
}

# against_scipy IN OUT DTYPE SHAPE SIGMA-XYZ MODE BOUND: mean and largest difference from SciPy in float64.
against_scipy() {
    /usr/bin/python3 -c "
import numpy as np, sys
from scipy.ndimage import gaussian_filter
shape = tuple(int(n) for n in '$4'.split('x'))[::-1]
sigma = tuple(float(s) for s in '$5'.split(','))[::-1]
a = np.fromfile('$1', np.$3).reshape(shape)
want = gaussian_filter(a.astype(np.float64), sigma, mode='$6', truncate=9)
got = np.fromfile('$2', np.$3).reshape(shape)
error = np.abs(got - want).max()
assert error <= $7, f'error {error} > $7'"
}

@test "float32, uint8 and uint16 agree with SciPy to the stated bound" {
    for sigma in 2 0.8 1,2,3; do
        xyz=$sigma
        [[ $sigma == *,* ]] || xyz=$sigma,$sigma,$sigma
        vkt filter gaussian f_45x31x20_float32.raw --sigma $sigma --format raw -o f.raw --force
        against_scipy f_45x31x20_float32.raw f.raw float32 45x31x20 $xyz reflect 1e-4
        vkt filter gaussian b_45x31x20_uint8.raw --sigma $sigma --format raw -o b.raw --force
        against_scipy b_45x31x20_uint8.raw b.raw uint8 45x31x20 $xyz reflect 0.75
        vkt filter gaussian w_45x31x20_uint16.raw --sigma $sigma --format raw -o w.raw --force
        against_scipy w_45x31x20_uint16.raw w.raw uint16 45x31x20 $xyz reflect 0.75
    done
}

@test "the boundaries are SciPy's" {
    for pair in mirror:reflect clamp:nearest wrap:wrap border:0:constant; do
        vkt filter gaussian f_45x31x20_float32.raw --sigma 3,2,4 --boundary "${pair%:*}" --tolerance 1e-4% --format raw -o f.raw --force
        against_scipy f_45x31x20_float32.raw f.raw float32 45x31x20 3,2,4 "${pair##*:}" 2e-6
    done
}

@test "volumes thinner than the radius" {
    for sigma in 3 10; do
        vkt filter gaussian thin_40x5x2_float32.raw --sigma $sigma --format raw -o t.raw --force
        against_scipy thin_40x5x2_float32.raw t.raw float32 40x5x2 $sigma,$sigma,$sigma reflect 1e-4
    done
}

@test "slab heights, threads and pipes make no difference" {
    vkt filter gaussian f_45x31x20_float32.raw --sigma 2 --slab 20 --threads 1 --format raw -o a.raw
    for slab in 1 2 7; do
        for threads in 1 2; do
            vkt read f_45x31x20_float32.raw --slab 3 | vkt filter gaussian --sigma 2 --slab $slab --threads $threads | vkt write - --format raw >b.raw
            cmp a.raw b.raw
        done
    done
}

@test "cropping before and after are the same far from the edge" {
    vkt filter gaussian f_45x31x20_float32.raw --sigma 1 | vkt crop --roi 15:30,12:20,8:12 | vkt write - --format raw >a.raw
    vkt crop f_45x31x20_float32.raw --roi 5:40,4:28,:  | vkt filter gaussian --sigma 1 | vkt crop --roi 10:25,8:16,8:12 | vkt write - --format raw >b.raw
    cmp a.raw b.raw
}

@test "flips commute with it, bit for bit" {
    for axis in x y z; do
        vkt flip $axis f_45x31x20_float32.raw | vkt filter gaussian --sigma 2 | vkt write - --format raw >a.raw
        vkt filter gaussian f_45x31x20_float32.raw --sigma 2 | vkt flip $axis | vkt write - --format raw >b.raw
        cmp a.raw b.raw
    done
}

@test "a sigma in world units follows the voxel size" {
    vkt set f_45x31x20_float32.raw --spacing 0.5,1,2 | vkt filter gaussian --sigma 2 --unit world | vkt write - --format raw >a.raw
    vkt filter gaussian f_45x31x20_float32.raw --sigma 4,2,1 | vkt write - --format raw >b.raw
    cmp a.raw b.raw
}

@test "a constant border is a physical value" {
    vkt set f_45x31x20_float32.raw --slope 2 --intercept 1 | vkt filter gaussian --sigma 2 --boundary border:5 | vkt write - --format raw >a.raw
    vkt filter gaussian f_45x31x20_float32.raw --sigma 2 --boundary border:2 | vkt write - --format raw >b.raw
    cmp a.raw b.raw
}

# bound_holds IN OUT SIGMA-XYZ MODE CVAL: no voxel is off by more than `plan` says, nor by more than half of whole numbers.
bound_holds() {
    /usr/bin/python3 - "$@" <<'PY'
import re, sys
import numpy as np
from scipy.ndimage import correlate1d
name, out, sigma, mode, cval = sys.argv[1:]
shape, dtype = name.split('.')[0].split('_')[1:]
shape = tuple(int(n) for n in shape.split('x'))[::-1]
text = open('plan').read()
error = re.search(r'error at most (?:(\S+) of the value range)?(?: \+ )?(?:(\S+) of the largest magnitude)?', text)
share, rounding = (float(e or 0) for e in error.groups())
v = np.fromfile(name, dtype).reshape(shape)
# Sums are of distances from one value, as small as the range: float64 rounds them to far less than the bound.
base = v.flat[0]
got = np.fromfile(out, dtype).reshape(shape)
want, got = ((v.astype(np.longdouble) - np.longdouble(base)).astype(float), (got.astype(np.longdouble) - np.longdouble(base)).astype(float))
cval = float(np.longdouble(cval) - np.longdouble(base))
for axis, s in enumerate(float(s) for s in sigma.split(',')[::-1]):
    k = np.arange(-int(9 * s + 9), int(9 * s + 9) + 1)
    with np.errstate(under='ignore'):
        w = np.exp(-.5 * (k / s) ** 2)
    w[k == 0] = 0  # the middle one is what the others leave: no share of a large value is lost
    w /= 1 + w.sum()
    w[k == 0] = 1 - w.sum()
    want = correlate1d(want, w, axis, mode=mode, cval=cval)
values = np.append(v.astype(float).ravel(), float(base) + cval if mode == 'constant' else [])
integer = np.issubdtype(np.dtype(dtype), np.integer)
if integer:
    info = np.iinfo(dtype)
    want = np.clip(want, float(info.min) - float(base), float(info.max) - float(base))
allowed = share * (values.max() - values.min()) + rounding * abs(values).max() + (.5 if integer else 0)
worst = np.abs(got - want).max()
assert worst <= allowed, f'{name} sigma {sigma} {mode}: off by {worst}, {allowed} promised'
PY
}

@test "the stated bound holds for narrow kernels, offsets, large borders and wide integers" {
    vkt make checkerboard --dims 9 9 9 --dtype uint32 | vkt write - --format raw >k_9x9x9_uint32.raw
    vkt make checkerboard --dims 9 9 9 --dtype float64 | vkt write - --format raw >k_9x9x9_float64.raw
    /usr/bin/python3 -c "
import numpy as np
u = np.random.default_rng(6).random((12, 13, 14))
(1e6 + u).astype('f4').tofile('o_14x13x12_float32.raw')
(1e9 + u).tofile('o_14x13x12_float64.raw')
u.astype('f4').tofile('u_14x13x12_float32.raw')
(1000 + u).astype('f2').tofile('o_14x13x12_float16.raw')
(1700000000000000000 + (u * 1000).astype('i8')).tofile('o_14x13x12_int64.raw')"
    for sigma in 0.13 0.14 0.15 0.2 0.3; do
        vkt filter gaussian k_9x9x9_uint32.raw --sigma $sigma --explain --format raw -o out.raw --force 2>plan
        bound_holds k_9x9x9_uint32.raw out.raw $sigma,$sigma,$sigma reflect 0
        vkt filter gaussian k_9x9x9_float64.raw --sigma $sigma --tolerance 1e-10% --explain --format raw -o out.raw --force 2>plan
        bound_holds k_9x9x9_float64.raw out.raw $sigma,$sigma,$sigma reflect 0
    done
    for file in o_14x13x12_float32 o_14x13x12_float64 o_14x13x12_float16 o_14x13x12_int64; do
        for sigma in 0.7 2; do
            vkt filter gaussian $file.raw --sigma $sigma --explain --format raw -o out.raw --force 2>plan
            bound_holds $file.raw out.raw $sigma,$sigma,$sigma reflect 0
        done
    done
    vkt filter gaussian u_14x13x12_float32.raw --sigma 2 --boundary border:1e6 --explain --format raw -o out.raw --force 2>plan
    bound_holds u_14x13x12_float32.raw out.raw 2,2,2 constant 1e6
    vkt filter gaussian o_14x13x12_int64.raw --sigma 1 --explain --format raw -o out.raw --force 2>plan
    grep -q 'of the largest magnitude (.* in values)' plan
}

@test "a border value is not rounded to the type of the volume, nor clipped unless the result is" {
    vkt make constant --dims 8 9 10 --dtype uint8 --value 100 | vkt write - --format raw >c_8x9x10_uint8.raw
    for sigma in 2,1e-3,1e-3 1e-3,2,1e-3 1e-3,1e-3,2 1,1,1; do
        for border in -100 30.5 1000; do
            vkt filter gaussian c_8x9x10_uint8.raw --sigma $sigma --boundary border:$border --explain --format raw -o out.raw --force 2>plan
            bound_holds c_8x9x10_uint8.raw out.raw $sigma constant $border
            vkt filter gaussian c_8x9x10_uint8.raw --sigma $sigma --boundary border:$border --tolerance 1e-7% --slab 3 --threads 2 --explain --format raw -o out.raw --force 2>plan
            bound_holds c_8x9x10_uint8.raw out.raw $sigma constant $border
        done
    done
    vkt filter gaussian c_8x9x10_uint8.raw --sigma 2,0,0 --boundary border:-100 --strict --format raw -o out.raw --force
    [ "$(od -An -tu1 -N1 out.raw | tr -d ' ')" = 20 ]
    fails_with 3 'clipped to [0,255]' vkt filter gaussian c_8x9x10_uint8.raw --sigma 3 --boundary border:-100 --strict -o out.nrrd
    fails_with 2 'not a finite number' vkt filter gaussian c_8x9x10_uint8.raw --boundary border:inf -o out.nrrd
}

@test "noise of the largest floats stays finite and within its range" {
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(7)
for t in 'float32', 'float64':
    m = np.finfo(t).max
    np.where(r.random((12, 13, 14)) < .5, -m, m).astype(t).tofile(f'm_14x13x12_{t}.raw')"
    for type in float32 float64; do
        for sigma in 0.4 1 3; do
            vkt filter gaussian m_14x13x12_$type.raw --sigma $sigma --format raw -o out.raw --force
            /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import gaussian_filter
v = np.fromfile('m_14x13x12_$type.raw', '$type').reshape(12, 13, 14); m = np.finfo('$type').max
got = np.fromfile('out.raw', '$type').reshape(v.shape)
assert np.isfinite(got).all()
want = gaussian_filter(np.sign(v).astype(float), $sigma, truncate=9)
assert abs(got / m - want).max() <= 2e-4"
        done
    done
}

@test "the plan names method, bound and cost, and a smaller tolerance costs more" {
    run --separate-stderr vkt filter gaussian f_45x31x20_float32.raw --sigma 2 --explain -o a.nrrd
    [ "$status" -eq 0 ]
    [[ "$stderr" == *"direct FIR, radius 8,8,8, float32"* ]]
    [[ "$stderr" == *"51 multiply-adds"* ]]
    run --separate-stderr vkt filter gaussian f_45x31x20_float32.raw --sigma 2 --tolerance 1e-8% --explain -o b.nrrd
    [[ "$stderr" == *"float64"* ]]
}

@test "sigma 0 is the identity, for 64-bit integers too" {
    vkt make constant --dims 3 2 2 --dtype int64 | vkt fill --value 9007199254740993 -o wide.vkt
    vkt filter gaussian wide.vkt --sigma 0 | vkt diff wide.vkt
    vkt make noise --dims 9 8 7 --dtype float64 --low -1 -o f.vkt
    vkt filter gaussian f.vkt --sigma 0 --slab 2 | vkt diff f.vkt
}

@test "what makes no sense is refused" {
    for sigma in -1 nan inf 1,-2,1 abc; do
        refused '' vkt filter gaussian f_45x31x20_float32.raw --sigma="$sigma" -o out.nrrd
    done
    refused 'tolerance' vkt filter gaussian f_45x31x20_float32.raw --tolerance 0% -o out.nrrd
    refused 'border' vkt filter gaussian f_45x31x20_float32.raw --boundary clamp:3 -o out.nrrd
    refused 'mirror' vkt filter gaussian f_45x31x20_float32.raw --boundary miror -o out.nrrd
    [ ! -e out.nrrd ]
}

# Slices of 512 KiB at a budget of which a piece may have 256.
@test "every boundary rule is the same bit for bit where slices are cut, wrapped rows too" {
    vkt make noise --dims 512 256 12 --dtype float32 --seed 3 -o in.nrrd
    for rule in wrap mirror clamp border:0.3; do
        for sigma in 2 0,3,0 1,2,0 0,3,1; do
            vkt filter gaussian in.nrrd --sigma $sigma --boundary $rule --memory 1G --format raw -o whole.raw --force
            vkt filter gaussian in.nrrd --sigma $sigma --boundary $rule --memory 4M --format raw -o cut.raw --force
            cmp whole.raw cut.raw
        done
        vkt read in.nrrd | vkt filter gaussian --sigma 0,3,1 --boundary $rule --memory 4M --format raw -o cut.raw --force -q
        cmp whole.raw cut.raw
    done
    # More rows than there are.
    vkt make noise --dims 4096 40 6 --dtype uint8 --seed 4 -o low.nrrd
    vkt filter gaussian low.nrrd --sigma 0,12,1 --boundary wrap --memory 1G --format raw -o whole.raw --force
    vkt filter gaussian low.nrrd --sigma 0,12,1 --boundary wrap --memory 8M --format raw -o cut.raw --force
    cmp whole.raw cut.raw
}

# cascade_holds SHAPE RULE SIGMA TOLERANCE [OPTION…]: noise, an impulse and a checkerboard, off from SciPy by no more than
# the plan says, by either method.
cascade_holds() {
    /usr/bin/python3 - "$@" <<'PY'
import re, subprocess, sys
import numpy as np
from scipy.ndimage import gaussian_filter
shape, rule, sigma, tolerance, *options = sys.argv[1:]
modes = {'mirror': 'reflect', 'clamp': 'nearest', 'wrap': 'wrap', 'border:0.3': 'constant'}
n = tuple(int(i) for i in shape.split('x'))[::-1]
s = [float(i) for i in sigma.split(',')][::-1]
u = np.random.default_rng(8).random(n)
impulse = np.zeros(n)
impulse[tuple(i // 2 for i in n)] = 1
for name, v in {'noise': u, 'impulse': impulse, 'checkerboard': np.indices(n).sum(0) % 2 * 1.0}.items():
    v = v.astype('f4')
    v.tofile(f'in_{shape}_float32.raw')
    done = subprocess.run(['vkt', 'filter', 'gaussian', f'in_{shape}_float32.raw', '--sigma', sigma, '--boundary', rule,
                           '--tolerance', tolerance, '--explain', '--format', 'raw', '-o', 'out.raw', '--force', *options],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = re.search(r'error at most (?:(\S+) of the value range)?(?: \+ )?(?:(\S+) of the largest magnitude)?', done.stderr)
    share, magnitude = (float(e or 0) for e in said.groups()) if said else (0, 0)
    if 'cascade' in options: assert 'cascade, nodes' in done.stderr, done.stderr
    want = gaussian_filter(v.astype(float), s, mode=modes[rule], cval=0.3, truncate=9)
    got = np.fromfile('out.raw', 'f4').reshape(n)
    values = np.append(v.ravel(), 0.3 if rule[0] == 'b' else [])
    worst, allowed = abs(got - want).max(), share * np.ptp(values) + magnitude * abs(values).max()
    assert worst <= allowed, f'{name} {sys.argv}: off by {worst}, {allowed} promised'
    assert share <= float(tolerance[:-1]) / 100 * 1.001
    assert got.min() >= values.min() and got.max() <= values.max()
PY
}

@test "the cascade keeps its bound for all boundary rules, sigmas and shapes, and results stay in the range" {
    for rule in mirror clamp wrap border:0.3; do
        cascade_holds 53x41x37 $rule 4,5,6 0.1% --method cascade
        cascade_holds 53x41x37 $rule 4,4,4 0.01% --method cascade
        cascade_holds 31x67x19 $rule 9,0.8,4 0.01% --method cascade
        cascade_holds 53x41x37 $rule 0,7,0 0.001% --method cascade
    done
    for rule in mirror clamp border:0.3; do
        cascade_holds 53x41x37 $rule 32,40,24 0.01% --method cascade
        cascade_holds 23x2x61 $rule 0,0,20 0.1% --method cascade
        cascade_holds 97x1x1 $rule 16,5,5 0.0001% --method cascade
    done
    cascade_holds 127x7x5 mirror 100,0,0 0.01% --method cascade
    cascade_holds 127x7x5 wrap 100,1,1 0.01% --method cascade
}

@test "whatever sigma is, the method chosen keeps the bound" {
    for sigma in 0.3 0.7 1.3 2.6 5 11 23 64 200; do
        cascade_holds 47x31x29 mirror $sigma,$sigma,$sigma 0.05%
        cascade_holds 47x31x29 wrap $sigma,1,$sigma 1%
    done
}

@test "the cascade: a blob of a blob, the sum, the variance, and constants" {
    /usr/bin/python3 -c "
import numpy as np
z, y, x = np.indices((61, 67, 71)) - np.array([30, 33, 35])[:, None, None, None]
np.exp(-(x * x + y * y + z * z) / (2 * 3 ** 2)).astype('f8').tofile('blob_71x67x61_float64.raw')
(x * x + y + 0.0).astype('f8').tofile('square_71x67x61_float64.raw')
np.full((23, 29, 31), 0.1, 'f4').tofile('c_31x29x23_float32.raw')
np.full((23, 29, 31), 65535, 'u2').tofile('c_31x29x23_uint16.raw')"
    vkt filter gaussian blob_71x67x61_float64.raw --sigma 4 --tolerance 0.01% --method cascade --boundary border --format raw -o blob.raw
    vkt filter gaussian square_71x67x61_float64.raw --sigma 4 --tolerance 0.01% --method cascade --format raw -o square.raw
    /usr/bin/python3 -c "
import numpy as np
z, y, x = np.indices((61, 67, 71)) - np.array([30, 33, 35])[:, None, None, None]
r2 = x * x + y * y + z * z
# sqrt(3^2 + 4^2) = 5: the amplitude falls by the volume.
want = (3 / 5) ** 3 * np.exp(-r2 / 50)
got = np.fromfile('blob.raw').reshape(want.shape)
assert abs(got - want).max() <= 1e-4, abs(got - want).max()
before = np.fromfile('blob_71x67x61_float64.raw').sum()
inner = np.exp(-r2 / 18).sum()
assert abs(got.sum() / inner - 1) <= 1e-3, got.sum() / inner
q = np.fromfile('square.raw').reshape(want.shape)[28:32, 30:36, 33:38]
assert abs(q - (x * x + y + 16.0)[28:32, 30:36, 33:38]).max() <= 1e-4 * (35 * 35 + 66)"
    vkt filter gaussian c_31x29x23_float32.raw --sigma 7 --method cascade --tolerance 0.1% --format raw -o c.raw
    cmp c.raw c_31x29x23_float32.raw
    vkt filter gaussian c_31x29x23_uint16.raw --sigma 20,6,0 --method cascade --tolerance 0.1% --format raw -o c.raw --force
    cmp c.raw c_31x29x23_uint16.raw
}

@test "the cascade is the same bit for bit however it is cut: slabs, threads, pieces of slices, and regions" {
    for options in '5 --boundary mirror' '5 --boundary wrap' '5 --boundary border:7' '3,0,5 --boundary clamp'; do
        # shellcheck disable=SC2086 # several words
        set -- --sigma $options --method cascade --tolerance 0.1% --format raw --force
        vkt filter gaussian f_45x31x20_float32.raw "$@" --slab 20 --threads 1 -o a.raw
        for slab in 1 3 7; do
            for threads in 1 2 5; do
                vkt read f_45x31x20_float32.raw --slab 2 | vkt filter gaussian "$@" --slab $slab --threads $threads -o b.raw -q
                cmp a.raw b.raw
            done
        done
        vkt filter gaussian f_45x31x20_float32.raw "$@" --roi 7:31,5:24,3:17 --slab 2 -o roi.raw
        /usr/bin/python3 -c "
import numpy as np
v, a, r = (np.fromfile(f, 'f4').reshape(20, 31, 45) for f in ('f_45x31x20_float32.raw', 'a.raw', 'roi.raw'))
v[3:17, 5:24, 7:31] = a[3:17, 5:24, 7:31]
assert (v.view('u4') == r.view('u4')).all()"
    done
    vkt make noise --dims 512 256 12 --dtype float32 --seed 3 -o in.nrrd
    for rule in wrap mirror border:0.3; do
        vkt filter gaussian in.nrrd --sigma 6,7,2 --tolerance 0.1% --method cascade --boundary $rule --memory 1G --format raw -o whole.raw --force
        vkt filter gaussian in.nrrd --sigma 6,7,2 --tolerance 0.1% --method cascade --boundary $rule --memory 8M --format raw -o cut.raw --force
        cmp whole.raw cut.raw
    done
}

@test "a region of the direct method is that of the whole, and the rest stays as it is" {
    vkt filter gaussian b_45x31x20_uint8.raw --sigma 1.5 --format raw -o a.raw
    vkt filter gaussian b_45x31x20_uint8.raw --sigma 1.5 --roi 7:31,5:24,3:17 --slab 3 --format raw -o roi.raw
    /usr/bin/python3 -c "
import numpy as np
v, a, r = (np.fromfile(f, 'u1').reshape(20, 31, 45) for f in ('b_45x31x20_uint8.raw', 'a.raw', 'roi.raw'))
v[3:17, 5:24, 7:31] = a[3:17, 5:24, 7:31]
assert (v == r).all()"
    vkt make amr --blocks 8 --levels 2 -o t.vkt
    refused 'structured' vkt filter gaussian t.vkt --roi 0:4,:,: -o out.vkt
}

@test "a region at the edge of a wrapped volume is that of the whole, by either method" {
    vkt make noise --dims 24 90 12 --dtype float32 -o in.nrrd
    for options in '--sigma 2 --method fir' '--sigma 0,4,0 --tolerance 0.1% --method cascade'; do
        # shellcheck disable=SC2086 # several words
        vkt filter gaussian in.nrrd $options --boundary wrap -o whole.vkt --force
        for region in 2:20,0:3,0:5 :,86:90,9:12; do
            # shellcheck disable=SC2086
            vkt filter gaussian in.nrrd $options --boundary wrap --roi $region --slab 4 -o part.vkt --force
            vkt diff <(vkt crop whole.vkt --roi $region) <(vkt crop part.vkt --roi $region)
        done
    done
}

@test "the cascade takes all types, and agrees with the direct method within both bounds" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make noise --dims 37 29 31 --dtype float64 --low 0 --high 100 --seed 2 | vkt convert --dtype $type -o in.vkt --force
        vkt filter gaussian in.vkt --sigma 5,6,4 --tolerance 0.1% --method cascade --format raw -o cascade.raw --force
        vkt filter gaussian in.vkt --sigma 5,6,4 --tolerance 0.1% --method fir --format raw -o fir.raw --force
        /usr/bin/python3 -c "
import numpy as np
a, b = (np.fromfile(f, '$type').astype(float) for f in ('cascade.raw', 'fir.raw'))
assert a.size == 37 * 29 * 31 and abs(a - b).max() <= 2 * 0.1 + (0 if '$type'[0] == 'f' else 1), abs(a - b).max()
assert a.std() > 0 or '$type'[0] != 'f'"
    done
}

@test "a NaN spoils no more than the cascade reaches" {
    /usr/bin/python3 -c "
import numpy as np
v = np.random.default_rng(9).random((90, 40, 40), 'f4')
v[45, 20, 20] = np.nan
v.tofile('n_40x40x90_float32.raw')"
    vkt filter gaussian n_40x40x90_float32.raw --sigma 0,0,4 --method cascade --tolerance 0.1% --format raw -o n.raw
    /usr/bin/python3 -c "
import numpy as np
bad = np.isnan(np.fromfile('n.raw', 'f4').reshape(90, 40, 40))
assert bad[45, 20, 20] and bad.sum() == bad[:, 20, 20].sum() <= 2 * 6 * 4"
}

@test "the cascade is taken where it is cheaper, and can be forced or kept out" {
    vkt filter gaussian f_45x31x20_float32.raw --sigma 1.5 --explain -o a.nrrd 2>plan
    grep -q 'direct FIR, radius' plan
    vkt make noise --dims 128 128 128 --dtype uint8 -o big.nrrd
    vkt filter gaussian big.nrrd --sigma 8 -n -o x.vkt 2>plan
    grep -q 'B-spline cascade, nodes every' plan
    vkt filter gaussian big.nrrd --sigma 8 --method fir -n -o x.vkt 2>plan
    grep -q 'direct FIR, radius' plan
    # The cost does not grow with sigma.
    /usr/bin/python3 - <<'PY'
import re, subprocess
def cost(sigma):
    plan = subprocess.run(['vkt', 'make', 'noise', '--dims', '2000', '2000', '2000', '-n'], capture_output=True)
    done = subprocess.run(['vkt', 'filter', 'gaussian', '-', '--sigma', str(sigma), '-n'], input=plan.stdout, capture_output=True)
    return float(re.search(rb'([0-9.e+]+) multiply-adds', done.stderr).group(1))
costs = [cost(s) for s in (8, 16, 32, 64)]
assert max(costs) <= 1.2 * costs[0] <= 30, costs
PY
    refused 'no cascade' vkt filter gaussian f_45x31x20_float32.raw --sigma 1 --method cascade -o out.nrrd
    refused 'no cascade' vkt filter gaussian f_45x31x20_float32.raw --sigma 4 --tolerance 1e-8% --method cascade -o out.nrrd
    refused 'method' vkt filter gaussian f_45x31x20_float32.raw --method iir -o out.nrrd
}

@test "trees take the cascade as they take the direct method" {
    vkt make amr --blocks 30 --levels 3 -o t.vkt
    vkt filter gaussian t.vkt --sigma 6 --tolerance 0.1% --method cascade -o cascade.vkt
    vkt filter gaussian t.vkt --sigma 6 --tolerance 0.1% --method cascade --threads 1 -o again.vkt
    cmp cascade.vkt again.vkt
    vkt filter gaussian t.vkt --sigma 6 --tolerance 0.1% --method fir -o fir.vkt
    for method in cascade fir; do vkt resample $method.vkt --cells 100k -o $method.nrrd; done
    vkt resample t.vkt --cells 100k -o t.nrrd
    range=$(vkt stats t.nrrd --json | /usr/bin/python3 -c "import json, sys; s = json.load(sys.stdin); print(0.002 * (s['max'] - s['min']))")
    vkt diff cascade.nrrd fir.nrrd --tolerance "$range"
    run ! vkt diff t.nrrd fir.nrrd --tolerance "$range"
}
