# vkt filter laplacian against SciPy and what is known of polynomials, however it is run.
load helper
load filters

setup_more() { make_volumes; }

@test "x^2 gives 2 in world units, a ramp and a constant nothing, a bright blob is negative in its middle" {
    /usr/bin/python3 -c "
import numpy as np
z, y, x = np.mgrid[:9, :9, :9].astype('f8')
((.5 * x) ** 2 + 3 * (2 * y) ** 2 + 7 * z).tofile('q_9x9x9_float64.raw')
np.exp(-((x - 4) ** 2 + (y - 4) ** 2 + (z - 4) ** 2) / 4).tofile('g_9x9x9_float64.raw')"
    vkt set q_9x9x9_float64.raw --spacing 0.5,2,1 | vkt filter laplacian | vkt crop --roi 1:-1,1:-1,1:-1 | vkt write - --format raw >a.raw
    vkt filter laplacian g_9x9x9_float64.raw | vkt crop --roi 4,4,4 | vkt write - --format raw >b.raw
    vkt make constant --dims 9 9 9 --dtype float32 --value 0.1 | vkt set --spacing 0.3,0.7,1.1 | vkt filter laplacian | vkt write - --format raw >c.raw
    /usr/bin/python3 -c "
import numpy as np
assert abs(np.fromfile('a.raw') - 8).max() < 1e-12
assert np.fromfile('b.raw')[0] < -1
assert not np.fromfile('c.raw', 'f4').any()"
}

@test "every type is what SciPy gives" {
    for type in $all_types; do vkt filter laplacian v_13x11x7_$type.raw | vkt write - --format raw >$type.raw; done
    /usr/bin/python3 - <<'PY'
import numpy as np
from scipy.ndimage import laplace
for t in 'uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'.split():
    v = np.fromfile(f'v_13x11x7_{t}.raw', t).reshape(7, 11, 13).astype('f8')
    wide = t in ('float64', 'int32', 'uint32', 'int64', 'uint64')
    got = np.fromfile(f'{t}.raw', 'f8' if wide else 'f4').reshape(v.shape)
    error = abs(got - laplace(v, mode='reflect')).max() / abs(v).max()
    assert error < (1e-14 if wide else 2e-6), f'{t}: {error}'
PY
}

@test "slabs, threads, memory, pipes and regions make no difference; trees run" {
    same_however_run dtype=float32 vkt filter laplacian
    same_however_run dtype=uint8 vkt filter laplacian --boundary clamp
    vkt make amr --blocks 20 --levels 2 | vkt filter laplacian | vkt info - >/dev/null
}

@test "near the largest numbers results are those of smaller ones, to the bit, where they have room themselves" {
    same_at_the_top vkt filter laplacian
}
