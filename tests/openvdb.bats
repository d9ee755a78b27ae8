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
    grep -q '"slope": 2.0' info.json && grep -q '"intercept": -10.0' info.json
    grep -q '"units": "HU"' info.json && grep -q '"patient":"none"' info.json
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
