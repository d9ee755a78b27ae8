# Annotated pictures: lengths and colours measured in the pixels, text against Pillow, refusals.
load helper

setup_more() {
    python_with cv2
    vkt make sphere --dims 40 40 40 --edge distance -o v.nrrd
    local here=0
    vkt render v.nrrd --size 8 --caption x -o probe.png 2>said || here=$?
    if [ "$here" = 1 ] && grep -q -e 'without it' -e 'no font' said; then skip "$(cat said)"; fi
}

# rows NAME: for python, the picture as red, green, blue.
rows='
import cv2, numpy as np
rows = lambda name: cv2.imread(name)[:, :, ::-1].astype(int)
def longest(mask):
    best = at = 0
    start = None
    for i, v in enumerate(list(mask) + [False]):
        if v and start is None: start = i
        if not v and start is not None:
            if i - start > best: best, at = i - start, start
            start = None
    return best, at
'

@test "the scale bar is as long as the world says" {
    # An orthographic picture of 40 units in 400 pixels: a quarter of the width is 10 units.
    vkt render v.nrrd --opacity 0,0 --projection orthographic --span 40 --size 400 --background 0,0,0 --annotate -o a.png -q
    # Perspective: 400 pixels are 2 * 100 * tan(15 degrees) at the target; a quarter is 13.4, so 10 units are 74.6.
    vkt render v.nrrd --opacity 0,0 --eye 19.5,-80.5,19.5 --target 19.5,19.5,19.5 --fov 30 --size 400 --background 1,1,1 --annotate -o b.png -q
    /usr/bin/python3 -c "$rows
for name, ink, want in ('a.png', 255, 100), ('b.png', 0, 10 * 400 / (200 * np.tan(np.radians(15)))):
    p = rows(name)
    length, at = longest((p[400 - 14] == ink).all(-1)[:200])
    assert abs(length - want) <= 0.5 and at == 13, (name, length, at, want)"
}

@test "the scale bar says its unit where there is one" {
    vkt set v.nrrd --attribute 'space units="mm" "mm" "mm"' -o mm.nrrd
    vkt set v.nrrd --attribute 'space units="mm" "mm" "um"' -o mixed.nrrd
    for f in v mm mixed; do
        vkt render $f.nrrd --opacity 0,0 --projection orthographic --span 40 --size 400 --background 0,0,0 --annotate -o $f.png -q
    done
    /usr/bin/python3 -c "$rows
def label(name): # columns of what is written above the bar
    written = (rows(name)[362:379, :200].max(-1) > 128).any(0)
    return np.flatnonzero(written)
plain, unit, mixed = label('v.png'), label('mm.png'), label('mixed.png')
print(np.ptp(plain), np.ptp(unit))
assert np.ptp(unit) > 2 * np.ptp(plain) and (plain == mixed).all()"
}

