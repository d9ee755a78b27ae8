# vkt permute: permutations of axes against NumPy, orientations against nibabel; world positions stay.
load helper

setup_more() {
    # Larger than a tile in places; bytes of every pattern.
    for type in uint8:1 int16:2 float16:2 float32:4 float64:8; do
        head -c $((131 * 47 * 29 * ${type#*:})) /dev/urandom >"v_131x47x29_${type%:*}.raw"
    done
}

raw() { vkt write "${1:--}" - --format raw; }

@test "every order agrees with numpy, for every size of voxels" {
    python_with numpy
    for type in uint8:8 int16:16 float16:16 float32:32 float64:64; do
        for order in xyz xzy yxz yzx zxy zyx; do
            vkt permute $order "v_131x47x29_${type%:*}.raw" --format raw -o out.raw --force
            /usr/bin/python3 - "v_131x47x29_${type%:*}.raw" "${type#*:}" $order <<'EOF'
import numpy as np, sys
name, bits, order = sys.argv[1:]
a = np.fromfile(name, f"uint{bits}").reshape(29, 47, 131)
# Axis k of the result is the input's axis order[k]; numpy has them backwards.
want = a.transpose([2 - "xyz".index(order[2 - i]) for i in range(3)])
assert want.tobytes() == open("out.raw", "rb").read(), (name, order)
EOF
        done
    done
}

@test "volumes larger than tiles in all directions, and than what is written past the caches" {
    python_with numpy
    /usr/bin/python3 - <<'EOF'
import numpy as np, subprocess
for dims, dtype in ((131, 261, 259), "uint8"), ((131, 261, 101), "float64"), ((40, 131, 260), "uint16"):
    a = np.random.default_rng(1).integers(0, 256, dims[::-1]).astype(dtype)
    name = f"l_{'x'.join(map(str, dims))}_{dtype}.raw"
    a.tofile(name)
    for order, axes in ("zyx", (2, 1, 0)), ("yxz", (0, 2, 1)), ("zxy", (1, 2, 0)):
        got = subprocess.run(["vkt", "permute", order, name, "--format", "raw"], check=True, capture_output=True).stdout
        assert got == a.transpose(axes).tobytes(), (name, order)
EOF
}

@test "slab heights, threads, pipes and a small budget make no difference; there and back is the volume" {
    for order in zyx:zyx yzx:zxy yxz:yxz xzy:xzy; do
        vkt permute ${order%:*} v_131x47x29_int16.raw | raw >want.raw
        for options in '--slab 1' '--slab 3' '--slab 7' '--threads 1' '--threads 5' '--memory 100k'; do
            # shellcheck disable=SC2086
            vkt permute ${order%:*} v_131x47x29_int16.raw $options | raw | cmp - want.raw
            # shellcheck disable=SC2086
            vkt read v_131x47x29_int16.raw --slab 2 | vkt permute ${order%:*} $options 2>/dev/null | raw | cmp - want.raw
        done
        vkt permute ${order%:*} v_131x47x29_int16.raw | vkt permute ${order#*:} | vkt diff - v_131x47x29_int16.raw --geometry
    done
}

@test "voxels keep their world positions" {
    vkt set v_131x47x29_uint8.raw --spacing 0.5,1,2 --origin 10,20,30 --direction 0,1,0,-1,0,0,0,0,1 -o s.nrrd
    vkt permute yzx s.nrrd -o p.nrrd
    vkt info p.nrrd | grep -x 'spacing    1 2 0.5'
    vkt info p.nrrd | grep -x 'origin     10 20 30'
    vkt info p.nrrd | grep -x 'direction  -1 0 0  0 0 1  0 1 0'
    # On the grid of the other, sampled by position, one is the other.
    vkt resample p.nrrd --like s.nrrd --method nearest | vkt diff - s.nrrd --geometry
}

@test "orientations are those of nibabel, for oblique volumes too" {
    python_with nibabel numpy
    vkt crop v_131x47x29_uint8.raw --roi 0:13,0:11,0:7 -o small.nrrd
    raw small.nrrd >s.raw
    local case=0
    for direction in 1,0,0,0,1,0,0,0,1 -1,0,0,0,0,-1,0,1,0 0.96,0.28,0,-0.28,0.96,0,0,0,1 0,0.6,0.8,1,0,0,0,0.8,-0.6; do
        for space in LPS RAS; do
            vkt set small.nrrd --direction=$direction --spacing 0.5,1,2 --origin 3,4,5 --attribute space=$space -o s.nrrd --force
            raw s.nrrd | cmp - s.raw
            for code in ras lps LPI sar ail; do
                vkt permute --to $code s.nrrd -o p.nrrd --force
                raw p.nrrd >$case.raw
                vkt info p.nrrd --json >$case.json
                echo $direction $space $code
                case=$((case + 1))
            done
        done
    done >cases
    [ $case -eq 40 ]
    /usr/bin/python3 - <<'EOF'
import json
import nibabel as nib, numpy as np
voxels = np.fromfile("s.raw", np.uint8).reshape(7, 11, 13).transpose()
for i, line in enumerate(open("cases")):
    direction, space, code = line.split()
    d = np.array([float(v) for v in direction.split(",")]).reshape(3, 3).T
    turn = np.diag([-1, -1, 1]) if space == "LPS" else np.eye(3) # nibabel's world is RAS
    affine = np.eye(4)
    affine[:3, :3] = turn @ d @ np.diag([0.5, 1, 2])
    affine[:3, 3] = turn @ [3, 4, 5]
    image = nib.Nifti1Image(voxels, affine)
    now, then = nib.io_orientation(affine), nib.orientations.axcodes2ornt(code.upper())
    want = image.as_reoriented(nib.orientations.ornt_transform(now, then))
    got = json.load(open(f"{i}.json"))
    assert tuple(got["dims"]) == want.shape, (line, got["dims"], want.shape)
    assert np.array_equal(np.fromfile(f"{i}.raw", np.uint8), np.asarray(want.dataobj).ravel(order="F")), line
    found = np.eye(4)
    found[:3, :3] = turn @ np.array(got["direction"]).T @ np.diag(got["spacing"])
    found[:3, 3] = turn @ got["origin"]
    assert np.allclose(found, want.affine, atol=1e-6), (line, found, want.affine)
EOF
}

@test "reversed axes: slabs, threads and pipes make no difference" {
    vkt set v_131x47x29_float32.raw --attribute space=LPS -o s.nrrd
    for code in ras ial ras pir; do
        vkt permute --to $code s.nrrd | raw >want.raw
        for options in '--slab 1' '--slab 7' '--threads 5' '--memory 100k'; do
            # shellcheck disable=SC2086
            vkt read s.nrrd --slab 2 | vkt permute --to $code $options 2>/dev/null | raw | cmp - want.raw
        done
    done
}

@test "trees: bricks and cells change places alike" {
    vkt make amr --blocks 50 --levels 3 -o t.vkt
    vkt set t.vkt --attribute space=LPS -o s.vkt
    for order in 'zyx:--to=sar' yzx:yzx; do
        vkt permute ${order#*:} s.vkt -o p.vkt --force
        if [ "${order%%:*}" = yzx ]; then
            vkt resample s.vkt --scale 0.25 --method nearest | vkt permute yzx -o want.nrrd --force
            vkt resample p.vkt --scale 0.25 --method nearest | vkt diff - want.nrrd --geometry
        else
            vkt permute --to lps p.vkt | vkt resample --scale 0.25 --method nearest -o back.nrrd
            vkt resample s.vkt --scale 0.25 --method nearest | vkt diff - back.nrrd --geometry
        fi
    done
}

@test "what cannot be is refused" {
    local v=v_131x47x29_uint8.raw
    fails_with 2 'neither an order' vkt permute xxy $v -o x.nrrd
    fails_with 2 'neither an order' vkt permute --to rla $v -o x.nrrd
    fails_with 2 'does not say what the axes' vkt permute --to ras $v -o x.nrrd
    fails_with 2 'ORDER' vkt permute -o x.nrrd
    [ ! -e x.nrrd ]
    vkt permute xyz $v | vkt diff - $v --geometry
}
