# MRC and CCP4 maps against mrcfile (where it is installed, or in build/peers) and headers made by hand.
load helper

setup_more() {
    python_with numpy
    cat >common.py <<'PY'
import json, struct, subprocess, sys
import numpy as np
def run(line): return subprocess.run(line, shell=True, check=True, capture_output=True).stdout
def info(name): return json.loads(run(f"vkt info {name} --json"))
def voxels(name): return run(f"vkt write {name} - --format raw")
def header(order="<", n=(5, 4, 3), mode=2, start=(0, 0, 0), m=None, cell=None, angles=(90, 90, 90), axes=(1, 2, 3), origin=(0, 0, 0),
           group=1, extended=0, labels=(), mark=b"MAP ", imod=None):
    m = m or n
    cell = cell or m
    h = bytearray(1024)
    struct.pack_into(order + "10i6f3i3fii", h, 0, *n, mode, *start, *m, *cell, *angles, *axes, 0, -1, -2, group, extended)
    struct.pack_into(order + "3f", h, 196, *origin)
    h[208:212] = mark
    h[212:214] = b"DD" if order == "<" else b"\x11\x11"
    struct.pack_into(order + "i", h, 220, len(labels))
    for i, label in enumerate(labels): h[224 + 80 * i:224 + 80 * i + len(label)] = label.encode()
    if imod is not None: struct.pack_into(order + "2i", h, 152, 1146047817, imod)
    return bytes(h)
PY
    export PYTHONPATH="$PWD"
}

@test "modes, byte orders, axes, cells, starts and labels, by hand" {
    /usr/bin/python3 - <<'END'
from common import *
rng = np.random.default_rng(2)
for order in "<>":
    for mode, code in ((0, "i1"), (1, "i2"), (2, "f4"), (6, "u2"), (12, "f2")):
        v = (rng.normal(size=(3, 4, 5)) * 50).astype(code)
        open("a.mrc", "wb").write(header(order, mode=mode, cell=(10, 2, 9), origin=(1, 2, 3), labels=("made by hand", "twice")) + v.astype(order + code).tobytes())
        i = info("a.mrc")
        assert i["format"] == "mrc" and i["dims"] == [5, 4, 3] and i["dtype"] == v.dtype.name, i
        assert i["spacing"] == [2, 0.5, 3] and i["origin"] == [1, 2, 3], i
        assert i["attributes"]["mrc label 2"] == "twice" and i["attributes"]["space units"].startswith('"angstrom"'), i
        assert voxels("a.mrc") == v.tobytes() and run("vkt read a.mrc --roi 1:3,:,2: | vkt write - --format raw") == v[2:, :, 1:3].tobytes()
        assert run("cat a.mrc | vkt write - - --format raw") == v.tobytes()
v = np.arange(60, dtype="f4").reshape(3, 4, 5)
# Columns along Z, rows along X, sections along Y; CCP4's start in voxels.
open("b.map", "wb").write(header(m=(4, 3, 5), cell=(8, 9, 5), axes=(3, 1, 2), start=(10, 20, 30)) + v.tobytes())
i = info("b.map")
assert i["spacing"] == [1, 2, 3] and i["direction"] == [[0, 0, 1], [1, 0, 0], [0, 1, 0]] and i["origin"] == [40, 90, 10], i
# A monoclinic cell: the third edge leans over.
open("c.map", "wb").write(header(angles=(90, 120, 90)) + v.tobytes())
d = info("c.map")["direction"]
assert np.allclose(d, [[1, 0, 0], [0, 1, 0], [-0.5, 0, 0.75 ** 0.5]], atol=1e-12), d
# IMOD's unsigned bytes, an extended header of others, a stack of volumes, files without a mark.
bytes_ = np.arange(60, dtype="u1").reshape(3, 4, 5) + 190
open("d.mrc", "wb").write(header(mode=0, imod=0, extended=7) + b"1234567" + bytes_.tobytes())
i = info("d.mrc")
assert i["dtype"] == "uint8" and i["attributes"]["mrc extended header"] == "7 bytes, not kept" and voxels("d.mrc") == bytes_.tobytes()
open("e.mrcs", "wb").write(header(n=(5, 4, 6), m=(5, 4, 3), group=401) + v.tobytes() + v[::-1].tobytes())
many = info("e.mrcs")
assert [j["dims"] for j in many] == [[5, 4, 3]] * 2 and run("vkt write e.mrcs - --format raw") == v.tobytes() + v[::-1].tobytes()
open("old.mrc", "wb").write(header(mark=b"\0" * 4) + v.tobytes())
assert voxels("old.mrc") == v.tobytes()
END
}

