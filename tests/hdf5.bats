#!/usr/bin/env bats
# HDF5 datasets: voxels equal to h5py's, also of NetCDF-4 and MATLAB's files; regions, choices, damage.
load helper

setup_more() {
    python_with h5py numpy
    cat >common.py <<'END'
import json, subprocess, sys, h5py, numpy
def infos(name):
    info = json.loads(subprocess.check_output(["vkt", "info", name, "--json"]))
    return info if isinstance(info, list) else [info]
def voxels(name, *options):
    return subprocess.check_output(f"vkt read {name} {' '.join(options)} | vkt write - --format raw", shell=True)
END
    /usr/bin/python3 -c '
import h5py, numpy
h5py.File("try.h5", "w")["a"] = numpy.zeros((2, 2, 2))'
    vkt info try.h5 2>err >/dev/null || { grep -q 'without it' err && skip 'built without HDF5'; cat err >&2; false; }
}

@test "types, byte orders, layouts, filters, one to four dimensions" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(1)
n = 0
for code in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"):
    for order in "<>":
        data = (rng.normal(size=(7, 12, 13)) * 50).astype(order + code)
        native = data.astype(code)
        with h5py.File(f"a{n}.h5", "w") as f:
            f["plain"] = data
            f.create_dataset("group/chunked", data=data, chunks=(3, 5, 4))
            f.create_dataset("group/packed", data=data, chunks=(2, 12, 13), compression="gzip", shuffle=True)
        for name in ("plain", "group/chunked", "group/packed"):
            assert infos(f"a{n}.h5:/{name}")[0]["dtype"] == native.dtype.name, (code, order)
            assert voxels(f"a{n}.h5:/{name}") == native.tobytes(), (code, order, name)
            assert voxels(f"a{n}.h5", "--variable", name, "--roi 2:9,3:11,1:6") == numpy.ascontiguousarray(native[1:6, 3:11, 2:9]).tobytes()
        n += 1
for shape in ((9,), (4, 9), (2, 3, 4, 5), (1, 1, 2, 3, 4, 5)):
    data = rng.normal(size=shape)
    with h5py.File("s.h5", "w") as f: f["a"] = data
    assert voxels("s.h5") == data.tobytes(), shape
    assert len(infos("s.h5")) == (2 if len(shape) > 3 else 1)
with h5py.File("b.h5", "w") as f: f["mask"] = rng.normal(size=(3, 4, 5)) > 0
assert infos("b.h5")[0]["dtype"] in ("int8", "uint8") and len(voxels("b.h5")) == 60
END
}

@test "coordinates, packing and units of NetCDF-4; sizes of elements; a user block" {
    /usr/bin/python3 - <<'END'
from common import *
data = numpy.arange(60, dtype="i2").reshape(3, 4, 5)
with h5py.File("n.nc", "w") as f:
    f["t"] = data
    for i, (name, at) in enumerate((("z", [10, 12, 14]), ("y", [3.5, 3, 2.5, 2]), ("x", [0, 1, 2, 3, 4]))):
        f[name] = numpy.array(at, "f8"); f[name].make_scale(name); f[name].attrs["units"] = "km"
        f["t"].dims[i].attach_scale(f[name])
    f["t"].attrs.update({"scale_factor": 0.5, "add_offset": 100.0, "units": "K", "long_name": "temperature"})
i = infos("n.nc")[0]
assert i["spacing"] == [1, 0.5, 2] and i["origin"] == [0, 3.5, 10] and i["direction"][1] == [0, -1, 0], i
assert i["slope"] == 0.5 and i["intercept"] == 100 and i["units"] == "K", i
assert i["attributes"]["space units"] == '"km" "km" "km"' and voxels("n.nc") == data.tobytes()
with h5py.File("e.h5", "w", userblock_size=512) as f:
    f["a"] = data; f["a"].attrs["element_size_um"] = [2.0, 0.5, 0.25]
assert infos("e.h5")[0]["spacing"] == [0.25, 0.5, 2] and voxels("e.h5") == data.tobytes()
END
}

@test "images of ITK: place, spacing and direction, two to four dimensions; vectors are refused" {
    python_with SimpleITK
    /usr/bin/python3 - <<'EOF'
import math, numpy as np, SimpleITK as sitk
a = np.arange(4 * 5 * 6, dtype=np.int16).reshape(4, 5, 6)
c, s = math.cos(0.3), math.sin(0.3)
image = sitk.GetImageFromArray(a)
image.SetSpacing((0.5, 2, 3))
image.SetOrigin((10, -20, 30))
image.SetDirection((c, 0, -s, s, 0, c, 0, -1, 0))
sitk.WriteImage(image, "a.hdf5")
sitk.WriteImage(image, "a.nrrd")
flat = sitk.GetImageFromArray(a[0])
flat.SetSpacing((2, 3))
flat.SetOrigin((-1, 7))
sitk.WriteImage(flat, "flat.h5")
sitk.WriteImage(sitk.JoinSeries([image, image + 1, image + 2], 100, 2.5), "times.h5")
sitk.WriteImage(sitk.Compose(image, image), "vectors.h5")
EOF
    vkt diff a.hdf5 a.nrrd >told
    grep -q '^same_geometry *yes$' told
    vkt info a.hdf5 >told
    grep -q '^attribute *space: left-posterior-superior$' told
    grep -q '^spacing *0.5 2 3$' told
    grep -q '^origin *10 -20 30$' told
    vkt info flat.h5 >told
    grep -q '^dims *6 5 1$' told
    grep -q '^spacing *2 3 1$' told
    grep -q '^origin *-1 7 0$' told
    vkt info times.h5 >told
    [ "$(grep -c '^dims *6 5 4$' told)" -eq 3 ]
    [ "$(sed -n 's/^attribute *sequence position: //p' told | tr '\n' ' ')" = "100 102.5 105 " ]
    vkt read times.h5 | vkt info --json | grep -q '"sequence step": *"2.5"'
    run ! vkt info vectors.h5
    [[ "$output" == *"'/ITKImage/0/VoxelData' has 2 numbers in each voxel"* ]]
}

@test "several datasets, none, damage" {
    /usr/bin/python3 - <<'END'
from common import *
import random
data = numpy.arange(600, dtype="i2").reshape(10, 6, 10)
with h5py.File("two.h5", "w") as f:
    f["first"] = data; f["g/second"] = data.astype("f4"); f["words"] = "text"; f["list"] = numpy.arange(5)
with h5py.File("none.h5", "w") as f: f["words"] = "text"
with h5py.File("c.h5", "w") as f: f.create_dataset("a", data=data, chunks=(2, 6, 10), compression="gzip")
good = open("c.h5", "rb").read()
random.seed(8)
for i in range(60):
    bad = bytearray(good)
    for _ in range(random.randint(1, 6)): bad[random.randrange(8, len(bad))] = random.randrange(256)
    if i % 3 == 0: bad = bad[:random.randrange(100, len(bad))]
    open("bad.h5", "wb").write(bad)
    run = subprocess.run(["vkt", "stats", "bad.h5"], capture_output=True, timeout=120)
    assert run.returncode in (0, 1, 2, 3, 5), (i, run.returncode, run.stderr)
END
    fails_with 2 "holds several variables: /first, /g/second" vkt stats two.h5
    fails_with 2 "did you mean '/first'" vkt read two.h5 --variable /fist
    [ "$(vkt read two.h5 --variable list | vkt dump | tr -d '\n' | grep -o '{ .*')" = '{  [0] {0.0, 1.0, 2.0, 3.0, 4.0}}' ]
    fails_with 3 "holds no dataset of numbers" vkt stats none.h5
    fails_with 4 "cannot open 'absent.h5:/a'" vkt stats absent.h5:/a
}

