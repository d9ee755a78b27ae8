#!/usr/bin/env bats
# DICOM: voxels and places equal to those that pydicom and SimpleITK find; gaps, slants and damage refused.
load helper

setup_more() {
    python_with pydicom numpy
    cat >common.py <<'END'
import json, os, subprocess, sys, numpy, pydicom, pydicom.encaps
from pydicom.dataset import Dataset, FileDataset
from pydicom.sequence import Sequence
from pydicom.uid import generate_uid, ExplicitVRLittleEndian, ImplicitVRLittleEndian, ExplicitVRBigEndian, RLELossless
def infos(name, *options):
    info = json.loads(subprocess.check_output(f"vkt read {' '.join(options)} {name} | vkt info --json", shell=True))
    return info if isinstance(info, list) else [info]
def voxels(name, *options):
    raw = subprocess.check_output(f"vkt read {name} {' '.join(options)} | vkt write - --format raw", shell=True)
    return numpy.frombuffer(raw, infos(name, *options)[0]["dtype"])
series, study = generate_uid(), generate_uid()
def base(path, pixels, uid=None, number=4, bits=16, syntax=ExplicitVRLittleEndian, slope=1, intercept=-1024, modality="CT", sop="1.2.840.10008.5.1.4.1.1.2"):
    meta = pydicom.dataset.FileMetaDataset()
    meta.MediaStorageSOPClassUID = sop
    meta.MediaStorageSOPInstanceUID = generate_uid()
    meta.TransferSyntaxUID = syntax
    d = FileDataset(path, {}, file_meta=meta, preamble=b"\0" * 128)
    d.is_little_endian = syntax != ExplicitVRBigEndian
    d.is_implicit_VR = syntax == ImplicitVRLittleEndian
    d.SOPClassUID, d.SOPInstanceUID = meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID
    d.PatientName, d.PatientID, d.PatientBirthDate = "Secret^Person", "S-4711", "19700101"
    d.StudyInstanceUID, d.SeriesInstanceUID, d.SeriesNumber = study, uid or series, number
    d.Modality = modality
    d.Rows, d.Columns = pixels.shape[-2:]
    d.SamplesPerPixel, d.PhotometricInterpretation = 1, "MONOCHROME2"
    d.BitsAllocated = pixels.dtype.itemsize * 8
    d.BitsStored = min(bits, d.BitsAllocated); d.HighBit = d.BitsStored - 1
    d.PixelRepresentation = int(pixels.dtype.kind == "i")
    d.RescaleSlope, d.RescaleIntercept = slope, intercept
    data = pixels if d.is_little_endian else pixels.byteswap()
    d.PixelData = data.tobytes()
    d["PixelData"].VR = "OW" if pixels.dtype.itemsize > 1 else "OB"
    return d
def slices(folder, data, places, orientation=(1, 0, 0, 0, 1, 0), origin=(-5, 6, 7), aside=0, **options):
    os.makedirs(folder, exist_ok=True)
    a, b = numpy.array(orientation[:3]), numpy.array(orientation[3:])
    n = numpy.cross(a, b)
    order = numpy.random.default_rng(9).permutation(len(data))
    for k, i in enumerate(order):
        d = base(f"{folder}/{k}", data[i], **options)
        d.ImageOrientationPatient = [float(v) for v in orientation]
        d.ImagePositionPatient = [round(float(v), 6) for v in numpy.array(origin) + n * places[i] + a * aside * i]
        d.PixelSpacing = [0.75, 0.5]
        d.SliceThickness = 2
        d.InstanceNumber = int(k + 1)
        d.save_as(f"{folder}/{k}")
END
    /usr/bin/python3 - <<'END'
from common import *
slices("try", numpy.zeros((2, 4, 4), "u2"), [0, 1])
END
    vkt info try 2>err >/dev/null || { grep -q 'without it' err && skip 'built without GDCM'; cat err >&2; false; }
}

@test "series of slices: types, transfer syntaxes, orientations" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(1)
c, s = 0.8, 0.6
n = 0
for code, bits in (("u1", 8), ("u2", 16), ("i2", 16), ("u2", 12), ("i2", 12)):
    low = -(1 << bits - 1) if code[0] == "i" else 0
    data = rng.integers(low, low + (1 << bits), (6, 11, 13)).astype(code)
    for syntax in (ExplicitVRLittleEndian, ImplicitVRLittleEndian, ExplicitVRBigEndian)[:3 if code == "u2" else 1]:
        for orientation in ((1, 0, 0, 0, 1, 0), (0, 1, 0, 0, 0, -1), (c, s, 0, -s, c, 0))[n % 3:n % 3 + 1]:
            stored = data if bits != 12 or code[0] == "u" else data & numpy.int16(0x0fff) # sign in the twelfth bit
            slices(f"f{n}", stored, numpy.arange(6) * 2.5, orientation, syntax=syntax, bits=bits, slope=2)
            got = voxels(f"f{n}")
            assert got.dtype == data.dtype and got.tobytes() == data.tobytes(), (code, bits, syntax, orientation)
            info = infos(f"f{n}")[0]
            assert info["dims"] == [13, 11, 6] and numpy.allclose(info["spacing"], [0.5, 0.75, 2.5]), info
            assert numpy.allclose(info["origin"], (-5, 6, 7)), info
            normal = numpy.cross(orientation[:3], orientation[3:])
            assert numpy.allclose(info["direction"], [orientation[:3], orientation[3:], normal]), info
            assert info["slope"] == 2 and info["intercept"] == -1024 and info["units"] == "HU", info
            assert info["attributes"]["space"] == "left-posterior-superior"
            n += 1
part = subprocess.check_output("vkt read f0 --roi 2:9,3:8,1:4 | vkt write - --format raw", shell=True)
assert part == numpy.ascontiguousarray(voxels("f0").reshape(6, 11, 13)[1:4, 3:8, 2:9]).tobytes()
END
}

@test "nothing personal goes anywhere" {
    /usr/bin/python3 -c '
from common import *
slices("f", numpy.zeros((3, 4, 4), "u2"), [0, 1, 2])'
    for name in a.nrrd a.mha a.nii a.vti a.vkt; do
        vkt write f $name
        refute_personal=$(grep -ac 'Secret\|4711\|19700101' $name) || true
        [ "$refute_personal" -eq 0 ]
    done
}

@test "what is personal is kept where it is asked for" {
    /usr/bin/python3 -c '
from common import *
slices("f", numpy.zeros((3, 4, 4), "u2"), [0, 1, 2])
for i in range(3):
    d = pydicom.dcmread(f"f/{i}")
    d.SpecificCharacterSet, d.PatientName, d.InstitutionName = "ISO_IR 100", "J\xe4ger^Anna", "two\nlines"
    d.save_as(f"f/{i}")'
    vkt read f --personal | vkt write - a.nrrd
    vkt info a.nrrd >told
    grep -q '^attribute *patient name: Jäger^Anna$' told
    grep -q '^attribute *patient id: S-4711$' told
    grep -q '^attribute *patient birth date: 19700101$' told
    vkt read f --personal --roi ::2,:,: | vkt info --json | grep -q '"patient id": *"S-4711"'
    /usr/bin/python3 -c '
from common import *
for i in range(3):
    d = pydicom.dcmread(f"f/{i}")
    d.SpecificCharacterSet = "ISO_IR 126"
    d.PatientName = "\u0391\u03bd\u03bd\u03b1"
    d.save_as(f"f/{i}")'
    vkt read f --personal | vkt info >told
    run ! grep -q 'attribute *patient name' told
    grep -q '4711' told
}

