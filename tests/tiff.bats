#!/usr/bin/env bats
# TIFF stacks: voxels and spacing equal to tifffile's, both ways, and damage refused.
load helper

setup_more() {
    python_with tifffile numpy
    vkt make noise --dims 2 2 2 -o probe.tif 2>err || { grep -q 'without it' err && skip 'built without TIFF'; cat err >&2; false; }
    cat >voxels.py <<'END'
import json, subprocess, numpy
def infos(name, *options):
    info = json.loads(subprocess.check_output(["vkt", "info", name, "--json"]))
    return info if isinstance(info, list) else [info]
def voxels(name, *options):
    info = infos(name)
    raw = subprocess.check_output(f"vkt read '{name}' {' '.join(options)} | vkt write - --format raw", shell=True)
    return numpy.frombuffer(raw, info[0]["dtype"])
END
}

@test "what tifffile wrote: types, byte orders, BigTIFF, strips, tiles, compressions" {
    /usr/bin/python3 - <<'END'
import tifffile, numpy
from voxels import *
rng = numpy.random.default_rng(1)
n = 0
def check(name, data):
    got = voxels(name)
    assert got.dtype == data.dtype.newbyteorder("="), (name, got.dtype)
    assert got.tobytes() == data.astype(got.dtype).tobytes(), name
    # A part of it is that part.
    part = subprocess.check_output(f"vkt read {name} --roi 3:19,5:30,1:3 | vkt write - --format raw", shell=True)
    assert part == numpy.ascontiguousarray(data.astype(got.dtype)[1:3, 5:30, 3:19]).tobytes(), (name, "part")
for code in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"):
    data = (rng.normal(size=(4, 37, 41)) * 50).astype(code)
    for order in "<>":
        for options in ({}, {"bigtiff": True}, {"rowsperstrip": 5}, {"tile": (16, 32)}):
            name = f"t{n}.tif"; n += 1
            tifffile.imwrite(name, data, byteorder=order, photometric="minisblack", **options)
            check(name, data)
data = (rng.normal(size=(4, 37, 41)) * 50).astype("i2")
for compression in ("zlib", "zlib+"):
    for order in "<>":
        for options in ({}, {"rowsperstrip": 7}, {"tile": (16, 16)}):
            name = f"c{n}.tif"; n += 1
            tifffile.imwrite(name, data, byteorder=order, photometric="minisblack", compression="zlib",
                             predictor=compression.endswith("+"), **options)
            check(name, data)
print(n)
END
}

@test "libtiff's own compressions, and values of few bits" {
    command -v tiffcp >/dev/null || skip 'no tiffcp'
    vkt make noise --dims 40 30 3 --dtype uint8 --seed 3 -o a.tif
    vkt write a.tif a.raw
    for codec in lzw packbits zip lzma zstd none; do
        tiffcp -c $codec a.tif $codec.tif || continue
        vkt read $codec.tif | vkt write - --format raw | cmp - a.raw
        tiffcp -t -w 16 -l 16 -c $codec a.tif tiled_$codec.tif
        vkt read tiled_$codec.tif | vkt write - --format raw | cmp - a.raw
    done
    [ -e lzw.tif ]
    [ -e packbits.tif ]
    /usr/bin/python3 - <<'END'
import struct, numpy, subprocess
from voxels import *
# One bit and twelve bits a value, by hand: no writer at hand makes them.
rng = numpy.random.default_rng(2)
for bits in (1, 2, 4, 12):
    data = rng.integers(0, 1 << bits, (6, 10))
    rows = b""
    for row in data:
        line = "".join(format(v, f"0{bits}b") for v in row)
        line += "0" * (-len(line) % 8)
        rows += bytes(int(line[i:i + 8], 2) for i in range(0, len(line), 8))
    tags = [(256, 4, 1, 10), (257, 4, 1, 6), (258, 3, 1, bits), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8),
            (277, 3, 1, 1), (278, 4, 1, 6), (279, 4, 1, len(rows))]
    pad = b"\0" * (len(rows) % 2)
    ifd = struct.pack("<H", len(tags)) + b"".join(struct.pack("<HHII", *t) for t in tags) + struct.pack("<I", 0)
    open(f"b{bits}.tif", "wb").write(b"II*\0" + struct.pack("<I", 8 + len(rows) + len(pad)) + rows + pad + ifd)
    got = voxels(f"b{bits}.tif")
    assert got.tobytes() == data.astype("u1" if bits < 9 else "u2").tobytes(), bits
END
}