@test "the colour bar has the colours of the values, and ticks where these are" {
    vkt render v.nrrd --colormap grey --opacity 0,0 --domain -10:10 --size 400 --background 0.5,0,0 --annotate -o a.png -q
    /usr/bin/python3 -c "$rows
p = rows('a.png')
ink = (p == 255).all(-1)
sides = [x for x in range(200, 400) if longest(ink[:, x])[0] >= 240]
left, right = sides[0], sides[-1]
assert longest(ink[:, left]) == (242, 79), longest(ink[:, left])
bar = p[80:320, (left + right) // 2]
assert (bar[:, 0] == bar[:, 1]).all() and (bar[:, 0] == bar[:, 2]).all()
want = 255 * (239.5 - np.arange(240)) / 240
assert np.abs(bar[:, 0] - want).max() <= 1, np.abs(bar[:, 0] - want).max()
# Multiples of 5 in [-10, 10]
ticks = [y for y in range(70, 330) if ink[y, right + 1:right + 4].all() and 80 <= y < 320]
assert ticks == [80, 140, 200, 260, 319], ticks"
}

@test "values of surfaces stand beside their colours" {
    vkt render v.nrrd -ra implicit-iso --iso 2 5 --iso-color 1 0 0 0 0 1 --size 400 --background 0,0,0 --annotate -o a.png
    /usr/bin/python3 -c "$rows
p = rows('a.png')[:, 300:]
for y, colour in (86, (255, 0, 0)), (112, (0, 0, 255)):
    assert longest((p[y] == colour).all(-1))[0] == 13, (y, colour)"
}

@test "the axes are those of the world" {
    # From -y: x to the right, z up, y away.
    vkt render v.nrrd --opacity 0,0 --view -y --projection orthographic --size 400 --background 0,0,0 --annotate -o a.png -q
    vkt render v.nrrd --opacity 0,0 --view z --up -1,0,0 --projection orthographic --size 400 --background 0,0,0 --annotate -o b.png -q
    /usr/bin/python3 -c "$rows
middle = 12.5 * 4
def ways(name):
    p = rows(name)[:120, :120]
    where = lambda c: np.argwhere((p[:, :, c] > 150) & (p[:, :, (c + 1) % 3] < 130) & (p[:, :, (c + 2) % 3] < 130)).mean(0) - middle
    return where
a, b = ways('a.png'), ways('b.png')
assert abs(a(0)[0]) < 2 and a(0)[1] > 10, a(0)
assert abs(a(2)[1]) < 2 and a(2)[0] < -10, a(2)
# From above with -x upwards: x down, y to the right.
assert b(0)[0] > 10 and abs(b(0)[1]) < 2, b(0)
assert b(1)[1] > 10 and abs(b(1)[0]) < 2, b(1)"
}

@test "a caption is as wide as Pillow draws it, letters of other languages too" {
    python_with PIL.ImageFont
    font=$(find /usr/share/fonts -name DejaVuSans.ttf | head -1)
    [ -n "$font" ] || skip "no DejaVu Sans"
    for caption in 'A sphere, 40 voxels' 'Größe in µm: Δ ≤ 5'; do
        vkt render v.nrrd --opacity 0,0 --size 640x384 --background 0,0,0 --caption "$caption" --font "$font" -o a.png --force -q
        CAPTION=$caption FONT=$font /usr/bin/python3 -c "$rows
import os
from PIL import ImageFont
box = ImageFont.truetype(os.environ['FONT'], 12).getbbox(os.environ['CAPTION'])
there = np.argwhere(rows('a.png').sum(-1) > 150)
y0, x0, y1, x1 = *there.min(0), *(there.max(0) + 1)
assert abs((x1 - x0) - (box[2] - box[0])) <= 5 and abs((y1 - y0) - (box[3] - box[1])) <= 2, (x0, x1, y0, y1, box)
assert abs((x0 + x1) / 2 - 320) <= 2 and y1 <= 384"
    done
}

@test "annotations lie on the picture and change nothing beside them" {
    local -a from=(--eye 60,-90,60 --target 19.5,19.5,19.5)
    vkt render v.nrrd "${from[@]}" --size 300 -o a.png
    vkt render v.nrrd "${from[@]}" --size 300 --annotate --caption below -o b.png
    vkt render v.nrrd "${from[@]}" --size 300 --annotate --caption below --threads 1 -o c.png
    cmp b.png c.png
    /usr/bin/python3 -c "$rows
a, b = rows('a.png'), rows('b.png')
assert np.array_equal(a[80:260, 80:200], b[80:260, 80:200]) and (a != b).any(-1).mean() > 0.01"
    vkt render v.nrrd --size 300 --background 0,0,0,0 --opacity 0,0 --caption below -o clear.png -q
    /usr/bin/python3 -c "
import cv2
a = cv2.imread('clear.png', cv2.IMREAD_UNCHANGED)
assert a.shape[2] == 4 and a[:, :, 3].max() == 255 and a[:200, :, 3].max() == 0"
    vkt history b.png | grep -q -e '--annotate --caption below'
}

@test "what is written has room beside what is shown, in pictures of all shapes" {
    vkt make ramp --dims 24 24 24 --dtype uint8 | vkt arith mul - 0 | vkt arith add - 200 -o block.nrrd
    for size in 200x150 400 800x500 300x900; do
        # The block alone, lit from the camera, and the same with what is written: nothing of that lies on it.
        vkt render block.nrrd --opacity 1,1 --colormap grey --domain 100:300 --size $size --background 0,0,0 --annotate --caption 'A caption of several words that does not fit into the width of small pictures' -o a.png --force -q
        vkt render block.nrrd --opacity 1,1 --colormap grey --domain 100:300 --size $size --background 0.4,0,0 --annotate --caption 'A caption of several words that does not fit into the width of small pictures' -o b.png --force -q
        /usr/bin/python3 -c "$rows
a, b = rows('a.png'), rows('b.png')
block = (a == b).all(-1) & (a.max(-1) > 20) & (a.max(-1) < 250) & (np.ptp(a, axis=-1) == 0)
block[:, int(block.shape[1] * 0.95):] = False
ys, xs = np.nonzero(cv2.morphologyEx(block.astype(np.uint8), cv2.MORPH_OPEN, np.ones((9, 9), np.uint8)))
h, w = block.shape
size = max(9, min(h / 32, w / 24))
assert len(ys) > 0.05 * h * w, len(ys)
assert xs.max() < w - 3 * size and ys.max() < h - 2.4 * size, ('$size', xs.max(), ys.max())
# The caption is there in full: its left and right ends are within the picture.
ink = (a == 255).all(-1)
low = ink[int(h - 5 * size):]
assert not low[:, :2].any() and not low[:, -2:].any() and low.any(), '$size'"
    done
}

@test "numbers of ticks and surfaces are short" {
    vkt convert v.nrrd --dtype float32 | vkt arith mul - 1e-21 -o tiny.nrrd
    for domain in -6e-21:6e-21 -1e3:1e3 0:3e38; do
        vkt render tiny.nrrd --opacity 0,0 --domain=$domain --size 400 --background 0,0,0 --annotate -o a.png --force -q
        # The widest label is narrower than six digits with their exponent.
        /usr/bin/python3 -c "$rows
p = rows('a.png')
ink = (p == 255).all(-1)
sides = [x for x in range(200, 400) if longest(ink[:, x])[0] >= 240]
written = np.flatnonzero((p[70:330, sides[-1] + 6:].max(-1) > 128).any(0))
assert np.ptp(written) < 12.5 * 4.2, ('$domain', np.ptp(written))"
    done
}

@test "annotations that cannot be" {
    fails_with 4 "none.ttf" vkt render v.nrrd --caption x --font none.ttf -o a.png
    fails_with 3 "cannot be read" vkt render v.nrrd --caption x --font v.nrrd -o a.png
    fails_with 2 "--font is for" vkt render v.nrrd --font none.ttf -o a.png
    fails_with 2 "for whole pictures" vkt render v.nrrd --annotate --tiles 1/2 -o a.png
    [ ! -e a.png ]
}
