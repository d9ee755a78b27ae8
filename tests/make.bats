# vkt make: fields that can be computed elsewhere, the same for every cut and machine.
load helper

raw() { vkt write - --format raw; }
check() {
    python_with numpy
    /usr/bin/python3 -c "import numpy as np, json
def raw(n, t, d): return np.fromfile(n, t).reshape(d)
$1"
}

@test "noise is Philox4x32-10: the published known answers" {
    check 'print()' # needs numpy
    vkt make noise --dims 4 1 1 --dtype uint32 | raw >zero
    check 'assert [hex(x) for x in np.fromfile("zero", "u4")] == ["0x6627e8d5", "0xe169c58d", "0xbc57ac4c", "0x9b00dbd8"]'
}

@test "noise has the moments of its distribution and other seeds other values" {
    vkt make noise --dims 64 64 64 --low -1 --high 3 | vkt stats --json >f
    vkt make noise --dims 64 64 64 --dtype uint8 --low 10 --high 13 | raw >u
    vkt make noise --dims 64 64 64 --dtype uint8 --low 10 --high 13 --seed 1 | raw >v
    check 's = json.load(open("f")); assert abs(s["mean"] - 1) < .02 and abs(s["variance"] - 16 / 12) < .02 and s["min"] >= -1 and s["max"] <= 3
n = np.bincount(np.fromfile("u", "u1")); assert len(n) == 14 and n[:10].sum() == 0 and abs(n[10:] / 65536 - 1).max() < .02, n
assert abs((np.fromfile("u", "u1") == np.fromfile("v", "u1")).mean() - .25) < .01'
}

@test "ramp, checkerboard, constant" {
    vkt make ramp --dims 5 4 3 --axis y --from 10 --to 40 --dtype int16 | raw >ramp
    vkt make checkerboard --dims 7 5 4 --period 2 --dtype uint8 --high 9 | raw >board
    vkt make constant --dims 3 2 2 --dtype int8 --value -7 | raw >constant
    check 'assert (raw("ramp", "i2", (3, 4, 5)) == np.array([10, 20, 30, 40])[None, :, None]).all()
z, y, x = np.indices((4, 5, 7)) // 2; assert (raw("board", "u1", (4, 5, 7)) == 9 * ((x + y + z) % 2)).all()
assert (np.fromfile("constant", "i1") == -7).all()'
}

@test "the Marschner-Lobb signal" {
    vkt make marschner-lobb --dims 20 22 24 --dtype float64 | raw >ml
    check 'z, y, x = ((2 * np.arange(n) + 1 - n) / n for n in (24, 22, 20)); z, y, x = np.meshgrid(z, y, x, indexing="ij")
r = np.cos(2 * np.pi * 6 * np.cos(np.pi * np.hypot(x, y) / 2))
assert abs(raw("ml", "f8", (24, 22, 20)) - (1 - np.sin(np.pi * z / 2) + .25 * (1 + r)) / 2.5).max() < 1e-13'
}

@test "spheres: volume, centre, distance" {
    vkt make sphere --dims 40 30 32 --center 20.3,14.1,15.7 --radius 12.25 --edge coverage --dtype float64 | raw >soft
    vkt make sphere --dims 40 30 32 --center 20.3,14.1,15.7 --radius 12.25 --dtype uint8 | raw >hard
    vkt make sphere --dims 40 30 32 --center 20.3,14.1,15.7 --radius 12.25 --edge distance --dtype float64 | raw >far
    vkt make sphere --dims 3 3 3 --radius 0.4 --edge coverage --dtype float64 | raw >small
    check 'c = raw("soft", "f8", (32, 30, 40)); z, y, x = np.indices(c.shape); v = 4 / 3 * np.pi * 12.25**3
assert abs(c.sum() / v - 1) < 1e-8, c.sum() / v
for a, p in ((x, 20.3), (y, 14.1), (z, 15.7)): assert abs((a * c).sum() / v - p) < 2e-3
d = np.sqrt((x - 20.3)**2 + (y - 14.1)**2 + (z - 15.7)**2)
assert (raw("hard", "u1", c.shape) == 255 * (d <= 12.25)).all()
assert abs(raw("far", "f8", c.shape) - (d - 12.25)).max() < 1e-12
s = np.fromfile("small", "f8"); assert abs(s[13] / (4 / 3 * np.pi * .064) - 1) < 1e-8 and (s > 0).sum() == 1, s'
}

@test "any cut, any number of threads, any instruction set: the same bytes" {
    for verb in "noise --dtype uint64 --seed 3" "noise --dtype uint8" noise "marschner-lobb" "sphere --edge coverage" "ramp --axis z" "checkerboard --period 3"; do
        vkt make $verb --dims 37 11 13 --slab 13 --threads 1 | vkt write all.raw --force --format raw
        vkt make $verb --dims 37 11 13 --slab 1 --threads 3 | raw | cmp - all.raw
        VKT_INSTRUCTION_SET=baseline vkt make $verb --dims 37 11 13 | raw | cmp - all.raw
    done
}