@test "what mrcfile writes, and what it reads of ours" {
    with_peer mrcfile
    for type in int8 int16 uint16 float16 float32; do
        vkt make noise --dims 7 6 5 --dtype $type --seed 3 | vkt set --spacing 0.5,1.5,2 --origin 4,5,6 --attribute note=kept -o $type.mrc
        vkt write $type.mrc $type.raw
    done
    /usr/bin/python3 - <<'END'
from common import *
import mrcfile
for type_ in ("int8", "int16", "uint16", "float16", "float32"):
    with mrcfile.open(f"{type_}.mrc") as f:
        assert f.data.dtype == type_ and f.data.shape == (5, 6, 7) and f.data.tobytes() == open(f"{type_}.raw", "rb").read(), type_
        assert np.allclose([f.voxel_size.x, f.voxel_size.y, f.voxel_size.z], [0.5, 1.5, 2]), f.voxel_size
        assert f.header.origin.item() == (4, 5, 6) and f.header.label[0].startswith(b"written by vkt")
        assert any(b"make noise" in label for label in f.header.label), f.header.label
    data = np.frombuffer(open(f"{type_}.raw", "rb").read(), type_).reshape(5, 6, 7)
    with mrcfile.new("theirs.mrc", overwrite=True) as f:
        f.set_data(data); f.voxel_size = (0.25, 0.5, 4); f.header.origin = (7, 8, 9)
    i = info("theirs.mrc")
    assert i["spacing"] == [0.25, 0.5, 4] and i["origin"] == [7, 8, 9] and voxels("theirs.mrc") == data.tobytes(), i
# The type of the extended header is vkt's own, which is all that there is to say.
with open("log", "w") as log: mrcfile.validate("int16.mrc", print_file=log)
assert [line for line in open("log").read().splitlines()[1:] if line and "exttyp = 'VKT '" not in line] == [], open("log").read()
with mrcfile.new("stack.mrcs", overwrite=True) as f:
    f.set_data(np.arange(2 * 3 * 4 * 5, dtype="i2").reshape(2, 3, 4, 5))
assert [j["dims"] for j in info("stack.mrcs")] == [[5, 4, 3]] * 2
# Who changes the header is believed, and the error says so.
with mrcfile.open("int16.mrc", "r+") as f: f.header.origin = (100, 5, 6)
i = info("int16.mrc")
assert i["origin"] == [100, 5, 6] and i["error"]["kind"] == "unknown", i
END
    for i in 0 1 2; do vkt make noise --dims 7 6 5 --dtype int16 --seed $i -o v$i.nrrd; done
    vkt stack v0.nrrd v1.nrrd v2.nrrd -o s.mrcs
    /usr/bin/python3 -c "
import mrcfile, subprocess
d = mrcfile.read('s.mrcs')
assert d.shape == (3, 5, 6, 7) and d.tobytes() == subprocess.check_output('vkt stack v0.nrrd v1.nrrd v2.nrrd | vkt write - --format raw', shell=True)"
}

@test "a plain volume has no extended header, and is what mrcfile takes for valid" {
    with_peer mrcfile
    /usr/bin/python3 - <<'END'
from common import *
import mrcfile
for type_ in ("int8", "int16", "uint16", "float16", "float32"):
    run(f"vkt make sphere --dims 7 6 5 --dtype {type_} --no-history -o {type_}.vkt")
    run(f"vkt set {type_}.vkt --spacing 0.5,1.5,2 --origin 4,5,6 --no-history -o {type_}.mrc")
    run(f"vkt set {type_}.vkt --spacing 0.5,1.5,2 --origin 4,5,6 --no-history | vkt diff - {type_}.mrc")
    assert len(open(f"{type_}.mrc", "rb").read()) == 1024 + 7 * 6 * 5 * np.dtype(type_).itemsize
    with open("log", "w") as log: assert mrcfile.validate(f"{type_}.mrc", print_file=log), open("log").read()
    assert "mrc label 1" not in info(f"{type_}.mrc").get("attributes", {})
run("vkt stack int16.vkt int16.vkt --no-history -o s.mrcs")
with open("log", "w") as log: assert mrcfile.validate("s.mrcs", print_file=log), open("log").read()
# What would be lost still has its place.
for change in ("--attribute note=kept", "--voxel-mapping 0 3", "--units HU"):
    run(f"vkt set int16.vkt {change} --no-history -o k.mrc --force && vkt set int16.vkt {change} --no-history -o k.nrrd --force")
    a, b = info("k.mrc"), info("k.nrrd")
    assert all(a.get(k) == b.get(k) for k in ("attributes", "slope", "intercept", "units")), (change, a, b)
END
}

