# Common to the tests of filters: volumes of every type, and what every filter promises.

# make_volumes: v_TYPE.raw named as raw files are, 13x11x7 voxels of every type over the whole range, floats with specials
# aside; n_… holds NaN and infinities.
make_volumes() {
    python_with numpy scipy
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(11)
shape = 7, 11, 13
for t in 'uint8 int8 uint16 int16 uint32 int32 uint64 int64'.split():
    i = np.iinfo(t)
    r.integers(i.min, i.max, shape, t, endpoint=True).tofile(f'v_13x11x7_{t}.raw')
for t in 'float16 float32 float64'.split():
    v = r.normal(size=shape).astype(t)
    v.tofile(f'v_13x11x7_{t}.raw')
    v[3, 5, 6] = np.nan; v[2, 4, 3] = np.inf; v[5, 2, 10] = -np.inf; v[0, 0, 0] = -np.nan
    v.tofile(f'n_13x11x7_{t}.raw')"
}

all_types="uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64"

# same_however_run dtype=TYPE COMMAND…: slabs, threads, memory (MEMORY, or 1M), pipes and files give the same bytes.
same_however_run() {
    vkt make marschner-lobb --dims 37 29 23 --dtype float32 | vkt convert --dtype "${1#dtype=}" --range minmax | vkt set --slope 1 --intercept 0 >run.vkt
    shift
    "$@" run.vkt --slab 23 --threads 1 | vkt write - --format raw >run.a
    [ -s run.a ]
    local options
    for options in '--slab 1 --threads 2' '--slab 3 --threads 5' '--slab 7' "--memory ${MEMORY:-1M}"; do
        # shellcheck disable=SC2086
        vkt read run.vkt --slab 4 | "$@" $options | vkt write - --format raw >run.b
        cmp run.a run.b || { echo "$* $options differs" >&2; return 1; }
    done
    # A region has what the whole has inside, and what was there outside.
    "$@" run.vkt --roi 5:30,4:20,6:17 -o region.vkt --force
    "$@" run.vkt | vkt crop --roi 5:30,4:20,6:17 | vkt write - --format raw >run.a
    vkt crop region.vkt --roi 5:30,4:20,6:17 | vkt write - --format raw >run.b
    cmp run.a run.b
    for slab in 1 7; do
        "$@" run.vkt --roi 5:30,4:20,6:17 --slab $slab | vkt diff - region.vkt
    done
    vkt info --json region.vkt | grep -o '"dtype": "[a-z0-9]*"' | grep -o '[a-z]*[0-9]\+' >type
    for outside in 0:5,:,: :,20:,: :,:,0:6 :,:,17:; do
        vkt crop region.vkt --roi "$outside" | vkt diff - <(vkt crop run.vkt --roi "$outside" | vkt convert --dtype "$(cat type)")
    done
}

# same_at_the_top COMMAND…: what is in between does not overflow where results do not: volumes times 2^k give results times 2^k, to the bit, whatever the slabs, and no more and no other infinities than there ought to be.
same_at_the_top() {
    python_with numpy
    /usr/bin/python3 - <<'PY'
import numpy as np
v = np.random.default_rng(8).uniform(-3.9, 3.9, (17, 18, 19))
v[3:9, 3:9, 3:9] = 3.9
v[12, 12, 12], v[12, 3, 15], v[4, 14, 15] = np.inf, -np.inf, np.nan
v[9:] /= 64 # there nothing overflows
for t, k in ('float32', 126), ('float64', 1022):
    for name, by in ('small', 0), ('large', k):
        np.ldexp(v, by).astype(t).tofile(f'{name}_19x18x17_{t}.raw')
PY
    local type slab
    for type in float32 float64; do
        "$@" small_19x18x17_$type.raw | vkt write - --format raw >small.raw
        for slab in 1 5 17; do
            vkt read large_19x18x17_$type.raw --slab $slab | "$@" - --slab $slab --threads 3 | vkt write - --format raw >large.raw
            /usr/bin/python3 - $type "$*" <<'PY'
import sys
import numpy as np
type_, command = sys.argv[1:]
small, large = (np.fromfile(n + '.raw', type_) for n in ('small', 'large'))
with np.errstate(over='ignore'):
    want = np.ldexp(small, 126 if type_ == 'float32' else 1022)
assert np.isfinite(want).sum() > 500 and np.array_equal(want, large, equal_nan=True), (command, type_, (want != large).sum())
PY
        done
    done
}
