#!/usr/bin/env bats
# NIfTI-1 and NIfTI-2: voxels and places equal to nibabel's, both ways, and damage refused.
load helper

bats_require_minimum_version 1.5.0

# compare FILE…: dims, physical values and the affine map of each file, as vkt and as nibabel have them.
setup_more() {
    python_with nibabel numpy
    cat >compare.py <<'END'
import json, subprocess, sys
import nibabel, numpy

def place(info):
    matrix = numpy.eye(4)
    for axis in range(3):
        matrix[:3, axis] = numpy.array(info["direction"][axis]) * info["spacing"][axis]
    matrix[:3, 3] = info["origin"]
    if info.get("attributes", {}).get("space", "").lower() in ("lps", "left-posterior-superior"):
        matrix = numpy.diag([-1, -1, 1, 1]) @ matrix
    return matrix

for name in sys.argv[1:]:
    image = nibabel.load(name)
    info = json.loads(subprocess.check_output(["vkt", "info", name, "--json"]))
    infos = info if isinstance(info, list) else [info]
    volumes = image.shape[3] if len(image.shape) > 3 else 1
    assert len(infos) == volumes, (name, len(infos), volumes)
    for one in infos:
        shape = tuple(image.shape[:3]) + (1,) * (3 - len(image.shape[:3]))
        assert tuple(one["dims"]) == shape, (name, one["dims"], image.shape)
        worst = abs(place(one) - image.affine).max()
        assert worst <= 1e-6, (name, worst, place(one), image.affine)
    dtype = numpy.dtype(infos[0]["dtype"])
    stored = subprocess.check_output(["vkt", "write", name, "-", "--format", "raw"])
    voxels = numpy.frombuffer(stored, dtype).reshape(image.shape, order="F")
    raw = image.dataobj.get_unscaled()
    assert dtype == raw.dtype.newbyteorder("="), (name, dtype, raw.dtype)
    assert numpy.array_equal(voxels, raw, equal_nan=dtype.kind == "f"), name
    slope, inter = infos[0].get("slope", 1), infos[0].get("intercept", 0)
    assert numpy.allclose(voxels * slope + inter, image.get_fdata(), rtol=1e-6), (name, slope, inter)
print("equal", len(sys.argv) - 1)
END
}
compare() { [ "$(/usr/bin/python3 compare.py "$@")" = "equal $#" ]; }

