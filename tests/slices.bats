# Slices in pictures and TIFF files as volumes, and volumes as slices; pictures made byte by byte, and tifffile.
load helper

setup_more() {
    python_with numpy
    for type in uint8 uint16; do vkt make noise --dims 9 7 5 --dtype $type --seed 2 -o $type.nrrd; done
}

raw() { vkt write "${1:--}" - --format raw; }

@test "a volume as numbered pictures is one again: by name, folder, pattern and stack" {
    mkdir a
    for type in uint8 uint16; do
        rm -f a/*
        vkt write $type.nrrd 'a/slice%04d.png'
        [ "$(echo a/*)" = "a/slice0000.png a/slice0001.png a/slice0002.png a/slice0003.png a/slice0004.png" ]
        vkt read 'a/slice%04d.png' | vkt diff - $type.nrrd
        vkt read a | vkt diff - $type.nrrd
        vkt read a/ --roi 1:4,2:,3: | vkt diff - <(vkt crop $type.nrrd --roi 1:4,2:,3:)
        vkt stack 'a/*.png' | vkt diff - $type.nrrd
        [ "$(vkt read 'a/*.png' | vkt info | grep -c '^dims       9 7 1$')" -eq 5 ]
        vkt stats a --json | tr -d ' \n' | grep -q '"count":315,'
    done
    vkt flip z uint16.nrrd -o 'f%d.png' --slab 2
    vkt stack f4.png f3.png f2.png f1.png f0.png | vkt diff - uint16.nrrd
    vkt read a --spacing 0.5,0.5,2 | vkt info | grep -qx 'spacing    0.5 0.5 2'
    vkt read 'a/slice%04d.png' | vkt history --as-shell | grep -q 'vkt read a/slice%04d.png'
    # Numbers without leading zeros, from any number on, with gaps, and others beside them.
    mkdir b
    for i in 8 9 10 12; do vkt slice uint8.nrrd --z $((i % 5)) -o b/s$i.png; done
    touch b/notes.txt b/s.png.bak
    vkt read 'b/s%d.png' | raw | cmp - <(for i in 3 4 0 2; do vkt slice uint8.nrrd --z $i | raw; done)
    fails_with 4 "no file matches 'b/t%d.png'" vkt read 'b/t%d.png'
    vkt slice uint8.nrrd --z 0 -o b/other.tif 2>err || { grep -q 'without it' err && skip 'built without libtiff'; cat err >&2; false; }
    fails_with 3 'holds files .' vkt read b
}

@test "TIFF slices are a volume" {
    python_with tifffile
    mkdir t
    vkt split uint16.nrrd -o 't/s%02d.tif' 2>err || { grep -q 'without it' err && skip 'built without libtiff'; cat err >&2; false; }
    vkt read t | vkt diff - uint16.nrrd
    vkt read 't/s%02d.tif' | vkt diff - uint16.nrrd
    /usr/bin/python3 -c "
import numpy as np, tifffile
for k in range(4): tifffile.imwrite(f't/s{k:02}.tif', np.full((6, 8), k, 'f4'))
import os; os.remove('t/s04.tif')"
    vkt read t | raw | cmp - <(/usr/bin/python3 -c "
import numpy as np, sys
sys.stdout.buffer.write(np.repeat(np.arange(4, dtype='f4'), 48).tobytes())")
}

@test "grey pictures of others: depths, colours that are grey, interlaced" {
    /usr/bin/python3 - <<'END'
import struct, subprocess, zlib
import numpy as np
def png(name, rows, color, depth, palette=b"", interlaced=0, width=8):
    def chunk(kind, data): return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    body = b"".join(b"\0" + r for r in rows)
    open(name, "wb").write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, 5, depth, color, 0, 0, interlaced)) +
        (chunk(b"PLTE", palette) if palette else b"") + chunk(b"IDAT", zlib.compress(body)) + chunk(b"IEND", b""))
def voxels(name): return subprocess.check_output(["vkt", "write", name, "-", "--format", "raw"])
rng = np.random.default_rng(1)
g = rng.integers(0, 256, (5, 8), dtype="u1")
png("g8.png", [r.tobytes() for r in g], 0, 8)
assert voxels("g8.png") == g.tobytes()
passes = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)] # of Adam M. Costello
png("i8.png", [r.tobytes() for x, y, dx, dy in passes for r in g[y::dy, x::dx] if len(r)], 0, 8, interlaced=1)
assert voxels("i8.png") == g.tobytes()
w = rng.integers(0, 65536, (5, 8)).astype(">u2")
png("g16.png", [r.tobytes() for r in w], 0, 16)
assert voxels("g16.png") == w.astype("<u2").tobytes()
bits = rng.integers(0, 2, (5, 8), dtype="u1")
png("g1.png", [np.packbits(r).tobytes() for r in bits], 0, 1)
assert voxels("g1.png") == bits.tobytes()
png("rgb.png", [np.repeat(r, 3).tobytes() for r in g], 2, 8)
assert voxels("rgb.png") == g.tobytes()
png("rgba.png", [np.stack([r, r, r, np.full_like(r, 255)], 1).tobytes() for r in g], 6, 8)
assert voxels("rgba.png") == g.tobytes()
png("ga.png", [np.stack([r, np.full_like(r, 255)], 1).tobytes() for r in g], 4, 8)
assert voxels("ga.png") == g.tobytes()
png("palette.png", [r.tobytes() for r in g % 4], 3, 8, palette=bytes([9, 9, 9, 8, 8, 8, 7, 7, 7, 6, 6, 6]))
assert voxels("palette.png") == (9 - g % 4).astype("u1").tobytes()
color = np.repeat(g, 3, axis=1); color[3, 4] ^= 1
png("color.png", [r.tobytes() for r in color], 2, 8)
png("glass.png", [np.stack([r, r], 1).tobytes() for r in g], 4, 8)
good = open("g16.png", "rb").read()
open("short.png", "wb").write(good[:-20])
open("crc.png", "wb").write(good[:45] + bytes([good[45] ^ 1]) + good[46:])
head = struct.pack(">IIBBBBB", 999999, 999999, 16, 0, 0, 0, 1)
open("huge.png", "wb").write(good[:16] + head + struct.pack(">I", zlib.crc32(b"IHDR" + head)) + good[33:])
END
    fails_with 3 'has colours' vkt stats color.png
    fails_with 3 'transparent' vkt stats glass.png
    for name in short crc; do fails_with 3 "'$name.png'" vkt stats $name.png; done
    fails_with 5 'interlaced' vkt stats huge.png
}

@test "other types, and what does not fit, are refused; what is whole stays" {
    vkt make ramp --dims 9 7 5 -o ramp.nrrd
    fails_with 2 'holds uint8 or uint16' vkt write ramp.nrrd 'r%d.png'
    fails_with 2 'slice%04d.png' vkt write uint8.nrrd one.png
    fails_with 2 'hierarchical volumes have no slices' eval 'vkt make amr --blocks 9 --levels 2 | vkt write "h%d.png"'
    [ ! -e r0.png ]
    [ ! -e one.png ]
    [ ! -e h0.png ]
    vkt stack uint8.nrrd uint8.nrrd | vkt write 's%d.png'
    [ "$(ls s*.png | wc -l)" -eq 10 ]
    fails_with 4 'the file exists' vkt write uint8.nrrd 's%d.png'
    mkdir empty
    fails_with 4 'it is a directory, and holds neither DICOM files nor slices' vkt info empty
}

@test "a number that is missing among the slices of a folder is said, and names that differ" {
    mkdir g h
    vkt make noise --dims 5 4 6 --dtype uint8 -q | vkt write - g/s%d.png
    run --separate-stderr vkt info g
    [[ "$stderr" != *missing* ]]
    cp g/s0.png h/a_1_488nm.png
    cp g/s1.png h/a_2_488nm.png
    run --separate-stderr vkt info h
    [[ "$stderr" != *follows* ]]
    cp g/s1.png h/b_1_488nm.png
    run --separate-stderr vkt convert h -o h.nrrd
    [ "$status" -eq 0 ]
    [[ "$stderr" == *"'h': files of several names make one volume: b_1_488nm.png follows a_2_488nm.png"* ]]
    rm g/s3.png
    run --separate-stderr vkt info g
    [[ "$stderr" == *"'g': a slice may be missing: s4.png follows s2.png"* ]]
    run --separate-stderr vkt info g/s%d.png
    [[ "$stderr" == *"a slice may be missing"* ]]
}
