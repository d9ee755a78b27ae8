# vkt filter log against SciPy and what is known of polynomials and blobs, however it is run.
load helper
load filters

setup_more() { make_volumes; }

@test "x^2 gives 2 in world units, constants and ramps nothing, at every sigma" {
    /usr/bin/python3 -c "
import numpy as np
z, y, x = np.mgrid[:41, :41, :41].astype('f8')
((.5 * (x - 20)) ** 2 + 3 * (2 * (y - 20)) ** 2 + 7 * z).tofile('q_41x41x41_float64.raw')"
    vkt set q_41x41x41_float64.raw --spacing 0.5,2,1 -o q.vkt
    for sigma in 0 0.3 0.7 1 2.5 3.5; do
        vkt filter log q.vkt --sigma $sigma | vkt crop --roi 20,20,20 | vkt write - --format raw >a.raw
        vkt make constant --dims 19 18 17 --dtype float32 --value 0.1 | vkt set --spacing 0.3,0.7,1.1 | vkt filter log --sigma $sigma | vkt write - --format raw >c.raw
        /usr/bin/python3 -c "
import numpy as np
assert abs(np.fromfile('a.raw')[0] - 8) < 1e-9, np.fromfile('a.raw')
assert not np.fromfile('c.raw', 'f4').any()"
    done
}

@test "SciPy agrees for every type where sampling is fine; a bright blob is most negative at its own scale" {
    for type in $all_types; do vkt filter log v_13x11x7_$type.raw --sigma 1.5 | vkt write - --format raw >$type.raw; done
    /usr/bin/python3 - <<'PY'
import numpy as np
from scipy.ndimage import gaussian_laplace
for t in 'uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'.split():
    v = np.fromfile(f'v_13x11x7_{t}.raw', t).reshape(7, 11, 13).astype('f8')
    wide = t in ('float64', 'int32', 'uint32', 'int64', 'uint64')
    want = gaussian_laplace(v, 1.5, mode='reflect', truncate=6)
    error = abs(np.fromfile(f'{t}.raw', 'f8' if wide else 'f4').reshape(v.shape) - want).max() / abs(want).max()
    assert error < 1e-4, f'{t}: {error}'
z, y, x = np.mgrid[:31, :31, :31] - 15.0
np.exp(-(x * x + y * y + z * z) / 18).astype('f4').tofile('g_31x31x31_float32.raw')
PY
    # A Gaussian of variance 9, smoothed by s: -3 (9 / (9 + s^2))^(3/2) / (9 + s^2) in the middle.
    for sigma in 1 2 3; do
        vkt filter log g_31x31x31_float32.raw --sigma $sigma | vkt crop --roi 15,15,15 | vkt write - --format raw >m.raw
        /usr/bin/python3 -c "
import numpy as np
v = 9 + $sigma ** 2
want = -3 * (9 / v) ** 1.5 / v
assert abs(np.fromfile('m.raw', 'f4')[0] - want) < 1e-3 * abs(want)"
    done
}

@test "world units, physical values, slabs, threads, memory, pipes and regions" {
    vkt set v_13x11x7_float32.raw --spacing 2,1,0.5 -o w.vkt
    vkt filter log w.vkt --sigma 2 --unit world | vkt write - --format raw >a.raw
    vkt filter log w.vkt --sigma 1,2,4 | vkt write - --format raw | cmp - a.raw
    vkt set v_13x11x7_int16.raw --slope -2 --intercept 100 | vkt filter log | vkt write - --format raw >a.raw
    vkt filter log v_13x11x7_int16.raw | vkt arith mul - -2 | vkt write - --format raw >b.raw
    /usr/bin/python3 -c "
import numpy as np
a, b = np.fromfile('a.raw', 'f4'), np.fromfile('b.raw', 'f4')
assert abs(a - b).max() <= 1e-6 * abs(b).max()"
    same_however_run dtype=float32 vkt filter log --sigma 1,2,0.5
    MEMORY=64M same_however_run dtype=uint8 vkt filter log --sigma 4 --boundary wrap
    vkt make amr --blocks 20 --levels 2 | vkt filter log | vkt info - >/dev/null
    fails_with 2 'more than 100' vkt filter log v_13x11x7_uint8.raw --sigma 101 -o o.vkt
    fails_with 2 'finite number >= 0' vkt filter log v_13x11x7_uint8.raw --sigma=-1 -o o.vkt
}

@test "near the largest numbers results are those of smaller ones, to the bit, where they have room themselves" {
    same_at_the_top vkt filter log --sigma 1
}
