# vkt arith: saturation, rounding, promotions, division by zero; NumPy as oracle.
load helper

raw() { vkt write - --format raw; }
check() {
    python_with numpy
    /usr/bin/python3 -c "import numpy as np, json
$1"
}
# one DTYPE VALUE: a volume of one value.
one() { vkt make constant --dims 2 1 1 --dtype "$1" --value "$2"; }
# value: the first voxel of the volume on standard input.
value() { vkt stats --json | sed -n 's/.*"max": \(.*\),/\1/p'; }

@test "integers saturate" {
    [ "$(one uint8 200 | vkt arith add - 100 -q | value)" = 255 ]
    [ "$(one uint8 3 | vkt arith sub - 5 -q | value)" = 0 ]
    [ "$(one int8 -128 | vkt arith sub - 1 -q | value)" = -128 ]
    [ "$(one uint16 65535 | vkt arith mul - <(one uint16 65535) -q | value)" = 65535 ]
    [ "$(one int32 -2147483648 | vkt arith div - -1 -q | value)" = 2147483647 ]
    [ "$(one int64 9223372036854774784 | vkt arith add - 9223372036854774784 -q | value)" = 9223372036854775807 ]
    [ "$(one uint8 7 | vkt arith div - 2 | value)" = 4 ]
    [ "$(one uint8 5 | vkt arith div - 2 | value)" = 2 ]
    [ "$(one int64 -7 | vkt arith div - 2 | value)" = -4 ]
}

@test "64-bit integers and whole numbers are combined exactly" {
    one int64 0 | vkt fill --value 9007199254740993 -o odd.vkt
    [ "$(vkt arith add odd.vkt 9007199254740993 | value)" = 18014398509481986 ]
    [ "$(vkt arith sub odd.vkt 9007199254740992 | value)" = 1 ]
    [ "$(vkt arith sub 18446744073709551615 odd.vkt --dtype uint64 --strict | value)" = 18437736874454810622 ]
    [ "$(vkt arith min odd.vkt 1e20 --strict | value)" = 9007199254740993 ]
}

@test "division by zero" {
    one uint8 5 | vkt arith div - 0 2>remark >out
    [ "$(value <out)" = 255 ]
    grep -q '2 of 2 voxels (100.00 %) divided by zero' remark
    run ! grep -q clipped remark
    [ "$(one uint8 0 | vkt arith div - 0 -q | value)" = 0 ]
    [ "$(one int16 -5 | vkt arith div - 0 -q | value)" = -32768 ]
    [ "$(one int64 -5 | vkt arith div - 0 -q | value)" = -9223372036854775808 ]
    one float32 5 | vkt arith div - 0 | vkt stats --json | grep -q '"inf": 2,'
    one float32 0 | vkt arith div - 0 | vkt stats --json | grep -q '"nan": 2,'
}

@test "all operations on all types agree with exact arithmetic" {
    for dtype in uint8 int8 uint16 int16 uint32 int32 uint64 int64; do
        vkt make noise --dims 13 7 5 --dtype $dtype --seed 1 -o a.$dtype.vkt --force
        vkt make noise --dims 13 7 5 --dtype $dtype --seed 2 -o b.$dtype.vkt --force
        for op in add sub mul div min max; do
            vkt arith $op a.$dtype.vkt b.$dtype.vkt -q -o $op.$dtype.raw
        done
        vkt read a.$dtype.vkt | raw >a.$dtype.raw
        vkt read b.$dtype.vkt | raw >b.$dtype.raw
    done
    check 'from fractions import Fraction
import operator
def div(a, b): return round(Fraction(a, b)) if b else (2**200 if a > 0 else -2**200 if a < 0 else 0)
ops = dict(add=operator.add, sub=operator.sub, mul=operator.mul, div=div, min=min, max=max)
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64".split():
    a, b = (np.fromfile(f"{n}.{t}.raw", t).tolist() for n in "ab"); i = np.iinfo(t)
    for name, f in ops.items():
        want = [min(max(f(u, v), int(i.min)), int(i.max)) for u, v in zip(a, b)]
        assert np.fromfile(f"{name}.{t}.raw", t).tolist() == want, (t, name)'
}