@test "more than four dimensions and complex numbers are volumes that are numbered" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(8)
five, six = rng.integers(0, 999, (2, 3, 4, 5, 6)).astype("i2"), rng.integers(0, 99, (2, 3, 2, 4, 5, 6)).astype("u1")
def complex_of(code, shape): return (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(code)
with h5py.File("m.h5", "w") as f:
    f["five"] = five; f["big"] = five.astype(">i2"); f["six"] = six
    f.create_dataset("packed", data=five, chunks=(1, 2, 2, 3, 3), compression="gzip")
    f.create_dataset("chunked", data=five, chunks=(1, 1, 2, 3, 3))
    f["thin"] = five[:, :1]
for name in "five", "packed", "chunked", "big": assert voxels("m.h5:/" + name) == five.tobytes(), name
with h5py.File("c.h5", "w") as f:
    for code in ("<c8", ">c8", "<c16"):
        for shape in ((4, 5, 6), (3, 4, 5, 6), (2, 3, 4, 5, 6)):
            f.create_dataset(f"{code[1:]}{'b' if code[0] == '>' else ''}{len(shape)}", data=complex_of(code, shape), chunks=(2,) * len(shape) if len(shape) == 4 else None)
def channels(name): return [i["attributes"].get("channel") for i in infos(name)]
assert voxels("m.h5:/six") == six.tobytes()
assert channels("m.h5:/five") == list("000111") and channels("m.h5:/six") == list("001122334455"), channels("m.h5:/six")
assert channels("m.h5:/thin") == [None] * 2, channels("m.h5:/thin")
part = subprocess.check_output("vkt read m.h5:/packed --index 4 --roi 1:4,2:5,1:3 | vkt write - --format raw", shell=True)
assert part == numpy.ascontiguousarray(five[1, 1, 1:3, 2:5, 1:4]).tobytes()
with h5py.File("c.h5") as f:
    for name, data in f.items():
        z = data[()].reshape(-1, 4, 5, 6)
        want = numpy.stack([z.real, z.imag], 1)
        assert voxels("c.h5:/" + name) == want.astype(want.dtype.newbyteorder("=")).tobytes(), name
        assert channels("c.h5:/" + name) == (list("01") * (len(z)) if z.shape[0] != 6 else list("010101232323")), (name, channels("c.h5:/" + name))
END
    /usr/bin/python3 -c '
from common import *
with h5py.File("vast.h5", "w") as f: f.create_dataset("d", (2000, 2000, 2, 2, 2), "u1", chunks=(100, 100, 2, 2, 2))'
    fails_with 3 "4000000 volumes, more than are numbered" vkt info vast.h5:/d
    # MATLAB's have parts of other names; its empty arrays have their extents for numbers.
    /usr/bin/python3 -c '
from common import *
z = numpy.zeros((4, 5, 6), dtype=[("real", "f8"), ("imag", "f8")])
z["real"], z["imag"] = numpy.random.default_rng(1).normal(size=(2, 4, 5, 6))
with h5py.File("parts.mat", "w") as f:
    f["z"] = z
    f["z"].attrs["MATLAB_class"] = numpy.bytes_("double")
    f["empty"] = numpy.array([0, 3], "u8")
    f["empty"].attrs["MATLAB_empty"] = numpy.uint8(1)
assert voxels("parts.mat") == voxels("parts.mat:/z") == z["real"].tobytes() + z["imag"].tobytes()
said = json.loads(subprocess.check_output(["vkt", "info", "parts.mat", "--json"]))
assert [one["attributes"]["channel"] for one in said] == ["0", "1"]'
    fails_with 3 "'/empty' holds an empty array of MATLAB" vkt info parts.mat:/empty
    # As NIfTI's fourth and fifth dimension.
    vkt convert m.h5:/five five.nii
    vkt convert c.h5:/c83 complex.nii
    /usr/bin/python3 - <<'END'
import h5py, nibabel, numpy
with h5py.File("m.h5") as f: assert numpy.array_equal(numpy.asanyarray(nibabel.load("five.nii").dataobj).T, f["five"][()])
with h5py.File("c.h5") as f: z = f["c83"][()]
got = numpy.asanyarray(nibabel.load("complex.nii").dataobj).T
assert got.shape == (2, 1, 4, 5, 6) and numpy.array_equal(got[0, 0] + 1j * got[1, 0], z), got.shape
END
}

@test "links within a file are other names, those to other files are not followed; what holds no numbers is named" {
    /usr/bin/python3 - <<'END'
from common import *
data = numpy.arange(60, dtype="i2").reshape(3, 4, 5)
with h5py.File("other.h5", "w") as f: f["a"] = data + 1
with h5py.File("l.h5", "w") as f:
    f["entry/data"] = data
    f["soft"] = h5py.SoftLink("/entry/data"); f["hard"] = f["entry/data"]; f["group"] = h5py.SoftLink("/entry")
    f["lost"] = h5py.SoftLink("/nowhere"); f["out"] = h5py.ExternalLink("other.h5", "/a")
    f["out group"] = h5py.ExternalLink("other.h5", "/")
    f["complex"] = data.astype("c8"); f["text"] = ["a", "b"]; f["one"] = 3.5
    f["records"] = numpy.zeros((2, 2), [("a", "f4"), ("b", "i2")])
for path in ("soft", "hard", "group/data", "entry/data"):
    assert voxels("l.h5:/" + path) == voxels("l.h5", "--variable", path) == data.tobytes(), path
END
    fails_with 3 "'/out' is a link to another file" vkt info l.h5:/out
    fails_with 3 "vkt read other.h5:/a" vkt info l.h5:/out
    fails_with 3 "is a link to another file" vkt info 'l.h5:/out group/a'
    fails_with 2 "has no variable '/lost'" vkt info l.h5:/lost
    fails_with 3 "'/entry' is no dataset" vkt info l.h5:/entry
    fails_with 3 "holds structures" vkt info l.h5:/records
    fails_with 3 "holds texts" vkt info l.h5:/text
    fails_with 3 "holds no array" vkt info l.h5:/one
    vkt info l.h5 | grep -q "not read *dataset '/records', which holds structures"
    # The command that a refusal names works as it stands.
    /usr/bin/python3 -c '
from common import *
with h5py.File("two words.h5", "w") as f: f["Level 0/Data"] = numpy.zeros((2, 3, 4)); f["Level 1/Data"] = numpy.zeros((1, 2, 2))'
    fails_with 2 "vkt read 'two words.h5' --variable '/Level 0/Data' | ..." vkt stats 'two words.h5'
}

@test "voxels in other files: those beside, but no others unless paths are trusted" {
    /usr/bin/python3 - <<'END'
from common import *
import os
data = numpy.arange(60, dtype="i2").reshape(3, 4, 5)
os.makedirs("far"); os.makedirs("near/sub")
def virtual(name, *sources):
    with h5py.File(name, "w", libver="latest") as f:
        layout = h5py.VirtualLayout((len(sources), 3, 4, 5), "i2")
        for i, (file, path) in enumerate(sources): layout[i] = h5py.VirtualSource(file, path, (3, 4, 5))
        f.create_virtual_dataset("v", layout, fillvalue=-7)
def external(name, file):
    with h5py.File(name, "w") as f:
        f.create_dataset("v", shape=data.shape, dtype="i2", external=[(file, 0, h5py.h5f.UNLIMITED)])
for folder in ("far", "near", "near/sub"):
    with h5py.File(folder + "/a.h5", "w") as f: f["a"] = data
    open(folder + "/a.raw", "wb").write(data.tobytes())
virtual("near/v.h5", ("a.h5", "/a"), ("sub/a.h5", "/a"))
virtual("near/here.h5", (".", "/b"))
with h5py.File("near/here.h5", "r+") as f: f["b"] = data
virtual("near/absent.h5", ("a.h5", "/a"), ("absent-1.h5", "/a"))
virtual("near/out.h5", ("../far/a.h5", "/a")); virtual("near/absolute.h5", (os.path.abspath("far/a.h5"), "/a"))
external("near/raw.h5", "a.raw"); external("near/leak.h5", os.path.abspath("far/a.raw"))
external("near/first.h5", os.path.abspath("far/a.raw"))
virtual("near/second.h5", ("first.h5", "/v"))
with h5py.File("near/link.h5", "w") as f: f["a"] = h5py.ExternalLink("../far/a.h5", "/a")
virtual("near/third.h5", ("link.h5", "/a"))
os.chdir("near")
assert voxels("v.h5") == data.tobytes() * 2 and voxels("here.h5:/v") == data.tobytes() == voxels("raw.h5")
os.chdir("sub")
assert voxels("../v.h5") == data.tobytes() * 2 and voxels("../raw.h5") == data.tobytes() # beside it, wherever one is
os.chdir("..")
assert voxels("absent.h5") == data.tobytes() + numpy.full(60, -7, "i2").tobytes()
for name in ("out", "absolute", "leak", "second"):
    assert voxels(name + ".h5", "--trust-paths") == data.tobytes(), name
END
    cd near
    vkt info absent.h5 | grep -q "not read *file 'absent-1.h5', which is not there"
    fails_with 3 "names '../far/a.h5', which leads out of its directory" vkt info out.h5
    for name in absolute leak second; do fails_with 3 "is an absolute path, not a file beside it" vkt stats $name.h5; done
    gzip -k v.h5
    fails_with 3 "it has no name beside which" vkt stats v.h5.gz
    fails_with 3 "'link.h5:/a', of which its virtual dataset is made, is not there itself" vkt stats third.h5
}

