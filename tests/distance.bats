# vkt distance: exact Euclidean distances, against SciPy, brute force and geometry.
load helper

# against_scipy CODE: Python with distance(values, options, spacing).
against_scipy() {
    python_with numpy scipy
    /usr/bin/python3 - <<EOF
import itertools, subprocess
import numpy as np
from scipy import ndimage

rng = np.random.default_rng(5)

def distance(values, options="", spacing=(1, 1, 1)):
    name = "v_%dx%dx%d_%s.raw" % (*values.shape[::-1], values.dtype)
    values.tofile(name)
    subprocess.run(f"vkt set {name} --spacing {spacing[0]},{spacing[1]},{spacing[2]} | vkt distance {options} |"
                   " vkt write out.raw --force", shell=True, check=True)
    return np.fromfile("out.raw", np.float32).reshape(values.shape)

def expected(values, spacing=(1, 1, 1)):
    return ndimage.distance_transform_edt(values != 0, sampling=spacing[::-1])
$1
EOF
}

@test "distances are SciPy's, for odd extents, from crowds of zeros to a single one" {
    against_scipy '
for shape in ((23, 29, 37), (70, 5, 64), (130, 13, 1), (11, 1, 130), (1, 61, 65), (1, 1, 1), (3, 1, 200)):
    for share in (0.4, 0.01, 0.0002, 0):
        a = (rng.random(shape) >= share).astype(np.uint8)
        a[-1, -1, -1] = 0
        # Squares of whole numbers: correctly rounded, nothing else will do.
        assert (distance(a) == expected(a).astype(np.float32)).all(), (shape, share)
        if not a.any():
            continue
        want = expected(a) - expected(a == 0)
        assert (distance(a, "--signed") == want.astype(np.float32)).all(), (shape, share)
'
}

@test "spacings may differ, and be no integers of each other" {
    against_scipy '
for spacing in ((1, 1, 5), (0.7, 0.7, 5), (0.3, 0.7, 2.1), (0.1, np.pi, 1.7), (1e-12, np.e * 1e-12, 2e-12),
                (1e12, 1e12, 3e12)):
    for share in (0.4, 0.01, 0):
        a = (rng.random((31, 45, 38)) >= share).astype(np.uint8)
        a[0, 0, 0] = 0
        for options in ("", "--signed"):
            want = expected(a, spacing) - (expected(a == 0, spacing) if options else 0)
            got = distance(a, options, spacing)
            assert (np.abs(got - want) <= 1.2e-7 * np.abs(want)).all(), (spacing, share, options)
    assert (distance(a, "--unit voxel", spacing) == expected(a).astype(np.float32)).all()
'
}

@test "one zero in each corner, against brute force" {
    against_scipy '
n = 24
index = np.stack(np.indices((n, n, n)), -1)
for corner in itertools.product((0, n - 1), repeat=3):
    a = np.ones((n, n, n), np.uint8)
    a[corner] = 0
    for spacing in ((1, 1, 1), (1, 1, 5), (0.3, 0.7, 2.1)):
        want = np.sqrt((((index - np.array(corner)) * np.array(spacing[::-1])) ** 2).sum(-1))
        assert np.allclose(distance(a, "", spacing), want, rtol=1.2e-7, atol=0)
'
}

@test "the distance field of a ball is that of geometry" {
    against_scipy '
z, y, x = np.indices((41, 43, 45)) - 20.0
ball = (x * x + y * y + z * z <= 15 ** 2).astype(np.uint8)
got = distance(ball, "--signed")
# Half a diagonal of a voxel is what the surface of voxels may be off.
assert np.abs(got - (15 - np.sqrt(x * x + y * y + z * z)))[:].max() < 1.8
assert (got != 0).all() and (np.sign(got) == np.where(ball, 1, -1)).all()
'
}

@test "every type; NaN is taken for zero, and told" {
    against_scipy '
for dtype in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    a = (rng.random((9, 8, 71)) < 0.8).astype(dtype)
    if a.dtype.kind != "u":
        a[::2] *= -1
    if a.dtype.kind == "f":
        a[1, 2, 3] = np.inf
    assert (distance(a) == expected(a).astype(np.float32)).all(), dtype
a = np.ones((9, 8, 71), np.float32)
a[4, 4, 7] = np.nan
assert (distance(a) == expected(np.nan_to_num(a)).astype(np.float32)).all()
'
    printf '\0\0\300\177\0\0\200\077' >n_2x1x1_float32.raw
    vkt distance n_2x1x1_float32.raw -o o.nrrd 2>err
    grep -q '1 of 2 voxels .* not a number' err
}

