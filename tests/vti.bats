#!/usr/bin/env bats
# VTK's images, .vti, .pvti and .vtk: voxels and places equal to VTK's, both ways, and damage refused.
load helper

setup_more() {
    python_with vtkmodules numpy
    cat >common.py <<'END'
import json, subprocess, sys, numpy
from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLImageDataWriter
from vtkmodules.vtkIOParallelXML import vtkXMLPImageDataWriter
from vtkmodules.vtkIOLegacy import vtkStructuredPointsReader, vtkStructuredPointsWriter
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.util import numpy_support
def infos(name):
    info = json.loads(subprocess.check_output(["vkt", "info", name, "--json"]))
    return info if isinstance(info, list) else [info]
def voxels(name, *options):
    dtype = infos(name)[0]["dtype"] if not options else None
    raw = subprocess.check_output(f"vkt read {name} {' '.join(options)} | vkt write - --format raw", shell=True)
    return numpy.frombuffer(raw, dtype) if dtype else raw
def image(array, name="scalars", spacing=(1, 1, 1), origin=(0, 0, 0), direction=None, lower=(0, 0, 0), cells=False):
    result = vtkImageData()
    size = [n + (1 if cells else 0) for n in array.shape[2::-1]]
    result.SetExtent(*[v for l, n in zip(lower, size) for v in (l, l + n - 1)])
    result.SetSpacing(spacing); result.SetOrigin(origin)
    if direction is not None: result.SetDirectionMatrix(direction)
    flat = array.reshape(-1, *array.shape[3:])
    data = numpy_support.numpy_to_vtk(flat, deep=True)
    data.SetName(name)
    (result.GetCellData() if cells else result.GetPointData()).SetScalars(data)
    return result
def place(info):
    m = numpy.eye(4)
    for a in range(3): m[:3, a] = numpy.array(info["direction"][a]) * info["spacing"][a]
    m[:3, 3] = info["origin"]
    return m
END
}

@test "what VTK wrote: ascii, base64, raw appended; no compressor, zlib, LZ4, LZMA; header types, byte orders, types" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(1)
n = 0
turned = (0, -1, 0, 1, 0, 0, 0, 0, 1)
for code in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"):
    data = (rng.normal(size=(5, 23, 19)) * 50).astype(code)
    picture = image(data, spacing=(0.5, 2, 3), origin=(-1, 7, 100), direction=turned, lower=(2, -3, 1))
    for mode in ("Ascii", "Binary", "Appended", "AppendedBase64"):
        for compressor in ("None", "ZLib", "LZ4", "LZMA"):
            if code not in ("u1", "i2", "f4") and compressor in ("LZ4", "LZMA"): continue
            for big in (False, True):
                for wide in (False, True):
                    if wide and code != "i2": continue
                    w = vtkXMLImageDataWriter()
                    w.SetFileName("a.vti"); w.SetInputData(picture)
                    getattr(w, "SetDataModeTo" + mode.replace("Base64", ""))()
                    if mode.startswith("Appended"): w.SetEncodeAppendedData(mode.endswith("64"))
                    getattr(w, "SetCompressorTypeTo" + compressor)()
                    w.SetBlockSize(1024)
                    (w.SetByteOrderToBigEndian if big else w.SetByteOrderToLittleEndian)()
                    (w.SetHeaderTypeToUInt64 if wide else w.SetHeaderTypeToUInt32)()
                    w.Write()
                    got = voxels("a.vti")
                    what = (code, mode, compressor, big, wide)
                    assert got.dtype == data.dtype and got.tobytes() == data.tobytes(), what
                    part = voxels("a.vti", "--roi", "3:11,5:20,1:4")
                    assert part == numpy.ascontiguousarray(data[1:4, 5:20, 3:11]).tobytes(), what
                    n += 1
    m = numpy.array(turned, float).reshape(3, 3) @ numpy.diag((0.5, 2, 3))
    want = numpy.eye(4); want[:3, :3] = m; want[:3, 3] = numpy.array((-1, 7, 100)) + m @ (2, -3, 1)
    assert numpy.allclose(place(infos("a.vti")[0]), want, atol=1e-12)
assert n > 150, n
END
}

@test "several arrays, cells, components, pieces" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(2)
points = rng.normal(size=(5, 6, 7)).astype("f4")
picture = image(points, "density")
more = numpy_support.numpy_to_vtk(rng.integers(0, 9, 210).astype("i2"), deep=True); more.SetName("label")
picture.GetPointData().AddArray(more)
cells = rng.normal(size=(4, 5, 6)).astype("f8")
of_cells = numpy_support.numpy_to_vtk(cells.ravel(), deep=True); of_cells.SetName("rate")
picture.GetCellData().AddArray(of_cells)
vectors = rng.normal(size=(210, 3)).astype("f4")
v = numpy_support.numpy_to_vtk(vectors, deep=True); v.SetName("flow")
picture.GetPointData().AddArray(v)
def write(p, name):
    w = vtkXMLImageDataWriter(); w.SetFileName(name); w.SetInputData(p); w.Write()
