# vkt histogram against NumPy and exact rationals, its forms, and partial results.
load helper

setup_more() {
    python_with numpy
    cp "$VKT_ROOT/examples/data/phantom.nrrd" phantom.nrrd
    cat >check.py <<'END'
import csv, json, subprocess, sys
import numpy as np
from fractions import Fraction
def save(v, name):
    v.tofile(f"{name}_{v.shape[2]}x{v.shape[1]}x{v.shape[0]}_{v.dtype}.raw")
def vkt(*words):
    return subprocess.run(["vkt", *words], check=True, capture_output=True, text=True).stdout
def histogram(*words):
    return json.loads(vkt("histogram", *words, "--json"))
def total(h):
    return sum(h["counts"]) + h["nan"] + h["under"] + h["over"]
END
    export PYTHONPATH="$PWD"
}

py() { /usr/bin/python3 -c "
from check import *
$1"; }

@test "all types agree with NumPy, for its own range and a given one" {
    py '
r = np.random.default_rng(2)
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    d = np.dtype(t)
    v = r.normal(40, 30, (7, 11, 13)) if d.kind != "u" else np.abs(r.normal(40, 30, (7, 11, 13)))
    v = np.rint(np.clip(v, -100, 120)) if d.kind != "f" else v
    v = v.astype(d)
    save(v, "v")
    name = f"v_13x11x7_{t}.raw"
    for bins in 1, 7, 64, 1000:
        # whole edges between whole numbers are exact here, and rounded there
        counts, edges = np.histogram(v.astype(float), bins)
        got = histogram(name, "--bins", str(bins))
        assert total(got) == v.size
        assert np.allclose(got["edges"], edges, rtol=1e-12, atol=1e-12), (t, bins)
        if d.kind == "f": assert got["counts"] == counts.tolist(), (t, bins)
        counts, edges = np.histogram(v.astype(float), bins, (3.25, 77.75))
        got = histogram(name, "--bins", str(bins), "--range", "3.25:77.75")
        assert got["counts"] == counts.tolist() and got["edges"] == edges.tolist(), (t, bins)
        assert got["under"] == (v < 3.25).sum() and got["over"] == (v > 77.75).sum()
        assert (got["low"], got["high"]) == (3.25, 77.75)'
}

@test "large volumes, in rows of odd length" {
    py '
r = np.random.default_rng(7)
noise = r.integers(0, 65536, (63, 181, 201), np.uint16)
for v, lo, hi in (noise.astype(np.uint8), 0, 255), (noise.view(np.int16), -3000, 4000), (noise.astype("float32"), 20, 60000):
    save(v, "l")
    h = histogram(f"l_201x181x63_{v.dtype}.raw", "--range", f"{lo}:{hi}", "--threads", "2")
    counts, _ = np.histogram(v, 256, (lo, hi))
    assert h["counts"] == counts.tolist() and h["under"] == (v < lo).sum() and h["over"] == (v > hi).sum(), v.dtype'
}

@test "bins of integers are exact fractions" {
    py '
r = np.random.default_rng(3)
for t, base in ("uint8", 0), ("int16", -3000), ("int32", 2**31 - 5000), ("uint32", 2**32 - 5000), ("int64", 2**62), ("uint64", 2**64 - 5000), ("int64", -2**63):
    v = np.array([base + int(i) for i in r.integers(0, 200 if t == "uint8" else 5000, 900)], dtype=t).reshape(9, 10, 10)
    save(v, "i")
    values = [int(i) for i in v.ravel()]
    lo, hi = min(values), max(values)
    for bins in 1, 3, 49, 100, 997:
        want = [0] * bins
        for i in values: want[min(int(Fraction((i - lo) * bins, hi - lo)), bins - 1)] += 1
        got = histogram(f"i_10x10x9_{t}.raw", "--bins", str(bins))
        assert got["counts"] == want, (t, bins)
        assert (got["low"], got["high"]) == (lo, hi), (got["low"], lo)
    # A given range that cuts on both sides
    a, b = lo + 17, hi - 23
    got = histogram(f"i_10x10x9_{t}.raw", "--bins", "13", "--range", f"{a}:{b}")
    want = [0] * 13
    for i in values:
        if a <= i <= b: want[min(int(Fraction((i - a) * 13, b - a)), 12)] += 1
    assert got["counts"] == want, t
    assert got["under"] == sum(i < a for i in values) and got["over"] == sum(i > b for i in values)'
}

@test "values on edges lie in the bin above, the last edge in the last bin" {
    py '
for bins in list(range(2, 40)) + [64, 100, 128, 255, 256, 333, 400]:
    for lo, hi in (0.0, 1.0), (-0.3, 0.7), (1e-3, 17.0), (-1e6, 1e6 + 0.1):
        edges = lo + np.arange(bins + 1) * ((hi - lo) / bins)
        edges[-1] = hi
        edges.reshape(1, 1, -1).tofile("e.raw")
        got = json.loads(
            vkt("pipe", f"read e.raw --dims {bins + 1} 1 1 --dtype float64 | histogram --bins {bins} --range {lo!r}:{hi!r} --json"))
        assert got["counts"] == [1] * (bins - 1) + [2], (bins, lo, hi)'
}

@test "float32: many voxels on edges, at both ends of the range, beyond it, infinite and NaN" {
    py '
r = np.random.default_rng(8)
for bins in 1, 7, 255, 256, 257, 300:
    for lo, hi in (0.0, 1.0), (-3.3, 77.7), (0.0, 256.0), (0.1, 0.7):
        edges = np.append(lo + np.arange(bins) * ((hi - lo) / bins), hi)
        v = r.uniform(lo - 0.01, hi + 0.01, 30000).astype(np.float32)
        v[:9000] = lo
        v[9000:12000] = hi
        v[12000:20000] = edges[r.integers(0, bins + 1, 8000)]
        v[20000:21000] = np.nextafter(v[19000:20000], np.float32(-1e9))
        v[21000:21300] = np.repeat(np.array([np.nan, np.inf, -np.inf], np.float32), 100)
        if bins % 2 == 0: r.shuffle(v)  # else runs of them
        save(v.reshape(10, 30, 100), "e")
        got = histogram("e_100x30x10_float32.raw", "--bins", str(bins), "--range", f"{lo!r}:{hi!r}")
        inside = v[(v >= lo) & (v <= hi)].astype(float)
        where = np.minimum(np.searchsorted(got["edges"], inside, side="right") - 1, bins - 1)
        assert got["counts"] == np.bincount(where, minlength=bins).tolist(), (bins, lo, hi)
        assert got["nan"] == 100 and got["under"] == (v < lo).sum() and got["over"] == (v > hi).sum()'
}

@test "ranges far from zero, very wide and very narrow" {
    py '
r = np.random.default_rng(4)
for lo, hi in (1e9, 1e9 + 1e-5), (-1.7e308, 1.7e308), (0, 5e-324), (0, 1e-310), (1, 1 + 2**-50), (-3e-320, 1e300):
    u = r.random(500)
    v = lo * (1 - u) + hi * u
    save(np.clip(v, lo, hi).reshape(5, 10, 10), "w")
    for bins in 1, 8, 300:
        got = histogram("w_10x10x5_float64.raw", "--bins", str(bins), "--range", f"{lo!r}:{hi!r}")
        edges = np.array(got["edges"])
        assert (np.diff(edges) >= 0).all() and edges[0] == lo and edges[-1] == hi
        # The last edge not above a value tells its bin.
        where = np.minimum(np.searchsorted(edges, np.clip(v, lo, hi), side="right") - 1, bins - 1)
        assert got["counts"] == np.bincount(where, minlength=bins).tolist(), (lo, hi, bins)'
}

@test "NaN, infinities and what is out of range count apart" {
    for type in float16 float32 float64; do
        py "
v = np.linspace(-10, 10, 1000).astype('$type').reshape(10, 10, 10)
v[0, 0, :4], v[3, 3, :3], v[4, 4, :2] = np.nan, np.inf, -np.inf
save(v, 'n')
h = histogram('n_10x10x10_$type.raw', '--range', '-5:5', '--bins', '10')
ok = v[np.isfinite(v)]
assert h['nan'] == 4 and h['over'] == 3 + (ok > 5).sum() and h['under'] == 2 + (ok < -5).sum()
assert total(h) == 1000
h = histogram('n_10x10x10_$type.raw')
assert (h['low'], h['high']) == (ok.min(), ok.max()) and (h['under'], h['over'], h['nan']) == (2, 3, 4)"
    done
}

@test "a constant volume has a range" {
    for pair in uint8:7 int16:-3 int64:9223372036854775807 uint64:18446744073709551615 float32:0.25 float64:1e300 float64:0; do
        vkt make constant --dims 5 4 3 --dtype float64 --value 0 | vkt convert --dtype "${pair%:*}" |
            vkt fill --value "${pair#*:}" -o c.nrrd --force
        py "h = histogram('c.nrrd', '--bins', '3')
assert h['counts'] == [0, 60, 0], h
assert h['low'] < ${pair#*:} < h['high'] or '$pair'.startswith('uint64')"
    done
}

@test "values are physical, also under a negative slope" {
    for map in "2 5" "-0.25 3"; do
        read -r slope intercept <<<"$map"
        vkt set phantom.nrrd --slope="$slope" --intercept="$intercept" -o m.nrrd --force
        vkt read phantom.nrrd | vkt write - --format raw >p.raw
        py "
v = np.fromfile('p.raw', np.uint8).astype(float) * $slope + $intercept
for options, range in (('minmax', None), ('-20:90.5', (-20, 90.5))):
    counts, edges = np.histogram(v, 50, range)
    h = histogram('m.nrrd', '--bins', '50', '--range', options)
    assert h['counts'] == counts.tolist() and h['edges'] == edges.tolist()"
    done
}

@test "percentiles as ends of the range" {
    py '
r = np.random.default_rng(5)
v = r.normal(0, 1, (20, 30, 40)).astype("float32")
save(v, "g")
h = histogram("g_40x30x20_float32.raw", "--range", "p5:p90", "--bins", "20")
lo, hi = np.percentile(v.astype(float), [5, 90])
assert abs(h["low"] - lo) < 1e-12 and abs(h["high"] - hi) < 1e-12
assert h["counts"] == np.histogram(v.astype(float), 20, (h["low"], h["high"]))[0].tolist()
assert 1199 <= h["under"] <= 1201 and 2399 <= h["over"] <= 2401'
}

@test "a region, slabs, threads, memory, pipes and files" {
    py '
r = np.random.default_rng(6)
save(r.normal(0, 1, (37, 41, 29)).astype("float32"), "s"); save(r.integers(0, 65536, (37, 41, 29), np.uint16), "s")'
    for file in s_29x41x37_float32.raw s_29x41x37_uint16.raw; do
        want=$(vkt histogram $file --roi 3:20,:,5:-4 --bins 100 --csv)
        [ "$(vkt crop $file --roi 3:20,:,5:-4 | vkt histogram --bins 100 --csv)" = "$want" ]
        for how in "--slab 1" "--slab 7" "--threads 1" "--threads 2" "--threads 5" "--memory 4M"; do
            # shellcheck disable=SC2086
            [ "$(vkt read $file | vkt histogram --roi 3:20,:,5:-4 --bins 100 --csv $how)" = "$want" ] || { echo "$file $how" >&2; return 1; }
        done
    done
    # A stream that must be read twice is spooled, and says so.
    vkt make noise --dims 256 256 60 | vkt histogram --memory 8M --json >a.json 2>stderr
    grep -q spooling stderr
    vkt make noise --dims 256 256 60 -o n.nrrd
    vkt histogram n.nrrd --json | cmp - a.json
}

@test "JSON, CSV and table say the same" {
    vkt histogram phantom.nrrd --bins 5 --range 10:60 --csv >a.csv
    vkt histogram phantom.nrrd --bins 5 --range 10:60 >table
    vkt histogram phantom.nrrd --bins 5 --range 10:60 -o b.csv
    cmp a.csv b.csv
    py '
h = histogram("phantom.nrrd", "--bins", "5", "--range", "10:60")
rows = list(csv.reader(open("a.csv")))
assert rows[0] == ["low", "high", "count"]
assert [r.split() for r in open("table")] == rows
assert [float(r[0]) for r in rows[2:-2]] + [float(rows[-3][1])] == h["edges"] == [10, 20, 30, 40, 50, 60]
assert [int(r[2]) for r in rows[1:]] == [h["under"]] + h["counts"] + [h["over"], h["nan"]]
assert rows[1][:2] == ["-inf", "10"] and rows[-2][:2] == ["60", "inf"] and rows[-1][:2] == ["nan", "nan"]
assert h["low"] == 10 and h["high"] == 60'
    vkt read phantom.nrrd >two.vkt
    vkt histogram --json <(vkt pipe 'read phantom.nrrd') | py 'assert json.load(sys.stdin)["nan"] == 0'
}

@test "bars are as long as counts, or their logarithms" {
    py 'save(np.repeat(np.uint8([0, 1, 2, 3]), [1000, 100, 10, 2]).reshape(1, 1, -1), "b")'
    command -v script >/dev/null || skip "script(1) is not installed"
    script -qec 'vkt histogram b_1112x1x1_uint8.raw --bins 4 --range 0:4' /dev/null </dev/null >linear
    vkt histogram b_1112x1x1_uint8.raw --bins 4 --range 0:4 --log >logarithmic
    py '
import math
def bars(name): return [l.count("#") for l in open(name) if "under" not in l]
a, b = bars("linear"), bars("logarithmic")
assert len(a) == len(b) == 4 and max(a) == max(b) > 40
assert a == [math.ceil(a[0] * n / 1000) for n in (1000, 100, 10, 2)], a
assert b == [math.ceil(b[0] * math.log1p(n) / math.log1p(1000)) for n in (1000, 100, 10, 2)], b'
    vkt histogram b_1112x1x1_uint8.raw --bins 1000 --log | py 'assert len(sys.stdin.readlines()) == 33'
}

@test "pictures" {
    vkt histogram phantom.nrrd --bins 64 -o h.png
    vkt histogram phantom.nrrd --bins 64 --log -o h.svg
    py '
import math, struct, zlib
import xml.etree.ElementTree as xml
h = histogram("phantom.nrrd", "--bins", "64")["counts"]
# PNG: 8 bits RGB, no interlace; filters undone by hand.
d = open("h.png", "rb").read()
assert d[:8] == b"\x89PNG\r\n\x1a\n"
w, ht, bits, color = struct.unpack(">IIBB", d[16:26])
assert (w, ht, bits, color) == (640, 360, 8, 2)
at, data = 8, b""
while at < len(d):
    n, kind = struct.unpack(">I4s", d[at:at + 8])
    if kind == b"IDAT": data += d[at + 8:at + 8 + n]
    at += n + 12
rows, old = zlib.decompress(data), np.zeros(w * 3, int)
picture = []
for y in range(ht):
    f, line = rows[y * (w * 3 + 1)], np.frombuffer(rows, np.uint8, w * 3, y * (w * 3 + 1) + 1).astype(int)
    new = line.copy()
    for i in range(w * 3):
        a, b, c = (new[i - 3] if i > 2 else 0), old[i], (old[i - 3] if i > 2 else 0)
        p = a + b - c
        paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        new[i] = (line[i] + (0, a, b, (a + b) // 2, paeth)[f]) % 256
    picture.append(new.reshape(w, 3)); old = new
filled = (np.array(picture)[:, :, 0] < 128).sum(axis=0)
assert filled.tolist() == [math.ceil(h[x // 10] / max(h) * 360) for x in range(640)]
bars = [r for r in xml.parse("h.svg").iter("{http://www.w3.org/2000/svg}rect") if "height" in r.attrib and r.attrib["height"] != "100%"]
want = [math.log1p(n) / math.log1p(max(h)) * 360 for n in h if n]
assert len(bars) == len(want) and all(abs(float(b.attrib["height"]) - x) < 1e-6 for b, x in zip(bars, want))'
    fails_with 4 "h.png" vkt histogram phantom.nrrd -o h.png
    vkt histogram phantom.nrrd -o h.png --force
}

@test "partial results add up to that of the whole" {
    for z in 0:7 7:30 30:; do
        vkt histogram phantom.nrrd --roi :,:,$z --range 5:80 --bins 33 --mergeable -o "part$z.json"
    done
    vkt histogram phantom.nrrd --range 5:80 --bins 33 --json >whole.json
    vkt histogram --merge part*.json --json | cmp - whole.json
    vkt histogram --merge part0:7.json part7:30.json --mergeable -o sum.json
    vkt histogram --merge sum.json part30:.json --csv | cmp - <(vkt histogram phantom.nrrd --range 5:80 --bins 33 --csv)
    fails_with 2 "--merge reads no volume" vkt histogram --merge sum.json part30:.json --bins 7
    vkt histogram --merge sum.json part30:.json -o merged.svg
    fails_with 2 "same range for all" vkt histogram phantom.nrrd --mergeable
    vkt histogram phantom.nrrd --range 5:81 --bins 33 --mergeable -o other.json
    fails_with 3 "different bins" vkt histogram --merge sum.json other.json
    for bad in '{}' '[]' 'x' '{"mergeable": "vkt histogram 1"}' '[[1]]' \
        '{"mergeable": "vkt histogram 1", "edges": [0, 1], "counts": [-1], "nan": 0, "under": 0, "over": 0}' \
        '{"mergeable": "vkt histogram 1", "edges": [0, "1"], "counts": [1], "nan": 0, "under": 0, "over": 0}' \
        '{"mergeable": "vkt histogram 1", "edges": [0], "counts": [], "nan": 0, "under": 0, "over": 0}'; do
        echo "$bad" >bad.json
        fails_with 3 "is no partial histogram" vkt histogram --merge bad.json
    done
    fails_with 3 "is no partial histogram" vkt histogram --merge whole.json
    fails_with 4 "missing.json" vkt histogram --merge missing.json
}

@test "trees: cells one by one and by their volume; their region; no background" {
    vkt make amr --blocks 60 --levels 3 -o t.vkt
    vkt resample t.vkt --method nearest --scale 1 -o grid.nrrd
    py '
h = histogram("t.vkt", "--range", "-1:2", "--bins", "30")
info = vkt("info", "t.vkt")
import re
cells = int(re.search(r"with (\d+) cells", info).group(1))
assert total(h) == cells
g = histogram("grid.nrrd", "--range", "-1:2", "--bins", "30")
spacing = json.loads(vkt("info", "grid.nrrd", "--json"))
voxel = np.prod(spacing["spacing"]) if "spacing" in spacing else 1
assert np.allclose(h["volumes"], np.array(g["counts"]) * voxel, rtol=1e-9), (h["volumes"], g["counts"])'
    vkt histogram t.vkt --roi 0:16,:,: --json | py 'h = json.load(sys.stdin); assert 0 < sum(h["counts"]) < 10**9'
    [ "$(vkt histogram t.vkt --json)" = "$(vkt read t.vkt | vkt histogram --json --threads 1)" ]
    vkt refine phantom.nrrd --tolerance 1 -o r.vkt
    [ "$(vkt histogram r.vkt --json | py 'print(total(json.load(sys.stdin)))')" = "$(vkt stats r.vkt --json | py 'print(json.load(sys.stdin)["count"])')" ]
}

@test "several volumes" {
    vkt make noise --dims 5 6 7 -o s-0.nrrd
    vkt make ramp --dims 5 6 7 -o s-1.nrrd
    vkt read 's-*.nrrd' >many.vkt
    vkt histogram many.vkt --bins 4 --json | py 'assert [total(h) for h in json.load(sys.stdin)] == [210, 210]'
    fails_with 2 "several volumes" vkt histogram many.vkt -o one.png
    [ ! -e one.png ]
    vkt histogram many.vkt -o 'h%02d.png'
    [ -s h00.png ] && [ -s h01.png ]
}

@test "names of tables and pictures say what is written" {
    vkt make ramp --dims 9 2 2 -o r.nrrd
    vkt histogram r.nrrd --bins 3 -o h.json
    vkt histogram r.nrrd --bins 3 --json | cmp - h.json
    vkt histogram r.nrrd --bins 3 -o h.csv
    vkt histogram r.nrrd --bins 3 --csv | cmp - h.csv
    fails_with 2 "files of that kind are not written" vkt histogram r.nrrd -o h.pdf
    [ ! -e h.pdf ]
    fails_with 2 "'n.csv' is the name of CSV, --json asks for another form" vkt histogram r.nrrd --json -o n.csv
    fails_with 2 "'n.csv' is the name of CSV, --mergeable asks" vkt histogram r.nrrd --range 0:9 --mergeable -o n.csv
    fails_with 2 "'n.json' is the name of JSON, --csv asks for" vkt histogram r.nrrd --csv -o n.json
    fails_with 2 "'n.png' is the name of a picture, --json asks" vkt histogram r.nrrd --json -o n.png
    [ -z "$(find . -name 'n.*')" ]
    vkt histogram r.nrrd --bins 3 --json -o again.json
    cmp again.json h.json
}

@test "what cannot be is refused" {
    fails_with 2 "not between 1 and" vkt histogram phantom.nrrd --bins 0
    fails_with 2 "not between 1 and" vkt histogram phantom.nrrd --bins 65537
    fails_with 2 "empty" vkt histogram phantom.nrrd --range 5:5
    fails_with 2 "contradict" vkt histogram phantom.nrrd --range 0:5 --csv --mergeable
    fails_with 2 "is a picture" vkt histogram phantom.nrrd --csv -o h.png
    py 'save(np.full((3, 3, 3), np.nan), "n")'
    fails_with 3 "no voxel is a finite number" vkt histogram n_3x3x3_float64.raw
    vkt histogram n_3x3x3_float64.raw --range 0:1 --json | py 'assert json.load(sys.stdin)["nan"] == 27'
    [ -z "$(vkt histogram phantom.nrrd -n 2>plan)" ]
    grep -q "256 bins" plan
}
