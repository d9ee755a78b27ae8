# vkt render: surfaces have smooth edges, unless one ray a pixel is asked for.
load helper

setup_more() {
    python_with numpy
    /usr/bin/python3 -c "
import numpy as np
z, y, x = np.mgrid[:30, :30, :30]
(15 - np.sqrt((x - 14.2)**2 + (y - 14.7)**2 + (z - 14.4)**2)).astype('<f4').tofile('ball_30x30x30_float32.raw')"
    f=ball_30x30x30_float32.raw
    see="$f -ra implicit-iso --iso 4 --iso-color 1,1,1 --background 0,0,0"
}

@test "edges of surfaces are nearer to sixteen rays a pixel than one ray is" {
    vkt render $see --size 64 -o smooth.pfm
    vkt render $see --size 64 --spp 1 -o one.pfm
    vkt render $see --size 64 --spp 16 -o many.pfm
    vkt render $see --size 1024 --spp 1 -o large.pfm
    /usr/bin/python3 -c "
import numpy as np
def read(name):
    head = open(name, 'rb').read().split(b'\n', 3)
    width, height = map(int, head[1].split())
    return np.frombuffer(head[3], '<f4').reshape(height, width, 3)
many = read('large.pfm').reshape(64, 16, 64, 16, 3).mean((1, 3))
def levels(light): return 255 * np.where(light < 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9)**(1 / 2.4) - 0.055)
def error(name):
    apart = levels(read(name)) - levels(many)
    return np.sqrt((apart**2).mean()), abs(apart).max()
(rms, worst), (before, worst_before), (least, _) = error('smooth.pfm'), error('one.pfm'), error('many.pfm')
print(rms, worst, before, worst_before, least)
assert rms < before / 2 and worst < 0.8 * worst_before and least < before / 4"
    vkt render $see --size 64 -v -o a.png 2>&1 | grep -Eq 'edges in [0-9.]+% of the pixels'
    vkt render $see --size 64 --explain -o b.png 2>&1 | grep -q 'one ray a pixel, through its middle, and 4 at edges'
    # The recipe, threads, and parts give the same picture.
    vkt render $see --size 64 --spp 16 -o more.png
    vkt history more.png | grep -q -- '--spp 16'
    vkt render $see --size 64 --spp 16 --threads 1 -o alone.png
    cmp more.png alone.png
    for part in 1 2 3; do vkt render $see --size 64 --tiles $part/3 -o part$part.png; done
    vkt image join part1.png part2.png part3.png -o joined.png
    vkt image diff joined.png a.png
}

@test "rays at edges are a power of two, and not what a goal decides" {
    fails_with 2 "2, 4, 8" vkt render $see --spp 3 -o a.png
    fails_with 2 "up to 1024" vkt render $see --spp 2048 -o a.png
    fails_with 2 "exclude each other" vkt render $see --spp 4 --tolerance 1 -o a.png
    fails_with 2 "does not apply" vkt render $f --spp 4 -o a.png
    fails_with 2 "Debian 12 has no package" vkt render $f -ra multi-scattering --denoise -o a.png
    fails_with 2 "does not apply" vkt render $f --denoise -o a.png
    [ ! -e a.png ]
    # A label is one of them or nothing, whatever the algorithm.
    vkt threshold $f --above 4 | vkt label -o labels.nrrd
    vkt render labels.nrrd -ra implicit-iso --shade none --background 0,0,0 --size 64 -o labels.pfm
    /usr/bin/python3 -c "
import numpy as np
pixels = np.frombuffer(open('labels.pfm', 'rb').read().split(b'\n', 3)[3], '<f4').reshape(-1, 3)
assert len(np.unique(pixels, axis=0)) == 2"
}

@test "the unit of length makes no difference to a picture, and one that floats do not hold is refused" {
    draw() { vkt set $f --spacing "$1" | vkt render --size 48 --opacity 0,0.3 --domain 0:15 -o "$2"; }
    draw 1 one.png
    for size in 1e-30 1e-9 1e30; do
        draw $size other.png
        vkt image diff one.png other.png --tolerance 0.01
        rm other.png
    done
    for size in 1e-60 1e40 1e200; do
        fails_with 3 "pictures take 1e-31 to 1e31" draw $size other.png
        [ ! -e other.png ]
    done
    fails_with 3 "pictures take 1e-31 to 1e31" vkt render <(vkt set $f --spacing 1,1,1e32) -ra implicit-iso -o other.png
}