write(picture, "a.vti")
assert voxels("a.vti").tobytes() == points.tobytes() # the active scalars
assert voxels("a.vti", "--variable rate") == cells.tobytes()
assert voxels("a.vti", "--variable flow") == vectors.T.tobytes()
picture.GetPointData().SetActiveScalars(None)
write(picture, "b.vti")
p = vtkXMLPImageDataWriter()
p.SetFileName("p.pvti"); p.SetInputData(image(points, "density", spacing=(2, 3, 4))); p.SetNumberOfPieces(4)
p.SetStartPiece(0); p.SetEndPiece(3); p.Write()
assert voxels("p.pvti").tobytes() == points.tobytes()
assert infos("p.pvti")[0]["spacing"] == [2, 3, 4]
assert voxels("p.pvti", "--roi", "1:5,2:6,2:5") == numpy.ascontiguousarray(points[2:5, 2:6, 1:5]).tobytes()
END
    vkt info a.vti | grep -q 'variable rate: float64, cells'
    fails_with 2 "holds several variables: density, label, flow, rate" vkt stats b.vti
    fails_with 2 "did you mean 'rate'" vkt read a.vti --variable rote
    sed -i 's/Source="p_0/Source="..\/p_0/' p.pvti
    fails_with 3 "trust-paths" vkt stats p.pvti
    sed -i 's/Source="..\/p_0/Source="p_9/' p.pvti
    fails_with 4 "p_9" vkt stats p.pvti
}

@test "pieces in one file, by hand" {
    cat >two.vti <<'END'
<VTKFile type="ImageData" version="0.1" byte_order="LittleEndian">
<ImageData WholeExtent="0 3 0 1 0 0" Origin="0 0 0" Spacing="1 1 1">
<Piece Extent="0 1 0 1 0 0"><PointData Scalars="a"><DataArray type="Int16" Name="a" format="ascii">1 2 5 6</DataArray></PointData></Piece>
<Piece Extent="2 3 0 1 0 0"><PointData Scalars="a"><DataArray type="Int16" Name="a" format="ascii">
3 4 7
8</DataArray></PointData></Piece>
</ImageData></VTKFile>
END
    [ "$(vkt dump two.vti | tr -d '\n' | grep -o '{ .*')" = '{  [0] {1.0, 2.0, 3.0, 4.0}  [1] {5.0, 6.0, 7.0, 8.0}}' ]
    sed 's/7$/7 9/' two.vti >many.vti
    fails_with 3 "more values" vkt stats many.vti
    sed 's/^8/ /' two.vti >few.vti
    fails_with 3 "few" vkt stats few.vti
    sed 's/2 3 0 1 0 0"><P/2 2 0 1 0 0"><P/' two.vti >gap.vti && fails_with 3 "do not fill" vkt stats gap.vti
}

@test "pieces that overlap, with ghosts that their extents state or do not, and what tells them" {
    python_with vtkmodules numpy
    /usr/bin/python3 - <<'END'
import subprocess, sys, numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLPImageDataReader
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
data = numpy.random.default_rng(2).normal(size=(6, 7, 20)).astype("f4")
def piece(name, first, last, ghosts, cells):
    image = vtkImageData()
    image.SetExtent(first, last + cells, 0, 6 + cells, 0, 5 + cells)
    image.SetSpacing(0.5, 1, 2)
    into = image.GetCellData() if cells else image.GetPointData()
    part = data[:, :, first:last + 1]
    marks = numpy.zeros(part.shape, "u1")
    for x in ghosts: marks[:, :, x - first] = 1
    for array, words in ((part, "s"), (marks, "vtkGhostType")):
        values = numpy_to_vtk(numpy.ascontiguousarray(array).ravel(), deep=1)
        values.SetName(words)
        into.AddArray(values)
    writer = vtkXMLImageDataWriter()
    writer.SetFileName(name)
    writer.SetInputData(image)
    writer.Write()
def part(roi, *options):
    return subprocess.check_output(f"vkt read g.pvti {' '.join(options)} --roi {roi} | vkt write - --format raw", shell=True)
for cells in (False, True):
    piece("g_0.vti", 0, 11, (10, 11), cells)
    piece("g_1.vti", 8, 19, (8, 9), cells)
    for spans in (((0, 9), (10, 19)) if cells else ((0, 9), (9, 19)), ((0, 11), (8, 19))):
        pieces = "".join(f'<Piece Extent="{a} {b + cells} 0 {6 + cells} 0 {5 + cells}" Source="g_{k}.vti"/>' for k, (a, b) in enumerate(spans))
        kind = "PCellData" if cells else "PPointData"
        open("g.pvti", "w").write(f'''<VTKFile type="PImageData" version="0.1" byte_order="LittleEndian">
<PImageData WholeExtent="0 {19 + cells} 0 {6 + cells} 0 {5 + cells}" GhostLevel="2" Origin="0 0 0" Spacing="0.5 1 2">
<{kind}><PDataArray type="Float32" Name="s"/><PDataArray type="UInt8" Name="vtkGhostType"/></{kind}>
{pieces}</PImageData></VTKFile>''')
        reader = vtkXMLPImageDataReader()
        reader.SetFileName("g.pvti")
        reader.Update()
        output = reader.GetOutput()
        array = (output.GetCellData() if cells else output.GetPointData()).GetArray("s")
        assert vtk_to_numpy(array).tobytes() == data.tobytes()
        assert part(":,:,:") == data.tobytes(), (cells, spans)
        assert part("7:13,2:5,3:4") == data[3:4, 2:5, 7:13].tobytes()
        assert len(part(":,:,:", "--variable vtkGhostType")) == data.size
END
    sed -i 's/Extent="0 /Extent="-1 /; s/WholeExtent="0/WholeExtent="-1/' g.pvti
    fails_with 3 'has another extent' vkt stats g.pvti
}

