# OpenVDB files through read and write: round trips, pruning, several grids, and OpenVDB's own Python module.
load helper

setup_more() {
    vkt make sphere --dims 12 10 8 --dtype float32 -o probe.nrrd
    vkt write probe.nrrd probe.vdb 2>err || { grep -q 'OpenVDB' err && skip 'built without OpenVDB'; cat err >&2; false; }
    vkt make sphere --dims 40 36 32 --dtype float32 | vkt set --spacing 0.5,1,2 --origin 3,-4,5 -o sphere.nrrd
}

dense() { vkt read "$1" | vkt resample --method nearest; }

@test "a volume comes back whole, background and geometry included" {
    vkt write sphere.nrrd sphere.vdb
    vkt info sphere.vdb --json | grep -q '"kind": "hierarchical"'
    dense sphere.vdb | vkt diff - sphere.nrrd --json | tee diff.json | grep -q '"max_abs": 0'
    grep -q '"same_geometry": true' diff.json
}

@test "equal volumes make equal files, different ones files that differ in their UUID" {
    vkt write sphere.nrrd a.vdb
    sleep 1
    vkt write sphere.nrrd b.vdb
    cmp a.vdb b.vdb
    vkt read a.vdb | vkt write c.vdb
    vkt read b.vdb | vkt write d.vdb
    cmp c.vdb d.vdb
    uuid() { dd if="$1" bs=1 skip=21 count=36 status=none; }
    [[ "$(uuid a.vdb)" =~ ^[0-9a-f]{8}-[0-9a-f]{4}-8[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}$ ]]
    vkt arith add sphere.nrrd 1 | vkt write e.vdb
    [ "$(uuid a.vdb)" != "$(uuid e.vdb)" ]
    # What OpenVDB thinks of it.
    if /usr/bin/python3 -c 'import pyopenvdb' 2>/dev/null; then
        /usr/bin/python3 -c "import pyopenvdb as v; v.readAll('a.vdb')"
    fi
}

@test "the history is kept, of grids and of trees" {
    vkt read sphere.nrrd | vkt flip x | vkt write flipped.vdb
    vkt history flipped.vdb >got
    cat got
    grep -q 'vkt make sphere' got
    grep -q 'vkt flip x' got
    vkt make amr --blocks 20 --levels 2 | vkt write tree.vdb
    vkt history tree.vdb | grep -q 'vkt make amr --blocks 20 --levels 2'
    # And travels on.
    vkt read flipped.vdb | vkt resample --method nearest | vkt history | grep -q 'vkt flip x'
}

@test "value map, units and attributes come back" {
    vkt convert sphere.nrrd --dtype float32 | vkt set --slope 2 --intercept -10 --units HU --attribute patient=none -o mapped.nrrd
    vkt write mapped.nrrd mapped.vdb
    vkt info mapped.vdb --json >info.json
    grep -q '"slope": 2.0' info.json
    grep -q '"intercept": -10.0' info.json
    grep -q '"units": "HU"' info.json
    grep -q '"patient":"none"' info.json
    # Stored zeros are left out, which stand for -10.
    grep -q '"background":"-10' info.json
    dense mapped.vdb | vkt diff - mapped.nrrd
    vkt write mapped.nrrd all.vdb --background 5000
    [ "$(stat -c %s mapped.vdb)" -lt "$(stat -c %s all.vdb)" ]
    vkt read mapped.vdb | vkt flip x | vkt info --json | grep -q '"slope": 2.0'
}

@test "a background other than 0 is left out and comes back" {
    vkt arith add sphere.nrrd 5 -o five.nrrd
    vkt write five.nrrd zero.vdb
    vkt write five.nrrd five.vdb --background 5
    [ "$(stat -c %s five.vdb)" -lt "$(stat -c %s zero.vdb)" ]
    dense five.vdb | vkt diff - five.nrrd
    dense zero.vdb | vkt diff - five.nrrd
}