@test "times of NetCDF-4 are those of the volumes; what stands for no value is said; version 3 is told by its name" {
    /usr/bin/python3 - <<'END'
from common import *
def write(name, times, units):
    with h5py.File(name, "w") as f:
        f["v"] = numpy.zeros((3, 2, 3, 4), "f4")
        f["time"] = numpy.array(times, "f8"); f["time"].make_scale("time"); f["time"].attrs["units"] = units
        f["v"].dims[0].attach_scale(f["time"]); f["v"].attrs["missing_value"] = numpy.float32(-999)
write("even.nc", [6, 18, 30], "hours since 2000-01-01")
write("uneven.nc", [0, 1, 5], "s")
def said(name): return [{k[9:]: v for k, v in i["attributes"].items() if k.startswith("sequence")} for i in infos(name)]
unit = '"hours since 2000-01-01"'
assert said("even.nc") == [{"position": t, "step": "12", "units": unit} for t in ("6", "18", "30")], said("even.nc")
assert said("uneven.nc") == [{"position": t} for t in ("0", "1", "5")], said("uneven.nc")
assert infos("even.nc")[0]["attributes"]["missing_value"] == "-999"
open("old.nc", "wb").write(b"CDF\1" + bytes(100))
open("old.mat", "wb").write(b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(200))
END
    fails_with 3 "is a NetCDF file of version 3, which is not read" vkt info old.nc
    fails_with 3 "is a MATLAB file before 7.3, which is not read" vkt info old.mat
}

@test "what vkt writes is what h5py reads: types, groups, chunks, compression; all of the header comes back" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make noise --dims 70 80 21 --dtype $type --seed 1 | vkt set --spacing 0.5,1,3 --origin 4,5,6 -o $type.h5:/group/volume
        vkt read $type.h5:/group/volume | vkt write packed_$type.h5 --compress
        vkt write $type.h5 $type.raw
        vkt read $type.h5 | vkt write rows_$type.h5:/v --memory 20k 2>err || { cat err >&2; false; }
    done
    /usr/bin/python3 - <<'END'
from common import *
for name in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float16", "float32", "float64"):
    want = open(name + ".raw", "rb").read()
    for file, path in ((name, "/group/volume"), ("packed_" + name, "/data")):
        with h5py.File(file + ".h5") as f:
            d = f[path]
            assert d.shape == (21, 80, 70) and d.dtype == name and d[...].tobytes() == want, name
            assert d.chunks == (16, 64, 64) and (d.compression == "gzip") == file.startswith("packed"), (d.chunks, d.compression)
            assert list(d.attrs["spacing"]) == [3, 1, 0.5] and list(d.attrs["origin"]) == [6, 5, 4]
            assert [dim.label for dim in d.dims] == ["z", "y", "x"]
    with h5py.File(f"rows_{name}.h5") as f:
        assert f["v"][...].tobytes() == want and f["v"].chunks[0] == 1, (name, f["v"].chunks)
END
    vkt make ramp --dims 600 520 17 --dtype uint16 -o large.h5
    /usr/bin/python3 -c 'import h5py; d = h5py.File("large.h5")["data"]; assert d.chunks == (16, 128, 128), d.chunks'
    vkt make ramp --dims 600 520 17 --dtype uint16 | vkt diff - large.h5
    vkt read int16.h5 | vkt set --attribute 'space units="mm" "mm" "mm"' --attribute note=kept --voxel-mapping -1024 3071 --units HU | vkt flip y -o h.h5
    vkt read int16.h5 | vkt set --attribute 'space units="mm" "mm" "mm"' --attribute note=kept --voxel-mapping -1024 3071 --units HU | vkt flip y -o h.nrrd
    vkt diff h.h5 h.nrrd
    for what in spacing origin direction slope intercept units; do
        diff <(vkt info h.h5 --json | grep "\"$what\"") <(vkt info h.nrrd --json | grep "\"$what\"")
    done
    vkt info h.h5 | grep -q 'note: kept'
    vkt history h.h5 --as-shell | grep -q 'flip y'
    /usr/bin/python3 - <<'END'
from common import *
with h5py.File("h.h5", "r+") as f:
    d = f["data"]
    assert list(d.attrs["element_size_um"]) == [3000, 1000, 500] and d.attrs["units"] == "HU"
    assert abs(d.attrs["scale_factor"] * 0 + d.attrs["add_offset"] - infos("h.nrrd")[0]["intercept"]) < 1e-9
    d.attrs["spacing"] = [7.0, 1, 0.5]  # who changes it is believed
assert infos("h.h5")[0]["spacing"] == [0.5, 1, 7]
END
    # Whole or nothing, never over another file, and not where it cannot be.
    fails_with 4 'the file exists' vkt write int16.h5 h.h5
    fails_with 4 'the file exists' vkt read int16.h5 -o h.h5:/other
    fails_with 2 'cannot be written to a pipe' bash -c 'set -o pipefail; vkt write int16.h5 - --format hdf5 | cat'
    fails_with 2 'names no dataset: a name in it is empty' vkt read int16.h5 -o 'x.h5:/a//b'
    vkt read int16.h5 | head -c 100000 >cut.vkt
    fails_with 3 'ended early' vkt read cut.vkt -o cut.h5
    [ ! -e cut.h5 ]
    [ ! -e x.h5 ]
    [ -z "$(find . -name '.*vkt-*')" ]
    vkt stack int16.h5 int16.h5 -o 'n%d.h5' && vkt diff n1.h5 int16.h5
}