@test "differences that a compression does not have: stated, they are refused, on whatever page" {
    /usr/bin/python3 - <<'END'
import struct, subprocess, numpy
from voxels import *
data = numpy.random.default_rng(4).integers(0, 60000, (6, 40)).astype("u2")
def packbits(row): return bytes([len(row) - 1]) + row
def page(order, big, at, compression, predictor, kind, last, zeiss):
    stored = data.astype(order + "u2")
    voxels = b"".join(packbits(row.tobytes()) for row in stored) if compression == 32773 else stored.tobytes()
    tags = [(256, 4, 40), (257, 4, 6), (258, 3, 16), (259, 3, compression), (262, 3, 1), (273, 4, at), (277, 3, 1),
            (278, 4, 6), (279, 4, len(voxels))]
    if predictor is not None: tags.append((317, kind, predictor))
    if zeiss: tags.append((34412, 4, 7))
    value = lambda kind, v: struct.pack(order + {1: "B", 3: "H", 4: "I"}[kind], v).ljust(8 if big else 4, b"\0")
    entry, count, link = (20, 8, 8) if big else (12, 2, 4)
    begin = at + len(voxels) + len(voxels) % 2
    end = begin + count + entry * len(tags) + link
    pointer = "Q" if big else "I"
    return begin, end, (voxels.ljust(begin - at, b"\0") + struct.pack(order + ("Q" if big else "H"), len(tags)) +
        b"".join(struct.pack(order + "HH" + pointer, tag, kind, 1) + value(kind, v) for tag, kind, v in tags),
        lambda next: struct.pack(order + pointer, 0 if last else next))
def file(name, compression, predictors, order="<", big=False, kind=3, zeiss=False):
    mark = b"II" if order == "<" else b"MM"
    parts, at = [], 16
    for i, predictor in enumerate(predictors):
        begin, at, part = page(order, big, at, compression, predictor, kind, i == len(predictors) - 1, zeiss)
        parts.append((begin, part))
    head = mark + (struct.pack(order + "HHHQ", 43, 8, 0, parts[0][0]) if big
                   else struct.pack(order + "HIQ", 42, parts[0][0], 0))
    links = [begin for begin, _ in parts[1:]] + [0]
    open(name, "wb").write(head + b"".join(body + link(n) for (_, (body, link)), n in zip(parts, links)))
def refused(name):
    got = subprocess.run(["vkt", "info", name], capture_output=True, text=True)
    assert got.returncode == 3 and "differences between pixels (Predictor 2)" in got.stderr, (name, got)
for order in "<>":
    for big in (False, True):
        for compression in (1, 32773):
            for kind in (1, 3, 4):
                layout = (order, big, kind)
                file("p.tif", compression, [2], *layout)
                refused("p.tif")
                file("p.tif", compression, [None, 1, 2], *layout)
                refused("p.tif")
                file("p.tif", compression, [1, None], *layout)
                assert voxels("p.tif").tobytes() == data.tobytes() * 2, (compression, layout)
    file("p.lsm", 1, [2], order, zeiss=True) # a known fault of Zeiss's program
    assert voxels("p.lsm").tobytes() == data.tobytes()
END
}

@test "hyperstacks and spacing: ImageJ's, OME's, colours" {
    /usr/bin/python3 - <<'END'
import tifffile, numpy
from voxels import *
rng = numpy.random.default_rng(3)
data = rng.integers(0, 60000, (2, 5, 3, 20, 30)).astype("u2") # T Z C Y X
tifffile.imwrite("ij.tif", data, imagej=True, resolution=(4.0, 2.0),
                 metadata={"spacing": 1.5, "unit": "um", "finterval": 0.25, "axes": "TZCYX"})
info = infos("ij.tif")
assert len(info) == 6 and all(i["dims"] == [30, 20, 5] for i in info), info[0]["dims"]
assert info[0]["spacing"] == [0.25, 0.5, 1.5], info[0]["spacing"]
assert info[0]["attributes"]["space units"] == '"um" "um" "um"'
assert [i["attributes"]["channel"] for i in info] == ["0", "1", "2"] * 2
assert [float(i["attributes"]["sequence position"]) for i in info] == [0, 0, 0, .25, .25, .25]
assert voxels("ij.tif").tobytes() == data.transpose(0, 2, 1, 3, 4).tobytes()
assert voxels("ij.tif", "--variable 1").tobytes() == data[:, :, 1].tobytes()
ome = data.transpose(0, 2, 1, 3, 4)
tifffile.imwrite("ome.tif", ome, ome=True, metadata={"axes": "TCZYX", "PhysicalSizeX": 0.3, "PhysicalSizeXUnit": "µm",
    "PhysicalSizeY": 0.3, "PhysicalSizeYUnit": "µm", "PhysicalSizeZ": 2.0, "PhysicalSizeZUnit": "µm",
    "Channel": {"Name": ["DAPI", "GFP", "RFP"]}})
info = infos("ome.tif")
assert len(info) == 6 and info[0]["spacing"] == [0.3, 0.3, 2.0] and info[0]["dims"] == [30, 20, 5], info[0]
assert [i["attributes"]["channel"] for i in info] == ["DAPI", "GFP", "RFP"] * 2
assert voxels("ome.tif").tobytes() == ome.tobytes()
assert voxels("ome.tif", "--variable GFP").tobytes() == ome[:, 1].tobytes()
# Times in units of their own, as tifffile and ImageJ write them.
for name, options, axes in (("min.ome.tif", {}, {"TimeIncrement": 0.5, "TimeIncrementUnit": "min"}),
                            ("us.ome.tif", {}, {"TimeIncrement": 0.5, "TimeIncrementUnit": "µs"}),
                            ("s.ome.tif", {}, {"TimeIncrement": 0.5}),
                            ("min.tif", {"imagej": True}, {"finterval": 0.5, "tunit": "min"}),
                            ("msec.tif", {"imagej": True}, {"finterval": 0.5, "tunit": "msec"})):
    tifffile.imwrite(name, data, metadata={"axes": "TZCYX", **axes}, **options)
    unit = {"msec": "ms"}.get(name.split(".")[0], name.split(".")[0])
    said = infos(name)[0]["attributes"]
    assert said["sequence units"] == f'"{unit}"' and said["sequence step"] == "0.5", (name, said)
    # The same times in files of ours, whose unit is the second: what others read.
    subprocess.check_call(f"vkt read {name} --index 0:6:3 -o again.tif --force -q", shell=True)
    seconds = tifffile.TiffFile("again.tif").imagej_metadata["finterval"]
    assert abs(seconds - 0.5 * {"min": 60, "us": 1e-6, "ms": 1e-3, "s": 1}[unit]) < 1e-9, (name, seconds)
rgb = rng.integers(0, 255, (4, 20, 30, 3)).astype("u1")
for planar in ("contig", "separate"):
    stored = rgb if planar == "contig" else rgb.transpose(0, 3, 1, 2)
    tifffile.imwrite("rgb.tif", stored, photometric="rgb", planarconfig=planar)
    assert voxels("rgb.tif").tobytes() == rgb.transpose(3, 0, 1, 2).tobytes(), planar
    assert [i["attributes"]["channel"] for i in infos("rgb.tif")] == ["red", "green", "blue"]
tifffile.imwrite("cm.tif", rgb[..., 0], photometric="minisblack", resolution=(20, 10), resolutionunit="CENTIMETER")
assert infos("cm.tif")[0]["spacing"] == [0.5, 1, 1]
END
}