# exactly.py: what real arithmetic gives, rounded once, of the values in exactly.json; values(type): those that are hard.
exactly() {
    cat >exactly.py <<'PYTHON'
import math
from fractions import Fraction
import numpy as np
TYPES = "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split()
DIGITS = dict(float16=(11, -24), float32=(24, -149), float64=(53, -1074))
OPS = "add sub mul div min max".split()

def values(t):
    if t in DIGITS:
        i = np.finfo(t)
        some = [0, -0.0, 0.5, 1, 1.5, 2.5, -0.5, -3.5, 1e-8, 1 / 3, 7, 100.25, 254.5, 255.5, 2049, 65504, 65519, 2**24 + 2, -2**31 - 0.5,
                2**31 - 0.5, 2**32 - 0.5, 2.0**51 + 0.5, 2.0**53 - 1, 2.0**53 + 2, 2.0**63, 2.0**64, 1e30, 1 + 2**-10, 1 + 2**-23, 1 + 2**-52,
                2**-24 + 2**-60, 2.0**-149, 3 * 2.0**-150, 2.0**-1074, i.tiny, i.eps, i.max, -i.max, np.inf, -np.inf, np.nan]
    else:
        i = np.iinfo(t)
        some = [0, 1, 2, 3, 5, 7, 100, 127, 255, 1000, 2049, 4097, 65535, 2**24 + 1, 2**24 + 3, 2**31 - 1, 2**32 - 1, 2**52 + 1, 2**53 - 1,
                2**53 + 1, 2**54 + 2, 2**60 + 129, 2**62 - 1, 2**63 - 1, 2**63 + 1025, -1, -2, -7, -129, -2**31, -2**53 - 1, -2**62 - 511,
                int(i.min), int(i.max), int(i.max) - 1]
        some = [v for v in some if i.min <= v <= i.max]
    with np.errstate(over="ignore"):
        return np.unique(np.array(some, t))

def to_type(x, t):
    """The Fraction or special double x as t, rounded once."""
    if t in DIGITS:
        if not isinstance(x, Fraction): return float(x)
        if x == 0: return 0.0
        digits, least = DIGITS[t]
        exponent = abs(x.numerator).bit_length() - x.denominator.bit_length()
        if abs(x) < Fraction(2) ** exponent: exponent -= 1
        unit = Fraction(2) ** max(exponent - digits + 1, least)
        result = round(x / unit) * unit
        return (math.inf if x > 0 else -math.inf) if abs(result) > Fraction(float(np.finfo(t).max)) else float(result)
    i = np.iinfo(t)
    if not isinstance(x, Fraction):
        if math.isnan(x): return 0
        if math.isinf(x): return int(i.max) if x > 0 else int(i.min)
        x = Fraction(x)
    return min(max(round(x), int(i.min)), int(i.max))

def exactly(op, a, b, integers, t):
    """a and b are integers, floats or Fractions; integers: the types of operands and result."""
    fa, fb = (float(v) if not isinstance(v, float) else v for v in (a, b))
    special = not (math.isfinite(fa) and math.isfinite(fb))
    if op in ("min", "max"):
        if special: x = a if math.isnan(fa) or (not math.isnan(fb) and (fa < fb if op == "min" else fa > fb)) else b
        else: x = min(a, b) if op == "min" else max(a, b)
        return to_type(Fraction(x) if not isinstance(x, float) or math.isfinite(x) else x, t)
    if op == "div" and fb == 0 and integers:
        i = np.iinfo(t)
        return 0 if a == 0 else int(i.max) if a > 0 else int(i.min)
    if special or (op == "div" and fb == 0):
        with np.errstate(all="ignore"):
            x = float(getattr(np, dict(add="add", sub="subtract", mul="multiply", div="divide")[op])(fa, fb))
        return to_type(x, t)
    a, b = Fraction(a), Fraction(b)
    return to_type(dict(add=a + b, sub=a - b, mul=a * b).get(op) if op != "div" else a / b, t)

def same(got, want):
    return got == want or (got != got and want != want)
PYTHON
}

