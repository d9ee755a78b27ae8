# Analyze 7.5 pairs: voxels and places equal to nibabel's.
load helper

setup_more() { python_with numpy nibabel; }

@test "types, byte orders, slopes, SPM's origin, series: as nibabel reads them" {
    /usr/bin/python3 - <<'END'
import json, subprocess, warnings
import numpy as np, nibabel as nib
warnings.simplefilter("ignore")
rng = np.random.default_rng(4)
def run(line): return subprocess.run(line, shell=True, check=True, capture_output=True).stdout
n = 0
for cls in (nib.AnalyzeImage, nib.Spm99AnalyzeImage, nib.Spm2AnalyzeImage):
    for code in ("u1", "i2", "i4", "f4", "f8"):
        for order in "<>":
            for shape in ((5, 4, 3), (5, 4, 3, 2)):
                data = (rng.normal(size=shape) * 50 + 60).astype(code)
                header = cls.header_class(endianness=order)
                header.set_data_dtype(np.dtype(code).newbyteorder(order)); header.set_data_shape(shape)
                header.set_zooms((2, 3, 4, 1)[:len(shape)])
                name = f"v{n}"; n += 1
                if cls is not nib.AnalyzeImage and n % 3: header["origin"] = (2, 1, 3, 0, 0)
                if cls is not nib.AnalyzeImage and n % 2: header["scl_slope"] = 0.5
                block = header.binaryblock
                open(name + ".hdr", "wb").write(block)
                open(name + ".img", "wb").write(data.astype(np.dtype(code).newbyteorder(order)).tobytes("F"))
                judge = cls.load(name + ".img")
                for file in (name + ".hdr", name + ".img"):
                    infos = json.loads(run(f"vkt info {file} --json"))
                    infos = infos if isinstance(infos, list) else [infos]
                    assert len(infos) == (shape[3] if len(shape) > 3 else 1), (file, len(infos))
                    i = infos[0]
                    assert i["dtype"] == np.dtype(code).name and i["dims"] == list(shape[:3]), i
                    affine = np.eye(4)
                    for a in range(3): affine[:3, a] = np.array(i["direction"][a]) * i["spacing"][a]
                    affine[:3, 3] = i["origin"]
                    assert np.allclose(affine, judge.affine), (cls, affine, judge.affine)
                    assert "assumed" in i["attributes"]["orientation"] and i["attributes"]["space"] == "right-anterior-superior"
                    raw = run(f"vkt write {file} - --format raw")
                    assert raw == data.tobytes("F"), file
                    values = np.frombuffer(raw, code).astype(float) * i["slope"] + i["intercept"]
                    assert np.allclose(values, judge.get_fdata().ravel("F")), (cls, i["slope"])
END
    gzip v0.img
    vkt stats v0.hdr >/dev/null
    vkt read v1.hdr -o v1.nii
    /usr/bin/python3 -c "
import nibabel as nib, numpy as np
a = nib.AnalyzeImage.load('v1.img'); b = nib.load('v1.nii')
assert np.allclose(a.affine, b.affine) and np.allclose(a.get_fdata(), b.get_fdata())"
}

@test "damage is told" {
    /usr/bin/python3 -c "
import nibabel as nib, numpy as np
nib.AnalyzeImage(np.arange(60, dtype='i2').reshape(5, 4, 3), np.eye(4)).to_filename('a.img')
h = bytearray(open('a.hdr', 'rb').read())
def bad(name, at, *values):
    b = bytearray(h); b[at:at + len(values)] = bytes(values); open(name + '.hdr', 'wb').write(b); open(name + '.img', 'wb').write(open('a.img', 'rb').read())
bad('bits', 70, 1, 0, 1, 0)
bad('negative', 42, 255, 255)
bad('offset', 108, 0, 0, 192, 127)
bad('far', 108, 0, 0, 128, 74)
bad('five', 40, 5, 0, 5, 0, 4, 0, 3, 0, 1, 0, 2, 0)
open('short.hdr', 'wb').write(h[:200])
open('alone.hdr', 'wb').write(h)"
    vkt stats a.hdr >/dev/null
    fails_with 3 'bits, complex numbers or colours' vkt info bits.hdr
    fails_with 3 'more than four' vkt info five.hdr
    for name in negative offset far short; do fails_with 3 "'$name." vkt stats $name.hdr; done
    fails_with 4 'alone.img' vkt stats alone.hdr
    fails_with 3 'a pair' eval 'cat a.hdr | vkt stats -'
}

