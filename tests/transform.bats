# vkt transform: expressions against what numpy and scipy make of the same text, for every type, and however it is run.
load helper
load filters

setup_more() {
    make_volumes
    # Small numbers, so that whole results fit their types.
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(3)
for t in '$all_types'.split():
    for k in 'vab':
        d = np.dtype(t)
        a = r.normal(size=(7, 11, 13)) * 3 if d.kind == 'f' else r.integers(0 if d.kind == 'u' else -50, 100, (7, 11, 13))
        a.astype(d).tofile(f's{k}_13x11x7_{t}.raw')"
    cat >reference.py <<'EOF'
import functools, numpy as np, scipy.special
z, y, x = np.meshgrid(np.arange(7.0), np.arange(11.0), np.arange(13.0), indexing="ij")
names = {n: getattr(np, n) for n in "sin cos tan sinh cosh tanh exp exp2 log log2 log10 sqrt cbrt abs hypot floor ceil trunc fmod mod sign isnan isinf isfinite pi e".split()}
names.update(x=x, y=y, z=z, nx=13, ny=11, nz=7, wx=x, wy=y, wz=z, pow=np.power, round=np.rint, atan2=np.arctan2,
             asin=np.arcsin, acos=np.arccos, atan=np.arctan, clamp=np.clip, select=np.where,
             erf=scipy.special.erf, fract=lambda v: v - np.floor(v), lerp=lambda a, b, t: a + t * (b - a),
             xor=lambda a, b: (a != 0) ^ (b != 0), step=lambda edge, v: v >= edge, nan=np.nan, inf=np.inf,
             min=lambda *v: functools.reduce(np.minimum, v), max=lambda *v: functools.reduce(np.maximum, v))
# What Python writes otherwise.
python = {"v > a and a > b or not v < 3": "(v > a) & (a > b) | ~(v < 3)", "v > a ? b : x > 4 ? y : z": "select(v > a, b, select(x > 4, y, z))",
          "x > 3 || y < 2 && !z": "(x > 3) | (y < 2) & (z == 0)", "-v^2 + 2^3^2": "-v**2 + 2**3**2", "3 - -v - 1": "3 - (-v) - 1",
          "(v != v) == 0 and a": "(v == v) & (a != 0)"}
def load(name, dtype):
    return np.fromfile(name, dtype).reshape(7, 11, 13)
def evaluated(text, dtype, prefix="s", compute=np.float64):
    volumes = {k: load(f"{prefix}{k}_13x11x7_{dtype}.raw", dtype).astype(compute) for k in "vab"}
    with np.errstate(all="ignore"):
        return np.broadcast_to(eval(python.get(text, text), {**names, **volumes}), (7, 11, 13)).astype(np.float64)
EOF
}

# inputs TYPE TEXT: the volumes that the text names.
inputs() {
    echo "sv_13x11x7_$1.raw"
    # shellcheck disable=SC2001
    names=$(sed 's/[a-z][a-z0-9]\+/ /g' <<<"$2")
    [[ ! "$names" =~ [ab] ]] || echo "sa_13x11x7_$1.raw"
    [[ ! "$names" =~ b ]] || echo "sb_13x11x7_$1.raw"
}

expressions=('v * 2 + 1' 'v - a' 'v * a / b' '-v^2 + 2^3^2' '3 - -v - 1' 'v ** 0.5' 'sin(v / 10) * v' 'cos(v)' 'tan(v / 7)'
    'exp(v / 20)' 'log(abs(v) + 1)' 'log10(abs(v) * 10)' 'sqrt(abs(v))' 'pow(abs(v), 1.5)' 'min(v, a, b)' 'max(v, a, b, 3)'
    'clamp(v, 2, 9)' 'v > a and a > b or not v < 3' 'v > a ? b : x > 4 ? y : z' 'x > 3 || y < 2 && !z' 'hypot(v, a)'
    'atan2(v, a)' 'asin(v / 200)' 'acos(v / 200)' 'atan(v)' 'floor(v / 3)' 'ceil(v / 3)' 'round(v / 2)' 'trunc(v / 3)'
    'fmod(v, 7)' 'mod(v, 7)' 'fmod(v, a)' 'mod(v, -2.5)' 'sign(v)' 'step(3, v)' 'select(v > 1, a, b)' 'isnan(v / 0)'
    'isinf(v / 0)' 'x + y * nx + z * nx * ny' 'wx * 2 - wy / wz' 'v == a' 'v != a' 'v >= a' 'v <= 3' 'pi * v + e'
    '(v + a) * (v + a) + (v + a)' 'sinh(v / 30)' 'cosh(v / 30)' 'tanh(v / 30)' 'erf(v / 50)' 'exp2(v / 9)' 'log2(abs(v) + 1)' 'cbrt(v)'
    'fract(v / 3)' 'lerp(v, a, 0.25)' 'xor(v > 3, a > 3)' 'isfinite(v / 0)' 'abs(-v)' '1e-3 * .5 + 2.E1' '(v != v) == 0 and a')

