# vkt crop: boxes in voxels, in the world, and like another volume.
load helper

setup_more() {
    /usr/bin/python3 -c "
import random, sys
random.seed(4)
sys.stdout.buffer.write(bytes(random.randrange(256) for _ in range(11 * 8 * 6 * 2)))" >v_11x8x6_int16.raw
    vkt set v_11x8x6_int16.raw --spacing 0.5,1,2 --origin 10,20,30 -o v.nrrd
}

raw() { vkt read "${1:--}" | vkt write - --format raw; }

@test "a box agrees with numpy, from files, pipes and slabs" {
    python_with numpy
    /usr/bin/python3 -c "
import numpy as np
np.fromfile('v_11x8x6_int16.raw', np.int16).reshape(6, 8, 11)[1:5, 2:8, 3:10].copy().tofile('want.raw')"
    vkt crop v.nrrd --roi 3:10,2:,1:-1 | raw >a.raw
    cmp a.raw want.raw
    for slab in 1 2 6; do
        vkt read v_11x8x6_int16.raw --slab $slab | vkt crop --roi 3:+7,2:8,1:5 --slab $slab | raw | cmp - want.raw
    done
}

@test "voxels keep their world positions" {
    vkt crop v.nrrd --roi 3:10,2:,1:-1 | vkt info >info
    grep -x 'dims       7 6 4' info
    grep -x 'origin     11.5 22 32' info
}

@test "a region in world units takes the voxels whose centres lie inside" {
    vkt crop v.nrrd --roi-world 11.2:12.6,:,31:35.5 | vkt info >info
    grep -x 'dims       3 8 2' info # x 11.5 12 12.5, z 32 34
    grep -x 'origin     11.5 20 32' info
    fails_with 2 '' vkt crop v.nrrd --roi-world 100:200,:,: -o out.nrrd
    vkt crop v.nrrd --roi-world -inf:inf,:,31:inf | vkt info >info
    grep -x 'dims       11 8 5' info
    fails_with 2 'does not meet' vkt crop v.nrrd --roi-world inf:,:,: -o out.nrrd
}

@test "like another volume: its part, at any resolution, mirrored or not" {
    vkt crop v.nrrd --roi 3:10,2:7,1:4 -o part.nrrd
    vkt crop v.nrrd --like part.nrrd | raw | cmp - <(raw part.nrrd)
    # A stream in a file, or from a pipe.
    vkt read part.nrrd -o part.vkt
    vkt crop v.nrrd --like part.vkt | raw | cmp - <(raw part.nrrd)
    vkt crop v.nrrd --like <(vkt read part.nrrd) | raw | cmp - <(raw part.nrrd)
    vkt read v.nrrd | vkt crop --like <(vkt read part.nrrd) --timing 2>table | raw | cmp - <(raw part.nrrd)
    vkt resample part.nrrd --scale 2 -o fine.nrrd
    vkt crop v.nrrd --like fine.nrrd | raw | cmp - <(raw part.nrrd)
    vkt flip y part.nrrd -o mirrored.nrrd
    vkt crop v.nrrd --like mirrored.nrrd | raw | cmp - <(raw part.nrrd)
    vkt set part.nrrd --origin 1000,0,0 -o far.nrrd
    fails_with 2 'does not overlap' vkt crop v.nrrd --like far.nrrd -o out.nrrd
    [ ! -e out.nrrd ]
}

@test "crop of the whole is the identity, of a crop the sum of both" {
    vkt crop v.nrrd --roi :,:,: | raw | cmp - v_11x8x6_int16.raw
    vkt crop v.nrrd --roi 2:,1:,1: | vkt crop --roi 3:6,2:5,1:3 | raw >a.raw
    vkt crop v.nrrd --roi 5:8,3:6,2:4 | raw | cmp - a.raw
}

@test "bounds that cannot be counted are refused" {
    fails_with 2 'out of range' vkt crop v.nrrd --roi 9223372036854775807,:,: -o out.nrrd
    fails_with 2 'out of range' vkt crop v.nrrd --roi=-9223372036854775808:,:,: -o out.nrrd
    fails_with 2 'out of range' vkt crop v.nrrd --roi 1:+9223372036854775807,:,: -o out.nrrd
    fails_with 2 'not a number of voxels' vkt crop v.nrrd --roi 3:+-5,:,: -o out.nrrd
    [ ! -e out.nrrd ]
}