@test "a volume that is all background comes back; a grid of which nothing is known is refused" {
    for dims in '12 10 9' '1 1 1' '300 5 8'; do
        # shellcheck disable=SC2086
        vkt make constant --dims $dims --dtype float32 --value 0.5 | vkt set --spacing 0.5,1,2 --origin 3,-4,5 -o c.nrrd --force
        vkt write c.nrrd c.vdb --background 0.5 --force
        dense c.vdb | vkt diff - c.nrrd --geometry
        vkt convert c.nrrd --dtype float32 | vkt arith mul - 0 | vkt write zero.vdb --force
        dense zero.vdb | vkt stats --json | tr -d ' \n' | grep -q '"max":0,'
    done
    python_with pyopenvdb
    /usr/bin/python3 -c "
import pyopenvdb as vdb
grid = vdb.FloatGrid(background=3)
grid.name = 'none'
vdb.write('none.vdb', grids=[grid])"
    fails_with 3 "grid 'none' is empty" vkt stats none.vdb
}

@test "pruning stays within its tolerance and saves room" {
    vkt make marschner-lobb --dims 48 48 48 -o ml.nrrd
    vkt write ml.nrrd whole.vdb
    vkt write ml.nrrd pruned.vdb --prune 0.125
    [ "$(stat -c %s pruned.vdb)" -lt "$(stat -c %s whole.vdb)" ]
    dense pruned.vdb | vkt diff - ml.nrrd --tolerance 0.125
    run vkt diff --tolerance 0.01 <(dense pruned.vdb) ml.nrrd
    [ "$status" -eq 1 ]
    fails_with 2 'prune' vkt write ml.nrrd bad.vdb --prune -1
    [ ! -e bad.vdb ]
}

@test "options of OpenVDB are refused elsewhere" {
    fails_with 2 '' vkt write sphere.nrrd out.nrrd --prune 0.1
    fails_with 2 '' vkt write sphere.nrrd out.nrrd --background 1
    [ ! -e out.nrrd ]
}

@test "OpenVDB's Python module reads what vkt writes" {
    python_with pyopenvdb numpy
    vkt write sphere.nrrd sphere.vdb
    vkt read sphere.nrrd | vkt write - --format raw >sphere.raw
    /usr/bin/python3 -c "
import numpy as np, pyopenvdb as vdb
grid = vdb.readAll('sphere.vdb')[0][0]
a = np.zeros((40, 36, 32), np.float32)
grid.copyToArray(a)
b = np.fromfile('sphere.raw', np.float32).reshape(32, 36, 40).transpose(2, 1, 0)
assert (a == b).all()
assert np.allclose(grid.transform.indexToWorld((2, 3, 4)), (3 + 0.5 * 2, -4 + 3, 5 + 2 * 4))"
}

@test "vkt reads what OpenVDB's Python module writes" {
    python_with pyopenvdb numpy
    /usr/bin/python3 -c "
import numpy as np, pyopenvdb as vdb
rng = np.random.default_rng(1)
a = rng.random((30, 20, 17)).astype(np.float32)
a[8:24, 8:16] = 0
first = vdb.FloatGrid(background=0)
first.copyFromArray(a, ijk=(-5, 4, 9))
first.name = 'first'
first.transform = vdb.createLinearTransform(voxelSize=0.25)
second = vdb.FloatGrid(background=7)
second.fill((0, 0, 0), (63, 63, 63), 3.0)
second.name = 'second'
vdb.write('two.vdb', grids=[first, second])
a.transpose(2, 1, 0).tofile('first.raw')"
    vkt info two.vdb --json >info.json || true
    vkt read two.vdb --variable first | vkt resample --method nearest -o first.nrrd
    vkt read first.nrrd | vkt write - --format raw | cmp - first.raw
    vkt info first.nrrd --json | grep -q '"origin": \[-1.25,1.0,2.25\]'
    vkt read two.vdb --variable second | vkt resample --method nearest | vkt stats --json >s.json
    grep -q '"count": 262144,' s.json
    grep -q '"min": 3,' s.json
    grep -q '"max": 3,' s.json
    fails_with 2 'third' vkt read two.vdb --variable third
}

