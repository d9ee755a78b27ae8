# vkt filter dog against SciPy, and however it is run.
load helper
load filters

setup_more() { make_volumes; }

@test "the difference of SciPy's Gaussians, for every type; little minus more" {
    for type in $all_types; do vkt filter dog v_13x11x7_$type.raw --sigma 1,1.5,0.5 --ratio 2 | vkt write - --format raw >$type.raw; done
    /usr/bin/python3 - <<'PY'
import numpy as np
from scipy.ndimage import gaussian_filter
for t in 'uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'.split():
    v = np.fromfile(f'v_13x11x7_{t}.raw', t).reshape(7, 11, 13).astype('f8')
    wide = t in ('float64', 'int32', 'uint32', 'int64', 'uint64')
    want = gaussian_filter(v, (.5, 1.5, 1), mode='reflect', truncate=8) - gaussian_filter(v, (1, 3, 2), mode='reflect', truncate=8)
    got = np.fromfile(f'{t}.raw', 'f8' if wide else 'f4').reshape(v.shape)
    assert abs(got - want).max() < 1e-5 * abs(v).max(), f'{t}: {abs(got - want).max()}'
PY
    vkt make sphere --dims 21 21 21 --dtype float32 | vkt filter dog --sigma 2 | vkt crop --roi 10,10,10 | vkt stats --json | grep -q '"min": [0-9]'
}

@test "a constant gives exactly nothing; slabs, threads, memory, pipes and regions make no difference" {
    vkt make constant --dims 19 18 17 --dtype float32 --value 0.1 | vkt filter dog --sigma 1.3 | vkt write - --format raw | tr -d '\0' | wc -c | grep -qx 0
    MEMORY=8M
    same_however_run dtype=float32 vkt filter dog --sigma 1.5
    same_however_run dtype=uint8 vkt filter dog --sigma 1 --dtype int8
    vkt make amr --blocks 20 --levels 2 | vkt filter dog | vkt info - >/dev/null
    fails_with 2 'ratio' vkt filter dog v_13x11x7_uint8.raw --ratio 0 -o o.vkt
}

@test "near the largest numbers results are those of smaller ones, to the bit, where they have room themselves" {
    same_at_the_top vkt filter dog --sigma 1
}
