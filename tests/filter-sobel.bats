# vkt filter sobel against SciPy and what is known of ramps, however it is run.
load helper
load filters

setup_more() { make_volumes; }

@test "a ramp gives its slope exactly, in world units, and nothing along the other axes" {
    /usr/bin/python3 -c "
import numpy as np
z, y, x = np.mgrid[:10, :11, :12].astype('f4')
(3 * x * .5 - 2 * y * .25 + 5 * z * 2).tofile('r_12x11x10_float32.raw')"
    vkt set r_12x11x10_float32.raw --spacing 0.5,0.25,2 -o r.vkt
    for pair in x:3 y:-2 z:5; do
        vkt filter sobel r.vkt --component ${pair%:*} | vkt crop --roi 1:-1,1:-1,1:-1 | vkt stats --json >stats
        grep -q "\"min\": ${pair#*:}[,}]*$" stats && grep -q "\"max\": ${pair#*:}[,}]*$" stats || { cat stats >&2; false; }
    done
    vkt filter sobel r.vkt | vkt crop --roi 1:-1,1:-1,1:-1 | vkt write - --format raw >m.raw
    /usr/bin/python3 -c "
import numpy as np
assert abs(np.fromfile('m.raw', 'f4') - np.sqrt(38)).max() < 1e-6"
}

@test "every type is what SciPy gives, unsigned ones do not wrap" {
    for type in $all_types; do
        for c in magnitude x y z; do
            vkt set v_13x11x7_$type.raw --spacing 0.5,1,3 | vkt filter sobel --component $c | vkt write - --format raw >${type}_$c.raw
        done
    done
    /usr/bin/python3 - sobel <<'PY'
import sys
import numpy as np
from scipy.ndimage import correlate1d
for t in 'uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'.split():
    v = np.fromfile(f'v_13x11x7_{t}.raw', t).reshape(7, 11, 13).astype('f8')
    wide = t in ('float64', 'int32', 'uint32', 'int64', 'uint64')
    parts = {}
    for axis, (name, h) in enumerate((('z', 3), ('y', 1), ('x', .5))):
        d = correlate1d(v, [-.5 / h, 0, .5 / h], axis, mode='reflect')
        for other in range(3):
            if other != axis and sys.argv[1] == 'sobel':
                d = correlate1d(d, [.25, .5, .25], other, mode='reflect')
        parts[name] = d
    parts['magnitude'] = np.sqrt(sum(d * d for d in parts.values()))
    for name, want in parts.items():
        got = np.fromfile(f'{t}_{name}.raw', 'f8' if wide else 'f4').reshape(v.shape)
        error = abs(got - want).max() / abs(v).max()
        assert error < (1e-14 if wide else 1e-6), f'{t} {name}: {error}'
PY
}

@test "a constant gives exactly nothing, whatever its value; flips change signs" {
    for value in 0.1 1e30 16777217; do
        vkt make constant --dims 20 9 8 --dtype float32 --value $value | vkt set --spacing 0.3,0.7,1.1 | vkt filter sobel | vkt stats --json >stats
        grep -q '"max": 0[,}]*$' stats || { cat stats >&2; false; }
    done
    vkt flip x v_13x11x7_float32.raw | vkt filter sobel --component x | vkt arith mul - -1 | vkt flip x | vkt write - --format raw >a.raw
    vkt filter sobel v_13x11x7_float32.raw --component x | vkt write - --format raw >b.raw
    /usr/bin/python3 -c "
import numpy as np
assert np.array_equal(np.fromfile('a.raw', 'f4'), np.fromfile('b.raw', 'f4'))"
}

@test "values are physical" {
    vkt set v_13x11x7_int16.raw --slope -2 --intercept 100 | vkt filter sobel --component y | vkt write - --format raw >a.raw
    vkt filter sobel v_13x11x7_int16.raw --component y | vkt arith mul - -2 | vkt write - --format raw | cmp - a.raw
    vkt set v_13x11x7_int16.raw --slope -2 --intercept 100 | vkt filter sobel --roi 3:9,:,: | vkt crop --roi :3,:,: | vkt write - --format raw >a.raw
    vkt set v_13x11x7_int16.raw --slope -2 --intercept 100 | vkt crop --roi :3,:,: | vkt write - --format raw >b.raw
    /usr/bin/python3 -c "
import numpy as np
assert np.array_equal(np.fromfile('a.raw', 'f4'), np.fromfile('b.raw', 'i2') * -2.0 + 100)"
}

@test "slabs, threads, memory, pipes and regions make no difference" {
    same_however_run dtype=float32 vkt filter sobel
    same_however_run dtype=uint8 vkt filter sobel --component z
    same_however_run dtype=int32 vkt filter sobel --boundary wrap
    same_however_run dtype=uint16 vkt filter sobel --dtype int16 --component x
}

@test "one voxel along an axis, a NaN, a tree, and what is refused" {
    vkt make constant --dims 1 1 1 --dtype uint8 --value 9 | vkt filter sobel | vkt write - --format raw | od -An -tf4 | grep -q '^ *0$'
    vkt crop v_13x11x7_float32.raw --roi :,:,3 | vkt filter sobel --component z | vkt stats --json | grep -q '"max": 0[,}]*$'
    vkt filter sobel n_13x11x7_float32.raw | vkt write - --format raw >n.raw
    /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import maximum_filter
bad = ~np.isfinite(np.fromfile('n_13x11x7_float32.raw', 'f4').reshape(7, 11, 13))
got = ~np.isfinite(np.fromfile('n.raw', 'f4').reshape(bad.shape))
assert got.any() and not (got & ~maximum_filter(bad, 3)).any()"
    vkt make amr --blocks 20 --levels 2 | vkt filter sobel | vkt info - >/dev/null
    fails_with 2 'magnitude, x, y, z' vkt filter sobel v_13x11x7_uint8.raw --component w -o o.vkt
    fails_with 2 'no voxel' vkt filter sobel v_13x11x7_uint8.raw --boundary border:256 -o o.vkt
}

@test "lengths are those of other magnitudes, to the bit, where squares would overflow or vanish" {
    vkt make noise --dims 21 14 9 --dtype float64 --low -1 --high 1 --seed 5 -o unit.vkt
    for type in float32 float64; do
        scales='-60 -100 100'
        [ $type = float32 ] || scales='-600 -900 900'
        vkt convert unit.vkt --dtype $type | vkt filter sobel >want.vkt
        for k in $scales; do
            factor=$(/usr/bin/python3 -c "print(repr(2.0 ** $k))") back=$(/usr/bin/python3 -c "print(repr(2.0 ** -$k))")
            vkt convert unit.vkt --dtype $type | vkt arith mul - "$factor" | vkt filter sobel | vkt arith mul - "$back" >got.vkt
            vkt diff want.vkt got.vkt
        done
    done
    vkt stats want.vkt | grep -x 'nan  *0'
}

@test "near the largest numbers results are those of smaller ones, to the bit, where they have room themselves" {
    same_at_the_top vkt filter sobel
}
