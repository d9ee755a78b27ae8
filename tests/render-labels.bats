# Labels in pictures: the colours, the legend, who says that there are some, what is refused.
load helper

setup_more() {
    python_with cv2
    # A box of 16 voxels a side in 24: the left half is label 1, the right half label 2.
    /usr/bin/python3 - <<'END'
import numpy as np
a = np.zeros((24, 24, 24), np.uint8)
a[4:20, 4:20, 4:12] = 1
a[4:20, 4:20, 12:20] = 2
a.tofile("halves.raw")
b = np.zeros((4, 4, 120), np.uint8)
b[:] = 1 + np.arange(120) // 2
b.tofile("many.raw")
END
    vkt read halves.raw --dims 24 24 24 --dtype uint8 -o plain.nrrd
    vkt set plain.nrrd --attribute Segment0_LabelValue=2 Segment0_Name=kidney Segment0_Color='0 0.5 1' \
        Segment1_LabelValue=1 Segment1_Color='1 0.5 0' -o named.nrrd
    front="--view -y --projection orthographic --span 24 --fit volume --size 96 --background 0,0,0"
}

# colours FILE: how many there are, and each as red, green, blue.
colours() {
    /usr/bin/python3 -c "
import cv2, numpy as np, sys
p = cv2.imread(sys.argv[1])[:, :, ::-1].reshape(-1, 3)
print(sorted(map(tuple, np.unique(p, axis=0).tolist())))" "$1"
}

@test "a volume whose header says labels shows their colours and no others" {
    vkt render named.nrrd $front --shade none -o a.png -v 2>said
    grep -q 'labels, 2 of them, nearest voxel' said
    [ "$(colours a.png)" = '[(0, 0, 0), (0, 128, 255), (255, 128, 0)]' ]
    # Marched, the same volume has colours between.
    vkt render named.nrrd $front --shade none --labels never -o b.png
    [ "$(colours b.png)" != "$(colours a.png)" ]
    # Light changes how bright a label is, and not which one it is.
    vkt render named.nrrd --azimuth 30 --specular 0 --size 96 --background 0,0,0 -o c.png
    /usr/bin/python3 -c "
import cv2, numpy as np
p = cv2.imread('c.png')[:, :, ::-1].reshape(-1, 3).astype(float)
p = p[p.max(1) > 0]
linear = lambda v: np.where(v <= 0.04045 * 255, v / 255 / 12.92, ((v / 255 + 0.055) / 1.055) ** 2.4)
p = linear(p)
one, two = linear(np.array([255, 128, 0.])), linear(np.array([0, 128, 255.]))
near = lambda c: np.abs(p - np.outer(p @ c / (c @ c), c)).max(1) < 0.02
assert (near(one) | near(two)).all() and near(one).sum() > 500 and near(two).sum() > 500"
}

@test "labels without a stated colour have the one that a segmentation writes" {
    vkt convert plain.nrrd out.seg.nrrd
    vkt render out.seg.nrrd $front --shade none -o a.png
    vkt render plain.nrrd $front --shade none --labels always -o b.png
    cmp <(colours a.png) <(colours b.png)
    sed -n '/^$/q;p' out.seg.nrrd | grep -a '^Segment[01]_Color:=' | sed 's/.*=//' | /usr/bin/python3 -c "
import cv2, numpy as np, sys
p = cv2.imread('a.png')[:, :, ::-1].astype(float)
for column, line in zip((32, 64), sys.stdin):
    assert np.abs(p[48, column] - 255 * np.array(line.split(), float)).max() <= 0.6, (p[48, column], line)"
}

@test "vkt label and vkt watershed say that they make labels, and names of others are forgotten" {
    vkt label named.nrrd -o l.nrrd
    vkt info l.nrrd | grep -q 'meaning.*labels'
    run ! grep -aq '^Segment' l.nrrd
    vkt render l.nrrd --size 32 -o a.png -v 2>said
    grep -q 'labels, 1 of them' said
    vkt filter gaussian plain.nrrd --sigma 1 | vkt watershed -o w.nrrd
    vkt info w.nrrd | grep -q 'meaning.*labels'
    vkt render plain.nrrd --size 32 -o b.png -v 2>said
    grep -q 'ray marching' said
    vkt set plain.nrrd --attribute intent_code=1002 | vkt render --size 32 -o c.png -v 2>said
    grep -q 'labels, 2 of them' said
}