@test "boxes that are empty, inverted or outside are refused" {
    for roi in 3:3,:,: 5:2,:,: 0:12,:,: 11:,:,: -12:,:,:; do
        fails_with 2 '' vkt crop v.nrrd --roi="$roi" -o out.nrrd
        [ -n "$stderr" ]
    done
    vkt crop v.nrrd --roi 10:11,7:8,5:6 | vkt info | grep -x 'dims       1 1 1'
    fails_with 2 'no region given' vkt crop v.nrrd -o out.nrrd
    fails_with 2 'more than one region' vkt crop v.nrrd --roi 0:1,:,: --roi-world 0:1,:,: -o out.nrrd
}

# boxes PYTHON: runs it with crop(options), the box that vkt keeps of v.nrrd or another file, and centres(directions).
boxes() {
    python_with numpy
    /usr/bin/python3 - <<PY
import json, subprocess, numpy as np
def run(*words): return subprocess.run(words, capture_output=True, text=True)
def crop(file, *options):
    "Dims and first voxel kept, or None if there is none."
    done = run("vkt", "crop", file, *options, "-o", "part.vkt", "--force")
    if done.returncode == 2: return None
    assert done.returncode == 0, done.stderr
    i = json.loads(run("vkt", "info", "part.vkt", "--json").stdout)
    return i["dims"], i["origin"]
def turned(random):
    q = np.linalg.qr(random.normal(size=(3, 3)))[0]  # columns are world directions of the axes
    return q, ",".join(repr(float(v)) for v in q.T.ravel())
def centres(dims, origin, spacing, q):
    at = np.indices(dims).reshape(3, -1)  # x, y, z
    return at, np.array(origin)[:, None] + q @ (np.array(spacing)[:, None] * at)
$1
PY
}

@test "a region in world units keeps the smallest box of the voxels inside, however oblique" {
    boxes '
random = np.random.default_rng(5)
tried = 0
for n in range(12):
    q, words = turned(random)
    run("vkt", "set", "v.nrrd", "--direction", words, "-o", "o.nrrd", "--force")
    at, world = centres((11, 8, 6), (10, 20, 30), (0.5, 1, 2), q)
    middle = world[:, random.integers(world.shape[1])]
    low, high = middle - random.uniform(0.1, 4, 3), middle + random.uniform(0.1, 4, 3)
    inside = ((world > low[:, None]) & (world < high[:, None])).all(0)
    for axes in ((0, 1, 2), (n % 3,)):  # the rest open
        if len(axes) == 1: inside = (world[n % 3] > low[n % 3]) & (world[n % 3] < high[n % 3])
        first, last = at[:, inside].min(1), at[:, inside].max(1)
        region = ",".join(f"{low[a]!r}:{high[a]!r}".replace("np.float64(", "").replace(")", "") if a in axes else ":" for a in range(3))
        dims, origin = crop("o.nrrd", "--roi-world=" + region)
        assert dims == (last - first + 1).tolist(), (n, region, dims, first, last)
        assert np.allclose(origin, np.array((10, 20, 30)) + q @ (first * (0.5, 1, 2))), (n, origin)
        tried += 1
# A region between voxels holds none.
q, words = turned(random)
run("vkt", "set", "v.nrrd", "--direction", words, "-o", "o.nrrd", "--force")
at, world = centres((11, 8, 6), (10, 20, 30), (0.5, 1, 2), q)
between = (np.array((10, 20, 30)) + q @ (np.array((4.5, 3.5, 2.5)) * (0.5, 1, 2))).tolist()
assert crop("o.nrrd", "--roi-world=" + ",".join(f"{v - 0.05!r}:{v + 0.05!r}" for v in between)) is None
assert tried == 24'
}

@test "like a turned volume: the smallest box of the voxels between its faces" {
    boxes '
random = np.random.default_rng(6)
for n in range(8):
    q, words = turned(random)
    run("vkt", "set", "v.nrrd", "--direction", words, "-o", "o.nrrd", "--force")
    p, words = turned(random)
    origin = np.array((10, 20, 30)) + q @ (np.array((3, 3, 2)) * (0.5, 1, 2))
    run("sh", "-c", "vkt make ramp --dims 3 2 4 --spacing 1,1.5,0.8 --origin=" + ",".join(repr(float(v)) for v in origin) +
        " | vkt set --direction=" + words + " -o like.nrrd --force")
    at, world = centres((11, 8, 6), (10, 20, 30), (0.5, 1, 2), q)
    u = (p.T @ (world - origin[:, None])) / np.array((1, 1.5, 0.8))[:, None]
    inside = ((u >= -0.5) & (u < np.array((3, 2, 4))[:, None] - 0.5)).all(0)
    first, last = at[:, inside].min(1), at[:, inside].max(1)
    dims, start = crop("o.nrrd", "--like", "like.nrrd")
    assert dims == (last - first + 1).tolist(), (n, dims, first, last)'
}