@test "every pair of types is combined as in real arithmetic, rounded once" {
    exactly
    check 'from exactly import *
n = 0
for i, ta in enumerate(TYPES):
    for j, tb in enumerate(TYPES):
        a, b = np.meshgrid(values(ta), values(tb))
        dims = f"{a.shape[1]}x{a.shape[0]}x1"
        a.tofile(f"a{i}_{j}_{dims}_{ta}.raw"); b.tofile(f"b{i}_{j}_{dims}_{tb}.raw")
        for op in OPS: # every pair of types with every operation, and every type of the result with most of them
            t = TYPES[(i + 3 * j + 2 * OPS.index(op)) % 11]
            print(op, f"a{i}_{j}_{dims}_{ta}.raw", f"b{i}_{j}_{dims}_{tb}.raw", t)' >runs
    while read -r op a b t; do
        vkt arith $op $a $b --dtype $t -q -o $op.$a.$t.raw
    done <runs
    check 'from exactly import *
wrong = set()
for line in open("runs"):
    op, a, b, t = line.split()
    ta, tb = (n[:-4].rsplit("_", 1)[1] for n in (a, b))
    u, v, got = np.fromfile(a, ta).tolist(), np.fromfile(b, tb).tolist(), np.fromfile(f"{op}.{a}.{t}.raw", t).tolist()
    integers = not any(x in DIGITS for x in (ta, tb, t))
    for x, y, z in zip(u, v, got):
        want = exactly(op, x, y, integers, t)
        if not same(z, want): wrong.add((op, ta, tb, t, x, y, z, want))
assert not wrong, (len(wrong), sorted(wrong, key=str)[:20])'
}

@test "numbers too, as long as double or 64 bits hold them" {
    exactly
    numbers="0.5 0.1 -3 9007199254740993 18446744073709551615 1e-8 1e300"
    for t in uint8 int32 uint64 float16 float32; do
        check "from exactly import *
v = values('$t'); v.tofile(f'v_{len(v)}x1x1_$t.raw')"
        for op in add mul div min; do
            for number in $numbers; do
                for out in uint8 int64 float32; do
                    echo $op $number $t $out
                    vkt arith $op v_*_$t.raw $number --dtype $out -q -o $op.$number.$t.$out.raw
                done
            done
        done
    done >runs
    check 'from exactly import *
import glob
wrong = set()
for line in open("runs"):
    op, number, t, out = line.split()
    b = Fraction(int(number)) if number.lstrip("-").isdigit() else Fraction(float(number))
    integers = not (t in DIGITS or out in DIGITS)
    v, got = np.fromfile(glob.glob(f"v_*_{t}.raw")[0], t).tolist(), np.fromfile(f"{op}.{number}.{t}.{out}.raw", out).tolist()
    for x, z in zip(v, got):
        want = exactly(op, x, b, integers, out)
        if not same(z, want): wrong.add((op, number, t, out, x, z, want))
assert not wrong, (len(wrong), sorted(wrong, key=str)[:20])'
}

@test "what goes through value maps is said to be an estimate, all else to be exact" {
    one uint8 3 | vkt arith add - 0.5 --dtype float32 --explain 2>&1 >out | grep -q 'exact,'
    one int64 3 | vkt arith add - 0.5 --explain 2>&1 >out | grep -q 'exact,'
    one int16 3 | vkt set --slope 0.1 | vkt arith add - 0.5 --explain 2>&1 >out | grep -q 'error about 1e-15'
}

@test "floats agree with numpy bit for bit" {
    for dtype in float32 float64; do
        vkt make noise --dims 13 7 5 --dtype $dtype --low -1 --seed 1 | tee a | raw >a.$dtype
        vkt make noise --dims 13 7 5 --dtype $dtype --low -1 --seed 2 | tee b | raw >b.$dtype
        for op in add sub mul div min max; do vkt arith $op a b | raw >$op.$dtype; done
    done
    check 'f = dict(add=np.add, sub=np.subtract, mul=np.multiply, div=np.divide, min=np.minimum, max=np.maximum)
for t in ("float32", "float64"):
    for n, g in f.items(): assert (np.fromfile(f"{n}.{t}", t) == g(np.fromfile("a." + t, t), np.fromfile("b." + t, t))).all()'
}

@test "types of results" {
    type_of() { vkt arith add <(one $1 1) <(one $2 1) ${3:+--dtype $3} | vkt info --json | sed -n 's/.*"dtype": "\(.*\)".*/\1/p'; }
    [ "$(type_of uint8 uint8)" = uint8 ]
    [ "$(type_of uint8 int8)" = int16 ]
    [ "$(type_of uint16 int8)" = int32 ]
    [ "$(type_of uint32 int32)" = int64 ]
    [ "$(type_of uint64 int8)" = int64 ]
    [ "$(type_of float32 uint16)" = float32 ]
    [ "$(type_of float32 int32)" = float64 ]
    [ "$(type_of float16 uint8)" = float16 ]
    [ "$(type_of uint8 uint8 float32)" = float32 ]
}

