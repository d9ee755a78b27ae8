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

@test "what unu makes of a volume with a space and spacings is a volume" {
    have_unu
    # teem writes "space directions: none none none" beside the spacings.
    "$unu" make -i a.raw -t short -s 5 6 7 -e raw -en little -spc lps -sp 0.5 1.5 2 -o s.nrrd
    "$unu" make -i a.raw -t short -s 5 6 7 -e raw -en little -spc lps -sp 0.5 1.5 2 -k space space space -o k.nrrd
    grep -aq '^space directions: none none none' s.nrrd
    for name in s.nrrd k.nrrd; do
        vkt read $name | voxels | cmp - a.raw
        geometry $name "[0.5, 1.5, 2]" "[0, 0, 0]" "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
        vkt info $name | grep -q 'space: left-posterior-superior'
        "$unu" crop -min 1 0 2 -max M M M-1 -i $name | vkt info --json >crop.json
        "$unu" resample -s 10 = = -i $name | vkt info --json >resample.json
        for axis in 0 1 2; do
            "$unu" slice -a $axis -p 2 -i $name | "$unu" axinsert -a $axis | vkt info --json >slice$axis.json
        done
        python3 - <<'END'
import json
def load(name):
    info = json.load(open(name + ".json"))
    return info["dims"], info["spacing"]
assert load("crop") == ([4, 6, 4], [0.5, 1.5, 2]), load("crop")
assert load("resample") == ([10, 6, 7], [0.25, 1.5, 2]), load("resample")
assert load("slice0") == ([1, 6, 7], [1, 1.5, 2]), load("slice0")
assert load("slice1") == ([5, 1, 7], [0.5, 1, 2]), load("slice1")
assert load("slice2") == ([5, 6, 1], [0.5, 1.5, 1]), load("slice2")
END
        "$unu" slice -a 1 -p 2 -i $name | "$unu" data - >expected
        "$unu" slice -a 1 -p 2 -i $name | "$unu" axinsert -a 1 | vkt read - | voxels | cmp - expected
    done
    # With vectors the slice lies where it was cut out, and its third axis is perpendicular.
    "$unu" slice -a 2 -p 2 -i a.nrrd | "$unu" axinsert -a 2 -o z.nrrd
    geometry z.nrrd "[0.5, 1.5, 1]" "[1, -2, 7.25]" "[[0, 1, 0], [-1, 0, 0], [0, 0, 1]]"
    "$unu" slice -a 1 -p 2 -i a.nrrd | "$unu" axinsert -a 1 -o y.nrrd
    geometry y.nrrd "[0.5, 1, 2]" "[-2, -2, 3.25]" "[[0, 1, 0], [-1, 0, 0], [0, 0, 1]]"
    # An axis may have a spacing, but no direction of its own.
    "$unu" axinfo -a 2 -sp 4 -i z.nrrd -o thick.nrrd
    geometry thick.nrrd "[0.5, 1.5, 4]" "[1, -2, 7.25]" "[[0, 1, 0], [-1, 0, 0], [0, 0, 1]]"
}