@test "like a volume in another anatomical frame: the same part" {
    vkt set v.nrrd --attribute space=left-posterior-superior -o v_lps.nrrd
    vkt crop v_lps.nrrd --roi 3:10,2:7,1:4 -o part.nrrd
    vkt set part.nrrd --origin -11.5,-22,32 --direction=-1,0,0,0,-1,0,0,0,1 --attribute space=RAS -o part_ras.nrrd
    vkt crop v_lps.nrrd --like part_ras.nrrd | vkt diff part.nrrd --geometry
    vkt write part_ras.nrrd part_ras.mha # in LPS
    vkt set v.nrrd --origin -10,-20,30 --direction=-1,0,0,0,-1,0,0,0,1 --attribute space=right-anterior-superior -o v_ras.nrrd
    vkt crop v_ras.nrrd --like part_ras.mha | vkt diff part.nrrd --geometry
    fails_with 2 'mean different things' vkt crop v.nrrd --like part.nrrd -o out.nrrd
    fails_with 2 'mean different things' vkt crop v_lps.nrrd --like v.nrrd -o out.nrrd
    [ ! -e out.nrrd ]
}

@test "steps are NumPy's: phase, extent, places; of files, pipes and slabs, read and cropped" {
    python_with numpy
    vkt read v.nrrd | vkt write v.nrrd.gz --format nrrd
    /usr/bin/python3 - <<'PY'
import json, subprocess
import numpy as np
v = np.fromfile("v_11x8x6_int16.raw", np.int16).reshape(6, 8, 11)
run = lambda line: subprocess.run(line, shell=True, check=True, capture_output=True).stdout
for text in ("::2,::2,::2", "1::3,:,:", "1:10:3,2:7:4,::5", "::99,:,1:6:2", ":,:,::2", ":-1:2,1:+6:2,3", "::1,:,:"):
    parts = []
    for range_, n in zip(text.split(","), (11, 8, 6)):
        ends = (range_ if ":" in range_ else f"{range_}:{int(range_) + 1}").split(":")
        low = int(ends[0] or 0)
        high = low + int(ends[1]) if ends[1].startswith("+") else int(ends[1]) if ends[1] else None
        parts.append(slice(low, high, int(ends[2]) if len(ends) > 2 else None))
    want = v[parts[2], parts[1], parts[0]]
    for line in (f"vkt crop v.nrrd --roi {text}", f"vkt read v.nrrd --roi {text}", f"vkt read v.nrrd.gz --roi {text}",
                 f"vkt read v.nrrd | vkt crop --roi {text} --slab 2", f"vkt read v.nrrd --slab 1 | vkt read --roi {text} --slab 1"):
        assert run(f"{line} | vkt write - --format raw") == want.tobytes(), line
        info = json.loads(run(f"{line} | vkt info --json"))
        assert info["dims"] == list(want.shape[::-1]), line
        steps = [p.step or 1 for p in parts]
        assert np.allclose(info["spacing"], [s * d for s, d in zip((0.5, 1, 2), steps)]), (line, info["spacing"])
        assert np.allclose(info["origin"], [o + s * p.start for o, s, p in zip((10, 20, 30), (0.5, 1, 2), parts)]), line
for dtype in ("uint8", "float32", "float64"):
    subprocess.run(f"vkt convert v.nrrd --dtype {dtype} -o t.nrrd --force -q", shell=True, check=True)
    whole = np.frombuffer(run("vkt write t.nrrd - --format raw"), dtype).reshape(v.shape)
    assert run("vkt crop t.nrrd --roi 1::2,::3,: | vkt write - --format raw") == whole[:, ::3, 1::2].tobytes(), dtype
PY
    # What was sampled lies where the field says: a ramp's values are its positions.
    vkt make ramp --dims 9 8 7 -o ramp.nrrd
    vkt crop ramp.nrrd --roi 1::2,::3,2::2 | vkt diff - <(vkt crop ramp.nrrd --roi 1:,:,2: | vkt crop --roi ::2,::3,::2)
    vkt crop v.nrrd --roi ::2,:,: | vkt history --as-shell | grep -q -- '--roi ::2,:,:'
    vkt read v.nrrd --roi ::2,:,: -o half.nrrd
    vkt history half.nrrd | grep -q 'crop --roi 0:11:2,0:8,0:6\|--roi ::2,:,:'
    fails_with 2 'a step of 0' vkt crop v.nrrd --roi ::0,:,: -o no.nrrd
    fails_with 2 'vkt flip reverses' vkt crop v.nrrd --roi ::-1,:,: -o no.nrrd
    fails_with 2 'with steps is no box' vkt fill v.nrrd --roi ::2,:,: -o no.nrrd
    vkt make amr --blocks 20 --levels 2 -o tree.vkt
    fails_with 2 'there is no every n-th one' vkt stats tree.vkt --roi ::2,:,:
    fails_with 2 'make it a grid first: vkt resample' vkt crop tree.vkt --roi ::2,:,: -o no.vkt
    fails_with 2 'there is no every n-th one' vkt read tree.vkt --roi ::2,:,: -o no.vkt
    for command in stats histogram 'threshold --above 0 -o no.vkt' 'diff tree.vkt' 'read -o no.vkt' dump 'mesh --iso 1 -o no.stl'; do
        # shellcheck disable=SC2086
        set -- $command
        fails_with 2 'make it a grid first: vkt resample' vkt "$1" tree.vkt "${@:2}" --roi ::2,:,:
    done
    # What that says works.
    vkt resample tree.vkt --cells 1k | vkt crop --roi ::2,::2,::2 | vkt stats >/dev/null
    [ ! -e no.nrrd ] && [ ! -e no.vkt ]
}