@test "what vkt wrote is what VTK reads; all of the header comes back" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float32 float64; do
        vkt make noise --dims 30 20 6 --dtype $type | vkt set --spacing 0.5,0.25,2 --origin=-3,4,5 -o $type.vti
        vkt write $type.vti c_$type.vti --compress
        vkt write $type.vti $type.raw
        vkt diff $type.vti c_$type.vti
    done
    vkt make noise --dims 9 8 7 --dtype int16 | vkt set --slope 0.5 --intercept -7 --units HU --attribute 'who=a < b & "c"' -o h.vti
    vkt info h.vti --json >info
    grep -q '"slope": 0.5' info
    grep -q '"units": "HU"' info
    grep -q 'a < b &' info
    vkt history h.vti | grep -q noise
    vkt make noise --dims 9 8 7 --dtype float16 -o f.vkt
    fails_with 2 "cannot hold float16" vkt write f.vkt f.vti
    /usr/bin/python3 - <<'END'
from common import *
for name in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float32 float64".split():
    for prefix in ("", "c_"):
        r = vtkXMLImageDataReader(); r.SetFileName(prefix + name + ".vti"); r.Update()
        out = r.GetOutput()
        assert out.GetDimensions() == (30, 20, 6) and out.GetSpacing() == (0.5, 0.25, 2) and out.GetOrigin() == (-3, 4, 5)
        a = numpy_support.vtk_to_numpy(out.GetPointData().GetScalars())
        assert a.dtype == name and a.tobytes() == open(name + ".raw", "rb").read(), prefix + name
r = vtkXMLImageDataReader(); r.SetFileName("h.vti"); r.Update()
assert r.GetOutput().GetFieldData().GetAbstractArray("vkt_header").GetValue(0).startswith("{")
END
}

@test "channels are written as components if they are numbered, else as arrays; times are not" {
    for i in 0 1 2; do vkt make noise --dims 40 30 20 --dtype int16 --seed $i | vkt set --spacing 1,2,3 --origin 4,5,6 --attribute note=kept -o v$i.nrrd; done
    for i in 0 1 2; do vkt set v$i.nrrd --attribute channel=$i; done | vkt read - -o numbered.vkt
    for i in 0 1 2; do vkt set v$i.nrrd --attribute channel="red & $i"; done | vkt read - -o named.vkt
    for how in "" --compress; do
        vkt write numbered.vkt numbered$how.vti $how 2>err
        vkt write named.vkt named$how.vti $how 2>>err
        [ ! -s err ]
        for name in numbered named; do
            vkt diff $name.vkt $name$how.vti
            vkt read $name$how.vti -o back.vkt --force
            diff <(vkt info $name.vkt --json | grep -v '"format"\|history\|vkt ') <(vkt info back.vkt --json | grep -v '"format"\|history\|vkt ')
        done
        vkt read named$how.vti --variable 'red & 1' | vkt diff - v1.nrrd
    done
    /usr/bin/python3 - <<'END'
from common import *
want = [numpy.frombuffer(subprocess.check_output(f"vkt write v{i}.nrrd - --format raw", shell=True), "i2") for i in range(3)]
for how in "", "--compress":
    for name in "numbered", "named":
        r = vtkXMLImageDataReader(); r.SetFileName(f"{name}{how}.vti"); r.Update()
        o = r.GetOutput(); points = o.GetPointData()
        assert o.GetDimensions() == (40, 30, 20) and o.GetSpacing() == (1, 2, 3) and o.GetOrigin() == (4, 5, 6)
        if name == "numbered":
            assert points.GetNumberOfArrays() == 1 and points.GetScalars().GetNumberOfComponents() == 3
            assert (numpy_support.vtk_to_numpy(points.GetScalars()).T == want).all()
        else:
            assert [points.GetArrayName(i) for i in range(3)] == [f"red & {i}" for i in range(3)]
            for i in range(3): assert (numpy_support.vtk_to_numpy(points.GetArray(i)) == want[i]).all()
END
    vkt stack v0.nrrd v1.nrrd -o times.nrrd
    fails_with 2 "a .vti file holds channels, no times" vkt convert times.nrrd times.vti
    [[ "$stderr" == *"out_%04d.vti"* ]]
    fails_with 2 "holds several volumes" vkt convert numbered.vkt x.pvti
    fails_with 2 "their number comes first" bash -c 'set -o pipefail; vkt write numbered.vkt - --format vti | cat >/dev/null'
    [ -z "$(find . -name 'times.vti' -o -name 'x.pvti' -o -name '.*vkt-*')" ]
    # The map of values, which only vkt finds.
    vkt set v0.nrrd --voxel-mapping -1024 3071 -o mapped.nrrd
    for file in mapped.vti mapped.pvti; do
        vkt convert mapped.nrrd $file 2>err
        [ "$(grep -c 'other programs take the values of VTI files as they are stored' err)" = 1 ]
        vkt diff mapped.nrrd $file
    done
}