@test "NRRD: colours, vectors and lists are a volume each, whichever axis they are" {
    have_unu
    seq 1 210 | head -c 630 >values.raw
    # What unu cuts out of the file, volume by volume.
    same_as_slices() { # FILE AXIS COUNT
        local i
        for i in $(seq 0 $(($3 - 1))); do
            "$unu" slice -a "$2" -p "$i" -i "$1" | "$unu" data - >expected
            vkt read "$1" --index "$i" | voxels | cmp - expected
        done
        [ "$(vkt read "$1" | vkt write - --format raw | wc -c)" -eq "$("$unu" save -f nrrd -e raw -i "$1" | "$unu" data - | wc -c)" ]
    }
    for kind in RGB-color list vector 3-vector time none '???'; do
        "$unu" make -i values.raw -t uchar -s 3 6 5 7 -e raw -k $kind domain domain domain -o first.nrrd
        same_as_slices first.nrrd 0 3
        "$unu" make -i values.raw -t uchar -s 6 5 7 3 -e raw -k domain domain domain $kind -o last.nrrd
        same_as_slices last.nrrd 3 3
    done
    "$unu" make -i values.raw -t uchar -s 42 5 3 -e raw -k domain domain RGB-color -o picture.nrrd
    same_as_slices picture.nrrd 2 3
    vkt info picture.nrrd --json | grep -q '"dims": \[42,5,1\]'
    head -c 210 values.raw >short.raw
    "$unu" make -i short.raw -t short -s 3 5 7 -e raw -en big -k vector domain domain -o picture.nrrd
    for i in 0 1 2; do
        "$unu" slice -a 0 -p $i -i picture.nrrd | "$unu" save -f nrrd -e raw -en little | "$unu" data - >expected
        vkt read picture.nrrd --index $i | voxels | cmp - expected
    done
    # Compressed ones are decoded once, and kept while they are read; from a pipe as well.
    "$unu" make -i values.raw -t uchar -s 3 6 5 7 -e raw -k list domain domain domain -o first.nrrd
    for encoding in gzip bzip2 hex ascii; do
        "$unu" save -f nrrd -e $encoding -i first.nrrd -o packed.nrrd
        same_as_slices packed.nrrd 0 3
        vkt read first.nrrd | vkt write - --format raw >plain.raw
        vkt read - <packed.nrrd | vkt write - --format raw | cmp - plain.raw
        cat packed.nrrd | vkt crop --roi 1:4,2:3,1:7:2 | vkt write - --format raw >part.raw
        vkt crop first.nrrd --roi 1:4,2:3,1:7:2 | vkt write - --format raw | cmp - part.raw
    done
    # Lists of vectors: the slow axis enumerates, the fast one holds components.
    "$unu" make -i values.raw -t uchar -s 3 2 5 7 3 -e raw -k vector domain domain domain list -o both.nrrd
    "$unu" slice -a 4 -p 2 -i both.nrrd | "$unu" slice -a 0 -p 1 | "$unu" data - >expected
    vkt read both.nrrd --index 7 | voxels | cmp - expected
    "$unu" make -i values.raw -t uchar -s 6 3 5 7 -e raw -k domain list domain domain -o middle.nrrd
    fails_with 3 "axis 1 holds 3 values for each voxel (list)" vkt info middle.nrrd
    # The command that the refusal names makes a sequence of it.
    fails_with 3 "or make it a sequence: unu permute -p 0 2 3 1 | unu axinfo -a 3 -k list" vkt info middle.nrrd
    "$unu" permute -p 0 2 3 1 -i middle.nrrd | "$unu" axinfo -a 3 -k list | vkt read - | voxels | wc -c | grep -qx 630
}

@test "NRRD: where a list lies along its axis is kept" {
    have_unu
    seq 1 210 | head -c 630 >values.raw
    "$unu" make -i values.raw -t uchar -s 3 6 5 7 -e raw -k time domain domain domain -sp 0.5 1 2 3 -o first.nrrd
    vkt info first.nrrd | grep "sequence position" >positions || vkt info first.nrrd >&2
    [ "$(wc -l <positions)" -eq 3 ]
    vkt convert first.nrrd last.nrrd
    [ "$("$unu" head last.nrrd | sed -n 's/^sizes: //p')" = "6 5 7 3" ]
    [ "$("$unu" head last.nrrd | sed -n 's/^kinds: //p')" = "domain domain domain time" ]
    "$unu" permute -p 1 2 3 0 -i first.nrrd | "$unu" data - >expected
    "$unu" data last.nrrd | cmp - expected
    # Without kinds a spacing that is no number says it: of the first axis, what unu join puts there, not of the last.
    "$unu" make -i a.raw -t short -s 5 6 7 -e raw -en little -sp 0.5 1.5 2 -o plain.nrrd
    "$unu" join -a 0 -incr -i plain.nrrd plain.nrrd -o channels.nrrd
    for i in 0 1; do
        vkt read channels.nrrd --index $i | voxels | cmp - a.raw
        vkt read channels.nrrd --index $i --force -o one.nrrd
        geometry one.nrrd "[0.5, 1.5, 2]" "[0, 0, 0]" "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    done
    "$unu" join -a 3 -incr -i plain.nrrd plain.nrrd -o times.nrrd
    [ "$(vkt read times.nrrd | vkt write - --format raw | wc -c)" -eq 840 ]
    "$unu" axinsert -a 0 -i plain.nrrd | vkt read - | voxels | cmp - a.raw
}