@test "gaps, slants, missing places, several series, doubles" {
    /usr/bin/python3 - <<'END'
from common import *
data = numpy.arange(5 * 4 * 4, dtype="u2").reshape(5, 4, 4)
slices("gap", data, [0, 1, 2, 4, 5])
slices("slant", data, [0, 1, 2, 3, 4], aside=0.2)
slices("two", data, [0, 1, 2, 3, 4], number=4)
for i in range(3):
    d = pydicom.dcmread(f"two/{i}"); d.SeriesInstanceUID = "1.2.3"; d.SeriesNumber = 9; d.save_as(f"two/other{i}")
slices("twice", data, [0, 1, 2, 3, 4])
for i in range(5):
    d = pydicom.dcmread(f"twice/{i}"); d.InstanceNumber += 100; d.PixelData = (d.pixel_array + 500).astype("u2").tobytes(); d.save_as(f"twice/b{i}")
END
    fails_with 3 "unequal distances: 2 mm from" vkt stats gap
    vkt read gap --force-uniform | vkt info --json >info
    grep -q '1.25' info
    fails_with 3 "0.2 mm aside of the one before it, 1 mm further" vkt stats slant
    fails_with 3 "vkt read slant --force-uniform | ..." vkt info slant # info itself has no such option
    vkt read slant --force-uniform | vkt info --json | /usr/bin/python3 -c '
import json, sys, numpy
i = json.load(sys.stdin)
assert numpy.allclose(numpy.array(i["direction"][2]) * i["spacing"][2], [0.2, 0, 1]), i'
    fails_with 2 "holds several variables: 4, 9" vkt stats two
    [ "$(vkt read two --variable 4 | vkt info --json | grep -c '"dims": \[4, 4, 5\]')" -eq 1 ] || vkt read two --variable 4 | vkt info --json | tr -d ' \n' | grep -q '"dims":\[4,4,5\]'
    /usr/bin/python3 - <<'END'
from common import *
i = infos("twice")
assert len(i) == 2 and i[0]["dims"] == [4, 4, 5], i
data = numpy.arange(5 * 4 * 4, dtype="u2")
assert voxels("twice").tobytes() == data.tobytes() + (data + 500).astype("u2").tobytes()
END
}