@test "every function and operator agrees with numpy in float64, for every type" {
    for type in $all_types; do
        for text in "${expressions[@]}"; do
            # shellcheck disable=SC2046
            vkt transform " $text" $(inputs "$type" "$text") --dtype float64 --format raw -o out.raw --force 2>/dev/null
            echo "$type $text"
            mv out.raw "$type $(tr '/* ' '|%_' <<<"$text").out"
        done
    done >list
    /usr/bin/python3 - <<'EOF'
from reference import *
for line in open("list"):
    dtype, text = line.rstrip("\n").split(" ", 1)
    got = np.fromfile(f"{dtype} {text.translate(str.maketrans('/* ', '|%_'))}.out").reshape(7, 11, 13)
    want = evaluated(text, dtype)
    number = np.isfinite(want)
    assert np.array_equal(got[~number], want[~number], equal_nan=True), line
    off = np.abs(got - want)[number] / np.maximum(np.abs(want[number]), 1e-300)
    assert off.max(initial=0) <= 4 * 2**-52, (line, off.max() * 2**52)
EOF
}

@test "functions hold over their whole domains: tiny, huge, subnormal, at their ends" {
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(1)
special = [0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -5e-324, 1e-310, 2.3e-308, 1.7e308, -1.7e308, 1, -1, 709.7, 709.9,
           -745, -745.2, -708.5, 2**20, 2**20 + 1, -2**20, 2**21 * np.pi, 1e22, np.pi, np.pi / 2, 3 * np.pi / 4, 1e15]
v = np.concatenate([special, r.normal(size=2000) * 10.0 ** r.integers(-300, 300, 2000), r.normal(size=4000) * 1e3,
                    np.arange(1, 974) * np.pi / 2])
v[:7000].tofile('v_7000x1x1_float64.raw')"
    for name in sin cos tan exp log log10 sqrt atan; do
        vkt transform "$name(v)" v_7000x1x1_float64.raw --format raw -o $name.raw 2>/dev/null
        vkt transform "$name(v)" v_7000x1x1_float64.raw --dtype float32 --format raw -o ${name}_32.raw 2>/dev/null
    done
    /usr/bin/python3 - <<'EOF'
import numpy as np
v = np.fromfile("v_7000x1x1_float64.raw")
for name in "sin cos tan exp log log10 sqrt atan".split():
    with np.errstate(all="ignore"):
        want = getattr(np, {"atan": "arctan"}.get(name, name))(v)
    got = np.fromfile(name + ".raw")
    assert np.array_equal(np.isnan(got), np.isnan(want)), name
    assert np.array_equal(got[np.isinf(want)], want[np.isinf(want)]), name
    off = np.abs(got - want)[np.isfinite(want)] / np.spacing(np.abs(want[np.isfinite(want)]))
    assert off.max() <= 4, (name, off.max(), v[np.isfinite(want)][off.argmax()])
    with np.errstate(all="ignore"):
        single = got.astype(np.float32)
    assert np.array_equal(np.fromfile(name + "_32.raw", np.float32), single, equal_nan=True), name
EOF
}

@test "float32 is computed as numpy computes it, step by step" {
    for text in 'v * 2 + 1' 'v - a' 'v * a / b' '(v + a) * 0.1' 'v[1,0,0] - 2 * v + v[-1,0,0]' 'sqrt(abs(v)) / 3'; do
        # shellcheck disable=SC2046
        vkt transform "$text" $(inputs float32 "$text") --boundary wrap --format raw -o out.raw --force 2>/dev/null ||
            vkt transform "$text" $(inputs float32 "$text") --format raw -o out.raw --force
        /usr/bin/python3 - "$text" <<'EOF'
import sys
from reference import *
v, a, b = (load(f"s{k}_13x11x7_float32.raw", np.float32) for k in "vab")
text = sys.argv[1].replace("v[1,0,0]", "np.roll(v, -1, 2)").replace("v[-1,0,0]", "np.roll(v, 1, 2)")
want = eval(text, {**names, "np": np, "v": v, "a": a, "b": b})
assert want.dtype == np.float32
assert np.array_equal(load("out.raw", np.float32), want), text
EOF
    done
}

