# Hierarchical (AMR) volumes on the command line: reading, resampling, editing, statistics, making and refining.
load helper

raw() { vkt read "${1:--}" | vkt write - --format raw; }
check() {
    python_with numpy
    /usr/bin/python3 -c "import numpy as np, json
$1"
}
# tree [OPTION…]: t.vkt, a small tree of four levels on a grid of 64^3 finest cells.
tree() { vkt make amr --blocks 300 --levels 4 "$@" -o t.vkt --force; }

@test "make amr makes what it is asked for, whatever the threads" {
    tree
    vkt info t.vkt --json >info.json
    check "
i = json.load(open('info.json'))
assert i['kind'] == 'hierarchical' and i['dims'] == [64, 64, 64], i"
    vkt stats t.vkt --json >stats.json
    check "
s = json.load(open('stats.json'))
assert s['count'] % 512 == 0 and 300 <= s['count'] // 512 < 307, s['count']"
    vkt make amr --blocks 300 --levels 4 --threads 1 -o u.vkt
    cmp <(vkt resample t.vkt --dims 30 20 10 | raw) <(vkt resample u.vkt --dims 30 20 10 | raw)
    fails_with 2 'not in 1…19' vkt make amr --levels 0 -o x.vkt
    fails_with 2 'not in 1…19' vkt make amr --levels 20 -o x.vkt
    fails_with 2 '--silcc says' vkt make amr --silcc --blocks 5 -o x.vkt
    fails_with 2 'float32 or float64' vkt make amr --dtype uint8 -o x.vkt
}

@test "crop keeps bricks, and what is inside is reconstructed as before" {
    tree
    vkt crop t.vkt --roi 10:34,16:48,5:29 -o part.vkt
    for method in basis nearest average auto; do
        vkt resample part.vkt --dims 20 31 17 --method $method | raw >a
        vkt resample t.vkt --roi 10:34,16:48,5:29 --dims 20 31 17 --method $method | raw >b
        cmp a b
    done
    vkt read t.vkt --roi 10:34,16:48,5:29 | vkt resample --dims 20 31 17 --method auto | raw | cmp - a
    vkt stats t.vkt --json >all.json
    vkt stats part.vkt --json >part.json
    check "assert json.load(open('part.json'))['count'] < json.load(open('all.json'))['count']"
    fails_with 2 'leaves' vkt resample part.vkt --roi 0:64,:,: --dims 8 8 8 -o x.vkt
}

@test "a region in world units is the one in cells" {
    tree
    vkt set t.vkt --spacing 0.5 --origin 3,-4,5 -o placed.vkt
    # From the centre of the first cell to that of the last.
    world=8:19.5,4:19.5,7.5:19 cells=10:34,16:48,5:29
    vkt crop placed.vkt --roi $cells --no-history -o a.vkt
    vkt crop placed.vkt --roi-world $world --no-history -o b.vkt
    vkt read placed.vkt --roi-world $world -o c.vkt
    cmp a.vkt b.vkt
    # What a reader leaves out is remembered like what crop does.
    vkt history c.vkt | grep -q "vkt crop --roi $cells\$"
    for file in a b c; do vkt resample $file.vkt --dims 20 31 17 | raw >$file; done
    vkt resample placed.vkt --roi-world $world --dims 20 31 17 | raw >d
    cmp a b
    cmp a c
    cmp a d
    fails_with 2 'does not meet the volume' vkt crop placed.vkt --roi-world 100:200,:,: -o x.vkt
    fails_with 2 '' vkt resample placed.vkt --roi-world 100:200,:,: --dims 2 2 2 -o x.vkt
}

@test "flip of a tree is the flip of its grid" {
    tree
    for axis in x y z; do
        vkt flip $axis t.vkt | vkt resample --method nearest --scale 1 | raw >a
        vkt resample t.vkt --method nearest --scale 1 | vkt flip $axis | raw | cmp - a
    done
    fails_with 2 'cannot be mirrored' vkt flip x t.vkt --roi 0:32,:,: -o x.vkt
}

@test "pointwise operations on a tree are those on its grid" {
    tree
    vkt resample t.vkt --method nearest --scale 1 -o grid.vkt
    vkt arith mul t.vkt 3 | vkt resample --method nearest --scale 1 | raw >a
    vkt arith mul grid.vkt 3 | raw | cmp - a
    vkt arith add t.vkt t.vkt | vkt resample --method nearest --scale 1 | raw >a
    vkt arith add grid.vkt grid.vkt | raw | cmp - a
    fails_with 2 'different trees' vkt arith add t.vkt <(vkt crop t.vkt --roi 0:8,:,:) -o x.vkt
    fails_with 2 'are of both kinds' vkt arith add t.vkt grid.vkt -o x.vkt
    vkt convert t.vkt --dtype uint8 --range minmax | vkt resample --method nearest --scale 1 | raw >a
    vkt convert grid.vkt --dtype uint8 --range minmax | raw | cmp - a
    vkt set t.vkt --units Pa | vkt info | grep -x 'units      Pa'
}

@test "fill takes the cells whose centres lie in the region" {
    tree
    vkt resample t.vkt --method nearest --scale 1 | raw >before
    vkt fill t.vkt --value 7 --roi 0:32,8:64,: | vkt resample --method nearest --scale 1 | raw >after
    check "
b, a = (np.fromfile(f, np.float32).reshape(64, 64, 64) for f in ('before', 'after'))
b[:, 8:64, 0:32] = 7
assert (a == b).all()"
    vkt fill t.vkt --value 7 | vkt stats --json >s.json
    check "
s = json.load(open('s.json'))
assert s['min'] == 7 and s['max'] == 7"
    # What does not fit is counted in cells.
    local cells
    cells=$(vkt info t.vkt | sed -n 's/^bricks .* with \([0-9]*\) cells/\1/p')
    vkt fill t.vkt --value 1e39 -o x.vkt 2>remark
    grep -q "stored as inf in $cells voxels" remark
}