@test "volumes of one kind are infinitely far from the other, and that is told" {
    vkt make constant --dims 5 40 30 --value 3 | vkt distance -o full.nrrd 2>err
    grep -q 'distances are infinite' err
    vkt stats full.nrrd | grep -qx 'min  *inf'
    vkt make constant --dims 5 40 30 --value 0 | vkt distance --signed -o empty.nrrd
    vkt stats empty.nrrd | grep -qx 'max  *-inf'
    vkt make constant --dims 5 40 30 --value 0 | vkt distance -o empty.nrrd --force 2>err
    [ ! -s err ]
    vkt stats empty.nrrd | grep -qx 'max  *0'
    vkt make constant --dims 5 40 30 --value 3 | vkt set --spacing 1,3.14159,2.7 | vkt distance --signed -o full.nrrd --force
    vkt stats full.nrrd | grep -qx 'min  *inf'
}

@test "slabs, threads, pipes and consumers of parts make no difference; zero is the physical zero" {
    against_scipy '
a = (rng.random((53, 61, 70)) < 0.97).astype(np.uint8)
a.tofile("v_70x61x53_uint8.raw")
'
    vkt distance v_70x61x53_uint8.raw --signed --threads 1 --format raw -o want.raw
    for options in '--slab 1 --threads 2' '--slab 3 --threads 5' '--slab 7'; do
        # shellcheck disable=SC2086
        vkt read v_70x61x53_uint8.raw --slab 5 | vkt distance --signed $options | vkt write - --format raw | cmp - want.raw
    done
    vkt pipe 'read v_70x61x53_uint8.raw | distance --signed | crop --roi 3:-7,2:,9:40 | write part.raw'
    vkt distance v_70x61x53_uint8.raw --signed | vkt crop --roi 3:-7,2:,9:40 | vkt write - --format raw | cmp - part.raw
    # Physically 0 for what is stored as 1, and the other way round.
    vkt set v_70x61x53_uint8.raw --slope 2 --intercept -2 | vkt distance --signed | vkt arith mul - -1 |
        vkt write - --format raw | cmp - want.raw
    vkt distance v_70x61x53_uint8.raw | vkt info | grep -qx 'dtype  *float32'
}

@test "the error that is promised is kept" {
    vkt make sphere --dims 20 20 20 -o v.nrrd
    vkt distance v.nrrd --explain -o o.nrrd 2>plan
    grep -qi 'exact' plan
    vkt set v.nrrd --spacing 1,3.14159,2.7 | vkt distance --explain -o o2.nrrd 2>plan
    grep -q 'error at most' plan
}

@test "requests that make no sense are refused" {
    vkt make ramp --dims 4 4 4 -o v.nrrd
    fails_with 2 "'mile' is not one of" vkt distance v.nrrd --unit mile -o o.nrrd
    vkt set v.nrrd --direction 1,0,0,0.6,0.8,0,0,0,1 -o skewed.nrrd
    fails_with 2 'perpendicular' vkt distance skewed.nrrd -o o.nrrd
    [ ! -e o.nrrd ]
    vkt distance skewed.nrrd --unit voxel -o o.nrrd
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical volume' vkt distance t.vkt -o o.vkt
    # A few lines of 60000 voxels are more than 4 MiB.
    vkt make ramp --dims 20 6 60000 -o long.nrrd
    for dry in '' -n; do
        # shellcheck disable=SC2086
        fails_with 5 'distance on these volumes needs 38.6 MiB of memory at once' vkt distance long.nrrd --memory 4M -o o4.nrrd $dry
    done
    [ ! -e o.vkt ] && [ ! -e o4.nrrd ]
}

@test "what memory has no room for is spooled, with the same bits" {
    mkdir spool
    export TMPDIR=$PWD/spool
    local dims spacing options memory threads
    # Slabs; slices beyond the budget, and blocks of columns; one slice; one row along z.
    for dims in '150 100 120' '700 1030 9' '1100 1300 1' '1300 1 1100'; do
        # shellcheck disable=SC2086
        vkt make noise --dims $dims --dtype uint8 --seed 3 | vkt threshold --above 5 -o mask.nrrd --force
        while read -r spacing options; do
            vkt set mask.nrrd --spacing "$spacing" -o in.nrrd --force
            # shellcheck disable=SC2086
            vkt distance in.nrrd $options --memory 1G --threads 1 --format raw -o want.raw --force
            while read -r memory threads; do
                # shellcheck disable=SC2086
                vkt distance in.nrrd $options --memory $memory --threads $threads --format raw -o got.raw --force 2>err
                [ "$(grep -c 'spooling' err)" -eq 1 ]
                cmp want.raw got.raw || { echo "$dims, $spacing $options, $memory, $threads threads" >&2; false; }
            done <<'EOF'
4M 1
4M 5
6M 3
EOF
            # shellcheck disable=SC2086
            vkt read in.nrrd --slab 3 | vkt distance - $options --memory 4M --slab 7 -q | vkt write - --format raw | cmp - want.raw
        done <<'EOF'
1,1,1
1,1,5 --signed
1,3.14159,2.7
1,3.14159,2.7 --signed --roi 17:-20,:,:
EOF
    done
    [ -z "$(ls -A spool)" ]
}