@test "OME images whose planes lie in several files: from any of them, deflated too, by regions; missing and misplaced ones are named" {
    /usr/bin/python3 - <<'END'
import os, shutil, tifffile, numpy
from voxels import *
data = numpy.random.default_rng(5).integers(0, 60000, (2, 3, 4, 12, 10)).astype("u2") # T C Z Y X
def write(folder, names=lambda t, c: f"t{t}c{c}.ome.tif", compression=None, uuid=lambda t, c: f"urn:uuid:{t}{c}", extra=""):
    """A file for each channel and time, every one with the whole description, as Bio-Formats writes them."""
    os.makedirs(folder, exist_ok=True)
    where = "".join(f'<TiffData FirstZ="{z}" FirstC="{c}" FirstT="{t}" IFD="{z}" PlaneCount="1"><UUID FileName="{names(t, c)}">{uuid(t, c)}</UUID></TiffData>'
                    for t in range(2) for c in range(3) for z in range(4))
    for t in range(2):
        for c in range(3):
            words = f'<?xml version="1.0" encoding="UTF-8"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" UUID="{uuid(t, c)}"><Image ID="Image:0" Name="i"><Pixels ID="Pixels:0" DimensionOrder="XYZCT" Type="uint16" SizeX="10" SizeY="12" SizeZ="4" SizeC="3" SizeT="2" PhysicalSizeX="0.5" PhysicalSizeY="0.5" PhysicalSizeZ="2"><Channel ID="Channel:0:0" Name="a"/><Channel ID="Channel:0:1" Name="b"/><Channel ID="Channel:0:2" Name="c"/>{where}</Pixels></Image></OME>'
            tifffile.imwrite(f"{folder}/t{t}c{c}.ome.tif", data[t, c], description=words, metadata=None, photometric="minisblack", compression=compression)
write("plain"); write("packed", compression="zlib")
for folder in "plain", "packed":
    for name in "t0c0", "t1c2":
        got = voxels(f"{folder}/{name}.ome.tif")
        assert got.tobytes() == data.tobytes(), (folder, name)
    assert voxels(f"{folder}/t0c1.ome.tif", "--variable b").tobytes() == data[:, 1].tobytes()
    assert voxels(f"{folder}/t0c1.ome.tif", "--roi 2:7,3:,1:3").tobytes() == data[:, :, 1:3, 3:, 2:7].tobytes()
i = infos("plain/t0c0.ome.tif")
assert len(i) == 6 and i[0]["dims"] == [10, 12, 4] and i[0]["spacing"] == [0.5, 0.5, 2], i[0]
assert numpy.array_equal(tifffile.imread("plain/t0c0.ome.tif"), data)
shutil.copytree("plain", "less"); os.remove("less/t1c1.ome.tif")
shutil.copytree("plain", "short"); tifffile.imwrite("short/t1c1.ome.tif", data[1, 1, :2])
shutil.copytree("plain", "small"); tifffile.imwrite("small/t1c1.ome.tif", data[1, 1, :, :9])
shutil.copytree("plain", "junk"); open("junk/t1c1.ome.tif", "w").write("no TIFF")
write("away", names=lambda t, c: f"../plain/t{t}c{c}.ome.tif" if t else f"t{t}c{c}.ome.tif")
END
    fails_with 3 "the file 't1c1.ome.tif' that its description names is not there" vkt info less/t0c0.ome.tif
    fails_with 3 "names page 2 of 't1c1.ome.tif', which has 2" vkt info short/t0c0.ome.tif
    fails_with 3 "on pages of different sizes" vkt info small/t0c0.ome.tif
    fails_with 3 "that its description names cannot be opened" vkt info junk/t0c0.ome.tif
    fails_with 3 "leads out of its directory" vkt info away/t0c0.ome.tif
    vkt read away/t0c0.ome.tif --trust-paths | vkt diff - plain/t0c0.ome.tif
}