@test "the header says what was asked for" {
    vkt make constant --dims 2 3 4 --spacing 1,2,3 --origin -1,0,1 | vkt info --json >i
    check 'i = json.load(open("i")); assert i["dims"] == [2, 3, 4] and i["spacing"] == [1, 2, 3] and i["origin"] == [-1, 0, 1] and i["dtype"] == "float32"'
}

@test "constants of every kind, exactly" {
    vkt make constant --dims 2 2 2 --value inf | vkt stats --json | grep -q '"inf": 8,'
    vkt make constant --dims 2 2 2 --value 1e308 --dtype float64 | vkt stats --json | grep -q '"max": 1e+308,'
    for pair in uint64:18446744073709551615 int64:9007199254740993 int64:-9223372036854775808; do
        vkt make constant --dims 2 2 2 --dtype ${pair%:*} --value ${pair#*:} --strict | vkt stats --json | grep -q "\"min\": ${pair#*:},"
    done
    vkt make checkerboard --dims 2 2 2 --dtype uint64 --strict | vkt stats --json | grep -q '"max": 18446744073709551615,'
}

@test "distances that do not fit are counted" {
    vkt make sphere --edge distance --dims 4 4 4 --dtype int8 --radius 1000 -o d.vkt 2>remark
    grep -q '64 of 64 voxels (100.00 %) clipped to \[-128,127\]' remark
    fails_with 3 "clipped" vkt make sphere --edge distance --dims 4 4 4 --dtype int8 --radius 1000 --strict -o e.vkt
    vkt make sphere --edge distance --dims 4 4 4 --dtype int16 --radius 1000 --strict -o e.vkt
}

@test "requests that make no sense" {
    fails_with 2 "infinite or too far apart" vkt make ramp --dims 4 1 1 --from inf -o x.vkt
    fails_with 2 "infinite or too far apart" vkt make ramp --dims 4 1 1 --dtype float64 --from -1e308 --to 1e308 -o x.vkt
    fails_with 2 "too far apart" vkt make noise --dims 4 1 1 --dtype float64 --low -1e308 --high 1e308 -o x.vkt
    fails_with 2 "for --edge coverage" vkt make sphere --dims 4 4 4 --edge coverage --inside inf -o x.vkt
    fails_with 2 "float16 cannot hold 1e+05" vkt make constant --dims 4 1 1 --dtype float16 --value 100000 -o x.vkt
    fails_with 2 "uint64 cannot hold 18446744073709551616" vkt make constant --dims 4 1 1 --dtype uint64 --value 18446744073709551616 -o x.vkt
    fails_with 2 "float32 cannot hold" vkt make checkerboard --dims 4 1 1 --high 1e39 -o x.vkt
    fails_with 2 "--dims" vkt make ramp -o x.vkt
    fails_with 2 "positive number of voxels" vkt make ramp --dims 0 1 1 -o x.vkt
    fails_with 2 "cannot hold 256" vkt make ramp --dims 257 1 1 --dtype uint8 -o x.vkt
    fails_with 2 "negative inside" vkt make sphere --dims 8 8 8 --dtype uint8 --edge distance -o x.vkt
    fails_with 2 "ascending" vkt make noise --dims 8 8 8 --low 2 --high 1 -o x.vkt
    fails_with 2 "--dims" vkt make ramp --dims 1000000000000 1000000000000 1000000000000 -o x.vkt
}

@test "amr by itself is a tree of several levels" {
    vkt make amr | vkt info --json >i
    check 'i = json.load(open("i")); levels = [l["bricks"] for l in i["level_list"]]
assert len(levels) >= 4 and sum(levels) == i["bricks"] >= 1000 and min(levels) > 1, i
assert i["cells"] == 512 * i["bricks"] < np.prod(i["dims"]) / 10, i'
    # One level more than the blocks fill is all of the finest level.
    vkt make amr --levels 3 2>said | vkt info | grep -qx 'bricks     64 of 1 levels with 32768 cells'
    grep -qx 'vkt make: bricks are on 1 of 3 levels: with --blocks 1000, the coarsest 2 are divided everywhere' said
    vkt make amr --levels 6 -o six.vkt 2>said
    grep -qx 'vkt make: bricks are on 4 of 6 levels: with --blocks 1000, the coarsest 2 are divided everywhere' said
    vkt make amr --field constant --levels 9 --strict -o nine.vkt 2>said
    grep -qx 'vkt make: bricks are on 3 of 9 levels: with --blocks 1000, the coarsest 2 are divided everywhere and the finest 4 are not reached' said
    # All of them, or none in particular, is nothing to tell.
    vkt make amr --blocks 1 --levels 1 -o one.vkt 2>said
    [ ! -s said ]
    vkt make amr -o default.vkt 2>said
    [ ! -s said ]
}