@test "NIfTI and MetaImage: colours, complex numbers, vectors and channels are a volume each" {
    python_with nibabel
    /usr/bin/python3 - <<'END'
import nibabel, numpy, zlib
rng = numpy.random.default_rng(3)
def keep(name, array):  # x first, as the volumes follow one another
    array.T.tofile(name + ".raw")
colours = rng.integers(0, 256, (5, 4, 3, 3), dtype="u1")
packed = colours.view([("R", "u1"), ("G", "u1"), ("B", "u1")])[..., 0]
for name in "rgb.nii", "rgb.nii.gz":
    nibabel.save(nibabel.Nifti1Image(packed, numpy.diag([1, 2, 3, 1])), name)
    keep(name, colours)
opaque = rng.integers(0, 256, (5, 4, 3, 4), dtype="u1")
nibabel.save(nibabel.Nifti1Image(opaque.view([(c, "u1") for c in "RGBA"])[..., 0], numpy.eye(4)), "rgba.nii")
keep("rgba.nii", opaque)
waves = (rng.normal(size=(5, 4, 3, 2)) + 1j * rng.normal(size=(5, 4, 3, 2))).astype("c8")
nibabel.save(nibabel.Nifti1Image(waves, numpy.eye(4)), "waves.nii")
keep("waves.nii", waves.view("f4").reshape(5, 4, 3, 2, 2).transpose(0, 1, 2, 4, 3))
keep("waves.nii.turned", waves.view("f4").reshape(5, 4, 3, 2, 2))  # as NIfTI has channels, outside of times
warp = rng.normal(size=(5, 4, 3, 1, 3)).astype("f4")
image = nibabel.Nifti1Image(warp, numpy.eye(4))
image.header.set_intent("vector")
for name in "warp.nii", "warp.nii.gz":
    nibabel.save(image, name)
    keep(name, warp)
steps = rng.normal(size=(5, 4, 3, 2, 3)).astype("f4")
nibabel.save(nibabel.Nifti1Image(steps, numpy.eye(4)), "steps.nii")
keep("steps.nii", steps)
channels = rng.integers(-99, 99, (3, 5, 4, 3), dtype="i2").copy(order="F")
head = "ObjectType = Image\nNDims = 3\nDimSize = 5 4 3\nElementType = MET_SHORT\nElementNumberOfChannels = 3\n"
data = channels.T.tobytes()
open("plain.mha", "wb").write((head + "ElementDataFile = LOCAL\n").encode() + data)
packed = zlib.compress(data)
head += f"CompressedData = True\nCompressedDataSize = {len(packed)}\n"
open("packed.mha", "wb").write((head + "ElementDataFile = LOCAL\n").encode() + packed)
for name in "plain.mha", "packed.mha":
    channels.transpose(1, 2, 3, 0).T.tofile(name + ".raw")
END
    for name in rgb.nii rgb.nii.gz rgba.nii waves.nii warp.nii warp.nii.gz steps.nii plain.mha packed.mha; do
        vkt read $name | voxels | cmp - $name.raw || { echo "$name" >&2; false; }
        vkt read - <$name | voxels | cmp - $name.raw
        # What they are written as holds the same, and says nothing of the first channel alone.
        for suffix in nrrd mha nii nii.gz; do
            vkt read $name -o series.$suffix --force
            want=$name.raw
            case $name$suffix in waves.niinii*) want=$name.turned.raw ;; esac
            vkt read series.$suffix | voxels | cmp - $want || { echo "$name $suffix" >&2; false; }
        done
        run ! grep -a -q channel series.nrrd
    done
    [ "$(vkt info steps.nii | grep -c 'channel: 2')" -eq 2 ]
    # Vectors become vectors again, along the fifth axis, with what they are.
    /usr/bin/python3 - <<'END'
