# Zarr arrays and OME-Zarr images against zarr-python (in build/peers, see tests/run.sh), and stores made by hand.
load helper

# written_in_part NAME: a writer of that store that waits for its input, some chunks of which are written; its process is
# $writer.
written_in_part() {
    [ -p pipe ] || mkfifo pipe
    vkt write pipe "$1" 3>&- & # bats waits for who holds 3
    writer=$!
    exec 9>pipe
    vkt make noise --dims 128 128 400 --dtype uint8 | head -c 5000000 >&9
    for _ in $(seq 250); do [ -n "$(find . -path "*vkt-*/0/0/0" -type f)" ] && return; sleep 0.02; done
    false
}
left_over() { find . -maxdepth 1 -name '.*vkt-*'; }

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
    fails_with 2 'holds several arrays: one, two' vkt stats g.zarr
    vkt info g.zarr | grep 'variable one: int16, '
    fails_with 2 "did you mean 'two'" vkt read g.zarr --variable twe
}

@test "info lists the arrays of a group and of groups in it; what cannot be a volume is no choice" {
    with_peer zarr
    /usr/bin/python3 - <<'PY'
from common import *
import warnings, zarr
warnings.simplefilter("ignore")
data = np.arange(60, dtype="i2").reshape(3, 4, 5)
for version in (2, 3):
    name = f"g{version}.zarr"
    g = zarr.open_group(name, mode="w", zarr_format=version)
    g.create_array("b", shape=(2, 3, 4, 5), chunks=(1, 3, 4, 5), dtype="f8")
    for path in ("inner/one", "inner/two"): g.create_array(path, shape=data.shape, chunks=data.shape, dtype="i2")[...] = data
    i = json.loads(run(f"vkt info {name} --json"))
    assert len(i) == 2 and i[0]["dims"] == [5, 4, 3], i
    i = i[0]["attributes"]
    assert i["variables"] == "b inner/one inner/two" and i["variable b"] == "float64, 5 x 4 x 3 x 2", i
    assert i["variable inner/two"] == "int16, 5 x 4 x 3", i
    assert voxels(name, "--variable inner/two") == data.tobytes()
    g = zarr.open_group(name, mode="w", zarr_format=version)
    g.create_array("other", shape=data.shape, chunks=data.shape, dtype="c16")
    g.create_array("volume", shape=data.shape, chunks=data.shape, dtype="i2")[...] = data
    assert voxels(name) == data.tobytes() and "variables" not in infos(name)[0].get("attributes", {})
    assert "array 'other'" in subprocess.check_output(["vkt", "info", name], text=True)
PY
}

