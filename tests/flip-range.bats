# vkt flip-range: volkit's name for flip with a region.
load helper

setup_more() { vkt make noise --seed 3 --dims 9 7 5 --dtype uint8 -o noise.nrrd; }

@test "mirrors the region and nothing else" {
    python_with numpy
    vkt read noise.nrrd | vkt write - --format raw >in.raw
    for axis in x y z; do
        vkt flip-range noise.nrrd --axis $axis --first 2 1 0 --last 8 6 4 | vkt write - --format raw >out.raw
        /usr/bin/python3 -c "
import numpy as np
a = np.fromfile('in.raw', np.uint8).reshape(5, 7, 9)
a[0:4, 1:6, 2:8] = np.flip(a[0:4, 1:6, 2:8], 'zyx'.index('$axis'))
assert (a == np.fromfile('out.raw', np.uint8).reshape(5, 7, 9)).all()"
        vkt flip $axis noise.nrrd --roi 2:8,1:6,0:4 2>/dev/null | vkt write - --format raw | cmp - out.raw
    done
}

@test "twice is nothing" {
    vkt flip-range noise.nrrd --axis z --first 1 1 1 --last 5 5 5 |
        vkt flip-range --axis z --first 1 1 1 --last 5 5 5 | vkt diff - noise.nrrd
}

@test "a region is needed, an axis has a name" {
    fails_with 2 '' vkt flip-range noise.nrrd --axis x -o out.nrrd
    fails_with 2 '' vkt flip-range noise.nrrd --axis w --first 0 0 0 --last 2 2 2 -o out.nrrd
    fails_with 2 '' vkt flip-range noise.nrrd --axis x --first 0 0 0 --last 2 2 6 -o out.nrrd
    [ ! -e out.nrrd ]
}