import nibabel, subprocess
for name in "warp.nii", "warp.nii.gz":
    subprocess.run(["vkt", "convert", name, "back-" + name], check=True)
    back, before = nibabel.load("back-" + name), nibabel.load(name)
    assert back.shape == before.shape == (5, 4, 3, 1, 3), back.shape
    assert back.header["intent_code"] == 1007 and (back.get_fdata() == before.get_fdata()).all()
END
    vkt read back-warp.nii | voxels | cmp - warp.nii.raw
    # A region of one channel reads what its rows need.
    vkt make noise --dims 64 64 64 --dtype uint8 --format raw | head -c 196608 >many.raw
    { printf 'NRRD0004\ntype: uint8\ndimension: 4\nsizes: 3 64 64 16\nkinds: list domain domain domain\nencoding: raw\n\n'; cat many.raw; } >many.nrrd
    vkt read many.nrrd --index 1 --roi 3:9,5:7,2:5 | voxels >part.raw
    /usr/bin/python3 -c 'import numpy, sys
a = numpy.fromfile("many.raw", "u1").reshape(16, 64, 64, 3)[2:5, 5:7, 3:9, 1]
assert a.tobytes() == open("part.raw", "rb").read()'
}

@test "NIfTI: units that differ between axes become millimetres; a frame that nobody named is said" {
    python_with nibabel
    { printf 'NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 3 2\nspace: right-anterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0.5,1)\nspace units: "mm" "um" "cm"\nspace origin: (1,2,3)\nencoding: raw\n\n'; head -c 24 /dev/zero; } >mixed.nrrd
    vkt convert mixed.nrrd mixed.nii
    /usr/bin/python3 -c '
import nibabel, numpy
image = nibabel.load("mixed.nii")
want = [[1, 0, 0, 1], [0, 1e-3, 5e-4, 2e-3], [0, 0, 10, 30], [0, 0, 0, 1]]
assert numpy.allclose(image.affine, want, atol=1e-6), image.affine
assert image.header.get_xyzt_units()[0] == "mm"'
    vkt diff mixed.nii mixed.nrrd --geometry # whoever reads ours finds what was written
    vkt make ramp --dims 4 3 2 -o plain.nrrd
    vkt convert plain.nrrd plain.nii 2>said
    [ ! -s said ] # it lies where every frame has it
    vkt set plain.nrrd --origin 5,6,7 -o moved.nrrd
    vkt convert moved.nrrd moved.nii 2>said
    grep -q "does not say what its axes mean, and those of NIfTI are right-anterior-superior" said
    vkt edit moved.nrrd --attribute space=LPS | vkt write - lps.nii 2>said
    [ ! -s said ]
    /usr/bin/python3 -c 'import nibabel; assert (nibabel.load("lps.nii").affine[:3, 3] == [-5, -6, 7]).all()'
}

@test "attributes that differ between the volumes of one file are not those of the first" {
    for i in 1 2 3; do
        vkt make constant --dims 4 3 2 --value $i -o $i.nrrd
        vkt edit $i.nrrd --attribute scan=$i --attribute site=here --no-history -o $i.vkt
    done
    for suffix in nrrd mha nii nii.gz; do
        vkt stack 1.vkt 2.vkt 3.vkt -o all.$suffix
        cat 1.vkt 2.vkt 3.vkt | vkt write - sequence.$suffix 2>said
        grep -q "does not hold attributes that differ between its volumes (scan): not kept" said || { cat said >&2; false; }
        vkt info sequence.$suffix >info
        [ "$(grep -c 'site: here' info)" -eq 3 ]
        run ! grep -q scan info
        cat 1.vkt 2.vkt 3.vkt | voxels >raw
        vkt read sequence.$suffix | voxels | cmp - raw
    done
}

