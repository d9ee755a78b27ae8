# Formats against programs that others wrote: teem's unu, VTK, ITK. Values and geometry agree in both directions.
load helper

setup_more() {
    python_with numpy
    /usr/bin/python3 - <<'END'
import numpy
rng = numpy.random.default_rng(5)
rng.integers(-3000, 3000, (7, 6, 5)).astype("<i2").tofile("a.raw")
(rng.normal(size=(7, 6, 5)) * 100).astype("<f4").tofile("f.raw")
END
}

voxels() { vkt write - --format raw; }

# unu under either name that it is installed as.
have_unu() {
    unu=$(command -v unu || command -v teem-unu) || skip "teem's unu is not installed"
    "$unu" make -i a.raw -t short -s 5 6 7 -e raw -en little -spc lps -dirs '(0,0.5,0) (-1.5,0,0) (0,0,2)' -orig '(1,-2,3.25)' -o a.nrrd
    "$unu" make -i f.raw -t float -s 5 6 7 -e raw -en little -spc ras -dirs '(0.6,0.8,0) (-1.6,1.2,0) (0,0,3)' -orig '(0.1,0.2,0.3)' -o f.nrrd
}

# geometry FILE SPACING ORIGIN DIRECTION: the JSON of `vkt info` says this.
geometry() {
    vkt info "$1" --json | python3 -c '
import json, sys
info, expected = json.load(sys.stdin), [json.loads(word) for word in sys.argv[1:]]
flat = lambda v: [x for row in v for x in (row if isinstance(row, list) else [row])]
for key, value in zip(["spacing", "origin", "direction"], expected):
    assert all(abs(a - b) < 1e-9 for a, b in zip(flat(info[key]), flat(value), strict=True)), (key, info[key], value)' "${@:2}"
}

@test "NRRD from unu in every encoding, attached and detached" {
    have_unu
    for encoding in raw gzip bzip2 ascii hex; do
        for name in x.nrrd x.nhdr; do
            for volume in a f; do
                "$unu" save -f nrrd -e $encoding -i $volume.nrrd -o $name
                vkt read $name >out.vkt || { echo "$encoding $name $volume" >&2; false; }
                if [ "$encoding$volume" != asciif ]; then
                    vkt read out.vkt | voxels | cmp - $volume.raw || { echo "$encoding $name $volume" >&2; false; }
                else
                    # unu prints six digits of a float.
                    vkt read out.vkt | voxels >back
                    /usr/bin/python3 -c '
import numpy
assert numpy.allclose(numpy.fromfile("back", "<f4"), numpy.fromfile("f.raw", "<f4"), rtol=1e-4, atol=1e-3)'
                fi
            done
            geometry $name "[1, 2, 3]" "[0.1, 0.2, 0.3]" "[[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]"
        done
    done
    geometry a.nrrd "[0.5, 1.5, 2]" "[1, -2, 3.25]" "[[0, 1, 0], [-1, 0, 0], [0, 0, 1]]"
}

@test "big-endian NRRD from unu" {
    have_unu
    for encoding in raw gzip hex; do
        for volume in a f; do
            "$unu" save -f nrrd -e $encoding -en big -i $volume.nrrd -o big.nrrd
            grep -aq '^endian: big' big.nrrd
            vkt read big.nrrd | voxels | cmp - $volume.raw
        done
    done
}

@test "NRRD data in several files, with lines and bytes to skip" {
    have_unu
    for z in 0 1 2 3 4 5 6; do
        { echo "a line"; printf 'xyz'; tail -c +$((z * 60 + 1)) a.raw | head -c 60; } >slice$z.bin
    done
    header() { printf 'NRRD0004\ntype: short\ndimension: 3\nsizes: 5 6 7\nencoding: raw\nendian: little\nline skip: 1\nbyte skip: 3\ndata file: %b\n' "$1"; }
    header 'slice%d.bin 0 6 1' >pattern.nhdr
    header 'LIST\nslice0.bin\nslice1.bin\nslice2.bin\nslice3.bin\nslice4.bin\nslice5.bin\nslice6.bin' >list.nhdr
    for name in pattern list; do
        "$unu" save -f nrrd -e raw -i $name.nhdr -o same.nrrd
        vkt read $name.nhdr | voxels | cmp - a.raw
        vkt read same.nrrd | voxels | cmp - a.raw
        vkt read $name.nhdr --roi 1:3,2:5,2:6 | voxels | cmp - <(vkt read same.nrrd --roi 1:3,2:5,2:6 | voxels)
    done
}

@test "axis mins, spacings and centers mean what unu takes them for" {
    have_unu
    "$unu" make -i a.raw -t short -s 5 6 7 -e raw -en little -sp 0.5 1.5 2 -o plain.nrrd
    "$unu" axinfo -a 0 -mm 10 12.5 -i plain.nrrd | "$unu" axinfo -a 0 -c cell -o cell.nrrd
    geometry cell.nrrd "[0.5, 1.5, 2]" "[10.25, 0, 0]" "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    "$unu" axinfo -a 0 -mm 10 12 -i plain.nrrd | "$unu" axinfo -a 0 -c node -o node.nrrd
    geometry node.nrrd "[0.5, 1.5, 2]" "[10, 0, 0]" "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
}