@test "legacy files: text and binary, types, several arrays, cells" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(4)
for code in ("u1", "i1", "u2", "i2", "u4", "i4", "f4", "f8"):
    data = (rng.normal(size=(5, 23, 19)) * 50).astype(code)
    if code[0] == "f": data = numpy.round(data * 4) / 4 # so that a few digits are all
    for binary in (False, True):
        w = vtkStructuredPointsWriter()
        w.SetFileName("a.vtk"); w.SetInputData(image(data, spacing=(0.5, 2, 3), origin=(-1, 7, 100)))
        (w.SetFileTypeToBinary if binary else w.SetFileTypeToASCII)()
        w.Write()
        got = voxels("a.vtk")
        assert got.dtype == data.dtype and got.tobytes() == data.tobytes(), (code, binary)
        assert voxels("a.vtk", "--roi", "3:11,5:20,1:4") == numpy.ascontiguousarray(data[1:4, 5:20, 3:11]).tobytes()
        info = infos("a.vtk")[0]
        assert info["spacing"] == [0.5, 2, 3] and info["origin"] == [-1, 7, 100], info
points = rng.integers(0, 99, (5, 6, 7)).astype("f4")
picture = image(points, "density")
more = numpy_support.numpy_to_vtk(rng.integers(0, 9, 210).astype("i2"), deep=True); more.SetName("label")
picture.GetPointData().AddArray(more)
cells = rng.integers(0, 99, (4, 5, 6)).astype("f8")
of_cells = numpy_support.numpy_to_vtk(cells.ravel(), deep=True); of_cells.SetName("rate")
picture.GetCellData().SetScalars(of_cells)
for binary in (False, True):
    w = vtkStructuredPointsWriter(); w.SetFileName("m.vtk"); w.SetInputData(picture)
    (w.SetFileTypeToBinary if binary else w.SetFileTypeToASCII)()
    w.Write()
    assert voxels("m.vtk", "--variable density") == points.tobytes()
    assert voxels("m.vtk", "--variable rate") == cells.tobytes()
    assert voxels("m.vtk", "--variable label") == numpy_support.vtk_to_numpy(more).tobytes()
END
    fails_with 2 "holds several variables" vkt stats m.vtk
    head -c 900 a.vtk >short.vtk
    fails_with 3 "short.vtk" vkt stats short.vtk
    sed 's/STRUCTURED_POINTS/POLYDATA/' a.vtk >poly.vtk
    fails_with 3 "holds POLYDATA, not STRUCTURED_POINTS" vkt stats poly.vtk
}

@test "legacy files and images in parts that vkt wrote are what VTK reads; what is lost is said" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float32 float64; do
        vkt make noise --dims 31 20 12 --dtype $type --seed 3 | vkt set --spacing 0.5,0.25,2 --origin=-3,4,5 -o $type.nrrd
        vkt write $type.nrrd $type.vtk 2>err
        [ ! -s err ]
        vkt write $type.nrrd $type.pvti
        vkt write $type.nrrd c_$type.pvti --compress
        vkt diff $type.nrrd $type.vtk
        vkt diff $type.nrrd $type.pvti
        vkt diff $type.nrrd c_$type.pvti
        vkt write $type.nrrd $type.raw
    done
    /usr/bin/python3 - <<'END'