@test "voxels that come last in a compressed file: NRRD around NIfTI" {
    python_with nibabel
    /usr/bin/python3 - <<'END'
import bz2, gzip, nibabel, numpy
voxels = numpy.fromfile("a.raw", "<i2").reshape(7, 6, 5).T
nibabel.save(nibabel.Nifti1Image(voxels, numpy.diag([0.5, 1.5, 2, 1])), "a.nii.gz")
whole = gzip.open("a.nii.gz").read()
open("two.gz", "wb").write(gzip.compress(whole[:500]) + gzip.compress(whole[500:]))  # as bgzip writes
open("a.nii.bz2", "wb").write(bz2.compress(whole))
for name, encoding in (("a.nii.gz", "gzip"), ("two.gz", "gzip"), ("a.nii.bz2", "bzip2")):
    open(name + ".nhdr", "w").write("NRRD0004\ntype: short\ndimension: 3\nsizes: 5 6 7\nspacings: 0.5 1.5 2\n"
        f"encoding: {encoding}\nendian: little\nbyte skip: -1\ndata file: {name}\n")
open("attached.nrrd", "wb").write(b"NRRD0004\ntype: short\ndimension: 3\nsizes: 5 6 7\nencoding: gzip\nendian: little\n"
    b"byte skip: -1\n\n" + open("a.nii.gz", "rb").read())
open("short.nii.gz", "wb").write(gzip.compress(whole[-300:]))
END
    vkt read a.raw --dims 5 6 7 --dtype int16 --roi 1:3,2:5,2:6 | voxels >expected
    for name in a.nii.gz.nhdr two.gz.nhdr a.nii.bz2.nhdr attached.nrrd; do
        vkt read $name | voxels | cmp - a.raw || { echo "$name" >&2; false; }
        vkt read $name --roi 1:3,2:5,2:6 | voxels | cmp - expected
    done
    sed 's/a.nii.gz/short.nii.gz/' a.nii.gz.nhdr >short.nhdr
    fails_with 3 "420 bytes expected, 300 found" bash -c 'vkt read short.nhdr >/dev/null'
    fails_with 3 "needs a file" vkt read - < <(cat attached.nrrd)
}