@test "statistics weight cells by their volume" {
    tree --dtype float64 --field linear
    vkt stats t.vkt --json >t.json
    vkt resample t.vkt --method nearest --scale 1 | vkt stats --json >grid.json
    check "
t, g = json.load(open('t.json')), json.load(open('grid.json'))
assert abs(t['weighted_mean'] - 3) < 1e-12 and abs(t['weighted_mean'] - g['mean']) < 1e-12, t
assert abs(t['weighted_variance'] - g['variance']) < 1e-10, (t, g)
assert abs(t['weighted_sum'] - t['weighted_mean'] * t['volume']) < 1e-9 * t['volume']
assert t['weighted_variance'] != t['variance'] and t['min'] == g['min'] and t['max'] == g['max']
assert t['argmin'] == g['argmin'], (t, g)
assert 'weighted_mean' not in g"
    vkt stats t.vkt --roi 0:32,:,: --json >t.json
    vkt resample t.vkt --method nearest --scale 1 | vkt stats --roi 0:32,:,: --json >grid.json
    check "
t, g = json.load(open('t.json')), json.load(open('grid.json'))
assert abs(t['weighted_mean'] - g['mean']) < 1e-12, (t, g)"
    vkt convert t.vkt --dtype uint8 --range minmax | vkt stats --json >t.json
    vkt convert t.vkt --dtype uint8 --range minmax | vkt resample --method nearest --scale 1 | vkt stats --json >grid.json
    check "
t, g = json.load(open('t.json')), json.load(open('grid.json'))
assert abs(t['weighted_mean'] - g['mean']) < 1e-9 and abs(t['weighted_variance'] - g['variance']) < 1e-9, (t, g)"
}

@test "average conserves the integral" {
    tree --dtype float64
    vkt stats t.vkt --json >t.json
    vkt resample t.vkt --method average --dims 13 9 21 | vkt stats --json >grid.json
    check "
t, g = json.load(open('t.json')), json.load(open('grid.json'))
assert abs(t['weighted_mean'] - g['mean']) < 1e-12 * abs(g['mean']), (t, g)"
}

@test "a sigma is the same length on every level, and no bound is claimed" {
    python_with numpy
    check "
wave = np.sin(2 * np.pi * (np.arange(64) + 0.5) / 64)
np.ascontiguousarray(np.broadcast_to(wave, (64, 64, 64))).tofile('wave_64x64x64_float64.raw')"
    depths='1 2 3 4' sigmas='1 2 4 8'
    if [ -n "$VKT_SANITIZED" ]; then depths=3 sigmas=4; fi # the numbers are those of the release build
    for levels in $depths; do
        # Cells 1, 2, 4 and 8 finest cells wide.
        vkt refine wave_64x64x64_float64.raw --tolerance 9 --levels $levels | vkt set --spacing 0.5 -o wave.vkt --force
        vkt resample wave.vkt --method nearest | raw >before
        for sigma in $sigmas; do
            vkt filter gaussian wave.vkt --sigma $sigma --boundary wrap --tolerance 1e-4% -o voxel.vkt --force
            vkt filter gaussian wave.vkt --sigma $(/usr/bin/python3 -c "print($sigma / 2)") --unit world --boundary wrap --tolerance 1e-4% -o world.vkt --force
            for unit in voxel world; do
                vkt resample $unit.vkt --method nearest | raw >after
                check "
a, b = (abs(np.fft.rfft(np.fromfile(f).reshape(64, 64, 64)[0, 0])[1]) for f in ('after', 'before'))
want = np.exp(-0.5 * (2 * np.pi * $sigma / 64) ** 2)
assert abs(a / b - want) < 1.5e-3, (a / b, want)"
            done
        done
    done
    tree --dtype float64
    for sigma in ${sigmas%8}; do
        vkt stats t.vkt --json >was.json
        vkt filter gaussian t.vkt --sigma $sigma -o s.vkt --force
        vkt stats s.vkt --json >is.json
        # Against the finest grid smoothed, whose voxels are those of the tree: cells are compared by their means.
        vkt resample t.vkt --method nearest | vkt filter gaussian --sigma $sigma | vkt resample --dims 8 8 8 --method area | raw >a
        vkt resample s.vkt --dims 8 8 8 --method average | raw >b
        check "
w, i = json.load(open('was.json')), json.load(open('is.json'))
assert abs(i['weighted_sum'] / w['weighted_sum'] - 1) < 1e-3, (w['weighted_sum'], i['weighted_sum'])
a, b = (np.fromfile(f) for f in 'ab')
assert abs(a - b).max() < 0.02 * (a.max() - a.min()), abs(a - b).max() / (a.max() - a.min())"
    done
    vkt filter gaussian t.vkt --sigma 1 -n 2>plan >dry
    grep -q 'no bound of the error' plan
    vkt filter gaussian t.vkt --sigma 1 --explain -o s.vkt --force 2>plan
    grep -q 'no bound of the error' plan
    # A tree that is a grid keeps the grid's.
    vkt make marschner-lobb --dims 16 16 16 | vkt refine --tolerance 0 --levels 1 | vkt filter gaussian --sigma 1 --explain -o s.vkt --force 2>plan
    grep -q 'error at most' plan
}

@test "every sigma is a length: filters made of Gaussians answer a wave alike on all levels" {
    python_with numpy
    check "
wave = np.sin(2 * np.pi * (np.arange(64) + 0.5) / 64)
np.ascontiguousarray(np.broadcast_to(wave, (64, 64, 64))).tofile('wave_64x64x64_float64.raw')"
    depths='3 4'
    if [ -n "$VKT_SANITIZED" ]; then depths=3; fi
    for levels in $depths; do
        vkt refine wave_64x64x64_float64.raw --tolerance 9 --levels $levels | vkt set --spacing 0.5 -o wave.vkt --force
        vkt resample wave.vkt --method nearest | raw >before
        for filter in log dog sharpen bilateral; do
            range=
            [ $filter != bilateral ] || range='--range-sigma 1e6'
            # shellcheck disable=SC2086
            vkt filter $filter wave.vkt --sigma 4 $range --boundary wrap | vkt resample --method nearest | raw >after
            # shellcheck disable=SC2086
            vkt filter $filter wave.vkt --sigma 2 --unit world $range --boundary wrap | vkt resample --method nearest | raw | cmp - after
            check "
a, b = (np.fft.rfft(np.fromfile(f).reshape(64, 64, 64)[0, 0])[1] for f in ('after', 'before'))
k = 2 * np.pi / 64
def gauss(sigma): return np.exp(-0.5 * (k * sigma) ** 2)
want = {'log': -(k / 0.5) ** 2 * gauss(4), 'dog': gauss(4) - gauss(6.4), 'sharpen': 2 - gauss(4), 'bilateral': gauss(4)}['$filter']
# On the coarsest level eight cells make a wave.
assert abs(a / b / want - 1) < 0.03, ('$filter', $levels, a / b, want)"
        done
    done
}