from common import *
from vtkmodules.vtkIOXML import vtkXMLPImageDataReader
for name in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float32 float64".split():
    for kind, file in ((vtkStructuredPointsReader, name + ".vtk"), (vtkXMLPImageDataReader, name + ".pvti"),
                       (vtkXMLPImageDataReader, "c_" + name + ".pvti"), (vtkXMLImageDataReader, f"{name}/{name}_3.vti")):
        r = kind(); r.SetFileName(file); r.Update()
        out = r.GetOutput()
        got = numpy_support.vtk_to_numpy(out.GetPointData().GetScalars())
        want = numpy.fromfile(name + ".raw", name)
        if file.endswith("vti") and "/" in file:
            e = out.GetExtent()
            assert e[:4] == (0, 30, 0, 19) and e[5] > e[4] > 0, e
            want = want.reshape(12, 20, 31)[e[4]:e[5] + 1].ravel()
        else:
            assert out.GetDimensions() == (31, 20, 12), file
        assert out.GetSpacing() == (0.5, 0.25, 2) and out.GetOrigin() == (-3, 4, 5), file
        assert got.dtype == numpy.dtype(name) and (got == want).all(), file
END
    [ "$(find uint8 -name '*.vti' | wc -l)" = 8 ]
    vkt set int16.nrrd --slope 0.5 --units HU --attribute 'variable=a b%' -o t.vkt
    vkt write t.vkt t.vtk 2>err
    grep -q 'do not hold the map of values, units' err
    fails_with 3 'do not hold' vkt read t.vkt -o s.vtk --strict
    vkt info t.vtk | grep -q 'variable: a b%'
    # Parts keep all of the header, and come and go as a whole.
    vkt write t.vkt t.pvti
    vkt info t.pvti --json | grep -q '"units": "HU"'
    fails_with 4 'exists' vkt write t.vkt t.pvti
    vkt write int16.nrrd t.pvti --force
    vkt diff t.pvti int16.nrrd
    touch t/other
    fails_with 4 'no pieces' vkt write t.vkt t.pvti --force
    vkt make noise --dims 9 8 1 -o one.pvti
    vkt make noise --dims 9 8 1 | vkt diff - one.pvti
    [ -z "$(find . -name '.*vkt-*')" ]
}

@test "damaged files end in an error and never in a crash" {
    vkt make noise --dims 30 20 6 --dtype uint16 -o a.vti
    vkt write a.vti c.vti --compress
    /usr/bin/python3 - <<'END'
import random
from common import *
data = numpy.arange(600, dtype="i2").reshape(5, 10, 12)
w = vtkXMLImageDataWriter(); w.SetFileName("b.vti"); w.SetInputData(image(data)); w.SetDataModeToBinary(); w.Write()
w = vtkStructuredPointsWriter(); w.SetFileName("l.vtk"); w.SetInputData(image(data)); w.SetFileTypeToASCII(); w.Write()
random.seed(6)
for name in ("a.vti", "c.vti", "b.vti", "l.vtk"):
    good = open(name, "rb").read()
    for i in range(40):
        bad = bytearray(good)
        for _ in range(random.randint(1, 6)): bad[random.randrange(min(len(bad), 3000))] = random.randrange(256)
        if i % 3 == 0: bad = bad[:random.randrange(8, len(bad))]
        open("bad" + name[-4:], "wb").write(bad)
        run = subprocess.run(["vkt", "stats", "bad" + name[-4:]], capture_output=True, timeout=60)
        assert run.returncode in (0, 1, 2, 3, 4), (name, i, run.returncode, run.stderr)
END
    sed 's/WholeExtent="0 29 0 19 0 5"/WholeExtent="0 999999999 0 999999999 0 9999"/; s/Extent="0 29 0 19 0 5">/Extent="0 999999999 0 999999999 0 9999">/' a.vti >huge.vti
    fails_with 3 "huge.vti" vkt stats huge.vti
    printf '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><VTKFile type="ImageData">&b;</VTKFile>' >bomb.vti
    fails_with 3 "entities" vkt stats bomb.vti
    # An element where an array's numbers are, found by fuzzing: the array's end was looked for in the piece within it.
    printf '%s' '<VTKFile type="ImageData"><ImageData WholeExtent="0 1 0 1 0 1" Origin="0 0 0" Spacing="1 1 1">' \
        '<Piece Extent="0 1 0 1 0 1"><PointData><DataArray type="UInt8" Name="a" format="ascii">1' \
        '<Piece Extent="0 1 0 1 0 1"/></DataArray></PointData></Piece></ImageData></VTKFile>' >nested.vti
    fails_with 3 "within the numbers" vkt stats nested.vti
    printf '<?xml version="1.0"?><VTKFile type="UnstructuredGrid"></VTKFile>' >grid.vtu
    fails_with 3 "VTK XML file" vkt stats grid.vtu
}

@test "the sample" {
    needs_data vti/hydrogen.vti
    /usr/bin/python3 - "$VKT_DATA/vti/hydrogen.vti" <<'END'
from common import *
r = vtkXMLImageDataReader(); r.SetFileName(sys.argv[1]); r.Update()
a = numpy_support.vtk_to_numpy(r.GetOutput().GetPointData().GetArray(0))
assert voxels(sys.argv[1]).tobytes() == a.tobytes()
END
    vkt write "$VKT_DATA/vti/hydrogen.vti" again.vti && vkt diff "$VKT_DATA/vti/hydrogen.vti" again.vti
}