@test "bytes behind the last voxel of NRRD and MetaImage are told, plain and compressed; damage in them is an error" {
    /usr/bin/python3 - <<'END'
import gzip, zlib
voxels = bytes(range(60))
nrrd = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: %s\n\n"
meta = b"NDims = 3\nDimSize = 5 4 3\nElementType = MET_UCHAR\nCompressedData = %s\nElementDataFile = LOCAL\n"
for name, more in ("good", b""), ("few", b"xyz"), ("one", b"x"), ("many", b"xyz" * 200000):
    all = voxels + more
    for path, content in ((name + "_raw.nrrd", nrrd % b"raw" + all), (name + "_gzip.nrrd", nrrd % b"gzip" + gzip.compress(all)),
                          (name + "_raw.mha", meta % b"False" + all), (name + "_zlib.mha", meta % b"True" + zlib.compress(all))):
        open(path, "wb").write(content)
        open(path.replace(name, "bad_" + name), "wb").write(content[:-3] + bytes([content[-3] ^ 1]) + content[-2:])
    open(name + "_wrapped.nrrd.gz", "wb").write(gzip.compress(nrrd % b"raw" + all))
    open(name + "_beside.raw", "wb").write(all)
    open(name + "_beside.nhdr", "wb").write((nrrd % b"raw")[:-1] + b"data file: " + name.encode() + b"_beside.raw\n")
open("sum", "w").write(str(sum(voxels)))
END
    for kind in wrapped.nrrd.gz beside.nhdr; do
        vkt stats good_$kind 2>err | grep -q "sum *$(cat sum)$"
        [ ! -s err ]
        vkt stats few_$kind 2>err | grep -q "sum *$(cat sum)$"
        grep -q "holds 3 bytes more than the voxels that its header names: not read" err
    done
    for kind in raw.nrrd gzip.nrrd raw.mha zlib.mha; do
        vkt stats good_$kind 2>err | grep -q "sum *$(cat sum)$"
        [ ! -s err ]
        vkt stats few_$kind 2>err | grep -q "sum *$(cat sum)$"
        grep -q "vkt stats: 'few_$kind' holds 3 bytes more than the voxels that its header names: not read" err
        vkt read many_$kind -o many.raw --force 2>err
        cmp -n 60 many.raw good_raw.mha 0 "$(($(stat -c %s good_raw.mha) - 60))"
        grep -q "holds 600000 bytes more" err
        vkt stats one_$kind --quiet 2>err >told
        [ ! -s err ]
        vkt stats one_$kind 2>&1 >told | grep -q 'holds 1 byte more'
    done
    fails_with 3 damaged vkt stats bad_many_gzip.nrrd
    fails_with 3 damaged vkt stats bad_many_zlib.mha
}

@test "matrix rows of MetaImage that are not unit vectors scale the spacing, as in ITK" {
    python_with SimpleITK
    /usr/bin/python3 - <<'END'
def write(name, fields):
    open(name, "wb").write(("ObjectType = Image\nNDims = 3\nDimSize = 5 6 7\nElementType = MET_SHORT\n" + fields +
        "ElementDataFile = LOCAL\n").encode() + open("a.raw", "rb").read())
write("rows.mha", "ElementSpacing = 1 2 3\nTransformMatrix = 0 2 0 -3 0 0 0 0 0.5\nOffset = 10 20 30\n")
write("negative.mha", "ElementSpacing = 1 -2 3\nOffset = 10 20 30\n")
write("oblique.mha", "ElementSpacing = 0.5 2 3\nTransformMatrix = 1.2 1.6 0 -4 3 0 0.3 0 0.4\nOffset = 10 20 30\n")
END
    for name in rows negative oblique; do
        vkt info $name.mha --json >$name.json
        vkt read $name.mha | vkt write back_$name.mha
    done
    /usr/bin/python3 - <<'END'
import itertools, json, numpy, SimpleITK
for name in ("rows", "negative", "oblique"):
    info = json.load(open(name + ".json"))
    for image in (SimpleITK.ReadImage(name + ".mha"), SimpleITK.ReadImage("back_" + name + ".mha")):
        for index in itertools.product((0, 3), repeat=3):
            ours = numpy.array(info["origin"]) + sum(i * s * numpy.array(d) for i, s, d in
                                                    zip(index, info["spacing"], info["direction"]))
            assert numpy.allclose(ours, image.TransformIndexToPhysicalPoint(index), atol=1e-12), (name, index)
END
}