# What a volume is, but for its history.
about() { vkt info "$1" --json | /usr/bin/python3 -c '
import json, sys
info = json.load(sys.stdin)
for one in info if isinstance(info, list) else [info]:
    for key in ("history", "file", "format", "access", "bytes", "name", "path", "not_read"): one.pop(key, None)
    print(json.dumps(one, sort_keys=True))'; }

@test "what nibabel wrote: all types, both byte orders, both versions, files and pairs" {
    /usr/bin/python3 - <<'END'
import nibabel, numpy
rng = numpy.random.default_rng(1)
affine = numpy.array([[0.8, -0.6, 0, 3], [0.9, 1.2, 0, -7], [0, 0, -2.5, 11], [0, 0, 0, 1]])
for code in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"):
    for order in "<>":
        dtype = numpy.dtype(order + code)
        if dtype.kind == "f": data = rng.normal(size=(5, 4, 3)).astype(dtype)
        else:
            limits = numpy.iinfo(dtype)
            data = rng.integers(limits.min, limits.max, (5, 4, 3), dtype.newbyteorder("="), endpoint=True).astype(dtype)
        for kind, name in ((nibabel.Nifti1Image, "one.nii"), (nibabel.Nifti2Image, "two.nii"),
                           (nibabel.Nifti1Pair, "pair.img"), (nibabel.Nifti2Pair, "pair2.img")):
            header = kind.header_class(endianness=order)
            header.set_data_dtype(dtype)
            image = kind(data, affine, header)
            assert image.header.endianness == order
            nibabel.save(image, f"{'be' if order == '>' else 'le'}_{code}_{name}")
END
    [ "$(ls *.nii *.hdr | wc -l)" -eq 80 ]
    compare *.nii *.hdr
    # The voxels of a pair stand for both.
    vkt diff be_i2_pair.img be_i2_pair.hdr
}

@test "pairs whose names are in capitals" {
    /usr/bin/python3 -c '
import nibabel, numpy
nibabel.save(nibabel.Nifti1Pair(numpy.arange(60, dtype="i2").reshape(5, 4, 3), numpy.eye(4)), "pair.img")'
    cp pair.hdr HEAD.HDR
    cp pair.img HEAD.IMG
    vkt diff pair.hdr HEAD.HDR
    vkt diff pair.hdr HEAD.IMG
    cp pair.hdr MIXED.HDR # of two makers
    cp pair.img MIXED.img
    vkt diff pair.hdr MIXED.HDR
}

@test "qform, sform, both, neither, shear, mirrored, with slopes and units" {
    /usr/bin/python3 - <<'END'
import nibabel, numpy
from nibabel.eulerangles import euler2mat
data = numpy.arange(5 * 6 * 7, dtype="<i2").reshape(5, 6, 7)
turned = numpy.eye(4)
turned[:3, :3] = euler2mat(0.3, -0.8, 2.9) @ numpy.diag([0.5, 1.5, 2])
turned[:3, 3] = [-90.25, 126, -72.1]
half = numpy.diag([-1.0, -2, 3, 1]); half[:3, 3] = [10, 20, -30]  # half a turn about z
sheared = turned.copy(); sheared[0, 1] += 0.3
mirrored = turned @ numpy.diag([1, 1, -1, 1])
for name, affine in (("turned", turned), ("half", half), ("mirrored", mirrored)):
    for s, q in ((0, 1), (2, 0), (4, 1), (3, 3)):
        image = nibabel.Nifti1Image(data, affine)
        image.set_sform(affine, s); image.set_qform(affine, q)
        nibabel.save(image, f"{name}_{s}{q}.nii")
image = nibabel.Nifti1Image(data, sheared)
image.set_sform(sheared, 4); image.set_qform(turned, 1)
nibabel.save(image, "sheared.nii")
image = nibabel.Nifti1Image(data, None)
image.header.set_zooms((0.5, 2, 3))
nibabel.save(image, "none.nii")
image = nibabel.Nifti1Image(data.astype("<f8") * 0.25 - 1000, turned)
image.header.set_data_dtype("<i2"); image.header.set_slope_inter(0.25, -1000)
image.header.set_xyzt_units("micron", "sec")
image.header["descrip"] = b"made by hand"; image.header.set_intent("t test", (7,), "effect")
nibabel.save(image, "slope.nii")
END
    compare *.nii
    vkt info slope.nii --json | /usr/bin/python3 -c '
import json, sys
info = json.load(sys.stdin)
a = info["attributes"]
assert info["slope"] == 0.25 and info["intercept"] == -1000, info
assert a["space"] == "right-anterior-superior" and a["space units"] == "\"um\" \"um\" \"um\"", a
assert a["descrip"] == "made by hand" and a["intent_code"] == "3" and a["intent_p1"] == "7", a
assert a["intent_name"] == "effect", a'
    # Codes, and what else vkt keeps, survive a round trip; NRRD holds the same.
    for name in *.nii; do
        vkt write $name again.nii --force
        vkt write $name $name.nrrd
        vkt diff $name again.nii
        [ "$(about $name)" = "$(about again.nii)" ]
        vkt diff $name $name.nrrd
        compare again.nii
        /usr/bin/python3 - $name again.nii <<'END'
import nibabel, sys
a, b = (nibabel.load(n).header for n in sys.argv[1:])
assert int(a["sform_code"]) == int(b["sform_code"]), sys.argv
if sys.argv[1] != "sheared.nii": assert int(a["qform_code"]) == int(b["qform_code"]), sys.argv
END
    done
}

@test "what vkt wrote is read by nibabel and by SimpleITK, from any frame" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float32 float64; do
        vkt make noise --dims 7 6 5 --dtype $type --seed 3 -o $type.nii
    done
    compare *.nii
    fails_with 2 "NIfTI cannot hold float16" vkt make noise --dims 7 6 5 --dtype float16 -o half.nii
    [ ! -e half.nii ]
    vkt make noise --dims 7 6 5 --dtype int16 | vkt set --spacing 0.1,0.7,3 --attribute space=LPS -o a.nrrd
    vkt permute zxy a.nrrd | vkt flip x -o b.nrrd
    for name in a b; do
        vkt write $name.nrrd $name.nii
        vkt write $name.nrrd $name.hdr
        vkt write $name.nrrd $name.nii.gz
        [ -e $name.img ]
        for file in $name.nii $name.hdr $name.nii.gz; do
            vkt diff $name.nrrd $file
            compare $file
            # All digits, and the frame as it was.
            [ "$(about $file)" = "$(about $name.nrrd)" ]
        done
    done
    gzip -t a.nii.gz
    gzip -dc a.nii.gz | cmp - a.nii
    vkt write a.nrrd - --format nifti --compress | gzip -dc | cmp - a.nii
    fails_with 2 "compressed as a whole" vkt write a.nrrd c.nii --compress
    # Numbers that others change count, whatever the extension says.
    /usr/bin/python3 - <<'END'
import nibabel, numpy
image = nibabel.load("a.nii")
affine = image.affine.copy()
affine[:3, 3] += 4
moved = nibabel.Nifti1Image(image.dataobj.get_unscaled(), affine, image.header)
nibabel.save(moved, "moved.nii")
END
    compare moved.nii
    PYTHONPATH="$VKT_BUILD/oracles" /usr/bin/python3 -c 'import SimpleITK' 2>/dev/null || skip "SimpleITK is not installed"
    PYTHONPATH="$VKT_BUILD/oracles" /usr/bin/python3 - <<'END'
import numpy, SimpleITK as sitk, subprocess
for name in ("a.nii", "a.hdr", "a.nii.gz", "b.nii"):
    image, reference = sitk.ReadImage(name), sitk.ReadImage(name[0] + ".nrrd")
    assert numpy.array_equal(sitk.GetArrayFromImage(image), sitk.GetArrayFromImage(reference))
    for what in ("GetOrigin", "GetSpacing", "GetDirection"):
        assert numpy.allclose(getattr(image, what)(), getattr(reference, what)(), atol=1e-5), (name, what)
END
}