@test "what VTK says of arrays between their numbers; extents, texts, bits, ids, vectors and colours of legacy files" {
    /usr/bin/python3 - <<'END'
from common import *
from vtkmodules.vtkCommonCore import vtkBitArray, vtkDataArray, vtkIdTypeArray, vtkStringArray
rng = numpy.random.default_rng(12)
points = rng.integers(0, 99, (5, 6, 7)).astype("f4")
picture = image(points, "density", spacing=(0.5, 2, 3), origin=(-1, 7, 100), lower=(2, -3, 1))
data = picture.GetPointData()
data.GetScalars().GetInformation().Set(vtkDataArray.UNITS_LABEL(), "K")
def add(array, name, how="AddArray"):
    v = numpy_support.numpy_to_vtk(array, deep=True); v.SetName(name); getattr(data, how)(v); return v
flow = rng.integers(-9, 9, (210, 3)).astype("f4")
add(flow, "flow", "SetVectors").SetComponentName(0, "X")
def write(writer, name, **set):
    writer.SetFileName(name); writer.SetInputData(picture)
    for key, value in set.items(): getattr(writer, key)(*value)
    writer.Write()
# The information stands behind the numbers, and numbers behind it would do as well.
for mode in ("Ascii", "Binary", "Appended"):
    write(vtkXMLImageDataWriter(), "a.vti", **{"SetDataModeTo" + mode: ()})
    assert voxels("a.vti").tobytes() == points.tobytes(), mode
    assert voxels("a.vti", "--variable flow") == flow.T.tobytes(), mode
write(vtkXMLImageDataWriter(), "a.vti", SetDataModeToAscii=())
text = open("a.vti").read()
assert text.count("<InformationKey") == 2
key = text[text.index("<InformationKey"):text.index("</InformationKey>") + 17]
first = text.index("<DataArray"); begin = text.index(">", first) + 1
open("before.vti", "w").write(text[:begin] + key + text[begin:].replace(key, "", 1))
assert voxels("before.vti").tobytes() == points.tobytes()
# Legacy files.
add(rng.integers(0, 9, 210).astype("i8"), "ids", "SetGlobalIds")
ids = vtkIdTypeArray(); ids.SetName("numbers"); ids.SetNumberOfTuples(210)
for i in range(210): ids.SetValue(i, 3 * i)
data.AddArray(ids)
bits = vtkBitArray(); bits.SetName("bits"); words = vtkStringArray(); words.SetName("words")
for i in range(210): bits.InsertNextValue(i & 1); words.InsertNextValue("w %d" % i if i % 3 else "long" * i)
data.AddArray(bits); data.AddArray(words)
title = vtkStringArray(); title.SetName("a title"); title.InsertNextValue("two\nlines"); title.InsertNextValue(""); picture.GetFieldData().AddArray(title)
for binary in (False, True):
    for extent in (False, True):
        write(vtkStructuredPointsWriter(), "a.vtk", SetWriteExtent=(extent,), **{"SetFileTypeTo" + ("Binary" if binary else "ASCII"): ()})
        what = (binary, extent)
        assert voxels("a.vtk", "--variable density") == points.tobytes(), what
        assert voxels("a.vtk", "--variable flow") == flow.T.tobytes(), what
        assert voxels("a.vtk", "--variable flow", "--roi", "3:,1:4,2:") == numpy.ascontiguousarray(flow.reshape(5, 6, 7, 3)[2:, 1:4, 3:].transpose(3, 0, 1, 2)).tobytes(), what
        assert voxels("a.vtk", "--variable numbers") == numpy.arange(0, 630, 3, dtype="i4").tobytes(), what
        i = infos("a.vtk")[0]
        assert i["origin"] == [0, 1, 103] and i["spacing"] == [0.5, 2, 3], i
for channels in (1, 3, 4):
    for code in ("u1", "u2"):
        colours = rng.integers(0, 256, (3, 4, 5, channels)).astype(code)
        picture = image(colours, "rgb")
        for kind in ("ASCII", "Binary"):
            write(vtkStructuredPointsWriter(), "c.vtk", **{"SetFileTypeTo" + kind: ()})
            assert voxels("c.vtk").tobytes() == numpy.ascontiguousarray(colours.transpose(3, 0, 1, 2)).tobytes(), (channels, code, kind)
            if channels > 1: assert infos("c.vtk")[1]["attributes"]["channel"] == "1"
w = vtkXMLImageDataWriter(); w.SetFileName("times.vti"); w.SetInputData(picture); w.SetNumberOfTimeSteps(2)
w.Start(); w.WriteNextTime(0); w.WriteNextTime(1); w.Stop()
END
    vkt info a.vtk | grep -q "not read *array 'words' of type string"
    # Version 1.0 has blank lines.
    printf '# vtk DataFile Version 1.0\nx\n\nASCII\n\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 1\nASPECT_RATIO 1 1 1\n\nPOINT_DATA 4\nSCALARS s char\n\nLOOKUP_TABLE default\n1 0 1 1\n' >old.vtk
    [ "$(vkt stats old.vtk --json | tr -d ' \n' | grep -o '"sum":3')" = '"sum":3' ]
    fails_with 3 "holds 2 time steps in one file, which is not read" vkt info times.vti
    printf '# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 1\nPOINT_DATA 4\nSCALARS s bit\n1 0 1 1\n' >bits.vtk
    fails_with 3 "holds no array of numbers, but array 's' of type bit, which is not read" vkt info bits.vtk
}