@test "what others say of a grid or its file is read, and written again with its type" {
    python_with pyopenvdb
    /usr/bin/python3 -c "
import pyopenvdb as vdb
grid = vdb.FloatGrid(background=0)
grid.fill((0, 0, 0), (7, 7, 7), 3.0)
grid.name, grid.creator = 'smoke', 'a program'
for key, value in {'author': 'somebody', 'exposure': 0.1, 'frame': 7, 'looped': True, 'wind': (0.1, 0.2, -3.0)}.items():
    grid[key] = value
vdb.write('foreign.vdb', grids=[grid], metadata={'scene': 'kitchen', 'author': 'of the file'})"
    vkt info foreign.vdb --json | python3 -c '
import json, sys
a = json.load(sys.stdin)["attributes"]
expected = {"author": "somebody", "scene": "kitchen", "frame": "7", "looped": "true", "creator": "a program"}
assert expected.items() <= a.items() and float(a["exposure"]) == 0.1, a
assert [float(w) for w in a["wind"].split()] == [0.1, 0.2, -3], a'
    vkt read foreign.vdb | vkt set --attribute note=new | vkt write back.vdb
    vkt read foreign.vdb | vkt resample --method nearest | vkt write dense.vdb
    /usr/bin/python3 -c "
import pyopenvdb as vdb
before = vdb.readAllGridMetadata('foreign.vdb')[0]
for name in ('back.vdb', 'dense.vdb'):
    grid = vdb.readAllGridMetadata(name)[0]
    for key in ('author', 'exposure', 'frame', 'looped', 'wind', 'creator'):
        assert grid[key] == before[key] and type(grid[key]) == type(before[key]), (name, key, grid[key])
    assert grid['scene'] == 'kitchen'
    assert name != 'back.vdb' or grid['note'] == 'new'"
}

@test "holes are background: a sparse grid on a coarse grid keeps its integral" {
    python_with pyopenvdb numpy
    /usr/bin/python3 -c "
import numpy as np, pyopenvdb as vdb
rng = np.random.default_rng(2)
grids = []
for name, background in (('zero', 0.0), ('three', 3.0)):
    a = np.full((61, 47, 53), background, np.float32)
    for corner in ((0, 0, 0), (30, 20, 11), (55, 41, 47)):
        a[tuple(slice(c, c + 6) for c in corner)] = rng.random((6, 6, 6)) + 1
    grid = vdb.FloatGrid(background=background)
    grid.copyFromArray(a, tolerance=0)
    grid.prune()
    grid.name = name
    grid.transform = vdb.createLinearTransform(voxelSize=0.5)
    grids.append(grid)
    a.transpose(2, 1, 0).astype(np.float64).tofile(name + '.raw')
vdb.write('sparse.vdb', grids=grids)"
    for name in zero three; do
        for method in average auto; do
            vkt read sparse.vdb --variable $name | vkt resample --dims 5 5 5 --method $method -o coarse.nrrd --force
            vkt write coarse.nrrd - --format raw >coarse.raw
            vkt read sparse.vdb --variable $name | vkt stats --json >stats.json
            vkt info coarse.nrrd --json >info.json
            /usr/bin/python3 -c "
import json, numpy as np
a = np.fromfile('$name.raw').reshape(53, 47, 61)
def mean(a, axis): # of intervals that cut voxels
    n = a.shape[axis]
    sums = np.moveaxis(np.concatenate([np.zeros_like(a.take([0], axis)), a.cumsum(axis)], axis), axis, 0)
    at = np.linspace(0, n, 6)
    low = np.minimum(at.astype(int), n - 1)
    held = sums[low] + (sums[low + 1] - sums[low]) * (at - low).reshape(-1, 1, 1)
    return np.moveaxis(np.diff(held, axis=0) * 5 / n, 0, axis)
want = mean(mean(mean(a, 0), 1), 2)
got = np.fromfile('coarse.raw', np.float32).reshape(5, 5, 5)
assert abs(got - want).max() < 1e-6 * abs(want).max(), abs(got - want).max()
i, s = json.load(open('info.json')), json.load(open('stats.json'))
assert i['dims'] == [5, 5, 5], i
background = {'zero': 0, 'three': 3}['$name']
integral = got.astype(float).sum() * np.prod(i['spacing'])
outside = background * (a == background).sum() / 8
assert abs(integral - outside - s['weighted_sum']) < 1e-5 * s['weighted_sum'], (integral, s)"
        done
    done
}

