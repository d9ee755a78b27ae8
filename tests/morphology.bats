# vkt morphology against SciPy's grey morphology, for every type, and however it is run.
load helper
load filters

setup_more() {
    make_volumes
    : >jobs
}

# morphology WHAT NAME TYPE RADIUS SHAPE MODE [OPTION…]: runs it and leaves to agree_with_scipy what must come out.
morphology() {
    local out=m$(wc -l <jobs).raw
    vkt morphology "$1" "$2" --radius "$4" --shape "$5" --format raw -o "$out" "${@:7}" 2>/dev/null
    echo "$1 $2 $out $3 $4 $5 $6" >>jobs
}

agree_with_scipy() {
    [ -s jobs ]
    /usr/bin/python3 <<'PY'
import numpy as np
def extreme(v, r, shape, mode, least):
    pads = {'reflect': 'symmetric', 'nearest': 'edge', 'wrap': 'wrap'}
    pick = np.minimum if least else np.maximum
    offsets = [o for o in np.ndindex(*[2 * n + 1 for n in r])
               if shape == 'box' or sum(((a - n) / n) ** 2 if n else 0 for a, n in zip(o, r)) <= 1 + 1e-9]
    p = np.pad(v, [(n, n) for n in r], pads[mode])
    out = None
    for o in offsets:
        part = p[tuple(slice(a, a + n) for a, n in zip(o, v.shape))]
        out = part.copy() if out is None else pick(out, part)
    return out
for line in open('jobs'):
    what, name, out, t, radius, shape, mode = line.split()
    r = [int(n) for n in (radius.split(',') if ',' in radius else [radius] * 3)][::-1]
    stored = np.fromfile(name, t).reshape([int(n) for n in name.split('_')[1].split('x')][::-1])
    wide = stored.astype(object) if stored.dtype.kind != 'f' else stored
    # What is continued without end, far enough for two windows.
    pads = {'reflect': 'symmetric', 'nearest': 'edge', 'wrap': 'wrap'}
    far = np.pad(stored, [(2 * n, 2 * n) for n in r], pads[mode])
    inner = tuple(slice(2 * n, 2 * n + m) for n, m in zip(r, stored.shape))
    e = lambda v: extreme(v, r, shape, 'nearest', True)
    d = lambda v: extreme(v, r, shape, 'nearest', False)
    if what in ('gradient', 'tophat'):
        a, b = (d(far), e(far)) if what == 'gradient' else (far, d(e(far)))
        if t[0] == 'f':
            want = a - b
        else:
            i = np.iinfo(t)
            want = np.array([min(int(x) - int(y), i.max) for x, y in zip(a.ravel(), b.ravel())], object).reshape(a.shape).astype(t)
    else:
        want = {'erode': e, 'dilate': d, 'open': lambda v: d(e(v)), 'close': lambda v: e(d(v))}[what](far)
    got = np.fromfile(out, t).reshape(stored.shape)
    assert np.array_equal(got, want[inner]), f'{line}: {(got != want[inner]).sum()} differ'
PY
    : >jobs
}

@test "every operation on every type, balls and boxes" {
    for type in $all_types; do
        for what in erode dilate open close gradient tophat; do
            morphology $what v_13x11x7_$type.raw $type 2 ball reflect
            morphology $what v_13x11x7_$type.raw $type 1 box reflect
        done
    done
    agree_with_scipy
}