@test "orientation: what is seen at the top left is at the origin, whatever the order in the file" {
    /usr/bin/python3 - <<'END'
import tifffile, numpy
from voxels import *
seen = numpy.arange(3 * 4 * 6, dtype="u2").reshape(3, 4, 6)
stored = {1: seen, 2: seen[:, :, ::-1], 3: seen[:, ::-1, ::-1], 4: seen[:, ::-1]}
stored |= {5: stored[1].swapaxes(1, 2), 6: stored[2].swapaxes(1, 2), 7: stored[3].swapaxes(1, 2), 8: stored[4].swapaxes(1, 2)}
for n, data in stored.items():
    tifffile.imwrite("o.tif", numpy.ascontiguousarray(data), photometric="minisblack", metadata=None,
                     resolution=(4, 2), resolutionunit="CENTIMETER", extratags=[(274, "H", 1, n, True)])
    assert voxels("o.tif").tobytes() == data.tobytes(), n  # in the order of the file
    info = infos("o.tif")[0]
    origin, spacing, axes = (numpy.array(info[k]) for k in ("origin", "spacing", "direction"))
    assert list(spacing) == [2.5, 5, 1]
    seen_spacing = spacing[[1, 0, 2]] if n > 4 else spacing
    for z, y, x in numpy.ndindex(data.shape):
        at = (origin + axes.T @ (spacing * (x, y, z))) / seen_spacing
        i, j, k = numpy.round(at).astype(int)
        assert numpy.allclose(at, (i, j, k)) and seen[k, j, i] == data[z, y, x], (n, at)
END
}

@test "axes of tifffile's own files, units that differ, thumbnails that come first" {
    /usr/bin/python3 - <<'END'
import struct, tifffile, numpy
from voxels import *
rng = numpy.random.default_rng(4)
def write(name, data, **options): tifffile.imwrite(name, data, photometric="minisblack", **options)
data = rng.integers(0, 60000, (2, 3, 4, 20, 30)).astype("u2")
def check(name, volumes, channels=None):
    info = infos(name)
    assert len(info) == len(volumes), (name, len(info))
    assert all(i["dims"] == list(volumes[0].shape[::-1]) for i in info), (name, info[0]["dims"])
    assert voxels(name).tobytes() == numpy.stack(volumes).tobytes(), name
    if channels: assert [i["attributes"]["channel"] for i in info] == channels, name
write("five.tif", data)
check("five.tif", [v for t in data for v in t])
write("tczyx.tif", data, metadata={"axes": "TCZYX"})
check("tczyx.tif", [v for t in data for v in t], ["0", "1", "2"] * 2)
write("tzcyx.tif", data, metadata={"axes": "TZCYX"}, compression="zlib")
check("tzcyx.tif", [t[:, c] for t in data for c in range(4)], ["0", "1", "2", "3"] * 2)
write("cyx.tif", data[0, 0], metadata={"axes": "CYX"})
check("cyx.tif", [data[0, 0, c:c + 1] for c in range(4)], ["0", "1", "2", "3"])
colours = rng.integers(0, 255, (2, 4, 20, 30, 3)).astype("u1")
tifffile.imwrite("tzyxs.tif", colours, photometric="rgb", metadata={"axes": "TZYXS"})
check("tzyxs.tif", [t[..., s] for t in colours for s in range(3)], ["red", "green", "blue"] * 2)
# One page is described, the others follow it.
write("one.tif", data, truncate=True)
check("one.tif", [v for t in data for v in t])
write("ome.tif", data[0, 0], ome=True, metadata={"axes": "ZYX", "PhysicalSizeX": 0.5, "PhysicalSizeXUnit": "µm",
    "PhysicalSizeY": 250, "PhysicalSizeYUnit": "nm", "PhysicalSizeZ": 0.002, "PhysicalSizeZUnit": "mm"})
i = infos("ome.tif")[0]
assert i["spacing"] == [0.5, 0.25, 2] and i["attributes"]["space units"] == '"um" "um" "um"', i
with tifffile.TiffWriter("thumbnail.tif") as t:
    t.write(data[0, 0, 0, ::2, ::2].copy(), photometric="minisblack", metadata=None, subfiletype=1)
    for page in data[0, 0]: t.write(page, photometric="minisblack", metadata=None)
check("thumbnail.tif", [data[0, 0]])
# Places of further pages that lie behind the end of the file.
tifffile.imwrite("whole.tif", data[0, 0], photometric="minisblack", metadata=None)
whole = open("whole.tif", "rb").read()
open("short.tif", "wb").write(whole[:-500])
tifffile.imwrite("deep.tif", rng.integers(0, 9, (16, 32, 32)).astype("u1"), photometric="minisblack", tile=(16, 16, 16))
# Of one slice by its ImageDepth, whose tiles hold more.
deep = bytearray(open("deep.tif", "rb").read())
at = deep.index(struct.pack("<HHI", 32997, 4, 1)); deep[at + 8:at + 12] = struct.pack("<I", 1)
open("deep tiles.tif", "wb").write(deep)
END
    vkt info thumbnail.tif | grep 'not read *page 0 (reduced or a mask) of 15 by 10 pixels'
    fails_with 3 "page 1 cannot be read" vkt info short.tif
    fails_with 3 "holds 16 slices in one (ImageDepth)" vkt info deep.tif
    fails_with 3 "holds 16 slices in one (TileDepth)" vkt info 'deep tiles.tif'
}