@test "auto keeps the integral of a sparse grid at any resolution, also finer than its cells" {
    python_with pyopenvdb numpy
    /usr/bin/python3 -c "
import numpy as np, pyopenvdb as vdb
rng = np.random.default_rng(4)
grids = []
for name, background in (('zero', 0.0), ('three', 3.0)):
    grid = vdb.FloatGrid(background=background)
    a = (rng.random((10, 10, 10)) + 1).astype(np.float32)
    for corner in ((3, 0, 0), (30, 20, 11), (50, 41, 47)):
        grid.copyFromArray(a, ijk=corner)
    grid.fill((64, 0, 0), (71, 7, 7), background + 1.5) # a leaf all of one value becomes a tile of one coarse cell
    grid.prune()
    grid.name = name
    grids.append(grid)
vdb.write('sparse.vdb', grids=grids)"
    for name in zero three; do
        vkt read sparse.vdb --variable $name -o $name.vkt
        vkt stats $name.vkt --json >stats.json
        for scale in 0.08 0.3 0.77 1 1.3 2 2.6; do
            vkt resample $name.vkt --scale $scale --method auto -o grid.nrrd --force
            vkt write grid.nrrd - --format raw >grid.raw
            vkt info grid.nrrd --json >info.json
            /usr/bin/python3 -c "
import json, numpy as np
s, i = json.load(open('stats.json')), json.load(open('info.json'))
background = {'zero': 0, 'three': 3}['$name']
above = (np.fromfile('grid.raw', np.float32).astype(float) - background).sum() * np.prod(i['spacing'])
want = s['weighted_sum'] - background * s['volume']
print('$name $scale', above / want - 1)
assert abs(above - want) < 1e-6 * abs(want), (above, want)"
        done
    done
}

@test "statistics are those of the active voxels, not of the blocks they are stored in" {
    python_with pyopenvdb numpy
    /usr/bin/python3 -c "
import json, numpy as np, pyopenvdb as vdb
rng = np.random.default_rng(3)
z, y, x = np.mgrid[:30, :26, :22] - 9.5
ball = x * x + y * y + z * z < 70
values = np.where(ball, rng.normal(5, 1, ball.shape), -2).astype(np.float32)
density = vdb.FloatGrid(background=-2)
density.copyFromArray(values.transpose(2, 1, 0), ijk=(-7, 3, 5))
mask = vdb.BoolGrid()
mask.copyFromArray(ball.transpose(2, 1, 0))
filled = vdb.DoubleGrid() if hasattr(vdb, 'DoubleGrid') else vdb.FloatGrid()
filled.fill((3, 4, 5), (6, 7, 200), 1.5)
for grid, name in ((density, 'density'), (mask, 'mask'), (filled, 'filled')):
    grid.name = name
    grid.transform = vdb.createLinearTransform(voxelSize=0.25)
    vdb.write(name + '.vdb', grids=[grid])
vdb.write('all.vdb', grids=[density, mask, filled])
v = values[ball].astype(float)
at = np.argwhere(ball & (values == values[ball].max()))[0][::-1]
json.dump({'density': [density.activeVoxelCount(), v.mean(), v.var(), v.min(), v.max(), [int(c) for c in at]],
           'mask': [mask.activeVoxelCount(), 1, 0, 1, 1, None], 'filled': [4 * 4 * 196, 1.5, 0, 1.5, 1.5, None]}, open('want.json', 'w'))"
    for name in density mask filled; do
        vkt stats $name.vdb --json >direct.json
        vkt read all.vdb --variable $name --transport pipe | vkt stats --json | cmp - direct.json
        vkt resample $name.vdb --method nearest | vkt info --json >info.json
        /usr/bin/python3 -c "
import json
s, i = json.load(open('direct.json')), json.load(open('info.json'))
count, mean, variance, low, high, at = json.load(open('want.json'))['$name']
assert s['count'] == count and s['min'] == low and s['max'] == high, (s, count)
for kind in ('', 'weighted_'):
    assert abs(s[kind + 'mean'] - mean) < 1e-12 * abs(mean), s
    assert abs(s[kind + 'variance'] - variance) < 1e-10, s
assert abs(s['volume'] - count / 64) < 1e-9 * s['volume'], s
assert abs(s['weighted_sum'] - mean * count / 64) < 1e-9 * s['weighted_sum'], s"
    done
    # And of a part, and of what arithmetic makes of it; holes follow.
    for name in density mask; do
        vkt read all.vdb --variable $name | vkt arith add 3 -o more.vkt --force
        vkt stats more.vkt --json >more.json
        vkt stats $name.vdb --json >was.json
        /usr/bin/python3 -c "
import json
s, m = json.load(open('was.json')), json.load(open('more.json'))
assert m['count'] == s['count'] and abs(m['mean'] - s['mean'] - 3) < 1e-6, (s, m)"
        vkt resample more.vkt --method nearest | vkt write - --format raw >a
        vkt resample $name.vdb --method nearest | vkt arith add 3 | vkt write - --format raw | cmp - a
    done
    # Values that stand for others: the holes do too.
    vkt set density.vdb --slope 2 --intercept 1 | vkt info | grep 'background: -3'
}

