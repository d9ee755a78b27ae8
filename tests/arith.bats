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
            vkt arith $op a.$dtype.vkt b.$dtype.vkt -q | raw >$op.$dtype.raw
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
    # equal maps: stored values; a number counts as a physical value; different maps: physical values
    vkt declare-sv --dims 2 2 2 --data-format uint8 | vkt arith add - 0.2 -o a.vkt
    [ "$(value <a.vkt)" = 0.2 ]
    vkt arith add a.vkt <(vkt set a.vkt --units x) | vkt stats --json | grep -q '"max": 0.4'
    vkt arith add a.vkt <(vkt make constant --dims 2 2 2 --value 3) >sum.vkt
    vkt info sum.vkt --json | grep -q '"slope": 1.0'
    [ "$(value <sum.vkt)" = 3.2 ] || [ "$(value <sum.vkt | cut -c1-8)" = 3.200000 ]
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