@test "files that are named one by one are the series of a folder, in whatever order" {
    /usr/bin/python3 - <<'END'
from common import *
data = numpy.random.default_rng(5).integers(0, 4000, (7, 5, 6)).astype("u2")
slices("f", data, numpy.arange(7) * 2.5, (0.8, 0.6, 0, -0.6, 0.8, 0))
slices("gap", data, [0, 1, 2, 4, 5, 6, 7]); slices("slant", data, numpy.arange(7), aside=0.2)
slices("pet", data, numpy.arange(7))
for k in range(7):
    d = pydicom.dcmread(f"pet/{k}"); d.RescaleSlope = k + 1; d.RescaleIntercept = 0; d.save_as(f"pet/{k}")
slices("other", data, numpy.arange(7), uid=generate_uid(), number=9)
many = base("many.dcm", data); many.NumberOfFrames = 7; many.SpacingBetweenSlices = 3; many.save_as("many.dcm")
END
    for folder in f pet; do
        vkt write $folder $folder.nrrd
        vkt stack $folder/[0-9] -o a.nrrd --force
        vkt stack $folder/6 $folder/1 $folder/0 $folder/5 $folder/2 $folder/4 $folder/3 -o b.nrrd --force
        vkt diff a.nrrd $folder.nrrd --geometry
        vkt diff b.nrrd $folder.nrrd --geometry
    done
    (cd f && vkt stack [0-9] | vkt diff - ../f.nrrd)
    vkt history a.nrrd | grep -q stack
    fails_with 3 "unequal distances: 2 mm from" vkt stack gap/* -o x.nrrd
    fails_with 3 "hint: as if all were equal, at their mean: vkt stack ... --force-uniform" vkt stack gap/* -o x.nrrd
    fails_with 3 "on a slant" vkt stack slant/* -o x.nrrd
    for folder in gap slant; do
        vkt stack $folder/* --force-uniform | vkt diff - <(vkt read $folder --force-uniform) --geometry
    done
    fails_with 2 "holds several variables: 4, 9" vkt stack f/* other/* -o x.nrrd
    vkt stack f/* other/* --variable 9 | vkt diff - other --geometry
    fails_with 2 "which these are not" vkt stack a.nrrd b.nrrd --variable 9 -o x.nrrd
    # Files of several frames are volumes, as they were.
    [ "$(vkt stack many.dcm many.dcm | vkt info | grep -c '^dims *6 5 7$')" -eq 2 ]
    head -c -20 f/3 >f/cut
    fails_with 3 "ended early" vkt stack f/* -o x.nrrd
    rm f/cut
    PYTHONPATH="$VKT_BUILD/oracles" /usr/bin/python3 -c 'import SimpleITK' 2>/dev/null || skip "SimpleITK is not installed"
    vkt stack f/* -o s.mha
    PYTHONPATH="$VKT_BUILD/oracles" /usr/bin/python3 - <<'END'
import numpy, SimpleITK as sitk
reader = sitk.ImageSeriesReader(); reader.SetFileNames(reader.GetGDCMSeriesFileNames("f"))
want, got = reader.Execute(), sitk.ReadImage("s.mha")
for what in ("GetOrigin", "GetSpacing", "GetDirection"): assert numpy.allclose(getattr(want, what)(), getattr(got, what)(), atol=1e-5), what
assert numpy.array_equal(sitk.GetArrayFromImage(want) + 1024, sitk.GetArrayFromImage(got)), "voxels"
END
}

@test "JPEG in a file that claims to write types and does not is read" {
    file=/usr/lib/python3/dist-packages/pydicom/data/test_files/SC_rgb_jpeg.dcm
    [ -e "$file" ] || skip "pydicom's test files are not installed"
    PYTHONPATH="$VKT_BUILD/oracles" /usr/bin/python3 -c 'import SimpleITK' 2>/dev/null || skip "SimpleITK is not installed"
    vkt write "$file" - --format raw >voxels
    PYTHONPATH="$VKT_BUILD/oracles" /usr/bin/python3 - "$file" <<'END'
import numpy, SimpleITK as sitk, sys
want = sitk.GetArrayFromImage(sitk.ReadImage(sys.argv[1]))[0]
got = numpy.fromfile("voxels", "u1").reshape(3, 256, 256)
assert numpy.array_equal(numpy.moveaxis(want, -1, 0), got)
END
    for n in 500 930 940 2000; do
        head -c $n "$file" >cut.dcm
        fails_with 3 "cut.dcm" vkt info cut.dcm
    done
}

@test "several frames, places of their own, slopes that differ, RLE" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(3)
data = rng.integers(0, 4000, (6, 8, 9)).astype("u2")
d = base("multi.dcm", data); d.NumberOfFrames = 6; d.SpacingBetweenSlices = 3; d.PixelSpacing = [2, 1]; d.save_as("multi.dcm")
assert voxels("multi.dcm").tobytes() == data.tobytes()
assert infos("multi.dcm")[0]["spacing"] == [1, 2, 3]
# Enhanced: a place for each frame, in any order.
order = rng.permutation(6)
d = base("enhanced.dcm", data[order]); d.NumberOfFrames = 6
def item(**kw):
    s = Dataset()
    for k, v in kw.items(): setattr(s, k, v)
    return Sequence([s])
shared = Dataset()
shared.PlaneOrientationSequence = item(ImageOrientationPatient=[1, 0, 0, 0, 1, 0])
shared.PixelMeasuresSequence = item(PixelSpacing=[2, 1], SliceThickness=4)
d.SharedFunctionalGroupsSequence = Sequence([shared])
frames = []
for i in order:
    f = Dataset(); f.PlanePositionSequence = item(ImagePositionPatient=[1, 2, float(10 + 4 * i)]); frames.append(f)
d.PerFrameFunctionalGroupsSequence = Sequence(frames)
d.save_as("enhanced.dcm")
assert voxels("enhanced.dcm").tobytes() == data.tobytes()
i = infos("enhanced.dcm")[0]
assert i["spacing"] == [1, 2, 4] and i["origin"] == [1, 2, 10], i
slices("pet", data, numpy.arange(6))
for k in range(6):
    d = pydicom.dcmread(f"pet/{k}"); d.RescaleSlope = k + 1; d.RescaleIntercept = 0; d.save_as(f"pet/{k}")
got = voxels("pet")
want = numpy.stack([pydicom.dcmread(f"pet/{k}").pixel_array * float(k + 1) for k in numpy.argsort([pydicom.dcmread(f"pet/{k}").ImagePositionPatient[2] for k in range(6)])])
assert got.dtype == "float32" and numpy.array_equal(got, want.astype("f4").ravel())
d = base("rle.dcm", data[0]); d.compress(RLELossless); d.save_as("rle.dcm")
assert voxels("rle.dcm").tobytes() == data[0].tobytes()
END
}

@test "doses have a slope and places of their own; values that are not read are named" {
    /usr/bin/python3 - <<'END'
from common import *
data = numpy.random.default_rng(6).integers(0, 2**31, (5, 8, 9)).astype("u4")
def dose(name, offsets, orientation=(1, 0, 0, 0, 1, 0)):
    d = base(name, data, bits=32, modality="RTDOSE")
    del d.RescaleSlope, d.RescaleIntercept
    d.NumberOfFrames, d.PixelSpacing, d.SliceThickness = 5, [2, 1], 9
    d.ImagePositionPatient, d.ImageOrientationPatient = [1, 2, 30], list(orientation)
    d.GridFrameOffsetVector, d.DoseGridScaling, d.DoseUnits = offsets, "0.0005", "GY"
    d.save_as(name)
    i = infos(name)[0]
    assert i["slope"] == 0.0005 and i["units"] == "GY", i
    return i["spacing"], i["origin"], voxels(name).reshape(data.shape)
spacing, origin, got = dose("relative.dcm", [0, 2.5, 5, 7.5, 10])
assert spacing == [1, 2, 2.5] and origin == [1, 2, 30] and numpy.array_equal(got, data), (spacing, origin)
spacing, origin, got = dose("absolute.dcm", [30, 27.5, 25, 22.5, 20])
assert spacing == [1, 2, 2.5] and origin == [1, 2, 20] and numpy.array_equal(got, data[::-1]), (spacing, origin)
spacing, origin, got = dose("down.dcm", [30, 27.5, 25, 22.5, 20], (1, 0, 0, 0, -1, 0))
assert spacing == [1, 2, 2.5] and origin == [1, 2, 30] and numpy.array_equal(got, data), (spacing, origin)
d = pydicom.dcmread("relative.dcm"); d.GridFrameOffsetVector = [0, 1, 2, 3, 9]; d.save_as("uneven.dcm")
d = base("high.dcm", data[0].astype("u2")); d.BitsStored, d.HighBit = 12, 15; d.save_as("high.dcm")
d = base("float.dcm", data[0]); d.FloatPixelData = data[0].astype("f4").tobytes(); del d.PixelData; d.save_as("float.dcm")
END
    fails_with 3 "Bits Stored is 12, High Bit 15" vkt info high.dcm
    fails_with 3 "Float Pixel Data" vkt info float.dcm
    fails_with 3 "unequal distances" vkt info uneven.dcm
}

@test "single bits, black that is the largest value, palettes, and files that begin without a preamble" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(8)
bits = (rng.random((3, 7, 9)) > 0.5).astype("u1") # frames do not end with a byte
d = base("bits.dcm", bits, bits=1, modality="SEG"); d.BitsAllocated = 1; d.NumberOfFrames = 3
packed = numpy.packbits(bits.ravel(), bitorder="little").tobytes()
d.PixelData = packed + bytes(len(packed) % 2); d.save_as("bits.dcm")
assert voxels("bits.dcm").tobytes() == bits.tobytes() == pydicom.dcmread("bits.dcm").pixel_array.astype("u1").tobytes()
d.PixelData = packed[:-4]; d.save_as("few.dcm")
data = rng.integers(0, 4000, (3, 8, 9)).astype("u2")
for name, said in (("MONOCHROME1", "min is white"), ("PALETTE COLOR", "palette")):
    d = base("kind.dcm", data[0]); d.PhotometricInterpretation = name
    for colour in ("Red", "Green", "Blue"):
        setattr(d, colour + "PaletteColorLookupTableDescriptor", [4096, 0, 16])
        setattr(d, colour + "PaletteColorLookupTableData", bytes(8192))
    d.save_as("kind.dcm")
    assert voxels("kind.dcm").tobytes() == data[0].tobytes()
    assert infos("kind.dcm")[0]["attributes"]["photometric"] == said
for syntax in (ImplicitVRLittleEndian, ExplicitVRLittleEndian):
    slices("bare", data, [0, 1, 2], syntax=syntax)
    for i in range(3):
        d = pydicom.dcmread(f"bare/{i}"); d.preamble = None; del d.file_meta
        d.is_little_endian, d.is_implicit_VR = True, syntax == ImplicitVRLittleEndian
        pydicom.dcmwrite(f"bare/{i}", d, write_like_original=True)
    assert open("bare/0", "rb").read(2) == b"\x08\0"
    assert voxels("bare").tobytes() == data.tobytes()
    assert voxels("bare/0").size == 72
END
    fails_with 3 "fewer pixels than it says" vkt stats few.dcm
}

@test "damaged files end in an error and never in a crash" {
    /usr/bin/python3 - <<'END'
import random
from common import *
data = numpy.arange(5 * 16 * 16, dtype="u2").reshape(5, 16, 16)
slices("f", data, [0, 1, 2, 3, 4])
good = open("f/0", "rb").read()
random.seed(7)
for i in range(60):
    bad = bytearray(good)
    for _ in range(random.randint(1, 6)): bad[random.randrange(132, len(bad))] = random.randrange(256)
    if i % 3 == 0: bad = bad[:random.randrange(140, len(bad))]
    open("bad.dcm", "wb").write(bad)
    run = subprocess.run(["vkt", "stats", "bad.dcm"], capture_output=True, timeout=60)
    assert run.returncode in (0, 1, 2, 3, 5), (i, run.returncode, run.stderr)
open("short.dcm", "wb").write(good[:-100])
# Cut among the elements before the pixels, at which GDCM may end: told, and in a folder the file is named.
slices("cut", data, [0, 1, 2, 3, 4])
for n in range(100, good.rfind(b"\xe0\x7f\x10\0"), 7):
    open("cut.dcm", "wb").write(good[:n])
    run = subprocess.run(["vkt", "info", "cut.dcm"], capture_output=True, timeout=60)
    assert run.returncode == 3 and b"crashed" not in run.stderr, (n, run.returncode, run.stderr)
open("cut/zz", "wb").write(good[:500])
END
    fails_with 3 "'cut/zz': ended early: it has no whole header" vkt info cut
    fails_with 3 "short.dcm" vkt stats short.dcm
    mkdir empty && fails_with 4 "holds neither DICOM files nor slices" vkt stats empty
}

@test "the sample, against SimpleITK" {
    needs_data dicom/ct_head_phantom_5mm
    python_with SimpleITK
    /usr/bin/python3 - "$VKT_DATA/dicom/ct_head_phantom_5mm" <<'END'
from common import *
import SimpleITK
reader = SimpleITK.ImageSeriesReader()
reader.SetFileNames(reader.GetGDCMSeriesFileNames(sys.argv[1]))
image = reader.Execute()
i = infos(sys.argv[1])[0]
assert i["dims"] == list(image.GetSize()) and numpy.allclose(i["spacing"], image.GetSpacing()), i
assert numpy.allclose(i["origin"], image.GetOrigin()), (i["origin"], image.GetOrigin())
assert numpy.allclose(numpy.array(i["direction"]).T.ravel(), image.GetDirection())
got = voxels(sys.argv[1]) * i.get("slope", 1) + i.get("intercept", 0)
assert numpy.array_equal(got, SimpleITK.GetArrayFromImage(image).ravel())
END
    vkt write "$VKT_DATA/dicom/ct_head_phantom_5mm" a.nrrd && vkt diff "$VKT_DATA/dicom/ct_head_phantom_5mm" a.nrrd
}

@test "written files are what pydicom and SimpleITK find, and come back the same" {
    cat >written.py <<'END'
from common import *
try: import SimpleITK as sitk
except ImportError: sitk = None
def sh(line): return subprocess.run(line, shell=True, check=True, capture_output=True, text=True)
rng = numpy.random.default_rng(4)
uids = set()
for code in "uint8 int8 uint16 int16".split():
    low, high = numpy.iinfo(code).min, numpy.iinfo(code).max
    data = rng.integers(low, high + 1, (5, 7, 9)).astype(code) # slices and volumes of an odd number of bytes
    data.tofile("a.raw")
    sh(f"vkt read a.raw --dims 9 7 5 --dtype {code} --spacing 0.7,0.9,2.3 | vkt set --origin 1.25,-2,3.1 --direction 0.8,0.6,0,0,0,-1,-0.6,0.8,0"
       " --units HU --slope 0.1 --intercept -1024.5 --attribute space=LPS --attribute modality=CT --no-history -o a.vkt --force")
    # The same place in another frame and unit.
    sh("vkt set a.vkt --origin -1250,2000,3100 --direction -0.8,-0.6,0,0,0,-1,0.6,-0.8,0 --spacing 700,900,2300 --attribute space=RAS"
       """ --attribute 'space units="um" "um" "um"' -o b.vkt --force""")
    for volume in "a", "b":
        names = f"{code}{volume}.dcm", f"{code}{volume}"
        for name, out in zip(names, (names[0], names[1] + "/")):
            assert sh(f"vkt write {volume}.vkt {out}").stderr == ""
            sh(f"vkt diff a.vkt {name}")
            i = infos(name)[0]
            assert i["dtype"] == code and i["slope"] == 0.1 and i["intercept"] == -1024.5 and i["units"] == "HU", i
            assert i["spacing"] == [0.7, 0.9, 2.3] and i["attributes"]["modality"] == "CT", i
        several = pydicom.dcmread(names[0])
        singles = [pydicom.dcmread(f"{names[1]}/slice{k:04}.dcm") for k in range(1, 6)]
        assert (several.pixel_array == data).all() and (numpy.stack([d.pixel_array for d in singles]) == data).all()
        at = numpy.array([1.25, -2, 3.1]) + numpy.arange(5)[:, None] * 2.3 * numpy.array([-0.6, 0.8, 0])
        frames = [f.PlanePositionSequence[0].ImagePositionPatient for f in several.PerFrameFunctionalGroupsSequence]
        assert numpy.allclose(frames, at) and numpy.allclose([d.ImagePositionPatient for d in singles], at)
        for d in several, *singles:
            assert d.Modality == "CT" and d.RescaleSlope == 0.1 and d.RescaleIntercept == -1024.5 and d.RescaleType == "HU"
            for element in d.iterall():
                personal = element.tag.group == 0x10 or element.VR in ("DA", "TM", "DT", "PN")
                assert not personal or element.value in ("", None), element
            assert d.SOPInstanceUID not in uids and d.SOPInstanceUID == d.file_meta.MediaStorageSOPInstanceUID
            uids |= {d.SOPInstanceUID, d.StudyInstanceUID}
        assert len({d.SeriesInstanceUID for d in singles}) == 1 and several.SeriesInstanceUID != singles[0].SeriesInstanceUID
        assert [int(d.InstanceNumber) for d in singles] == [1, 2, 3, 4, 5]
        if sitk is None: continue
        series = sitk.ImageSeriesReader()
        series.SetFileNames(series.GetGDCMSeriesFileNames(names[1]))
        for image in sitk.ReadImage(names[0]), series.Execute():
            assert numpy.allclose(sitk.GetArrayFromImage(image), data * 0.1 - 1024.5, rtol=0, atol=1e-9)
            assert numpy.allclose(image.GetSpacing(), [0.7, 0.9, 2.3]) and numpy.allclose(image.GetOrigin(), [1.25, -2, 3.1])
            assert numpy.allclose(numpy.array(image.GetDirection()).reshape(3, 3).T, [[0.8, 0.6, 0], [0, 0, -1], [-0.6, 0.8, 0]])
END
    /usr/bin/python3 written.py
    vkt write a.vkt one.dcm.gz
    vkt diff a.vkt one.dcm.gz
    vkt write a.vkt some --format dicom
    vkt diff a.vkt some # a name without its end
    vkt read a.vkt --slab 1 | vkt crop --roi :,:,2:3 -o thin/
    vkt crop a.vkt --roi :,:,2:3 | vkt diff - thin
    python_with SimpleITK # the rest of the test, which ran
}

@test "what DICOM has no place for is refused or said; what fails leaves nothing" {
    vkt make ramp --dims 9 8 7 --dtype float32 -o f.vkt
    fails_with 2 "8 or 16 bits in a pixel, not float32" vkt write f.vkt f.dcm
    fails_with 2 "vkt convert --dtype uint16 --range minmax" vkt write f.vkt f/
    vkt convert f.vkt --dtype uint16 --range minmax -o w.dcm 2>err
    vkt diff f.vkt w.dcm --tolerance 0.01
    grep -q 'all digits of the map of values' err
    vkt set <(vkt convert f.vkt --dtype uint16) --attribute space=LPS --slope 2 -o u.vkt
    vkt write u.vkt u/
    vkt diff u.vkt u
    fails_with 2 "no sheared lattices" vkt write <(vkt set u.vkt --direction 1,0,0,0.6,0.8,0,0,0,1) s/
    fails_with 2 "no sheared lattices" vkt write <(vkt set u.vkt --direction 1,0,0,0,1,0,0,0.6,0.8) s.dcm
    fails_with 2 "65535 by 65535" vkt make constant --dims 65536 1 1 --dtype uint8 -o s.dcm
    fails_with 2 "write a folder with a file for each slice" vkt make constant --dims 60000 60000 2 --dtype uint8 -o s.dcm
    fails_with 2 "name it like out_%04d.dcm" vkt write <(vkt read u.vkt && vkt read u.vkt) s.dcm
    fails_with 2 "not compressed" vkt write u.vkt s.dcm --compress
    fails_with 4 "the directory exists" vkt write u.vkt u/
    vkt flip x u.vkt -o u/ --force
    vkt flip x u.vkt | vkt flip z | vkt diff - u # to the right-handed lattice
    vkt flip x u -o u/ --force
    vkt flip z u.vkt | vkt flip z | vkt diff - u # read and replaced at once
    touch u/notes
    fails_with 4 "it holds files that are no DICOM files" vkt write u.vkt u/ --force
    said='DICOM files do not hold all digits of the map of values, labels, the attributes note patient name, what stood in the JSON file beside, the error, the history: not kept'
    vkt filter gaussian u.vkt --sigma 1 | vkt set --slope 0.12345678901234567 --attribute note=x --attribute 'sidecar={"a":1}' --attribute Segment0_Name=liver \
        --attribute 'patient name=Secret^Person' -o rich.vkt
    fails_with 3 "--strict: $said" vkt read rich.vkt -o strict/ --strict
    vkt write rich.vkt rich/ 2>err
    grep -qx "vkt write: $said" err
    run ! grep -qra 'Secret' rich
    [ ! -e s ]
    [ ! -e s.dcm ]
    [ ! -e strict ]
    [ -z "$(find . -name '.*vkt-*')" ]
    # Killed in the middle of a series, and of a file.
    for out in d/none/ d/none.dcm; do
        mkdir -p d
        mkfifo pipe
        vkt write pipe $out &
        writer=$!
        exec 7>pipe
        head -c 900 u.vkt >&7
        sleep 0.3
        kill -9 $writer
        wait $writer || true
        exec 7>&-
        for _ in $(seq 100); do [ -n "$(ls -A d)" ] || break; sleep 0.05; done
        [ -z "$(ls -A d)" ] || { ls -A d >&2; false; }
        rm pipe
    done
    mkdir small
    mount -t tmpfs -o size=64k tmpfs small 2>/dev/null || skip "a tmpfs cannot be mounted here"
    failed=0
    for out in small/a/ small/a.dcm; do
        fails_with 4 "space left" vkt make constant --dims 128 128 32 --dtype uint16 -o $out || failed=1
        [ -z "$(ls -A small)" ] || failed=1
    done
    umount small
    [ $failed -eq 0 ]
}

@test "times of enhanced frames, rescaling of 32 bits, copies, a DICOMDIR, detectors, tables of values" {
    /usr/bin/python3 - <<'END'
from common import *
import shutil
rng = numpy.random.default_rng(13)
data = rng.integers(0, 4000, (6, 8, 9)).astype("u2")
def item(**kw):
    s = Dataset()
    for k, v in kw.items(): setattr(s, k, v)
    return Sequence([s])
# Frames of two times at three places, in any order.
order = rng.permutation(6)
d = base("times.dcm", data[order]); d.NumberOfFrames = 6
shared = Dataset(); shared.PlaneOrientationSequence = item(ImageOrientationPatient=[1, 0, 0, 0, 1, 0]); shared.PixelMeasuresSequence = item(PixelSpacing=[2, 1])
d.SharedFunctionalGroupsSequence = Sequence([shared])
frames = []
for i in order:
    f = Dataset(); f.PlanePositionSequence = item(ImagePositionPatient=[1, 2, float(4 * (i % 3))])
    f.FrameContentSequence = item(TemporalPositionIndex=int(i // 3 + 1)); frames.append(f)
d.PerFrameFunctionalGroupsSequence = Sequence(frames); d.save_as("times.dcm")
assert voxels("times.dcm").tobytes() == data.tobytes() and len(infos("times.dcm")) == 2
# What float32 does not hold.
deep = rng.integers(2**30, 2**31, (3, 8, 9)).astype("u4")
slices("deep", deep, numpy.arange(3), bits=32)
for k in range(3):
    d = pydicom.dcmread(f"deep/{k}"); d.RescaleSlope = 1 + d.ImagePositionPatient[2]; d.RescaleIntercept = 0.5; d.save_as(f"deep/{k}")
got = voxels("deep").reshape(deep.shape); place = infos("deep")[0]["origin"][2]
assert got.dtype == "float64" and numpy.array_equal(got, deep * (1.0 + place + numpy.arange(3))[:, None, None] + 0.5)
# The same image twice is there once; another one in the same place is another volume.
slices("copies", data, numpy.arange(6)); shutil.copy("copies/3", "copies/again")
assert voxels("copies").tobytes() == data.tobytes()
# Nuclear medicine: the detector says where its frames lie.
d = base("nm.dcm", data, modality="NM"); d.NumberOfFrames, d.PixelSpacing, d.SpacingBetweenSlices = 6, [2, 1], 3
d.DetectorInformationSequence = item(ImagePositionPatient=[1, 2, 3], ImageOrientationPatient=[1, 0, 0, 0, 0, -1]); d.save_as("nm.dcm")
i = infos("nm.dcm")[0]
assert i["origin"] == [1, 2, 3] and i["spacing"] == [1, 2, 3] and i["direction"] == [[1, 0, 0], [0, 0, -1], [0, 1, 0]], i
d = base("table.dcm", data[0]); del d.RescaleSlope, d.RescaleIntercept
d.ModalityLUTSequence = item(LUTDescriptor=[4096, 0, 16], ModalityLUTType="US", LUTData=bytes(8192)); d.ModalityLUTSequence[0]["LUTData"].VR = "OW"; d.save_as("table.dcm")
d = base("mosaic.dcm", data[0], modality="MR"); d.ImageType = ["ORIGINAL", "PRIMARY", "M", "MOSAIC"]; d.save_as("mosaic.dcm")
# Discs: an index, and images in folders beside it, by names that may have got small letters.
os.makedirs("disc/images/ct")
records = []
for k in range(6):
    shutil.copy(f"copies/{k}", f"disc/images/ct/im{k}")
    r = Dataset(); r.OffsetOfTheNextDirectoryRecord, r.RecordInUseFlag, r.OffsetOfReferencedLowerLevelDirectoryEntity = 0, 0xffff, 0
    r.DirectoryRecordType, r.ReferencedFileID = "IMAGE", ["IMAGES", "CT", f"IM{k}"]; records.append(r)
d = base("x", data[0])
for name in ("Rows", "Columns", "PixelData", "SamplesPerPixel", "BitsAllocated", "BitsStored", "HighBit", "PixelRepresentation", "PhotometricInterpretation"): delattr(d, name)
d.file_meta.MediaStorageSOPClassUID = "1.2.840.10008.1.3.10"; d.DirectoryRecordSequence = Sequence(records); d.save_as("disc/DICOMDIR")
assert voxels("disc/DICOMDIR").tobytes() == data.tobytes() == voxels("disc").tobytes()
records[2].ReferencedFileID = ["..", "..", "copies", "2"]; d.save_as("disc/out")
os.remove("disc/images/ct/im%d" % max(range(6), key=lambda k: pydicom.dcmread(f"copies/{k}").ImagePositionPatient[2]))
END
    vkt info copies | grep -q 'not read *1 copy of images that are there already'
    vkt info table.dcm | grep -q 'not read *the modality LUT, which says what its values mean'
    vkt info mosaic.dcm | grep -q 'not read *the places of slices in a mosaic'
    vkt info disc/DICOMDIR | grep -q 'not read *1 file named by the DICOMDIR, but not there'
    fails_with 3 "leads out of its directory" vkt info disc/out
}

@test "black that is the largest value: as stored, as pydicom has it; SimpleITK turns it round" {
    python_with SimpleITK
    /usr/bin/python3 - <<'END'
from common import *
import SimpleITK
data = numpy.random.default_rng(14).integers(0, 4000, (3, 8, 9)).astype("u2")
slices("f", data, numpy.arange(3), bits=12)
for k in range(3):
    d = pydicom.dcmread(f"f/{k}"); d.PhotometricInterpretation = "MONOCHROME1"; d.save_as(f"f/{k}")
place = sorted(range(3), key=lambda k: pydicom.dcmread(f"f/{k}").ImagePositionPatient[2])
got = voxels("f").reshape(data.shape)
assert numpy.array_equal(got, numpy.stack([pydicom.dcmread(f"f/{k}").pixel_array for k in place]))
i = infos("f")[0]
assert i["attributes"]["photometric"] == "min is white" and i["slope"] == 1 and i["intercept"] == -1024, i
reader = SimpleITK.ImageSeriesReader(); reader.SetFileNames(reader.GetGDCMSeriesFileNames("f"))
turned = SimpleITK.GetArrayFromImage(reader.Execute())
assert numpy.array_equal(turned, 4095 - got.astype("i4") - 1024)
END
}

@test "signs of twelve encoded bits; luma and colour differences are the colours that pydicom makes of them" {
    /usr/bin/python3 - <<'END'
from common import *
from pydicom.pixel_data_handlers.util import convert_color_space
rng = numpy.random.default_rng(15)
data = rng.integers(-2048, 2048, (8, 9)).astype("i2")
d = base("rle.dcm", data & numpy.int16(0xfff), bits=12); d.compress(RLELossless); d.save_as("rle.dcm")
assert voxels("rle.dcm").tobytes() == data.tobytes()
# By JPEG-LS, which has no signs: (arange(30) * 50 - 700) & 0xfff.
import base64
ramp = (numpy.arange(30).reshape(5, 6) * 50 - 700).astype("i2")
d = base("jls.dcm", ramp, bits=12, syntax=pydicom.uid.JPEGLSLossless)
d.PixelData = pydicom.encaps.encapsulate([base64.b64decode("/9j/6AAgU1BJRkYAAgAAAQAAAAUAAAAGChAGAQAAASwAAAEs/+gACAAAAAH/2P/3AAsQAAUABgEBEQD/+AANAf//ABIAQwEUAED/2gAIAQEAAAAAAaHjHGGX5dreWIyRimCXoyZWrgAAAADSwAgCAAC1cAMsRci1GLK0WIrSpKUwAP/Z")]); d["PixelData"].is_undefined_length = True; d["PixelData"].VR = "OB"; d.save_as("jls.dcm")
assert voxels("jls.dcm").tobytes() == ramp.tobytes()
colours = rng.integers(0, 256, (2, 8, 9, 3)).astype("u1")
want = numpy.ascontiguousarray(numpy.moveaxis(convert_color_space(colours, "YBR_FULL", "RGB"), -1, 0))
for planar in (0, 1):
    d = base("ybr.dcm", colours[0, ..., 0], bits=8); d.SamplesPerPixel, d.PhotometricInterpretation, d.PlanarConfiguration, d.NumberOfFrames = 3, "YBR_FULL", planar, 2
    d.PixelData = (numpy.moveaxis(colours, -1, 1) if planar else colours).tobytes(); d.save_as("ybr.dcm")
    assert voxels("ybr.dcm").tobytes() == want.tobytes(), planar
END
}

@test "pixels that GDCM decodes otherwise: big-endian words of four bytes and pairs of one, runs of colours, doses of one frame; a preamble of TIFF" {
    /usr/bin/python3 - <<'END'
from common import *
rng = numpy.random.default_rng(16)
deep = rng.integers(0, 2**32, (3, 8, 9)).astype("u4")
d = base("deep.dcm", deep, bits=32, syntax=ExplicitVRBigEndian); d.NumberOfFrames = 3; d.save_as("deep.dcm")
assert voxels("deep.dcm").tobytes() == deep.tobytes()
odd = rng.integers(0, 256, (3, 3, 5)).astype("u1") # frames do not end with a word
d = base("odd.dcm", odd, bits=8, syntax=ExplicitVRBigEndian); d.NumberOfFrames = 3
d.PixelData = numpy.frombuffer(odd.tobytes() + b"\0", "u2").byteswap().tobytes(); d["PixelData"].VR = "OW"; d.save_as("odd.dcm")
assert voxels("odd.dcm").tobytes() == odd.tobytes()
for code in ("u1", "u2"):
    for frames in (1, 2):
        colours = rng.integers(0, 256 ** int(code[1]) // 2, (frames, 8, 9, 3)).astype(code)
        colours[:, :, 3:7] = colours[:, :, 3:4] # some runs
        d = base("rle.dcm", colours[0, ..., 0], bits=8 * int(code[1])); d.SamplesPerPixel, d.PhotometricInterpretation, d.PlanarConfiguration, d.NumberOfFrames = 3, "RGB", 0, frames
        d.PixelData = colours.tobytes(); d.compress(RLELossless); d.save_as("rle.dcm")
        assert voxels("rle.dcm").tobytes() == numpy.moveaxis(colours, -1, 0).tobytes(), (code, frames)
good = open("rle.dcm", "rb").read(); at = good.rfind(b"\xfe\xff\x00\xe0") + 8
open("bad.dcm", "wb").write(good[:at + 4] + b"\xff\xff\xff\x7f" + good[at + 8:])
open("runs.dcm", "wb").write(good[:at + 64] + b"\x7f" * (len(good) - at - 72) + good[-8:])
# A dose of one frame, which says so by saying nothing.
d = base("dose.dcm", deep[0], bits=32, modality="RTDOSE", sop="1.2.840.10008.5.1.4.1.1.481.2")
del d.RescaleSlope, d.RescaleIntercept
d.DoseGridScaling, d.FrameIncrementPointer = "1e-06", 0x3004000c; d.save_as("dose.dcm")
assert voxels("dose.dcm").tobytes() == deep[0].tobytes() and infos("dose.dcm")[0]["slope"] == 1e-6
# Scanners of GE begin their files with a directory of TIFF, which may lead nowhere.
slices("tiff", deep.astype("u2"), numpy.arange(3))
for k in range(3):
    b = bytearray(open(f"tiff/{k}", "rb").read()); b[:8] = b"II*\0\xf4\x05\x08\0"; open(f"tiff/{k}", "wb").write(b)
assert voxels("tiff").tobytes() == deep.astype("u2").tobytes() and voxels("tiff/0").size == 72
END
    vkt info tiff/0 | grep -q '^format *dicom$'
    fails_with 3 "its runs of bytes are no frame" vkt stats bad.dcm
    fails_with 3 "its runs of bytes are no frame" vkt stats runs.dcm
}

@test "frames of several stacks, times, diffusion weights and segments are volumes of a series, or series of their own" {
    cat >frames.py <<'END'
from common import *
STACK, IN_STACK, TIME, B, POSITION, SEGMENT = 0x00209056, 0x00209057, 0x00209128, 0x00189087, 0x00200032, 0x0062000b
def item(**kw):
    s = Dataset()
    for k, v in kw.items(): setattr(s, k, v)
    return Sequence([s])
def enhanced(name, frames, dims=(), seed=1):
    """frames: dictionaries of pixels, pos and what else they are said to be; they are shuffled."""
    frames = [frames[i] for i in numpy.random.default_rng(seed).permutation(len(frames))]
    d = base(name, numpy.stack([f["pixels"] for f in frames]), modality=frames[0].get("modality", "MR")); d.NumberOfFrames = len(frames)
    d.DimensionIndexSequence = Sequence([])
    for tag in dims:
        x = Dataset(); x.DimensionIndexPointer = tag; d.DimensionIndexSequence.append(x)
    shared = Dataset(); shared.PixelMeasuresSequence = item(PixelSpacing=[2, 1], SliceThickness=3)
    d.SharedFunctionalGroupsSequence, groups = Sequence([shared]), []
    for f in frames:
        g = Dataset()
        g.PlanePositionSequence = item(ImagePositionPatient=[float(v) for v in f["pos"]])
        g.PlaneOrientationSequence = item(ImageOrientationPatient=list(f.get("orient", (1, 0, 0, 0, 1, 0))))
        content = {}
        if "stack" in f: content |= dict(StackID=str(f["stack"]), InStackPositionNumber=f["place"])
        if "time" in f: content["TemporalPositionIndex"] = f["time"]
        if dims: content["DimensionIndexValues"] = f["index"]
        if content: g.FrameContentSequence = item(**content)
        if "b" in f:
            diffusion = dict(DiffusionBValue=float(f["b"]))
            if "gradient" in f: diffusion["DiffusionGradientDirectionSequence"] = item(DiffusionGradientOrientation=list(map(float, f["gradient"])))
            g.MRDiffusionSequence = item(**diffusion)
        if "phase" in f: g.CardiacSynchronizationSequence = item(NominalPercentageOfCardiacPhase=float(f["phase"]))
        if "segment" in f: g.SegmentIdentificationSequence = item(ReferencedSegmentNumber=f["segment"])
        groups.append(g)
    d.PerFrameFunctionalGroupsSequence = Sequence(groups); d.save_as(name)
v = numpy.random.default_rng(21).integers(0, 4000, (3, 4, 8, 9)).astype("u2")
w = numpy.random.default_rng(22).integers(0, 4000, (2, 3, 4, 8, 9)).astype("u2")
def at(z, more=0): return (1, 2, 10 + 3 * z + more)
weights = (0, 500, 1000)
def same(name, want, *options):
    got = voxels(name, *options)
    assert got.tobytes() == want.tobytes(), name
    i = infos(name, *options)
    assert len(i) == (len(want) if want.ndim == 4 else 1) and i[0]["dims"] == [9, 8, 4] and i[0]["spacing"] == [1, 2, 3], (name, i[0])
    return i
END
    /usr/bin/python3 - <<'END'
from frames import *
cells = [(k, z) for k in range(3) for z in range(4)]
# Diffusion weights, by dimension indices and without.
frames = [dict(pixels=v[k, z], pos=at(z), b=weights[k], stack=1, place=z + 1, index=[1, z + 1, k + 1]) for k, z in cells]
for dims in (STACK, IN_STACK, B), ():
    enhanced("b.dcm", frames, dims)
    assert [i["attributes"]["b value"] for i in same("b.dcm", v)] == ["0", "500", "1000"]
frames = [dict(pixels=v[k, z], pos=at(z), b=1000 if k else 0, **({"gradient": (1, 0, 0) if k == 2 else (0, 1, 0)} if k else {})) for k, z in cells]
enhanced("dti.dcm", frames)
told = [i["attributes"].get("gradient direction") for i in same("dti.dcm", v)]
assert told == [None, "0 1 0", "1 0 0"], told
# Times, cardiac phases, times of several weights.
enhanced("time.dcm", [dict(pixels=v[k, z], pos=at(z), time=k + 1, index=[k + 1, z + 1]) for k, z in cells], (TIME, POSITION)); same("time.dcm", v)
enhanced("phase.dcm", [dict(pixels=v[k, z], pos=at(z), phase=30 * k) for k, z in cells])
assert [i["attributes"]["cardiac phase"] for i in same("phase.dcm", v)] == ["0", "30", "60"]
frames = [dict(pixels=w[t, k, z], pos=at(z), time=t + 1, b=weights[k], index=[t + 1, k + 1, z + 1]) for t in range(2) for k in range(3) for z in range(4)]
enhanced("both.dcm", frames, (TIME, B, POSITION)); same("both.dcm", w.reshape(6, 4, 8, 9))
# By what pydicom says of every frame: the order of its indices, the place last.
d = pydicom.dcmread("both.dcm")
def key(i): return list(d.PerFrameFunctionalGroupsSequence[i].FrameContentSequence[0].DimensionIndexValues)
assert voxels("both.dcm").tobytes() == d.pixel_array[sorted(range(24), key=key)].tobytes()
# Stacks in the same places are volumes, elsewhere or turned they are series; each a slice they are one volume.
enhanced("same.dcm", [dict(pixels=v[k, z], pos=at(z), stack=k + 1, place=z + 1, index=[k + 1, z + 1]) for k, z in cells], (STACK, IN_STACK))
assert [i["attributes"]["stack"] for i in same("same.dcm", v)] == ["1", "2", "3"]
enhanced("apart.dcm", [dict(pixels=v[k, z], pos=at(z, 100 * k), stack=k + 1, place=z + 1, index=[k + 1, z + 1]) for k, z in cells], (STACK, IN_STACK))
for k, name in enumerate(("4", "4-2", "4-3")):
    assert same("apart.dcm", v[k], "--variable", name)[0]["origin"] == [1, 2, 10 + 100 * k]
turned = (1, 0, 0, 0, 1, 0), (0, 1, 0, 0, 0, -1), (1, 0, 0, 0, 0, -1)
frames = [dict(pixels=v[k, z], pos=numpy.array((1, 2, 10)) + 3 * z * numpy.cross(turned[k][:3], turned[k][3:]), orient=turned[k], stack=k + 1, place=z + 1, index=[k + 1, z + 1]) for k, z in cells]
enhanced("survey.dcm", frames, (STACK, IN_STACK))
seen = {}
for name in ("4", "4-2", "4-3"):
    i = infos("survey.dcm", "--variable", name)[0]
    k = [list(t[:3]) + list(t[3:]) for t in turned].index(i["direction"][0] + i["direction"][1])
    same("survey.dcm", v[k], "--variable", name); seen[k] = name
assert len(seen) == 3
enhanced("single.dcm", [dict(pixels=v[0, z], pos=at(z), stack=z + 1, place=1, index=[z + 1, 1]) for z in range(4)], (STACK, IN_STACK)); same("single.dcm", v[0])
enhanced("segments.dcm", [dict(pixels=v[k, z], pos=at(z), segment=k + 1, index=[k + 1, z + 1], modality="SEG") for k, z in cells], (SEGMENT, POSITION))
assert [i["attributes"]["segment"] for i in same("segments.dcm", v)] == ["1", "2", "3"]
# A file for each time, whose frames are in orders of their own.
import os
os.mkdir("files")
for k in range(3): enhanced(f"files/{k}", [dict(pixels=v[k, z], pos=at(z), time=k + 1, index=[k + 1, z + 1]) for z in range(4)], (TIME, POSITION), seed=k)
same("files", v)
# Refused: one frame less, one less of two volumes each, a gap, a slant.
enhanced("missing.dcm", [dict(pixels=v[k, z], pos=at(z), time=k + 1, index=[k + 1, z + 1]) for k, z in cells if (k, z) != (1, 2)], (TIME, POSITION))
less = [(k, z) for k, z in cells if (k, z) not in ((1, 0), (0, 1), (2, 2), (2, 3))]
enhanced("mixed.dcm", [dict(pixels=v[k, z], pos=at(z), time=k + 1, index=[k + 1, z + 1]) for k, z in less], (TIME, POSITION))
enhanced("weights.dcm", [dict(pixels=v[k, z], pos=at(z), b=weights[k]) for k, z in less])
enhanced("gap.dcm", [dict(pixels=v[k, z], pos=at(z, 5 * (z == 3)), time=k + 1, index=[k + 1, z + 1]) for k, z in cells], (TIME, POSITION))
enhanced("slant.dcm", [dict(pixels=v[k, z], pos=numpy.array(at(z)) + (0.4 * z, 0, 0), time=k + 1, index=[k + 1, z + 1]) for k, z in cells], (TIME, POSITION))
END
    vkt info apart.dcm | grep -q 'variable 4-2: MR, stack 2, 4 images of 9 by 8'
    fails_with 3 "in the same places unequally often" vkt stats missing.dcm
    fails_with 3 "its frames do not make whole volumes" vkt stats mixed.dcm
    fails_with 3 "its frames do not make whole volumes" vkt stats weights.dcm
    vkt read mixed.dcm --force-uniform | vkt info --json | grep -c '"dims"' | grep -qx 2
    fails_with 3 "unequal distances" vkt stats gap.dcm
    fails_with 3 "on a slant" vkt stats slant.dcm
    vkt read slant.dcm --force-uniform | vkt info --json | /usr/bin/python3 -c '
import json, sys, numpy
i = json.load(sys.stdin)
assert len(i) == 3 and numpy.allclose(numpy.array(i[0]["direction"][2]) * i[0]["spacing"][2], [0.4, 0, 3]), i'
}

@test "hundreds of damaged files of every kind: an exit code of errors, one line, no signal, whatever GDCM does" {
    /usr/bin/python3 - <<'END'
import os, random, re, shutil
from concurrent.futures import ThreadPoolExecutor
from common import *
data = numpy.arange(5 * 16 * 16, dtype="u2").reshape(5, 16, 16)
def item(**kw):
    s = Dataset()
    for k, v in kw.items(): setattr(s, k, v)
    return Sequence([s])
sources = {}
for name, syntax in (("explicit", ExplicitVRLittleEndian), ("implicit", ImplicitVRLittleEndian), ("big", ExplicitVRBigEndian)):
    for undefined in False, True:
        d = base("x", data, syntax=syntax); d.NumberOfFrames = 5
        shared = Dataset(); shared.PlaneOrientationSequence = item(ImageOrientationPatient=[1, 0, 0, 0, 1, 0]); shared.PixelMeasuresSequence = item(PixelSpacing=[2, 1], SliceThickness=4)
        d.SharedFunctionalGroupsSequence = Sequence([shared])
        groups = []
        for i in range(5):
            f = Dataset(); f.PlanePositionSequence = item(ImagePositionPatient=[1, 2, float(10 + 4 * i)]); f.FrameContentSequence = item(StackID="1", InStackPositionNumber=i + 1, DimensionIndexValues=[1, i + 1]); groups.append(f)
        d.PerFrameFunctionalGroupsSequence = Sequence(groups)
        d.DimensionIndexSequence = item(DimensionIndexPointer=0x00209056)
        if undefined:
            for e in d.iterall():
                if e.VR == "SQ":
                    e.is_undefined_length = True
                    for i in e.value: i.is_undefined_length_sequence_item = True
        d.save_as("x"); sources[f"{name}{undefined}"] = open("x", "rb").read()
d = base("x", data[0]); d.compress(RLELossless); d.save_as("x"); sources["rle"] = open("x", "rb").read()
import base64
d = base("x", (numpy.arange(30).reshape(5, 6) * 50 - 700).astype("i2"), bits=12, syntax=pydicom.uid.JPEGLSLossless)
d.PixelData = pydicom.encaps.encapsulate([base64.b64decode("/9j/6AAgU1BJRkYAAgAAAQAAAAUAAAAGChAGAQAAASwAAAEs/+gACAAAAAH/2P/3AAsQAAUABgEBEQD/+AANAf//ABIAQwEUAED/2gAIAQEAAAAAAaHjHGGX5dreWIyRimCXoyZWrgAAAADSwAgCAAC1cAMsRci1GLK0WIrSpKUwAP/Z")]); d["PixelData"].is_undefined_length = True; d["PixelData"].VR = "OB"
d.save_as("x"); sources["jls"] = open("x", "rb").read()
os.makedirs("disc/ct"); slices("disc/ct", data, numpy.arange(5))
records = []
for k in range(5):
    r = Dataset(); r.OffsetOfTheNextDirectoryRecord, r.RecordInUseFlag, r.OffsetOfReferencedLowerLevelDirectoryEntity = 0, 0xffff, 0
    r.DirectoryRecordType, r.ReferencedFileID = "IMAGE", ["CT", f"{k}"]; records.append(r)
d = base("x", data[0])
for name in ("Rows", "Columns", "PixelData", "SamplesPerPixel", "BitsAllocated", "BitsStored", "HighBit", "PixelRepresentation", "PhotometricInterpretation"): delattr(d, name)
d.file_meta.MediaStorageSOPClassUID = "1.2.840.10008.1.3.10"; d.DirectoryRecordSequence = Sequence(records); d.save_as("x"); sources["DICOMDIR"] = open("x", "rb").read()
def damaged(good, rng):
    b = bytearray(good); head = min(len(b), 132 + 3000)
    for _ in range(rng.randint(1, 4)):
        at, how = rng.randrange(132, head), rng.randrange(7)
        if how == 0: b[at % len(b)] ^= 1 << rng.randrange(8)
        elif how == 1: b[at:at + 4] = rng.choice([b"\xff" * 4, b"\0" * 4, b"\xfe\xff\x00\xe0", b"\xfe\xff\x0d\xe0", b"\xfe\xff\xdd\xe0", b"\xff\xff\xff\x7f", b"\xfe\xff\xff\xff"])
        elif how == 2: b = b[:rng.randrange(100, len(b))] or b
        elif how == 3: del b[at:at + rng.randint(1, 9)]
        elif how == 4: b[at:at] = b[at:at + rng.randint(1, 40)]
        elif how == 5: # a length or type of an element: behind its tag
            places = [m.start() for m in re.finditer(rb"[\x08\x10\x18\x20\x28\x04\x52]\0.[\0-\x94][A-Z][A-Z]", bytes(b[:head]), re.S)] or [at]
            p = rng.choice(places) + rng.choice((4, 6, 8)); b[p:p + 2] = rng.choice([b"SQ", b"UN", b"OB", b"\xff\xff", b"\0\0", b"\x01\0", b"AT"])
        else: b[at % len(b)] = rng.randrange(256)
        head = min(len(b), head)
        if head <= 140: break
    return bytes(b)
def trial(job):
    name, i = job
    rng = random.Random(f"{name} {i}")
    folder = f"t/{name}{i}"; os.makedirs(folder)
    file = f"{folder}/{'DICOMDIR' if name == 'DICOMDIR' else 'a.dcm'}"
    if name == "DICOMDIR": os.symlink(os.path.abspath("disc/ct"), f"{folder}/CT")
    open(file, "wb").write(damaged(sources[name], rng))
    run = subprocess.run(["vkt", "stats", file], capture_output=True, timeout=60)
    lines = [l for l in run.stderr.decode().split("\n") if l]
    assert run.returncode in (0, 2, 3, 4) and len(lines) <= (run.returncode != 0) + 1, (name, i, run.returncode, run.stderr)
    assert run.returncode == 0 or (lines and file.encode() in run.stderr), (name, i, run.returncode, run.stderr)
    shutil.rmtree(folder)
    return run.returncode
with ThreadPoolExecutor(2) as pool: codes = list(pool.map(trial, [(name, i) for name in sources for i in range(40)]))
assert codes.count(3) > 50 and len(codes) == 360, {c: codes.count(c) for c in codes}
END
}

@test "folders of folders, and slices named one by one: the hint says what to name" {
    /usr/bin/python3 - <<'END'
from common import *
slices("disc/patient/two words", numpy.zeros((3, 4, 5), "u2"), range(3))
END
    fails_with 4 "hint: DICOM files lie in a folder within: 'disc/patient/two words'" vkt info disc
    fails_with 2 "hint: slices make one volume: name their folder, or order them with vkt stack" vkt convert 'disc/patient/two words/*' -o o.nrrd
}

@test "of a folder the headers are read and the pixels that are asked for" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers need all of the address space and no tracer"
    command -v strace >/dev/null || skip "strace is not installed"
    /usr/bin/python3 - <<'END'
from common import *
import re
data = numpy.random.default_rng(3).integers(0, 4096, (96, 256, 256)).astype("u2")
slices("many", data, range(96))
def bytes_read(*command):
    subprocess.run(["strace", "-f", "-y", "-qq", "-e", "trace=read,pread64,preadv,readv", "-o", "trace", *command], check=True,
                   stdout=subprocess.DEVNULL)
    return sum(int(n) for n in re.findall(r"/many/.* = (\d+)$", open("trace").read(), re.M))
headers = 96 * 8192 + 65536
assert 0 < bytes_read("vkt", "info", "many") <= headers
got = bytes_read("vkt", "read", "many", "--roi", ":,:,50", "-o", "part.raw")
assert open("part.raw", "rb").read() == data[50].tobytes() and got <= headers + data[50].nbytes, got
# Elements beyond the beginning: large ones among those of the header, and pixels behind them.
for k in range(3):
    d = pydicom.dcmread(f"many/{k}")
    d.add_new((0x0009, 0x0010), "LO", "VKT TEST")
    d.add_new((0x0009, 0x1001), "OB", bytes(range(250)) * 400)
    d.add_new((0x0009, 0x1002), "UN", b"ab" * 5000)
    d.save_as(f"many/{k}")
assert (voxels("many").reshape(data.shape) == data).all()
END
}
