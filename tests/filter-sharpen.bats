# vkt filter sharpen against SciPy, and however it is run.
load helper
load filters

setup_more() { make_volumes; }

@test "v + amount (v - SciPy's Gaussian), rounded and saturated to every type" {
    for type in $all_types; do vkt filter sharpen v_13x11x7_$type.raw --sigma 1.2 --amount 0.7 2>/dev/null | vkt write - --format raw >$type.raw; done
    /usr/bin/python3 - <<'PY'
import numpy as np
from scipy.ndimage import gaussian_filter
for t in 'uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'.split():
    v = np.fromfile(f'v_13x11x7_{t}.raw', t).reshape(7, 11, 13)
    want = v + .7 * (v.astype('f8') - gaussian_filter(v.astype('f8'), 1.2, mode='reflect', truncate=8))
    got = np.fromfile(f'{t}.raw', t).reshape(v.shape).astype('f8')
    if v.dtype.kind != 'f':
        want = np.clip(want, float(np.iinfo(t).min), float(np.iinfo(t).max))
    allowed = 1e-5 * abs(v.astype('f8')).max() + (.5 if v.dtype.kind != 'f' else 2e-3 if t == 'float16' else 0)
    assert abs(got - want).max() <= allowed, f'{t}: {abs(got - want).max()}'
PY
    fails_with 3 'clipped to [0,255]' vkt filter sharpen v_13x11x7_uint8.raw --amount 5 --strict -o o.vkt
}

@test "constants stay bit for bit, value maps are kept, amount 0 is the identity" {
    for value in 0.1 -1e30; do
        vkt make constant --dims 19 18 17 --dtype float32 --value $value -o c.vkt --force
        vkt filter sharpen c.vkt --sigma 1.7 --amount 3.3 | vkt diff c.vkt
    done
    vkt filter sharpen v_13x11x7_float32.raw --amount 0 | vkt diff v_13x11x7_float32.raw
    vkt set v_13x11x7_int16.raw --slope -2 --intercept 5 | vkt filter sharpen 2>/dev/null | vkt write - --format raw >a.raw
    vkt filter sharpen v_13x11x7_int16.raw 2>/dev/null | vkt write - --format raw | cmp - a.raw
}

@test "slabs, threads, memory, pipes and regions make no difference; trees run" {
    MEMORY=8M
    same_however_run dtype=float32 vkt filter sharpen --sigma 1.5
    same_however_run dtype=uint8 vkt filter sharpen --sigma 2,1,0 --boundary clamp
    vkt make amr --blocks 20 --levels 2 | vkt filter sharpen | vkt info - >/dev/null
    fails_with 2 'amount' vkt filter sharpen v_13x11x7_uint8.raw --amount inf -o o.vkt
}

@test "near the largest numbers results are those of smaller ones, to the bit, where they have room themselves" {
    same_at_the_top vkt filter sharpen --sigma 1 --amount 0.5
}
