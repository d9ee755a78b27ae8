# vkt slice: planes against NumPy, pictures pixel for pixel against a decoder that is not vkt's.
load helper

setup_more() {
    python_with numpy
    for type in uint8:1 uint16:2 float16:2 float32:4 int64:8; do
        head -c $((13 * 11 * 7 * ${type#*:})) /dev/urandom >"v_13x11x7_${type%:*}.raw"
    done
}

raw() { vkt write "${1:--}" - --format raw; }

# same_slice IN BITS AXIS N: what is in out.raw.
same_slice() {
    /usr/bin/python3 -c "
import numpy as np
a = np.fromfile('$1', 'uint$2').reshape(7, 11, 13)
want = a.take($4, axis='zyx'.index('$3'))
assert want.tobytes() == open('out.raw', 'rb').read(), '$*'"
}

@test "every slice agrees with numpy, for every size of voxels" {
    for type in uint8:8 uint16:16 float16:16 float32:32 int64:64; do
        for place in x:0 x:12 y:5 z:0 z:3 z:-1; do
            vkt slice "v_13x11x7_${type%:*}.raw" --${place%:*} ${place#*:} --format raw -o out.raw --force
            same_slice "v_13x11x7_${type%:*}.raw" "${type#*:}" ${place%:*} ${place#*:}
        done
    done
    for axis in x:6 y:5 z:3; do
        vkt slice v_13x11x7_uint8.raw --axis ${axis%:*} --format raw -o out.raw --force
        same_slice v_13x11x7_uint8.raw 8 ${axis%:*} ${axis#*:}
    done
    vkt slice v_13x11x7_uint8.raw --axis z --z 4 --format raw -o out.raw --force
    same_slice v_13x11x7_uint8.raw 8 z 4
}

@test "slices are two-dimensional and keep their place in the world" {
    vkt set v_13x11x7_uint8.raw --spacing 0.5,1,2 --origin 10,20,30 -o s.nrrd
    vkt slice s.nrrd --x 4 -o x.nrrd
    vkt info x.nrrd | grep -x 'dims       11 7 1'
    vkt info x.nrrd | grep -x 'origin     12 20 30'
    vkt info x.nrrd | grep -x 'spacing    1 2 0.5'
    vkt crop s.nrrd --roi 4:5,:,: -o column.nrrd
    vkt permute zxy x.nrrd | vkt diff - column.nrrd --geometry
    vkt slice s.nrrd --z 4 | vkt diff - <(vkt crop s.nrrd --roi :,:,4:5) --geometry
}

@test "pictures are pixel for pixel, 8 and 16 bits" {
    python_with vtkmodules.vtkIOImage
    for type in uint8:8 uint16:16; do
        vkt slice v_13x11x7_${type%:*}.raw --y 3 | raw >want.raw
        for suffix in png pgm; do vkt slice v_13x11x7_${type%:*}.raw --y 3 -o s_${type%:*}.$suffix; done
        /usr/bin/python3 - ${type%:*} <<'EOF'
import sys
import numpy as np
from vtkmodules.vtkIOImage import vtkPNGReader
from vtkmodules.util.numpy_support import vtk_to_numpy
want = np.fromfile("want.raw", sys.argv[1]).reshape(7, 13)
reader = vtkPNGReader()
reader.SetFileName(f"s_{sys.argv[1]}.png")
reader.Update()
image = reader.GetOutput()
assert image.GetDimensions() == (13, 7, 1) and image.GetNumberOfScalarComponents() == 1
got = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(7, 13)[::-1] # VTK counts rows from below
assert got.dtype == want.dtype and np.array_equal(got, want)
head, size, most, pixels = open(f"s_{sys.argv[1]}.pgm", "rb").read().split(b"\n", 3)
assert (head, size, int(most)) == (b"P5", b"13 7", np.iinfo(want.dtype).max)
assert pixels == want.astype(want.dtype.newbyteorder(">")).tobytes()
EOF
    done
    vkt slice v_13x11x7_uint8.raw --y 3 --format png -o - | cmp - s_uint8.png
}

@test "--range maps values to 256 levels, as convert does" {
    vkt make noise --dims 13 11 7 --low -3 --high 8 -o n.nrrd
    for range in 0:5 minmax p1:p99; do
        vkt slice n.nrrd --x 4 --range $range -o a.nrrd --force 2>/dev/null
        vkt slice n.nrrd --x 4 | vkt convert --dtype uint8 --range $range 2>/dev/null | vkt diff - a.nrrd
        vkt read n.nrrd --slab 2 | vkt slice --x 4 --range $range 2>/dev/null | vkt diff - a.nrrd
    done
    # Cut off is what the range asks for.
    vkt slice n.nrrd --x 4 --range 0:5 --strict -o s.png
    /usr/bin/python3 -c "
import sys
sys.exit(open('s.png', 'rb').read(8) != b'\x89PNG\r\n\x1a\n')"
}

@test "slabs, threads, pipes and small budgets make no difference" {
    for place in x:4 y:4 z:4; do
        vkt slice v_13x11x7_float32.raw --${place%:*} 4 | raw >want.raw
        for options in '--slab 1' '--slab 3' '--slab 7' '--threads 1' '--threads 5' '--memory 100k'; do
            # shellcheck disable=SC2086
            vkt slice v_13x11x7_float32.raw --${place%:*} 4 $options | raw | cmp - want.raw
            # shellcheck disable=SC2086
            vkt read v_13x11x7_float32.raw --slab 2 | vkt slice --${place%:*} 4 $options | raw | cmp - want.raw
        done
    done
}

@test "several volumes are several pictures" {
    for i in 1 2 3; do vkt make noise --dims 9 8 7 --dtype uint8 --high 255 --seed $i -o in-$i.nrrd; done
    vkt read 'in-*.nrrd' | vkt slice --z 2 -o 'p-%02d.png'
    for i in 1 2 3; do vkt slice in-$i.nrrd --z 2 -o - --format png | cmp - p-0$((i - 1)).png; done
    fails_with 2 'several volumes' bash -c "vkt read 'in-*.nrrd' | vkt slice --z 2 -o one.png"
    [ ! -e one.png ]
}

@test "what cannot be is refused, and leaves no file" {
    local v=v_13x11x7_float32.raw
    fails_with 2 'outside of the volume' vkt slice $v --z 7 -o x.nrrd
    fails_with 2 'outside of the volume' vkt slice $v --z -8 -o x.nrrd
    fails_with 2 'one index' vkt slice $v --z 1 --x 1 -o x.nrrd
    fails_with 2 'different axes' vkt slice $v --axis x --z 1 -o x.nrrd
    fails_with 2 'uint8 or uint16, not float32' vkt slice $v --z 1 -o x.png
    fails_with 2 'holds one slice' vkt convert $v --dtype uint8 -o x.png
    fails_with 3 'its header is no PGM header' vkt read v_13x11x7_uint8.raw --format pgm -o x.nrrd
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical' vkt slice t.vkt --z 1 -o x.nrrd
    [ -z "$(ls x.* 2>/dev/null)" ]
}
