# vkt brick and vkt merge: cutting and putting together, against NumPy, SciPy and unu; what does not fit is refused.
load helper

setup_more() {
    python_with numpy
    cat >check.py <<'END'
import glob, itertools, json, os, re, shutil, subprocess, sys
import numpy as np
TYPES = "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split()
NRRD = {"uint8": "u1", "uchar": "u1", "int8": "i1", "signed char": "i1", "uint16": "u2", "int16": "i2", "uint32": "u4", "int32": "i4",
        "uint64": "u8", "int64": "i8", "float": "f4", "double": "f8", "float16": "f2", "short": "i2", "ushort": "u2", "int": "i4",
        "uint": "u4", "unsigned short": "u2", "unsigned int": "u4", "longlong": "i8", "ulonglong": "u8", "unsigned char": "u1"}
def vkt(*words, ok=True, **more):
    return subprocess.run(["vkt", *words], check=ok, capture_output=True, **more)
def noise(t, dims, seed=1):
    r = np.random.default_rng(seed)
    v = r.integers(0, 256, dims[::-1] + (8,), dtype=np.uint8).view(f"u{np.dtype(t).itemsize}")[..., 0].copy()
    v = v.view(t)
    return np.where(np.isfinite(v), v, 0).astype(t) if v.dtype.kind == "f" else v
def save(v, name, spacing=(1, 1, 1), origin=(0, 0, 0)):
    z, y, x = v.shape
    file = f"{name}_{x}x{y}x{z}_{v.dtype}.raw"
    v.tofile(file)
    words = ["set", file, "--spacing", ",".join(map(str, spacing)), "--origin", ",".join(map(str, origin)), "--force", "-o"]
    vkt(*words, name + ".vkt")
    if v.dtype != np.float16: vkt(*words, name + ".nrrd") # which has no such type
    return name + ".nrrd"
def nrrd(file):
    """An attached, raw NRRD as its text says, read by nothing of ours: voxels [z, y, x], fields, key/values."""
    head, body = open(file, "rb").read().split(b"\n\n", 1)
    lines = head.decode().split("\n")[1:]
    keys = dict(l.split(":=", 1) for l in lines if ":=" in l)
    fields = dict(l.split(": ", 1) for l in lines if ": " in l and ":=" not in l and not l.startswith("#"))
    assert fields["encoding"] == "raw"
    kind = np.dtype("<" + NRRD[fields["type"]])
    dims = [int(n) for n in fields["sizes"].split()]
    return np.frombuffer(body, kind).reshape(dims[::-1]), fields, keys
def origin(fields):
    return [float(n) for n in re.findall(r"[-+0-9.e]+", fields["space origin"])]
def raw(v):
    return vkt("write", v, "-", "--format", "raw").stdout
def cut(v, place, ghost, pad=None):
    lo = [max(0, a - g) for a, g in zip(place[0], ghost)]
    hi = [min(n, b + g) for n, b, g in zip(v.shape[::-1], place[1], ghost)]
    return v[lo[2]:hi[2], lo[1]:hi[1], lo[0]:hi[0]], lo
END
    export PYTHONPATH="$PWD"
}