@test "a series is one dataset that grows along times and channels, of every layout" {
    /usr/bin/python3 - <<'END'
import os
from common import *
dims = (70, 40, 19)
def run(line): return subprocess.run(line, shell=True, check=True, capture_output=True).stdout
def stream(name, said):
    """One volume for each, with these attributes, as one stream."""
    for i, attributes in enumerate(said):
        options = " ".join(f"--attribute '{k}={v}'" for k, v in attributes.items())
        run(f"vkt make noise --dims {' '.join(map(str, dims))} --dtype uint16 --seed {i} | vkt set --spacing 0.5,1,3 --origin 4,5,6 {options} -o s{i}.vkt --force")
    run(f"vkt read 's[0-9]*.vkt' -o {name}.vkt --force; rm s[0-9]*.vkt")
def times(n, step=0.1, first=1): return [{"sequence position": f"{first + i * step:g}", "sequence step": step, "sequence units": '"s"'} for i in range(n)]
names = [{"channel": n} for n in ("DAPI", "GFP", "Cy5")]
series = {"t": times(4), "c": names, "tc": [t | c for t in times(2) for c in names], "ct": [t | c for c in names for t in times(4)], "plain": [{}, {}],
          "uneven": [{"sequence position": p} for p in (0, 1, 5)]}
leading = {"t": (4,), "c": (3,), "tc": (2, 3), "ct": (3, 4), "plain": (2,), "uneven": (3,)}
for name, said in series.items():
    stream(name, said)
    want = numpy.frombuffer(voxels(name + ".vkt"), "u2").reshape(*leading[name], *dims[::-1])
    sizes = []
    for layout in ("", "--compress", "--memory 20k"):
        run(f"vkt write {name}.vkt {name}.h5:/g/{name} {layout} --force")
        sizes.append(os.path.getsize(name + ".h5"))
        os.rename(name + ".h5", "o.h5")
        with h5py.File("o.h5") as f:
            d = f[f"g/{name}"]
            assert [n for n in f["g"] if f["g"][n].attrs.get("CLASS") != b"DIMENSION_SCALE"] == [name] and d.shape == want.shape and (d[...] == want).all() and d.chunks[:-3] == (1,) * (d.ndim - 3), (name, d.chunks)
            assert d.maxshape == (None,) + want.shape[1:] and (d.compression == "gzip") == (layout == "--compress")
            axes = name if len(name) < 3 else "t"
            assert [n.label for n in d.dims] == [*axes, "z", "y", "x"]
            if "c" in axes: assert list(d.attrs["channel"]) == ["DAPI", "GFP", "Cy5"]
            if name in ("t", "tc", "ct"): assert d.attrs["sequence_units"] == "s" and numpy.allclose(d.attrs["sequence_position"], [1 + 0.1 * i for i in range(d.shape[axes.index("t")])])
            assert ("sequence_position" in d.attrs) == (name not in ("c", "plain"))
        for f, g in zip(infos("o.h5"), infos(name + ".vkt"), strict=True):
            del f["attributes"]["variable"]
            assert f["attributes"] == g.get("attributes", {}) and f["spacing"] == [0.5, 1, 3] and f["origin"] == [4, 5, 6], (name, layout, f, g)
        assert voxels("o.h5") == want.tobytes(), (name, layout)
    # What moves to more dimensions leaves no hole: chunks of 32 x 64 x 128 voxels a volume, and the first row of them twice at most.
    assert sizes[0] < want.shape[0] * (want.shape[1] if want.ndim == 5 else 1) * 2 * 32 * 64 * 128 + 2 * 32 * 64 * 128 + 40000, (name, sizes)
for said in ([t | c for t, c in zip(times(3), names)], [t | c for t in times(2) for c in names][:5], [names[0], names[1], names[0], names[2]]):
    stream("bad", said)
    r = subprocess.run("vkt write bad.vkt bad.h5", shell=True, capture_output=True, text=True)
    assert r.returncode == 2 and "no full grid" in r.stderr and "out_%04d.h5" in r.stderr, r
assert not [n for n in os.listdir() if n.startswith(("bad.h5", ".bad"))], os.listdir()
# Labels of others, in any order; those that name no direction in space mean nothing.
data = numpy.arange(3 * 4 * 5 * 6 * 2, dtype="u2").reshape(3, 4, 5, 6, 2)
with h5py.File("l.h5", "w") as f:
    f["a"] = data
    for d, label in zip(f["a"].dims, "ztyxc"): d.label = label
got = numpy.frombuffer(voxels("l.h5"), "u2").reshape(4, 2, 3, 5, 6)
assert (got == data.transpose(1, 4, 0, 2, 3)).all()
END
    vkt make noise --dims 4 4 4 -o small.vkt
    fails_with 2 'different dims' sh -c 'cat t.vkt small.vkt | vkt write - mixed.h5'
}

@test "replacing a dataset leaves no reference without its object; what refers to it, or is of a later HDF5, is refused" {
    vkt make ramp --dims 5 4 3 --dtype uint8 -o a.nrrd
    cat >scales.py <<'END'
import h5py, numpy, sys
name, version = sys.argv[1:]
with h5py.File(name, "w", libver=version) as f:
    f["records"] = numpy.zeros(10, dtype=[("a", "i4"), ("b", "f8")])
    for scale, n in ("x", 5), ("y", 4), ("alone", 3):
        f[scale] = numpy.arange(float(n)); f[scale].make_scale(scale)
    for data in "d", "e":
        f[data] = numpy.zeros((4, 5)); f[data].dims[1].attach_scale(f["x"])
    f["d"].dims[0].attach_scale(f["y"])
    f["plain"] = numpy.zeros((4, 5)); f["other name"] = f["x"]
END
    for version in earliest v110; do
        /usr/bin/python3 scales.py k.h5 $version
        cp k.h5 kept.h5
        # Of a name among two the scale itself stays.
        vkt convert a.nrrd "k.h5:/other name" --force
        vkt diff a.nrrd "k.h5:/other name"
        cp k.h5 kept.h5
        fails_with 2 "'/x' is a scale of dimensions that 2 other datasets name as theirs" vkt convert a.nrrd k.h5:/x --force
        [[ "$stderr" == *"another name: -o k.h5:/x_new"* ]]
        cmp k.h5 kept.h5
        for name in d alone records plain; do vkt convert a.nrrd k.h5:/$name --force; done
        /usr/bin/python3 -c '
import h5py
f = h5py.File("k.h5")
assert [f[r[0]].name for r in f["x"].attrs["REFERENCE_LIST"]] == ["/e"] and "REFERENCE_LIST" not in f["y"].attrs
assert f["e"].dims[1][0] == f["x"] and f["d"].shape == (3, 4, 5)'
        vkt convert a.nrrd k.h5:/e --force
        vkt convert a.nrrd k.h5:/x --force # which nobody uses any more
        vkt diff a.nrrd k.h5:/x
    done
    # In the latest layout a dataset of one chunk has an index of its own.
    vkt make noise --dims 12 11 10 --seed 1 -o one.nrrd
    vkt make noise --dims 140 130 40 --seed 1 -o many.nrrd
    for version in earliest v108 v110 latest; do
        /usr/bin/python3 scales.py k.h5 $version
        for volume in one many; do
            vkt convert $volume.nrrd k.h5:/$volume --force
            vkt diff $volume.nrrd k.h5:/$volume
            vkt stack $volume.nrrd $volume.nrrd | vkt write - k.h5:/series --force
            vkt split k.h5:/series -o "part%d.nrrd" --force
            vkt diff part1.nrrd $volume.nrrd
        done
    done
    PYTHONPATH="$VKT_BUILD/hdf5plugin" /usr/bin/python3 scales.py k.h5 latest || skip "no later h5py in $VKT_BUILD/hdf5plugin"
    cp k.h5 kept.h5
    # Whether this library is too old, or knows what it replaces: never half of it.
    for name in records d x; do
        if vkt convert a.nrrd k.h5:/$name --force 2>err; then vkt diff a.nrrd k.h5:/$name; cp kept.h5 k.h5; continue; fi
        [ "$(wc -l <err)" = 2 ]
        grep -Eq "cannot replace '/$name', which a later one may have written|scale of dimensions" err
        cmp k.h5 kept.h5
    done
}

# series NAME…: three channels at two times, written to each of these.
series() {
    for c in 0 1 2; do for t in 0 1; do
        vkt make noise --dims 6 5 4 --dtype int16 --seed $c$t | vkt set --spacing 1,2,3 --origin 10,20,30 --attribute channel=c$c \
            --attribute "sequence position=$t.5" --attribute 'sequence step=1' --attribute 'sequence units="s"' --attribute 'space units="mm" "mm" "mm"'
    done; done >s.vkt
    for name; do vkt write s.vkt "$name" --force; done
}