@test "units, thicknesses and labels survive" {
    have_unu
    "$unu" make -i a.raw -t short -s 5 6 7 -e raw -en little -sp 0.5 1.5 2 -th 0.25 1 2 -o plain.nrrd
    "$unu" axinfo -a 2 -l depth -i plain.nrrd | "$unu" axinfo -a 0 -l 'a "quoted" \ one' -o labels.nrrd
    # unu reads units of axes, but writes empty ones.
    LC_ALL=C sed '/^labels/a units: "mm" "mm" "mm"' labels.nrrd >axes.nrrd
    "$unu" data axes.nrrd | cmp - a.raw
    vkt read axes.nrrd | vkt write o.nrrd
    vkt read o.nrrd | vkt write p.nrrd
    vkt read o.nrrd | vkt write o.mha
    vkt read o.mha | vkt write q.nrrd
    for name in o p q; do
        "$unu" head $name.nrrd >head
        grep -qFx 'space units: "mm" "mm" "mm"' head
        grep -qFx "$(grep -a '^labels' axes.nrrd)" head
        grep -qFx 'thicknesses: 0.25 1 2' head
        "$unu" data $name.nrrd | cmp - a.raw
    done
    grep -aqx 'DistanceUnits = mm' o.mha
    # Units that MetaImage has no name for are kept as well.
    LC_ALL=C sed '/^units/s/"mm"$/"s"/' axes.nrrd | vkt write t.mha
    run ! grep -aq '^DistanceUnits' t.mha
    vkt read t.mha | vkt write - --format nrrd | grep -aqFx 'space units: "mm" "mm" "s"'
    # What fits no field of NRRD is a pair of key and value.
    vkt set a.nrrd --attribute space=mars --attribute labels=none -o mars.nrrd
    "$unu" head mars.nrrd >head
    grep -qx 'space:=mars' head
    grep -qx 'labels:=none' head
    vkt info mars.nrrd --json | grep -q '"labels":"none","space":"mars"'
}

@test "a measurement frame is turned with the frame of the world" {
    vkt read a.raw --dims 5 6 7 --dtype int16 | vkt set --attribute space=right-anterior-superior \
        --attribute 'measurement frame=(0,1,0) (-0.6,0,0.8) (0.8,0,0.6)' -o ras.nrrd
    grep -aqx 'measurement frame: (0,1,0) (-0.6,0,0.8) (0.8,0,0.6)' ras.nrrd
    vkt read ras.nrrd | vkt write lps.mha
    vkt read lps.mha | vkt write lps.nrrd
    grep -aqx 'space: left-posterior-superior' lps.nrrd
    grep -aqx 'measurement frame: (0,-1,0) (0.6,0,0.8) (-0.8,0,0.6)' lps.nrrd
}

@test "attributes that a format has no place for come back" {
    /usr/bin/python3 - >odd.nrrd <<'END'
import sys
sys.stdout.buffer.write(b"NRRD0004\ntype: short\ndimension: 3\nsizes: 5 6 7\nencoding: raw\nendian: little\n"
    b"two words:=a value\nlines:=one\\ntwo\nold max: 7\nquotes:=say \"so\" \\\\ or not\nElementType:=none\n"
    b"Ma\xc3\x9f:=gr\xc3\xb6\xc3\x9fe\n\n" + open("a.raw", "rb").read())
END
    vkt read odd.nrrd | vkt write odd.mha
    vkt read odd.mha | vkt write odd.vkt
    vkt read odd.vkt | vkt write back.nrrd
    for name in odd.mha odd.vkt back.nrrd; do
        vkt info $name --json | python3 -c '
import json, sys
a = json.load(sys.stdin)["attributes"]
expected = {"two words": "a value", "lines": "one\ntwo", "old max": "7", "quotes": "say \"so\" \\ or not",
            "ElementType": "none", "Ma\u00df": "gr\u00f6\u00dfe"}
assert a == expected, a'
    done
}

