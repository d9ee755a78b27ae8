# vkt project: reductions along an axis against NumPy, and exact rationals.
load helper

types='uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'

setup_more() {
    python_with numpy
    /usr/bin/python3 - <<'EOF'
import numpy as np
rng = np.random.default_rng(3)
for name in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    type_ = np.dtype(name)
    if type_.kind == "f":
        a = (rng.normal(0, 100, (7, 11, 13)) + 1000).astype(type_)
    else: # all of the type's range
        a = np.frombuffer(rng.bytes(7 * 11 * 13 * type_.itemsize), type_).reshape(7, 11, 13)
    a.tofile(f"v_13x11x7_{name}.raw")
    if type_.kind == "f":
        b = a.copy()
        b.flat[::5] = np.nan
        b[:, 2, 3] = b[1, :, 4] = b[2, 5, :] = np.nan
        b[0, 0, 1] = np.inf
        b[3, 3, 3] = -np.inf
        b.tofile(f"n_13x11x7_{name}.raw")
EOF
}

# project WHAT AXIS IN OPTIONS…: its bytes; what is said of NaN is no matter here.
project() {
    vkt project "$1" --axis "$2" "${@:3}" --format raw -o projected.$BASHPID --force 2>/dev/null || return
    cat projected.$BASHPID
}