@test "levels of pyramids, thumbnails, pages of another size and images of OME are read by their names" {
    cat >named.py <<'END'
import json, subprocess, sys, tifffile, numpy
def check(name, variable, want, affine=None):
    read = ["vkt", "read", name, "--variable", variable]
    stream = subprocess.check_output(read)
    raw = subprocess.run(["vkt", "write", "-", "-", "--format", "raw"], input=stream, stdout=subprocess.PIPE, check=True).stdout
    info = json.loads(subprocess.run(["vkt", "info", "--json"], input=stream, stdout=subprocess.PIPE, check=True).stdout)
    want = want.reshape((-1,) + want.shape[-2:])
    assert info["dims"] == list(want.shape[::-1]) and raw == want.tobytes(), (name, variable, info)
    if affine is not None:
        spacing, origin = affine
        assert numpy.allclose(info["spacing"], spacing) and numpy.allclose(info["origin"], origin), (name, variable, info)
page = numpy.arange(64 * 96, dtype="u2").reshape(64, 96)
stack = numpy.stack([page, page + 1, page + 2])
options = dict(photometric="minisblack")
with tifffile.TiffWriter("pyramid.tif") as t:
    t.write(page, subifds=2, tile=(16, 16), resolution=(10, 5, "CENTIMETER"), **options)
    for level in (2, 4): t.write(page[::level, ::level].copy(), subfiletype=1, tile=(16, 16), **options)
check("pyramid.tif", "level 1", page[::2, ::2], ((2, 4, 1), (0.5, 1, 0)))
check("pyramid.tif", "level 2", page[::4, ::4], ((4, 8, 1), (1.5, 3, 0)))
with tifffile.TiffWriter("pyramid.ome.tif", ome=True) as t:
    t.write(stack, subifds=1, metadata={"axes": "ZYX", "PhysicalSizeX": 0.5, "PhysicalSizeY": 0.25, "PhysicalSizeZ": 3}, **options)
    t.write(stack[:, ::2, ::2].copy(), subfiletype=1, metadata=None, **options)
check("pyramid.ome.tif", "level 1", stack[:, ::2, ::2], ((1, 0.5, 3), (0.25, 0.125, 0)))
with tifffile.TiffWriter("pages.tif") as t:
    t.write(page, metadata=None, **options)
    t.write(page[::2, ::2].copy(), subfiletype=1, metadata=None, **options)
    t.write(page[:7, :5].copy(), metadata=None, **options)
check("pages.tif", "page 1", page[::2, ::2], ((2, 2, 1), (0.5, 0.5, 0)))
check("pages.tif", "page 2", page[:7, :5], ((1, 1, 1), (0, 0, 0)))
with tifffile.TiffWriter("images.ome.tif", ome=True) as t:
    t.write(page[:8, :9].copy(), metadata={"axes": "YX", "Name": "label"}, **options)
    t.write(stack, metadata={"axes": "ZYX", "Name": "body", "PhysicalSizeX": 0.5}, **options)
    t.write(stack + 9, metadata={"axes": "ZYX", "Name": "again"}, **options)
check("images.ome.tif", "label", page[:8, :9])
check("images.ome.tif", "body", stack, ((0.5, 1, 1), (0, 0, 0)))
check("images.ome.tif", "again", stack + 9)
END
    /usr/bin/python3 named.py
    vkt info pyramid.tif | grep -q 'not read *level 2 of 24 by 16 pixels'
    vkt info images.ome.tif | grep -q "not read *image 'body'"
    fails_with 2 "has no level 3; its last is level 2" vkt read pyramid.tif --variable 'level 3'
    fails_with 2 "has no page 3; its last is page 2" vkt read pages.tif --variable 'page 3'
    fails_with 2 "has no channel 'head'" vkt read images.ome.tif --variable head
}

