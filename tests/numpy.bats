#!/usr/bin/env bats
# NumPy's .npy, both ways, against NumPy; and files of other formats compressed as a whole.
load helper

setup_more() { python_with numpy; }

@test "what NumPy saved: all types, both byte orders, C and Fortran, one to four dimensions" {
    /usr/bin/python3 - <<'END'
import json, numpy, subprocess
rng = numpy.random.default_rng(1)
def vkt(name, array, fortran):
    numpy.save(name, array)
    infos = json.loads(subprocess.check_output(["vkt", "info", name, "--json"]))
    infos = infos if isinstance(infos, list) else [infos]
    shape = array.shape if fortran else array.shape[::-1]
    dims = (shape + (1, 1, 1))[:3]
    assert all(tuple(i["dims"]) == dims for i in infos), (name, infos[0]["dims"], shape)
    assert len(infos) == (shape[3] if len(shape) == 4 else 1), name
    stored = subprocess.check_output(["vkt", "write", name, "-", "--format", "raw"])
    dtype = array.dtype.newbyteorder("=") if array.dtype != bool else numpy.dtype("u1")
    assert infos[0]["dtype"] == dtype.name, (name, infos[0]["dtype"])
    assert stored == array.astype(dtype).tobytes("F" if fortran else "C"), name
for code in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8", "?"):
    for order in "<>":
        data = (rng.normal(size=(4, 3, 5)) * 100).astype(order + code if code != "?" else "?")
        vkt("c.npy", data, False)
        vkt("f.npy", numpy.asfortranarray(data), True)
for shape in ((7,), (7, 4), (2, 3, 4, 5)):
    data = rng.normal(size=shape).astype("<f4")
    vkt("c.npy", data, False)
    if len(shape) > 1: vkt("f.npy", numpy.asfortranarray(data), True)
for code in ("c8", "c16"):  # real and imaginary parts are volumes
    for order in "<>":
        for fortran in (False, True):
            data = (rng.normal(size=(4, 3, 5)) + 1j * rng.normal(size=(4, 3, 5))).astype(order + code)
            numpy.save("c.npy", numpy.asfortranarray(data) if fortran else data)
            stored = subprocess.check_output(["vkt", "write", "c.npy", "-", "--format", "raw"])
            assert stored == b"".join(part.astype("f" + str(data.itemsize // 2)).tobytes("F" if fortran else "C") for part in (data.real, data.imag)), (code, order)
numpy.lib.format.write_array(open("v3.npy", "wb"), numpy.arange(24, dtype="<u2").reshape(2, 3, 4), (3, 0))
assert json.loads(subprocess.check_output(["vkt", "info", "v3.npy", "--json"]))["dims"] == [4, 3, 2]
END
}

@test "what vkt wrote is what NumPy loads, series and compressed ones too" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make noise --dims 5 4 3 --dtype $type --seed 1 -o $type.npy
        vkt write $type.npy $type.raw --force
    done
    for i in 0 1 2; do vkt make noise --dims 5 4 3 --dtype int16 --seed $i -o v$i.nrrd; done
    vkt read 'v*.nrrd' | vkt write s.npy
    vkt read 'v*.nrrd' | vkt write s.npy.gz
    gzip -dc s.npy.gz | cmp - s.npy
    vkt read 'v*.nrrd' | vkt write s.raw
    vkt read s.npy.gz | vkt write - --format raw | cmp - s.raw
    /usr/bin/python3 - <<'END'
import numpy
for name in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float16", "float32", "float64"):
    array = numpy.load(name + ".npy")
    assert array.shape == (3, 4, 5) and array.dtype == name and array.flags.c_contiguous
    assert array.tobytes() == open(name + ".raw", "rb").read(), name
series = numpy.load("s.npy")
assert series.shape == (3, 3, 4, 5) and series.tobytes() == open("s.raw", "rb").read()
assert open("s.npy", "rb").read().index(b"\n") % 64 == 63  # voxels are aligned
END
}

@test "arrays that are no volumes, and damaged ones, are refused" {
    /usr/bin/python3 - <<'END'
import numpy
numpy.save("complex.npy", numpy.zeros((2, 3, 4), "c32"))
numpy.save("structure.npy", numpy.zeros((2, 3), [("a", "f4"), ("b", "i2")]))
numpy.save("text.npy", numpy.zeros((2, 3), "U5"))
numpy.save("object.npy", numpy.array([[None]]), allow_pickle=True)
numpy.save("five.npy", numpy.zeros((2, 2, 3, 2, 2)))
numpy.save("scalar.npy", numpy.float32(3))
numpy.save("empty.npy", numpy.zeros((2, 0, 3)))
numpy.save("good.npy", numpy.arange(60, dtype="<i2").reshape(3, 4, 5))
good = open("good.npy", "rb").read()
open("short.npy", "wb").write(good[:-1])
open("header.npy", "wb").write(good[:50])
open("magic.npy", "wb").write(good.replace(b"NUMPY", b"NUMPX"))
open("version.npy", "wb").write(good[:6] + b"\x09" + good[7:])
open("key.npy", "wb").write(good.replace(b"shape", b"shade"))
open("huge.npy", "wb").write(good.replace(b"(3, 4, 5), }" + b" " * 24, b"(999999999, 999999999, 999999999), }"))
open("overflow.npy", "wb").write(good.replace(b"(3, 4, 5), }" + b" " * 24, b"(99999999999999999999999999, 4, 5),}"))
open("open.npy", "wb").write(good.replace(b"(3, 4, 5), }", b"(3, 4, 5   }"))
END
    fails_with 3 "exceed 2^62 bytes" vkt write huge.npy out.nrrd
    for name in complex structure text object five scalar empty short header magic version key overflow open; do
        fails_with 3 "$name.npy'" vkt write $name.npy out.nrrd
        [ ! -e out.nrrd ]
    done
    # A batch of one is no dimension.
    /usr/bin/python3 -c 'import numpy; numpy.save("batch.npy", numpy.arange(48.0).reshape(1, 2, 3, 2, 4))'
    [ "$(vkt info batch.npy --json | tr -d ' \n' | grep -o '"dims":\[4,2,3\]' | wc -l)" -eq 2 ]
    fails_with 3 "elements of type '<c32', which volumes do not have" vkt info complex.npy
}

@test "NRRD and MetaImage compressed as a whole" {
    vkt make noise --dims 9 8 7 --dtype uint16 | vkt set --spacing 1,2,3 -o a.nrrd
    vkt write a.nrrd a.mha
    for name in a.nrrd a.mha; do
        gzip -k $name
        cp $name.gz other
        vkt diff a.nrrd $name.gz
        vkt diff a.nrrd other
        vkt read - <other | vkt diff a.nrrd -
        vkt write a.nrrd b_$name.gz
        gzip -dc b_$name.gz >b_$name
        vkt diff a.nrrd b_$name
        vkt diff a.nrrd b_$name.gz
        vkt read 'b_a.*' --roi 1:3,:,: >/dev/null
        head -c -9 $name.gz >short_$name.gz
        fails_with 3 "short_$name.gz" vkt write short_$name.gz out.nrrd
        # Damage behind the last voxel is damage as well.
        head -c -8 $name.gz >sum_$name.gz
        printf '01234567' >>sum_$name.gz
        fails_with 3 "sum_$name.gz" vkt write sum_$name.gz out.nrrd
    done
    vkt write a.nrrd twice.nrrd.gz --compress
    gzip -dc twice.nrrd.gz | grep -aq 'encoding: raw'
    fails_with 2 "detached" vkt write a.nrrd d.nhdr.gz
    cp "$VKT_ROOT/README.md" readme
    gzip readme
    fails_with 3 "readme.gz" vkt info readme.gz
}
