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
    grep -q 'do not hold the place, the directions, units' err
    fails_with 2 'cannot hold uint64' eval 'vkt make noise --dims 4 4 4 --dtype uint64 | vkt write u.hdr --format analyze'
    fails_with 4 'exists' vkt write int16.vkt int16.hdr --format analyze
}

@test "SPM's matrix beside a pair is not read, and info says so" {
    vkt make noise --dims 5 4 3 --dtype int16 -o v.vkt
    vkt set v.vkt --attribute 'space=right-anterior-superior' | vkt write - p.hdr --format analyze
    run ! grep -q "p.mat" <(vkt info p.hdr)
    printf 'MATLAB 5.0 MAT-file' >p.mat
    vkt info p.hdr | grep "the place and direction in SPM's 'p.mat'"
}