@test "what vkt wrote is what tifffile reads, with ImageJ's description; all of the header comes back" {
    vkt make noise --dims 30 20 6 --dtype uint16 | vkt set --spacing 0.5,0.25,2 --origin=-3,4,5 --slope 0.5 --intercept -7 --units HU -o a.nrrd
    vkt write a.nrrd a.tif
    vkt write a.nrrd c.tif --compress
    [ "$(stat -c %s c.tif)" -gt 0 ]
    for name in a c; do
        vkt diff a.nrrd $name.tif
        vkt info $name.tif --json >info
        grep -q '"slope": 0.5' info
        grep -q '"units": "HU"' info
        vkt history $name.tif | grep -q noise
    done
    for type in uint8 int8 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make noise --dims 30 20 6 --dtype $type -o $type.tif
        vkt write $type.tif c_$type.tif --compress
        vkt write $type.tif $type.raw
        vkt diff $type.tif c_$type.tif
    done
    for i in 0 1 2; do vkt make noise --dims 9 8 4 --dtype int16 --seed $i -o v$i.nrrd; done
    vkt read 'v*.nrrd' | vkt write s.tif
    [ "$(vkt info s.tif --json | grep -c '"dims"')" -eq 3 ]
    vkt read s.tif | vkt write - --format raw >s.raw
    vkt read 'v*.nrrd' | vkt write - --format raw | cmp - s.raw
    /usr/bin/python3 - <<'END'
import tifffile, numpy
with tifffile.TiffFile("a.tif") as f:
    assert f.is_imagej and f.imagej_metadata["slices"] == 6 and f.imagej_metadata["spacing"] == 2, f.imagej_metadata
    assert f.pages[0].tags["XResolution"].value == (2, 1) and f.pages[0].tags["YResolution"].value == (4, 1)
    assert f.asarray().shape == (6, 20, 30)
for name in "uint8 int8 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    for prefix in ("", "c_"):
        try: a = tifffile.imread(prefix + name + ".tif")
        except (ValueError, ImportError) as e:
            if prefix and "imagecodecs" in str(e): continue  # no predictors without it
            raise
        assert a.dtype == name and a.tobytes() == open(name + ".raw", "rb").read(), prefix + name
assert tifffile.imread("s.tif").shape == (3, 4, 8, 9)
assert tifffile.imread("s.tif").tobytes() == open("s.raw", "rb").read()
END
}

@test "channels stay channels: as OME describes them, with their names, times and units; of ImageJ's files too" {
    /usr/bin/python3 - <<'END'
import json, numpy, os, subprocess, tifffile
import xml.etree.ElementTree as xml
def run(line): return subprocess.run(line, shell=True, check=True, capture_output=True).stdout
def infos(name):
    i = json.loads(run(f"vkt info {name} --json"))
    return [one.get("attributes", {}) for one in (i if isinstance(i, list) else [i])]
def raw(name): return run(f"vkt write {name} - --format raw")
def stream(name, said, more="", dtype="uint16"):
    """One volume for each, with these attributes, as one stream."""
    for i, attributes in enumerate(said):
        options = " ".join(f"--attribute '{k}={v}'" for k, v in attributes.items())
        run(f"vkt make noise --dims 9 8 4 --dtype {dtype} --seed {i} | vkt set --spacing 0.5,0.25,3 --origin 4,5,6 --attribute 'space units=\"um\" \"um\" \"um\"' {options} {more} -o s{i:02}.vkt --force")
    run(f"vkt read 's[0-9]*.vkt' -o {name}.vkt --force; rm s[0-9]*.vkt")
def times(n, step=5): return [{"sequence position": f"{10 + i * step:g}", "sequence step": step, "sequence units": '"ms"'} for i in range(n)]
names = [{"channel": n} for n in ("DAPI", "a & b <c>", "Cy5")]
for name, said, shape, axes in (("c", names, (3,), "CZYX"), ("tc", [t | c for t in times(2) for c in names], (2, 3), "TCZYX"), ("ct", [t | c for c in names for t in times(2)], (3, 2), "CTZYX")):
    stream(name, said, "--slope 0.5 --units HU")
    given, want = infos(name + ".vkt"), numpy.frombuffer(raw(name + ".vkt"), "u2").reshape(*shape, 4, 8, 9)
    if name == "ct": given = [given[i] for i in (0, 2, 4, 1, 3, 5)] # read with times outside
    for options in ("", "--compress"):
        run(f"vkt write {name}.vkt o.tif --force {options}")
        with tifffile.TiffFile("o.tif") as f:
            s = f.series[0]
            assert f.is_ome and s.axes == axes and s.shape == want.shape, (s.axes, s.shape)
            if not options: assert (s.asarray() == want).all()
            pixels = xml.fromstring(f.ome_metadata)[0][0]
            assert [e.get("Name") for e in pixels if e.tag.endswith("Channel")] == ["DAPI", "a & b <c>", "Cy5"]
            assert pixels.get("PhysicalSizeX") == "0.5" and pixels.get("PhysicalSizeZ") == "3" and pixels.get("PhysicalSizeYUnit") == "\u00b5m"
            assert pixels.get("TimeIncrement") == (None if name == "c" else "0.005")
        assert infos("o.tif") == given, (infos("o.tif"), given)
        got = want.swapaxes(0, 1) if name == "ct" else want
        assert raw("o.tif") == got.tobytes()
        one = json.loads(run("vkt info o.tif --json"))[-1]
        assert one["spacing"] == [0.5, 0.25, 3] and one["origin"] == [4, 5, 6] and one["slope"] == 0.5 and one["units"] == "HU", one
# ImageJ's.
data = numpy.arange(2 * 4 * 3 * 8 * 9, dtype="u2").reshape(2, 4, 3, 8, 9)
tifffile.imwrite("j.tif", data, imagej=True, metadata={"axes": "TZCYX", "finterval": 0.5})
run("vkt convert j.tif o.tif --force")
with tifffile.TiffFile("o.tif") as f: assert f.series[0].axes == "TCZYX" and (f.asarray() == data.swapaxes(1, 2)).all()
assert infos("o.tif") == infos("j.tif")
# Times alone are ImageJ's frames, from where they begin.
stream("t", times(3))
run("vkt write t.vkt t.tif")
with tifffile.TiffFile("t.tif") as f: assert f.is_imagej and f.series[0].axes == "TZYX" and f.imagej_metadata["frames"] == 3 and f.imagej_metadata["finterval"] == 0.005
assert infos("t.tif") == infos("t.vkt"), infos("t.tif")
for said, dtype, why in (([names[0], names[1], names[0], names[2]], "uint8", "no full grid"), (names, "float16", "OME's, which knows no float16")):
    stream("bad", said, dtype=dtype)
    r = subprocess.run("vkt write bad.vkt bad.tif", shell=True, capture_output=True, text=True)
    assert r.returncode == 2 and why in r.stderr and not os.path.exists("bad.tif"), r
END
}