py() { /usr/bin/python3 -c "
from check import *
$1"; }

@test "NumPy reads the bricks, finds its own slices in them, and puts them together" {
    py '
for n, (dims, size, ghost) in enumerate([((37, 5, 1), (16, 16, 16), (2, 2, 2)), ((23, 19, 17), (7, 8, 5), (1, 0, 3)), ((6, 5, 4), (1, 1, 1), (0, 0, 0)),
                           ((6, 5, 4), (2, 3, 1), (9, 9, 9)), ((1, 1, 40), (64, 64, 7), (2, 2, 2))]):
    v = noise("int16", dims, n)
    name = save(v, "v", (0.5, 2, 3), (10, -4, 7))
    vkt("brick", name, "--size", ",".join(map(str, size)), "--ghost", ",".join(map(str, ghost)), "-o", f"out {n}")
    m = json.load(open(f"out {n}/bricks.json"))
    assert m["dims"] == list(dims) and m["size"] == list(size) and m["dtype"] == "int16" and m["boundary"] is None
    assert m["ghost"] == {"below": list(ghost), "above": list(ghost)} and m["spacing"] == [0.5, 2, 3] and m["origin"] == [10, -4, 7]
    want = list(itertools.product(*[range(0, d, s) for d, s in zip(dims[::-1], size[::-1])]))
    assert [b["lower"] for b in m["bricks"]] == [list(l[::-1]) for l in want]
    assert sorted(os.listdir(f"out {n}")) == sorted([b["file"] for b in m["bricks"]] + ["bricks.json"])
    again = np.zeros_like(v)
    for b in m["bricks"]:
        got, fields, keys = nrrd(f"out {n}/" + b["file"])
        part, lo = cut(v, (b["lower"], b["upper"]), ghost)
        assert np.array_equal(got, part), b
        assert np.allclose(origin(fields), [10 + .5 * lo[0], -4 + 2 * lo[1], 7 + 3 * lo[2]]), fields
        assert b["ghost_below"] == [a - l for a, l in zip(b["lower"], lo)]
        (x0, y0, z0), (x1, y1, z1), (gx, gy, gz) = b["lower"], b["upper"], b["ghost_below"]
        again[z0:z1, y0:y1, x0:x1] = got[gz:gz + z1 - z0, gy:gy + y1 - y0, gx:gx + x1 - x0]
    assert np.array_equal(again, v)
    vkt("merge", f"out {n}", "-o", "again.nrrd", "--force")
    assert raw("again.nrrd") == v.tobytes()
    assert vkt("diff", name, "again.nrrd", "--geometry").returncode == 0'
}

@test "all types come back bit for bit: files, patterns, streams, pipes within one process" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        py "save(noise('$type', (23, 11, 13)), 'v', (1.5, 1, 2), (3, 4, 5))"
        local format=nrrd
        [ $type != float16 ] || format=vkt
        vkt brick v.vkt --size 8 --ghost 3 -o d --force --format $format
        vkt merge d -o a.vkt --force
        vkt brick v.vkt --size 8 --ghost 3 | vkt merge -o b.vkt --force
        vkt brick - --size 9,4,5 --ghost 1 --boundary mirror <v.vkt | vkt merge -o c.vkt --force
        vkt pipe 'read v.vkt | brick --size 8 | merge - | write e.vkt --force'
        for file in a b c e; do
            vkt write v.vkt - --format raw >want
            vkt write $file.vkt - --format raw | cmp - want
            vkt diff v.vkt $file.vkt --geometry >diff
            vkt info $file.vkt --json >info
            run ! grep -q 'brick-' info
        done
    done
    vkt brick v.nrrd --size 8 --ghost 2 -o 'part %03d.nrrd'
    [ "$(find . -name 'part *.nrrd' | wc -l)" -eq 12 ]
    [ -e 'part 011.nrrd' ]
    vkt merge 'part *.nrrd' | vkt diff v.nrrd --geometry
    # The order of files does not matter.
    ls part*.nrrd | tac | tr '\n' '\0' | xargs -0 vkt merge | vkt diff v.nrrd --geometry
    for other in metaimage:mha vkt:vkt; do
        vkt brick v.nrrd --size 8 -o f --format ${other%:*} --force
        [ -e f/brick_011.${other#*:} ]
        vkt merge f | vkt diff v.nrrd --geometry
    done
    vkt brick v.nrrd --size 8 --ghost 1 -o g --compress --force
    vkt merge g | vkt diff v.nrrd --geometry
    vkt merge g/bricks.json | vkt flip z | vkt flip z | vkt diff v.nrrd
    vkt crop v.nrrd --roi 2:20,3:9,1:11 -o part.nrrd
    vkt merge g | vkt crop --roi 2:20,3:9,1:11 | vkt diff part.nrrd
    # Value maps and what else the header says stay.
    vkt set v.nrrd --slope 2 --intercept -5 --units HU --attribute patient=nobody -o s.nrrd
    vkt brick s.nrrd --size 8 | vkt merge -o t.nrrd
    vkt info s.nrrd --json | grep -v history >a.json
    vkt info t.nrrd --json | grep -v history >b.json
    grep -q '"slope": 2' b.json
    grep -q nobody b.json
    grep -q HU b.json
    # Several volumes, one after the other.
    cp part.nrrd s0.nrrd
    vkt flip x v.nrrd -o s1.nrrd
    vkt read 's?.nrrd' | vkt brick --size 5 --ghost 1 | vkt merge -o 'm%d.nrrd'
    vkt diff s0.nrrd m0.nrrd --geometry
    vkt diff s1.nrrd m1.nrrd --geometry
    # A stream of bricks in a file.
    vkt brick part.nrrd --size 5 >bricks.vkt
    vkt merge bricks.vkt | vkt diff part.nrrd
}

@test "ghosts outside of the volume are what NumPy's pad says" {
    py '
v = noise("uint8", (9, 7, 5))
save(v, "v")
for rule, mode in ("clamp", "edge"), ("mirror", "symmetric"), ("wrap", "wrap"), ("border:9", "constant"):
    padded = np.pad(v, ((3, 3), (1, 1), (2, 2)), mode, **({"constant_values": 9} if mode == "constant" else {}))
    for source in "file", "pipe":
        words = ["--size", "4", "--ghost", "2,1,3", "--boundary", rule, "-o", "d", "--force"]
        if source == "file": vkt("brick", "v.nrrd", *words)
        else: vkt("brick", *words, input=vkt("read", "v.nrrd").stdout)
        for b in json.load(open("d/bricks.json"))["bricks"]:
            got, fields, keys = nrrd("d/" + b["file"])
            (x0, y0, z0), (x1, y1, z1) = b["lower"], b["upper"]
            assert np.array_equal(got, padded[z0:z1 + 6, y0:y1 + 2, x0:x1 + 4]), (rule, source, b)
            assert np.allclose(origin(fields), [x0 - 2, y0 - 1, z0 - 3])
        vkt("merge", "d", "-o", "m.nrrd", "--force")
        assert raw("m.nrrd") == v.tobytes()'
}

@test "a filter brick by brick is the filter of the whole: bit for bit with ghosts as wide as it reaches" {
    py "save(noise('uint16', (45, 38, 29)), 'v', (1, 1, 2))"
    # The filter's border is the volume's in the outer bricks, and the ghosts are dropped with what theirs spoils.
    vkt brick v.nrrd --size 16 --ghost 8 | vkt filter gaussian --sigma 1 | vkt merge -o bricks.nrrd
    vkt filter gaussian v.nrrd --sigma 1 -o whole.nrrd
    vkt diff whole.nrrd bricks.nrrd --geometry
    vkt filter median v.nrrd --radius 2 -o median.nrrd
    vkt brick v.nrrd --size 10,11,12 --ghost 2 -o in
    mkdir out
    for brick in in/*.nrrd; do vkt filter median "$brick" --radius 2 -o "out/${brick#in/}"; done
    vkt merge out | vkt diff median.nrrd --geometry
    cp in/bricks.json out
    vkt merge out | vkt diff median.nrrd
    # With too few ghosts it is not.
    run -1 bash -c 'vkt brick v.nrrd --size 10,11,12 --ghost 1 | vkt filter median --radius 2 | vkt merge | vkt diff median.nrrd'
    # SciPy does the same to the bricks, which it reads by the manifest alone.
    python_with scipy
    py '
from scipy import ndimage
whole = ndimage.median_filter(nrrd("v.nrrd")[0], 5, mode="reflect")
m = json.load(open("in/bricks.json"))
again = np.zeros_like(whole)
for b in m["bricks"]:
    v = ndimage.median_filter(nrrd("in/" + b["file"])[0], 5, mode="reflect")
    (x0, y0, z0), (x1, y1, z1), (gx, gy, gz) = b["lower"], b["upper"], b["ghost_below"]
    again[z0:z1, y0:y1, x0:x1] = v[gz:gz + z1 - z0, gy:gy + y1 - y0, gx:gx + x1 - x0]
assert np.array_equal(again, whole)
assert raw("median.nrrd") == whole.tobytes()'
}

@test "bricks that lead out of the directory, or are no files, are refused unless they are trusted" {
    vkt make noise --dims 9 8 7 -o v.nrrd
    vkt brick v.nrrd --size 5 -o d
    for manifest in yes no; do
        [ $manifest = yes ] || rm d/bricks.json
        mv d/brick_000.nrrd kept.nrrd
        mkfifo d/brick_000.nrrd
        fails_with 3 "'brick_000.nrrd', which is no regular file" timeout 20 vkt merge d -o m.nrrd
        rm d/brick_000.nrrd
        ln -s ../kept.nrrd d/brick_000.nrrd
        fails_with 3 "'brick_000.nrrd', which leads out of its directory" vkt merge d -o m.nrrd
        [[ "$stderr" == *--trust-paths* ]]
        vkt merge d --trust-paths | vkt diff v.nrrd
        mv kept.nrrd d/brick_000.nrrd
        vkt merge d | vkt diff v.nrrd
    done
    mkfifo d/bricks.json
    fails_with 3 "'bricks.json', which is no regular file" timeout 20 vkt merge d -o m.nrrd
}

@test "unu reads the bricks" {
    local unu=teem-unu
    command -v $unu >/dev/null || unu=unu
    command -v $unu >/dev/null || skip "unu (teem) is not installed"
    py "save(noise('uint16', (20, 10, 12)), 'v')"
    vkt brick v.nrrd --size 10 -o d
    $unu crop -i v.nrrd -min 10 0 0 -max 19 9 9 | $unu save -f nrrd -o want.nrrd
    vkt diff want.nrrd d/brick_001.nrrd
    $unu join -i d/brick_000.nrrd d/brick_001.nrrd -a 0 | $unu crop -min 0 0 0 -max M M 9 | $unu save -f nrrd -o joined.nrrd
    vkt crop v.nrrd --roi :,:,0:10 | vkt diff joined.nrrd
}

@test "what does not fit is refused, with the name of the brick" {
    py "save(noise('uint8', (12, 12, 12), 1), 'v'); save(noise('uint8', (12, 12, 12), 2), 'w', (1, 1, 1), (50, 0, 0))"
    fresh() { rm -rf d && vkt brick v.nrrd --size 6 --ghost 1 -o d; }
    fresh
    rm d/brick_003.nrrd
    fails_with 3 "'d/brick_003.nrrd' is missing" vkt merge d -o x.nrrd
    rm d/bricks.json
    fails_with 3 "a brick is missing before 'd/brick_004.nrrd'" vkt merge d -o x.nrrd
    fresh
    truncate -s -5 d/brick_007.nrrd
    fails_with 3 "brick_007.nrrd" vkt merge d -o x.nrrd
    fresh
    vkt convert d/brick_002.nrrd --dtype int16 -o d/brick_002.nrrd --force
    fails_with 3 "'d/brick_002.nrrd' is no brick of this volume: its type is int16" vkt merge d -o x.nrrd
    fresh
    vkt set d/brick_002.nrrd --spacing 2,1,1 -o d/brick_002.nrrd --force
    fails_with 3 "'d/brick_002.nrrd' does not lie where its brick belongs" vkt merge d -o x.nrrd
    fresh
    vkt flip x d/brick_002.nrrd -o d/brick_002.nrrd --force
    fails_with 3 "'d/brick_002.nrrd' does not lie where its brick belongs" vkt merge d -o x.nrrd
    fresh
    vkt crop d/brick_002.nrrd --roi 1:,:,: -o d/brick_002.nrrd --force
    fails_with 3 "brick_002.nrrd': it has 6 7 7 voxels, its place 7 7 7" vkt merge d -o x.nrrd
    fresh
    cp d/brick_001.nrrd d/brick_002.nrrd
    fails_with 3 "'d/brick_002.nrrd' is a foreign brick: it holds the voxels 6:12,0:6,0:6" vkt merge d -o x.nrrd
    fresh
    cp d/brick_001.nrrd d/more.nrrd
    fails_with 3 "'d/more.nrrd' is a foreign brick: bricks.json does not list it" vkt merge d -o x.nrrd
    rm d/bricks.json
    fails_with 3 "overlap" vkt merge d -o x.nrrd
    fresh
    vkt brick w.nrrd --size 6 --ghost 1 -o e
    cp e/brick_004.nrrd d/
    fails_with 3 "'d/brick_004.nrrd' does not lie where its brick belongs" vkt merge d -o x.nrrd
    fresh
    cp v.nrrd d/brick_000.nrrd
    fails_with 3 "'d/brick_000.nrrd' has 12 12 12 voxels" vkt merge d -o x.nrrd
    fails_with 3 "v.nrrd, brick 1' is no brick: it does not say where it belongs" vkt merge v.nrrd -o x.nrrd
    printf '{"format": "vkt bricks 1", "dims": [1,2]}' >bad.json
    fails_with 3 "'bad.json' is no manifest of bricks" vkt merge bad.json -o x.nrrd
    mkdir empty
    fails_with 3 "holds no bricks" vkt merge empty -o x.nrrd
    # Streams.
    vkt brick v.nrrd --size 6 --ghost 1 -o 'p%d.nrrd'
    vkt read 'p?.nrrd' >whole.vkt
    vkt merge whole.vkt | vkt diff v.nrrd
    vkt read 'p[0-6].nrrd' >short.vkt
    fails_with 3 "a brick is missing" vkt merge short.vkt -o x.nrrd
    vkt read 'p[013-7].nrrd' >gap.vkt
    fails_with 3 "gap.vkt, brick 3' holds the voxels" vkt merge gap.vkt -o x.nrrd
    vkt read 'p[1-7].nrrd' >late.vkt
    fails_with 3 "late.vkt, brick 1' holds the voxels" vkt merge late.vkt -o x.nrrd
    head -c 2000 whole.vkt >cut.vkt
    fails_with 3 "ended early" vkt merge cut.vkt -o x.nrrd
    # Nothing was left of any of these.
    [ ! -e x.nrrd ]
    [ -z "$(find . -name '.*.vkt-*')" ]
}

@test "a directory appears whole or not at all, and only what brick wrote is replaced" {
    py "save(noise('uint8', (30, 20, 12), 1), 'v')"
    vkt brick v.nrrd --size 8 -o 'a b/' 2>/dev/null
    vkt merge 'a b' | vkt diff v.nrrd
    fails_with 4 "the directory exists" vkt brick v.nrrd --size 9 -o 'a b'
    vkt brick v.nrrd --size 9 -o 'a b' --force
    vkt merge 'a b' | vkt diff v.nrrd
    touch 'a b/notes.txt'
    fails_with 4 "it holds files that are no bricks" vkt brick v.nrrd --size 9 -o 'a b' --force
    [ -e 'a b/notes.txt' ]
    [ -e 'a b/brick_000.nrrd' ]
    mkdir empty
    vkt brick v.nrrd --size 9 -o empty
    vkt merge empty | vkt diff v.nrrd
    ln -s empty link
    vkt brick v.nrrd --size 10 -o link --force
    [ -L link ]
    vkt merge empty | vkt diff v.nrrd
    fails_with 4 "make the directory 'no/where' first" vkt brick v.nrrd --size 9 -o no/where/bricks
    touch plain
    fails_with 4 "it is no directory" vkt brick v.nrrd --size 9 -o plain --force
    fails_with 2 "lies in the directory that would be replaced" vkt brick empty/brick_000.nrrd -o empty --force
    # An upstream that fails, and one that is cut off.
    head -c 3000 <(vkt read v.nrrd) >cut.vkt
    fails_with 3 "ended early" vkt brick cut.vkt --size 4 -o none
    [ ! -e none ]
    [ -z "$(find . -name '.*vkt-*')" ]
    # Killed in the middle, by whatever signal.
    for signal in KILL TERM; do
        mkfifo pipe
        vkt brick pipe --size 2 -o none &
        writer=$!
        exec 7>pipe
        head -c 4500 v.nrrd >&7
        for _ in $(seq 100); do [ -z "$(find . -path './.none*brick_*')" ] || break; sleep 0.05; done
        [ -n "$(find . -path './.none*brick_*')" ]
        kill -$signal $writer
        wait $writer || true
        exec 7>&-
        for _ in $(seq 100); do [ -n "$(find . -name '.none*')" ] || break; sleep 0.05; done
        [ ! -e none ]
        [ -z "$(find . -name '.none*')" ]
        rm pipe
    done
}

@test "options, streams in little memory, history" {
    py "save(noise('float32', (64, 60, 50), 1), 'v')"
    fails_with 2 "is not N or X,Y,Z" vkt brick v.nrrd --size 3,4 -o d
    fails_with 2 "is not a number of voxels" vkt brick v.nrrd --size 0 -o d
    fails_with 2 "" vkt brick v.nrrd --ghost -1 -o d
    fails_with 2 "is no number's place" vkt brick v.nrrd -o 'd%x.nrrd'
    fails_with 2 "name it like out_%04d.nrrd" vkt brick v.nrrd --size 32 -o d.nrrd
    fails_with 2 "hierarchical" bash -c 'vkt make amr --blocks 20 --levels 2 | vkt brick --size 4 -o d'
    # A stream beyond the budget is spooled, with the same result.
    vkt read v.nrrd | vkt brick --size 20 --ghost 2 -o small --memory 100k -q
    vkt brick v.nrrd --size 20 --ghost 2 -o large
    for brick in large/*.nrrd; do cmp <(tail -c 1000 "$brick") <(tail -c 1000 "small/${brick#large/}"); done
    vkt merge small | vkt diff v.nrrd
    fails_with 5 "needs" bash -c 'vkt brick v.nrrd --size 20 | vkt merge --memory 100k -o x.nrrd'
    vkt merge small --memory 100k | vkt diff v.nrrd
    # What the history tells can be run.
    vkt brick v.nrrd --size 20 --ghost 3 | vkt filter median | vkt merge -o m.nrrd
    vkt history m.nrrd --as-shell >again.sh
    grep -q 'vkt brick' again.sh
    grep -q 'vkt merge' again.sh
    bash -c "$(cat again.sh)" | vkt diff m.nrrd
    # A dry run tells of bricks and moves no voxel.
    vkt brick v.nrrd --size 40 -o n -n 2>plan
    [ "$(grep -c '40x40x40' plan)" -eq 1 ]
    [ "$(wc -l <plan)" -le 2 ]
    grep -q '8 parts, the first 40x40x40' plan
    [ ! -e n ]
    vkt brick v.nrrd --size 40 -n 2>/dev/null | vkt merge -n 2>plan >/dev/null
    grep -q '64x60x50' plan
}

@test "a closed standard output is an error, whatever is opened first" {
    vkt make noise --dims 8 8 8 -o v.nrrd
    vkt brick v.nrrd --size 4 -o bricks
    vkt stats v.nrrd --mergeable >part
    run -4 bash -c 'vkt merge bricks >&-'
    run -4 bash -c 'vkt merge bricks/*.nrrd >&-'
    run -4 bash -c 'vkt stats --merge part >&-'
    run -4 bash -c 'vkt --version >&-'
    run -4 bash -c 'vkt --version >/dev/full'
}