@test "value maps" {
    # values are physical: equal maps are kept, of different ones floats are made
    vkt declare-sv --dims 2 2 2 --data-format uint8 | vkt arith add - 0.2 -o a.vkt
    [ "$(value <a.vkt)" = 0.2 ]
    vkt arith add a.vkt <(vkt set a.vkt --units x) | vkt stats --json | grep -q '"max": 0.4'
    vkt arith add a.vkt <(vkt make constant --dims 2 2 2 --value 3) >sum.vkt
    vkt info sum.vkt --json | grep -q '"slope": 1.0'
    [ "$(value <sum.vkt)" = 3.2 ] || [ "$(value <sum.vkt | cut -c1-8)" = 3.200000 ]
}

@test "volumes with equal value maps are combined as what they mean" {
    check 'import subprocess
def run(*words, data=None): return subprocess.run(words, input=data, stdout=subprocess.PIPE, check=True).stdout
draw = np.random.default_rng(1)
for slope, intercept in (1, -1024), (-0.5, 3), (-2, 0), (0.25, 0):
    for dtype in "int16", "uint8", "int64", "float32":
        stored = [draw.integers(0, 9, 64).astype(dtype) for _ in range(2)]
        for name, voxels in zip("ab", stored):
            voxels.tofile(name)
            stream = run("vkt", "read", name, "--dims", "4", "4", "4", "--dtype", dtype)
            stream = run("vkt", "set", "--slope", str(slope), "--intercept", str(intercept), data=stream)
            open(name + ".vkt", "wb").write(stream)
        a, b = (slope * voxels.astype("f8") + intercept for voxels in stored)
        for op, want in dict(add=a + b, sub=a - b, mul=a * b, absdiff=abs(a - b), min=np.minimum(a, b),
                             max=np.maximum(a, b), gt=a > b, ge=a >= b, lt=a < b, le=a <= b, eq=a == b).items():
            stream = run("vkt", "arith", op, "a.vkt", "b.vkt", "-q")
            header = json.loads(run("vkt", "info", "--json", data=stream))
            got = np.frombuffer(run("vkt", "write", "-", "--format", "raw", data=stream), header["dtype"])
            at_most = 0
            if header["dtype"] == dtype and op not in ("gt", "ge", "lt", "le", "eq"): # kept, and so is the map
                assert (header["slope"], header["intercept"]) == (slope, intercept)
                if dtype != "float32":
                    kind = np.iinfo(dtype)
                    ends = sorted((slope * kind.min + intercept, slope * kind.max + intercept))
                    want, at_most = np.clip(want, *ends), abs(slope) / 2
            else: assert header["dtype"] == "uint8" and header["slope"] == 1
            assert (abs(header["slope"] * got + header["intercept"] - want) <= at_most).all(), (op, dtype, slope)'
    one int16 30 | vkt set --slope 1 --intercept -1024 --units HU -o ct.vkt
    vkt arith sub ct.vkt ct.vkt | vkt info | grep -q 'exact'
    [ "$(vkt arith absdiff ct.vkt ct.vkt | value)" = 0 ]
}

@test "where takes what values mean, and looks at what the mask means" {
    one uint8 10 | vkt set --slope 3 --intercept 6 -o a.vkt # 36
    one int16 5 | vkt set --slope -2 -o b.vkt               # -10
    one uint8 1 | vkt set --slope 1 --intercept -1 -o none.vkt
    vkt arith eq a.vkt 36 -o yes.vkt
    [ "$(vkt arith where yes.vkt a.vkt b.vkt | value)" = 36 ]
    [ "$(vkt arith where none.vkt a.vkt b.vkt | value)" = -10 ]
    [ "$(vkt arith where none.vkt a.vkt 7 | value)" = 6 ] # 7 under a's map, rounded
    [ "$(vkt arith where none.vkt 3 4 | value)" = 4 ]
    [ "$(vkt arith where yes.vkt 6 b.vkt | value)" = 6 ]
    [ "$(vkt arith where yes.vkt a.vkt b.vkt --roi 0:1,:,: --dtype float64 | value)" = 36 ]
}