@test "pairs that vkt writes are what nibabel reads; what is lost is said" {
    for type in uint8 int16 int32 float32 float64; do
        vkt make noise --dims 9 8 6 --dtype $type --seed 2 | vkt set --spacing 2,3,4 --origin 4,-3,-8 \
            --direction -1,0,0,0,1,0,0,0,1 --attribute space=right-anterior-superior --slope 0.5 --intercept -3 -o $type.vkt
        vkt write $type.vkt $type.hdr --format analyze 2>err
        [ ! -s err ]
        vkt write $type.vkt $type.raw
    done
    /usr/bin/python3 - <<'END'
import warnings, numpy as np, nibabel as nib
warnings.simplefilter("ignore")
for name in "uint8 int16 int32 float32 float64".split():
    judge = nib.Spm99AnalyzeImage.load(name + ".img")
    assert judge.get_data_dtype() == np.dtype(name)
    want = np.fromfile(name + ".raw", name).reshape((9, 8, 6), order="F")
    assert np.allclose(judge.dataobj.get_unscaled(), want), name
    assert judge.dataobj.slope == 0.5
    affine = np.diag((-2.0, 3, 4, 1)); affine[:3, 3] = 4, -3, -8
    assert np.allclose(judge.affine, affine), judge.affine
END
    vkt diff int16.vkt int16.hdr
    vkt set int16.vkt --origin 4.5,-3,-8 --direction 1,0,0,0,1,0,0,0,1 --units HU -o t.vkt
    vkt write t.vkt t.hdr --format analyze 2>err
    grep -q 'do not hold units' err
    fails_with 2 'cannot hold uint64' eval 'vkt make noise --dims 4 4 4 --dtype uint64 | vkt write u.hdr --format analyze'
    fails_with 4 'exists' vkt write int16.vkt int16.hdr --format analyze
}

@test "SPM's matrix beside a pair gives its place: mat before M, versions and compression of MATLAB's files, as nibabel reads it" {
    python_with nibabel scipy
    /usr/bin/python3 - <<'END'
import json, subprocess, warnings, numpy as np, nibabel, scipy.io as sio
from nibabel.spm99analyze import Spm99AnalyzeImage
rng = np.random.default_rng(6)
warnings.simplefilter("ignore")
def place(name):
    info = json.loads(subprocess.check_output(["vkt", "info", name, "--json"]))
    info = info[0] if isinstance(info, list) else info
    m = np.eye(4)
    for a in range(3): m[:3, a] = np.array(info["direction"][a]) * info["spacing"][a]
    m[:3, 3] = info["origin"]
    return m, info
def turned():
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    m = np.eye(4); m[:3, :3] = q @ np.diag([2, 3, 1.5]); m[:3, 3] = rng.normal(size=3) * 20
    return m
data = rng.integers(-99, 99, (5, 4, 3)).astype("i2")
n = 0
def check(name, sided):
    want = Spm99AnalyzeImage.load(name + ".img").affine
    for file in (name + ".hdr", name + ".img"):
        got, info = place(file)
        assert np.allclose(got, want, rtol=1e-12, atol=1e-9), (file, got, want)
        assert ("orientation" in info["attributes"]) != sided and not info.get("not_read"), info
nibabel.save(Spm99AnalyzeImage(data, turned()), "saved.img"); check("saved", True)
for big in (False, True):
    for names in (("M",), ("mat",), ("M", "mat"), ("mat", "note", "M")):
        for version, packed in (("4", False), ("5", False), ("5", True)):
            name = f"p{n}"; n += 1
            nibabel.save(Spm99AnalyzeImage(data, np.diag([-2, 2, 2, 1])), name + ".img")
            matrices = {k: "words" if k == "note" else turned() for k in names}
            sio.savemat(name + ".mat", matrices, format=version, do_compression=packed)
            if big and version == "4": # the order of bytes of a SPARC
                out = b""
                for k, v in matrices.items():
                    if k == "note": continue
                    out += np.array([1000, 4, 4, 0, len(k) + 1], ">i4").tobytes() + k.encode() + b"\0" + v.T.astype(">f8").tobytes()
                open(name + ".mat", "wb").write(out)
            check(name, "mat" in names)
# Whole numbers in fewer bytes, single precision, one matrix for each volume.
whole = np.array([[0, -2, 0, 30], [3, 0, 0, -50], [0, 0, 4, -70], [0, 0, 0, 1.]])
for name, m in (("whole", whole.astype("i2")), ("single", turned().astype("f4"))):
    nibabel.save(Spm99AnalyzeImage(data, np.diag([-2, 2, 2, 1])), name + ".img")
    sio.savemat(name + ".mat", {"M": m}, format="4"); check(name, False)
four = np.stack([data, data + 1], -1)
nibabel.save(Spm99AnalyzeImage(four, np.diag([-2, 2, 2, 1])), "four.img")
sio.savemat("four.mat", {"mat": np.stack([whole, whole], -1)}); check("four", True)
sio.savemat("four.mat", {"mat": np.stack([whole, turned()], -1)})
assert np.allclose(place("four.hdr")[0], Spm99AnalyzeImage.load("four.img").affine)
# Damage ends in a place without it and never in a crash.
import random
random.seed(2)
good = [open(f"p{i}.mat", "rb").read() for i in (2, 1, 0)]
for i in range(150):
    bad = bytearray(good[i % 3])
    for _ in range(random.randint(1, 4)): bad[random.randrange(len(bad))] = random.randrange(256)
    if i % 4 == 0: bad = bad[:random.randrange(len(bad))]
    open("p0.mat", "wb").write(bad)
    run = subprocess.run(["vkt", "stats", "p0.hdr"], capture_output=True, timeout=120)
    assert run.returncode == 0, (i, run.stderr)
END
    vkt info four.hdr | grep "places of their own of all volumes but the first, in 'four.mat'"
    printf 'MATLAB 5.0 MAT-file' >whole.mat
    vkt info whole.hdr | grep "'whole.mat', which is no file of SPM's"
    mkdir within
    mv single.hdr single.img within
    ln -s ../single.mat within/single.mat
    vkt info within/single.hdr | grep "'single.mat', which leads out of its directory"
}