@test "distances from the spool are SciPy's, where one zero is left, too" {
    against_scipy '
for shape in ((60, 110, 190), (2, 1500, 900), (1500, 1, 900)):
    for share in (0.2, 0.001, 0):
        a = (rng.random(shape) >= share).astype(np.uint8)
        a[-1, -1, -1] = 0
        assert (distance(a, "--memory 4M -q") == expected(a).astype(np.float32)).all(), (shape, share)
a = (rng.random((60, 110, 190)) > 0.001).astype(np.float64)
a[3, 4, 5] = np.nan
for spacing in ((1, 1, 2), (0.3, 0.7, 2.1)):
    want = expected(np.nan_to_num(a), spacing) - expected(np.nan_to_num(a) == 0, spacing)
    got = distance(a, "--signed --memory 4M -q", spacing)
    assert (np.abs(got - want) <= 1.2e-7 * np.abs(want)).all(), spacing
'
    # What is counted is counted once.
    vkt make ramp --dims 190 110 60 --dtype float32 | vkt transform 'sqrt(-1-v)' -q | vkt distance --memory 4M -o o.nrrd 2>err
    grep -q '1254000 of 1254000 voxels .* not a number' err
    vkt make constant --dims 190 110 60 --value 2 | vkt distance --memory 4M -o o.nrrd --force 2>err
    grep -q 'distances are infinite' err
}

@test "the plan says that there will be a spool, how large, and what is held" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers keep memory of their own"
    export OMP_WAIT_POLICY=passive
    vkt make noise --dims 8 8 8 --dtype uint8 -o tiny.nrrd
    vkt make noise --dims 300 200 180 --dtype uint8 -o in.nrrd # 41 MiB of distances
    base=$(peak_kib vkt distance tiny.nrrd -o o.vkt --force -q)
    for memory in 4 8 24; do
        vkt distance in.nrrd --memory ${memory}M -n -o o.vkt --force 2>plan
        grep -q 'works on lines along x, y and z of a spool of 41.2 MiB' plan || { cat plan >&2; false; }
        said=$(sed -n 's/.*peak memory about \([0-9.]*\) MiB.*/\1/p' plan)
        most=$(peak_kib vkt distance in.nrrd --memory ${memory}M -o o.vkt --force -q)
        echo "$memory MiB: said $said, took $most KiB beside $base"
        awk "BEGIN { exit !($said <= $memory && $most - $base <= 1024 * $memory) }"
    done
    vkt distance in.nrrd --memory 64M -n -o o.vkt --force 2>&1 | grep -q 'holds the whole volume'
    # What is held needs no spool.
    vkt distance in.nrrd --memory 64M -o o.vkt --force 2>err
    [ ! -s err ]
}

@test "where there is no room for a spool nothing is left behind" {
    vkt make noise --dims 150 100 120 --dtype uint8 -o in.nrrd
    TMPDIR=/nowhere fails_with 4 'cannot spool to /nowhere' vkt distance in.nrrd --memory 4M -o o.nrrd
    [ ! -e o.nrrd ]
}

@test "with --roi only the region is measured: distances are those of the cropped volume, all else is 0" {
    vkt make noise --dims 23 19 17 | vkt threshold --above 0.05 -o mask.nrrd
    for option in --unit=voxel --signed; do
        for region in 3:20,2:11,5:16 :,7:8,: 0:1,:,:; do
            vkt distance mask.nrrd $option --roi "$region" -o depth.nrrd --force
            vkt crop mask.nrrd --roi "$region" | vkt distance $option -o part.nrrd --force
            vkt crop depth.nrrd --roi "$region" | vkt diff - part.nrrd
            vkt delete depth.nrrd --roi "$region" | vkt stats --json >outside.json
            grep -q '"max": 0[,.]' outside.json
            grep -q '"min": -\?0[,.]' outside.json
        done
    done
}