@test "dimensions of a series have scales, which go with it" {
    /usr/bin/python3 -c '
import h5py, numpy
with h5py.File("s.h5", "w") as f: f["y"] = numpy.arange(7)' # of somebody else
    series s.h5:/data s.h5:/g/vol s.h5:/g/second
    for name in data g/vol g/second; do vkt diff s.vkt s.h5:/$name; done
    vkt info s.h5:/data >told
    run ! grep 'not read' told
    vkt info s.h5 --json | grep -q '"variables": *"/data /g/second /g/vol"'
    cat >scales.py <<'END'
import h5py
f = h5py.File("s.h5")
assert sorted(f) == ["c", "data", "data_y", "g", "t", "x", "y", "z"], list(f)
assert sorted(f["g"]) == sorted(["second", "vol", *"ctxyz"] + ["second_" + n for n in "ctxyz"]), list(f["g"])
for name, prefix in ("data", ""), ("g/vol", ""), ("g/second", "second_"):
    d = f[name]
    assert d.maxshape[0] is None and [s.label for s in d.dims] == list("ctzyx")
    for k, axis in enumerate("ctzyx"):
        scale = d.dims[k][0]
        assert scale.attrs["CLASS"] == b"DIMENSION_SCALE" and scale.shape == (d.shape[k],) and scale.maxshape == (d.maxshape[k],), (name, axis)
        assert scale.name.split("/")[-1] == ("data_y" if name == "data" and axis == "y" else prefix + axis), scale.name
        assert [(f[r[0]], r[1]) for r in scale.attrs["REFERENCE_LIST"]] == [(d, k)]
    assert list(d.dims[0][0].asstr()) == ["c0", "c1", "c2"] and list(d.dims[1][0]) == [0.5, 1.5] and d.dims[1][0].attrs["units"] == b"s"
    assert list(d.dims[2][0]) == [30, 33, 36, 39] and list(d.dims[4][0]) == [10, 11, 12, 13, 14, 15] and d.dims[4][0].attrs["units"] == b"mm"
END
    /usr/bin/python3 scales.py
    # Again and again: nothing is left, and nobody else's goes.
    series s.h5:/data s.h5:/g/second s.h5:/data
    /usr/bin/python3 scales.py
    vkt make ramp --dims 5 4 3 | vkt write - s.h5:/data --force
    /usr/bin/python3 -c '
import h5py
f = h5py.File("s.h5"); assert sorted(f) == ["data", "data_y", "g", "x", "y", "z"] and list(f["y"]) == list(range(7)) and "second_x" in f["g"], list(f)'
    # Axes that are turned, and times that nobody states, have names alone.
    for i in 1 2; do vkt make noise --dims 6 5 4 --seed $i; done | vkt set --direction 0,1,0,1,0,0,0,0,1 -o turned.h5
    /usr/bin/python3 -c '
import h5py
d = h5py.File("turned.h5")["data"]
assert [s[0].attrs["NAME"].startswith(b"This is a netCDF dimension but not a netCDF variable") for s in d.dims] == [True] * 4'
}

@test "xarray opens a series: names, coordinates and units of its dimensions" {
    export PYTHONPATH="$VKT_BUILD/xarray:$VKT_BUILD/hdf5plugin"
    /usr/bin/python3 -c 'import xarray, h5netcdf' 2>/dev/null || skip "no xarray: pip install --no-deps --target $VKT_BUILD/xarray h5netcdf xarray packaging pandas"
    series s.h5 g.h5:/g/vol
    /usr/bin/python3 - <<'END'
import subprocess, sys, warnings
warnings.simplefilter("ignore")
for other in "dask", "dask.array", "scipy": sys.modules[other] = None # the system's, of another NumPy
import numpy, xarray
want = subprocess.check_output("vkt write s.vkt - --format raw", shell=True)
for name, group, data in ("s.h5", None, "data"), ("g.h5", "g", "vol"):
    s = xarray.open_dataset(name, engine="h5netcdf", group=group)
    d = s[data]
    assert d.dims == tuple("ctzyx") and set(s.coords) == set("ctzyx") and d.values.tobytes() == want, s.sizes
    assert d.sel(c="c1", t=1.5, x=12, y=20, z=39).item() == numpy.frombuffer(want, "i2").reshape(3, 2, 4, 5, 6)[1, 1, 3, 0, 2]
    assert s.t.attrs["units"] == "s" and s.x.attrs["units"] == "mm"
END
}

@test "xarray opens single volumes with their coordinates and units; datasets may be called as the scales of others are" {
    vkt make noise --dims 6 5 4 --dtype int16 --seed 1 | vkt set --spacing 0.5,1,2 --origin 3,4,5 --attribute 'space units="mm" "mm" "mm"' --units HU -o v.h5
    vkt write v.h5 v.raw 2>/dev/null
    # Components that are named like axes: scales make room, and keep to their dataset.
    for name in x y z; do vkt write v.h5 c.h5:/g/$name --force; done
    for name in x y z; do vkt diff v.h5 c.h5:/g/$name --geometry; done
    vkt make ramp --dims 6 5 4 | vkt set --direction 0,1,0,1,0,0,0,0,1 -o turned.h5
    [ "$(vkt info v.h5 | grep -c 'not read')" -eq 0 ]
    /usr/bin/python3 - <<'END'
import h5py
f = h5py.File("c.h5")["g"]
assert sorted(f) == sorted(["x", "y", "z"] + [f"{d}_{a}" for d in "xyz" for a in "xyz"]), list(f)
for name in "xyz":
    for k, axis in enumerate("zyx"):
        scale = f[name].dims[k][0]
        assert scale.name == f"/g/{name}_{axis}" and scale.attrs["vkt_scale"] == f"/g/{name}".encode() and scale.attrs["units"] == b"mm", scale.name
    assert list(f[name].dims[2][0]) == [3, 3.5, 4, 4.5, 5, 5.5] and list(f[name].dims[0][0]) == [5, 7, 9, 11]
END
    export PYTHONPATH="$VKT_BUILD/xarray:$VKT_BUILD/hdf5plugin"
    /usr/bin/python3 -c 'import xarray, h5netcdf' 2>/dev/null || skip "no xarray: pip install --no-deps --target $VKT_BUILD/xarray h5netcdf xarray packaging pandas"
    /usr/bin/python3 - <<'END'
import sys, warnings
warnings.simplefilter("ignore")
for other in "dask", "dask.array", "scipy": sys.modules[other] = None # the system's, of another NumPy
import numpy, xarray
want = numpy.fromfile("v.raw", "i2").reshape(4, 5, 6)
d = xarray.open_dataset("v.h5", engine="h5netcdf")["data"]
assert d.dims == ("z", "y", "x") and set(d.coords) == set("zyx") and numpy.array_equal(d.values, want), d
assert list(d.x.values) == [3, 3.5, 4, 4.5, 5, 5.5] and list(d.y.values) == [4, 5, 6, 7, 8] and list(d.z.values) == [5, 7, 9, 11]
assert d.x.attrs["units"] == d.z.attrs["units"] == "mm" and d.attrs["units"] == "HU"
assert d.sel(x=4, y=6, z=9).item() == want[2, 2, 2]
c = xarray.open_dataset("c.h5", engine="h5netcdf", group="g")
assert c["y"].dims == ("y_z", "y_y", "y_x") and numpy.array_equal(c["y"].values, want) and list(c["y_x"].values) == list(d.x.values)
t = xarray.open_dataset("turned.h5", engine="h5netcdf")["data"]
assert t.dims == ("z", "y", "x") and not t.coords, t
END
}

@test "a dataset without a name is no folder of slices; names are no way out of a file" {
    vkt make ramp --dims 5 4 3 --dtype uint8 -o a.nrrd
    for name in / /g/ // /g//; do
        fails_with 2 "'x.h5:$name' names no dataset: its name is missing" vkt convert a.nrrd -o x.h5:$name
        [[ "$stderr" == *"e.g. -o x.h5:/group/volume"* ]]
    done
    fails_with 2 "its name is missing" vkt convert a.nrrd -o x.nc:/ --force
    for name in /.. /../a /g/../a /./a /a/.; do
        fails_with 2 "is no name" vkt convert a.nrrd -o x.h5:$name
    done
    [ -z "$(find . -name "x*" -o -name evil)" ]
    vkt convert a.nrrd -o x.h5:/..g/a..b
    vkt diff a.nrrd x.h5:/..g/a..b
    # A folder is still one.
    vkt convert a.nrrd -o folder:/
    [ -d folder: ]
}

