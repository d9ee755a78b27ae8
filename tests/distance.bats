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
    vkt make ramp --dims 256 256 64 -o large.nrrd
    fails_with 5 'whole volumes' vkt distance large.nrrd --memory 8M -o o8.nrrd
    [ ! -e o.vkt ] && [ ! -e o8.nrrd ]
}

@test "the plan says that the whole volume is held" {
    vkt make ramp --dims 4 4 4 | vkt distance --explain 2>plan | vkt stats
    grep -q 'holds the whole volume' plan
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
