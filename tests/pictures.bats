# Picture files: 16-bit PNG, PFM and OpenEXR with layers, against readers that are not vkt's and analytic answers.
load helper

setup_more() { python_with numpy; }

needs_exr() {
    vkt doctor >doctor
    grep -q '^ *openexr *there' doctor || skip "built without OpenEXR"
}

# For python: exr(NAME), its channels by an own reader of ZIP scan lines; pfm(NAME).
readers='
import numpy as np, struct, zlib
def exr(name):
    b = open(name, "rb").read()
    assert b[:8] == bytes([0x76, 0x2f, 0x31, 1, 2, 0, 0, 0])
    at, attributes = 8, {}
    def word(at):
        end = b.index(0, at)
        return b[at:end].decode(), end + 1
    while b[at]:
        key, at = word(at)
        kind, at = word(at)
        n, = struct.unpack_from("<i", b, at)
        attributes[key] = b[at + 4:at + 4 + n]
        at += 4 + n
    at += 1
    exr.texts = attributes
    x0, y0, x1, y1 = exr.window = struct.unpack("<4i", attributes["dataWindow"])
    exr.display = struct.unpack("<4i", attributes["displayWindow"])
    assert attributes["compression"] == b"\x03" and attributes["lineOrder"] == b"\0"
    w, h, names, types, c, k = x1 - x0 + 1, y1 - y0 + 1, [], [], attributes["channels"], 0
    while c[k]:
        end = c.index(0, k)
        names.append(c[k:end].decode())
        types.append({1: "<f2", 2: "<f4"}[c[end + 1]])
        k = end + 17
    planes = {n: np.zeros((h, w), t) for n, t in zip(names, types)}
    for block in range((h + 15) // 16):
        place, = struct.unpack_from("<Q", b, at + 8 * block)
        y, size = struct.unpack_from("<ii", b, place)
        rows = min(16, y1 - y + 1)
        full = sum(np.dtype(t).itemsize for t in types) * w * rows
        data = b[place + 8:place + 8 + size]
        if size < full:
            d = np.frombuffer(zlib.decompress(data), np.uint8).astype(int)
            d = (np.cumsum(d) - 128 * np.arange(len(d))) % 256
            half = (len(d) + 1) // 2
            out = np.zeros(len(d), np.uint8)
            out[0::2], out[1::2] = d[:half], d[half:]
            data = out.tobytes()
        k = 0
        for row in range(y - y0, y - y0 + rows):
            for n, t in zip(names, types):
                planes[n][row] = np.frombuffer(data, t, w, k)
                k += w * np.dtype(t).itemsize
    return planes
def pfm(name):
    head, size, scale, pixels = open(name, "rb").read().split(b"\n", 3)
    assert float(scale) < 0
    w, h = map(int, size.split())
    return np.frombuffer(pixels, "<f4").reshape(h, w, *((3,) if head == b"PF" else ()))[::-1]
'

@test "16-bit PNG, PFM and OpenEXR hold the same light" {
    python_with cv2
    needs_exr
    vkt make noise --dims 24 20 16 -o v.nrrd
    for algorithm in ray-marching implicit-iso "multi-scattering --spp 3" maximum; do
        for suffix in png exr pfm; do
            # shellcheck disable=SC2086  # an option with its value
            vkt render v.nrrd -ra $algorithm --size 61x47 -o a.$suffix --force
        done
        # shellcheck disable=SC2086
        vkt render v.nrrd -ra $algorithm --size 61x47 --depth 16 -o b.png --force
        # shellcheck disable=SC2086
        vkt render v.nrrd -ra $algorithm --size 61x47 --depth 16 -o b.exr --force
        OPENCV_IO_ENABLE_OPENEXR=1 /usr/bin/python3 -c "$readers
import cv2
light = pfm('a.pfm').astype(float)
assert light.shape == (47, 61, 3) and light.max() > 0.05
own = exr('a.exr')
assert exr.window == exr.display == (0, 0, 60, 46) and 'A' not in own
for i, c in enumerate('RGB'): assert np.array_equal(own[c], light[:, :, i]) and own[c].dtype == np.float32
# cv2 has blue first
assert np.array_equal(cv2.imread('a.exr', cv2.IMREAD_UNCHANGED)[:, :, ::-1], light.astype('f4'))
assert np.array_equal(cv2.imread('a.pfm', cv2.IMREAD_UNCHANGED)[:, :, ::-1], light.astype('f4'))
half = exr('b.exr')
for c in 'RGB': assert half[c].dtype == np.float16 and np.array_equal(half[c], own[c].astype(np.float16))
light = np.clip(light, 0, 1)
srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
wide, narrow = cv2.imread('b.png', cv2.IMREAD_UNCHANGED), cv2.imread('a.png', cv2.IMREAD_UNCHANGED)
assert wide.dtype == np.uint16 and narrow.dtype == np.uint8
assert np.abs(wide[:, :, ::-1] - 65535 * srgb).max() < 0.51
assert np.abs(narrow[:, :, ::-1] - 255 * srgb).max() < 0.51"
    done
}

@test "pictures with alpha: straight in PNG, premultiplied in OpenEXR, refused for PFM" {
    python_with cv2
    needs_exr
    vkt make noise --dims 24 20 16 -o v.nrrd
    for file in "a.exr" "a.png --depth 16"; do
        # shellcheck disable=SC2086  # an option with its value
        vkt render v.nrrd --size 40 --opacity 0,0.1 --background 0.5,0.2,0.8,0.25 -o $file
    done
    /usr/bin/python3 -c "$readers
import cv2
e = exr('a.exr')
p = cv2.imread('a.png', cv2.IMREAD_UNCHANGED).astype(float) / 65535
assert p.shape == (40, 40, 4)
alpha = e['A'].astype(float)
assert alpha.min() == 0.25 and alpha.max() > 0.5
assert np.abs(p[:, :, 3] - alpha).max() < 1e-5
for i, c in enumerate('BGR'):
    light = e[c] / alpha
    srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    assert np.abs(p[:, :, i] - srgb).max() < 2e-5, c"
    fails_with 2 "PFM pictures have no alpha" vkt render v.nrrd --background 0,0,0,0 -o a.pfm
    [ ! -e a.pfm ]
}

@test "what a picture file cannot be is refused before anything is read" {
    mkfifo silent
    exec 5<>silent
    fails_with 2 "end the name in .png or .exr or .pfm" timeout 20 vkt render silent -o a.jpg
    fails_with 2 "PNG pictures have 8 or 16 bits" timeout 20 vkt render silent -o a.png --depth 32
    fails_with 2 "PFM pictures have 32 bits" timeout 20 vkt render silent -o a.pfm --depth 16
    fails_with 2 "'x'" timeout 20 vkt render silent -o a.png --depth x
    needs_exr
    fails_with 2 "OpenEXR pictures have 32 or 16 bits" timeout 20 vkt render silent -o a.exr --depth 8
    run find . -name 'a.*'
    [ -z "$output" ]
}

@test "without OpenEXR the refusal says so" {
    vkt doctor >doctor
    if grep -q '^ *openexr *there' doctor; then skip "built with OpenEXR"; fi
    vkt make noise --dims 4 4 4 -o v.nrrd
    fails_with 1 "without it" vkt render v.nrrd -o a.exr
}

@test "layers of a plane: distance and normal as geometry has them" {
    needs_exr
    # value = n . p with world coordinates p: trilinear interpolation is exact, the surface of 0 a plane.
    /usr/bin/python3 -c "
import numpy as np
z, y, x = np.mgrid[0:24, 0:20, 0:30].astype(float)
p = np.stack([1 + x, -3 + 2 * y, 5 + 0.5 * z], -1)
n = np.array([1, 2, -2]) / 3
(p @ n - np.array([15.5, 16, 10.75]) @ n).astype('<f4').tofile('plane.raw')"
    vkt read plane.raw --dims 30 20 24 --dtype float32 | vkt set --spacing 1,2,0.5 --origin 1,-3,5 -o plane.nrrd
    common=(--render-algo implicit-iso --iso 0 --iso-color 0.5 0.25 1 --size 45x45 --eye 20,-60,40 --target 15.5,16,10.75)
    vkt render plane.nrrd "${common[@]}" --fov 24 -o perspective.exr
    vkt render plane.nrrd "${common[@]}" --projection orthographic --span 20 -o orthographic.exr
    /usr/bin/python3 -c "$readers
n, eye, target = np.array([1, 2, -2]) / 3, np.array([20, -60, 40.]), np.array([15.5, 16, 10.75])
forward = (target - eye) / np.linalg.norm(target - eye)
right = np.cross(forward, [0, 0, 1.]); right /= np.linalg.norm(right)
up = np.cross(right, forward)
v, u = np.mgrid[0:45, 0:45]
u, v = (2 * (u + 0.5) / 45 - 1)[..., None], (1 - 2 * (v + 0.5) / 45)[..., None]
for name in 'perspective', 'orthographic':
    e = exr(name + '.exr')
    if name == 'perspective':
        t = np.tan(np.radians(12))
        way = forward + t * (u * right + v * up)
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        origin = eye + 0 * way
    else:
        way, origin = forward + 0 * u, eye + 10 * (u * right + v * up)
    want = ((target - origin) @ n) / (way @ n)
    hit = np.isfinite(e['Z'])
    # beyond the centres of the outer voxels the field is constant across the face
    place = origin + want[..., None] * way
    inside = ((place > [1, -3, 5]) & (place < [30, 35, 16.5])).all(-1)
    assert inside.mean() > 0.1 and hit[inside].all()
    assert np.abs(e['Z'] - want)[inside].max() < 2e-4, np.abs(e['Z'] - want)[inside].max()
    # a gradient takes one voxel more
    core = ((place > [2, -1, 5.5]) & (place < [29, 33, 16])).all(-1)
    facing = -np.sign(way @ n)
    for i, c in enumerate('XYZ'):
        assert np.abs(e['normal.' + c] - facing * n[i])[core].max() < 1e-5
        assert (e['normal.' + c][~hit] == 0).all()
    srgb = np.array([0.5, 0.25, 1]); linear = ((srgb + 0.055) / 1.055) ** 2.4
    for i, c in enumerate('RGB'):
        assert np.abs(e['albedo.' + c][hit] - linear[i]).max() < 1e-6 and (e['albedo.' + c][~hit] == 0).all()"
}

@test "distance in a medium: where half of the light is held back" {
    needs_exr
    # alpha 0.5 a unit of 2: half is gone 2 behind the face x = 15.5, wherever the ray goes on in the medium.
    head -c 32768 /dev/zero | tr '\0' '\1' >ones.raw
    vkt read ones.raw --dims 32 32 32 --dtype uint8 -o one.nrrd
    for algorithm in "ray-marching --shade none" "ray-marching --exact" multi-scattering; do
        spp=; [ "$algorithm" != multi-scattering ] || spp="--spp 1"
        # shellcheck disable=SC2086  # options with their values
        vkt render one.nrrd -ra $algorithm $spp --lut 1 1 1 0.5 --unit-distance 2 --size 31 --view x \
            --projection orthographic --span 40 -o a.exr --force
        /usr/bin/python3 -c "$readers
z = exr('a.exr')['Z']
text = exr.texts['Camera'].decode().split()
eye = float(text[1])
hit = np.isfinite(z)
side = np.abs(40 * ((np.arange(31) + 0.5) / 31 - 0.5)) < 16
assert np.array_equal(hit, side[:, None] & side)
assert np.abs(z[hit] - (eye - 31.5 + 2)).max() < 1e-4, (eye, z[hit])"
    done
    # All but half: nothing holds back half of the light.
    vkt render one.nrrd --lut 1 1 1 0.01 --unit-distance 2 --size 8 --view x -o b.exr
    /usr/bin/python3 -c "$readers
assert np.isinf(exr('b.exr')['Z']).all()"
}

@test "distance where opacities rise, below many colours: as the integral says, and in about the time of the picture" {
    needs_exr
    # Values are x; the extinction of 0.04 x a unit has the depth 0.02 (b^2 - a^2) from a to b.
    vkt make ramp --dims 40 12 12 --dtype float32 -o ramp.nrrd
    transfer=$(/usr/bin/python3 -c "
import json, math
print(json.dumps({'unit': 1, 'points': [[v, v % 3 / 2, v % 5 / 4, v % 7 / 6, 1 - math.exp(-0.04 * v)] for v in range(40)]}))")
    vkt render ramp.nrrd --transfer "$transfer" --size 64 --view -x --projection orthographic --span 16 -o a.exr
    /usr/bin/python3 -c "$readers
z = exr('a.exr')['Z']
eye = float(exr.texts['Camera'].decode().split()[1])
hit = np.isfinite(z)
assert hit[20:44, 20:44].all()
assert np.abs(z[hit] + eye - (2 * np.log(2) / 0.04) ** 0.5).max() < 1e-4, (eye, z[hit])"
    vkt make sphere --dims 32 24 16 -o ball.nrrd
    /usr/bin/python3 -c "
import os, resource, subprocess
def seconds(name):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run([os.environ['VKT'], 'render', 'ball.nrrd', '--size', '256', '--threads', '1', '-o', name], check=True)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
picture, layers = seconds('b.png'), seconds('b.exr')
assert layers < 8 * picture + 0.5, (picture, layers)"
}

@test "variance of paths is that of pictures with other seeds" {
    needs_exr
    vkt make noise --dims 12 12 12 -o v.nrrd
    for seed in $(seq 40); do
        vkt render v.nrrd -ra multi-scattering --spp 16 --size 24 --opacity 0,0.3 --seed "$seed" -o "s$seed.exr"
    done
    /usr/bin/python3 -c "$readers
all = [exr(f's{i}.exr') for i in range(1, 41)]
assert exr.texts['Samples'] == b'16'
for c in 'RGB':
    seen = np.var([e[c].astype(float) for e in all], axis=0, ddof=1).mean()
    told = np.mean([e['variance.' + c].astype(float) for e in all])
    # 576 pixels with 39 degrees of freedom each: a standard error of a hundredth and a half at most
    assert seen > 1e-4 and abs(told / seen - 1) < 0.05, (c, told, seen)"
}

@test "the variance of a mean follows from those of what it is made of" {
    needs_exr
    vkt make noise --dims 12 12 12 -o v.nrrd
    vkt render v.nrrd -ra multi-scattering --spp 4 --seed 1 --size 24 -o a.exr
    vkt render v.nrrd -ra multi-scattering --spp 12 --seed 2 --size 24 -o b.exr
    vkt image mean a.exr b.exr -o mean.exr
    /usr/bin/python3 -c "$readers
a, b, mean = exr('a.exr'), exr('b.exr'), exr('mean.exr')
assert exr.texts['Samples'] == b'16'
for c in 'RGB':
    want = (a['variance.' + c].astype(float) + 9 * b['variance.' + c]) / 16
    assert want.max() > 1e-3 and np.abs(mean['variance.' + c] - want).max() < 1e-7
    assert np.abs(mean[c] - (a[c].astype(float) + 3 * b[c]) / 4).max() < 1e-6
assert np.array_equal(mean['Z'], a['Z'])"
}

@test "what an integrator does not know is not written" {
    needs_exr
    vkt make noise --dims 12 12 12 -o v.nrrd
    vkt make amr --blocks 20 --levels 2 -o tree.vkt
    vkt render v.nrrd --size 8 -o march.exr
    vkt render v.nrrd -ra maximum --size 8 -o maximum.exr
    vkt render tree.vkt --size 8 -o tree.exr
    /usr/bin/python3 -c "$readers
assert sorted(exr('march.exr')) == sorted(exr('tree.exr')) == ['B', 'G', 'R', 'Z']
assert sorted(exr('maximum.exr')) == ['B', 'G', 'R']"
}

@test "an OpenEXR picture holds its recipe, and equal pictures are equal files" {
    needs_exr
    vkt make noise --dims 12 12 12 -o v.nrrd
    vkt render v.nrrd --size 8 -ra implicit-iso --threads 1 -o a.exr
    vkt render v.nrrd --size 8 -ra implicit-iso --threads 2 -o b.exr
    cmp a.exr b.exr
    vkt history a.exr --as-shell >line
    grep -q 'vkt render --render-algo implicit-iso --size 8' line
    for n in 4 400 2000; do
        head -c $n a.exr >cut.exr
        fails_with 3 "cut.exr" vkt history cut.exr
    done
}

@test "slices as pictures of floats" {
    needs_exr
    for type in uint8:u1 int16:i2 float16:f2 float32:f4; do
        head -c $((13 * 11 * 7 * ${type#*:?})) /dev/urandom >"v_13x11x7_${type%:*}.raw"
        for suffix in exr pfm; do vkt slice "v_13x11x7_${type%:*}.raw" --y 3 -o s.$suffix --force; done
        /usr/bin/python3 -c "$readers
v = np.fromfile('v_13x11x7_${type%:*}.raw', '<${type#*:}').reshape(7, 11, 13)[:, 3].astype('f4')
e = exr('s.exr')
assert list(e) == ['Y'] and e['Y'].dtype == ('f2' if '${type%:*}' == 'float16' else 'f4')
assert np.array_equal(e['Y'], v, equal_nan=True) and np.array_equal(pfm('s.pfm'), v, equal_nan=True)"
    done
    head -c $((13 * 11 * 7 * 8)) /dev/zero >v_13x11x7_float64.raw
    fails_with 2 "holds what float32 can" vkt slice v_13x11x7_float64.raw -o d.pfm
    fails_with 2 "holds what float32 can" vkt slice v_13x11x7_float64.raw -o d.exr
    fails_with 2 "holds one slice" vkt write v_13x11x7_uint8.raw d.exr
}

@test "a light from one direction: Lambert's cosine and the shadow of a ball" {
    needs_exr
    # A ball of radius 6 around (20, 20, 22) above the plane z = 8, as one field; both are surfaces of 0.
    /usr/bin/python3 -c "
import numpy as np
z, y, x = np.mgrid[0:40, 0:40, 0:40].astype(float)
np.maximum(6 - np.sqrt((x - 20) ** 2 + (y - 20) ** 2 + (z - 22) ** 2), 8 - z).astype('<f4').tofile('scene.raw')"
    vkt read scene.raw --dims 40 40 40 --dtype float32 -o scene.nrrd
    common=(scene.nrrd --render-algo implicit-iso --iso 0 --iso-color 0.5 0.7 0.9 --size 80 --projection orthographic
        --eye 20,-40,60 --target 20,20,12 --span 40 --light-direction 1,0.5,2 --ambient 0.3 --specular 0)
    vkt render "${common[@]}" --spp 1 -o plain.exr
    vkt render "${common[@]}" --spp 1 --shadows -o shadow.exr
    /usr/bin/python3 -c "$readers
e, s = exr('plain.exr'), exr('shadow.exr')
light = np.array([1, 0.5, 2]) / np.sqrt(5.25)
hit = np.isfinite(e['Z'])
normal = np.stack([e['normal.' + c] for c in 'XYZ'], -1).astype(float)
cosine = np.maximum(0, normal @ light)
assert cosine[hit].max() > 0.9 and (cosine[hit] == 0).any()
for c in 'RGB':
    want = e['albedo.' + c] * (0.3 + 0.7 * cosine)
    assert np.abs(e[c] - want)[hit].max() < 1e-5, np.abs(e[c] - want)[hit].max()
# Where a pixel's point lies, and whether the ball stands between it and the light.
eye, target = np.array([20, -40, 60.]), np.array([20, 20, 12.])
forward = (target - eye) / np.linalg.norm(target - eye)
right = np.cross(forward, [0, 0, 1.]); right /= np.linalg.norm(right)
up = np.cross(right, forward)
v, u = np.mgrid[0:80, 0:80]
u, v = (2 * (u + 0.5) / 80 - 1)[..., None], (1 - 2 * (v + 0.5) / 80)[..., None]
point = eye + 20 * (u * right + v * up) + np.where(hit, e['Z'], 0)[..., None].astype(float) * forward
to = np.array([20, 20, 22]) - point
miss = np.linalg.norm(to - (to @ light)[..., None] * light, axis=-1)
plane = hit & (np.abs(point[..., 2] - 8) < 0.01) & ((point[..., :2] > 1) & (point[..., :2] < 38)).all(-1)
dark, lit = plane & (miss < 5.8), plane & (miss > 6.2)
assert dark.sum() > 100 and lit.sum() > 500, (dark.sum(), lit.sum())
assert np.abs(s['R'] - 0.3 * e['albedo.R'])[dark].max() < 1e-5
assert np.abs(s['R'] - e['R'])[lit].max() < 1e-5"
    fails_with 2 "--shadows needs a light" vkt render scene.nrrd -ra implicit-iso --shadows -o a.png
    fails_with 2 "--shadows does not apply" vkt render scene.nrrd -ra multi-scattering --shadows -o a.png
    fails_with 2 "--shadows needs a light" vkt render scene.nrrd --shadows -o a.png
    fails_with 2 "--light-direction" vkt render scene.nrrd --light-direction 0,0,0 -o a.png
    fails_with 2 "does not apply to --shade none" vkt render scene.nrrd --light-direction 0,0,1 --shade none -o a.png
    fails_with 2 "--ambient" vkt render scene.nrrd --ambient 2 -o a.png
}

@test "a light where the camera is shades marched volumes as the headlight does" {
    vkt make sphere --dims 24 24 24 --edge distance -o v.nrrd
    common=(v.nrrd --opacity 0.5,0 --domain -3:3 --view -y --projection orthographic --size 60 --specular 0)
    vkt render "${common[@]}" --shade gradient -o head.png
    vkt render "${common[@]}" --light-direction 0,-1,0 -o lamp.png
    vkt render "${common[@]}" --light-direction 0,1,0 -o behind.png
    vkt image diff head.png lamp.png --tolerance 1e-3
    run vkt image diff head.png behind.png --tolerance 0.05
    [ "$status" = 1 ]
}

@test "slices come back from PGM, PFM and OpenEXR; colours and channels are a volume each" {
    for type in uint8 uint16 float16 float32; do
        vkt make noise --dims 9 7 1 --dtype $type -o $type.vkt
        case $type in
        uint*) formats=pgm ;;
        float16) formats=exr ;;
        float32) formats="pfm exr" ;;
        esac
        for format in $formats; do
            vkt write $type.vkt $type.$format 2>said || { grep -q "this build has no OpenEXR" said; continue; }
            vkt diff $type.$format $type.vkt
            [ "$(vkt info $type.$format --json | sed -n 's/.*"dtype": "\(.*\)",/\1/p')" = $type ]
            vkt read $type.$format --roi 2:5,1:6,: | vkt diff - <(vkt crop $type.vkt --roi 2:5,1:6,:)
            vkt read - <$type.$format | vkt diff - $type.vkt
        done
    done
    printf 'P3\n# a comment\n2 1 # another\n255\n1 2 3\n4 5 6\n' >text.ppm
    printf 'P6 2 1 255\n\001\002\003\004\005\006' >binary.ppm
    printf 'P2\n2 1\n300\n299 7\n' >wide.pgm
    for name in text binary; do
        [ "$(vkt read $name.ppm | vkt write - --format raw 2>/dev/null | od -An -tu1 | tr -s ' ')" = " 1 4 2 5 3 6" ]
    done
    vkt info wide.pgm | grep -q '^dtype *uint16'
    printf 'PF\n1 2\n-1.0\n' >colours.pfm
    /usr/bin/python3 -c 'import struct, sys; sys.stdout.buffer.write(struct.pack("<6f", 4, 5, 6, 1, 2, 3))' >>colours.pfm
    vkt read colours.pfm --variable G | vkt stats --json | grep -q '"sum": 7'
    fails_with 2 "has no channel 'A', but R, G, B" vkt read colours.pfm --variable A
    # What is damaged.
    printf 'P5 2 99 255\n12' >short.pgm
    printf 'P5 99999999 2 255\n' >huge.pgm
    printf 'P5 2 2 0\n1234' >none.pgm
    printf 'P5 x' >letters.pgm
    printf 'P5 2' >cut.pgm
    for name in short huge none letters cut; do fails_with 3 "$name.pgm" vkt stats $name.pgm; done
    vkt make sphere --dims 12 12 12 -o ball.nrrd
    vkt render ball.nrrd --size 16 -o drawn.exr 2>said || { grep -q "without it\|no OpenEXR" said; return 0; }
    vkt info drawn.exr >info
    [ "$(grep -c 'channel: [RGBZ]$' info)" -ge 4 ]
    vkt read drawn.exr --variable Z | vkt info | grep -q '^dims *16 16 1'
    vkt history drawn.exr | grep -q '^vkt render'
}

@test "slices of a volume appear together or not at all" {
    vkt make noise --dims 128 128 128 --dtype uint16 -o n.vkt
    head -c 3000000 n.vkt >cut.vkt
    mkdir d
    for suffix in png pgm; do
        fails_with 3 "ended early" vkt write cut.vkt "d/%03d.$suffix"
        [ -z "$(ls -A d)" ]
    done
    fails_with 3 "" vkt filter box --radius 1 cut.vkt -o d/%03d.png
    [ -z "$(ls -A d)" ]
    vkt write n.vkt d/%03d.png
    sha256sum d/* >before
    fails_with 3 "ended early" vkt write cut.vkt d/%03d.png --force
    sha256sum --quiet -c before
    [ "$(ls -A d | wc -l)" -eq 128 ]
    vkt read d | vkt diff - n.vkt
    # More of them than files may be open: the limit is raised, and where it cannot be they appear one by one.
    vkt make noise --dims 4 4 1500 --dtype uint8 -o long.vkt
    (ulimit -Sn 256 && vkt write long.vkt d/l%04d.pgm)
    [ "$(ls d/l* | wc -l)" -eq 1500 ]
    (ulimit -n 256 && vkt write long.vkt d/m%04d.pgm)
    [ "$(ls d/m* | wc -l)" -eq 1500 ]
}