@test "pages smaller than their description are what tifffile and libtiff read" {
    for n in 1 2 3 9; do vkt make noise --dims 5 3 $n --dtype uint8 | vkt write - small$n.tif; done
    vkt make noise --dims 5 3 4 --dtype uint16 --seed 1 -o s_1.nrrd
    vkt make noise --dims 5 3 4 --dtype uint16 --seed 2 -o s_2.nrrd
    vkt read 's_*.nrrd' -o two.tif
    /usr/bin/python3 - <<'END'
import tifffile
from voxels import *
for name in ("small1.tif", "small2.tif", "small3.tif", "small9.tif", "two.tif"):
    assert tifffile.imread(name).tobytes() == voxels(name).tobytes(), name
END
}

@test "pipes, standard input, names, and refusals" {
    vkt make noise --dims 9 8 4 --dtype int16 -o a.tif
    vkt diff a.tif - <a.tif
    cat a.tif | vkt diff a.tif -
    fails_with 2 "cannot be written to a pipe" bash -c 'vkt write a.tif - --format tiff | cat; exit "${PIPESTATUS[0]}"'
    cp a.tif b
    vkt diff a.tif b
    fails_with 4 "exists" vkt write b a.tif
    vkt make amr --blocks 100 -o t.vkt
    fails_with 2 "cannot hold bricks" vkt write t.vkt t.tif
    [ ! -e t.tif ]
}

@test "a list of times that is too short is none" {
    for time in 2 5 8; do
        vkt make constant --value $time --dims 4 3 2 | vkt set --attribute "sequence position=$time" --attribute "sequence positions=7"
    done >times.vkt
    vkt read times.vkt -o times.tif
    vkt info times.tif --json | grep -o '"sequence position":"[^"]*"' >found
    printf '"sequence position":"%s"\n' 2 5 8 | cmp - found
}

@test "damaged TIFF files end in an error and never in a crash" {
    vkt make noise --dims 30 20 6 --dtype uint16 -o a.tif
    vkt write a.tif c.tif --compress
    /usr/bin/python3 - <<'END'
import random, subprocess, struct
random.seed(5)
for name in ("a.tif", "c.tif"):
    good = open(name, "rb").read()
    for i in range(60):
        bad = bytearray(good)
        for _ in range(random.randint(1, 6)):
            at = random.randrange(8) if random.random() < .1 else random.randrange(len(bad))
            bad[at] = random.randrange(256)
        if i % 3 == 0: bad = bad[:random.randrange(8, len(bad))]
        open("bad.tif", "wb").write(bad)
        run = subprocess.run(["vkt", "stats", "bad.tif"], capture_output=True, timeout=60)
        assert run.returncode in (0, 1, 2, 3), (i, run.returncode, run.stderr)
        assert run.returncode == 0 or b"bad.tif" in run.stderr, run.stderr
# Extents that no such file can hold.
tags = [(256, 4, 1, 2**31 - 1), (257, 4, 1, 2**31 - 1), (258, 3, 1, 16), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8),
        (277, 3, 1, 1), (278, 4, 1, 2**31 - 1), (279, 4, 1, 64)]