@test "collections (.pvd): a series is an image for each time, its times and places those of the series, and back" {
    cat >make.py <<'END'
from common import *
import itertools
rng = numpy.random.default_rng(5)
def series(name, times, channels=(None,), order="tc", dtype="i2"):
    """Volumes in this order, through vkt stack; returns {(time, channel): voxels}."""
    all = {}
    axes = {"t": times, "c": channels}
    for i, key in enumerate(itertools.product(*(axes[a] for a in order))):
        at = dict(zip(order, key))
        v = rng.integers(-99, 99, (4, 5, 6)).astype(dtype)
        all[at["t"], at["c"]] = v
        numpy.save("v.npy", v)
        said = ["--attribute", f"sequence position={at['t']}"] + (["--attribute", f"channel={at['c']}"] if at["c"] is not None else [])
        subprocess.check_call(["vkt", "set", "v.npy", "--spacing", "0.5,1,2", "--origin", "3,4,5", *said, "-o", f"part{i:03}.nrrd", "--force"])
    parts = [f"part{i:03}.nrrd" for i in range(len(all))]
    subprocess.check_call(["vkt", "stack", *parts, "--along", "series", "-o", name])
    return all
END
    /usr/bin/python3 - <<'END'
from make import *
import glob, xml.etree.ElementTree as tree
def collection(name):
    root = tree.parse(name).getroot()
    assert root.tag == "VTKFile" and root.get("type") == "Collection" and root[0].tag == "Collection", name
    return {float(d.get("timestep")): d.get("file") for d in root[0]}
def arrays(name):
    r = vtkXMLImageDataReader(); r.SetFileName(name); r.Update()
    i = r.GetOutput()
    assert i.GetSpacing() == (0.5, 1, 2) and i.GetOrigin() == (3, 4, 5) and i.GetDimensions() == (6, 5, 4)
    p = i.GetPointData()
    return {p.GetArrayName(k): numpy_support.vtk_to_numpy(p.GetArray(k)) for k in range(p.GetNumberOfArrays())}
def read(name):
    parts = [numpy.frombuffer(subprocess.check_output(f"vkt read {name} --index {i} | vkt write - --format raw", shell=True), info["dtype"])
             for i, info in enumerate(infos(name))]
    def said(info, what): return info["attributes"].get(what)
    return {(float(said(i, "sequence position")), said(i, "channel")): v for i, v in zip(infos(name), parts)}
for n, (times, channels, order) in enumerate((
        ((0.5, 1.5, 2.5), (None,), "tc"), ((0, 1, 7.25), (None,), "tc"), ((3,), (None,), "tc"),
        ((0, 2), ("0", "1", "2"), "tc"), ((0, 2, 4), ("0", "1"), "ct"), ((0, 2), ("red", "green"), "tc"), ((1, 5), ("red", "green", "blue"), "ct"))):
    name = f"s{n}.pvd"
    want = series(name, times, channels, order)
    listed = collection(name)
    assert sorted(listed) == sorted(times) and len(glob.glob(f"s{n}/*")) == len(times), listed
    for t in times:
        found = arrays(listed[t])
        for k, c in enumerate(channels):
            v = found[c] if c in ("red", "green", "blue") else found["values"]
            v = v[:, k] if v.ndim == 2 else v
            assert numpy.array_equal(v, want[t, c].ravel()), (name, t, c)
    back = read(name)
    assert len(back) == len(want)
    for (t, c), v in want.items(): assert numpy.array_equal(back[t, c], v.ravel()), (name, t, c)
    for i in infos(name): assert i["spacing"] == [0.5, 1, 2] and i["origin"] == [3, 4, 5] and i["format"] == "pvd"
END
    # What is there is replaced if it is nothing else.
    fails_with 4 'the file exists' vkt write s0.pvd s1.pvd
    vkt write s0.pvd s1.pvd --force
    [ "$(ls s1)" = "$(printf 's1_%04d.vti\n' 0 1 2)" ]
    touch s1/mine
    fails_with 4 'holds files that are no VTK images' vkt write s0.pvd s1.pvd --force
    fails_with 2 'a collection is several files' vkt write s0.pvd s9.pvd.gz
    fails_with 2 'cannot go to a pipe' bash -c 'set -o pipefail; vkt write s0.pvd - --format pvd | cat'
    vkt make ramp --dims 3 3 3 --dtype float16 -o half.vkt
    fails_with 2 'cannot hold float16' vkt write half.vkt half.pvd
    vkt read s0.pvd | head -c 1500 >cut.vkt
    fails_with 3 'ended early' vkt write cut.vkt cut.pvd
    for name in cut.pvd cut half.pvd half; do [ ! -e $name ]; done
    [ -z "$(find . -name '.*vkt-*')" ]
}

