# vkt filter kernel against SciPy's correlate, dense and separable.
load helper
load filters

setup_more() {
    make_volumes
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(12)
def text(name, k):
    with open(name, 'w') as f:
        print('# weights', *k.shape[::-1], file=f)
        print(*k.shape[::-1], file=f)
        np.savetxt(f, k.reshape(-1, k.shape[2]))
text('dense.txt', r.normal(size=(5, 3, 7)))
text('long.txt', r.normal(size=(1, 1, 9)))
text('product.txt', np.einsum('i,j,k->ijk', r.normal(size=3), r.normal(size=7), r.normal(size=5)))
text('large.txt', r.normal(size=(3, 13, 15)))
g = lambda s: np.exp(-np.arange(-5, 6.0)**2 / 2 / s**2)
cube = lambda s: np.einsum('i,j,k->ijk', *[g(s) / g(s).sum()] * 3)
text('dog.txt', cube(1) - cube(2.5))
text('two.txt', sum(np.einsum('i,j,k->ijk', r.normal(size=9), r.normal(size=11), r.normal(size=7)) for _ in range(2)))
text('signs.txt', sum(np.einsum('i,j,k->ijk', *r.integers(-2, 3, size=(3, 9))) for _ in range(2)))
text('cube3.txt', r.normal(size=(3, 3, 3)))
text('cube5.txt', r.normal(size=(5, 5, 5)))
gaps = r.normal(size=(3, 5, 5))
gaps[0, 0, 0] = gaps[1, 2, :] = gaps[2, 4, 3] = 0
text('gaps.txt', gaps)"
}

# kernel KERNEL TYPE PAD [OPTION…]: runs it with --explain; are_correlations compares with SciPy to the bound it states.
kernel() {
    local out=k$(ls k*.raw 2>/dev/null | wc -l).raw kernel=$1 type=$2 mode=$3
    shift 3
    vkt filter kernel $kernel v_13x11x7_$type.raw --explain --format raw -o $out "$@" 2>plan
    echo "$kernel $type $out $mode $(grep -o 'error at most [0-9.e+-]*' plan | cut -d' ' -f4) $*" >>jobs
}

are_correlations() {
    /usr/bin/python3 - <<'PY'
import numpy as np
from scipy.ndimage import correlate, convolve
for line in open('jobs'):
    kernel, dtype, out, mode, bound, *options = line.split()
    words = [w for l in open(kernel) for w in l.split('#')[0].split()]
    k = np.array(words[3:], float).reshape([int(n) for n in words[2::-1]])
    mode, _, value = mode.partition(':')
    v = np.fromfile(f'v_13x11x7_{dtype}.raw', dtype).reshape(7, 11, 13).astype('f8')
    want = (convolve if '--convolve' in options else correlate)(v, k, mode=mode, cval=float(value or 0))
    wide = dtype in ('float64', 'int32', 'uint32', 'int64', 'uint64')
    got = np.fromfile(out, 'f8' if wide else 'f4').reshape(v.shape)
    allowed = float(bound) * max(abs(v).max(), abs(float(value or 0))) + 1e-13 * abs(want).max()
    assert allowed < 1e-2 * abs(want).max()
    assert abs(got - want).max() <= allowed, f'{line}: {abs(got - want).max()} > {allowed}'
PY
    rm jobs
}

@test "every type is what SciPy's correlate gives, to the stated bound" {
    for type in $all_types; do
        for kernel in dense long product large cube3 cube5 gaps dog two; do kernel $kernel.txt $type reflect; done
    done
    are_correlations
}

@test "boundaries are SciPy's" {
    for pair in mirror=reflect clamp=nearest wrap=wrap border=constant:0 border:-2=constant:-2; do
        for kernel in dense product large cube3 cube5 gaps dog; do kernel $kernel.txt float32 "${pair#*=}" --boundary "${pair%=*}"; done
    done
    are_correlations
}