@test "a dataset that is named leaves the others of its file, which is replaced whole, or not at all" {
    vkt make noise --dims 12 11 10 --dtype uint16 --seed 1 -o a.nrrd
    vkt make noise --dims 9 8 7 --dtype float32 --seed 2 -o b.nrrd
    /usr/bin/python3 -c '
import h5py, numpy
with h5py.File("k.h5", "w") as f:
    f["old"] = numpy.arange(60.).reshape(3, 4, 5)
    f["g/one"] = numpy.arange(8); f["g"].attrs["note"] = "kept"; f["text"] = "words"'
    cp k.h5 before.h5
    fails_with 4 'the file exists' vkt convert a.nrrd k.h5:/new
    vkt convert a.nrrd k.h5:/new --force
    vkt convert b.nrrd k.h5:/g/two --force --compress
    vkt convert b.nrrd k.h5:/old --force
    vkt diff a.nrrd k.h5:/new
    vkt diff b.nrrd k.h5:/g/two
    vkt diff b.nrrd k.h5:/old
    /usr/bin/python3 -c '
import h5py
f = h5py.File("k.h5")
assert sorted(f) == ["g", "new", "old", "old_x", "old_y", "old_z", "text", "x", "y", "z"] and sorted(f["g"]) == ["one", "two", "x", "y", "z"] and f["g"].attrs["note"] == "kept" and list(f["g/one"]) == list(range(8)) and f["text"][()] == b"words"'
    # Read from the file that it is added to.
    vkt flip x k.h5:/new -o k.h5:/flipped --force
    vkt diff a.nrrd k.h5:/new
    # In place of itself again and again: the room is used again.
    vkt convert a.nrrd k.h5:/new --force
    size=$(stat -c %s k.h5)
    for i in 1 2 3; do vkt convert a.nrrd k.h5:/new --force; done
    [ "$(stat -c %s k.h5)" -le $((size + 20000)) ]
    cp k.h5 kept.h5
    fails_with 2 "'/g' is a group" vkt convert a.nrrd k.h5:/g --force
    fails_with 2 "'/old' is no group" vkt convert a.nrrd k.h5:/old/new --force
    vkt read a.nrrd | head -c 2000 >cut.vkt
    fails_with 3 'ended early' vkt read cut.vkt -o k.h5:/new --force
    cmp k.h5 kept.h5
    echo words >words.h5
    fails_with 3 'no HDF5 file' vkt convert a.nrrd words.h5:/a --force
    [ "$(cat words.h5)" = words ]
    # Without a name the file is meant.
    vkt convert a.nrrd k.h5 --force
    /usr/bin/python3 -c 'import h5py; assert list(h5py.File("k.h5")) == ["data", "x", "y", "z"]'
    [ -z "$(find . -name '.*vkt-*')" ]
}

@test "chunks without filters: every order of bytes, regions, series, ends, and those that are missing" {
    /usr/bin/python3 - <<'END'
import h5py, numpy, subprocess
rng = numpy.random.default_rng(1)
a = rng.integers(0, 60000, (3, 19, 23, 31)).astype("<u2")
with h5py.File("chunks.h5", "w") as f:
    f.create_dataset("big", data=a, chunks=(1, 5, 7, 4), dtype=">u2")
    f.create_dataset("little", data=a[0], chunks=(5, 7, 4), dtype="<u2")
    f.create_dataset("many", data=a[0], chunks=(2, 2, 2), dtype="<u2") # more than are looked for
    f.create_dataset("series", data=a, chunks=(2, 5, 7, 4), dtype="<u2") # of two volumes in a chunk
    f.create_dataset("sparse", shape=(19, 23, 31), chunks=(5, 7, 4), dtype="<u2", fillvalue=7)[3, 4, 5] = 9
sparse = numpy.full((1, 19, 23, 31), 7, "<u2")
sparse[0, 3, 4, 5] = 9
for name, want in (("big", a), ("little", a[:1]), ("many", a[:1]), ("series", a), ("sparse", sparse)):
    for x0, x1, y0, y1, z0, z1 in (0, 31, 0, 23, 0, 19), (1, 29, 3, 20, 2, 17), (4, 8, 7, 14, 5, 10), (30, 31, 0, 23, 18, 19):
        got = subprocess.check_output(f"vkt read chunks.h5:/{name} --roi {x0}:{x1},{y0}:{y1},{z0}:{z1} | vkt write - --format raw -q", shell=True)
        assert got == want[:, z0:z1, y0:y1, x0:x1].tobytes(), (name, x0)
END
}

@test "what NetCDF and MATLAB say of numbers: signs, limits of cells, times, parts; integers of any width; MINC is named" {
    /usr/bin/python3 - <<'END'
from common import *
data = numpy.arange(-60, 60, dtype="i2").reshape(4, 5, 6)
def scale(f, name, values, **attributes):
    f[name] = values; f[name].make_scale(name); f[name].attrs.update(attributes)
def attach(f, name, *scales):
    for i, s in enumerate(scales): f[name].dims[i].attach_scale(f[s])
with h5py.File("n.nc", "w") as f:
    scale(f, "lev", numpy.array([10.0, 20, 30, 40]), bounds="lev_bnds"); scale(f, "lat", numpy.arange(5.0)); scale(f, "lon", numpy.arange(6.0))
    f["lev_bnds"] = numpy.zeros((4, 2))
    f["v"] = data; f["v"].attrs.update({"_Unsigned": "true", "_FillValue": numpy.int16(-1), "scale_factor": 0.5}); attach(f, "v", "lev", "lat", "lon")
i = infos("n.nc")[0] # the limits are no variable to choose from
assert i["dtype"] == "uint16" and voxels("n.nc") == data.tobytes() and i["attributes"]["_FillValue"] == "65535" and i["spacing"] == [1, 1, 10], i
with h5py.File("t.nc", "w") as f:
    scale(f, "step", numpy.array([0.0, 6, 12, 18]), units="hours since 2000-01-01"); scale(f, "lat", numpy.arange(5.0)); scale(f, "lon", numpy.arange(6.0))
    f["v"] = data; attach(f, "v", "step", "lat", "lon")
i = infos("t.nc")
assert len(i) == 4 and i[1]["dims"] == [6, 5, 1] and i[1]["attributes"]["sequence position"] == "6" and voxels("t.nc") == data.tobytes(), i
# Twelve bits of sixteen, in the middle; three bytes.
space = h5py.h5s.create_simple(data.shape)
for name, kind, size, precision, offset in (("a", h5py.h5t.STD_I16BE, 2, 12, 3), ("b", h5py.h5t.STD_I32LE, 3, 24, 0), ("c", h5py.h5t.STD_I64BE, 8, 40, 0)):
    t = kind.copy(); t.set_precision(precision); t.set_size(size); t.set_offset(offset)
    for chunks in (None, (2, 3, 4)):
        with h5py.File("w.h5", "w") as f:
            how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            if chunks: how.set_chunk(chunks)
            h5py.h5d.create(f.id, name.encode(), t, space, how).write(h5py.h5s.ALL, h5py.h5s.ALL, data.astype("i8"))
        assert voxels("w.h5") == data.astype({"a": "i2", "b": "i4", "c": "i8"}[name]).tobytes(), (name, chunks)
with h5py.File("m.mat", "w") as f:
    f["volume"] = data
    for name in ("#refs#/a", "#refs#/b", "#subsystem#/MCOS"): f[name] = numpy.zeros((2, 2))
    f["nothing"] = numpy.zeros((2, 3), "u8"); f["nothing"].attrs["MATLAB_empty"] = numpy.uint8(1)
    f["words"] = numpy.zeros((3, 3), "u2"); f["words"].attrs["MATLAB_class"] = numpy.bytes_("char")
assert voxels("m.mat") == data.tobytes()
with h5py.File("i.mnc", "w") as f: f["minc-2.0/image/0/image"] = data
assert voxels("i.mnc:/minc-2.0/image/0/image") == data.tobytes()
END
    fails_with 3 "is a MINC file, which is not read" vkt info i.mnc
}

@test "filters of others: LZF, Zstandard, LZ4, bzip2, Blosc, bitshuffle; those that nobody has are named" {
    # Chunks as the filters' own code writes them, in files that list the filters.
    /usr/bin/python3 - <<'END'
from common import *
import bz2, struct
rng = numpy.random.default_rng(3)
data = numpy.cumsum(rng.integers(-3, 4, (7, 12, 13)), axis=2).astype("i4")
for more in ({}, {"shuffle": True}, {"shuffle": True, "fletcher32": True}):
    for values in (data, rng.integers(-2**31, 2**31, data.shape).astype(">i4")):
        with h5py.File("lzf.h5", "w") as f: f.create_dataset("a", data=values, chunks=(3, 5, 7), compression="lzf", **more)
        assert voxels("lzf.h5") == values.astype("i4").tobytes(), more
def by_hand(name, id, settings, encode):
    """One chunk, and a filter that this library does not have: it may be left out, so that the file can be made."""
    with h5py.File(name, "w") as f:
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE); how.set_chunk(data.shape); how.set_filter(id, h5py.h5z.FLAG_OPTIONAL, settings)
        h5py.h5d.create(f.id, b"a", h5py.h5t.STD_I32LE, h5py.h5s.create_simple(data.shape), how).write_direct_chunk((0, 0, 0), encode(data.tobytes()))