@test "radii of all sizes and shapes, boundaries" {
    for radius in 0 1 3 5 0,2,1 4,1,0 9,7,12; do
        for shape in ball box; do
            for what in erode close; do morphology $what v_13x11x7_int16.raw int16 $radius $shape reflect; done
        done
    done
    for pair in clamp=nearest wrap=wrap; do
        for what in dilate open; do
            for shape in ball box; do
                morphology $what v_13x11x7_uint16.raw uint16 2 $shape ${pair#*=} --boundary ${pair%=*}
            done
        done
    done
    agree_with_scipy
}

@test "SciPy's own functions give the same" {
    vkt morphology open v_13x11x7_uint8.raw --radius 2 --shape box | vkt write - --format raw >o.raw
    vkt morphology dilate v_13x11x7_uint8.raw --radius 3 | vkt write - --format raw >d.raw
    /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import grey_opening, grey_dilation
v = np.fromfile('v_13x11x7_uint8.raw', 'u1').reshape(7, 11, 13)
assert np.array_equal(np.fromfile('o.raw', 'u1').reshape(v.shape), grey_opening(v, 5, mode='reflect'))
z, y, x = np.mgrid[-3:4, -3:4, -3:4]
ball = x * x + y * y + z * z <= 9
assert np.array_equal(np.fromfile('d.raw', 'u1').reshape(v.shape), grey_dilation(v, footprint=ball, mode='reflect'))"
}

@test "closing keeps what touches a face; erosion does not eat from outside" {
    vkt make constant --dims 9 8 7 --dtype uint8 --value 1 -o c.vkt
    for what in erode dilate open close; do vkt morphology $what c.vkt --radius 3 | vkt diff c.vkt; done
    vkt morphology close v_13x11x7_uint8.raw --radius 2 -o once.vkt
    vkt morphology close once.vkt --radius 2 | vkt diff once.vkt
}

@test "erosion and dilation are dual, and physical where the slope is negative" {
    for shape in ball box; do
        vkt set v_13x11x7_int16.raw --slope -0.5 --intercept 3 | vkt morphology erode --shape $shape --radius 2 | vkt write - --format raw >a.raw
        vkt morphology dilate v_13x11x7_int16.raw --shape $shape --radius 2 | vkt write - --format raw | cmp - a.raw
    done
    vkt convert v_13x11x7_uint8.raw --dtype int16 | vkt set --slope -0.5 --intercept 3 -o n.vkt
    for what in gradient tophat; do
        vkt morphology $what n.vkt | vkt convert --dtype float64 | vkt write - --format raw >$what.raw
    done
    vkt info --json <(vkt morphology gradient n.vkt) | grep -q '"slope": 0.5'
    vkt convert v_13x11x7_uint8.raw --dtype float64 | vkt arith mul - -0.5 | vkt arith add - 3 -o p.vkt
    for what in gradient tophat; do
        vkt morphology $what p.vkt | vkt write - --format raw >b.raw
        /usr/bin/python3 -c "
import numpy as np
a, b = np.fromfile('$what.raw'), np.fromfile('b.raw')
assert np.array_equal(a, b) or np.array_equal(a * 0.5, b)"
    done
}

@test "NaN is larger than all numbers" {
    vkt morphology erode n_13x11x7_float32.raw --shape box | vkt write - --format raw >e.raw
    vkt morphology dilate n_13x11x7_float32.raw --shape box | vkt write - --format raw >d.raw
    /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import maximum_filter
v = np.fromfile('n_13x11x7_float32.raw', 'f4').reshape(7, 11, 13)
assert not np.isnan(np.fromfile('e.raw', 'f4')).any()
assert np.array_equal(np.isnan(np.fromfile('d.raw', 'f4')).reshape(v.shape), maximum_filter(np.isnan(v), 3))"
}

@test "slabs, threads, memory, pipes and regions make no difference; trees run" {
    MEMORY=4M
    for what in erode close tophat; do
        same_morphology() { vkt morphology "$what" "$@"; }
        same_however_run dtype=uint8 same_morphology --radius 2 --shape ball
        same_however_run dtype=float32 same_morphology --radius 3,1,6 --shape box
    done
    vkt make amr --blocks 20 --levels 2 | vkt morphology open | vkt info - >/dev/null
}

@test "what makes no sense is refused; differences that do not fit are counted" {
    fails_with 2 'balls have at most 32' vkt morphology erode v_13x11x7_uint8.raw --radius 33 -o o.vkt
    fails_with 2 'erode, dilate, open, close, gradient, tophat' vkt morphology shrink v_13x11x7_uint8.raw -o o.vkt
    fails_with 2 'ball, box' vkt morphology erode v_13x11x7_uint8.raw --shape cube -o o.vkt
    fails_with 3 'clipped to [-128,127]' vkt morphology gradient v_13x11x7_int8.raw --strict -o o.vkt
    vkt set v_13x11x7_uint8.raw --slope 2 --intercept 3 -o map.vkt
    fails_with 2 'would change what is outside' vkt morphology gradient map.vkt --roi 2:5,:,: -o o.vkt
    vkt morphology open map.vkt --roi 2:5,:,: | vkt crop --roi 5:,:,: | vkt diff - <(vkt crop map.vkt --roi 5:,:,:)
    [ ! -e o.vkt ]
}