@test "unu reads what vkt writes, with the same geometry" {
    have_unu
    for volume in a f; do
        for name in o.nrrd o.nhdr; do
            for flag in "" --compress; do
                # shellcheck disable=SC2086
                vkt read $volume.nrrd | vkt write $name --force $flag
                "$unu" save -f nrrd -e raw -i $name -o back.nrrd
                "$unu" data back.nrrd | cmp - $volume.raw
                for field in "space:" "space directions:" "space origin:" "sizes:" "type:"; do
                    diff <(grep -a "^$field" $volume.nrrd) <(grep -a "^$field" back.nrrd)
                done
            done
        done
    done
    # A series, with its fourth axis.
    "$unu" join -a 3 -incr -i a.nrrd a.nrrd a.nrrd -o series.nrrd
    vkt read series.nrrd | vkt write series2.nrrd
    "$unu" head series2.nrrd | grep -qx 'sizes: 5 6 7 3'
    "$unu" slice -a 3 -p 2 -i series2.nrrd | "$unu" data - | cmp - a.raw
}

@test "MetaImage from VTK, plain and compressed, and back" {
    python_with vtk
    cat >vtk_write.py <<'END'
import numpy, vtk
from vtk.util.numpy_support import numpy_to_vtk
for name, kind in (("a", "<i2"), ("f", "<f4")):
    image = vtk.vtkImageData()
    image.SetDimensions(5, 6, 7)
    image.SetSpacing(0.5, 1.5, 2)
    image.SetOrigin(1, -2, 3.25)
    image.GetPointData().SetScalars(numpy_to_vtk(numpy.fromfile(name + ".raw", kind), deep=True))
    for compressed in (False, True):
        for extension in ("mha", "mhd"):
            writer = vtk.vtkMetaImageWriter()
            writer.SetInputData(image)
            writer.SetFileName(f"{name}{int(compressed)}.{extension}")
            writer.SetCompression(compressed)
            writer.Write()
END
    /usr/bin/python3 vtk_write.py
    for volume in a f; do
        for name in ${volume}0.mha ${volume}0.mhd ${volume}1.mha ${volume}1.mhd; do
            vkt read $name | voxels | cmp - $volume.raw
            geometry $name "[0.5, 1.5, 2]" "[1, -2, 3.25]" "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
            vkt read $name | vkt write "back_$name"
            vkt read $name | vkt write "packed_$name" --compress
        done
    done
    cat >vtk_read.py <<'END'
import glob, numpy, vtk
from vtk.util.numpy_support import vtk_to_numpy
names = glob.glob("back_*.mh?") + glob.glob("packed_*.mh?")
assert len(names) == 16, names
for name in names:
    reader = vtk.vtkMetaImageReader()
    reader.SetFileName(name)
    reader.Update()
    image = reader.GetOutput()
    volume, kind = ("a", "<i2") if "_a" in name else ("f", "<f4")
    assert image.GetDimensions() == (5, 6, 7), name
    assert image.GetSpacing() == (0.5, 1.5, 2) and image.GetOrigin() == (1, -2, 3.25), name
    assert (vtk_to_numpy(image.GetPointData().GetScalars()) == numpy.fromfile(volume + ".raw", kind)).all(), name
END
    /usr/bin/python3 vtk_read.py
}

@test "ITK reads what vkt writes as it reads what unu writes" {
    have_unu
    python_with SimpleITK
    for name in f.mha g.mhd f2.nrrd f2.nhdr; do
        vkt read f.nrrd | vkt write "$name"
        vkt read f.nrrd | vkt write "packed_$name" --compress
    done
    /usr/bin/python3 - <<'END'
import numpy, SimpleITK
reference = SimpleITK.ReadImage("f.nrrd")  # right-anterior-superior, which ITK turns into its own frame
voxels = SimpleITK.GetArrayFromImage(reference)
for name in ("f.mha", "g.mhd", "f2.nrrd", "f2.nhdr"):
    for prefix in ("", "packed_"):
        image = SimpleITK.ReadImage(prefix + name)
        assert (SimpleITK.GetArrayFromImage(image) == voxels).all(), name
        for a, b in ((image.GetOrigin(), reference.GetOrigin()), (image.GetSpacing(), reference.GetSpacing()),
                     (image.GetDirection(), reference.GetDirection())):
            assert numpy.allclose(a, b, atol=1e-12), (name, a, b)
END
}

@test "regions of every file equal that part of the whole" {
    have_unu
    vkt read a.nrrd -o whole.vkt
    for encoding in raw gzip bzip2 ascii hex; do "$unu" save -f nrrd -e $encoding -i a.nrrd -o e_$encoding.nrrd; done
    for name in b.mha b.mhd c.nhdr; do vkt write whole.vkt $name; done
    vkt write whole.vkt z.mha --compress
    for roi in 1:4,2:5,3:6 :,:,2 0,0,0 4:,5:,6: :,3:4,: 2:4,:,:; do
        vkt read whole.vkt --roi $roi | voxels >expected
        for name in e_*.nrrd b.mha b.mhd c.nhdr z.mha; do
            vkt read "$name" --roi $roi | voxels | cmp - expected || { echo "$name $roi" >&2; false; }
        done
    done
}