@test "whole numbers are exact: what leaves float32 is computed in float64" {
    for type in uint8 int8 uint16 int16; do
        for text in 'v * v - a * a' 'v * 7 - a * 5 + b' 'mod(v * a, 1000)' 'v^4 - v^3' '(v - a) * (v + a) - x * y'; do
            # Whatever comes out is stored in int64, which holds all that float64 holds below 2^53.
            vkt transform "$text" v_13x11x7_$type.raw v_13x11x7_$type.raw v_13x11x7_$type.raw --dtype int64 --format raw \
                -o out.raw --force 2>/dev/null || # without b, or without a
                vkt transform "$text" v_13x11x7_$type.raw v_13x11x7_$type.raw --dtype int64 --format raw -o out.raw --force 2>/dev/null ||
                vkt transform "$text" v_13x11x7_$type.raw --dtype int64 --format raw -o out.raw --force 2>/dev/null
            /usr/bin/python3 - $type "$text" <<'EOF'
import sys
from reference import *
v = load(f"v_13x11x7_{sys.argv[1]}.raw", sys.argv[1]).astype(object)
i = [q.astype(int).astype(object) for q in (x, y)]
want = eval(sys.argv[2].replace("^", "**"), {"v": v, "a": v, "b": v, "x": i[0], "y": i[1], "mod": lambda p, q: p % q})
got = load("out.raw", np.int64).astype(object)
small = np.vectorize(lambda p: abs(p) < 2**53)(v ** 4)
assert small.sum() > 100 and np.array_equal(got[small], want[small]), sys.argv
EOF
        done
    done
}

@test "the type of the result" {
    is() {
        local type="$1"
        shift
        vkt transform "$@" 2>/dev/null | vkt info --json | grep -q "\"dtype\": \"$type\"" || { echo "$type: $*" >&2; false; }
    }
    for type in $all_types; do is $type 'v * 2.5' sv_13x11x7_$type.raw; done
    is uint8 'v > 3' sv_13x11x7_float64.raw
    is uint8 'v > 3 ? 1 : 0' sv_13x11x7_float64.raw
    is uint8 'x' sv_13x11x7_float64.raw
    is int8 'x - 20' sv_13x11x7_float32.raw
    is uint16 'x * 100' sv_13x11x7_float32.raw
    is float64 'x / 2' sv_13x11x7_uint8.raw
    is float32 'sqrt(v)' sv_13x11x7_int16.raw
    is float64 'sqrt(v)' sv_13x11x7_int32.raw
    is int16 'v + a' sv_13x11x7_uint8.raw sv_13x11x7_int8.raw
    is uint8 'a > 3 ? v : 0' sv_13x11x7_uint8.raw sv_13x11x7_float64.raw
    is float16 'v > 3' sv_13x11x7_float64.raw --dtype float16
    is uint8 'sqrt(v)' sv_13x11x7_uint8.raw --roi 2:5,:,:
}