@test "several threads read the rows of large files: the same voxels, of one file or of many, in any order of bytes" {
    python_with numpy
    /usr/bin/python3 -c "
import numpy as np
v = np.random.default_rng(7).integers(0, 65536, (240, 250, 300)).astype('>u2')
v.tofile('big.raw')
for i in range(2):
    v[i * 120:(i + 1) * 120].tofile(f'part{i}.raw')
v[37:203, 20:249, 11:299].astype('<u2').tofile('want.raw')
v[125:203, 20:249, 11:299].astype('<u2').tofile('want_second.raw')
v[37:203, :, 299:].astype('<u2').tofile('want_column.raw')"
    header='NRRD0004\ntype: ushort\ndimension: 3\nsizes: 300 250 240\nencoding: raw\nendian: big'
    printf "$header\ndata file: big.raw\n" >one.nhdr
    printf "$header\ndata file: LIST\npart0.raw\npart1.raw\n" >two.nhdr
    for file in one.nhdr two.nhdr; do
        for threads in 1 16; do
            VKT_THREADS=$threads vkt crop $file --roi 11:299,20:249,37:203 --slab 100 | raw | cmp - want.raw
            VKT_THREADS=$threads vkt crop $file --roi 11:299,20:249,125:203 --slab 100 | raw | cmp - want_second.raw
            VKT_THREADS=$threads vkt crop $file --roi 299:,:,37:203 --slab 166 | raw | cmp - want_column.raw
        done
    done
    truncate -s -1000 part1.raw
    ! VKT_THREADS=16 vkt crop two.nhdr --roi 11:299,20:249,125: --slab 200 -o out.nrrd || false
    [ ! -e out.nrrd ]
}

@test "open bounds of a hierarchical volume are those of its own region, wherever it is cropped, and plans refuse what runs do" {
    vkt make noise --dims 40 30 20 --spacing 2 | vkt refine --tolerance 0.1 | vkt crop --roi 5:35,6:24,3:17 -o tree.vkt
    box() { vkt info --json "$@" | jq -r .attributes.roi; }
    while read -r roi want; do
        [ "$(vkt crop tree.vkt --roi "$roi" | box)" = "$want" ]
        [ "$(vkt crop tree.vkt --roi "$roi" -n 2>/dev/null | box)" = "$want" ]
        [ "$(vkt read tree.vkt --roi "$roi" | box)" = "$want" ]
        [ "$(vkt stats tree.vkt --roi "$roi" --json | jq .count)" = "$(vkt stats tree.vkt --roi "$want" --json | jq .count)" ]
        vkt resample tree.vkt --roi "$roi" | vkt diff - <(vkt resample tree.vkt --roi "$want")
    done <<'EOF2'
:,:,10: 5:35,6:24,10:17
:9,:,: 5:9,6:24,3:17
,7:,: 5:35,7:24,3:17
:50%,:20,:-5 5:20,6:20,3:15
EOF2
    # The world may stick out; so may another volume.
    [ "$(vkt crop tree.vkt --roi-world :,30:1000,: | box)" = 5:35,15:24,3:17 ]
    [ "$(vkt read tree.vkt --roi-world :,30:1000,: | box)" = 5:35,15:24,3:17 ]
    [ "$(vkt crop tree.vkt --like <(vkt make constant --dims 40 30 20 --spacing 2) | box)" = 5:35,6:24,3:17 ]
    for roi in 0:9,:,: :,:,:18 :4,:,:; do
        refused_and_foretold 2 "" vkt crop tree.vkt --roi "$roi"
        fails_with 2 "" vkt read tree.vkt --roi "$roi"
    done
    fails_with 2 "does not meet" vkt crop tree.vkt --roi-world 0:8,:,:
}