@test "Latin-1 text is the same by way of a pipe and without one" {
    have_unu
    vkt set a.nrrd --attribute "$(printf 'name=M\374ller')" --units "$(printf '\265g')" -o direct.nrrd
    vkt set a.nrrd --attribute "$(printf 'name=M\374ller')" --units "$(printf '\265g')" | vkt write piped.nrrd
    for volume in direct piped; do
        vkt info $volume.nrrd --json | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["attributes"]["name"] == "M\u00fcller" and info["units"] == "\u00b5g", info'
    done
    cmp direct.nrrd piped.nrrd
    printf 'NRRD0004\ntype: short\ndimension: 3\nsizes: 5 6 7\nencoding: raw\nendian: little\ncontent: caf\351\nname:=M\374ller \303\274\n\n' | cat - a.raw >latin.nrrd
    printf 'NDims = 3\nDimSize = 5 6 7\nElementType = MET_SHORT\nName = M\374ller\nElementDataFile = LOCAL\n' | cat - a.raw >latin.mha
    for name in latin.nrrd latin.mha; do
        for format in nrrd metaimage; do
            vkt write $name - --format $format >direct
            vkt read $name --no-history | vkt write - --format $format | cmp - direct
            vkt read $name | vkt info --json | iconv -f utf-8 -t utf-8 | grep -q 'Müller'
        done
    done
    vkt info latin.nrrd | iconv -f utf-8 -t utf-8 | grep -q 'name: Müller ü'
}

@test "images of four dimensions go from SimpleITK to vkt and back" {
    python_with SimpleITK
    /usr/bin/python3 - <<'END'
import numpy, SimpleITK
voxels = numpy.fromfile("a.raw", "<i2")[:120].reshape(5, 4, 3, 2)
for step in (0.5, -2, 1):
    image = SimpleITK.GetImageFromArray(voxels, isVector=False)
    image.SetSpacing((1, 2, 3, abs(step)))
    image.SetOrigin((1, 2, 3, 7.5))
    image.SetDirection((0.6, -0.8, 0, 0, 0.8, 0.6, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 if step > 0 else -1))
    for extension in ("nrrd", "mha"):
        SimpleITK.WriteImage(image, f"in{step}.{extension}")
END
    for step in 0.5 -2 1; do
        for from in nrrd mha; do
            for to in nrrd nhdr mha mhd; do
                vkt read "in$step.$from" | vkt write "out$step$from$to.$to"
                vkt read "in$step.$from" | vkt write "packed$step$from$to.$to" --compress
            done
        done
    done
    /usr/bin/python3 - <<'END'
import numpy, SimpleITK
for step in (0.5, -2, 1):
    for source in ("nrrd", "mha"):
        image = SimpleITK.ReadImage(f"in{step}.{source}")
        for prefix in ("out", "packed"):
            for target in ("nrrd", "nhdr", "mha", "mhd"):
                back = SimpleITK.ReadImage(f"{prefix}{step}{source}{target}.{target}")
                assert (SimpleITK.GetArrayFromImage(back) == SimpleITK.GetArrayFromImage(image)).all()
                for a, b in ((back.GetOrigin(), image.GetOrigin()), (back.GetSpacing(), image.GetSpacing()),
                             (back.GetDirection(), image.GetDirection())):
                    assert numpy.allclose(a, b, atol=1e-12), (step, source, target, prefix, a, b)
END
    # Each volume knows where it lies, alone as well, and together they make the series again.
    vkt info in0.5.nrrd --json | python3 -c '
import json, sys
positions = [v["attributes"]["sequence position"] for v in json.load(sys.stdin)]
assert positions == ["7.5", "8", "8.5", "9", "9.5"], positions'
    vkt read in0.5.nrrd | vkt write part_%d.nrrd
    vkt read 'part_*.nrrd' | vkt write again.nrrd
    vkt info again.nrrd --json | grep -q '"sequence position":"9.5","sequence step":"0.5"'
    rm part_2.nrrd
    vkt read 'part_*.nrrd' -o gap.vkt
    fails_with 2 "one NRRD file cannot say" vkt write gap.vkt gap.nrrd
    [ ! -e gap.nrrd ]
    # A series of which nobody said where its volumes lie stays one.
    vkt read a.raw --dims 5 6 7 --dtype int16 -o s0.nrrd
    cp s0.nrrd s1.nrrd
    vkt read 's?.nrrd' | vkt write none.mha
    vkt info none.mha --json >info.json
    run ! grep -q sequence info.json
    vkt read none.mha -o none.nrrd
    grep -aq '^kinds: domain domain domain list' none.nrrd
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