def bitshuffled(plain, element=4, block=2048):
    """Bit k of byte j of all elements, by numpy."""
    a = numpy.frombuffer(plain, "u1").reshape(-1, element); n = len(a) // 8 * 8; out = b""
    for at in range(0, n, block):
        bits = numpy.unpackbits(a[at:min(at + block, n)], axis=1, bitorder="little")
        out += numpy.packbits(bits.T, axis=1, bitorder="little").tobytes()
    return out + a[n:].tobytes()
by_hand("bz2.h5", 307, (9,), bz2.compress)
by_hand("bitshuffle.h5", 32008, (0, 4, 4, 0, 0), bitshuffled)
by_hand("stored.h5", 32004, (), lambda b: struct.pack(">QI", len(b), 1000) + b"".join(struct.pack(">I", len(b[i:i + 1000])) + b[i:i + 1000] for i in range(0, len(b), 1000)))
for name in ("bz2", "bitshuffle", "stored"): assert voxels(name + ".h5") == data.tobytes(), name
for name in ("bz2", "bitshuffle", "stored"):
    bad = open(name + ".h5", "rb").read()
    at = bad.find(b"BZh9") if name == "bz2" else bad.find(bitshuffled(data.tobytes())[:64]) if name == "bitshuffle" else bad.find(struct.pack(">QI", data.nbytes, 1000)) + 12
    open(name + "-bad.h5", "wb").write(bad[:at] + bytes([255] * 40) + bad[at + 40:])
by_hand("zfp.h5", 32013, (1, 2), lambda b: b); by_hand("none.h5", 400, (), lambda b: b)
END
    fails_with 3 "cannot be read" vkt stats bz2-bad.h5
    fails_with 3 "cannot be read" vkt stats stored-bad.h5
    vkt stats bitshuffle-bad.h5 # other bits are other numbers
    fails_with 3 "compressed by filter 32013 (zfp), which is not read" vkt info zfp.h5
    fails_with 3 "compressed by filter 400, which is not read" vkt info none.h5
}

@test "filters of others, as hdf5plugin writes them" {
    # Its h5py is another one than Debian's.
    PYTHONPATH="$VKT_BUILD/hdf5plugin" /usr/bin/python3 -c 'import hdf5plugin' 2>/dev/null || skip "no hdf5plugin: pip install --target $VKT_BUILD/hdf5plugin hdf5plugin"
    PYTHONPATH="$PWD:$VKT_BUILD/hdf5plugin" /usr/bin/python3 - <<'END'
from common import *
import hdf5plugin as p
rng = numpy.random.default_rng(4)
for code in ("u1", "<i2", ">u2", "<f4", "<f8"):
    for values in (numpy.cumsum(rng.normal(size=(17, 33, 41)), axis=2) * 50, rng.integers(0, 256, (17, 33, 41))):
        values = values.astype(code)
        for how in (p.Zstd(), p.LZ4(), p.LZ4(nbytes=512), p.BZip2(), p.Blosc(cname="lz4"), p.Blosc(cname="zstd", shuffle=2), p.Blosc(cname="blosclz", shuffle=0),
                    p.Bitshuffle(cname="none"), p.Bitshuffle(cname="lz4"), p.Bitshuffle(nelems=64, cname="lz4"), p.Bitshuffle(cname="zstd")):
            for chunks in ((17, 33, 41), (4, 16, 16), (2, 1, 3)):
                with h5py.File("f.h5", "w") as f: f.create_dataset("a", data=values, chunks=chunks, **how)
                assert voxels("f.h5") == values.astype(values.dtype.newbyteorder("=")).tobytes(), (code, how, chunks)
with h5py.File("f.h5", "w") as f: f.create_dataset("a", data=values, chunks=(4, 16, 16), **p.Blosc2())
END
    fails_with 3 "compressed by filter 32026 (blosc2), which is not read" vkt info f.h5
}

@test "a region of a large file reads its chunks and little besides, wherever the root group has its names" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers need all of the address space and no tracer"
    command -v strace >/dev/null || skip "strace is not installed"
    /usr/bin/python3 - <<'END'
from common import *
import re
data = numpy.arange(256**3, dtype="u4").astype("u2").reshape(256, 256, 256)
def bytes_read(name, *command):
    subprocess.run(["strace", "-f", "-y", "-qq", "-e", "trace=read,pread64,preadv", "-o", "trace", *command], check=True,
                   stdout=subprocess.DEVNULL)
    return sum(int(n) for n in re.findall(rf"/{name}>.* = (\d+)$", open("trace").read(), re.M))
for name, others, how in (("one.h5", 0, {}), ("many.h5", 30, {}), ("new.h5", 1, {"libver": "latest"}),
                          ("dense.h5", 60, {"libver": "latest"}), ("block.h5", 1, {"userblock_size": 1024})):
    with h5py.File(name, "w", **how) as f:
        f.create_dataset("data", data=data, chunks=(64, 64, 64))
        for i in range(others): f.create_group(f"another of them {i}")
    assert 0 < bytes_read(name, "vkt", "info", name) < 300_000, (name, bytes_read(name, "vkt", "info", name))
    got = bytes_read(name, "vkt", "read", name, "--roi", "64:128,64:128,128:192", "-o", "part.raw", "--force")
    assert open("part.raw", "rb").read() == numpy.ascontiguousarray(data[128:192, 64:128, 64:128]).tobytes(), name
    assert 2 * 64**3 <= got <= data.nbytes / 32, (name, got)
END
}

@test "FLASH's files are told by the names in their root group, in every layout of it" {
    /usr/bin/python3 - <<'END'
from common import *
for name, how, others in (("old.h5", {}, 0), ("more.h5", {}, 200), ("new.h5", {"libver": "latest"}, 0),
                          ("dense.h5", {"libver": "latest"}, 200)):
    with h5py.File(name, "w", **how) as f:
        for i in range(others): f[f"variable {i}"] = numpy.zeros((4, 4, 4))
        f["refine level"] = numpy.ones(1, "i4")
    # They lack the rest, of which only the reader of FLASH speaks.
    run = subprocess.run(["vkt", "info", name], capture_output=True, text=True)
    assert run.returncode == 3 and "FLASH" in run.stderr, (name, run)
END
}