@test "series: a fourth dimension, compressed and not" {
    for i in 0 1 2; do vkt make noise --dims 6 5 4 --dtype int16 --seed $i -o v$i.nrrd; done
    for file in s.nii s.nii.gz s.hdr; do
        vkt read 'v*.nrrd' | vkt write $file
        compare $file
        vkt read $file | vkt write $file.raw
        for i in 0 1 2; do vkt write v$i.nrrd - --format raw; done | cmp - $file.raw
    done
    gzip -dc s.nii.gz | cmp - s.nii
    fails_with 2 "several volumes" bash -o pipefail -c "vkt read 'v*.nrrd' | vkt write - --format nifti >out.nii"
    /usr/bin/python3 - <<'END'
import nibabel, numpy
image = nibabel.Nifti1Image(numpy.arange(120, dtype="<f4").reshape(2, 3, 4, 5), numpy.diag([2, 2, 2, 1]))
image.header.set_zooms((2, 2, 2, 1.5)); image.header.set_xyzt_units("mm", "sec"); image.header["toffset"] = 0.5
nibabel.save(image, "t.nii.gz")
END
    compare t.nii.gz
    vkt info t.nii.gz --json | /usr/bin/python3 -c '
import json, sys
infos = json.load(sys.stdin)
assert [float(i["attributes"]["sequence position"]) for i in infos] == [0.5, 2, 3.5, 5, 6.5], infos
assert infos[0]["attributes"]["sequence units"] == "\"s\"", infos[0]'
    vkt write t.nii.gz u.nii
    [ "$(about t.nii.gz)" = "$(about u.nii)" ]
    /usr/bin/python3 -c '
import nibabel
header = nibabel.load("u.nii").header
assert header.get_zooms()[3] == 1.5 and header["toffset"] == 0.5 and header.get_xyzt_units() == ("mm", "sec"), header'
}