@test "no reconstruction leaves the range of the cells" {
    python_with numpy
    check "
rng = np.random.default_rng(4)
a = np.where(rng.random((40, 40, 40)) < 0.5, 0.1, 0.7)
for t in ('float32', 'float64'): a.astype(t).tofile('two_40x40x40_%s.raw' % t)"
    for dtype in float32 float64; do
        vkt refine two_40x40x40_$dtype.raw --tolerance 0 --levels 1 -o two.vkt --force
        for method in basis average auto; do
            for dims in "97 91 89" "23 97 31"; do
                vkt resample two.vkt --dims $dims --method $method | raw >got
                check "
got, held = np.fromfile('got', np.$dtype), np.fromfile('two_40x40x40_$dtype.raw', np.$dtype)
assert got.min() >= held.min() and got.max() <= held.max(), (got.min() - held.min(), got.max() - held.max())"
            done
        done
    done
}

@test "resample sizes: cells, spacing, scale, other types" {
    tree
    vkt resample t.vkt --cells 20k -o g.vkt
    vkt info g.vkt --json >g.json
    check "
d = json.load(open('g.json'))['dims']
assert abs(d[0] * d[1] * d[2] - 20000) < 1500 and d[0] == d[1] == d[2], d"
    vkt resample t.vkt --scale 0.5 | vkt info | grep -x 'dims       32 32 32'
    vkt resample t.vkt --dims 16,auto,auto --roi :,:,0:32 | vkt info | grep -x 'dims       16 16 8'
    vkt resample t.vkt --roi 0:10,0:12,0:14 | vkt info | grep -x 'dims       10 12 14'
    vkt resample t.vkt --dims 8 9 10 --dtype float64 | vkt info | grep -x 'dtype      float64'
    vkt make ramp --dims 40 20 10 | vkt resample --cells 1k | vkt info | grep -x 'dims       20 10 5'
    run -2 vkt resample t.vkt --cells 0 -o x.vkt
    [[ "$output" == *'not a number of cells'* ]]
}

@test "methods and options of the other kind are refused by name" {
    tree
    fails_with 2 'is for structured volumes' vkt resample t.vkt --dims 8 8 8 --method linear -o x.vkt
    fails_with 2 'use --method average' vkt resample t.vkt --dims 8 8 8 --method area -o x.vkt
    fails_with 2 '--boundary is for structured' vkt resample t.vkt --dims 8 8 8 --boundary mirror -o x.vkt
    vkt make ramp --dims 8 8 8 -o s.vkt
    fails_with 2 'is for hierarchical volumes' vkt resample s.vkt --scale 2 --method basis -o x.vkt
    fails_with 2 '--background is for hierarchical' vkt resample s.vkt --scale 2 --background 3 -o x.vkt
    fails_with 2 'is for OpenVDB' vkt write s.vkt s.nrrd --prune 1
    vkt write s.vkt s.nrrd
    fails_with 2 'one unnamed variable' vkt read s.nrrd --variable dens -o x.vkt
}

@test "FLASH: variables are listed, chosen and resampled as the oracle does" {
    needs_data amr/flash
    python_with numpy
    file="$VKT_DATA/amr/flash/synth3d_cubic_hdf5_plt_cnt_0000"
    vkt info "$file" >info
    grep 'variables: .*dens' info
    grep 'variable dens: ' info
    grep 'level 0: ' info
    grep 'holes: 0 %' info
    fails_with 2 "choose one: vkt read $file --variable " vkt stats "$file"
    fails_with 2 "has no variable 'denz'; it holds dens" vkt read "$file" --variable denz -o x.vkt
    for method in basis average; do
        vkt read "$file" --variable dens | vkt resample --dims 40 36 72 --method $method | raw >got
        check "
want = np.fromfile('$VKT_DATA/amr/oracle/cubic_${method}_dens_40x36x72.raw', np.float32)
got = np.fromfile('got', np.float32)
assert abs(got - want).max() <= 1e-5 * abs(want).max(), abs(got - want).max()"
    done
    vkt read "$file" --variable linr --roi 10:34,20:44,30:54 | vkt resample --dims 48 48 48 | raw >got
    check "
want = np.fromfile('$VKT_DATA/amr/oracle/cubic_basis_linr_roi10-20-30_34-44-54_48x48x48.raw', np.float32)
got = np.fromfile('got', np.float32)
assert abs(got - want).max() <= 1e-5 * abs(want).max(), abs(got - want).max()"
}

@test "AMReX: a directory is an input like any other" {
    needs_data amr/plt_eb_3d
    vkt info "$VKT_DATA/amr/plt_eb_3d" >info
    grep 'kind       hierarchical' info
    name=$(sed -n 's/^attribute  *variables: \([^ ]*\).*/\1/p' info)
    if [ -n "$name" ]; then
        vkt read "$VKT_DATA/amr/plt_eb_3d" --variable "$name" | vkt stats --json >stats.json
        vkt read "$VKT_DATA/amr/plt_eb_3d/" --variable "$name" | vkt resample --cells 10k --method average | vkt stats --json >grid.json
    else
        vkt stats "$VKT_DATA/amr/plt_eb_3d" --json >stats.json
        vkt resample "$VKT_DATA/amr/plt_eb_3d" --cells 10k --method average | vkt stats --json >grid.json
    fi
    check "
s, g = json.load(open('stats.json')), json.load(open('grid.json'))
assert abs(s['weighted_mean'] - g['mean']) <= 1e-5 * max(1, abs(g['mean'])), (s, g)"
    mkdir plain
    fails_with 4 'directory' vkt info plain
}

@test "AMReX: damaged records are bad data, in one line that says where" {
    needs_data amr/plt_eb_3d
    damaged() { # TEXT PYTHON: of b, the bytes of a copied level's data
        rm -rf plt
        cp -r "$VKT_DATA/amr/plt_eb_3d" plt
        chmod -R u+w plt
        /usr/bin/python3 -c "
name = 'plt/Level_0/Cell_D_00000'
b = open(name, 'rb').read()
begin = b.index(b'\n') + 1
$2
open(name, 'wb').write(b)"
        fails_with 3 "$1" vkt read plt --variable ${3:-volFrac} -o x.vkt
        [ "$(grep -c . <<<"$stderr")" -eq 1 ]
        [[ "$stderr" == *"Level_0/Cell_D_00000: the record at byte 0 of box"* ]]
        [ ! -e x.vkt ]
    }
    damaged 'holds box' "b = b.replace(b'(63,31,15)', b'(95,31,15)', 1)"
    damaged 'ended early' "b = b[:-8]"
    damaged 'is damaged' "b = b[:begin] + b[begin + 3:] + b'abc'" density
}