@test "info of several grids tells the extent of their active voxels" {
    python_with pyopenvdb numpy
    /usr/bin/python3 -c "
import pyopenvdb as vdb
a, b, c = vdb.FloatGrid(), vdb.FloatGrid(), vdb.FloatGrid()
a.fill((-3, 0, 2), (6, 4, 5), 1.0)
b.fill((0, 0, 0), (99, 1, 1), 2.0)
for grid, name in ((a, 'a'), (b, 'b'), (c, 'c')):
    grid.name = name
    grid.transform = vdb.createLinearTransform(voxelSize=0.5)
vdb.write('grids.vdb', grids=[a, b, c])"
    vkt info grids.vdb >info
    cat info
    grep -x 'dims       103 5 6' info
    grep -x 'spacing    0.5 0.5 0.5' info
    grep -x 'origin     -1.5 0 0' info
    grep 'variable a: float32, 200 active voxels in 10 5 4 from -3 0 2' info
    grep 'variable b: float32, 400 active voxels in 100 2 2 from 0 0 0' info
    grep 'variable c: float32, 0 active voxels' info
    vkt read grids.vdb --variable a | vkt info | grep -x 'region     10 5 4'
}

@test "info names the grids that are not read" {
    python_with pyopenvdb
    /usr/bin/python3 -c "
import pyopenvdb as vdb
a, v, b = vdb.FloatGrid(), vdb.Vec3SGrid(), vdb.FloatGrid()
a.fill((0, 0, 0), (6, 4, 5), 1.0)
v.fill((0, 0, 0), (6, 4, 5), (1.0, 2.0, 3.0))
a.name, v.name, b.name = 'a', 'v', 'b'
vdb.write('one.vdb', grids=[a, v])
vdb.write('two.vdb', grids=[a, v, b])
vdb.write('vectors.vdb', grids=[v])
vdb.write('scalars.vdb', grids=[a, b])"
    for file in one two; do
        vkt info $file.vdb | grep -x "not read   grid 'v' of type vec3s"
        vkt info $file.vdb --json | /usr/bin/python3 -c '
import json, sys
assert json.load(sys.stdin)["not_read"] == ["grid '"\'v\'"' of type vec3s"]'
    done
    vkt info scalars.vdb >info
    run ! grep 'not read' info
    run ! vkt info vectors.vdb
    # It is said of the file, and no attribute of what is made of it.
    vkt resample one.vdb --method nearest -o one.nrrd
    run ! grep -a vec3s one.nrrd
}

@test "damaged files are refused" {
    head -c 300 probe.vdb >cut.vdb
    fails_with 3 'cut.vdb' vkt read cut.vdb
    printf 'not a grid' >text.vdb
    fails_with 3 'text.vdb' vkt read text.vdb
}

@test "a level set is read with its class, its background and the distances in its band" {
    python_with pyopenvdb numpy
    /usr/bin/python3 -c "
import pyopenvdb as vdb
ball = vdb.createLevelSetSphere(radius=8, voxelSize=0.5, center=(1, 2, 3))
ball.name = 'ball'
vdb.write('ball.vdb', grids=[ball])"
    vkt info ball.vdb >info
    grep -q 'class: level set' info
    grep -q 'background: 1.5' info
    vkt read ball.vdb | vkt resample --method nearest -o ball.nrrd
    vkt read ball.nrrd | vkt write - --format raw >ball.raw
    vkt info ball.nrrd --json >info.json
    /usr/bin/python3 -c "
import json, numpy as np
i = json.load(open('info.json'))
a = np.fromfile('ball.raw', np.float32).reshape(i['dims'][::-1])
z, y, x = (i['origin'][k] + i['spacing'][k] * np.arange(i['dims'][k]) for k in (2, 1, 0))
d = np.sqrt((z[:, None, None] - 3) ** 2 + (y[:, None] - 2) ** 2 + (x - 1) ** 2) - 8
# Exact within the band, and inside and outside of it the half width with the right sign.
assert np.abs(a - np.clip(d, -1.5, 1.5)).max() < 1e-5, np.abs(a - np.clip(d, -1.5, 1.5)).max()"
}

@test "grids of points are refused, and what to do is said" {
    # OpenVDB's Python module makes none: a grid of floats whose entry in the table of grids says that it is of points.
    /usr/bin/python3 -c "
import struct
b = open('probe.vdb', 'rb').read()
def word(s): return struct.pack('<I', len(s)) + s
old, new = word(b'Tree_float_5_4_3'), word(b'Tree_ptdataidx32_5_4_3')
at = b.index(old) + len(old)
parent = at + 4 + struct.unpack('<I', b[at:at + 4])[0]
places = [p + len(new) - len(old) for p in struct.unpack('<3q', b[parent:parent + 24])]
open('points.vdb', 'wb').write(b[:at].replace(old, new) + b[at:parent] + struct.pack('<3q', *places) + b[parent + 24:])"
    fails_with 3 "holds points" vkt read points.vdb
    [[ "$stderr" == *"rasterize the points"* ]]
    fails_with 3 "holds points" vkt read points.vdb --variable density
}

@test "a grid written again keeps its background, and ':' is all of it" {
    python_with pyopenvdb
    /usr/bin/python3 -c "
import pyopenvdb as vdb
grid = vdb.createLevelSetSphere(5, voxelSize=0.5)
grid.name = 'ls'
vdb.write('ls.vdb', grids=[grid])"
    vkt write ls.vdb again.vdb
    /usr/bin/python3 -c "
import pyopenvdb as vdb
a, b = (vdb.read(n, 'ls').background for n in ('ls.vdb', 'again.vdb'))
assert a == b == 1.5, (a, b)"
    diff <(vkt stats ls.vdb) <(vkt stats again.vdb)
    vkt crop ls.vdb --roi :,:,: | vkt stats | diff - <(vkt stats ls.vdb)
    vkt resample ls.vdb --roi :,:,: --method nearest -o a.nrrd
    vkt resample ls.vdb --method nearest | vkt diff - a.nrrd
}

@test "a volume that OpenVDB has no room for is refused before it is read" {
    vkt make constant --dims 512 512 1 --dtype uint8 -o flat.nrrd
    vkt write flat.nrrd flat.vdb
    fails_with 5 "OpenVDB needs 8.2 MiB" vkt write flat.nrrd small.vdb --memory 4M
    # Of trees what their cells make: those of level 1 are 8 voxels each.
    vkt make amr --blocks 600 --levels 5 --block-size 16 -o tree.vkt
    fails_with 5 "OpenVDB needs 73.4 MiB" vkt write tree.vkt tree.vdb --memory 16M
    [ ! -e tree.vdb ]
    [ ! -e small.vdb ]
}

@test "a full disk is an error, and leaves nothing" {
    mkdir small
    mount -t tmpfs -o size=1m tmpfs small 2>/dev/null || skip "a tmpfs cannot be mounted here"
    vkt make noise --dims 100 100 100 -o noise.nrrd
    failed=0
    fails_with 4 "cannot write 'small/a.vdb': no space left" vkt write noise.nrrd small/a.vdb || failed=1
    fails_with 4 "no space left" bash -c 'vkt make noise --dims 200 200 200 | vkt write small/b.vdb' || failed=1
    [ -z "$(ls -A small)" ] || failed=1
    umount small
    [ $failed -eq 0 ]
    run bash -c 'ulimit -f 1000; vkt write noise.nrrd d.vdb'
    [[ "$status" -eq 4 && "$output" == *"'d.vdb'"*"too large"* ]]
    [ ! -e d.vdb ]
}

@test "what a crop has cut off does not come back with a file" {
    vkt make noise --dims 40 30 20 --spacing 2 | vkt refine --tolerance 0 2>/dev/null | vkt crop --roi 5:35,6:24,3:17 -o cut.vkt
    vkt write cut.vkt cut.vdb
    [ "$(vkt stats cut.vdb --json | jq .count)" = 7560 ]
    vkt resample cut.vkt --scale 1 -o grid.nrrd
    vkt resample cut.vdb --scale 1 | vkt diff - grid.nrrd --geometry
    # The same of a part that begins inside of the first brick kept, and once more.
    vkt crop cut.vkt --roi 20:30,9:20,10:12 | vkt write - part.vdb
    vkt write part.vdb again.vdb
    vkt crop grid.nrrd --roi 15:25,3:14,7:9 -o want.nrrd
    vkt resample again.vdb --scale 1 | vkt diff - want.nrrd --geometry
}