@test "neighbours, for every type and boundary, along every axis" {
    declare -A modes=([mirror]=reflect [clamp]=nearest [wrap]=wrap [border:3]=constant)
    for rule in mirror clamp wrap border:3; do
        for type in $all_types; do
            [ "$rule$type" = mirrorfloat32 ] || [[ "$type" =~ ^(uint8|int16|float64)$ ]] || [ $rule = wrap ] || continue
            vkt transform 'v[-2,0,0] + 2 * v[1,-1,0] - 3 * v[0,3,-2] + v[9,0,0] + v' sv_13x11x7_$type.raw --boundary $rule \
                --dtype float64 --format raw -o out.raw --force
            /usr/bin/python3 - $type ${modes[$rule]} <<'EOF'
import sys
from scipy.ndimage import correlate
from reference import *
w = np.zeros((19, 19, 19))
for weight, dx, dy, dz in (1, -2, 0, 0), (2, 1, -1, 0), (-3, 0, 3, -2), (1, 9, 0, 0), (1, 0, 0, 0):
    w[9 + dz, 9 + dy, 9 + dx] += weight
want = correlate(load(f"sv_13x11x7_{sys.argv[1]}.raw", sys.argv[1]).astype(float), w, mode=sys.argv[2], cval=3)
assert np.allclose(load("out.raw", float), want, rtol=0, atol=1e-12), sys.argv
EOF
        done
    done
    # Of several volumes, each at its own offsets; the default is mirror.
    vkt transform 'v[0,0,1] - a[1,0,0] * b' s{v,a,b}_13x11x7_float64.raw --format raw -o out.raw --force
    vkt transform 'v[0,0,1] - a[1,0,0] * b' s{v,a,b}_13x11x7_float64.raw --format raw -o mirror.raw --boundary mirror --slab 1
    cmp out.raw mirror.raw
    /usr/bin/python3 -c "
from reference import *
v, a, b = (np.pad(load(f's{k}_13x11x7_float64.raw', float), 1, 'symmetric') for k in 'vab')
assert np.array_equal(load('out.raw', float), v[2:, 1:-1, 1:-1] - a[1:-1, 1:-1, 2:] * b[1:-1, 1:-1, 1:-1])"
}

@test "positions lie in the world: oblique directions, spacing, origin" {
    vkt set sv_13x11x7_float32.raw --spacing 0.5,2,3 --origin -7,100,1e4 --direction 0.6,0.8,0,-0.8,0.6,0,0,0,1 -o w.vkt
    vkt transform 'wx + 1000 * wy + 1e6 * wz' w.vkt --format raw -o out.raw
    /usr/bin/python3 -c "
from reference import *
d = np.array([[.6, -.8, 0], [.8, .6, 0], [0, 0, 1]])
w = np.tensordot(d * [.5, 2, 3], np.stack([x, y, z]), 1) + np.array([-7, 100, 1e4])[:, None, None, None]
assert np.allclose(load('out.raw', float), w[0] + 1000 * w[1] + 1e6 * w[2], rtol=1e-15)"
}

@test "values are physical, and keep their map where they come from one" {
    vkt set sv_13x11x7_int16.raw --slope 0.5 --intercept 10 --units HU -o m.vkt
    vkt transform 'v * 2 - 10' m.vkt -o out.vkt
    vkt arith mul sv_13x11x7_int16.raw 2 | vkt arith add - 0 -o stored.vkt # 2 (s/2 + 10) - 10 = (2 s) / 2 + 10
    vkt write out.vkt - --format raw | cmp - <(vkt write stored.vkt - --format raw)
    vkt info --json out.vkt | grep -q '"slope": 0.5'
    vkt info --json out.vkt | grep -q '"units": "HU"'
    vkt transform 'sqrt(v + 100)' m.vkt -o root.vkt
    vkt info --json root.vkt | grep -q '"slope": 1.0'
    vkt write root.vkt - --format raw >root.raw
    /usr/bin/python3 -c "
from reference import *
v = load('sv_13x11x7_int16.raw', np.int16) * .5 + 10
assert np.array_equal(load('root.raw', np.float32), np.sqrt(v + 100).astype(np.float32))"
    vkt transform 'v + a' m.vkt sv_13x11x7_int16.raw | vkt info --json | grep -q '"dtype": "float32"'
}

@test "slabs, threads, memory, pipes, files and regions give the same" {
    same_transform() { vkt transform 'sin(v) * x + mod(v, 3)' "$@"; }
    same_however_run dtype=float32 same_transform
    same_transform() { vkt transform 'v * 2 + exp(y / 10)' "$@"; }
    same_however_run dtype=float64 same_transform --dtype float64
    same_transform() { vkt transform 'v[1,2,-3] / 2 + v[-1,0,2] / 3 + tan(wx) * z' "$@"; }
    same_however_run dtype=int16 same_transform --boundary wrap --dtype int16
    # Whatever the length of the rows, and where in them a value stands.
    vkt make noise --dims 2100 1 1 --dtype float32 --high 9 -o n.vkt
    text='sin(v) + cos(v) * exp(-v) + log(v) + tan(v) + fmod(v, 0.7)'
    vkt transform "$text" n.vkt -o whole.vkt
    for first in 1 7 511 513 1030; do
        vkt crop n.vkt --roi $first:,:,: | vkt transform "$text" | vkt write - --format raw >part.raw
        vkt crop whole.vkt --roi $first:,:,: | vkt write - --format raw | cmp - part.raw
    done
}