@test "every type agrees with numpy, along every axis" {
    for type in $types; do
        for axis in x y z; do
            for what in max min mean sum std median; do project $what $axis v_13x11x7_$type.raw >$what.raw; done
            /usr/bin/python3 - $type $axis <<'EOF'
import sys
import numpy as np
from fractions import Fraction
name, axis = sys.argv[1], "zyx".index(sys.argv[2])
a = np.fromfile(f"v_13x11x7_{name}.raw", name).reshape(7, 11, 13)
read = lambda what, type_: np.fromfile(what + ".raw", type_)
floats = a.dtype.kind == "f"
wide = name in ("uint32", "int32", "uint64", "int64", "float64")
real = "float64" if wide else "float32"
for what in "max", "min":
    assert np.array_equal(read(what, name), getattr(a, what)(axis).ravel()), (name, axis, what)
exact = np.empty(a.shape, object)
exact.ravel()[:] = [Fraction(v) for v in a.ravel().tolist()]
lines = np.moveaxis(exact, axis, -1).reshape(-1, a.shape[axis])
for got, line in zip(read("mean", real), lines):
    want = sum(line) / len(line)
    scale = max(abs(v) for v in line)
    assert abs(Fraction(got.item()) - want) <= scale * Fraction(2.0 ** (-52 if wide else -24)) , (name, axis, "mean")
for got, line in zip(read("std", real), lines):
    mean = sum(line) / len(line)
    want = float(sum((v - mean) ** 2 for v in line) / len(line)) ** 0.5
    assert abs(got - want) <= (1e-14 if wide else 2e-7) * want, (name, axis, "std", got, want)
for got, line in zip(read("sum", "float64" if floats else "int64" if a.dtype.kind == "i" else "uint64"), lines):
    want = sum(line)
    if floats:
        assert abs(Fraction(got.item()) - want) <= sum(abs(v) for v in line) * Fraction(2.0 ** -50), (name, axis, "sum")
    else:
        low, high = (-2**63, 2**63 - 1) if a.dtype.kind == "i" else (0, 2**64 - 1)
        assert int(got) == min(max(want, low), high), (name, axis, "sum")
for got, line in zip(read("median", name), lines):
    line = sorted(line)
    n = len(line)
    want = (line[n // 2] + line[(n - 1) // 2]) / 2
    assert got == (round(want) if not floats else want), (name, axis, "median")
EOF
        done
    done
}

@test "medians of an even number of voxels: the middle of two, half to even" {
    for type in uint8 int8 uint64 int64 float16 float64; do
        vkt crop v_13x11x7_$type.raw --roi 0:12,0:10,0:6 -o even.vkt --force
        vkt write even.vkt - --format raw >even.raw
        for axis in x y z; do
            project median $axis even.vkt >median.raw
            /usr/bin/python3 - $type $axis <<'EOF'
import sys
import numpy as np
from fractions import Fraction
name, axis = sys.argv[1], "zyx".index(sys.argv[2])
a = np.fromfile("even.raw", name).reshape(6, 10, 12)
lines = np.sort(np.moveaxis(a, axis, -1).reshape(-1, a.shape[axis]), -1)
for got, line in zip(np.fromfile("median.raw", name), lines):
    n = len(line)
    want = (Fraction(line[n // 2].item()) + Fraction(line[n // 2 - 1].item())) / 2
    assert got == (np.dtype(name).type(float(want)) if a.dtype.kind == "f" else round(want)), (name, axis, got, want)
EOF
        done
    done
}

@test "long lines give the same along rows as across them, zeros with their signs" {
    for type in uint8 int16 int32 int64 float16 float32 float64; do
        /usr/bin/python3 - $type <<'EOF'
import sys
import numpy as np
rng = np.random.default_rng(5)
name = sys.argv[1]
a = rng.normal(0, 100, (5, 9, 203)).clip(-127, 127)
a = (np.abs(a) if name[0] == "u" else a).astype(name)
if a.dtype.kind == "f":
    a[0] = rng.choice([-0.0, 0.0, -1], a[0].shape)
    a[1] = rng.choice([-0.0, 0.0, 1], a[1].shape)
    a[2].flat[::7] = np.nan
    a[3, 4] = np.nan
a.tofile("long_203x9x5_%s.raw" % name)
EOF
        vkt permute yzx long_203x9x5_$type.raw -o upright.vkt --force
        for what in max min mean sum std median; do
            project $what x long_203x9x5_$type.raw >rows.raw
            project $what z upright.vkt >lines.raw
            /usr/bin/python3 -W ignore - $type $what <<'EOF'
import sys
import numpy as np
name, what = sys.argv[1:]
wide = name in ("int32", "int64", "float64")
real = "float64" if wide else "float32"
type_ = {"mean": real, "std": real, "sum": "float64" if name[0] == "f" else "uint64" if name[0] == "u" else "int64"}.get(what, name)
a = np.fromfile(f"long_203x9x5_{name}.raw", name).reshape(-1, 203)
rows, lines = np.fromfile("rows.raw", type_), np.fromfile("lines.raw", type_)
if what in ("max", "min", "median") or (what == "sum" and name[0] != "f"):
    assert rows.tobytes() == lines.tobytes(), (name, what)
else:
    assert np.allclose(rows, lines, rtol=1e-14 if wide or what == "sum" else 2e-7, atol=1e-10, equal_nan=True), (name, what)
want = getattr(np, "nan" + what)(a.astype(float), 1)
if name[0] == "f" and what == "sum":
    want[np.isnan(a).all(1)] = 0
if what == "median" and name[0] != "f":
    want = np.round(want)
assert np.allclose(rows, want, rtol=1e-3 if name == "float16" else 1e-6, atol=1e-6, equal_nan=True), (name, what)
EOF
        done
    done
}

@test "NaN is left out and counted, infinities are values" {
    for type in float16 float32 float64; do
        for axis in x y z; do
            for what in max min mean sum std median; do project $what $axis n_13x11x7_$type.raw >$what.raw; done
            /usr/bin/python3 -W ignore - $type $axis <<'EOF'
import sys
import numpy as np
name, axis = sys.argv[1], "zyx".index(sys.argv[2])
a = np.fromfile(f"n_13x11x7_{name}.raw", name).reshape(7, 11, 13)
d = a.astype(float)
real = "float64" if name == "float64" else "float32"
read = lambda what, type_: np.fromfile(what + ".raw", type_)
assert np.array_equal(read("max", name), np.nanmax(a, axis).ravel(), equal_nan=True)
assert np.array_equal(read("min", name), np.nanmin(a, axis).ravel(), equal_nan=True)
assert np.array_equal(read("median", name), np.nanmedian(d, axis).astype(name).ravel(), equal_nan=True)
for what, type_, want in ("mean", real, np.nanmean(d, axis)), ("sum", "float64", np.nansum(d, axis)), ("std", real, np.nanstd(d, axis)):
    assert np.allclose(read(what, type_), want.ravel(), rtol=1e-6, equal_nan=True), (name, axis, what)
EOF
        done
    done
    for what in max sum std median; do
        run --separate-stderr vkt project $what n_13x11x7_float32.raw --strict -o out.nrrd --force
        [ "$status" -eq 0 ]
        [[ "$stderr" == *" of 1001 voxels "*"not a number, left out"* ]]
    done
}

@test "wide slices with few odd voxels: every instruction set, slab and thread, along every axis" {
    # Slices of more than 16 KiB, and rows that no register divides; NaN and infinities in few places, and far apart.
    /usr/bin/python3 - <<'EOF'
import numpy as np
rng = np.random.default_rng(8)
for name in "uint8 int16 float16 float32 float64".split():
    a = rng.normal(0, 50, (21, 87, 149)).clip(0 if name == "uint8" else -127, 127).astype(name)
    if a.dtype.kind == "f":
        a[3, 5, 7] = a[20, 86, 148] = a[:, 40, 3] = np.nan
        a[6, 2, 140] = np.inf
        a[18, 60, 20] = -np.inf
        a[11, :, 33] = np.nan
    a.tofile(f"w_149x87x21_{name}.raw")
EOF
    for type in uint8 int16 float16 float32 float64; do
        for axis in x y z; do
            for what in max min mean sum std median; do
                project $what $axis w_149x87x21_$type.raw >$what.raw
                for set in baseline avx2; do
                    VKT_INSTRUCTION_SET=$set project $what $axis w_149x87x21_$type.raw --threads 3 --slab 5 |
                        cmp - $what.raw
                done
            done
            /usr/bin/python3 -W ignore - $type $axis <<'EOF'
import sys
import numpy as np
name, axis = sys.argv[1], "zyx".index(sys.argv[2])
a = np.fromfile(f"w_149x87x21_{name}.raw", name).reshape(21, 87, 149)
d = a.astype(float)
floats = a.dtype.kind == "f"
read = lambda what, type_: np.fromfile(what + ".raw", type_)
assert np.array_equal(read("max", name), np.nanmax(a, axis).ravel(), equal_nan=floats)
assert np.array_equal(read("min", name), np.nanmin(a, axis).ravel(), equal_nan=floats)
real = "float64" if name == "float64" else "float32"
whole = "float64" if floats else "int64" if a.dtype.kind == "i" else "uint64"
for what, type_, want in ("mean", real, np.nanmean(d, axis)), ("sum", whole, np.nansum(d, axis)), ("std", real, np.nanstd(d, axis)):
    assert np.allclose(read(what, type_), want.ravel(), rtol=1e-6, atol=1e-6, equal_nan=True), (name, axis, what)
EOF
        done
    done
    for what in max mean std; do
        for axis in x y z; do
            run --separate-stderr vkt project $what w_149x87x21_float32.raw --axis $axis -o out.nrrd --force
            [ "$status" -eq 0 ]
            [[ "$stderr" == *"110 of 272223 voxels "*"not a number, left out"* ]]
        done
    done
}

@test "slabs, threads, pipes, rows and small budgets make no difference" {
    for what in max mean std sum median; do
        for axis in x y z; do
            project $what $axis n_13x11x7_float64.raw >want.raw
            for options in '--slab 1' '--slab 3' '--slab 7' '--threads 1' '--threads 5' '--memory 100k'; do
                # shellcheck disable=SC2086
                project $what $axis n_13x11x7_float64.raw $options | cmp - want.raw
                # shellcheck disable=SC2086
                vkt read n_13x11x7_float64.raw --slab 2 | project $what $axis - $options | cmp - want.raw
            done
        done
    done
    vkt make noise --dims 640 304 30 --dtype uint16 --high 65535 --seed 3 -o large.nrrd # slices that come in pieces
    for axis in x y z; do
        project sum $axis large.nrrd >want.raw
        vkt read large.nrrd --memory 4M | project sum $axis - --memory 4M --threads 5 | cmp - want.raw
    done
}

@test "large offsets cost a deviation no digits; sums of floats are compensated" {
    /usr/bin/python3 -c "
import numpy as np
(1e9 + np.arange(1000) % 2).tofile('o_1x1x1000_float64.raw')
np.array([1, 1e100, 1, -1e100] * 100, float).tofile('c_1x1x400_float64.raw')"
    [ "$(project std z o_1x1x1000_float64.raw | od -An -tf8 | tr -d ' ')" = 0.5 ]
    [ "$(project sum z c_1x1x400_float64.raw | od -An -tf8 | tr -d ' ')" = 200 ]
    # Sums beyond 64 bits are said.
    vkt make constant --dims 1 1 3 --dtype uint64 --value 18446744073709551615 -o u.vkt
    fails_with 3 'beyond 64 bits' vkt project sum u.vkt --strict -o x.vkt
    [ ! -e x.vkt ]
}

@test "values are physical" {
    for map in '0.5 -3' '-2 100'; do
        # shellcheck disable=SC2086
        set -- $map
        vkt set v_13x11x7_int16.raw --slope "$1" --intercept "$2" -o mapped.nrrd --force
        for what in max min mean sum std median; do
            vkt project $what mapped.nrrd --axis y | vkt stats --json >$what.json
        done
        /usr/bin/python3 -c "
import json
import numpy as np
a = np.fromfile('v_13x11x7_int16.raw', np.int16).reshape(7, 11, 13).astype(float) * ($1) + ($2)
for what in 'max', 'min', 'mean', 'sum', 'std', 'median':
    want, got = getattr(np, what)(a, 1), json.load(open(what + '.json'))
    for key in 'min', 'max':
        assert np.isclose(got[key], getattr(want, key)(), rtol=1e-6), (what, key, got[key], getattr(want, key)())"
    done
}

@test "the slice lies in the middle of what it covers" {
    vkt set v_13x11x7_uint8.raw --spacing 0.5,1,2 --origin 10,20,30 -o s.nrrd
    vkt project max s.nrrd -o z.nrrd
    vkt info z.nrrd | grep -x 'dims       13 11 1'
    vkt info z.nrrd | grep -x 'spacing    0.5 1 14'
    vkt info z.nrrd | grep -x 'origin     10 20 36'
    vkt project max s.nrrd --axis x -o x.nrrd
    vkt info x.nrrd | grep -x 'dims       11 7 1'
    vkt info x.nrrd | grep -x 'spacing    1 2 6.5'
    vkt info x.nrrd | grep -x 'origin     13 20 30'
    vkt project mean s.nrrd --axis x | vkt info | grep -q float32
}

@test "a pipe is not spooled, but for medians" {
    mkdir spool
    export TMPDIR=$PWD/spool
    vkt make noise --dims 128 128 128 -o in.nrrd
    vkt read in.nrrd | vkt project mean --memory 300k -o out.nrrd 2>err
    [ ! -s err ] || { cat err >&2; false; }
    vkt project mean in.nrrd -n 2>plan | vkt info >/dev/null
    grep -q streaming plan
    vkt read in.nrrd | vkt project median --memory 300k -o median.nrrd 2>err
    grep -q spool err
}

@test "single voxels across change nothing" {
    vkt crop v_13x11x7_uint8.raw --roi :,:,3:4 -o one.nrrd
    for what in max min median; do vkt project $what one.nrrd | vkt diff - one.nrrd --geometry; done
    vkt project std one.nrrd | vkt stats --json | grep -q '"max": 0[.,]'
}

@test "what cannot be is refused" {
    fails_with 2 'not one of max' vkt project most v_13x11x7_uint8.raw -o x.nrrd
    fails_with 2 'WHAT' vkt project -o x.nrrd
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical' vkt project max t.vkt -o x.nrrd
    [ ! -e x.nrrd ]
}

@test "with --roi the image is that of the cropped volume" {
    vkt make noise --dims 23 19 17 --dtype float32 | vkt set --spacing 1,2,3 -o in.nrrd
    for what in max min mean sum std median; do
        for axis in x y z; do
            for region in 3:20,2:11,5:16 22:23,:,1:3 ::2,1::3,: 4:20:5,:,2::4; do
                vkt project $what in.nrrd --axis $axis --roi "$region" -o image.nrrd --force
                vkt crop in.nrrd --roi "$region" | vkt project $what --axis $axis | vkt diff - image.nrrd
                vkt read in.nrrd --slab 2 | vkt project $what --axis $axis --roi "$region" | vkt diff - image.nrrd
            done
        done
    done
    # What is gathered of steps is a part of a slab, whatever the budget.
    vkt make noise --dims 300 200 40 --dtype uint16 -o large.nrrd
    for memory in 1GiB 1MiB; do
        vkt project mean large.nrrd --axis x --roi 3::2,::3,1::7 --memory $memory -o image.nrrd --force
        vkt crop large.nrrd --roi 3::2,::3,1::7 | vkt project mean --axis x | vkt diff - image.nrrd
    done
    run -2 vkt project max in.nrrd --roi 0:24,:,:
}

@test "std of float64 of any magnitude: no square overflows or vanishes, whatever the slabs, as numpy's long double has it" {
    /usr/bin/python3 - <<'EOF'
import numpy as np
rng = np.random.default_rng(9)
base = rng.normal(size=(19, 23, 29))
powers = rng.integers(-1000, 1000, base.shape)
rising = np.sort(powers, None).reshape(base.shape)
mixed = np.ldexp(base, powers)
mixed[rng.random(base.shape) < 0.1] = np.nan
mixed[rng.random(base.shape) < 0.2] = 0
for name, a in {"one": base, "top": np.ldexp(base, 1021), "high": np.ldexp(base, 997), "low": np.ldexp(base, -997), "mixed": mixed,
                "rising": np.ldexp(base, rising), "falling": np.ldexp(base, rising[::-1, ::-1, ::-1]),
                "same": np.full(base.shape, 1e-300)}.items():
    a.tofile(name + "_29x23x19_float64.raw")
EOF
    for axis in x y z; do
        for name in one top high low mixed rising falling same; do
            project std $axis ${name}_29x23x19_float64.raw >$name.raw
            for slab in 1 4; do
                vkt read ${name}_29x23x19_float64.raw --slab $slab | project std $axis - --slab $slab --threads 3 | cmp - $name.raw
            done
        done
        /usr/bin/python3 - $axis <<'EOF'
import sys
import numpy as np
axis = "zyx".index(sys.argv[1])
read = lambda name: np.fromfile(name + ".raw")
for name in "one", "top", "high", "low", "mixed", "rising", "falling", "same":
    a = np.fromfile(name + "_29x23x19_float64.raw").reshape(19, 23, 29).astype(np.longdouble)
    want = np.nanstd(a, axis).ravel()
    assert np.all(np.abs(read(name) - want) <= (want if name != "same" else 1e-300) * 2e-15), (name, axis)
for name, k in ("top", 1021), ("high", 997), ("low", -997):
    assert np.array_equal(read(name), np.ldexp(read("one"), k)), (name, axis)
EOF
    done
}

@test "mean and sum of float64 near the largest numbers are those of smaller ones, to the bit, whatever the slabs" {
    /usr/bin/python3 - <<'EOF'
import numpy as np
v = np.random.default_rng(8).uniform(-3.9, 3.9, (19, 23, 29))
v = np.where(np.indices(v.shape).sum(0) % 8 < 4, 1, -1) * np.abs(v) # sums that overflow, and come back
v[3:9, 3:9, 3:9] = 3.9
v[12, 12, 12], v[12, 3, 15], v[2, 3, 15], v[14, 15, 16] = np.inf, -np.inf, np.inf, np.nan
for name, by in ("small", 0), ("large", 1022):
    np.ldexp(v, by).tofile(name + "_29x23x19_float64.raw")
np.full((5, 6, 7), np.finfo(float).max).tofile("most_7x6x5_float64.raw")
EOF
    for axis in x y z; do
        for what in mean sum; do
            project $what $axis small_29x23x19_float64.raw >small.raw
            for slab in 1 19; do
                vkt read large_29x23x19_float64.raw --slab $slab | project $what $axis - --slab $slab --threads 3 >large.raw
                /usr/bin/python3 - $what $axis <<'EOF'
import sys
import numpy as np
small, large = (np.fromfile(name + ".raw") for name in ("small", "large"))
with np.errstate(over="ignore"):
    want = np.ldexp(small, 1022)
assert np.isfinite(want).sum() > (50 if sys.argv[1] == "sum" else 200), sys.argv
assert np.array_equal(want, large, equal_nan=True), (sys.argv, (want != large).sum())
EOF
            done
        done
        project mean $axis most_7x6x5_float64.raw >most.raw
        /usr/bin/python3 -c "
import numpy as np
assert np.all(np.fromfile('most.raw') / np.finfo(float).max >= 1 - 2**-52) and np.isfinite(np.fromfile('most.raw')).all()"
    done
}