# pixels PNG: what it shows, without the texts in it.
pixels() { /usr/bin/python3 -c "
import struct, sys, zlib
b, at, data = open(sys.argv[1], 'rb').read(), 8, b''
while at < len(b):
    n, kind = struct.unpack('>I4s', b[at:at + 8])
    if kind == b'IHDR': print(*struct.unpack('>IIBB', b[at + 8:at + 18]))
    if kind == b'IDAT': data += b[at + 8:at + 8 + n]
    at += 12 + n
print(zlib.decompress(data).hex())" "$1"; }

@test "AMReX: pipes and devices among the files are refused, not waited for" {
    needs_data amr/plt_eb_3d
    cp -r "$VKT_DATA/amr/plt_eb_3d" plt
    chmod -R u+w plt
    for part in Level_0/Cell_D_00000 Level_1/Cell_H; do
        mv plt/$part kept
        mkfifo plt/$part
        fails_with 3 "$part: is no regular file" timeout 20 vkt read plt --variable density
        rm plt/$part
        ln -s /dev/zero plt/$part
        fails_with 3 "$part: is no regular file" timeout 20 vkt read plt --variable density
        rm plt/$part
        mv kept plt/$part
    done
}

# plots.py: plotfiles as AMReX writes them, of every version of its tables of boxes.
plots() {
    python_with numpy
    cat >plots.py <<'END'
import os, re, struct, subprocess, sys, numpy
def corner(v): return "(" + ",".join(map(str, v)) + ")"
def box(b, kind=None): return f"({corner(b[0])} {corner([u - 1 for u in b[1]])} {corner(kind or [0] * len(b[0]))})"
def descriptor(code, big):
    n = int(code[1])
    return f"((8, ({'64 11 52 0 1 12 0 1023' if n == 8 else '32 8 23 0 1 9 0 127'})),({n}, ({' '.join(map(str, range(1, n + 1) if big else range(n, 0, -1)))})))"
def plot(root, levels, boxes, ratio, version=1, code="f8", big=False, ghosts=0, names=("rho", "vel x"), files=2, kind=None, label="HyperCLaw-V1.1", ratios=None):
    """levels: for each, arrays of its whole domain, z, y, x, one for each name; boxes: for each, (lower, upper) as x, y, z."""
    nd = levels[0][0].ndim
    domains = [([0] * nd, list(a[0].shape[::-1])) for a in levels]
    head = [label, len(names), *names, nd, 0.25, len(levels) - 1, " ".join(["0"] * nd), " ".join(map(str, domains[0][1])),
            ratios if ratios is not None else " ".join([str(ratio)] * (len(levels) - 1)), " ".join(map(box, domains)), " ".join(["3"] * len(levels))]
    head += [" ".join([str(1 / ratio ** l)] * nd) for l in range(len(levels))] + [0, 0]
    for l, (data, parts) in enumerate(zip(levels, boxes)):
        head += [f"{l} {len(parts)} 0.25", 3] + [f"{a / ratio ** l} {b / ratio ** l}" for p in parts for a, b in zip(*p)] + [f"Level_{l}/Cell"]
        os.makedirs(f"{root}/Level_{l}", exist_ok=True)
        out, disk, least, most = [b""] * files, [], [], []
        for i, (lower, upper) in enumerate(parts):
            f = i * files // len(parts) if version != 2 else i % files
            disk.append(f"FabOnDisk: Cell_D_{f:05d} {len(out[f])}")
            cells = [a[tuple(slice(x, y) for x, y in zip(lower, upper))[::-1]] for a in data]
            least.append("".join(f"{a.min():.17g}," for a in cells)); most.append("".join(f"{a.max():.17g}," for a in cells))
            grown = ([x - ghosts for x in lower], [x + ghosts for x in upper])
            if version < 2: out[f] += f"FAB {descriptor(code, big)}{box(grown, kind)} {len(names)}\n".encode()
            for a in cells: out[f] += numpy.pad(a, ghosts, constant_values=numpy.nan).astype((">" if big else "<") + code).tobytes()
        for f, b in enumerate(out):
            if b: open(f"{root}/Level_{l}/Cell_D_{f:05d}", "wb").write(b)
        table = [version, 1, len(names), ghosts, f"({len(parts)} 0", *[box(p, kind) for p in parts], ")", len(parts), *disk, ""]
        if version in (0, 1, 3): table += [f"{len(parts)},{len(names)}", *least, "", f"{len(parts)},{len(names)}", *most, ""]
        if version == 4: table += ["".join(f"{f(a):.17g}," for a in data) for f in (numpy.min, numpy.max)]
        if version >= 2: table += [descriptor(code, big)]
        open(f"{root}/Level_{l}/Cell_H", "w").write("\n".join(map(str, table)) + "\n")
    open(f"{root}/Header", "w").write("\n".join(map(str, head)) + "\n")
def example(root, nd=3, **more):
    """Two levels of random numbers, two boxes each; returns what the finest cells everywhere are."""
    rng = numpy.random.default_rng(4)
    small = (4, 8, 16)[3 - nd:]
    coarse = [rng.random(small).astype("f4").astype("f8") for _ in range(2)]
    fine = [rng.random([2 * n for n in small]).astype("f4").astype("f8") for _ in range(2)]
    top = list(small[::-1])
    halves = [([0] * nd, [top[0] // 2] + top[1:]), ([top[0] // 2] + [0] * (nd - 1), top)]
    parts = [([4, 4, 0][:nd], [8, 8, 4][:nd]), ([8, 4, 0][:nd], [12, 8, 8][:nd])]
    plot(root, [coarse, fine], [halves, parts], 2, **more)
    want = []
    for k in range(2):
        whole = coarse[k]
        for a in range(nd): whole = whole.repeat(2, a)
        for lower, upper in parts:
            part = tuple(slice(x, y) for x, y in zip(lower, upper))[::-1]
            whole[part] = fine[k][part]
        want.append(whole)
    return want
def grid(root, name, code):
    raw = subprocess.check_output(["bash", "-c", "set -o pipefail; vkt read \"$1\" --variable \"$2\" | vkt resample --method nearest --scale 1 | vkt write - --format raw", "", root, name])
    return numpy.frombuffer(raw, code)
END
}

@test "AMReX: every version of tables, kind of numbers, order of bytes, several boxes in a file, ghost cells, one to three dimensions" {
    plots
    /usr/bin/python3 - <<'END'
from plots import *
n = 0
for version in 0, 1, 2, 3, 4:
    for code in "f4", "f8":
        for big in False, True:
            root = f"plt{n:05d}"
            nd = 3 - n % 3
            want = example(root, nd, version=version, code=code, big=big, ghosts=n % 2)
            for name, values in zip(("rho", "vel x"), want):
                got = grid(root, name, code)
                assert got.size == values.size, (version, nd, got.size, values.shape)
                assert numpy.array_equal(got, values.ravel()), (version, code, big, nd, name)
            n += 1
want = example("one", version=4, files=1)
assert numpy.array_equal(grid("one", "rho", "f8"), want[0].ravel())
END
}

@test "AMReX: nodes, checkpoints, ratios that differ by axis, and bare records that end early are refused, and why" {
    plots
    /usr/bin/python3 -c '
from plots import *
example("nodes", kind=[1, 0, 0])
example("nodes4", kind=[1, 1, 1], version=4)
example("chk", label="Checkpoint version: 1")
example("axes", ratios="((2,2,1))")
example("three", ratios="3")
example("short", version=2)
b = open("short/Level_1/Cell_D_00000", "rb").read(); open("short/Level_1/Cell_D_00000", "wb").write(b[:-8])
example("future", version=7)
example("kind", version=4)
t = open("kind/Level_0/Cell_H").read(); open("kind/Level_0/Cell_H", "w").write(t[:t.rindex("((")])'
    fails_with 3 "at nodes or faces of cells, and only those of cells are read" vkt info nodes
    fails_with 3 "at nodes or faces" vkt info nodes4
    fails_with 3 "is the header of a checkpoint" vkt info chk
    fails_with 3 "refinement ratios differ between axes" vkt info axes
    fails_with 3 "refinement ratio 3 is not a power of two" vkt info three
    fails_with 3 "ended early" vkt read short --variable rho -o x.vkt
    fails_with 3 "version is not in 0" vkt info future
    fails_with 3 "ended early" vkt info kind
}

@test "FLASH: the names of version 2, blocks of two dimensions, values at corners, files of particles" {
    python_with h5py numpy
    /usr/bin/python3 - <<'END'
import h5py, numpy, subprocess
rng = numpy.random.default_rng(2)
def flash2(name, nd, extra=0):
    """FLASH 2: 'file format version' and 'simulation parameters' are datasets of their own."""
    n = (8, 6, 4)[:nd]
    blocks = 1 + 2 ** nd # a root and its leaves
    shape = tuple(n[a] + extra if a < nd else 1 for a in range(3))[::-1]
    data = rng.random((blocks,) + shape)
    with h5py.File(name, "w") as f:
        f["file format version"] = numpy.array([7], "i4")
        f["simulation parameters"] = numpy.array([(blocks, 0.5, 0.01, 0.0, 42, *(n + (1,) * (3 - nd)))], [(k, t) for k, t in (
            ("total blocks", "i4"), ("time", "f8"), ("timestep", "f8"), ("redshift", "f8"), ("number of steps", "i4"), ("nxb", "i4"), ("nyb", "i4"), ("nzb", "i4"))])
        f["unknown names"] = numpy.array([[b"dens"]], "S4")
        f["refine level"] = numpy.array([1] + [2] * (blocks - 1), "i4")
        f["node type"] = numpy.array([2] + [1] * (blocks - 1), "i4")
        f["gid"] = numpy.full((blocks, 2 * nd + 1 + 2 ** nd), -1, "i4")
        low = numpy.array([[0] * nd] + [[(k >> a & 1) / 2 for a in range(nd)] for k in range(blocks - 1)])
        size = numpy.array([[1.0] * nd] + [[0.5] * nd] * (blocks - 1))
        f["coordinates"], f["block size"] = low + size / 2, size
        f["bounding box"] = numpy.stack([low, low + size], -1)
        f["dens"] = data
    if extra: return
    want = numpy.zeros(tuple(2 * n[a] if a < nd else 1 for a in range(3))[::-1])
    for k in range(blocks - 1):
        at = [(k >> a & 1) * n[a] if a < nd else 0 for a in range(3)]
        want[at[2]:at[2] + shape[0], at[1]:at[1] + shape[1], at[0]:at[0] + shape[2]] = data[1 + k]
    raw = subprocess.check_output(f"vkt read {name} | vkt resample --method nearest --scale 1 | vkt write - --format raw", shell=True)
    assert numpy.array_equal(numpy.frombuffer(raw), want.ravel()), nd
    info = subprocess.check_output(["vkt", "info", name], text=True)
    assert "time: 0.5" in info and "step: 42" in info, info
for nd in 1, 2, 3: flash2(f"old{nd}_hdf5_chk_0000", nd)
flash2("corners_hdf5_plt_cnt_0000", 3, extra=1)
flash2("corners2_hdf5_plt_cnt_0000", 2, extra=1)
with h5py.File("run_hdf5_part_0000", "w") as f:
    f["sim info"] = numpy.array([(9,)], [("file format version", "i4")])
    f["particle names"] = numpy.array([[b"posx"], [b"posy"]], "S24")
    f["tracer particles"] = rng.random((50, 2))
END
    for file in corners_hdf5_plt_cnt_0000 corners2_hdf5_plt_cnt_0000; do
        fails_with 3 "holds values at the corners of cells" vkt stats $file
    done
    fails_with 3 "is a FLASH file of particles" vkt info run_hdf5_part_0000
}

@test "render draws a tree, whatever the threads, skipping and transport" {
    tree
    look="--size 90x70 --domain 0:1 --opacity 0,0.01,0.1 --colormap viridis --shade gradient"
    look+=" --tree bricks"
    vkt render t.vkt $look -o a.png
    pixels a.png >a
    [ "$(head -n 1 a)" = "90 70 8 2" ]
    [ "$(tail -n 1 a | fold -w 6 | sort -u | wc -l)" -gt 100 ]
    vkt render t.vkt $look --threads 1 -o b.png
    vkt render t.vkt $look --threads 3 --no-skip -o c.png
    vkt make amr --blocks 300 --levels 4 | vkt render $look -o d.png
    vkt make amr --blocks 300 --levels 4 --transport shm | vkt render $look -o e.png
    for other in b c d e; do pixels $other.png | cmp - a; done
    look=${look/bricks/blocks}
    vkt render t.vkt $look -o f.png
    vkt render t.vkt $look --threads 3 --no-skip -o g.png
    pixels f.png >f
    pixels g.png | cmp - f
    run ! cmp f a
    # Without memory for blocks there are bricks.
    vkt render t.vkt $look --memory 2M -o h.png
    pixels h.png | cmp - a
    vkt render t.vkt --size 40 -o chosen.png
}

@test "ranges and thresholds of a cropped tree are those of what is left, not of bricks" {
    vkt make noise --dims 40 30 20 --seed 4 --dtype float32 -o grid.vkt
    vkt refine grid.vkt --tolerance 0 --levels 1 -o t.vkt
    for volume in grid t; do
        vkt crop $volume.vkt --roi 5:35,6:25,3:17 -o part.vkt --force
        vkt threshold part.vkt --otsu --report otsu_$volume -o mask.vkt --force
        vkt threshold $volume.vkt --roi 5:35,6:25,3:17 --otsu --report roi_$volume -o mask.vkt --force
        for range in minmax p1:p99; do
            vkt convert part.vkt --dtype uint8 --range $range -q | vkt info --json | grep -E '"(slope|intercept)"' >>map_$volume
        done
    done
    cat otsu_*
    cmp otsu_grid otsu_t
    cmp otsu_grid roi_t
    [ -s map_grid ]
    cmp map_grid map_t
    # Cells of several levels, with centres in the region, are what stats counts.
    tree
    vkt crop t.vkt --roi 9:40,7:33,5:50 -o part.vkt --force
    ends() { vkt stats "$1" --json | grep -Eo '"(min|max)": [^,]*'; }
    vkt convert part.vkt --dtype float64 --range minmax --to 5:7 -q | vkt set - --slope 1 --intercept 0 -o scaled.vkt
    [ "$(ends scaled.vkt | tr '\n' ' ')" = '"min": 5 "max": 7 ' ]
}

@test "a tree is drawn as a grid where that is smaller, and as asked" {
    tree
    look="--size 64 --domain 0:1 --opacity 0,0.01,0.1 --colormap viridis"
    vkt resample t.vkt --scale 1 --method basis -o grid.vkt
    for case in "grid.vkt" "t.vkt --tree grid" "t.vkt" "t.vkt --tree bricks"; do
        # shellcheck disable=SC2086
        vkt render $case $look -v -o a.png --force 2>said
        pixels a.png >"of_${case// /_}"
        grep -o 'finest [a-z]*' said >"said_${case// /_}" || true
    done
    cmp of_grid.vkt of_t.vkt_--tree_grid
    cmp of_t.vkt of_t.vkt_--tree_grid
    [ "$(cat said_t.vkt)" = "finest grid" ]
    [ "$(cat said_t.vkt_--tree_bricks)" = "finest cell" ]
    run ! cmp of_t.vkt of_t.vkt_--tree_bricks
    # One that would be a few times larger as a grid is drawn sooner so, where there is room.
    vkt make amr --blocks 500 --levels 5 -o wide.vkt
    vkt render wide.vkt --size 20 -v -o wide.png 2>said
    grep -q 'finest grid' said
    vkt render wide.vkt --size 20 -v --memory 12M -o narrow.png 2>said
    grep -q 'finest cell' said
    # Deep ones would be larger still.
    vkt make amr --blocks 500 --levels 6 | vkt render --size 20 -v -o b.png 2>said
    grep -q 'finest cell' said
    fails_with 2 "did you mean 'bricks'" vkt render t.vkt --tree brick -o c.png
}

@test "a tree of one level looks like its grid" {
    python_with numpy
    vkt make marschner-lobb --dims 20 28 24 --spacing 1,0.5,2 -o grid.vkt
    vkt refine grid.vkt --tolerance 0 --levels 1 -o t.vkt
    look="--size 60 --opacity 0,0.01,0.1 --domain 0:1 --colormap viridis --fit volume --shade gradient"
    vkt render grid.vkt $look -o grid.png
    vkt render t.vkt $look --tree bricks -o t.png
    for volume in grid t; do pixels $volume.png >$volume; done
    check "
a, b = (np.frombuffer(bytes.fromhex(open(f).read().split('\n')[1]), np.uint8).astype(int) for f in ('grid', 't'))
assert abs(a - b).max() <= 1, abs(a - b).max()"
}

@test "files that hold trees are drawn" {
    needs_data amr/flash
    needs_data vdb/smoke.vdb
    for file in synth3d_noncubic_hdf5_chk_0000 synth3d_guard2_hdf5_chk_0000 blast2_hdf5_chk_0018; do
        vkt read "$VKT_DATA/amr/flash/$file" --variable dens | vkt render --size 64 -o $file.png
    done
    vkt read "$VKT_DATA/amr/plt_eb_3d" --variable density | vkt render --size 64 -o amrex.png
    vkt write --formats | grep -q OpenVDB || return 0
    vkt render "$VKT_DATA/vdb/smoke.vdb" --size 64 -o smoke.png
    # Smoke in the middle, nothing in the corners.
    pixels smoke.png | tail -n 1 >smoke
    [ "$(fold -w 6 smoke | sort -u | wc -l)" -gt 100 ]
}

@test "every algorithm draws a tree, with its goals and layers; nothing to see is no crash" {
    tree --field linear
    drawn() { # options…: a picture that is not one colour
        vkt render t.vkt --size 40 --tree bricks -o drawn.png --force "$@"
        pixels drawn.png | tail -n 1 >drawn
        [ "$(fold -w 6 drawn | sort -u | wc -l)" -gt 20 ]
    }
    drawn --render-algo implicit-iso
    drawn --render-algo implicit-iso --tolerance 2
    drawn --render-algo multi-scattering --spp 8
    drawn --render-algo multi-scattering --noise 8
    drawn --render-algo maximum
    drawn --exact --opacity 0,0.3
    drawn --tolerance 2
    vkt arith mul t.vkt 0 | vkt arith div 0 -o nan.vkt
    fails_with 3 'no finite voxel' vkt render nan.vkt -o a.png
    vkt make sphere --dims 64 64 64 | vkt refine --tolerance 0.01 --background 0 -o holes.vkt
    vkt render holes.vkt --size 40 -o holes.png
    vkt crop holes.vkt --roi 0:32,:,: | vkt render --size 40 -o half.png
    vkt arith mul t.vkt 0 | vkt render --size 20 -o zero.png
    [ ! -e a.png ]
}

@test "the case study runs" {
    run sh "$VKT_ROOT/examples/amr-zoom.sh" 20k --blocks 400 --levels 5
    [ "$status" -eq 0 ] || { echo "$output" >&2; false; }
    [[ "$output" == *"whole volume"* && "$output" == *"region"* ]]
    [ -s whole.nrrd ]
    [ -s zoom.nrrd ]
    for picture in whole zoom whole-tree zoom-tree; do
        [ "$(pixels $picture.png | head -n 1)" = "512 512 8 2" ]
    done
    python_with numpy
    for file in whole zoom; do
        vkt info $file.nrrd --json >info.json
        check "
d = json.load(open('info.json'))['dims']
assert abs(d[0] * d[1] * d[2] - 20000) < 2000, d"
    done
}

@test "a tree that was cut off or damaged, or whose upstream failed, never passes for a whole one" {
    tree
    vkt read t.vkt --memory 4M >whole.vkt # several frames of cells
    local size offset operation
    size=$(stat -c %s whole.vkt)
    "$VKT_ROOT/tests/frames.py" whole.vkt | awk '$2 == "cut" { print $1 }' >offsets
    [ "$(wc -l <offsets)" -ge 5 ]
    # fails STATUS FILE: with it, and says nothing else; the operation is $operation.
    fails() {
        # shellcheck disable=SC2086
        run --separate-stderr vkt ${operation/@/$2}
        [ "$status" -eq "$1" ] && [ -z "$output" ] && [ ! -e out.vkt ] || {
            echo "$operation, $3: $status" >&2
            return 1
        }
    }
    for operation in 'convert @ --dtype float64 -o out.vkt' 'filter gaussian @ --sigma 1 -o out.vkt' \
        'filter gaussian @ --sigma 1 --memory 4M -o out.vkt' 'stats @' 'stats @ --percentiles 50' 'histogram @' \
        'crop @ --roi 0:8,:,: -o out.vkt' 'flip x @ -o out.vkt' 'set @ --units K -o out.vkt' 'info @' 'read @ -o out.vkt'; do
        for offset in $(cat offsets) $((size / 3)) $((size - 1)); do
            head -c "$offset" whole.vkt >cut.vkt
            fails 3 cut.vkt "$offset bytes"
        done
        # A cell, and the table.
        for offset in $((size / 2)) 1500; do
            cp whole.vkt bad.vkt
            printf '\x5a\xa5' | dd of=bad.vkt bs=1 seek="$offset" conv=notrunc status=none
            fails 3 bad.vkt "byte $offset changed"
        done
        # What another stage says.
        vkt arith add cut.vkt 1 2>/dev/null | fails 3 - "after a failure"
    done
}

@test "frames of a tree that are missing, doubled or out of order are found" {
    tree
    vkt read t.vkt --memory 4M >whole.vkt
    /usr/bin/python3 - "$VKT_ROOT/tests" <<'EOF'
import sys
sys.path.insert(0, sys.argv[1])
from frames import FRAME, MAGIC, boundaries
stream = open('whole.vkt', 'rb').read()
ends = [at for at, _ in boundaries(stream)]
frames = [stream[a:b] for a, b in zip(ends, ends[1:])]
kinds = [FRAME.unpack_from(frame)[0] for frame in frames]
assert kinds[:2] == [b'HEAD', b'PACK'] and kinds[2:-1] == [b'BRIK'] * 3, kinds
for name, order in {'table': [0, 2, 3, 4, 5], 'tables': [0, 1, 1, 2, 3, 4, 5], 'one': [0, 1, 3, 4, 5], 'last': [0, 1, 2, 3, 5],
                    'twice': [0, 1, 2, 2, 3, 4, 5], 'more': [0, 1, 2, 3, 4, 4, 5], 'turned': [0, 1, 3, 2, 4, 5]}.items():
    open(name + '.vkt', 'wb').write(MAGIC + b''.join(frames[i] for i in order))
EOF
    for command in 'stats' 'flip x' 'filter gaussian --sigma 1 --memory 4M' info; do
        for file in table tables one last twice more turned; do
            # shellcheck disable=SC2086
            run --separate-stderr vkt $command $file.vkt
            [ "$status" -eq 3 ] || { echo "$command, $file: $status" >&2; false; }
        done
    done
    fails_with 3 'come before the table of bricks' vkt stats table.vkt
}

@test "kill -9 of a stage that spools a tree leaves nothing" {
    tree --block-size 16
    mkdir spool pipes
    export TMPDIR=$PWD/spool
    mkfifo pipes/in
    vkt filter gaussian pipes/in --sigma 1 --memory 4M -o out.vkt 3>&- &
    local stage=$!
    exec 9>pipes/in
    head -c 3000000 t.vkt >&9 # it waits for more
    kill -KILL $stage
    exec 9>&-
    run wait $stage
    [ ! -e out.vkt ]
    [ -z "$(ls -A spool)" ]
    [ "$(ls)" = "$(printf 'pipes\nspool\nt.vkt')" ]
}

@test "plotfiles that are written hold the tree, and what it covers as means, for a reader of their own" {
    python_with numpy
    cat >plotfile.py <<'END'
import re, sys, numpy
def numbers(line): return [int(n) for n in re.findall(r"-?\d+", line)]
def boxes(line, nd): # inclusive corners
    n = numbers(line)
    return [(n[i:i + nd], n[i + nd:i + 2 * nd]) for i in range(0, len(n), 3 * nd)]
def read(folder):
    head = open(f"{folder}/Header").read().split("\n")
    assert head[0] == "HyperCLaw-V1.1" and head[1] == "1"
    nd, finest = int(head[3]), int(head[5])
    low, high = [float(x) for x in head[6].split()], [float(x) for x in head[7].split()]
    assert head[8].split() == ["2"] * finest
    domains = boxes(head[9], nd)
    at, levels = 11, []
    for l in range(finest + 1):
        sizes = [float(x) for x in head[at + l].split()]
        cells = [b - a + 1 for a, b in zip(*domains[l])]
        assert numpy.allclose(sizes, (numpy.array(high) - low) / cells)
    at += finest + 3
    for l in range(finest + 1):
        _, count, _ = head[at].split()
        edges = numpy.array([[float(x) for x in line.split()] for line in head[at + 2:at + 2 + int(count) * nd]]).reshape(-1, nd, 2)
        stem = head[at + 2 + int(count) * nd]
        assert stem == f"Level_{l}/Cell"
        at += 3 + int(count) * nd
        table = open(f"{folder}/{stem}_H").read().split("\n")
        n = int(table[6 + int(count)])
        assert table[:4] == ["1", "1", "1", "0"] and numbers(table[4])[0] == int(count) == n
        lists = [boxes(line, nd)[0] for line in table[5:5 + n]]
        disk = [line.split() for line in table[7 + n:7 + 2 * n]]
        least, most = table[9 + 2 * n:9 + 3 * n], table[11 + 3 * n:11 + 4 * n]
        cells = [b - a + 1 for a, b in zip(*domains[l])]
        data, seen = numpy.full(cells[::-1], numpy.nan), numpy.zeros(cells[::-1], int)
        for (a, b), (label, file, offset), lo, hi, edge in zip(lists, disk, least, most, edges, strict=True):
            raw = open(f"{folder}/Level_{l}/{file}", "rb").read()
            line, rest = raw[int(offset):].split(b"\n", 1)
            m = re.fullmatch(r"FAB \(\(8, \((.*?)\)\),\((\d), \((.*?)\)\)\)(\(\(.*\)\)) 1", line.decode())
            assert boxes(m[4], nd)[0] == (a, b)
            assert (m[1], m[3]) == {"8": ("64 11 52 0 1 12 0 1023", "8 7 6 5 4 3 2 1"), "4": ("32 8 23 0 1 9 0 127", "4 3 2 1")}[m[2]]
            shape = [y - x + 1 for x, y in zip(a, b)][::-1]
            values = numpy.frombuffer(rest, "<f" + m[2], int(numpy.prod(shape))).reshape(shape)
            assert values.min() == float(lo.rstrip(",")) and values.max() == float(hi.rstrip(","))
            part = tuple(slice(x, y + 1) for x, y in zip(a, b))[::-1]
            data[part] = values
            seen[part] += 1
            h = (numpy.array(high) - low) / cells
            assert numpy.allclose(edge, numpy.array([low + h * a, low + h * (numpy.array(b) + 1)]).T)
        assert seen.max() == 1 and (l > 0 or seen.min() == 1) # nothing twice, and the coarsest level everywhere
        levels.append((data, seen == 1))
    return head[2], low, high, levels
def finer(a): # each cell twice along every axis
    for k in range(a.ndim): a = a.repeat(2, k)
    return a
def means(a): return a.reshape([m for n in a.shape for m in (n // 2, 2)]).mean(tuple(range(1, 2 * a.ndim, 2)))
name, low, high, levels = read(sys.argv[1])
whole = levels[0][0]
for (below, _), (data, seen) in zip(levels, levels[1:]):
    mean, covered = means(numpy.where(seen, data, 0)), means(seen.astype(float))
    assert set(numpy.unique(covered)) <= {0, 1} # whole coarse cells
    assert numpy.allclose(below[covered == 1], mean[covered == 1], rtol=1e-5 if sys.argv[3] == "float32" else 1e-13)
    whole = numpy.where(seen, data, finer(whole))
want = numpy.load(sys.argv[2])
assert numpy.array_equal(whole.reshape(want.shape).astype(want.dtype), want)
print(name, *low, *high, len(levels))
END
    vkt make amr --blocks 300 --levels 4 --dtype float64 | vkt set --spacing 0.5,0.25,2 --origin 1,2,3 --attribute variable=dens --attribute time=0.25 -o a.vkt
    vkt make amr --blocks 900 --levels 6 --block-size 4 -o b.vkt
    vkt make sphere --dims 64 48 1 --edge coverage | vkt refine --tolerance 0.01 -o c.vkt
    for tree in a b c; do
        vkt write $tree.vkt plt0000$tree --format amrex 2>/dev/null
        vkt resample $tree.vkt --method nearest --scale 1 -o $tree.npy -q
        vkt resample plt0000$tree --method nearest --scale 1 | vkt diff - <(vkt resample $tree.vkt --method nearest --scale 1)
        /usr/bin/python3 plotfile.py plt0000$tree $tree.npy "$(vkt info $tree.vkt | sed -n 's/^dtype *//p')" >$tree.said
        vkt write plt0000$tree plt1
        diff -r plt0000$tree plt1
        rm -r plt1 # by its name, and the same again
    done
    [ "$(cat a.said)" = "dens 0.75 1.875 2.0 32.75 17.875 130.0 2" ]
    vkt info plt0000a | grep -q 'attribute *time: 0.25'
    fails_with 4 "the directory exists" vkt write a.vkt plt0000a --format amrex
    vkt write b.vkt plt0000a --format amrex --force -q
    diff -r plt0000a plt0000b
    touch plt0000a/notes
    fails_with 4 "it holds files that are no plotfile" vkt write b.vkt plt0000a --format amrex --force
    fails_with 2 "vkt refine" vkt make ramp --dims 4 4 4 --dtype float32 -o plt9
    fails_with 2 "not float16" bash -c 'vkt convert b.vkt --dtype float16 | vkt write plt9'
    fails_with 2 "leaf blocks cover" bash -c 'vkt crop b.vkt --roi 0:20,:,: | vkt write plt9'
    fails_with 2 "cuts cells" bash -c 'vkt make sphere --dims 64 48 48 --edge coverage | vkt refine --tolerance 0.01 --block-size 5 | vkt write plt9'
    fails_with 3 "plotfiles do not hold the map of values, units, the attribute content, the history" bash -c \
        'vkt set b.vkt --units K --slope 2 | vkt write - plt9 --strict'
    mkdir d
    mkfifo pipe
    for signal in KILL TERM; do
        vkt write pipe d/plt9 -q &
        writer=$!
        exec 7>pipe
        head -c 300000 b.vkt >&7
        for _ in $(seq 100); do [ -z "$(find d -path '*Level_0*')" ] || break; sleep 0.05; done
        kill -$signal $writer
        wait $writer || true
        exec 7>&-
        for _ in $(seq 100); do [ -n "$(ls -A d)" ] || break; sleep 0.05; done
        [ -z "$(ls -A d)" ] || { find d >&2; false; }
    done
    [ ! -e plt9 ]
    [ -z "$(find . -name '.*vkt-*')" ]
    mkdir small
    mount -t tmpfs -o size=64k tmpfs small 2>/dev/null || skip "a tmpfs cannot be mounted here"
    failed=0
    fails_with 4 "space left" vkt write b.vkt small/plt9 || failed=1
    [ -z "$(ls -A small)" ] || failed=1
    umount small
    [ $failed -eq 0 ]
}
