# Zarr arrays and OME-Zarr images against zarr-python (in build/peers, see tests/run.sh), and stores made by hand.
load helper

setup_more() {
    python_with numpy
    cat >common.py <<'PY'
import gzip, json, os, struct, subprocess, zlib
import numpy as np
def run(line): return subprocess.run(line, shell=True, check=True, capture_output=True).stdout
def infos(name, options=""):
    i = json.loads(run(f"vkt read '{name}' {options} | vkt info --json"))
    return i if isinstance(i, list) else [i]
def voxels(name, options=""): return run(f"vkt read '{name}' {options} | vkt write - --format raw")
def by_hand(folder, data, chunks, meta, encode=lambda b: b, sep=".", order="C", skip=()):
    """A store of version 2."""
    os.makedirs(folder)
    json.dump({"zarr_format": 2, "shape": data.shape, "chunks": chunks, "dtype": data.dtype.str, "compressor": None, "fill_value": 0, "order": order,
               "filters": None, "dimension_separator": sep} | meta, open(folder + "/.zarray", "w"))
    for at in np.ndindex(*(-(-n // c) for n, c in zip(data.shape, chunks))):
        if at in skip: continue
        chunk = np.zeros(chunks, data.dtype)
        part = data[tuple(slice(a * c, a * c + c) for a, c in zip(at, chunks))]
        chunk[tuple(slice(0, n) for n in part.shape)] = part
        path = folder + "/" + sep.join(map(str, at))
        os.makedirs(os.path.dirname(path), exist_ok=True)
        open(path, "wb").write(encode(chunk.tobytes(order)))
PY
    export PYTHONPATH="$PWD"
}

@test "version 2 by hand: types, byte orders, C and Fortran, separators, fill values, missing chunks" {
    /usr/bin/python3 - <<'END'
from common import *
rng = np.random.default_rng(1)
n = 0
for code in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"):
    for byte_order in "<>":
        for sep, order, compressor, encode in ((".", "C", None, bytes), ("/", "F", {"id": "zlib", "level": 1}, zlib.compress), (".", "F", {"id": "gzip"}, gzip.compress)):
            data = (rng.normal(size=(7, 12, 13)) * 50).astype(byte_order + code)
            name = f"a{n}.zarr"; n += 1
            by_hand(name, data, (3, 5, 4), {"compressor": compressor, "fill_value": 7}, encode, sep, order, skip={(0, 1, 2), (2, 2, 3)})
            want = data.astype(code)
            want[0:3, 5:10, 8:12] = 7; want[6:, 10:, 12:] = 7
            assert infos(name)[0]["dtype"] == np.dtype(code).name and infos(name)[0]["dims"] == [13, 12, 7]
            assert voxels(name) == want.tobytes(), (name, code, byte_order, sep, order)
            assert voxels(name, "--roi 2:9,3:11,1:6") == want[1:6, 3:11, 2:9].tobytes()
            assert voxels(name, "--roi 1::3,::2,::2 --memory 100k") == want[::2, ::2, 1::3].tobytes()
for fill, code, bits in (("NaN", "f4", None), ("-Infinity", "f8", -np.inf), (-3, "i2", -3), (2**64 - 1, "u8", 2**64 - 1), (-2**63, "i8", -2**63), (None, "u2", 0), (True, "u1", 1)):
    os.makedirs(f"fill{n}")
    json.dump({"zarr_format": 2, "shape": [2, 3], "chunks": [2, 2], "dtype": np.dtype(code).str, "compressor": None, "fill_value": fill, "order": "C", "filters": None}, open(f"fill{n}/.zarray", "w"))
    got = np.frombuffer(voxels(f"fill{n}"), code)
    assert (np.isnan(got).all() if fill == "NaN" else (got == np.array(bits, code)).all()), (fill, got)
    n += 1
END
}

@test "what zarr-python writes: versions, codecs, shards, transpositions, dimensions" {
    with_peer zarr
    /usr/bin/python3 - <<'END'
from common import *
import zarr, numcodecs
from zarr.codecs import BloscCodec, BytesCodec, GzipCodec, ZstdCodec, Crc32cCodec, TransposeCodec, ShardingCodec
rng = np.random.default_rng(3)
data = (rng.normal(size=(21, 32, 43)) * 900).astype("i2")
n = 0
def check(z, data, name, variable=""):
    z[...] = data
    assert voxels(name, variable) == data.tobytes(), name
    assert voxels(name, variable + " --roi 5:30,7:,3:19") == data[3:19, 7:, 5:30].tobytes(), name
for codec in (None, numcodecs.Zlib(3), numcodecs.GZip(3), numcodecs.Zstd(5), numcodecs.LZ4(),
              *(numcodecs.Blosc(cname=c, shuffle=s) for c in ("zstd", "lz4", "blosclz", "zlib") for s in (0, 1, 2))):
    for order in "CF":
        name = f"v2_{n}.zarr"; n += 1
        check(zarr.create_array(name, shape=data.shape, chunks=(8, 10, 11), dtype=data.dtype, zarr_format=2, compressors=codec, order=order), data, name)
for codecs in ([], [GzipCodec()], [ZstdCodec()], [ZstdCodec(checksum=True)], [BloscCodec(cname="zstd")], [BloscCodec(cname="lz4", shuffle="bitshuffle")], [Crc32cCodec()], [ZstdCodec(), Crc32cCodec()]):
    for endian in ("little", "big"):
        for separator in "/.":
            name = f"v3_{n}.zarr"; n += 1
            check(zarr.create_array(name, shape=data.shape, chunks=(8, 10, 11), dtype=data.dtype, zarr_format=3, compressors=codecs or None,
                                    serializer=BytesCodec(endian=endian), chunk_key_encoding={"name": "default", "separator": separator}), data, name)
check(zarr.create_array("t.zarr", shape=data.shape, chunks=(8, 10, 11), dtype=data.dtype, filters=[TransposeCodec(order=(2, 0, 1))]), data, "t.zarr")
for where in ("start", "end"):
    for codecs in ([BytesCodec()], [BytesCodec(), BloscCodec()], [TransposeCodec(order=(1, 2, 0)), BytesCodec(endian="big"), ZstdCodec()]):
        name = f"s_{n}.zarr"; n += 1
        z = zarr.create_array(name, shape=data.shape, chunks=(16, 20, 22), dtype=data.dtype, compressors=None,
                              serializer=ShardingCodec(chunk_shape=(4, 5, 11), codecs=codecs, index_location=where))
        check(z, data, name)
        z[:8] = 0; z[:, 10:15] = 0  # chunks that a shard does not have
        assert voxels(name) == z[...].tobytes(), name
# Other ranks; a dimension name; groups.
for shape in ((9,), (4, 9), (2, 3, 4, 5), (2, 3, 2, 4, 5)):
    d = rng.normal(size=shape)
    z = zarr.create_array(f"r{len(shape)}.zarr", shape=shape, chunks=tuple(max(1, s // 2) for s in shape), dtype="f8"); z[...] = d
    assert voxels(f"r{len(shape)}.zarr") == d.tobytes(), shape
    assert len(infos(f"r{len(shape)}.zarr")) == int(np.prod(shape[:-3])), shape
z = zarr.create_array("c.zarr", shape=(3, 4, 5), chunks=(1, 4, 5), dtype="f8", dimension_names=["c", "y", "x"]); z[...] = rng.normal(size=(3, 4, 5))
assert [i["dims"] for i in infos("c.zarr")] == [[5, 4, 1]] * 3 and voxels("c.zarr") == z[...].tobytes() and infos("c.zarr")[2]["attributes"]["channel"] == "2"
g = zarr.open_group("g.zarr", mode="w")
check(g.create_array("one", shape=data.shape, chunks=(8, 8, 8), dtype="i2"), data, "g.zarr", "")
check(g.create_array("two", shape=data.shape, chunks=(8, 8, 8), dtype="i2"), data, "g.zarr", "--variable two")
assert voxels("g.zarr:/one") == voxels("g.zarr/two") == data.tobytes()
END
    fails_with 2 'holds several arrays: one, two' vkt info g.zarr
    fails_with 2 "did you mean 'two'" vkt read g.zarr --variable twe
}

@test "OME-Zarr: axes, scales, translations, units, levels, of both versions" {
    with_peer zarr
    /usr/bin/python3 - <<'END'
from common import *
import zarr
data = np.arange(2 * 3 * 4 * 6 * 8, dtype="u2").reshape(2, 3, 4, 6, 8)
axes = [{"name": "t", "type": "time", "unit": "second"}, {"name": "c", "type": "channel"}] + [{"name": n, "type": "space", "unit": "micrometer"} for n in "zyx"]
levels = [{"path": str(i), "coordinateTransformations": [{"type": "scale", "scale": [1, 1, 2, 0.5 * 2**i, 0.25 * 2**i]},
                                                       {"type": "translation", "translation": [0, 0, 10, 20, 30]}]} for i in range(2)]
for version, name in (("0.4", "a.zarr"), ("0.5", "b.zarr")):
    g = zarr.open_group(name, mode="w", zarr_format=2 if version == "0.4" else 3)
    multi = {"multiscales": [{"version": version, "axes": axes, "datasets": levels, "coordinateTransformations": [{"type": "scale", "scale": [5, 1, 1, 1, 1]}]}]}
    g.attrs.update(multi if version == "0.4" else {"ome": multi | {"version": version}})
    for i in range(2):
        d = data[..., ::2**i, ::2**i]
        z = g.create_array(str(i), shape=d.shape, chunks=(1, 1, 3, 4, 4), dtype="u2"); z[...] = d
    found = infos(name)
    assert len(found) == 6 and found[0]["dims"] == [8, 6, 4] and found[0]["spacing"] == [0.25, 0.5, 2] and found[0]["origin"] == [30, 20, 10], found[0]
    assert found[5]["attributes"]["channel"] == "2" and found[5]["attributes"]["sequence position"] == "1" and found[0]["attributes"]["levels"] == "0 1", found[5]
    assert found[0]["attributes"]["space units"] == '"um" "um" "um"' and voxels(name) == data.tobytes()
    assert infos(name + "/1")[0]["spacing"] == [0.5, 1, 2] and infos(name + ":/1")[0]["spacing"] == [0.5, 1, 2], infos(name + "/1")[0]
    assert voxels(name, "--variable 1") == data[..., ::2, ::2].tobytes()
END
}

@test "what vkt writes is what zarr-python reads: types, compressed or not, missing zeros, all of the header" {
    with_peer zarr
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make noise --dims 70 80 67 --dtype $type --seed 1 | vkt fill --value 0 --roi :64,:64,: -o $type.nrrd --force || vkt make noise --dims 70 80 67 --dtype $type --seed 1 -o $type.vkt
        [ -e $type.nrrd ] && from=$type.nrrd || from=$type.vkt
        vkt write $from $type.zarr
        vkt write $from packed_$type.zarr --compress
        vkt write $from rows_$type.zarr --compress --memory 20k
        vkt write $from $type.raw
    done
    /usr/bin/python3 - <<'END'
from common import *
import zarr
for name in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float16", "float32", "float64"):
    want = open(name + ".raw", "rb").read()
    for folder in (name, "packed_" + name, "rows_" + name):
        z = zarr.open_array(folder + ".zarr", mode="r")
        assert z.shape == (67, 80, 70) and z.dtype == name and z[...].tobytes() == want, folder
        assert voxels(folder + ".zarr") == want and not folder.startswith("rows") or z.chunks[0] == 1, (folder, z.chunks)
assert not os.path.exists("int16.zarr/0/0/0") and os.path.exists("int16.zarr/0/1/0") # zeros
END
    vkt set int16.nrrd --spacing 0.5,1,3 --origin 4,5,6 --units HU --voxel-mapping -1024 3071 --attribute note=kept | vkt flip y -o h.zarr
    vkt set int16.nrrd --spacing 0.5,1,3 --origin 4,5,6 --units HU --voxel-mapping -1024 3071 --attribute note=kept | vkt flip y -o h.nrrd
    vkt diff h.zarr h.nrrd
    for what in spacing origin direction slope intercept units; do
        diff <(vkt info h.zarr --json | grep "\"$what\"") <(vkt info h.nrrd --json | grep "\"$what\"")
    done
    vkt info h.zarr | grep -q 'note: kept' && vkt history h.zarr --as-shell | grep -q 'flip y'
    # Whole or nothing, and only Zarr stores are replaced.
    fails_with 4 'exists' vkt write int16.nrrd h.zarr
    vkt write uint8.nrrd h.zarr --force && vkt diff h.zarr uint8.nrrd
    mkdir other.zarr && touch other.zarr/precious
    fails_with 4 'no Zarr stores' vkt write uint8.nrrd other.zarr --force
    [ -e other.zarr/precious ]
    vkt read int16.nrrd | head -c 100000 >cut.vkt
    fails_with 3 'ended early' vkt read cut.vkt -o cut.zarr
    [ ! -e cut.zarr ] && [ -z "$(find . -maxdepth 1 -name '.*vkt-*')" ]
    fails_with 2 'write one each' vkt stack int16.nrrd int16.nrrd -o two.zarr
    fails_with 2 '--pyramid is for Zarr' vkt write int16.nrrd x.nrrd --pyramid
    [ ! -e two.zarr ]
}

@test "a pyramid: every level the means of the one before, where OME says that it lies" {
    with_peer zarr
    for type in uint8 int16 uint64 float32 float64 float16; do
        vkt make noise --dims 201 150 9 --dtype $type --seed 5 -o $type.vkt --force
        vkt set $type.vkt --spacing 0.5,1,3 --origin 4,5,6 --attribute 'space units="um" "um" "um"' | vkt write $type.zarr --pyramid --compress
    done
    /usr/bin/python3 - <<'END'
from common import *
import zarr
def halved(v):
    exact = v.dtype.kind in "ui"
    out = np.empty(tuple(-(-n // 2) for n in v.shape), v.dtype)
    for at in np.ndindex(*out.shape):
        part = v[tuple(slice(2 * a, 2 * a + 2) for a in at)].ravel()
        if exact:
            from fractions import Fraction
            out[at] = round(Fraction(sum(int(p) for p in part), len(part)))
        else: out[at] = np.float64(sum(float(p) for p in part)) / len(part)
    return out
for name in ("uint8", "int16", "uint64", "float32", "float64", "float16"):
    g = zarr.open_group(name + ".zarr", mode="r")
    ms = g.attrs["multiscales"][0]
    assert ms["version"] == "0.4" and [a["name"] for a in ms["axes"]] == ["z", "y", "x"] and ms["axes"][0]["unit"] == "micrometer"
    assert [d["path"] for d in ms["datasets"]] == ["0", "1", "2"], ms
    before = g["0"][...]
    assert before.tobytes() == run(f"vkt write {name}.vkt - --format raw")
    for k in (1, 2):
        got = g[str(k)][...]
        assert got.shape == tuple(-(-n // 2) for n in before.shape), (got.shape, before.shape)
        if k == 1 or name in ("uint8", "float32"):
            want = halved(before)
            assert (got == want).all() if got.dtype.kind in "ui" else np.allclose(got.astype("f8"), want.astype("f8"), rtol=2e-3 if name == "float16" else 1e-6), (name, k)
        scale, shift = (d[t] for d, t in zip(ms["datasets"][k]["coordinateTransformations"], ("scale", "translation")))
        assert scale == [3 * 2**k, 1 * 2**k, 0.5 * 2**k] and shift == [6 + 1.5 * (2**k - 1), 5 + 0.5 * (2**k - 1), 4 + 0.25 * (2**k - 1)], (scale, shift)
        i = infos(f"{name}.zarr/{k}")[0]
        assert i["spacing"] == scale[::-1] and i["origin"] == shift[::-1]
        before = got
END
    vkt diff float32.zarr <(vkt set float32.vkt --spacing 0.5,1,3 --origin 4,5,6 --attribute 'space units="um" "um" "um"')
}

@test "damage, and what volumes are not, is told; paths lead nowhere else" {
    /usr/bin/python3 - <<'END'
from common import *
import random, shutil
data = np.arange(600, dtype="<i2").reshape(10, 6, 10)
by_hand("good", data, (4, 6, 5), {"compressor": {"id": "zlib", "level": 1}}, zlib.compress)
meta = json.load(open("good/.zarray"))
def bad(name, **changes):
    shutil.copytree("good", name)
    json.dump(meta | changes, open(name + "/.zarray", "w"))
for name, change in {"shape": {"shape": [10, -6, 10]}, "float": {"shape": [10, 6.5, 10]}, "huge": {"shape": [2**40, 2**40, 10]}, "chunks": {"chunks": [4, 6]}, "zero": {"chunks": [4, 0, 5]},
                     "big": {"chunks": [2**20, 2**20, 5]}, "type": {"dtype": "<c8"}, "structure": {"dtype": [["a", "<f4"]]}, "codec": {"compressor": {"id": "magic"}},
                     "filter": {"filters": [{"id": "delta"}]}, "fill": {"fill_value": "seven"}, "range": {"fill_value": 70000}}.items(): bad(name, **change)
shutil.copytree("good", "json"); open("json/.zarray", "w").write("{\"zarr_format\": 2, ")
shutil.copytree("good", "cut"); open("cut/1.0.0", "r+b").truncate(20)
shutil.copytree("good", "long"); open("long/1.0.0", "ab").write(b"x" * 9000)
shutil.copytree("good", "fifo"); os.remove("fifo/1.0.0"); os.mkfifo("fifo/1.0.0")
os.makedirs("leads"); json.dump({"zarr_format": 2}, open("leads/.zgroup", "w"))
json.dump({"multiscales": [{"version": "0.4", "datasets": [{"path": "../good"}]}]}, open("leads/.zattrs", "w"))
os.makedirs("empty"); json.dump({"zarr_format": 2}, open("empty/.zgroup", "w"))
random.seed(3)
good = open("good/.zarray", "rb").read()
for i in range(80):
    text = bytearray(good)
    for _ in range(random.randint(1, 4)): text[random.randrange(len(text))] = random.choice(b'0123456789"[]{},:-eE nulltrue')
    shutil.rmtree("m", ignore_errors=True); shutil.copytree("good", "m"); open("m/.zarray", "wb").write(text)
    r = subprocess.run(["vkt", "stats", "m"], capture_output=True, timeout=60)
    assert r.returncode in (0, 1, 2, 3, 5), (i, r, text)
END
    [ "$(vkt stats good --json | tr -d ' \n' | grep -o '"count":[0-9]*')" = '"count":600' ]
    for name in shape float huge chunks zero big type structure codec filter fill range json cut long fifo leads empty; do
        fails_with 3 "'$name" vkt stats $name
    done
    fails_with 3 'is no path below it' vkt read leads
    fails_with 3 'is no path below it' vkt read empty --variable ../good
}