@test "channels lie along a fifth axis, with times or without, whichever of them comes inside the other" {
    python_with nibabel
    for c in 0 1 2; do for t in 0 1; do
        vkt make noise --dims 6 5 4 --dtype int16 --seed $c$t | vkt set --attribute channel=$c --attribute "sequence position=$t.5" \
            --attribute 'sequence step=1' --attribute 'space units="mm" "mm" "mm"' -o v$c$t.vkt
    done; done
    cat v00.vkt v01.vkt v10.vkt v11.vkt v20.vkt v21.vkt >outer.vkt
    cat v00.vkt v10.vkt v20.vkt v01.vkt v11.vkt v21.vkt >inner.vkt
    cat v00.vkt v10.vkt v20.vkt >alone.vkt
    cat v00.vkt v01.vkt v10.vkt >part.vkt
    for end in nii nii.gz hdr; do
        vkt write outer.vkt outer.$end 2>err
        [ ! -s err ]
        vkt read outer.$end -o back.vkt --force
        vkt diff outer.vkt outer.$end
        for file in outer back; do
            vkt info $file.vkt --json | grep -v '"history"' | grep -o '"channel": *"[^"]*"\|"sequence [a-z]*": *"[^"]*"\|"dims": *[^]]*]' >$file.said
        done
        [ "$(grep -c '"sequence position": *"1.5"' outer.said)" = 3 ]
        diff outer.said back.said
        vkt write alone.vkt alone.$end
        vkt diff alone.vkt alone.$end
        # Channels inside of times are put in order, by whole volumes or some bytes of each.
        for memory in 1GiB 2k; do
            vkt write inner.vkt inner.$end --memory $memory --force 2>err
            [ ! -s err ]
            vkt diff outer.vkt inner.$end
            vkt info inner.$end --json | grep -v '"history"' | grep -o '"channel": *"[^"]*"\|"sequence [a-z]*": *"[^"]*"\|"dims": *[^]]*]' | diff outer.said -
        done
        fails_with 2 'no full grid' vkt write part.vkt part.$end
        [ ! -e part.$end ]
        [ -z "$(find . -name '.*vkt-*')" ]
        /usr/bin/python3 - $end <<'END'
import nibabel, numpy, subprocess, sys
end = sys.argv[1]
for name, shape in ("outer", (6, 5, 4, 2, 3)), ("inner", (6, 5, 4, 2, 3)), ("alone", (6, 5, 4, 1, 3)):
    file = nibabel.load(f"{name}.{end}")
    assert file.shape == shape, (name, file.shape)
    want = subprocess.check_output(f"vkt write {'alone' if name == 'alone' else 'outer'}.vkt - --format raw", shell=True)
    assert numpy.asanyarray(file.dataobj).tobytes("F") == want, name
    if name != "alone": assert file.header["toffset"] == 0.5 and file.header.get_zooms()[3] == 1, file.header
END
    done
    # Steps that are not said are those of the places, and uneven ones are refused.
    for c in 0 1; do for t in 0 1 2; do vkt read v${c}0.vkt | vkt set --attribute "sequence position=$((t * t + t + 4))" -o u$c$t.vkt; done; done
    cat u00.vkt u10.vkt u01.vkt u11.vkt | vkt edit --attribute 'sequence step=' -o steps.nii
    [ "$(/usr/bin/python3 -c 'import nibabel; h = nibabel.load("steps.nii").header; print(h.get_zooms()[3], h["toffset"], *h.get_data_shape())')" = "2.0 4.0 6 5 4 2 2" ]
    cat u00.vkt u10.vkt u01.vkt u11.vkt u02.vkt u12.vkt | vkt edit --attribute 'sequence step=' -o uneven.vkt
    fails_with 2 'behind the one before it' vkt write uneven.vkt uneven.nii
    # Of vectors at several times the intent is true.
    cat outer.vkt | vkt edit --attribute intent_code=1007 -o vectors.nii
    [ "$(vkt info vectors.nii --json | grep -c '"intent_code": *"1007"')" = 6 ]
}