@test "the legend has a colour and a name or number for each label, and counts what does not fit" {
    local here=0
    vkt render plain.nrrd --size 8 --caption x -o probe.png 2>said || here=$?
    if [ "$here" = 1 ] && grep -q -e 'without it' -e 'no font' said; then skip "$(cat said)"; fi
    vkt render named.nrrd --clip-box :,:,0:1 --size 400 --background 0,0,0 --annotate -o a.png -q
    vkt read many.raw --dims 120 4 4 --dtype uint8 | vkt set --attribute meaning=labels -o many.nrrd
    vkt render many.nrrd --clip-box 0:1,0:1,0:1 --eye 400,2,2 --target 500,2,2 --size 400 --background 0,0,0 --annotate -o b.png -q
    /usr/bin/python3 -c "
import cv2, numpy as np
def rows(name): return cv2.imread(name)[:, :, ::-1].astype(int)
def swatches(p):
    # Runs of one colour 11 pixels wide or more, not black and no ink, a row each 26 pixels.
    found = []
    for y in range(86, 400, 26):
        row = p[y, 200:]
        same = [tuple(row[i]) for i in range(len(row) - 11) if (row[i:i + 11] == row[i]).all() and 0 < row[i].max() and not (row[i] == 255).all()]
        if same: found.append(same[0])
    return found
assert swatches(rows('a.png')) == [(255, 128, 0), (0, 128, 255)], swatches(rows('a.png'))
# Ten fit above the last row, which has words and no colour.
many = swatches(rows('b.png'))
assert len(many) == 10 and len(set(many)) == 10, many
last = rows('b.png')[80 + 26 * 10:80 + 26 * 10 + 14, 200:]
assert (last == 255).all(-1).any()"
}

@test "what is calculated from labels is not said to be labels, what is moved is" {
    vkt label named.nrrd -o l.nrrd
    labels() { vkt info | grep -a '^attribute.*\(meaning: labels\|Segment\)' >marks; }
    for volume in named.nrrd l.nrrd; do
        for words in 'flip x' 'crop --roi 1:,:,:' 'filter median' 'rotate --angle 20 --method nearest' 'fill-holes' \
            'resample --scale 0.5 --method nearest' 'convert --dtype uint16' 'slice --z 4' 'arith add - 1'; do
            vkt $words <$volume | labels
        done
        for words in 'filter gaussian --sigma 1' 'filter box' 'filter sobel' 'rotate --angle 20' 'resample --scale 0.5' \
            'distance' 'scan' 'project mean' 'clahe' 'convert --dtype uint8 --range 0:9'; do
            run ! labels < <(vkt $words <$volume)
        done
    done
    # A mask, smoothed, is drawn as the body that it is.
    vkt convert l.nrrd --dtype uint8 | vkt arith mul - 200 | vkt filter gaussian --sigma 2 | vkt render --size 32 -o a.png -v 2>said
    grep -q 'ray marching' said
}

@test "what labels cannot be drawn with is refused, and why" {
    fails_with 2 "the maximum of labels along a ray is no label" vkt render named.nrrd --labels always -ra maximum -o a.png
    fails_with 2 "nothing is scattered in them" vkt render named.nrrd --labels always -ra multi-scattering -o a.png
    fails_with 2 "colours of its own" vkt render named.nrrd --labels always --colormap grey -o a.png
    fails_with 2 "colours of its own" vkt render named.nrrd --labels always -ra implicit-iso --iso 1 -o a.png
    vkt convert plain.nrrd --dtype float32 | vkt filter gaussian --sigma 1 -o soft.nrrd
    fails_with 2 "whole numbers" vkt render soft.nrrd --labels always -o a.png
    fails_with 2 "the cells are no integers" vkt render <(vkt make amr --blocks 20 --levels 2) --labels always --size 16 -o a.png
    # Own colours, or a projection, are a wish for these.
    vkt render named.nrrd --colormap grey --size 16 -o grey.png -v 2>said
    grep -q 'ray marching' said
    vkt render named.nrrd -ra maximum --size 16 -o maximum.png -v 2>said
    grep -q 'maximum of the values' said
}

@test "a hierarchical volume of labels is drawn as the grid that it stands for" {
    vkt refine named.nrrd --tolerance 0.5 --method nearest --block-size 4 -o tree.vkt
    vkt info tree.vkt | grep -q 'blocks\|bricks'
    for more in "" "--clip-box 2:,:,:11"; do
        vkt render named.nrrd --size 48 $more -o grid.png --force
        vkt render tree.vkt --size 48 $more -o tree.png -v --force 2>said
        grep -q 'labels, 2 of them' said
        /usr/bin/python3 -c "
import cv2
assert (cv2.imread('grid.png') == cv2.imread('tree.png')).all()"
    done
    vkt set tree.vkt --attribute meaning= | vkt render --labels never --size 16 -o marched.png -v 2>said
    grep -q 'ray marching' said
    fails_with 5 "memory" vkt render tree.vkt --size 16 --memory 20K -o a.png
}

@test "threads and instruction sets change no bit, and a tolerance smooths the edges" {
    vkt render named.nrrd --size 64 --light-direction 1,-1,2 --shadows --ambient-occlusion 8 --threads 1 -o one.png
    vkt render named.nrrd --size 64 --light-direction 1,-1,2 --shadows --ambient-occlusion 8 --threads 3 -o three.png
    cmp <(colours one.png) <(colours three.png)
    /usr/bin/python3 -c "
import cv2
assert (cv2.imread('one.png') == cv2.imread('three.png')).all()"
    vkt render named.nrrd --size 32 --tolerance 1 -o fine.png -v 2>said
    grep -q 'rays a pixel' said
}