@test "all that a header says comes back; compressed as a whole too" {
    vkt make noise --dims 7 6 5 --dtype int16 --seed 3 | vkt set --spacing 0.1,0.2,0.3 --origin -1,2,1e3 --voxel-mapping 0 3 --units HU --attribute 'space units="nm" "nm" "nm"' -o v.nrrd
    vkt write v.nrrd v.mrc
    vkt diff v.mrc v.nrrd
    vkt write v.nrrd v.mrc.gz
    vkt diff v.mrc.gz v.nrrd
    for what in spacing origin slope intercept units attributes direction; do
        diff <(vkt info v.mrc --json | grep "\"$what\"") <(vkt info v.nrrd --json | grep "\"$what\"")
    done
    vkt history v.mrc --as-shell | grep -q 'make noise'
    vkt permute zxy v.nrrd -o p.mrc
    vkt permute zxy v.nrrd | vkt diff - p.mrc
    /usr/bin/python3 -c "
import struct
h = open('p.mrc', 'rb').read(1024)
assert struct.unpack_from('<3i', h, 64) == (3, 1, 2), struct.unpack_from('<3i', h, 64)
h = open('v.mrc', 'rb').read(1024)
assert [round(x, 4) for x in struct.unpack_from('<3f', h, 40)] == [7, 12, 15] and b'values are ' in h"
    vkt flip x v.nrrd -o f.mrc
    vkt flip x v.nrrd | vkt diff - f.mrc
    grep -qa 'axes are turned' f.mrc
    fails_with 2 'MRC cannot hold float64' vkt convert v.nrrd --dtype float64 -o no.mrc
    [ ! -e no.mrc ]
}

@test "two voxels in a byte, rows of odd and even length, compressed too" {
    /usr/bin/python3 - <<'END'
from common import *
import gzip
rng = np.random.default_rng(4)
for width in 1, 2, 5, 8:
    v = rng.integers(0, 16, (3, 4, width)).astype("u1")
    rows = np.pad(v, ((0, 0), (0, 0), (0, width % 2)))
    b = header(mode=101, n=(width, 4, 3)) + (rows[..., ::2] | rows[..., 1::2] << 4).tobytes()
    open("a.mrc", "wb").write(b); open("a.mrc.gz", "wb").write(gzip.compress(b)); open("short.mrc", "wb").write(b[:-1])
    for name in "a.mrc", "a.mrc.gz":
        assert subprocess.check_output(f"vkt read {name} | vkt write - --format raw", shell=True) == v.tobytes(), (name, width)
    got = subprocess.check_output("vkt read a.mrc --roi :,1:3,1: | vkt write - --format raw", shell=True)
    assert got == v[1:, 1:3].tobytes(), width
END
    vkt info a.mrc | grep -q '^dtype *uint8'
    fails_with 3 "'short.mrc'" vkt stats short.mrc
}

@test "complex numbers and colours are a volume a component, in either byte order" {
    /usr/bin/python3 - <<'END'
from common import *
rng = np.random.default_rng(7)
for order in "<>":
    for mode, code, n in ((3, "i2", 2), (4, "f4", 2), (16, "u1", 3)):
        v = (rng.normal(size=(3, 4, 5, n)) * 50).astype(code)
        open("a.mrc", "wb").write(header(order, mode=mode) + v.astype(order + code).tobytes())
        infos = info("a.mrc")
        assert [i["attributes"]["channel"] for i in infos] == [str(c) for c in range(n)], infos
        assert all(i["dims"] == [5, 4, 3] and i["dtype"] == v.dtype.name for i in infos), infos
        assert run("vkt read a.mrc | vkt write - --format raw") == np.moveaxis(v, 3, 0).tobytes(), (order, mode)
END
}

@test "a series does not say of all volumes that they are exact because the first one is" {
    vkt make sphere --dims 9 8 7 --no-history -o exact.vkt
    vkt filter gaussian exact.vkt --sigma 1 --no-history -o smooth.vkt
    fails_with 2 "some are exact and others are not" bash -c 'cat exact.vkt smooth.vkt | vkt write - both.mrc'
    [ ! -e both.mrc ]
    cat smooth.vkt exact.vkt | vkt write - other.mrc
    run ! bash -c "vkt info other.mrc | grep -q 'error *exact'"
    cat exact.vkt exact.vkt | vkt write - two.mrc
    [ "$(vkt info two.mrc | grep -c 'error *exact')" -eq 2 ]
}

@test "damaged files, and modes that are no volumes, are refused" {
    /usr/bin/python3 - <<'END'
from common import *
v = np.arange(60, dtype="f4").tobytes()
for name, h in {"complex": header(mode=4, n=(6, 4, 3)), "unknown": header(mode=55), "huge": header(n=(2**31 - 1,) * 3), "negative": header(n=(-5, 4, 3)),
                "extended": header(extended=-1), "far": header(extended=2**30 + 1)}.items(): open(name + ".mrc", "wb").write(h + v)
open("short.mrc", "wb").write(header() + v[:-1])
open("head.mrc", "wb").write(header()[:500])
END
    fails_with 3 '576 bytes expected, 240 found' vkt info complex.mrc
    fails_with 3 'unknown' vkt info unknown.mrc
    fails_with 3 'exceed 2^62 bytes' vkt stats huge.mrc
    for name in negative extended far short head; do fails_with 3 "'$name.mrc'" vkt stats $name.mrc; done
}