@test "collections of others: order of times, pieces, parts of no one volume, names that lead away, damage" {
    /usr/bin/python3 - <<'END'
from common import *
import os, random
os.makedirs("d/sub")
rng = numpy.random.default_rng(3)
want = {}
for t in (10, 2, 2.5):
    want[t] = rng.normal(size=(3, 4, 5)).astype("f4")
    w = vtkXMLImageDataWriter(); w.SetFileName(f"d/sub/a{t}.vti"); w.SetInputData(image(want[t], spacing=(1, 2, 3), origin=(7, 8, 9))); w.Write()
w = vtkXMLPImageDataWriter(); w.SetFileName("d/p.pvti"); w.SetInputData(image(want[10])); w.SetNumberOfPieces(2); w.SetStartPiece(0); w.SetEndPiece(1); w.Write()
def put(name, *entries):
    with open(name, "w") as f:
        f.write('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian"><Collection>')
        for e in entries: f.write("<DataSet " + " ".join(f'{k}="{v}"' for k, v in e.items()) + "/>")
        f.write("</Collection></VTKFile>")
put("d/a.pvd", *({"timestep": t, "group": "", "part": 0, "file": f"sub/a{t}.vti"} for t in (10, 2, 2.5)))
got = infos("d/a.pvd")
assert [i["attributes"]["sequence position"] for i in got] == ["2", "2.5", "10"] and all(i["spacing"] == [1, 2, 3] and i["origin"] == [7, 8, 9] for i in got)
assert voxels("d/a.pvd", "--roi 1:3,:,1:") == b"".join(numpy.ascontiguousarray(want[t][1:, :, 1:3]).tobytes() for t in (2, 2.5, 10))
assert voxels("d/a.pvd", "--index 1") == want[2.5].tobytes()
put("one.pvd", {"file": "d/sub/a2.vti"}); put("pieces.pvd", {"timestep": 4, "file": "d/p.pvti"})
assert voxels("one.pvd", "--roi :,:,:") == want[2].tobytes() and "sequence position" not in infos("one.pvd")[0]["attributes"]
assert voxels("pieces.pvd", "--roi :,:,:") == want[10].tobytes()
put("parts.pvd", {"timestep": 1, "part": 0, "file": "d/sub/a2.vti"}, {"timestep": 1, "part": 1, "file": "d/sub/a10.vti"})
put("d/away.pvd", {"timestep": 1, "file": "../one.vti"}); put("none.pvd"); put("word.pvd", {"timestep": "now", "file": "x.vti"})
put("absent.pvd", {"timestep": 1, "file": "x.vti"})
open("mesh.vtu", "w").write('<VTKFile type="UnstructuredGrid" version="0.1"><UnstructuredGrid/></VTKFile>'); put("mesh.pvd", {"timestep": 1, "file": "mesh.vtu"})
open("bomb.pvd", "w").write('<!DOCTYPE a [<!ENTITY b "c">]><VTKFile type="Collection"><Collection/></VTKFile>')
good = open("d/a.pvd", "rb").read()
random.seed(4)
for i in range(60):
    bad = bytearray(good)
    for _ in range(random.randint(1, 5)): bad[random.randrange(len(bad))] = random.randrange(256)
    if i % 3 == 0: bad = bad[:random.randrange(30, len(bad))]
    open("d/bad.pvd", "wb").write(bad)
    run = subprocess.run(["vkt", "stats", "d/bad.pvd"], capture_output=True, timeout=120)
    assert run.returncode in (0, 1, 2, 3, 4), (i, run.returncode, run.stderr)
END
    fails_with 3 'names several files at time 1' vkt info parts.pvd
    fails_with 3 'which leads out of its directory' vkt info d/away.pvd
    fails_with 3 'names no file' vkt info none.pvd
    fails_with 3 'timestep="now" is no number' vkt info word.pvd
    fails_with 4 "cannot open" vkt info absent.pvd
    fails_with 3 'holds UnstructuredGrid, not ImageData' vkt info mesh.pvd
    fails_with 3 'defines entities of its own' vkt info bomb.pvd
}