@test "filters before compression, of both versions, as numcodecs undoes them" {
    with_peer zarr
    /usr/bin/python3 - <<'PY'
from common import *
import warnings, zarr, numcodecs as N
from numcodecs.checksum32 import JenkinsLookup3
warnings.simplefilter("ignore")
rng = np.random.default_rng(8)
n = 0
def check(data, fmt=2, chunks=(4, 6, 5), **how):
    global n
    name = f"f{n}.zarr"; n += 1
    z = zarr.create_array(name, shape=data.shape, chunks=chunks, dtype=data.dtype, zarr_format=fmt, **how)
    z[...] = data
    want = z[...].astype(z.dtype.newbyteorder("="))
    assert voxels(name) == want.tobytes(), (name, how)
    if data.shape == (9, 13, 11): assert voxels(name, "--roi 3:8,2:,1:7") == want[1:7, 2:, 3:8].tobytes(), (name, how)
for code in "i1", "u2", "i4", "u8", "f4", "f8":
    data = (rng.normal(size=(9, 13, 11)) * 50).astype(code)
    for order in "CF": check(data, filters=[N.Delta("<" + code if code != "i1" else code)], compressors=N.Zlib(1), order=order)
    for big in "<>" if code != "i1" else "|": check(data.astype(big + code), filters=[N.Shuffle(data.itemsize)], compressors=None)
data = rng.normal(size=(9, 13, 11)) * 100
check(data.astype("u2"), filters=[N.Delta("<u2", "<i4"), N.Shuffle(4)], compressors=N.Zstd(1))
check(data.astype(">i2"), filters=[N.Delta(">i2")], compressors=N.Blosc("zstd"))
for astype in "<i2", ">i4", "u1":
    check(data, filters=[N.FixedScaleOffset(-500, 10, "<f8", astype)] if astype != "u1" else [N.FixedScaleOffset(-500, 0.2, "<f8", astype)], compressors=N.Zlib(1))
check(data, filters=[N.FixedScaleOffset(-500, 10, "<f8", "<i2"), N.Delta("<i2")], compressors=None)
check(np.arange(9 * 13 * 11, dtype="u1").reshape(9, 13, 11), filters=[N.FixedScaleOffset(3, 1, "u1", "u1")], compressors=None) # around, there and back
check(data, filters=[N.Quantize(2, "<f8", "<f4")], compressors=N.Zlib(1))
check(data.astype("f4"), filters=[N.BitRound(7)], compressors=N.Zstd(1))
check(data.astype("f4"), filters=[N.AsType("<f8", "<f4")], compressors=N.Zlib(1))
import zarr.codecs.numcodecs as V3
check(data.astype("i2"), 3, filters=[V3.Delta(dtype="<i2")])
check(data.astype("i2"), 3, filters=[V3.Delta(dtype="<i2")], shards=(8, 12, 10))
check(data, 3, filters=[V3.FixedScaleOffset(offset=-500, scale=10, dtype="<f8", astype="<i2")])
check(data.astype("u4"), 3, compressors=[V3.Shuffle(elementsize=4), V3.Zlib(level=1)])
for codec in V3.LZ4(), V3.BZ2(), V3.LZMA(), V3.Zstd(), V3.GZip(), V3.Blosc(cname="lz4"): check(data.astype("i2"), 3, compressors=[codec])
# Checksums, before and behind, on their own, in a row and inside of compression; a changed byte is told.
for sum in N.CRC32(), N.CRC32("end"), N.Adler32(), N.Adler32("end"), N.CRC32C(), N.CRC32C("start"), N.Fletcher32(), JenkinsLookup3():
    for compressor in None, N.Zlib(1), N.Blosc("lz4"):
        check(data.astype("i2"), filters=[sum], compressors=compressor)
        check(data.astype("i2"), filters=[N.Delta("<i2"), N.Shuffle(2), sum], compressors=compressor)
    check(data.astype("u1"), filters=[sum], compressors=None)  # chunks of odd sizes too, at none of the ends
check(np.zeros((9, 13, 11), "u1"), filters=[N.Fletcher32()], compressors=None)
check(np.full((9, 13, 11), 255, "u1"), filters=[N.Fletcher32()], compressors=None)
check(data.astype("i2"), filters=[N.CRC32(), N.Fletcher32(), N.Adler32("end")], compressors=N.Zstd(1))
for sum in V3.CRC32(), V3.Adler32(), V3.CRC32C(), V3.Fletcher32(), V3.JenkinsLookup3(), V3.CRC32(location="end"):
    check(data.astype("i2"), 3, compressors=[sum])
    check(data.astype("i2"), 3, compressors=[sum, V3.Zlib(level=1)])
    chunk = bytearray(open(f"f{n - 2}.zarr/c/0/0/0", "rb").read())
    chunk[20] ^= 1
    open(f"f{n - 2}.zarr/c/0/0/0", "wb").write(chunk)
    assert subprocess.run(["vkt", "stats", f"f{n - 2}.zarr"], capture_output=True).returncode == 3
# Compression among the filters, several kinds in a row, and checksums and filters in the place of compression.
for codec in N.Zstd(1), N.Zlib(1), N.GZip(1), N.Blosc("lz4"), N.LZ4(), N.BZ2(), N.LZMA():
    check(data.astype("i2"), filters=[codec], compressors=None)
    check(data.astype("i2"), filters=[N.Delta("<i2"), N.Shuffle(2), codec], compressors=N.Zlib(1))
    check(data.astype("i2"), filters=[N.Zlib(1), N.CRC32(), N.Adler32("end")], compressors=codec)
for last in N.CRC32(), N.Adler32("end"), N.Fletcher32(), N.Shuffle(2): check(data.astype("i2"), compressors=last)
# Of sizes around lookup3's blocks of twelve bytes.
for size in range(1, 30): check(np.arange(3 * size, dtype="u1").reshape(1, 3, size) + 200, compressors=JenkinsLookup3(), chunks=(1, 1, size))
check(data.astype("i2"), filters=[N.Zlib(1), JenkinsLookup3()], compressors=JenkinsLookup3())
check(data.astype("i2"), 3, compressors=[V3.Zstd(), V3.Zlib(level=1), V3.CRC32()])
for compressor in None, N.Zlib(1), N.Blosc("zstd"):
    check(data > 0, filters=[N.PackBits()], compressors=compressor)
    check(data > 0, filters=[N.PackBits(), N.CRC32()], compressors=compressor, order="F")
def refused(name, filters):
    by_hand(name, data.astype("<i2"), (4, 6, 5), {"filters": filters})
refused("objects", [{"id": "vlen-utf8"}]); refused("zero", [{"id": "fixedscaleoffset", "scale": 0, "offset": 1, "dtype": "<i2"}])
refused("others", [{"id": "delta", "dtype": "<f8"}]); refused("behind", [{"id": "shuffle", "elementsize": 2}, {"id": "delta", "dtype": "<i2"}])
refused("bits", [{"id": "packbits"}]); refused("seeded", [{"id": "jenkins_lookup3", "initval": 7, "prefix": None}])
refused("summed", [{"id": "crc32"}, {"id": "delta", "dtype": "<i2"}])
PY
    fails_with 3 "the filter 'vlen-utf8', which is not read" vkt info objects
    fails_with 3 "a filter whose scale is 0" vkt info zero
    fails_with 3 "a checksum jenkins_lookup3 with its own initval, which is not read" vkt info seeded
    fails_with 3 "filters of other types than its own" vkt info others
    fails_with 3 "behind one of bytes" vkt info behind
    fails_with 3 "the filter 'delta', which is not read" vkt info summed
    fails_with 3 "bits of other elements than bool" vkt info bits
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
    assert found[5]["attributes"]["channel"] == "2" and found[5]["attributes"]["sequence position"] == "5" and found[0]["attributes"]["levels"] == "0 1", found[5]
    assert all(f["attributes"]["sequence step"] == "5" and f["attributes"]["sequence units"] == '"s"' for f in found), found
    assert found[0]["attributes"]["space units"] == '"um" "um" "um"' and voxels(name) == data.tobytes()
    assert infos(name + "/1")[0]["spacing"] == [0.5, 1, 2] and infos(name + ":/1")[0]["spacing"] == [0.5, 1, 2], infos(name + "/1")[0]
    assert voxels(name, "--variable 1") == data[..., ::2, ::2].tobytes()
    # Channels by their labels, where these tell them apart; times by scale, translation and unit.
    multi = json.loads(json.dumps(multi))
    image = multi["multiscales"][0]
    image["axes"][0]["unit"] = "millisecond"
    for level in image["datasets"]: level["coordinateTransformations"][0]["scale"][0] = 0.1; level["coordinateTransformations"][1]["translation"][0] = 2
    for labels, want in ((["DAPI", "GFP", "Cy5"], ["DAPI", "GFP", "Cy5"]), (["a", "a", "b"], ["0", "1", "2"]), (["a", "b"], ["0", "1", "2"])):
        multi["omero"] = {"channels": [{"label": l, "color": "FFFFFF"} for l in labels]}
        g.attrs.update(multi if version == "0.4" else {"ome": multi | {"version": version}})
        found = [f["attributes"] for f in infos(name)]
        assert [f["channel"] for f in found] == 2 * want, found
        assert [f["sequence position"] for f in found] == 3 * ["10"] + 3 * ["10.5"] and found[0]["sequence step"] == "0.5" and found[0]["sequence units"] == '"ms"', found
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
    vkt info h.zarr | grep -q 'note: kept'
    vkt history h.zarr --as-shell | grep -q 'flip y'
    # Whole or nothing, and only Zarr stores are replaced.
    fails_with 4 'exists' vkt write int16.nrrd h.zarr
    vkt write uint8.nrrd h.zarr --force
    vkt diff h.zarr uint8.nrrd
    mkdir other.zarr
    touch other.zarr/precious
    fails_with 4 'no Zarr stores' vkt write uint8.nrrd other.zarr --force
    [ -e other.zarr/precious ]
    vkt read int16.nrrd | head -c 100000 >cut.vkt
    fails_with 3 'ended early' vkt read cut.vkt -o cut.zarr
    [ ! -e cut.zarr ]
    [ -z "$(find . -maxdepth 1 -name '.*vkt-*')" ]
    fails_with 3 'ended early' vkt write cut.vkt cut.zarr --zarr-version 3 --chunk 4
    [ -z "$(find . -maxdepth 1 -name '.*vkt-*')" ]
    fails_with 2 '--pyramid is for Zarr' vkt write int16.nrrd x.nrrd --pyramid
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

@test "version 3 as vkt writes it: types, codecs, chunks and shards, the same bytes for every number of threads" {
    with_peer zarr
    /usr/bin/python3 - <<'END'
from common import *
import zarr
n = 0
def check(raw, dtype, options, chunks=None, shards=None, names=()):
    global n
    name = f"w{n}.zarr"; n += 1
    run(f"vkt write {raw}.vkt {name} --zarr-version 3 {options}")
    z = zarr.open_array(name, mode="r")
    want = run(f"vkt write {raw}.vkt - --format raw")
    assert z.metadata.zarr_format == 3 and z.shape == (67, 80, 70) and z.dtype == dtype and z[...].tobytes() == want, (name, options)
    assert chunks is None or z.chunks == chunks, (z.chunks, options)
    assert shards is None or z.shards == shards, (z.shards, options)
    assert tuple(type(c).__name__ for c in z.compressors) == names, (z.compressors, options)
    assert z.metadata.dimension_names == ("z", "y", "x")
    assert voxels(name) == want, name
    assert voxels(name, "--roi 3:40,60:,30:50") == np.frombuffer(want, dtype).reshape(67, 80, 70)[30:50, 60:, 3:40].tobytes()
    return name
for dtype in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float16", "float32", "float64"):
    run(f"vkt make noise --dims 70 80 67 --dtype {dtype} --seed 1 -o {dtype}.vkt")
    check(dtype, dtype, "")
    check(dtype, dtype, "--compress", names=("BloscCodec",))
    check(dtype, dtype, "--codec zstd --chunk 32,20,16 --shard 64,40,32", (16, 20, 32), (32, 40, 64), ("ZstdCodec",))
run("vkt fill int16.vkt --value 0 --roi :40,:,: -o zeros.vkt")  # chunks and shards that are not there
for options, chunks, shards, names in (("--codec gzip", (64, 64, 64), None, ("GzipCodec",)), ("--codec blosc --chunk 16", (16, 16, 16), None, ("BloscCodec",)),
                                       ("--chunk 16 --shard 48", (16, 16, 16), (48, 48, 48), ()), ("--chunk 16 --shard 40 --codec zstd", (16, 16, 16), (48, 48, 48), ("ZstdCodec",)),
                                       ("--shard 1000", (64, 64, 64), (128, 128, 128), ()), ("--chunk 200 --shard 200 --codec blosc", (67, 80, 70), (67, 80, 70), ("BloscCodec",)),
                                       ("--chunk 20,1,5", (5, 1, 20), None, ())):
    name = check("zeros", "int16", options, chunks, shards, names)
    run(f"vkt write zeros.vkt one.zarr --zarr-version 3 {options} --threads 1 --force && diff -r one.zarr {name}")
    # A budget below a layer, and below a slice: chunks get flat, the voxels stay.
    for memory in ("400k", "60k"):
        check("zeros", "int16", f"{options} --memory {memory}", names=names)
# Version 2 takes chunks and codecs, too.
for codec, names in (("zstd", ("Zstd",)), ("gzip", ("GZip",)), ("blosc", ("Blosc",))):
    run(f"vkt write zeros.vkt two_{codec}.zarr --codec {codec} --chunk 33")
    z = zarr.open_array(f"two_{codec}.zarr", mode="r")
    assert z.metadata.zarr_format == 2 and z.chunks == (33, 33, 33) and tuple(type(c).__name__ for c in z.compressors) == names, z.compressors
    assert z[...].tobytes() == run("vkt write zeros.vkt - --format raw") == voxels(f"two_{codec}.zarr")
END
    vkt set int16.vkt --spacing 0.5,1,3 --origin 4,5,6 --units HU --attribute note=kept | vkt flip y | vkt write h.zarr --zarr-version 3 --chunk 16 --shard 32
    vkt set int16.vkt --spacing 0.5,1,3 --origin 4,5,6 --units HU --attribute note=kept | vkt flip y | vkt diff - h.zarr
    vkt info h.zarr | grep -q 'note: kept'
    vkt history h.zarr --as-shell | grep -q 'flip y'
    fails_with 2 'is not 2 or 3' vkt write int16.vkt x.zarr --zarr-version 4
    fails_with 2 'has no shards' vkt write int16.vkt x.zarr --shard 64
    fails_with 2 'is smaller than --chunk' vkt write int16.vkt x.zarr --zarr-version 3 --shard 16 --chunk 32
    fails_with 2 'voxels along each axis' vkt write int16.vkt x.zarr --chunk 0
    fails_with 2 'voxels along each axis' vkt write int16.vkt x.zarr --chunk 2.5
    for option in '--zarr-version 3' '--chunk 8' '--codec zstd'; do
        # shellcheck disable=SC2086
        fails_with 2 'is for Zarr' vkt write int16.vkt x.nrrd $option
    done
    [ ! -e x.zarr ] && [ ! -e x.nrrd ]
}

@test "OME-Zarr 0.5: a pyramid of version 3 is that of version 2" {
    with_peer zarr
    vkt make noise --dims 201 150 9 --dtype uint16 --seed 5 | vkt set --spacing 0.5,1,3 --origin 4,5,6 --attribute 'space units="um" "um" "um"' -o v.vkt
    vkt write v.vkt two.zarr --pyramid --compress
    vkt write v.vkt three.zarr --pyramid --zarr-version 3 --chunk 32 --shard 64 --codec zstd
    /usr/bin/python3 - <<'END'
from common import *
import zarr
two, three = zarr.open_group("two.zarr", mode="r"), zarr.open_group("three.zarr", mode="r")
assert three.metadata.zarr_format == 3 and three.attrs["ome"]["version"] == "0.5"
a, b = two.attrs["multiscales"][0], three.attrs["ome"]["multiscales"][0]
assert a["axes"] == b["axes"] and a["datasets"] == b["datasets"] and "version" not in b
for k in ("0", "1", "2"):
    assert (two[k][...] == three[k][...]).all() and three[k].shards == (min(64, three[k].shape[0]), 64, 64) or k == "2", three[k].shards
    assert voxels("two.zarr/" + k) == voxels("three.zarr/" + k) == voxels("three.zarr:/" + k)
    assert infos("two.zarr/" + k)[0]["origin"] == infos("three.zarr/" + k)[0]["origin"]
END
    vkt diff v.vkt three.zarr
}

@test "consolidated metadata stand for the files that are not there" {
    with_peer zarr
    /usr/bin/python3 - <<'END'
from common import *
import glob, zarr
rng = np.random.default_rng(5)
data = rng.integers(0, 900, (9, 10, 11)).astype("u2")
for version in (2, 3):
    name = f"g{version}.zarr"
    g = zarr.open_group(name, mode="w", zarr_format=version)
    sub = g.create_group("inner")
    z = sub.create_array("one", shape=data.shape, chunks=(4, 5, 6), dtype="u2"); z[...] = data
    z.attrs["units"] = "HU"
    g.create_array("two", shape=(3, 4, 5), chunks=(2, 2, 2), dtype="f4", fill_value=2.5)  # no chunk at all
    zarr.consolidate_metadata(name)
    for path in glob.glob(name + "/**/*", recursive=True) + glob.glob(name + "/**/.z*", recursive=True):
        keep = path == name + "/.zmetadata" or (version == 3 and path == name + "/zarr.json")
        if os.path.isfile(path) and os.path.basename(path) in (".zarray", ".zattrs", ".zgroup", "zarr.json") and not keep: os.remove(path)
    assert voxels(name, "--variable inner/one") == voxels(name + ":/inner/one") == voxels(name + "/inner/one") == data.tobytes(), version
    assert infos(name, "--variable inner/one")[0]["units"] == "HU"
    assert (np.frombuffer(voxels(name, "--variable two"), "f4") == 2.5).all()
    r = subprocess.run(["vkt", "stats", name], capture_output=True, text=True)
    assert r.returncode == 2 and "inner, two" in r.stderr, r
for bad in ("[]", "{", '{"metadata": 7}', '{"metadata": {"one/.zarray": 7}}', '{"metadata": {"one/.zarray": {"shape": [1]}}}'):
    os.makedirs("bad", exist_ok=True); os.makedirs("bad/one", exist_ok=True); open("bad/.zmetadata", "w").write(bad)
    r = subprocess.run(["vkt", "info", "bad/one", "--format", "zarr"], capture_output=True, text=True)
    assert r.returncode in (2, 3) and r.stderr, (bad, r)
END
}

@test "stores in ZIP files: as zarr-python writes them and as zip packs directories" {
    with_peer zarr
    /usr/bin/python3 - <<'END'
from common import *
import shutil, zarr, zipfile
rng = np.random.default_rng(6)
data = rng.integers(-900, 900, (21, 32, 43)).astype("i2")
n = 0
for version in (2, 3):
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        for shards in ((None, (16, 20, 22)) if version == 3 else (None,)):
            name = f"z{n}.zarr.zip"; n += 1
            store = zarr.storage.ZipStore(name, mode="w", compression=method)
            z = zarr.create_array(store, shape=data.shape, chunks=(8, 10, 11), shards=shards, dtype="i2", zarr_format=version); z[...] = data
            store.close()
            assert voxels(name) == data.tobytes(), name
            assert voxels(name, "--roi 5:30,7:,3:19") == data[3:19, 7:, 5:30].tobytes()
            assert run(f"cat {name} | vkt read - | vkt write - --format raw") == data.tobytes()
            os.rename(name, f"nameless{n}")
            assert voxels(f"nameless{n}") == data.tobytes()
            os.rename(f"nameless{n}", name)
# A pyramid, and a folder packed as a whole.
run("vkt make noise --dims 150 90 20 --dtype uint16 --seed 5 -o v.vkt && vkt write v.vkt p.zarr --pyramid --zarr-version 3 --codec zstd")
shutil.make_archive("whole", "zip", ".", "p.zarr"); os.rename("whole.zip", "whole.zarr.zip")
shutil.make_archive("p", "zip", "p.zarr"); os.rename("p.zip", "p.zarr.zip")
for name in ("whole.zarr.zip", "p.zarr.zip"):
    for level in ("0", "1"):
        assert voxels(name + ":/" + level) == voxels(name, "--variable " + level) == voxels("p.zarr/" + level), name
    assert infos(name)[0]["attributes"]["levels"] == infos("p.zarr")[0]["attributes"]["levels"]
    assert infos(name + ":/1")[0]["spacing"] == infos("p.zarr/1")[0]["spacing"], infos(name + ":/1")
# Damage: cut at every so many bytes, and flipped bytes.
whole = open("z1.zarr.zip", "rb").read()
for length in range(0, len(whole), len(whole) // 40):
    open("cut.zarr.zip", "wb").write(whole[:length])
    r = subprocess.run(["vkt", "stats", "cut.zarr.zip"], capture_output=True, text=True, timeout=60)
    assert r.returncode == 3, (length, r)
import random
random.seed(4)
for i in range(60):
    damaged = bytearray(whole)
    for _ in range(3): damaged[random.randrange(len(whole) * 3 // 4 if i % 2 else 0, len(whole))] = random.randrange(256)
    open("bad.zarr.zip", "wb").write(damaged)
    r = subprocess.run(["vkt", "write", "bad.zarr.zip", "-", "--format", "raw"], capture_output=True, timeout=60)
    assert r.returncode in (0, 2, 3, 5), r
    # Voxels that a deflated member's checksum covers are right or refused.
END
    fails_with 2 'did you mean' vkt read p.zarr.zip --variable 00
}

@test "stores in ZIP files that vkt writes: as zarr-python and zip read them, whole or not there" {
    with_peer zarr
    vkt make noise --dims 70 40 30 --dtype uint16 --seed 5 -o v.vkt
    vkt write v.vkt v.raw
    vkt write v.vkt a.zarr.zip --chunk 16,16,16
    vkt write v.vkt b.zarr.zip --zarr-version 3 --chunk 8,8,8 --shard 32,16,16 --compress
    vkt write v.vkt c.zarr.zip --pyramid --zarr-version 3 --compress
    for name in a b c; do vkt diff v.vkt $name.zarr.zip; done
    vkt write v.vkt b2.zarr.zip --zarr-version 3 --chunk 8,8,8 --shard 32,16,16 --compress --threads 1
    cmp b.zarr.zip b2.zarr.zip
    /usr/bin/python3 - <<'END'
from common import *
import zarr, zipfile
want = np.fromfile("v.raw", "u2").reshape(30, 40, 70)
for name, path in (("a", ""), ("b", ""), ("c", "0")):
    with zipfile.ZipFile(name + ".zarr.zip") as z:
        assert z.testzip() is None and all(i.compress_type == zipfile.ZIP_STORED for i in z.infolist())
    store = zarr.storage.ZipStore(name + ".zarr.zip", mode="r")
    assert (zarr.open_array(store, path=path, mode="r")[...] == want).all(), name
END
    fails_with 4 'exists' vkt write v.vkt a.zarr.zip
    vkt write v.vkt a.zarr.zip --force
    vkt diff v.vkt a.zarr.zip
    [ -z "$(find . -name '*.parts' -o -name '.*vkt-*')" ]
}

@test "stores in ZIP files: a damaged voxel of a member that is stored as it is" {
    vkt make noise --dims 12 10 8 --dtype uint16 -o z.zarr.zip
    vkt stats z.zarr.zip >/dev/null
    printf '\377' | dd of=z.zarr.zip bs=1 seek=$(($(stat -c %s z.zarr.zip) / 2)) conv=notrunc status=none
    fails_with 3 "damaged: its checksum is another" vkt stats z.zarr.zip
}

@test "transpositions one after another, bzip2 and LZMA; arrays of coordinates and what converters put beside images" {
    with_peer zarr
    /usr/bin/python3 - <<'END'
from common import *
import zarr, numcodecs
from zarr.codecs import TransposeCodec
rng = np.random.default_rng(11)
data = (rng.normal(size=(7, 12, 13)) * 900).astype("i2")
for shards in (None, (6, 10, 8)):
    for orders in (((0, 2, 1), (1, 0, 2)), ((1, 2, 0), (1, 2, 0)), ((2, 0, 1), (0, 2, 1))):
        name = f"t{shards is None}{orders[0]}.zarr".replace(" ", "")
        z = zarr.create_array(name, shape=data.shape, dtype="i2", chunks=(3, 5, 4), shards=shards, filters=[TransposeCodec(order=o) for o in orders])
        z[...] = data
        assert voxels(name) == data.tobytes(), (shards, orders)
for codec in (numcodecs.BZ2(), numcodecs.LZMA(), numcodecs.LZMA(format=2)):  # xz and the older format of one file
    name = f"{codec.codec_id}{getattr(codec, 'format', '')}.zarr"
    z = zarr.create_array(name, shape=data.shape, dtype="i2", chunks=(3, 5, 4), zarr_format=2, compressors=codec); z[...] = data
    assert voxels(name) == data.tobytes(), codec
# xarray's: a variable, its coordinates, the limits of their cells, a number that names a projection.
for version in (2, 3):
    name = f"x{version}.zarr"
    g = zarr.open_group(name, mode="w", zarr_format=version)
    def put(array, values, *dimensions, **attributes):
        z = g.create_array(array, shape=values.shape, dtype=values.dtype, **({"dimension_names": dimensions} if version == 3 else {}))
        z[...] = values
        z.attrs.update(attributes | ({"_ARRAY_DIMENSIONS": dimensions} if version == 2 else {}))
    put("lat", 50 - np.arange(12) * 0.5, "lat", units="degrees"); put("lon", np.arange(13, dtype="f4") * 2, "lon", units="degrees")
    put("lev", np.array([10, 20, 30, 40, 50, 60, 70]), "lev", units="m"); put("time", np.array([0.0, 6, 12]), "time", units="hours since 2000-01-01", bounds="time_bnds")
    put("time_bnds", np.zeros((3, 2)), "time", "bnds"); put("crs", np.array(0))
    series = np.stack([data, data + 1, data + 2])
    put("v", series, "time", "lev", "lat", "lon")
    i = infos(name)
    assert voxels(name) == series.tobytes() == voxels(name, "--variable v") and len(i) == 3, i
    assert i[1]["spacing"] == [2, 0.5, 10] and i[1]["origin"] == [0, 50, 10] and i[1]["direction"][1] == [0, -1, 0], i[1]
    assert i[1]["attributes"]["sequence position"] == "6" and i[1]["attributes"]["sequence step"] == "6", i[1]
    put("flat", series[:, 0], "time", "lat", "lon")
    assert [j["dims"] for j in infos(name + "/flat")] == [[13, 12, 1]] * 3 and infos(name + "/flat")[2]["attributes"]["sequence position"] == "12"
# bioformats2raw writes OME's metadata as a group beside the only image.
g = zarr.open_group("b.zarr", mode="w", zarr_format=2); g.attrs["bioformats2raw.layout"] = 3
image = g.create_group("0"); image.create_array("0", data=data)
image.attrs["multiscales"] = [{"version": "0.4", "axes": [{"name": n, "type": "space"} for n in "zyx"], "datasets": [{"path": "0", "coordinateTransformations": [{"type": "scale", "scale": [3, 2, 2]}]}]}]
g.create_group("OME").attrs["series"] = ["0"]
assert voxels("b.zarr") == data.tobytes() and infos("b.zarr")[0]["spacing"] == [2, 2, 3]
END
    fails_with 2 'holds several arrays: flat, v' vkt read x2.zarr -o x.raw
}

@test "a series is one array with axes of times and channels, in bounded memory, of every layout" {
    with_peer zarr
    /usr/bin/python3 - <<'END'
from common import *
import zarr
dims = (70, 40, 9)
def stream(name, said):
    """One volume for each, with these attributes, as one stream."""
    for i, attributes in enumerate(said):
        options = " ".join(f"--attribute '{k}={v}'" for k, v in attributes.items())
        run(f"vkt make noise --dims {' '.join(map(str, dims))} --dtype uint16 --seed {i} | vkt set --spacing 0.5,1,3 --origin 4,5,6 --attribute 'space units=\"um\" \"um\" \"um\"' {options} -o s{i}.vkt --force")
    run(f"vkt read 's[0-9]*.vkt' -o {name}.vkt --force; rm s[0-9]*.vkt")
def times(n, step=0.5, first=1): return [{"sequence position": first + i * step, "sequence step": step, "sequence units": '"s"'} for i in range(n)]
names = [{"channel": n} for n in ("DAPI", "GFP", "Cy5")]
series = {"t": times(3), "c": names, "tc": [t | c for t in times(2) for c in names], "ct": [t | c for c in names for t in times(2)], "plain": [{}, {}],
          "uneven": [{"sequence position": p} for p in (0, 1, 5)]}
leading = {"t": (3,), "c": (3,), "tc": (2, 3), "ct": (3, 2), "plain": (2,), "uneven": (3,)}
layouts = ["", "--compress", "--memory 20k", "--zarr-version 3", "--zarr-version 3 --chunk 8 --shard 32 --compress", "--pyramid", "--pyramid --zarr-version 3 --chunk 16 --shard 32"]
for name, said in series.items():
    stream(name, said)
    want = np.frombuffer(voxels(name + ".vkt"), "u2").reshape(*leading[name], *dims[::-1])
    given = [f["attributes"] for f in infos(name + ".vkt")]
    for layout in layouts if len(name) < 3 else layouts[::5]:
        for end in (".zarr", ".zarr.zip"):
            if end == ".zarr.zip" and name not in ("tc", "t"): continue
            out = name + end
            run(f"vkt write {name}.vkt {out} --force {layout}")
            turned = name == "ct" and "pyramid" in layout # OME has times first
            data = np.swapaxes(want, 0, 1) if turned else want
            about = [given[j] for j in np.arange(len(said)).reshape(leading[name]).T.ravel()] if turned else given
            store = zarr.storage.ZipStore(out, mode="r") if end == ".zarr.zip" else out
            z = zarr.open(store, mode="r")
            a = z["0"] if "pyramid" in layout else z
            assert a.shape == data.shape and (a[...] == data).all(), (name, layout)
            assert a.chunks[:-3] == (1,) * (data.ndim - 3)
            axes = ["t" if name in ("plain", "uneven") else n for n in ("tc" if turned else name if name in ("t", "c", "tc", "ct") else "t")] + ["z", "y", "x"]
            assert list(a.metadata.dimension_names if "version 3" in layout else a.attrs["_ARRAY_DIMENSIONS"]) == axes
            found = infos(out)
            assert voxels(out) == data.tobytes()
            for f, g in zip(found, about, strict=True):
                f["attributes"].pop("variable", 0), f["attributes"].pop("levels", 0)
                assert f["attributes"] == g and f["spacing"] == [0.5, 1, 3] and f["origin"] == [4, 5, 6], (name, layout, f, g)
            if "pyramid" not in layout: continue
            image = z.attrs["ome"] if "version 3" in layout else z.attrs
            m = image["multiscales"][0]
            assert [x["name"] for x in m["axes"]] == axes and [x["type"] for x in m["axes"]] == [{"t": "time", "c": "channel"}.get(n, "space") for n in axes]
            assert m["axes"][-1]["unit"] == "micrometer" and [d["path"] for d in m["datasets"]] == ["0", "1"]
            for k, d in enumerate(m["datasets"]):
                scale, shift = (d["coordinateTransformations"][i][w] for i, w in ((0, "scale"), (1, "translation")))
                assert scale == [0.5 if n == "t" and name in ("t", "tc", "ct") else 1 for n in axes[:-3]] + [3 * 2**k, 2**k, 0.5 * 2**k]
                assert shift[:-3] == [1 if n == "t" and name in ("t", "tc", "ct") else 0 for n in axes[:-3]]
            if "t" in name and len(name) < 3: assert m["axes"][0]["unit"] == "second"
            if "c" in name: assert [c["label"] for c in image["omero"]["channels"]] == ["DAPI", "GFP", "Cy5"]
            low = z["1"][...]
            assert low.shape == data.shape[:-3] + (5, 20, 35)
            for at in np.ndindex(*data.shape[:-3]):
                p = np.pad(data[at].astype("f8"), ((0, 1), (0, 0), (0, 0)), "edge").reshape(5, 2, 20, 2, 35, 2).mean((1, 3, 5))
                assert np.abs(low[at] - p).max() <= 0.5
            assert voxels(out + ("/1" if end == ".zarr" else ":/1")) == low.tobytes()
# What is no grid is refused, and leaves nothing.
for said in ([t | c for t, c in zip(times(3), names)], [t | c for t in times(2) for c in names][:5], [names[0], names[1], names[0], names[2]]):
    stream("bad", said)
    r = subprocess.run("vkt write bad.vkt bad.zarr", shell=True, capture_output=True, text=True)
    assert r.returncode == 2 and "no full grid" in r.stderr and "out_%04d.zarr" in r.stderr, r
assert not [n for n in os.listdir() if n.startswith(("bad.zarr", ".bad"))], os.listdir()
END
    vkt make noise --dims 4 4 4 -o small.vkt
    fails_with 2 'different dims' sh -c 'cat t.vkt small.vkt | vkt write - mixed.zarr'
    # What is replaced goes with all of its folders.
    vkt write t.vkt three.zarr --zarr-version 3
    vkt write small.vkt three.zarr --zarr-version 3 --force
    vkt write t.vkt three.zarr --force
    [ -z "$(find . -maxdepth 1 -name '.*vkt-*')" ]
}

@test "a writer that is killed leaves nothing; killed with its guard, nothing after the next write in that place" {
    written_in_part a.zarr
    kill -9 $writer
    exec 9>&-
    for _ in $(seq 250); do [ -z "$(left_over)" ] && break; sleep 0.02; done
    [ -z "$(left_over)" ]
    written_in_part a.zarr
    kill -9 "$(pgrep -P $writer)" $writer
    wait $writer || true
    exec 9>&-
    [ -n "$(left_over)" ]
    touch .a.zarr.vkt-notes
    vkt make ramp --dims 8 8 8 -o other.zarr
    [ "$(left_over)" = ./.a.zarr.vkt-notes ]
    # A living one is left alone.
    written_in_part a.zarr
    vkt make ramp --dims 8 8 8 -o other.zarr --force
    [ "$(left_over | wc -l)" = 2 ]
    kill $writer
    exec 9>&-
    wait $writer || true
    [ "$(left_over)" = ./.a.zarr.vkt-notes ]
}

@test "folders that hold more than a store are not replaced" {
    vkt make ramp --dims 5 4 3 -o a.nrrd
    mkdir broken.zarr
    echo 'not json' >broken.zarr/.zarray
    vkt write a.nrrd -o broken.zarr --force # is a store all the same
    vkt read broken.zarr | vkt diff - a.nrrd
    vkt write a.nrrd -o pyramid.zarr --pyramid
    vkt write a.nrrd -o pyramid.zarr --force
    for file in keep.txt .git/config 0.txt; do
        for store in broken.zarr pyramid.zarr; do
            mkdir -p "$(dirname $store/$file)"
            echo precious >$store/$file
            find $store | sort >before
            fails_with 4 "it holds files that are no Zarr stores" vkt write a.nrrd -o $store --force
            find $store | sort | diff before -
            rm -r "${store:?}/${file%%/*}"
        done
    done
    vkt write a.nrrd -o broken.zarr --force
}

@test "a store of another program that is replaced is gone, groups with names and all" {
    /usr/bin/python3 -c '
from common import *
for path in ("g.zarr/density", "g.zarr/labels/cells/0"): by_hand(path, np.zeros((4, 4, 4), "u1"), (2, 2, 2), {}, sep="/")
for path in ("g.zarr", "g.zarr/labels", "g.zarr/labels/cells"): open(path + "/.zgroup", "w").write("{\"zarr_format\": 2}")'
    mkdir elsewhere
    touch elsewhere/kept
    ln -s ../elsewhere g.zarr/link
    fails_with 4 "it holds files that are no Zarr stores" vkt make ramp --dims 8 8 8 -o g.zarr --force
    [ -L g.zarr/link ]
    rm g.zarr/link
    vkt make ramp --dims 8 8 8 -o g.zarr --force
    [ -z "$(left_over)" ]
    [ -e elsewhere/kept ]
    vkt make ramp --dims 8 8 8 | vkt diff - g.zarr
}

@test "a region of an array that is there: its chunks and shards, whatever they are encoded by, and nothing else" {
    with_peer zarr
    PYTHONPATH="$VKT_ROOT/tests:$PYTHONPATH" /usr/bin/python3 - <<'END'
from common import *
from region_writing import *
import zarr, numcodecs, shutil
from zarr.codecs import BloscCodec, BytesCodec, GzipCodec, ZstdCodec, Crc32cCodec, TransposeCodec, ShardingCodec
whole, part, want, rng = whole_and_part((21, 32, 43), 4)
def files(folder): return {os.path.relpath(os.path.join(d, f), folder): open(os.path.join(d, f), "rb").read() for d, _, fs in os.walk(folder) for f in fs}
makers = []
for codec in (None, numcodecs.Zlib(3), numcodecs.GZip(3), numcodecs.Zstd(5), numcodecs.Blosc(cname="lz4", shuffle=2)):
    for order in "CF":
        makers.append(dict(chunks=(8, 10, 11), zarr_format=2, compressors=codec, order=order))
for codecs in (None, [GzipCodec()], [ZstdCodec(checksum=True)], [BloscCodec(cname="zstd")], [ZstdCodec(), Crc32cCodec()]):
    for endian in ("little", "big"):
        makers.append(dict(chunks=(8, 10, 11), compressors=codecs, serializer=BytesCodec(endian=endian),
                           chunk_key_encoding={"name": "default", "separator": "/." [endian == "big"]}))
makers.append(dict(chunks=(8, 10, 11), filters=[TransposeCodec(order=(2, 0, 1))]))
for where in ("start", "end"):
    for codecs in ([BytesCodec()], [TransposeCodec(order=(1, 2, 0)), BytesCodec(endian="big"), ZstdCodec()]):
        makers.append(dict(chunks=(16, 20, 22), compressors=None, serializer=ShardingCodec(chunk_shape=(4, 5, 11), codecs=codecs, index_location=where)))
for n, how in enumerate(makers):
    name = f"r{n}.zarr"
    z = zarr.create_array(name, shape=whole.shape, dtype="i2", fill_value=7, **how)
    z[...] = whole
    z.attrs["note"] = "kept"
    shutil.copytree(name, "old.zarr")
    met = None
    for memory in ("1GiB", "40k", "16k"):  # by layers of files, by slices, by rows
        shutil.rmtree(name); shutil.copytree("old.zarr", name)
        run = put(name, "--at", "20,3,8", "--force", "--memory", memory)
        assert run.returncode == 0, (how, run.stderr)
        z = zarr.open(name, mode="r")
        assert np.array_equal(z[...], want), (how, memory)
        assert z.attrs["note"] == "kept"
        assert voxels(name) == want.tobytes(), (how, memory)
        old, new = files("old.zarr"), files(name)
        changed = {f for f in old if old[f] != new[f]}
        assert old.keys() == new.keys() and not any("zarr" in f or f.startswith(".z") for f in changed), changed
        file = how["chunks"]
        assert len(changed) == np.prod([(b - 1) // c - a // c + 1 for (a, b), c in zip(((8, 17), (3, 14), (20, 33)), file)]), (how, changed)
    shutil.rmtree("old.zarr")
# Chunks that were not there hold the fill value besides; so do those of shards.
for how in (dict(chunks=(8, 10, 11)), dict(chunks=(4, 5, 11), shards=(16, 20, 22)), dict(chunks=(8, 10, 11), zarr_format=2)):
    zarr.create_array("empty.zarr", shape=whole.shape, dtype="i2", fill_value=7, overwrite=True, **how)
    w = np.full_like(whole, 7); w[12:21, 21:32, 30:43] = part
    assert put("empty.zarr", "--at", "30,21,12", "--force").returncode == 0
    assert np.array_equal(zarr.open("empty.zarr", mode="r")[...], w) and voxels("empty.zarr") == w.tobytes()
# One volume of several, several at once, in chunks of several volumes; an array in a group.
for shape, chunks, number, source in (((4, 21, 32, 43), (3, 8, 10, 11), 1, part), ((2, 3, 21, 32, 43), (1, 2, 8, 40, 50), 3, np.stack([part, part + 1]))):
    z = zarr.create_array("g.zarr/a", shape=shape, dtype="i2", chunks=chunks, overwrite=True)
    z[...] = rng.integers(-999, 999, shape)
    zarr.open_group("g.zarr", mode="a").create_array("b", shape=(2, 2), dtype="i2", overwrite=True)[...] = 5
    w = put_into(z[...].reshape(-1, 21, 32, 43), source, number, "g.zarr:/a")
    assert np.array_equal(zarr.open("g.zarr/a", mode="r")[...].reshape(w.shape), w)
END
    for version in 2 3; do
        vkt make ramp --dims 30 20 10 --dtype uint8 | vkt set --spacing 2,2,3 | vkt write ours$version.zarr --chunk 8 --zarr-version $version
        vkt crop ours$version.zarr --roi 5:10,4:9,3:6 | vkt flip x | vkt write ours$version.zarr --at 5,4,3 --force
        vkt info ours$version.zarr | grep -q '^spacing *2 2 3$'
        vkt history ours$version.zarr --as-shell >again.sh
        grep -q -- 'vkt copy - <(.*) --at 5 4 3$' again.sh
        bash again.sh | vkt diff - ours$version.zarr
    done
    [ -z "$(find . -name '.*vkt-*')" ]
}

@test "a region of an array that cannot be written is refused, and one that is cut short changes nothing" {
    with_peer zarr
    /usr/bin/python3 - <<'END'
from common import *
import zarr, numcodecs
data = np.arange(120, dtype="u1").reshape(4, 5, 6)
for name, how in {"d": {}, "float": dict(dtype="f4"), "mask": dict(dtype="bool"), "lz4": dict(zarr_format=2, compressors=numcodecs.LZ4()),
                  "delta": dict(zarr_format=2, filters=numcodecs.Delta("u1"))}.items():
    zarr.create_array(name + ".zarr", shape=data.shape, chunks=(2, 5, 6), **(dict(dtype="u1") | how))[...] = data
zarr.open("float.zarr").attrs["scale_factor"] = 2.0
g = zarr.open_group("g.zarr", mode="w")
for name in "ab": g.create_array(name, shape=data.shape, dtype="u1")[...] = data
np.save("part.npy", data[:2, :2, :2] + np.uint8(9)); np.save("float.npy", np.zeros((2, 2, 2), "f4"))
END
    vkt make ramp --dims 100 20 10 --dtype uint8 | vkt write pyramid.zarr --pyramid
    vkt make ramp --dims 8 8 8 --dtype uint8 -o zip.zarr.zip
    find . -path '*.zarr*' -type f -exec sha256sum {} + >sums
    refused_and_foretold 4 'is changed only with --force' vkt write part.npy d.zarr --at 0,0,0
    refused_and_foretold 4 'no such store to write into' vkt write part.npy new.zarr --at 0,0,0 --force
    refused_and_foretold 2 'is no directory' vkt write part.npy zip.zarr.zip --at 0,0,0 --force
    refused_and_foretold 2 'holds several arrays' vkt write part.npy g.zarr --at 0,0,0 --force
    refused_and_foretold 2 "levels of an image, which would not show the same" vkt write part.npy pyramid.zarr --at 0,0,0 --force
    refused_and_foretold 2 "levels of an image, which would not show the same" vkt write part.npy pyramid.zarr:/1 --at 0,0,0 --force
    refused_and_foretold 2 'does not lie' vkt write part.npy d.zarr --at 5,0,0 --force
    refused_and_foretold 2 'does not lie' vkt write part.npy d.zarr --at -1,0,0 --force
    refused_and_foretold 2 'has 1 volume, and none of number 1' vkt write part.npy d.zarr --at 0,0,0 --index 1 --force
    refused_and_foretold 2 'vkt convert --dtype float32' vkt write part.npy float.zarr --at 0,0,0 --force
    refused_and_foretold 2 'holds values as 2' vkt write float.npy float.zarr --at 0,0,0 --force
    refused_and_foretold 2 'holds booleans' vkt write part.npy mask.zarr --at 0,0,0 --force
    refused_and_foretold 2 'which is read and not written' vkt write part.npy lz4.zarr --at 0,0,0 --force
    refused_and_foretold 2 'encoded by filters' vkt write part.npy delta.zarr --at 0,0,0 --force
    for option in --compress --pyramid '--chunk 8' '--codec zstd' '--zarr-version 3' '--zarr-version 3 --shard 8'; do
        # shellcheck disable=SC2086 # options and their values
        refused_and_foretold 2 'leave out --' vkt write part.npy d.zarr --at 0,0,0 --force $option
    done
    # Voxels that end early, and a writer that is killed while it waits for more, with chunks of it made.
    vkt make ramp --dims 6 5 4 --dtype uint8 -o part.vkt
    head -c -60 part.vkt >cut.vkt
    fails_with 3 'ended early' vkt write cut.vkt d.zarr --at 0,0,0 --force
    sha256sum --quiet -c sums
    mkfifo never
    vkt write never d.zarr --at 0,0,0 --force 3>&- &
    writer=$!
    exec 9>never
    head -c -30 part.vkt >&9
    for _ in $(seq 250); do [ -n "$(find d.zarr -path '*vkt-*' -type f)" ] && break; sleep 0.02; done
    kill -9 $writer
    exec 9>&-
    wait $writer || true
    for _ in $(seq 250); do [ -z "$(find d.zarr -name '.*vkt-*')" ] && break; sleep 0.02; done
    [ -z "$(find . -name '.*vkt-*')" ]
    sha256sum --quiet -c sums
    # A chunk that is damaged is not covered up by a part of it; by all of it, it is.
    printf x >>d.zarr/c/0/0/0
    fails_with 3 'damaged' vkt write part.npy d.zarr --at 0,0,0 --force
    vkt write part.vkt d.zarr --at 0,0,0 --force
    vkt diff d.zarr part.vkt
}