@test "what is lost is said: clipped, not a number, undefined, beyond 53 bits" {
    fails_with 3 'clipped to [0,255]' vkt transform 'v * 100' sv_13x11x7_uint8.raw --strict -o o.vkt
    fails_with 3 'not a number, stored as 0' vkt transform '(v - v) / (v - v)' sv_13x11x7_uint8.raw --strict -o o.vkt
    fails_with 3 'undefined' vkt transform 'sqrt(-1 - abs(v))' sv_13x11x7_float32.raw --strict -o o.vkt
    fails_with 3 'undefined' vkt transform '1 / (v - v)' sv_13x11x7_float64.raw --strict -o o.vkt
    fails_with 3 'infinite beyond' vkt transform 'v * 1e300' sv_13x11x7_float64.raw --dtype float32 --strict -o o.vkt
    /usr/bin/python3 -c "
import numpy as np
np.array([2**53 + 1, 5, -2**60], np.int64).tofile('i_3x1x1_int64.raw')
np.array([np.nan, np.inf, 1, -1], np.float32).tofile('f_4x1x1_float32.raw')"
    run --separate-stderr vkt transform 'v + 1' i_3x1x1_int64.raw -o o.vkt
    [[ "$stderr" == *"2 of 3 voxels (66.67 %) of 2^53 or more"*"vkt arith is exact"* ]]
    # What is not finite already is not made so, and who says nan means it.
    run --separate-stderr vkt transform 'log(v)' f_4x1x1_float32.raw -o l.vkt
    [[ "$stderr" == *"1 of 4 voxels"*undefined* ]]
    vkt transform 'v > 0 ? v : nan' f_4x1x1_float32.raw --strict -o n.vkt
    vkt transform 'v + 1' f_4x1x1_float32.raw --strict -o p.vkt
}

@test "trees: pointwise cell by cell, neighbours level by level" {
    grid() { vkt resample --scale 1 --method nearest; }
    vkt make amr --blocks 50 --levels 3 -o t.vkt
    vkt transform 'v * 2 + 1' t.vkt | grid | vkt diff - <(vkt arith mul t.vkt 2 | vkt arith add - 1 | grid)
    vkt arith mul t.vkt 3 -o three.vkt
    vkt transform 'a - v' t.vkt three.vkt | grid | vkt diff - <(vkt arith sub three.vkt t.vkt | grid)
    # Positions are those of centres, in finest cells and in the world.
    vkt set t.vkt --spacing 2,2,2 --origin 5,6,7 -o w.vkt
    vkt transform 'wx - (2 * x + 5)' w.vkt | vkt stats --json | grep -q '"max": 0,'
    vkt transform 'x' t.vkt | grid | vkt write - x.nrrd
    dims=$(vkt info x.nrrd --json | /usr/bin/python3 -c 'import json, sys; print(*json.load(sys.stdin)["dims"])')
    vkt write x.nrrd x.raw --format raw
    /usr/bin/python3 - $dims <<'EOF'
import sys, numpy as np
n = [int(d) for d in sys.argv[1:]]
raw = np.fromfile("x.raw", np.float64).reshape(n[::-1])
off = raw - np.arange(n[0])
assert set(np.unique(off)) >= {-0.5, 0.5} and set(np.unique(off)) <= {0, .5, -.5, 1.5, -1.5}, np.unique(off)
EOF
    # One level: what the grid gives.
    vkt make amr --blocks 8 --levels 1 -o one.vkt
    grid <one.vkt >grid.vkt
    for text in 'v[1,0,0] - v[0,-2,1] + x * z' 'v * wx + y'; do
        vkt transform "$text" one.vkt | grid >a.vkt
        vkt transform "$text" grid.vkt | vkt diff - a.vkt
    done
    vkt transform '0' t.vkt --roi 3:20,:,: | grid | vkt diff - <(vkt fill t.vkt --value 0 --roi 3:20,:,: | grid)
    fails_with 2 'nx, ny and nz beside neighbours' vkt transform 'v[1,0,0] * nx' t.vkt -o o.vkt
    fails_with 2 'structured volumes only' vkt transform 'v[1,0,0]' t.vkt --roi 3:20,:,: -o o.vkt
    fails_with 2 'it takes several inputs' vkt transform 'v[1,0,0] - a' t.vkt t.vkt -o o.vkt
}