@test "where takes integers of 64 bits as they are, whatever the mask is made of" {
    /usr/bin/python3 - <<'END'
import subprocess, numpy as np
rng = np.random.default_rng(6)
shape = (5, 7, 67)
a = rng.integers(-2**62, 2**62, shape) * 2 + 1
b = rng.integers(2**63, 2**64, shape, dtype="u8") | np.uint64(1)
np.save("a.npy", a); np.save("b.npy", b); np.save("minus.npy", -a)
mask = rng.integers(0, 3, shape)
big = 1152921504606846999
def vkt(*words): return subprocess.check_output(["vkt", *words, "-q"])
masks = {}
for dtype in "uint8 int16 int64 float16 float32 float64".split():
    np.save("m.npy", mask.astype(dtype))
    vkt("write", "m.npy", f"m_{dtype}.vkt")
    vkt("set", "m.npy", "--slope", "2", "--intercept", "-2", "-o", f"mapped_{dtype}.vkt")
    masks[f"m_{dtype}"], masks[f"mapped_{dtype}"] = mask != 0, mask != 1
odd = np.where(mask == 0, 0, np.where(mask == 1, 0.25, np.nan)).astype("f4") # what integers would take for 0
np.save("odd.npy", odd); vkt("write", "odd.npy", "odd.vkt")
masks["odd"] = mask != 0
for name, is_set in masks.items():
    for words, want in ((["a.npy", "minus.npy"], np.where(is_set, a, -a)), (["b.npy", "3"], np.where(is_set, b, np.uint64(3))),
                        (["a.npy", str(big)], np.where(is_set, a, big)), ([str(-big), "a.npy"], np.where(is_set, -big, a))):
        vkt("arith", "where", name + ".vkt", *words, "-o", "o.npy", "--force")
        assert np.array_equal(np.load("o.npy"), want), (name, words)
    vkt("arith", "where", name + ".vkt", "a.npy", "minus.npy", "--roi", ":,2:5,:", "-o", "o.npy", "--force")
    want[:, 2:5] = np.where(is_set, a, -a)[:, 2:5]
    want[:, :2], want[:, 5:] = -a[:, :2], -a[:, 5:]
    assert np.array_equal(np.load("o.npy"), want), name
    plan = subprocess.run(["vkt", "arith", "where", name + ".vkt", "a.npy", "minus.npy", "-n"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True).stderr
    assert "result exact" in plan, plan
vkt("arith", "where", "0.5", "a.npy", "minus.npy", "-o", "o.npy", "--force")
assert np.array_equal(np.load("o.npy"), a)
END
}

@test "either operand may be the number, and standard input either volume" {
    vkt make ramp --dims 4 1 1 -o r.vkt
    [ "$(vkt arith sub 10 r.vkt | value)" = 10 ]
    [ "$(vkt arith sub r.vkt -10 | value)" = 13 ]
    [ "$(vkt arith max r.vkt - <r.vkt | value)" = 3 ]
}

@test "volumes that do not fit" {
    vkt make ramp --dims 4 1 1 -o r.vkt
    vkt make ramp --dims 4 2 1 -o s.vkt
    fails_with 2 "differ in size" vkt arith add r.vkt s.vkt -o x.vkt
    fails_with 2 "different places" vkt arith add r.vkt <(vkt set r.vkt --origin 1,2,3) -o x.vkt
    fails_with 2 "are numbers" vkt arith add 1 2
    fails_with 2 "only once" vkt arith add - -
    fails_with 2 "is not one of" vkt arith plus r.vkt s.vkt
}

@test "slabs and threads do not matter" {
    vkt make noise --dims 33 15 21 | vkt write a.nrrd
    vkt make noise --dims 33 15 21 --seed 9 | vkt write b.nrrd
    vkt arith div a.nrrd b.nrrd --slab 21 --threads 1 | raw >all
    vkt arith div a.nrrd b.nrrd --slab 1 --threads 3 | raw >cut
    cmp all cut
}

@test "volumes in two frames are combined where they are the same place only" {
    vkt make noise --dims 9 8 7 --seed 1 | vkt set --origin 1,2,3 --attribute space=left-posterior-superior -o lps.nrrd
    vkt set lps.nrrd --attribute space=right-anterior-superior -o elsewhere.nrrd
    vkt set lps.nrrd --origin=-1,-2,3 --direction=-1,0,0,0,-1,0,0,0,1 --attribute space=right-anterior-superior -o ras.nrrd
    vkt write ras.nrrd ras.mha
    for other in ras.nrrd ras.mha; do
        vkt arith sub lps.nrrd $other -o zero.nrrd --force
        vkt stats zero.nrrd --json | grep -q '"max": 0,'
        vkt arith sub $other lps.nrrd | vkt stats --json | grep -q '"min": 0,'
    done
    vkt diff --geometry zero.nrrd lps.nrrd --tolerance 2
    fails_with 2 'resample SECOND --like FIRST' vkt arith sub lps.nrrd elsewhere.nrrd -o x.nrrd
    fails_with 2 'mean different things' vkt arith sub lps.nrrd <(vkt set lps.nrrd --attribute space=) -o x.nrrd
    fails_with 2 'mean different things' vkt arith sub lps.nrrd <(vkt set lps.nrrd --attribute space=scanner-xyz) -o x.nrrd
    [ ! -e x.nrrd ]
    # What the hint says helps.
    vkt resample elsewhere.nrrd --like lps.nrrd -o there.nrrd
    vkt arith sub there.nrrd lps.nrrd -o x.nrrd
}

@test "hierarchical volumes in two frames likewise" {
    vkt make amr --blocks 20 --levels 2 | vkt set --attribute space=LPS -o a.vkt
    vkt set a.vkt --attribute space=RAS -o b.vkt
    vkt arith sub a.vkt a.vkt -o x.vkt
    fails_with 2 'different trees' vkt arith sub a.vkt b.vkt -o y.vkt
}

@test "comparisons, logic and functions agree with numpy for all types" {
    python_with numpy
    for t in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make noise --dims 7 5 3 --dtype float64 --seed 1 --low -3 --high 200 | vkt convert --dtype $t -q -o a_$t.vkt
        vkt make noise --dims 7 5 3 --dtype float64 --seed 2 --low 0 --high 120 | vkt convert --dtype $t -q -o b_$t.vkt
        vkt fill a_$t.vkt --roi 0:3,0:2,: --value 7 -o t.vkt
        mv t.vkt a_$t.vkt
        vkt fill b_$t.vkt --roi 1:5,0:2,: --value 7 -o t.vkt
        mv t.vkt b_$t.vkt
        for op in gt ge lt le eq ne and or absdiff pow; do vkt arith $op a_$t.vkt b_$t.vkt -q | raw >$op.$t; done
        for op in not abs neg sqrt exp log; do vkt arith $op a_$t.vkt -q | raw >$op.$t; done
        vkt arith clamp a_$t.vkt 5 90 -q | raw >clamp.$t
        vkt arith where a_$t.vkt b_$t.vkt 3 -q | raw >where.$t
        vkt write a_$t.vkt - --format raw >a.$t
        vkt write b_$t.vkt - --format raw >b.$t
    done
    check '
np.seterr(all="ignore")
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    a, b = np.fromfile("a." + t, t), np.fromfile("b." + t, t)
    got = lambda op, d="uint8": np.fromfile(op + "." + t, d)
    for op, f in dict(gt=np.greater, ge=np.greater_equal, lt=np.less, le=np.less_equal, eq=np.equal, ne=np.not_equal).items():
        assert (got(op) == f(a, b)).all(), (op, t)
    assert (got("and") == ((a != 0) & (b != 0))).all() and (got("or") == ((a != 0) | (b != 0))).all(), t
    assert (got("not") == (a == 0)).all(), t
    whole = np.issubdtype(a.dtype, np.integer)
    exact = (lambda v: [int(x) for x in v]) if whole else (lambda v: [float(x) for x in v])
    low, high = (np.iinfo(t).min, np.iinfo(t).max) if whole else (-np.inf, np.inf)
    limit = lambda v: np.array([min(max(x, low), high) for x in v], t)
    assert (got("absdiff", t) == limit(abs(x - y) for x, y in zip(exact(a), exact(b)))).all(), t
    assert (got("abs", t) == limit(abs(x) for x in exact(a))).all() and (got("neg", t) == limit(-x for x in exact(a))).all(), t
    assert (got("clamp", t) == np.clip(a, a.dtype.type(5), a.dtype.type(90))).all(), t
    assert (got("where", t) == np.where(a != 0, b, a.dtype.type(3))).all(), t
    f = np.float32 if t in ("uint8", "int8", "uint16", "int16", "float16", "float32") else np.float64
    d, e = a.astype(np.float64), b.astype(np.float64)
    for op, want in dict(sqrt=np.sqrt(d), exp=np.exp(d), log=np.log(d), pow=d ** e).items():
        assert np.allclose(got(op, f), want.astype(f), rtol=3e-7 if f == np.float32 else 1e-15, atol=0, equal_nan=True), (op, t)
'
}

@test "64-bit integers are compared with fractions exactly" {
    one int64 0 | vkt fill --value 9007199254740993 -o odd.vkt
    one float64 9007199254740992 >even.vkt
    [ "$(vkt arith gt odd.vkt even.vkt | value)" = 1 ]
    [ "$(vkt arith eq odd.vkt even.vkt | value)" = 0 ]
    [ "$(vkt arith le odd.vkt 9007199254740992.5 | value)" = 0 ]
}

@test "values with a slope are compared, limited and chosen as what they mean" {
    one uint8 100 | vkt set --slope -0.5 --intercept 10 -o v.nrrd # -40
    [ "$(vkt arith lt v.nrrd -39 | value)" = 1 ]
    [ "$(vkt arith abs v.nrrd | value)" = 10 ] # 40 is beyond what the map can store: the largest value
    [ "$(vkt arith clamp v.nrrd -20 5 | value)" = -20 ]
    [ "$(vkt arith clamp v.nrrd -60 -50 | value)" = -50 ]
    one uint8 1 >yes.vkt
    [ "$(vkt arith where yes.vkt v.nrrd 0 | value)" = -40 ]
    [ "$(vkt arith not v.nrrd | value)" = 0 ]
    [ "$(vkt arith exp v.nrrd --dtype float64 | value)" = 4.248354255291589e-18 ]
}

@test "operands that are too few, too many or no volumes are refused" {
    one uint8 1 >v.vkt
    fails_with 2 'sqrt takes 1 operand' vkt arith sqrt v.vkt 2
    fails_with 2 'where takes 3 operands' vkt arith where v.vkt
    fails_with 2 'is a number' vkt arith abs 3
    fails_with 2 'clamp takes a volume and two numbers' vkt arith clamp v.vkt v.vkt 3
    fails_with 2 'is not below' vkt arith clamp v.vkt 3 2
    [ "$(vkt arith neg --dtype int8 <v.vkt | value)" = -1 ]
    [ "$(vkt arith clamp 2 3 <v.vkt | value)" = 2 ]
}

@test "what has no value is counted: roots, logarithms and powers" {
    /usr/bin/python3 -c "
import numpy as np
np.array([-4, -1, 0, 1, 4, np.nan, np.inf, 2], 'f4').tofile('v_8x1x1_float32.raw')"
    vkt arith sqrt v_8x1x1_float32.raw -o s.vkt 2>said
    grep -q '2 of 8 voxels (25.00 %) undefined: roots of numbers below 0' said
    fails_with 3 'undefined' vkt arith sqrt v_8x1x1_float32.raw --strict -o t.vkt
    vkt arith log v_8x1x1_float32.raw -o l.vkt 2>said
    grep -q '3 of 8 voxels (37.50 %) undefined: logarithms of numbers not above 0' said
    vkt arith pow v_8x1x1_float32.raw 0.5 -o p.vkt 2>said
    grep -q '2 of 8 voxels (25.00 %) undefined: powers that no real number is, of numbers below 0$' said
    vkt arith pow v_8x1x1_float32.raw -1 -o p.vkt --force 2>said
    grep -q '1 of 8 voxels (12.50 %) undefined: 0 to a power below 0, divided by zero$' said
    vkt arith pow v_8x1x1_float32.raw -0.5 -o p.vkt --force 2>said
    grep -q '3 of 8 voxels (37.50 %) undefined: 0 to a power below 0, divided by zero, or powers of numbers below 0 that no' said
    vkt arith pow v_8x1x1_float32.raw v_8x1x1_float32.raw -o p.vkt --force 2>said
    [ ! -s said ]
    vkt arith pow 0 v_8x1x1_float32.raw -o p.vkt --force 2>said
    grep -q '2 of 8 voxels (25.00 %) undefined: 0 to a power below 0, divided by zero$' said
    vkt arith pow -2 s.vkt -o p.vkt --force 2>said
    grep -q '1 of 8 voxels (12.50 %) undefined: powers that no real number is, of numbers below 0$' said
    vkt arith pow v_8x1x1_float32.raw 3 -o q.vkt 2>said
    [ ! -s said ]
    vkt arith exp v_8x1x1_float32.raw -o e.vkt 2>said
    [ ! -s said ]
}

@test "with --roi all other voxels keep the first volume's values, as transform does; masks are 0 there, where takes its last" {
    python_with numpy
    /usr/bin/python3 - <<'PY'
import numpy as np
rng = np.random.default_rng(6)
a = rng.integers(0, 200, (7, 9, 11)).astype('u1'); a.tofile('a_11x9x7_uint8.raw')
b = rng.integers(-300, 300, a.shape).astype('i2'); b.tofile('b_11x9x7_int16.raw')
c = rng.uniform(0, 9, a.shape).astype('f4'); c.tofile('c_11x9x7_float32.raw')
np.round(np.clip(c, 2, 6)).astype('u1').tofile('d_11x9x7_uint8.raw')
PY
    check() { # DTYPE EXPRESSION OUTSIDE WORDS…
        vkt arith "${@:4}" --roi 2:9,1:8,1:6 --slab 7 --threads 1 | vkt write - --format raw >got.raw
        vkt arith "${@:4}" --roi 2:9,1:8,1:6 --slab 1 --threads 3 | vkt write - --format raw | cmp - got.raw
        vkt arith "${@:4}" --roi 2:9,1:8,1:6 --slab 3 | vkt write - --format raw | cmp - got.raw
        /usr/bin/python3 - "$1" "$2" "$3" "${*:4}" <<'PY'
import sys
import numpy as np
type_, inside, outside, words = sys.argv[1:]
load = lambda n, t: np.fromfile(f'{n}_11x9x7_{t}.raw', t).reshape(7, 9, 11)
a, b, c, d = load('a', 'uint8'), load('b', 'int16'), load('c', 'float32'), load('d', 'uint8')
A, B, C = a.astype(float), b.astype(float), c.astype(float)
def stored(v):
    v = np.broadcast_to(v, a.shape)
    if np.dtype(type_).kind == 'f':
        return v.astype(type_)
    i = np.iinfo(type_)
    return np.clip(np.round(v), i.min, i.max).astype(type_)
want = stored(eval(outside)).copy()
region = np.s_[1:6, 1:8, 2:9]
want[region] = stored(eval(inside))[region]
got = np.fromfile('got.raw', type_).reshape(a.shape)
assert np.array_equal(got, want), (words, (got != want).sum())
PY
    }
    a=a_11x9x7_uint8.raw b=b_11x9x7_int16.raw c=c_11x9x7_float32.raw
    check uint8 'A + 90' A add $a 90
    check uint8 '100 - A' A sub 100 $a
    check uint8 'A + B' A add $a $b
    check int16 'B + A' B add $b $a
    check uint8 'A * C' A mul $a $c
    check float32 'C * A' C mul $c $a
    check float64 'A / 7' A div $a 7 --dtype float64
    check uint8 'np.sqrt(A)' A sqrt $a
    check int16 '-B' B neg $b
    check uint8 'np.clip(B, 0, 100)' B clamp $b 0 100 --dtype uint8
    check uint8 'A > 100' 0 gt $a 100
    check uint8 '(A != 0) & (B != 0)' 0 and $a $b
    check float32 'C < 4' 0 lt $c 4 --dtype float32
    vkt arith gt d_11x9x7_uint8.raw 4 -o e.vkt
    check int16 'np.where(d > 4, A, B)' B where e.vkt $a $b
    check uint8 'np.where(d > 4, A, 3)' 3 where e.vkt $a 3
    # Value maps: the first one's.
    vkt set $a --slope 0.5 --intercept 10 -o m.vkt
    vkt arith mul m.vkt 2 --roi 2:9,1:8,1:6 -o got.vkt
    vkt diff <(vkt crop got.vkt --roi :,0:1,:) <(vkt crop m.vkt --roi :,0:1,:)
    vkt diff <(vkt crop got.vkt --roi 2:9,1:8,1:6) <(vkt crop m.vkt --roi 2:9,1:8,1:6 | vkt arith mul - 2)
    fails_with 2 'leaves the volume' vkt arith add $a 1 --roi 3:40,:,: -o x.vkt
}

@test "regions of hierarchical volumes: cells whose centres lie within" {
    vkt make amr --blocks 40 --levels 2 -o tree.vkt
    vkt arith add tree.vkt 1000 --roi 2:9,:,: -o got.vkt
    run -1 vkt diff got.vkt tree.vkt
    vkt arith where <(vkt fill tree.vkt --value 1) tree.vkt 0 --roi 2:9,:,: | vkt diff - <(vkt delete tree.vkt --value 0 --roi 9:,:,: | vkt delete --value 0 --roi 0:2,:,:)
    vkt diff got.vkt <(vkt transform 'v + 1000' tree.vkt --roi 2:9,:,:)
}

@test "an absolute difference has no sign" {
    python_with numpy
    /usr/bin/python3 -c "
import numpy as np
np.array([-0.0, 0.0, -3.0, 3.0], np.float32).tofile('v_4x1x1_float32.raw')"
    for type in float32 float64; do
        vkt convert v_4x1x1_float32.raw --dtype $type | vkt arith absdiff - 0 | vkt arith div 1 - | vkt stats --json >s.json
        grep -q '"min": 0.33' s.json
        grep -q '"inf": 2' s.json
    done
}