@test "a place that an Analyze header cannot hold is written as SPM's matrix, which replaces an older one" {
    python_with nibabel scipy
    vkt make noise --dims 6 5 4 --dtype int16 | vkt set --spacing 1.5,2,3 --origin 4,-5.25,6 --attribute 'space=left-posterior-superior' -o v.vkt
    vkt rotate v.vkt --axis z --angle 30 --expand | vkt set --direction 0.6,0.8,0,-0.8,0.6,0,0,0,1 -o w.vkt
    for name in v w; do
        vkt write $name.vkt $name.hdr --format analyze 2>err
        run ! grep -q 'place\|directions' err
        vkt diff $name.vkt $name.hdr --geometry | grep -q 'same_geometry *yes'
        vkt write $name.vkt $name.nii
    done
    /usr/bin/python3 - <<'END'
import nibabel, numpy as np
from nibabel.spm99analyze import Spm99AnalyzeImage
for name in "vw":
    a, b = Spm99AnalyzeImage.load(name + ".img"), nibabel.load(name + ".nii")
    assert np.allclose(a.affine, b.affine, atol=1e-5) and np.array_equal(a.get_fdata(), b.get_fdata()), name
END
    # A matrix that is there would misplace what the header alone tells.
    vkt make noise --dims 6 5 4 --dtype int16 | vkt set --spacing 2,2,2 --attribute 'space=right-anterior-superior' --direction -1,0,0,0,1,0,0,0,1 -o plain.vkt
    vkt write plain.vkt plain.hdr --format analyze
    [ ! -e plain.mat ]
    vkt write plain.vkt w.hdr --format analyze --force
    vkt diff plain.vkt w.hdr --geometry
    [ -e w.mat ]
    # What is no matrix of SPM's stays.
    echo mine >v.mat
    fails_with 4 "it is no file of SPM's" vkt write w.vkt v.hdr --format analyze --force
    vkt write plain.vkt v.hdr --format analyze --force
    [ "$(cat v.mat)" = mine ]
    rm v.hdr v.img
    cp w.mat v.mat
    fails_with 4 'the file exists' vkt write w.vkt v.hdr --format analyze
}