@test "a region of a dataset that is there: only its voxels change, how it is stored and all else of the file stay" {
    PYTHONPATH="$VKT_ROOT/tests" /usr/bin/python3 - <<'END'
from common import *
from region_writing import *
whole, part, want, rng = whole_and_part((20, 31, 33), 16)
layouts = {"plain": {}, "chunked": {"chunks": (4, 7, 8)}, "packed": {"chunks": (4, 7, 8), "compression": "gzip", "shuffle": True, "fletcher32": True},
           "flat": {"chunks": (1, 31, 33), "compression": "gzip"}}
with h5py.File("f.h5", "w") as f:
    for name, how in layouts.items():
        d = f.create_dataset("g/" + name, data=whole, **how)
        d.attrs["note"] = name
    f["big"] = whole.astype(">i2"); f["four"] = numpy.stack([whole, whole + 1])
    f["five"] = numpy.stack([numpy.stack([whole, whole + 1, whole + 2])] * 2)
    f["other"] = numpy.arange(7.0); f.create_dataset("wave", data=whole.astype("c8"), chunks=(5, 5, 5))
    f["soft"] = h5py.SoftLink("/g/chunked")
before = open("f.h5", "rb").read()
for memory in ("1GiB", "40k", "1k"):  # by layers of chunks, by slices, by rows
    for path in ("g/plain", "g/chunked", "g/packed", "g/flat", "big", "soft"):
        open("f.h5", "wb").write(before)
        run = put("f.h5:/" + path, "--at", "20,3,8", "--force", "--memory", memory)
        assert run.returncode == 0, (path, run.stderr)
        with h5py.File("f.h5") as f, h5py.File("before.h5", "w") as w:
            open("old.h5", "wb").write(before)
            with h5py.File("old.h5") as old:
                d, o = f[path], old[path]
                assert numpy.array_equal(d[()], want), (path, memory)
                assert (d.dtype, d.chunks, d.compression, d.shuffle, d.fletcher32, dict(d.attrs)) == (o.dtype, o.chunks, o.compression, o.shuffle, o.fletcher32, dict(o.attrs))
                names = []
                f.visit(names.append)
                for name in names:
                    if isinstance(f[name], h5py.Dataset) and f[name] != d: assert numpy.array_equal(f[name][()], old[name][()]), name
# One volume of several, several at once, the imaginary part.
for path, at, number, source in (("four", (0, 0, 0), 1, part), ("five", (2, 1, 0), 4, numpy.stack([part, part + 1]))):
    with h5py.File("f.h5") as f: w = f[path][()].reshape(-1, 20, 31, 33)
    w = put_into(w, source, number, "f.h5:/" + path, *at)
    with h5py.File("f.h5") as f: assert numpy.array_equal(f[path][()].reshape(-1, 20, 31, 33), w), path
numpy.save("p.npy", part.astype("f4"))
assert put("f.h5:/wave", "--at", "0,0,0", "--index", "1", "--force", source="p.npy").returncode == 0
w = whole.astype("c8"); w[:9, :11, :13].imag = part
with h5py.File("f.h5") as f: assert numpy.array_equal(f["wave"][()], w)
# The same as vkt copy, by any reader of ours.
open("f.h5", "wb").write(before)
assert put("f.h5:/g/packed", "--at", "20,3,8", "--force").returncode == 0
subprocess.check_call("vkt copy part.npy old.h5:/g/packed --at 20,3,8 | vkt diff - f.h5:/g/packed >/dev/null", shell=True)
END
    vkt make ramp --dims 30 20 10 --dtype uint8 | vkt set --spacing 2,2,3 -o ours.h5:/v
    vkt crop ours.h5:/v --roi 5:10,4:9,3:6 | vkt flip x | vkt write ours.h5:/v --at 5,4,3 --force
    vkt info ours.h5:/v | grep -q '^spacing *2 2 3$'
    vkt history ours.h5:/v --as-shell >again.sh
    grep -q -- 'vkt copy - <(.*) --at 5 4 3$' again.sh
    bash again.sh | vkt diff - ours.h5:/v
    [ -z "$(find . -name '.*vkt-*')" ]
}

@test "a region that cannot be written is refused, and nothing of the file is changed" {
    /usr/bin/python3 - <<'END'
from common import *
data = numpy.zeros((4, 5, 6), "u1")
with h5py.File("other.h5", "w") as f: f["g/d"] = data
with h5py.File("f.h5", "w") as f:
    f["d"] = data; f["float"] = data.astype("f4"); f["mask"] = data > 0; f["words"] = "text"; f["group/d"] = data
    f.create_dataset("lzf", data=data, chunks=(2, 5, 6), compression="lzf")
    f["scaled"] = data; f["scaled"].attrs["scale_factor"] = 2.0
    f["out"] = h5py.ExternalLink("other.h5", "/g"); f["far"] = h5py.ExternalLink("other.h5", "/g/d"); f["by"] = h5py.SoftLink("/out")
    f.create_dataset("elsewhere", shape=data.shape, dtype="u1", external=[("voxels.raw", 0, h5py.h5f.UNLIMITED)])
    layout = h5py.VirtualLayout(data.shape, "u1"); layout[:] = h5py.VirtualSource("other.h5", "g/d", data.shape)
    f.create_virtual_dataset("virtual", layout)
open("voxels.raw", "wb").write(data.tobytes())
numpy.save("part.npy", data[:2, :2, :2] + numpy.uint8(9))
END
    sha256sum f.h5 other.h5 voxels.raw >sums
    refused_and_foretold 4 'is changed only with --force' vkt write part.npy f.h5:/d --at 0,0,0
    refused_and_foretold 2 'is not there, and a region' vkt write part.npy f.h5:/new --at 0,0,0 --force
    refused_and_foretold 4 'no such file to write into' vkt write part.npy new.h5:/d --at 0,0,0 --force
    refused_and_foretold 2 'names no dataset' vkt write part.npy f.h5 --at 0,0,0 --force
    refused_and_foretold 2 "'/group' is a group" vkt write part.npy f.h5:/group --at 0,0,0 --force
    refused_and_foretold 2 'does not lie' vkt write part.npy f.h5:/d --at 5,0,0 --force
    refused_and_foretold 2 'does not lie' vkt write part.npy f.h5:/d --at -1,0,0 --force
    refused_and_foretold 2 'has 1 volume, and none of number 1' vkt write part.npy f.h5:/d --at 0,0,0 --index 1 --force
    refused_and_foretold 2 'vkt convert --dtype float32' vkt write part.npy f.h5:/float --at 0,0,0 --force
    refused_and_foretold 2 'holds values as 2' vkt write part.npy f.h5:/scaled --at 0,0,0 --force
    refused_and_foretold 2 'not all bits count' vkt write part.npy f.h5:/mask --at 0,0,0 --force
    refused_and_foretold 3 'holds' vkt write part.npy f.h5:/words --at 0,0,0 --force
    refused_and_foretold 2 'filter 32000 (lzf), which is read and not written' vkt write part.npy f.h5:/lzf --at 0,0,0 --force
    refused_and_foretold 2 'in which nothing is changed' vkt write part.npy f.h5:/elsewhere --at 0,0,0 --force
    refused_and_foretold 2 'in which nothing is changed' vkt write part.npy f.h5:/virtual --at 0,0,0 --force
    refused_and_foretold 2 "'/out' leads to another file" vkt write part.npy f.h5:/out/d --at 0,0,0 --force
    refused_and_foretold 3 "'/far' is a link to another file" vkt write part.npy f.h5:/far --at 0,0,0 --force
    refused_and_foretold 2 'leave out --compress' vkt write part.npy f.h5:/d --at 0,0,0 --force --compress
    refused_and_foretold 2 '--at is for HDF5 datasets' vkt write part.npy part.nrrd --at 0,0,0 --force
    fails_with 2 '--index goes with --at' vkt write part.npy f.h5:/d --index 1 --force
    # What joins a file neither follows links out of it.
    fails_with 2 "write it there: -o other.h5:/g/d" vkt write part.npy f.h5:/out/d --force
    fails_with 2 "'/by' leads to another file" vkt write part.npy f.h5:/by/new --force
    # Whoever is killed or ends early leaves the file as it was.
    vkt read part.npy | head -c 300 >cut.vkt
    fails_with 3 'ended early' vkt write cut.vkt f.h5:/d --at 0,0,0 --force
    mkfifo never
    vkt write never f.h5:/d --at 0,0,0 --force & writer=$!
    { vkt read part.npy | head -c 300; until [ -n "$(find . -name '.*vkt-*')" ]; do sleep 0.05; done; kill -9 $writer; } >never
    wait $writer || true
    until [ -z "$(find . -name '.*vkt-*')" ]; do sleep 0.05; done
    sha256sum --quiet -c sums
    vkt write part.npy f.h5:/far --force # the link goes, and what it led to stays
    sha256sum other.h5 voxels.raw | diff - <(tail -2 sums)
    vkt diff part.npy f.h5:/far
}

@test "a disk that is full is one line" {
    [ "$(id -u)" -eq 0 ] && mkdir small && mount -t tmpfs -o size=2m tmpfs small 2>/dev/null || skip "no small file system can be mounted"
    for options in "" --compress; do
        run vkt write <(vkt make noise --dims 96 96 96 --dtype float32) small/o.h5 $options
        [ "$status" -ne 0 ] || { umount small; false; }
        [ "${#lines[@]}" -le 2 ] || { umount small; false; }
        [ -z "$(ls -A small)" ] || { umount small; false; }
    done
    umount small
}