@test "samples from scanners equal nibabel's" {
    needs_data nifti/example4d.nii.gz
    compare "$VKT_DATA"/nifti/*
    for file in "$VKT_DATA"/nifti/*; do
        vkt write "$file" round.nii --force
        compare round.nii
        [ "$(about "$file")" = "$(about round.nii)" ]
        gzip -dc "$file" | vkt read - | vkt write piped.nii --force
        [ "$(about "$file")" = "$(about piped.nii)" ]
    done
}

@test "an extent above 32767 makes NIfTI-2" {
    vkt make ramp --dims 40000 2 1 --dtype uint16 -o long.nii
    [ "$(head -c 4 long.nii | od -An -tu4 | tr -d ' ')" -eq 540 ]
    compare long.nii
}

@test "a region of a file reads its own bytes, and of a compressed one the same voxels" {
    vkt make noise --dims 60 50 40 --dtype int16 -o a.nii
    vkt write a.nii a.nii.gz
    vkt crop a.nii --roi 3:20,:,30:33 -o part.nrrd
    vkt read a.nii --roi 3:20,:,30:33 | vkt diff part.nrrd -
    vkt read a.nii.gz --roi 3:20,:,30:33 | vkt diff part.nrrd -
    strace --version >/dev/null 2>&1 || skip "strace is not installed"
    export ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}detect_leaks=0" # LeakSanitizer does not work where it is traced
    strace -f -e trace=read,pread64 -o log vkt read a.nii --roi :,:,30:31 -o slice.vkt
    /usr/bin/python3 -c '
import re
total = sum(int(m.group(1)) for line in open("log") if (m := re.search(r"pread64.* = (\d+)$", line)))
assert total <= 60 * 50 * 2 + 65536, total'
}

@test "damage is refused, and leaves nothing" {
    vkt make noise --dims 30 20 10 --dtype int16 -o a.nii
    vkt write a.nii a.nii.gz
    vkt write a.nii p.hdr
    head -c 200 a.nii >header.nii
    head -c -2 a.nii >short.nii
    head -c -100 a.nii.gz >short.nii.gz
    /usr/bin/python3 - <<'END'
import gzip, struct
good = bytearray(open("a.nii", "rb").read())
def write(name, *changes):
    bad = bytearray(good)
    for at, what in changes: bad[at:at + len(what)] = what
    open(name, "wb").write(bad)
write("magic.nii", (344, b"n+3\0"))
write("huge.nii", (40, struct.pack("<4h", 3, 32767, 32767, 32767)))
write("negative.nii", (42, struct.pack("<h", -5)))
write("dimensions.nii", (40, struct.pack("<h", 9)))
write("vector.nii", (40, struct.pack("<8h", 5, 30, 20, 5, 1, 3, 1, 1)))
write("volumes.nii", (40, struct.pack("<8h", 7, 1, 1, 1, 32767, 32767, 32767, 32767)))
write("complex.nii", (70, struct.pack("<h", 32)))
write("rgb.nii", (70, struct.pack("<h", 128)))
write("bits.nii", (70, struct.pack("<h", 1)))
write("type.nii", (70, struct.pack("<h", 77)))
write("offset.nii", (108, struct.pack("<f", 1e30)))
write("offsetnan.nii", (108, struct.pack("<f", float("nan"))))
write("early.nii", (108, struct.pack("<f", 100)))
write("place.nii", (252, struct.pack("<2h", 0, 1)), (280, bytes(48)))
write("inter.nii", (112, struct.pack("<2f", 2, float("inf"))))
whole = bytearray(open("a.nii.gz", "rb").read())
whole[-6] ^= 1
open("checksum.nii.gz", "wb").write(whole)
middle = bytearray(open("a.nii.gz", "rb").read())
middle[len(middle) // 2] ^= 0xff
open("middle.nii.gz", "wb").write(middle)
END
    for name in header.nii short.nii short.nii.gz magic.nii huge.nii negative.nii dimensions.nii vector.nii volumes.nii complex.nii \
        rgb.nii bits.nii type.nii offset.nii offsetnan.nii early.nii place.nii inter.nii checksum.nii.gz middle.nii.gz; do
        fails_with 3 "$name'" vkt write $name out.nrrd
        [ ! -e out.nrrd ]
    done
    fails_with 3 "single bits, which are not read" vkt info bits.nii
    fails_with 3 "18000 bytes expected, 12000 found" vkt info vector.nii
    # Both of a pair compressed, named by either.
    for end in hdr img; do gzip -c p.$end >packed.$end.gz; done
    vkt diff packed.img.gz p.hdr
    vkt diff packed.hdr.gz p.hdr
    rm p.img
    fails_with 4 "p.img" vkt write p.hdr out.nrrd
    fails_with 3 "NAME.img beside NAME.hdr" vkt write - out.nrrd <p.hdr
    # A pair whose voxels lead elsewhere is not followed.
    mkdir d
    vkt write a.nii d/q.hdr
    mv d/q.img elsewhere.img
    ln -s ../elsewhere.img d/q.img
    fails_with 3 "leads out of its directory" vkt info d/q.hdr
    vkt diff a.nii d/q.hdr --trust-paths
}

@test "the JSON file beside an image travels to the one beside the next, and is said to be lost elsewhere" {
    vkt make noise --dims 9 8 7 --dtype int16 -o scan.nii.gz
    printf '{"RepetitionTime": 2.0, "SliceTiming": [0, 0.5,\n 1e-3], "Note": "\303\274\\n\\"q\\""}\n' >scan.json
    vkt convert scan.nii.gz -o out.nii.gz
    vkt crop scan.nii.gz --roi 0:4,0:4,0:4 | vkt write way.nrrd
    vkt write way.nrrd later.nii
    vkt write way.nrrd pair.hdr
    /usr/bin/python3 - <<'END'
import json
want = json.load(open("scan.json"))
for name in ("out", "later", "pair"): assert json.load(open(name + ".json")) == want, name
END
    # Nesting that no scanner writes is not followed, in the file or in an attribute.
    vkt make noise --dims 4 4 4 --dtype int16 -o deep.nii
    /usr/bin/python3 -c "print('{\"A\":' + '[' * 200000 + ']' * 200000 + '}')" >deep.json
    run ! grep -q sidecar <(vkt info deep.nii --json)
    vkt info deep.nii
    # A report is no such file: it does not go there, and is not read as one where it lies already.
    vkt make noise --dims 9 8 7 | vkt threshold --otsu -o mask.nii
    for out in l.nii.gz ./l.hdr; do
        fails_with 2 'would be read as that' vkt label mask.nii --report l.json -o $out
        [ ! -e l.json ]
        [ ! -e $out ]
    done
    vkt label mask.nii --report l_report.json -o l.nii.gz
    vkt label mask.nii --report n.json -o n.nrrd
    cp n.json l.json
    run ! grep -q sidecar <(vkt info l.nii.gz --json)
    # The image itself does not say it, or two files would.
    run ! grep -qa RepetitionTime <(zcat out.nii.gz)
    vkt info out.nii.gz --json | grep -q 'RepetitionTime'
    fails_with 4 'exists' vkt convert scan.nii.gz -o out.nii.gz
    rm out.nii.gz
    fails_with 4 'out.json' vkt convert scan.nii.gz -o out.nii.gz
    [ ! -e out.nii.gz ]
    vkt convert scan.nii.gz -o out.nii.gz --force
    for name in t.vtk t.npy; do
        vkt write scan.nii.gz $name 2>err
        grep -q 'files do not hold .*what stood in the JSON file beside, the history: not kept$' err
        [ "$(wc -l <err)" -eq 1 ]
    done
    fails_with 3 'JSON file' vkt read scan.nii.gz -o s.npy --strict
    # What is no object stays where it is, and nothing is written beside the next image.
    for words in '[1, 2]' '{"a": ' ''; do
        printf '%s' "$words" >scan.json
        vkt convert scan.nii.gz -o plain.nii --force
        [ ! -e plain.json ]
    done
}

@test "extensions of text are kept as a comment, what is not kept is named" {
    python_with nibabel
    /usr/bin/python3 - <<'END'
import nibabel, numpy
from nibabel.nifti1 import Nifti1Extension
image = nibabel.Nifti1Image(numpy.arange(60, dtype="i2").reshape(3, 4, 5), numpy.diag([1, 2, 3, 1]))
image.header.extensions.append(Nifti1Extension("comment", b"scanned upside down"))
image.header.extensions.append(Nifti1Extension("comment", b"and twice"))
image.header.extensions.append(Nifti1Extension("afni", b"<AFNI_attributes/>"))
nibabel.save(image, "foreign.nii")
END
    vkt info foreign.nii >info
    grep -q 'comment: scanned upside down' info
    grep -q 'not read *an extension of 24 bytes, code 4' info
    for name in own.nii own.nii.gz own.hdr; do
        vkt convert foreign.nii $name
        /usr/bin/python3 - "$name" <<'END'
import nibabel, numpy, sys
image = nibabel.load(sys.argv[1])
texts = [e.get_content() for e in image.header.extensions if e.get_code() == 6]
assert texts[0].rstrip(b"\0") == b"scanned upside down\nand twice", texts
assert (numpy.asanyarray(image.dataobj) == numpy.arange(60).reshape(3, 4, 5)).all()
END
        vkt diff $name foreign.nii --geometry
        [ "$(vkt info $name | grep -c 'comment: scanned')" -eq 1 ]
    done
    # Volumes of one file that say different things say none of it.
    vkt edit own.nii --attribute comment=other -o other.nii
    vkt stack own.nii other.nii -o both.nii 2>said
    grep -q 'differ between its volumes (comment): not kept' said
    vkt read both.nii --index 1 | vkt diff - foreign.nii
}

@test "a qform that differs, slices, intents, times and dimensions are what they were, in NIfTI again" {
    python_with nibabel
    cat >kept.py <<'END'
import nibabel, numpy, subprocess, sys
fields = ("dim", "pixdim", "intent_code", "intent_name", "qform_code", "sform_code", "slice_code", "slice_start", "slice_end",
          "slice_duration", "dim_info", "toffset", "xyzt_units", "datatype")
for name in sys.argv[1:]:
    for way in ("{0}", "way.nrrd", "way.h5"):
        if way == "way.nrrd" and name in ("six.nii", "seven.nii"): continue # which has one axis for times and channels
        if way != "{0}": subprocess.run(["vkt", "convert", name, way, "--force"], check=True)
        said = subprocess.run(["vkt", "convert", way.format(name), "kept.nii", "--force"], check=True, capture_output=True).stderr
        assert said == b"", (name, way, said)
        want, got = nibabel.load(name), nibabel.load("kept.nii")
        a, b = want.header, got.header
        for field in fields:
            # The fourth element of zooms is about times, of which there may be none.
            n = 4 if field == "pixdim" and want.ndim < 4 else 5 if field == "pixdim" else None
            assert numpy.allclose(a[field][:n] if n else a[field], b[field][:n] if n else b[field], rtol=1e-6) \
                if a[field].dtype.kind != "S" else a[field] == b[field], (name, way, field, a[field], b[field])
        assert numpy.allclose(want.get_qform(), got.get_qform(), atol=2e-6), (name, way)
        assert numpy.allclose(want.get_sform(), got.get_sform(), atol=2e-6), (name, way)
        assert numpy.array_equal(numpy.asanyarray(want.dataobj), numpy.asanyarray(got.dataobj)), (name, way)
END
    /usr/bin/python3 - <<'END'
import nibabel, numpy
from nibabel.eulerangles import euler2mat
rng = numpy.random.default_rng(3)
def image(shape, kind=nibabel.Nifti1Image): return kind(rng.integers(0, 99, shape).astype("i2"), numpy.diag([1, 2, 3, 1]))
turned = numpy.eye(4)
turned[:3, :3] = euler2mat(0.3, -0.8, 0.4) @ numpy.diag([1.5, 2.5, -3.5])
turned[:3, 3] = [-9.25, 12, 7]
moved = numpy.diag([-1, 2, 3, 1]); moved[:3, 3] = [50, 0, 1]
sheared = numpy.diag([1.0, 2, 3, 1]); sheared[0, 1] = 0.4
for kind, mark in ((nibabel.Nifti1Image, ""), (nibabel.Nifti2Image, "2")):
    for name, s, q in (("moved", numpy.diag([1, 2, 3, 1]), moved), ("turned", moved, turned), ("sheared", sheared, turned)):
        one = image((5, 6, 7), kind)
        one.set_sform(s, 3); one.set_qform(q, 1)
        one.header.set_xyzt_units("mm")
        nibabel.save(one, name + mark + ".nii")
    one = image((5, 6, 7), kind)
    one.header["slice_code"] = 3; one.header["slice_start"] = 1; one.header["slice_end"] = 6
    one.header["slice_duration"] = 0.25; one.header.set_dim_info(freq=0, phase=1, slice=2)
    nibabel.save(one, "slices" + mark + ".nii")
one = image((5, 6, 7, 1, 3)); one.header.set_intent("vector", name="flow"); one.header["toffset"] = 2.5
one.header.set_xyzt_units("mm", "sec"); nibabel.save(one, "vectors.nii")
one = image((5, 6, 7)); one.header["toffset"] = -1.5; one.header.set_xyzt_units("mm", "msec"); nibabel.save(one, "late.nii")
nibabel.save(image((5, 6, 7, 2, 3, 2)), "six.nii")
nibabel.save(image((5, 6, 4, 1, 3, 1, 2)), "seven.nii")
for code, names in ((2003, "RGB"), (2004, "RGBA")):
    colours = numpy.zeros((5, 6, 7), dtype=[(c, "u1") for c in names])
    for c in names: colours[c] = rng.integers(0, 255, (5, 6, 7))
    nibabel.save(nibabel.Nifti1Image(colours, numpy.eye(4)), f"colour{code}.nii")
END
    /usr/bin/python3 kept.py moved*.nii turned*.nii sheared*.nii slices*.nii vectors.nii late.nii six.nii seven.nii
    # Colours become components, for which the standard has an intent.
    for code in 2003 2004; do
        vkt convert colour$code.nii colours.nii --force
        /usr/bin/python3 - colour$code.nii $code <<'END'
import nibabel, numpy, sys
want, got = numpy.asanyarray(nibabel.load(sys.argv[1]).dataobj), nibabel.load("colours.nii")
assert got.header["intent_code"] == int(sys.argv[2]) and got.shape == (5, 6, 7, 1, len(want.dtype.names)), got.header
for c, name in enumerate(want.dtype.names): assert (numpy.asanyarray(got.dataobj)[..., 0, c] == want[name]).all()
END
        vkt read colour$code.nii --index 1 | vkt write green.nii --force
        /usr/bin/python3 -c 'import nibabel; assert nibabel.load("green.nii").header["intent_code"] == 0'
    done
    # Where the lattice went, the qform goes too, and slices are no longer those that were taken.
    vkt crop turned.nii --roi 2:5,1:4,3: | vkt flip y -o part.nii
    vkt crop slices.nii --roi :,:,2: -o part2.nii 2>said
    [ "$(cat said)" = "vkt crop: not true of this lattice: how the scanner took its slices (slice_code slice_start slice_end slice_duration dim_info): not kept" ]
    vkt flip z sheared.nii | vkt resample --dims 10 6 7 -o part3.nii 2>said
    [ ! -s said ]
    # What was at right angles there need not be so any more.
    vkt edit sheared.nii --direction 1,0,0,0,1,0,0,0,1 -o part4.nii 2>said
    [ "$(cat said)" = "vkt edit: not true of this lattice: the qform, which says no shears: not kept" ]
    /usr/bin/python3 - <<'END'
import nibabel, numpy
whole, part = nibabel.load("turned.nii"), nibabel.load("part.nii")
way = numpy.array([[1, 0, 0, 2], [0, -1, 0, 3], [0, 0, 1, 3], [0, 0, 0, 1]])
assert numpy.allclose(part.get_qform(), whole.get_qform() @ way, atol=1e-5), part.get_qform()
assert numpy.allclose(part.get_sform(), whole.get_sform() @ way, atol=1e-5), part.get_sform()
third, fourth = nibabel.load("part3.nii"), nibabel.load("part4.nii")
way = numpy.array([[0.5, 0, 0, -0.25], [0, 1, 0, 0], [0, 0, -1, 6], [0, 0, 0, 1]])
assert numpy.allclose(third.get_qform(), nibabel.load("sheared.nii").get_qform() @ way, atol=1e-5), third.get_qform()
assert int(fourth.header["qform_code"]) == 0 and int(fourth.header["sform_code"]) == 3, fourth.header
for field in ("slice_code", "slice_end", "slice_duration", "dim_info"): assert nibabel.load("part2.nii").header[field] == 0
END
    # What has no place for it says so.
    vkt convert slices.nii s.npy 2>said
    grep -q 'do not hold .*attributes .*: not kept' said
}