@test "mistakes are pointed at" {
    local v=sv_13x11x7_uint8.raw
    wrong() { fails_with 2 "$2" vkt transform "$1" $v -o o.vkt && { [ -z "${3:-}" ] || [[ "$stderr" == *"$3"* ]]; }; }
    wrong 'v +' "column 4, at the end: a value"
    wrong 'v + floo(x)' "column 5, at 'floo'" "did you mean 'floor'"
    wrong 'V * 2' "column 1, at 'V'" "did you mean 'v'"
    wrong 'é + v' "column 1, at 'é'"
    wrong "v$(printf '\n\t')+ é" "column 6, at 'é'"
    wrong 'sin' 'in parentheses'
    wrong 'sin(1, 2)' 'takes 1 argument, not 2'
    wrong 'min(v)' 'takes 2 or more'
    wrong 'clamp()' 'takes 3 arguments, not 0'
    wrong 'v(3)' "column 2" 'said with *'
    wrong '2v' "column 2" 'said with *'
    wrong 'x[1,2,3]' 'only these have neighbours'
    wrong 'v[1,2]' "',' is expected"
    wrong 'v[1.5,0,0]' 'whole number'
    wrong 'v[x,0,0]' 'whole number'
    wrong 'v[129,0,0]' 'at most 128'
    wrong '' 'is empty'
    wrong 'v % 2' 'column 3' 'mod(a, b)'
    wrong 'v = 2' 'column 3' '== compares'
    wrong 'v < x < 3' 'do not chain'
    wrong '1.2.3' 'not a number'
    wrong '(v' "')' is expected"
    wrong 'v ? 1' "':' is expected"
    wrong "$(printf '(%.0s' {1..200})v" 'nested more than'
    wrong " $(printf -- '- %.0s' {1..300})v" 'nested more than'
    wrong "$(printf 'v+%.0s' {1..9000})v" 'more than 16384 characters'
    wrong "v$(printf '*%d' {2..4200} | cut -c1-16000)" 'different parts'
    fails_with 3 'no volume on standard input' vkt transform 'v + a' $v -o o.vkt </dev/null
    fails_with 2 'names 1 volume; 2 are given' vkt transform v $v $v -o o.vkt
    fails_with 2 'looks at no neighbours' vkt transform v $v --boundary clamp -o o.vkt
    fails_with 2 'differ in size' vkt transform 'v + a' $v <(vkt crop $v --roi 1:,:,:) -o o.vkt
    fails_with 2 'different places' vkt transform 'v + a' $v <(vkt set $v --origin 1,2,3) -o o.vkt
    fails_with 2 'no voxel of a uint8' vkt transform 'v[1,0,0]' $v --boundary border:-1 -o o.vkt
    [ ! -e o.vkt ]
    vkt transform ' -v' sv_13x11x7_int8.raw | vkt diff - <(vkt arith neg sv_13x11x7_int8.raw)
}

@test "the pipe is the first volume, and histories say so" {
    vkt read sv_13x11x7_float32.raw | vkt transform 'v - a' sa_13x11x7_float32.raw -o d.vkt
    vkt transform 'v - a' sv_13x11x7_float32.raw sa_13x11x7_float32.raw | vkt diff - d.vkt
    vkt history d.vkt --as-shell >again.sh
    grep -q 'vkt transform .*v - a' again.sh
}

@test "neighbours however far along z come from a stream as from a file, in slabs of any height" {
    vkt make noise --dims 9 8 60 --seed 5 --dtype int16 --low -900 --high 900 -o n.nrrd
    vkt convert n.nrrd -o packed.nrrd --compress
    for expression in 'v[0,0,17]' 'v[0,0,40]-v[0,0,-2]' 'v[0,0,-20]' 'v[0,0,-128]+v[1,0,3]' 'v[1,2,128]'; do
        for rule in mirror clamp border:7; do
            vkt transform "$expression" n.nrrd --boundary $rule --slab 60 -o whole.nrrd --force
            for slab in 1 8 25; do
                vkt read n.nrrd | vkt transform "$expression" --boundary $rule --slab $slab -o a.nrrd --force
                vkt diff a.nrrd whole.nrrd >/dev/null
            done
            vkt transform "$expression" packed.nrrd --boundary $rule --slab 4 | vkt diff - whole.nrrd >/dev/null
        done
    done
}