@test "correlation by default, convolution when asked" {
    kernel dense.txt int16 reflect --convolve
    kernel product.txt int16 reflect --convolve
    are_correlations
    # The weight of the neighbour with larger x is the last of the row.
    echo '3 1 1  0 0 1' >next.txt
    vkt filter kernel next.txt v_13x11x7_uint8.raw --dtype uint8 | vkt crop --roi :12,:,: | vkt write - --format raw >a.raw
    vkt crop v_13x11x7_uint8.raw --roi 1:,:,: | vkt write - --format raw | cmp - a.raw
}

@test "the plan says what was found" {
    vkt filter kernel product.txt v_13x11x7_uint8.raw -n -o x.vkt 2>plan
    grep -q 'separable kernel, 5x7x3' plan
    vkt filter kernel dense.txt v_13x11x7_uint8.raw -n -o x.vkt 2>plan
    grep -q 'direct, kernel 7x3x5, 105 weights' plan
    printf '3 3 3  1 2 1 2 4 2 1 2 1  2 4 2 4 8 4 2 4 2  1 2 1 2 4 2 1 2 1.001' >nearly.txt
    vkt filter kernel nearly.txt v_13x11x7_uint8.raw -n -o x.vkt 2>plan
    grep -q 'direct' plan
}

@test "sums of few products are found, forced and refused; integer sums stay exact" {
    plan_of() { vkt filter kernel "$@" -n -o x.vkt 2>&1; }
    plan_of dog.txt v_13x11x7_float64.raw | grep -q 'sum of [2-4] separable kernels, 11x11x11'
    plan_of two.txt v_13x11x7_uint8.raw | grep -q 'sum of [2-4] separable kernels, 7x11x9'
    plan_of two.txt v_13x11x7_uint8.raw --method direct | grep -q 'direct, kernel 7x11x9, 693 weights'
    plan_of large.txt v_13x11x7_uint8.raw | grep -q 'direct'
    fails_with 2 'no sum of few products' vkt filter kernel <(/usr/bin/python3 -c "
import numpy as np
print(31, 31, 31, *np.random.default_rng(1).normal(size=31**3))") v_13x11x7_uint8.raw --method separable -o o.vkt
    for method in direct separable; do kernel two.txt uint16 reflect --method $method; done
    kernel dense.txt float64 reflect --method separable
    are_correlations
    # Integers: the same as exact sums, bit for bit; floats with these weights may take the products.
    plan_of signs.txt v_13x11x7_uint8.raw | grep -q direct
    plan_of signs.txt v_13x11x7_float32.raw | grep -q 'sum of'
    vkt filter kernel signs.txt v_13x11x7_uint8.raw --format raw -o exact.raw
    /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import correlate
k = np.array([w for l in open('signs.txt') for w in l.split('#')[0].split()][3:], float).reshape(9, 9, 9)
v = np.fromfile('v_13x11x7_uint8.raw', 'u1').reshape(7, 11, 13).astype('f8')
assert (correlate(v, k, mode='reflect') == np.fromfile('exact.raw', 'f4').reshape(v.shape)).all()"
    echo '3 3 3' $(yes 0 | head -27) >zero.txt
    vkt filter kernel zero.txt v_13x11x7_float32.raw --method separable | vkt stats - | grep -q .
}

@test "--tolerance: a kernel that is nearly a product becomes one; results keep to the bound; what cannot be kept is refused" {
    plan_of() { vkt filter kernel "$@" -n -o x.vkt 2>&1; }
    # A product, and noise of a ten-thousandth of its weights.
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(5)
k = np.einsum('i,j,k->ijk', *r.normal(size=(3, 9)))
k += 1e-4 * abs(k).mean() * r.uniform(-1, 1, k.shape)
print(9, 9, 9, *k.ravel())" >noisy.txt
    plan_of noisy.txt v_13x11x7_float32.raw | grep -q direct
    plan_of noisy.txt v_13x11x7_float32.raw --tolerance 0.1% | grep -q 'separable kernel, 9x9x9'
    plan_of noisy.txt v_13x11x7_float32.raw --tolerance 0.001% | grep -q direct
    for tolerance in 0.1% 0.02%; do
        kernel noisy.txt uint16 reflect --tolerance $tolerance
        kernel noisy.txt float64 reflect --tolerance $tolerance
    done
    kernel dog.txt float32 constant:30 --boundary border:30 --tolerance 3%
    # The bound says what was left out, no more than was allowed and not nothing.
    /usr/bin/python3 - <<'PY'
import numpy as np
for line in open('jobs'):
    kernel, dtype, out, mode, bound, *options = line.split()
    if kernel != 'noisy.txt': continue
    k = np.array(open(kernel).read().split()[3:], float)
    allowed = float(options[-1][:-1]) / 100 * abs(k).sum()
    assert 0.01 * allowed < float(bound) < 1.01 * allowed + 1e-4, line
PY
    sed -i '/dog/d' jobs
    are_correlations
    # Integers with integer weights: sums of products only where a tolerance allows them.
    plan_of signs.txt v_13x11x7_uint8.raw --tolerance 0.01% | grep -q 'sum of'
    # Transforms keep to a tolerance of float64, or are refused.
    if ! vkt --version | grep -q 'KISS FFT.*off'; then
        plan_of large.txt v_13x11x7_float64.raw --method fft --tolerance 1e-8% | grep -q Fourier
    fi
    fails_with 2 'the error of its transforms is' vkt filter kernel large.txt v_13x11x7_float64.raw --method fft --tolerance 1e-10% -o o.vkt
    fails_with 2 'lacks the sign' vkt filter kernel large.txt v_13x11x7_uint8.raw --tolerance 0.01 -o o.vkt
    fails_with 2 'is not between' vkt filter kernel large.txt v_13x11x7_uint8.raw --tolerance 0% -o o.vkt
}

@test "Fourier transforms: SciPy's results to the bound, however run, and NaN and infinities no further than directly" {
    vkt --version | grep -q 'KISS FFT' && ! vkt --version | grep -q 'KISS FFT.*off' || skip 'built without KISS FFT'
    for type in uint8 int16 float32 float64 int64; do kernel large.txt $type reflect --method fft; done
    kernel dense.txt int16 reflect --method fft --convolve
    kernel dense.txt float32 constant:-2 --boundary border:-2 --method fft
    kernel two.txt float32 wrap --boundary wrap --method fft
    are_correlations
    # 96 voxels are several squares; the kernel is large enough to be chosen.
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(3)
print(17, 15, 13, *r.normal(size=17 * 15 * 13), file=open('huge.txt', 'w'))
v = r.normal(size=(21, 70, 131)).astype('f4')
v.tofile('w_131x70x21_float32.raw')
print(17, 15, 3, *r.normal(size=17 * 15 * 3), file=open('flat.txt', 'w'))
v[3, 8, 100], v[18, 60, 20] = np.nan, np.inf
v.tofile('s_131x70x21_float32.raw')"
    vkt filter kernel huge.txt w_131x70x21_float32.raw -n --explain -o x.vkt 2>&1 | grep -q 'Fourier transforms, kernel 17x15x13, squares of [0-9]'
    for name in w s; do
        for method in auto direct; do
            vkt filter kernel huge.txt ${name}_131x70x21_float32.raw --method $method --format raw -o $name$method.raw
        done
        for options in '--slab 1 --threads 2' '--slab 5 --threads 3'; do
            vkt filter kernel huge.txt ${name}_131x70x21_float32.raw $options --format raw -o b.raw --force
            cmp ${name}auto.raw b.raw
        done
        # More threads than pairs of squares: these are cut along z.
        vkt filter kernel flat.txt ${name}_131x70x21_float32.raw --method fft --threads 1 --format raw -o one.raw --force
        vkt filter kernel flat.txt ${name}_131x70x21_float32.raw --method fft --threads 9 --format raw -o nine.raw --force
        cmp one.raw nine.raw
        vkt filter kernel huge.txt ${name}_131x70x21_float32.raw --roi 40:99,13:60,2:9 | vkt crop --roi 40:99,13:60,2:9 | vkt write - --format raw >b.raw
        vkt filter kernel huge.txt ${name}_131x70x21_float32.raw | vkt crop --roi 40:99,13:60,2:9 | vkt write - --format raw | cmp - b.raw
    done
    /usr/bin/python3 -c "
import numpy as np
for name in 'ws':
    a, b = (np.fromfile(f'{name}{m}.raw', 'f4') for m in ('auto', 'direct'))
    assert (np.isnan(a) == np.isnan(b)).all() and (np.isinf(a) == np.isinf(b)).all()
    ok = np.isfinite(b)
    assert ok.any() and (name == 'w') == ok.all() and abs(a - b)[ok].max() < 2e-3  # direct sums are in float32
from scipy.signal import fftconvolve
k = np.array(open('huge.txt').read().split()[3:], float).reshape(13, 15, 17)
v = np.fromfile('w_131x70x21_float32.raw', 'f4').reshape(21, 70, 131).astype('f8')
want = fftconvolve(np.pad(v, [(6, 6), (7, 7), (8, 8)], mode='symmetric'), k[::-1, ::-1, ::-1], 'valid')
got = np.fromfile('wauto.raw', 'f4').reshape(want.shape)
assert (abs(got - want) <= 2**-24 * abs(want) + 1e-9).all()"
    same_however_run dtype=float32 vkt filter kernel two.txt --method fft
}

@test "a kernel may be a volume, of any type and with a value map" {
    /usr/bin/python3 -c "
import numpy as np
np.arange(27, dtype='u1').tofile('k_3x3x3_uint8.raw')
print(3, 3, 3, *(0.5 * np.arange(27) - 3), file=open('k.txt', 'w'))"
    vkt set k_3x3x3_uint8.raw --slope 0.5 --intercept -3 -o k.nrrd
    vkt filter kernel k.nrrd v_13x11x7_float32.raw | vkt write - --format raw >a.raw
    vkt filter kernel k.txt v_13x11x7_float32.raw | vkt write - --format raw >b.raw
    cmp a.raw b.raw
    vkt filter kernel <(cat k.txt) v_13x11x7_float32.raw | vkt write - --format raw | cmp - b.raw
    vkt write k.nrrd k.vkt
    vkt write k.nrrd k.zarr
    for kernel in k.vkt k.zarr; do vkt filter kernel $kernel v_13x11x7_float32.raw | vkt write - --format raw | cmp - b.raw; done
    vkt filter kernel <(cat k.nrrd) v_13x11x7_float32.raw | vkt write - --format raw | cmp - b.raw
    vkt filter kernel <(vkt read k.nrrd) v_13x11x7_float32.raw | vkt write - --format raw | cmp - b.raw
}

@test "values are physical; NaN and infinities stay within the kernel" {
    vkt set v_13x11x7_int16.raw --slope 0.5 --intercept 100 | vkt filter kernel dense.txt --dtype float64 | vkt write - --format raw >a.raw
    vkt set v_13x11x7_int16.raw --slope 0.5 --intercept 100 | vkt filter kernel product.txt --dtype float64 | vkt write - --format raw >p.raw
    vkt filter kernel dense.txt n_13x11x7_float64.raw | vkt write - --format raw >n.raw
    /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import correlate
v = np.fromfile('v_13x11x7_int16.raw', 'i2').reshape(7, 11, 13) * .5 + 100
def read(name):
    words = [w for l in open(name) for w in l.split('#')[0].split()]
    return np.array(words[3:], float).reshape([int(n) for n in words[2::-1]])
for name, kernel in (('a.raw', 'dense.txt'), ('p.raw', 'product.txt')):
    want = correlate(v, read(kernel), mode='reflect')
    assert abs(np.fromfile(name, 'f8').reshape(v.shape) - want).max() < 1e-5 * abs(want).max()
n = np.fromfile('n_13x11x7_float64.raw').reshape(v.shape)
with np.errstate(invalid='ignore'):
    spoilt = correlate((~np.isfinite(n)).astype(float), np.ones((5, 3, 7)), mode='reflect') > 0
got = np.fromfile('n.raw').reshape(v.shape)
assert (np.isfinite(got) == ~spoilt).all()
clean = correlate(np.where(np.isfinite(n), n, 0), read('dense.txt'), mode='reflect')
assert abs(got - clean)[~spoilt].max() < 1e-12"
}

@test "a weight of 0 reads nothing, beside weights that do" {
    # One voxel is infinite: it reaches as far as the weights that are not 0, whichever of the methods adds them up.
    /usr/bin/python3 -c "
import numpy as np
v = np.ones((9, 9, 9), 'f4')
v[4, 4, 4] = np.inf
v.tofile('i_9x9x9_float32.raw')
v[:, 4:5].copy().tofile('i_9x1x9_float32.raw')"
    for kernel in gaps cube3 cube5; do
        for size in 9x9x9 9x1x9; do
            vkt filter kernel $kernel.txt i_${size}_float32.raw --boundary border:1 --format raw -o i_$kernel$size.raw
        done
    done
    /usr/bin/python3 -c "
import numpy as np
for name in 'gaps', 'cube3', 'cube5':
    words = [w for l in open(name + '.txt') for w in l.split('#')[0].split()]
    k = np.array(words[3:], float).reshape([int(n) for n in words[2::-1]])
    reach = np.zeros((9, 9, 9), bool)
    r = [n // 2 for n in k.shape]
    reach[tuple(slice(4 - n, 5 + n) for n in r)] = k[::-1, ::-1, ::-1] != 0
    got = np.fromfile(f'i_{name}9x9x9.raw', 'f4').reshape(reach.shape)
    assert (np.isinf(got) == reach).all() and not np.isnan(got).any(), name
    assert abs(got[0, 0, 0] / k.sum() - 1) < 1e-4, name
    flat = np.fromfile(f'i_{name}9x1x9.raw', 'f4').reshape(9, 9)
    assert (np.isinf(flat) == reach[:, 4]).all(), name"
}

@test "slabs, threads, memory, pipes and regions make no difference" {
    for kernel in dense product large cube3 cube5 two; do same_however_run dtype=float32 vkt filter kernel $kernel.txt; done
    same_however_run dtype=uint8 vkt filter kernel dense.txt
    same_however_run dtype=uint32 vkt filter kernel product.txt
}

@test "near the largest numbers results are those of smaller ones, to the bit, where they have room themselves" {
    setup_more
    local kernel
    for kernel in cube3 gaps long; do same_at_the_top vkt filter kernel $kernel.txt --method direct; done
    same_at_the_top vkt filter kernel two.txt --method separable
    # Sums of transforms are rounded otherwise; what they have no room for is summed up directly.
    vkt filter kernel large.txt --method fft large_19x18x17_float64.raw | vkt write - --format raw >fft.raw
    vkt filter kernel large.txt --method direct large_19x18x17_float64.raw | vkt write - --format raw | cmp - fft.raw
}

@test "what is no kernel is refused, and said" {
    echo '2 3 3' >even.txt
    fails_with 3 'not odd' vkt filter kernel even.txt v_13x11x7_uint8.raw -o o.vkt
    echo '3 1 1  1 2' >short.txt
    fails_with 3 'it ends after 5 of 6 numbers' vkt filter kernel short.txt v_13x11x7_uint8.raw -o o.vkt
    echo '3 1 1  1 2 3 4' >more.txt
    fails_with 3 'more than 3 weights' vkt filter kernel more.txt v_13x11x7_uint8.raw -o o.vkt
    echo '3 1 1  1 2 1e400' >inf.txt
    run ! vkt filter kernel inf.txt v_13x11x7_uint8.raw -o o.vkt
    echo '3 1 1  1 nan 2' >nan.txt
    fails_with 3 "'nan' is not a number" vkt filter kernel nan.txt v_13x11x7_uint8.raw -o o.vkt
    echo '99999999 3 1  1' >far.txt
    fails_with 3 'extents 99999999 x 3 x 1' vkt filter kernel far.txt v_13x11x7_uint8.raw -o o.vkt
    fails_with 2 '--tolerance 1%' vkt filter kernel dense.txt v_13x11x7_uint8.raw --tolerance inf -o o.vkt
    echo '3 1 1  1 2-3 1' >word.txt
    fails_with 3 "'2-3' is not a number" vkt filter kernel word.txt v_13x11x7_uint8.raw -o o.vkt
    echo '3 1 1  1 x 1' >letter.txt
    fails_with 3 "'x' is not a number" vkt filter kernel letter.txt v_13x11x7_uint8.raw -o o.vkt
    printf '# of three\n3,1,1 1 2 3\n' >commas.txt
    fails_with 3 "'3,1,1' is not a number" vkt filter kernel commas.txt v_13x11x7_uint8.raw -o o.vkt
    echo '3 1 1  0 1e39 0' >beyond.txt
    fails_with 2 'too much for the float32' vkt filter kernel beyond.txt v_13x11x7_uint8.raw --dtype float64 -o o.vkt
    vkt convert v_13x11x7_uint8.raw --dtype float64 | vkt filter kernel beyond.txt -o wide.vkt
    vkt stats wide.vkt --json | grep -q '"max": 2.55e+41'
    fails_with 4 'absent.txt' vkt filter kernel absent.txt v_13x11x7_uint8.raw -o o.vkt
    fails_with 2 'kernel' vkt filter kernel
    fails_with 2 'is no voxel of a uint8 volume' vkt filter kernel dense.txt v_13x11x7_uint8.raw --boundary border:0.5 -o o.vkt
    fails_with 2 'is no voxel of a uint8 volume' vkt filter kernel dense.txt v_13x11x7_uint8.raw --boundary border:-1 -o o.vkt
    : >empty.txt
    run ! vkt filter kernel empty.txt v_13x11x7_uint8.raw -o o.vkt
    [ ! -e o.vkt ]
}

@test "a type asked for clips and says so" {
    echo '1 1 1 300' >gain.txt
    fails_with 3 'clipped to [0,255]' vkt filter kernel gain.txt v_13x11x7_uint8.raw --dtype uint8 --strict -o o.vkt
    vkt make amr --blocks 20 --levels 2 | vkt filter kernel dense.txt | vkt info - >/dev/null
}

@test "weights of several planes on a single slice are those of the slice between two like it" {
    printf '3 3 3\n0 1 0 1 2 1 0 1 0  1 2 1 2 -24 2 1 2 1  0 1 0 1 2 1 0 1 0\n' >stencil.txt
    printf '3 3 3\n0 0 0 0 1 0 0 0 0  1 1 1 1 -10 1 1 1 1  0 0 0 0 1 0 0 0 0\n' >cross.txt
    vkt make noise --dims 9 8 7 --seed 4 -o noise.nrrd
    for axis in x y z; do
        by=0:0,0:0,1:1
        case $axis in x) by=1:1,0:0,0:0 ;; y) by=0:0,1:1,0:0 ;; esac
        roi=:,:,3:4 middle=:,:,1:2
        case $axis in x) roi=3:4,:,: middle=1:2,:,: ;; y) roi=:,3:4,: middle=:,1:2,: ;; esac
        vkt crop noise.nrrd --roi $roi -o flat.nrrd --force
        for kernel in stencil cross; do
            vkt pad flat.nrrd --by $by --boundary clamp | vkt filter kernel $kernel.txt | vkt crop --roi $middle -o expected.nrrd --force
            vkt filter kernel $kernel.txt flat.nrrd | vkt diff - expected.nrrd --tolerance 1e-3
        done
    done
}