ifd = struct.pack("<H", len(tags)) + b"".join(struct.pack("<HHII", *t) for t in tags) + struct.pack("<I", 0)
open("huge.tif", "wb").write(b"II*\0" + struct.pack("<I", 72) + bytes(64) + ifd)
END
    fails_with 3 "'huge.tif': ended early" vkt stats huge.tif
}

@test "the samples" {
    needs_data tiff/brain.tiff
    /usr/bin/python3 - "$VKT_DATA" <<'END'
import glob, sys, tifffile
from voxels import *
base = sys.argv[1] + "/tiff/"
assert voxels(base + "brain.tiff").tobytes() == tifffile.imread(base + "brain.tiff").tobytes()
for name in sorted(glob.glob(base + "banana/*.tif")):
    a = tifffile.imread(name)
    assert voxels(name).tobytes() == a.astype("<u2").tobytes(), name
    info = infos(name)[0]
    assert info["spacing"][:2] == [0.390625, 0.390625] and info["attributes"]["space units"].startswith('"mm"'), info
END
    vkt write "$VKT_DATA/tiff/brain.tiff" b.tif && vkt diff "$VKT_DATA/tiff/brain.tiff" b.tif
}

@test "files cut anywhere among what describes their pages are no shorter stacks, and lose no words" {
    python_has tifffile || skip "python3 has no tifffile"
    /usr/bin/python3 - <<'END'
import subprocess
import numpy as np, tifffile
data = np.random.default_rng(0).integers(0, 60000, (3, 2, 2, 3, 4)).astype("u2")
tifffile.imwrite("ome.ome.tif", data, metadata={"axes": "TZCYX", "PhysicalSizeX": 0.3, "PhysicalSizeXUnit": "µm"}, photometric="minisblack")
tifffile.imwrite("big.ome.tif", data, bigtiff=True, metadata={"axes": "TZCYX"}, ome=True, photometric="minisblack")
tifffile.imwrite("plain.tif", data[0, :, 0].repeat(4, 0), photometric="minisblack", metadata=None)
cuts = 0
for name in "ome.ome.tif", "big.ome.tif", "plain.tif":
    whole = open(name, "rb").read()
    subprocess.run(["vkt", "info", name], check=True, capture_output=True)
    # Every place near the ends of directories and of the file, others here and there.
    places = {*range(len(whole) - 40, len(whole), 3), *range(8, len(whole) - 40, 149)}
    directory = int.from_bytes(whole[8:16] if whole[2] == 43 else whole[4:8], "little")
    for _ in range(3):
        count = int.from_bytes(whole[directory:directory + (8 if whole[2] == 43 else 2)], "little")
        end = directory + (8 + 20 * count if whole[2] == 43 else 2 + 12 * count)
        places |= {*range(end - 1, end + (8 if whole[2] == 43 else 4))}
        directory = int.from_bytes(whole[end:end + (8 if whole[2] == 43 else 4)], "little")
    for place in sorted(places):
        open("cut.tif", "wb").write(whole[:place])
        done = subprocess.run(["vkt", "write", "cut.tif", "out_%d.vkt", "--force"], capture_output=True, text=True)
        # What was cut off may be what fills up the file.
        same = done.returncode == 0 and subprocess.run(f"vkt write {name} whole_%d.vkt --force && cat whole_*.vkt | vkt diff - <(cat out_*.vkt) --geometry",
                                                       shell=True, executable="/bin/bash", capture_output=True).returncode == 0
        assert same and place > len(whole) - 40 or done.returncode in (3, 4), (name, place, len(whole), done)
        cuts += 1
assert cuts > 150, cuts
END
}

@test "a value map that ImageJ alone reads is said" {
    vkt make ramp --dims 4 3 2 --dtype int16 --to 9 | vkt set --slope 0.5 --intercept -3 -o mapped.nrrd
    vkt convert mapped.nrrd -o mapped.tif 2>said
    grep -q 'other programs take the values of TIFF files as they are stored, but for ImageJ, here 0.5 \* stored + -3 is meant' said
    vkt diff mapped.nrrd mapped.tif
    vkt make ramp --dims 4 3 2 --dtype int16 --to 9 -o plain.tif 2>said
    [ ! -s said ]
}

@test "whole pages of another size than the volume's are not left out without a word" {
    python_with tifffile
    /usr/bin/python3 -c "
import numpy as np, tifffile
with tifffile.TiffWriter('mixed.tif') as file:
    file.write(np.zeros((10, 17), 'u2'), photometric='minisblack')
    file.write(np.ones((6, 20, 17), 'u2'), photometric='minisblack')"
    run --separate-stderr vkt convert mixed.tif -o out.nrrd
    [ "$status" -eq 0 ]
    [[ "$stderr" == *"'mixed.tif' holds pages of other sizes than its volume's (page 1 of 17 by 20 pixels, and others): not read"* ]]
}
