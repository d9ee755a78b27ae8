# vkt filter box against exact sums, and however it is run.
load helper
load filters

setup_more() { make_volumes; }

@test "integers are means of exact sums, rounded half to even; floats agree with float64" {
    for type in $all_types; do
        for radius in 1 2 3,0,4 6,5,3 20; do
            vkt filter box v_13x11x7_$type.raw --radius $radius --format raw -o ${type}_$radius.raw
        done
    done
    /usr/bin/python3 - <<'PY'
import numpy as np
from fractions import Fraction
for t in 'uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'.split():
    v = np.fromfile(f'v_13x11x7_{t}.raw', t).reshape(7, 11, 13)
    for radius in '1 2 3,0,4 6,5,3 20'.split():
        r = [int(n) for n in (radius.split(',') if ',' in radius else [radius] * 3)][::-1]
        w = v.astype('f8') if v.dtype.kind == 'f' else v.astype(object)
        count = 1
        for axis, n in enumerate(r):
            p = np.pad(w, [(n, n) if a == axis else (0, 0) for a in range(3)], 'symmetric')
            w = sum(np.take(p, range(k, k + v.shape[axis]), axis) for k in range(2 * n + 1))
            count *= 2 * n + 1
        got = np.fromfile(f'{t}_{radius}.raw', t).reshape(v.shape)
        if v.dtype.kind == 'f':
            want = w / count
            assert abs(got - want).max() <= np.finfo(t).eps * abs(want).max() * (1 if t != 'float64' else 30), f'{t} {radius}'
        else:
            want = np.array([round(Fraction(int(s), count)) for s in w.ravel()], object).reshape(v.shape)
            off = max(abs(int(a) - int(b)) for a, b in zip(got.ravel(), want.ravel()))
            assert off <= (0 if v.itemsize < 8 else 2**15), f'{t} {radius}: {off}'
PY
}

@test "boundaries are SciPy's" {
    for pair in mirror:reflect clamp:nearest wrap:wrap border:constant; do
        vkt filter box v_13x11x7_float32.raw --radius 2,3,1 --boundary ${pair%:*} --format raw -o b.raw --force
        /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import uniform_filter
v = np.fromfile('v_13x11x7_float32.raw', 'f4').reshape(7, 11, 13)
want = uniform_filter(v.astype('f8'), (3, 7, 5), mode='${pair#*:}')
assert abs(np.fromfile('b.raw', 'f4').reshape(v.shape) - want).max() < 1e-7"
    done
}

@test "no residue stays of a large value; NaN and infinities spoil their boxes alone" {
    /usr/bin/python3 -c "
import numpy as np
v = np.ones((9, 40, 50), 'f4'); v[4, 10, 12] = 1e30; v.tofile('s_50x40x9_float32.raw')"
    vkt filter box s_50x40x9_float32.raw --radius 2 | vkt write - --format raw >s.raw
    vkt filter box n_13x11x7_float64.raw --radius 1,2,1 | vkt write - --format raw >n.raw
    /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import maximum_filter
s = np.fromfile('s.raw', 'f4').reshape(9, 40, 50)
far = np.ones(s.shape, bool); far[2:7, 8:13, 10:15] = False
assert (s[far] == 1).all() and (s[~far] > 1e27).all()
bad = ~np.isfinite(np.fromfile('n_13x11x7_float64.raw').reshape(7, 11, 13))
got = ~np.isfinite(np.fromfile('n.raw').reshape(bad.shape))
assert np.array_equal(got, maximum_filter(bad, (3, 5, 3)))"
}

@test "a constant stays, value maps are kept, the identity is one" {
    for value in 0.1 1e30 -7; do
        vkt make constant --dims 20 9 8 --dtype float32 --value $value -o c.vkt --force
        vkt filter box c.vkt --radius 3,50,1 | vkt diff c.vkt
    done
    vkt set v_13x11x7_int16.raw --slope -2 --intercept 5 | vkt filter box --radius 2 | vkt write - --format raw >a.raw
    vkt filter box v_13x11x7_int16.raw --radius 2 | vkt write - --format raw | cmp - a.raw
    vkt filter box v_13x11x7_int64.raw --radius 0 | vkt diff v_13x11x7_int64.raw
}

@test "slabs, threads, memory, pipes and regions make no difference; trees run" {
    for radius in 1 3,0,4 30; do
        [ $radius != 30 ] || MEMORY=32M
        same_however_run dtype=float32 vkt filter box --radius $radius
        same_however_run dtype=uint8 vkt filter box --radius $radius --boundary wrap
    done
    vkt make amr --blocks 20 --levels 2 | vkt filter box --radius 2 | vkt info - >/dev/null
    fails_with 2 'is not in 0 to 4096' vkt filter box v_13x11x7_uint8.raw --radius 4097 -o o.vkt
    fails_with 2 'no voxel' vkt filter box v_13x11x7_uint8.raw --boundary border:0.5 -o o.vkt
}

@test "tiles of threads see what lies around them, at the other end as well" {
    vkt make noise --dims 120 90 70 --dtype float32 -o noise.vkt
    for boundary in mirror clamp wrap border:7; do
        for radius in 1 2,0,40 33,50,3; do
            for filter in 'filter box' 'morphology erode --shape box'; do
                # shellcheck disable=SC2086
                vkt $filter noise.vkt --boundary $boundary --radius $radius --threads 1 --slab 70 -o one.vkt --force
                for threads in 4 7 13; do
                    # shellcheck disable=SC2086
                    vkt $filter noise.vkt --boundary $boundary --radius $radius --threads $threads --slab 70 | vkt diff - one.vkt
                done
            done
        done
    done
}

@test "the plan tells what is exact and what is bounded" {
    vkt filter box v_13x11x7_uint8.raw --radius 9 -n -o x.vkt 2>plan
    grep -q 'windows of sums, 19x19x19, int32' plan
    run ! grep -q 'error at most' plan
    vkt filter box v_13x11x7_float32.raw --radius 9 -n -o x.vkt 2>plan
    grep -q 'float64' plan
    grep -q 'error at most 6e-08 of the largest magnitude' plan
}

@test "near the largest numbers results are those of smaller ones, to the bit, where they have room themselves" {
    same_at_the_top vkt filter box --radius 1
    same_at_the_top vkt filter box --radius 2,5,1
    vkt make constant --dims 9 9 9 --dtype float64 --value 1.7976931348623157e308 -o most.vkt
    vkt filter box most.vkt | vkt stats - | grep -qx 'inf  *0'
}
