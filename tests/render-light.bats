# vkt render: environments from files, shadows, ambient occlusion and clip planes from the command line.
load helper

setup_more() {
    python_with numpy
    /usr/bin/python3 -c "
import numpy as np
v = np.zeros((30, 18, 24), np.uint8)
v[10:20, 5:13, 8:16] = 200
v.tofile('block_24x18x30_uint8.raw')"
    f=block_24x18x30_uint8.raw
    cloud="-ra multi-scattering --opacity 0,0.5 --size 24 --spp 16"
}

# environments: the same light in files of every kind, 16 x 8 pixels that eight bits and an exponent hold exactly.
environments() { /usr/bin/python3 -c "
import numpy as np
rng = np.random.default_rng(1)
mantissa = rng.integers(0, 256, (8, 16, 3))
mantissa[..., 0] |= 128 # as writers of the format have it
mantissa[2, 3:9] = mantissa[2, 3] # something to repeat
exponent = rng.integers(126, 134, (8, 16, 1))
exponent[2, 3:9] = exponent[2, 3]
light = (mantissa * 2.0 ** (exponent - 136)).astype('<f4')
open('sky.pfm', 'wb').write(b'PF\n16 8\n-1.0\n' + light[::-1].tobytes())
head = b'#?RADIANCE\n# made by hand\nFORMAT=32-bit_rle_rgbe\n'
pixels = np.concatenate([mantissa, exponent], 2).astype(np.uint8)
open('flat.hdr', 'wb').write(head + b'\n-Y 8 +X 16\n' + pixels.tobytes())
rows, old = b'', b''
for row in pixels:
    rows += bytes([2, 2, 0, 16])
    for plane in row.T: # nine as they are, or runs
        x = 0
        while x < 16:
            n = 1
            while x + n < 16 and plane[x + n] == plane[x]: n += 1
            rows += bytes([128 + n, plane[x]]) if n > 1 else bytes([1, plane[x]])
            x += n
    x = 0
    while x < 16:
        n = 1
        while x + n < 16 and (row[x + n] == row[x]).all(): n += 1
        old += row[x].tobytes() + (bytes([1, 1, 1, n - 1]) if n > 1 else b'')
        x += n
open('runs.hdr', 'wb').write(head + b'\n-Y 8 +X 16\n' + rows)
open('old.hdr', 'wb').write(head + b'\n-Y 8 +X 16\n' + old)
# Twice as bright, and a header that says so.
pixels[..., 3] += 1
open('exposed.hdr', 'wb').write(head.replace(b'RADIANCE', b'RGBE') + b'EXPOSURE= 2.0\n\n-Y 8 +X 16\n' + pixels.tobytes())"; }

@test "an environment is the same from PFM, OpenEXR and every kind of Radiance file" {
    environments
    vkt render $f $cloud --environment sky.pfm -o sky.pfm.png
    for kind in flat runs old exposed; do
        vkt render $f $cloud --environment $kind.hdr -o $kind.pfm
        [ "$kind" = flat ] || cmp flat.pfm $kind.pfm
    done
    vkt render $f $cloud --environment sky.pfm -o of_pfm.pfm
    cmp flat.pfm of_pfm.pfm
    vkt doctor >doctor
    if grep -q '^ *openexr *there' doctor; then
        vkt image mean sky.pfm -o sky.exr
        vkt render $f $cloud --environment sky.exr -o of_exr.pfm
        cmp flat.pfm of_exr.pfm
    fi
    # Another direction is another picture; a whole turn is none, but for what rounding does to random paths.
    vkt render $f $cloud --environment sky.pfm --environment-rotation 90 -o turned.pfm
    run ! cmp -s flat.pfm turned.pfm
    vkt history sky.pfm.png | grep -q -- '--environment sky.pfm'
    vkt render $f $cloud --environment sky.pfm --threads 1 -o one.pfm
    cmp flat.pfm one.pfm
}

@test "damaged and foreign environments are refused" {
    environments
    for cut in 20 60 100 200; do
        head -c $cut runs.hdr >cut.hdr
        fails_with 3 "Radiance" vkt render $f $cloud --environment cut.hdr -o a.png
    done
    sed 's/rle_rgbe/rle_xyze/' flat.hdr >xyz.hdr
    fails_with 3 "FORMAT=32-bit_rle_xyze" vkt render $f $cloud --environment xyz.hdr -o a.png
    sed 's/-Y 8 +X 16/+Y 8 +X 16/' flat.hdr >turned.hdr
    fails_with 3 "from the top" vkt render $f $cloud --environment turned.hdr -o a.png
    sed 's/-Y 8 +X 16/-Y 8 +X 99999/' flat.hdr >large.hdr
    fails_with 3 "16384" vkt render $f $cloud --environment large.hdr -o a.png
    printf '#?RADIANCE\n\n-Y 1 +X 4\n\1\1\1\7\0\0\0\0' >first.hdr
    fails_with 3 "does not fit" vkt render $f $cloud --environment first.hdr -o a.png
    printf 'PF\n1 1\n-1.0\n\0\0\300\177\0\0\0\0\0\0\0\0' >nan.pfm
    fails_with 3 "not a number" vkt render $f $cloud --environment nan.pfm -o a.png
    fails_with 3 "no PNG, PFM or OpenEXR" vkt render $f $cloud --environment $f -o a.png
    fails_with 4 "absent.hdr" vkt render $f $cloud --environment absent.hdr -o a.png
    fails_with 2 "does not apply" vkt render $f -ra maximum --environment sky.pfm -o a.png
    fails_with 2 "does not apply" vkt render $f --shade none --environment sky.pfm -o a.png
    fails_with 2 "exclude each other" vkt render $f --exact --environment sky.pfm -o a.png
    fails_with 2 "needs --environment" vkt render $f $cloud --environment-rotation 3 -o a.png
    fails_with 2 "0 or greater" vkt render $f $cloud --environment sky.pfm --environment-strength -1 -o a.png
    [ ! -e a.png ]
}

@test "light from one pixel lights the side that faces it" {
    # An opaque block, lit from +x, seen from above.
    /usr/bin/python3 -c "
import numpy as np
sky = np.zeros((8, 16, 3), '<f4')
sky[3:5, 11:13] = 20
open('sun.pfm', 'wb').write(b'PF\n16 8\n-1.0\n' + sky[::-1].tobytes())"
    for turned in 0 90 180 270; do
        vkt render $f -ra multi-scattering --opacity 0,0.5 --size 24 --spp 64 --view z --background 0,0,0 \
            --environment sun.pfm --environment-rotation $turned -o $turned.pfm
    done
    # Where the light is in the picture, in pixels to the right and downwards: counterclockwise from x, y is up.
    /usr/bin/python3 -c "
import numpy as np
def middle(turned):
    p = np.frombuffer(open(f'{turned}.pfm', 'rb').read().split(b'\n', 3)[3], '<f4').reshape(24, 24, 3)[::-1].mean(2)
    return p.sum(0) @ np.arange(24) / p.sum(), p.sum(1) @ np.arange(24) / p.sum()
(x, _), (_, y), (minus_x, _), (_, minus_y) = map(middle, (0, 90, 180, 270))
assert x - minus_x > 2 and minus_y - y > 2, (x, y, minus_x, minus_y)"
}

@test "an environment lights surfaces and the marched volume by their normals" {
    # A block, and light from +x: seen from there it is bright, from -x dark, and turned it is the other way round.
    /usr/bin/python3 -c "
import numpy as np
sky = np.zeros((8, 16, 3), '<f4')
sky[:, 8:] = [1, 1, 2]
open('right.pfm', 'wb').write(b'PF\n16 8\n-1.0\n' + sky[::-1].tobytes())
open('one.pfm', 'wb').write(b'PF\n16 8\n-1.0\n' + np.ones((8, 16, 3), '<f4').tobytes())"
    for way in "-ra implicit-iso --iso 100 --iso-color 1,1,1" "--opacity 0,1 --colormap grey"; do
        see="$f $way --size 24 --background 0,0,0 --specular 0 --force"
        for view in x -x; do
            vkt render $see --view=$view --environment right.pfm -o "lit$view.pfm"
            vkt render $see --view=$view --environment right.pfm --environment-rotation 180 -o "turned$view.pfm"
        done
        /usr/bin/python3 -c "
import numpy as np
def middle(name): return np.frombuffer(open(name + '.pfm', 'rb').read().split(b'\n', 3)[3], '<f4').reshape(24, 24, 3)[12, 12]
bright, dark, other, another = map(middle, ('litx', 'lit-x', 'turned-x', 'turnedx'))
# Half of the sky: what faces it has all of its light, the other side none.
assert (dark < 0.02 * bright.max()).all() and bright[2] > 1.9 * bright[0] > 0, (bright, dark)
assert np.allclose(bright, other, rtol=1e-4) and np.allclose(dark, another, atol=1e-4), (bright, other, dark, another)"
        # One everywhere is light from everywhere.
        vkt render $see --environment one.pfm --ambient 0.4 -o one.pfm.pfm
        vkt render $see --shade gradient --ambient 0.4 -o plain.pfm
        vkt image diff one.pfm.pfm plain.pfm --tolerance 0.00001
    done
    # The recipe draws the same, and threads do not matter; with a lamp the environment has its share.
    lit="--opacity 0,0.8 --size 24 --environment right.pfm --ambient-occlusion 8"
    vkt render $f $lit --threads 1 -o a.png
    vkt render $f $lit --threads 3 -o b.png
    cmp a.png b.png
    vkt history a.png | grep -q -- '--environment right.pfm'
    vkt render $f $lit --light-direction 0,0,1 -o lamp.png
    vkt render $f $lit --light-direction 0,0,1 --ambient 0.25 -o share.png
    vkt image diff lamp.png share.png
    vkt render $f $lit --ambient 1 -o whole.png
    vkt image diff a.png whole.png
    vkt render $f $lit --explain -o c.png 2>&1 | grep -q "surfaces lit from an environment"
}

@test "paths are scattered from a light in one direction as well, which has its share" {
    for way in 1,0,0 -1,0,0; do
        vkt render $f -ra multi-scattering --opacity 0,0.5 --size 24 --spp 32 --view z --background 0,0,0 --ambient 0 \
            --light-direction=$way -o "lamp$way.pfm"
    done
    /usr/bin/python3 -c "
import numpy as np
def middle(way):
    p = np.frombuffer(open(f'lamp{way}.pfm', 'rb').read().split(b'\n', 3)[3], '<f4').reshape(24, 24, 3).mean(2)
    return p.sum(0) @ np.arange(24) / p.sum()
assert middle('1,0,0') - middle('-1,0,0') > 2"
    vkt render $f $cloud --light-direction 1,0,0 --threads 1 -o one.png
    vkt render $f $cloud --light-direction 1,0,0 --threads 3 -o three.png
    cmp one.png three.png
    vkt history one.png | grep -q -- '--light-direction 1,0,0'
    # Without, it is another picture; of all light from everywhere it is the same but for noise.
    vkt render $f $cloud -o none.png
    run vkt image diff one.png none.png --tolerance 0.02
    [ "$status" = 1 ]
    vkt render $f $cloud --light-direction 1,0,0 --explain -o b.png 2>&1 | grep -q "light from one direction and from all around"
    fails_with 2 "needs --light-direction" vkt render $f $cloud --ambient 0.5 -o b.png
}

@test "shadows and occlusion of the marched volume darken, and the recipe and threads give the same picture" {
    lit="--opacity 0,0.8 --colormap grey --size 40 --shade gradient"
    vkt render $f $lit --light-direction 1,-1,1 -o lit.png
    vkt render $f $lit --light-direction 1,-1,1 --shadows -o shadow.png
    vkt render $f $lit --light-direction 1,-1,1 --shadows --ambient-occlusion 16 -o both.png
    vkt render $f $lit --light-direction 1,-1,1 --shadows --ambient-occlusion 16 --threads 1 -o one.png
    cmp both.png one.png
    run vkt image diff lit.png shadow.png --tolerance 0.02
    [ "$status" = 1 ]
    run vkt image diff shadow.png both.png --tolerance 0.01
    [ "$status" = 1 ]
    vkt history both.png | grep -q -- '--shadows'
    vkt history both.png | grep -q -- '--ambient-occlusion 16'
    # Of a tree too.
    vkt make amr --blocks 20 --levels 2 --block-size 8 -o tree.vkt
    vkt render tree.vkt --opacity 0,0.5 --domain 0:1 --size 24 --light-direction 1,-1,1 --shadows -o tree.png
    vkt render tree.vkt --opacity 0,0.5 --domain 0:1 --size 24 --light-direction 1,-1,1 -o plain.png
    run vkt image diff tree.png plain.png --tolerance 0.01
    [ "$status" = 1 ]
}

@test "what shadows and occlusion need is said" {
    fails_with 2 "needs a light" vkt render $f --shadows -o a.png
    fails_with 2 "6 to 64 directions" vkt render $f --ambient-occlusion 3 -o a.png
    fails_with 2 "6 to 64 directions" vkt render $f --ambient-occlusion 65 -o a.png
    fails_with 2 "needs --ambient-occlusion" vkt render $f --occlusion-radius 3 -o a.png
    fails_with 2 "exclude each other" vkt render $f --exact --ambient-occlusion 8 -o a.png
    fails_with 2 "does not apply" vkt render $f -ra maximum --ambient-occlusion 8 -o a.png
    fails_with 2 "does not apply" vkt render $f -ra multi-scattering --shadows -o a.png
    vkt render $f --light-direction 1,0,0 --shadows --shade none --opacity 0,1 --size 16 -o a.png
    vkt render $f --ambient-occlusion 8 --shade none --ambient 1 --opacity 0,1 --size 16 -o b.png
    [ -s a.png ] && [ -s b.png ]
}

@test "clip planes cut as clip boxes do, from the command line" {
    view="--eye 60,-50,50 --target 12,9,15 --size 48 --opacity 0,0.4 --colormap viridis"
    vkt render $f $view --clip-box 12:,:,:15 -o box.png
    vkt render $f $view --clip-plane 1 0 0 11.5 0 0 -1 -14.5 -o planes.png
    vkt image diff box.png planes.png --tolerance 0.005
    vkt render $f $view -o whole.png
    run vkt image diff whole.png planes.png --tolerance 0.05
    [ "$status" = 1 ]
    vkt history planes.png | grep -q -- '--clip-plane 1 0 0 11.5 0 0 -1 -14.5'
    fails_with 2 "NX NY NZ D" vkt render $f --clip-plane 1 0 0 -o a.png
    fails_with 2 "at most 6 planes" vkt render $f --clip-plane $(printf '1 0 0 0 %.0s' {1..7}) -o a.png
    fails_with 2 "not 0 0 0" vkt render $f --clip-plane 0 0 0 1 -o a.png
    vkt render $f --clip-plane 1 0 0 1000 --size 16 -o empty.png 2>err
    grep -q "the picture is empty" err
}

@test "an environment that is all the light makes no highlights" {
    /usr/bin/python3 -c "
import struct
open('black.pfm', 'wb').write(b'PF\n16 8\n-1\n' + struct.pack('<384f', *[0.0] * 384))"
    vkt render $f -ra implicit-iso --iso 10 --environment black.pfm --background 0,0,0 -o black.pfm.pfm
    /usr/bin/python3 -c "
import struct
values = open('black.pfm.pfm', 'rb').read().split(b'\n', 3)[3]
assert max(struct.unpack('<%df' % (len(values) // 4), values)) == 0"
    vkt render $f -ra implicit-iso --iso 10 --environment black.pfm --specular 0.3 --background 0,0,0 -o some.pfm
    ! cmp -s some.pfm black.pfm.pfm || false
}
