# vkt filter median against sorting, for every type, and however it is run.
load helper
load filters

setup_more() {
    make_volumes
    : >jobs
}

# median IN TYPE RADIUS PAD [OPTION…]: runs it and leaves to are_medians what must come out. PAD is NumPy's word for the
# boundary, with a value after a colon.
median() {
    local name=$1 type=$2 radius=$3 pad=$4 out
    shift 4
    out=m$(wc -l <jobs).raw
    vkt filter median "$name" --radius "$radius" --format raw -o "$out" "$@"
    [[ $radius == *,* ]] || radius=$radius,$radius,$radius
    echo "$name $out $type $radius $pad" >>jobs
}

# NumPy's sorting of every window; NaN sorts last there too.
are_medians() {
    [ -s jobs ]
    /usr/bin/python3 <<'PY'
import numpy as np
for line in open('jobs'):
    name, out, dtype, radius, pad = line.split()
    r = [int(n) for n in radius.split(',')][::-1]
    shape = tuple(int(n) for n in name.split('_')[1].split('x'))[::-1]
    v = np.fromfile(name, dtype).reshape(shape)
    pad, _, value = pad.partition(':')
    more = {'constant_values': np.array(float(value)).astype(dtype)} if value else {}
    p = np.pad(v, [(n, n) for n in r], pad, **more)
    w = np.lib.stride_tricks.sliding_window_view(p, [2 * n + 1 for n in r]).reshape(*shape, -1)
    want = np.sort(w, axis=-1)[..., w.shape[-1] // 2]
    got = np.fromfile(out, dtype).reshape(shape)
    assert np.array_equal(want, got, equal_nan=want.dtype.kind == 'f'), f'{line}: {(want != got).sum()} differ'
PY
    rm jobs
}

@test "all types are what sorting gives: networks, histograms, flat and long boxes" {
    for type in $all_types; do
        for radius in 1 2 3 1,1,0 0,3,1 5,0,0; do median v_13x11x7_$type.raw $type $radius symmetric; done
    done
    are_medians
}

@test "SciPy gives the same" {
    for radius in 1 2 4; do
        vkt filter median v_13x11x7_float32.raw --radius $radius --format raw -o m.raw --force
        /usr/bin/python3 -c "
import numpy as np
from scipy.ndimage import median_filter
v = np.fromfile('v_13x11x7_float32.raw', 'f4').reshape(7, 11, 13)
assert np.array_equal(median_filter(v, 2 * $radius + 1, mode='reflect'), np.fromfile('m.raw', 'f4').reshape(v.shape))"
    done
}

@test "NaN is larger than all numbers, of either sign, and infinities are numbers" {
    for type in float16 float32 float64; do
        for radius in 1 2 3 1,0,0; do median n_13x11x7_$type.raw $type $radius symmetric; done
    done
    # Most of the box: the result is NaN.
    /usr/bin/python3 -c "
import numpy as np
v = np.zeros((5, 5, 5), 'f4'); v[:, :, 2:] = -np.nan; v.tofile('h_5x5x5_float32.raw')"
    median h_5x5x5_float32.raw float32 1 edge --boundary clamp
    are_medians
}

@test "boundaries are NumPy's; border values are physical" {
    for pair in mirror=symmetric clamp=edge wrap=wrap border=constant:0 border:700=constant:700; do
        for radius in 1 2 3,2,4; do
            median v_13x11x7_int16.raw int16 $radius "${pair#*=}" --boundary "${pair%=*}"
        done
    done
    # A border beyond the type is as good as its end.
    median v_13x11x7_uint8.raw uint8 1 constant:255 --boundary border:1000
    are_medians
    vkt filter median v_13x11x7_int16.raw --boundary border:700 | vkt write - --format raw >a.raw
    vkt set v_13x11x7_int16.raw --slope 2 --intercept -100 | vkt filter median --boundary border:1300 | vkt write - --format raw >b.raw
    cmp a.raw b.raw
}

@test "tiny, thin and long volumes, and rows around the width of registers" {
    for dims in 1x1x1 1x1x9 9x1x1 2x3x1 31x2x2 32x2x2 33x2x2 63x3x2 64x2x3 65x1x5 129x3x1 1023x2x1 1024x1x2 1027x2x2; do
        for type in uint8 int16 float32 float64; do echo t_${dims}_$type.raw; done
    done >names
    /usr/bin/python3 -c "
import numpy as np
for name in open('names').read().split():
    dims, dtype = name.split('.')[0].split('_')[1:]
    x, y, z = (int(n) for n in dims.split('x'))
    (np.random.default_rng(3).random((z, y, x)) * 200).astype(dtype).tofile(name)"
    while read -r name; do
        type=${name##*_}
        for radius in 1 2 3; do median $name ${type%.raw} $radius symmetric; done
    done <names
    are_medians
}

@test "slabs, threads, memory, pipes and regions make no difference" {
    for type in uint8 float32; do
        for radius in 1 2 3 20,1,0; do
            same_however_run dtype=$type vkt filter median --radius $radius
        done
    done
    same_however_run dtype=int16 vkt filter median --radius 1 --boundary wrap
    same_however_run dtype=int16 vkt filter median --radius 1,4,2 --boundary border:3
}

@test "it commutes with mappings that keep the order, and a constant stays" {
    vkt filter median v_13x11x7_int16.raw --radius 2 | vkt arith mul - -1 | vkt write - --format raw >a.raw
    vkt arith mul v_13x11x7_int16.raw -1 | vkt filter median --radius 2 | vkt write - --format raw >b.raw
    cmp a.raw b.raw
    vkt make constant --dims 9 8 7 --dtype float32 --value 0.1 -o c.vkt
    vkt filter median c.vkt --radius 3 | vkt diff c.vkt
    vkt filter median v_13x11x7_float32.raw --radius 0 | vkt diff v_13x11x7_float32.raw
}

@test "what makes no sense is refused with a line that says what does" {
    fails_with 2 'is not in 0 to 64' vkt filter median v_13x11x7_uint8.raw --radius -1 -o o.vkt
    fails_with 2 'is not in 0 to 64' vkt filter median v_13x11x7_uint8.raw --radius 65 -o o.vkt
    fails_with 2 'X,Y,Z' vkt filter median v_13x11x7_uint8.raw --radius 1,2 -o o.vkt
    fails_with 2 'radius' vkt filter median v_13x11x7_uint8.raw --radius 1.5 -o o.vkt
    fails_with 2 'not a finite number' vkt filter median v_13x11x7_uint8.raw --boundary border:inf -o o.vkt
    fails_with 2 'roi' vkt filter median v_13x11x7_uint8.raw --roi 5:40,:,: -o o.vkt
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'structured volumes only' vkt filter median t.vkt --roi 0:4,:,: -o o.vkt
    [ ! -e o.vkt ]
}

@test "in a tree boxes count cells of each level; of one level the result is the grid's" {
    vkt make marschner-lobb --dims 16 16 16 | vkt refine --tolerance 0 --levels 1 -o t.vkt
    vkt filter median t.vkt --radius 1 | vkt resample --method nearest | vkt write - --format raw >a.raw
    vkt resample t.vkt --method nearest | vkt filter median --radius 1 | vkt write - --format raw >b.raw
    cmp a.raw b.raw
    vkt make amr --blocks 50 --levels 3 | vkt filter median --radius 2 --explain 2>plan | vkt info - >/dev/null
    grep -q 'selection network, 5x5x5' plan
}

@test "the plan names method and cost" {
    vkt filter median v_13x11x7_uint8.raw --radius 1 -n 2>plan >/dev/null -o x.vkt
    grep -q 'selection network, 3x3x3' plan
    vkt filter median v_13x11x7_uint8.raw --radius 3,3,0 -n 2>plan >/dev/null -o x.vkt
    grep -q 'sliding histogram of ranks, 7x7x1' plan
    fails_with 5 'budget' vkt filter median v_13x11x7_uint8.raw --radius 64 --memory 1M -o x.vkt
}
