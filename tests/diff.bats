# vkt diff: figures, tolerance, exit codes.
load helper

setup_more() {
    vkt make noise --dims 17 9 13 --seed 1 -o a.vkt
    vkt make noise --dims 17 9 13 --seed 2 -o b.vkt
}

@test "equal volumes" {
    vkt diff a.vkt a.vkt --json >d
    grep -q '"max_abs": 0' d
    grep -q '"same_geometry": true' d
    vkt diff a.vkt <a.vkt
}

@test "figures agree with numpy" {
    python_with numpy
    run -1 vkt diff a.vkt b.vkt --json
    echo "$output" >d
    for n in a b; do vkt read $n.vkt | vkt write $n.raw --format raw; done
    /usr/bin/python3 -c '
import numpy as np, json
a, b, d = np.fromfile("a.raw", "f4").astype(float), np.fromfile("b.raw", "f4").astype(float), json.load(open("d"))
e = abs(a - b); rmse = np.sqrt((e**2).mean()); i = int(np.nonzero(e)[0][0])
assert d["max_abs"] == e.max() and abs(d["rmse"] / rmse - 1) < 1e-12, d
assert abs(d["psnr"] - 20 * np.log10((a.max() - a.min()) / rmse)) < 1e-9 and d["differing"] == (e > 0).sum(), d
assert d["count"] == a.size and d["first"] == [i % 17, i // 17 % 9, i // 153], d'
}

@test "differences near the ends of double" {
    python_with numpy
    /usr/bin/python3 -c '
import numpy as np
rng = np.random.default_rng(5)
for e in (308, 200, 160, -160, -200, -300):
    for n in "ab": (rng.uniform(-1.7, 1.7, (4, 20, 30)) * 10.0 ** e).tofile(f"{n}{e}_30x20x4_float64.raw")'
    for e in 308 200 160 -160 -200 -300; do
        run -1 vkt diff a${e}_30x20x4_float64.raw b${e}_30x20x4_float64.raw --json
        echo "$output" >d$e
    done
    /usr/bin/python3 -c '
import numpy as np, json
for e in (308, 200, 160, -160, -200, -300):
    a, b = (np.fromfile(f"{n}{e}_30x20x4_float64.raw") / 10.0 ** e for n in "ab"); d = json.load(open(f"d{e}"))
    rmse = np.sqrt(((a - b) ** 2).mean())
    assert abs(d["rmse"] / 10.0 ** e / rmse - 1) < 1e-12, (e, d)
    assert abs(d["psnr"] - 20 * np.log10((a.max() - a.min()) / rmse)) < 1e-9, (e, d)
    if e != 308: assert d["max_abs"] / 10.0 ** e - abs(a - b).max() < 1e-12, (e, d)
    assert d["differing"] == a.size'
}

@test "tolerance decides the exit code" {
    vkt arith add a.vkt 0.25 -o c.vkt
    run -1 vkt diff a.vkt c.vkt
    run -1 vkt diff a.vkt c.vkt --tolerance 0.2
    vkt diff a.vkt c.vkt --tolerance 0.2501
    fails_with 2 "negative" vkt diff a.vkt c.vkt --tolerance -1
}

@test "types may differ, sizes may not, geometry is reported" {
    vkt make ramp --dims 9 8 7 -o r.vkt
    vkt convert r.vkt --dtype uint8 | vkt diff r.vkt
    run -1 vkt diff a.vkt r.vkt --json
    [[ "$output" == *'"same_dims": false'* && "$output" == *'"max_abs": null'* ]]
    vkt set r.vkt --spacing 2 | vkt diff r.vkt --json | grep -q '"same_geometry": false'
    run -1 vkt diff --geometry r.vkt <(vkt set r.vkt --spacing 2)
}

@test "NaN equals NaN, and 64-bit integers differ by one" {
    python_with numpy
    /usr/bin/python3 -c '
import numpy as np
v = np.ones(24, "f4"); v[5] = np.nan; v.tofile("n_4x3x2_float32.raw"); v[6] = np.nan; v.tofile("m_4x3x2_float32.raw")
w = np.full(24, 2**62, "i8"); w.tofile("i_4x3x2_int64.raw"); w[23] += 1; w.tofile("j_4x3x2_int64.raw")'
    vkt diff n_4x3x2_float32.raw n_4x3x2_float32.raw
    run -1 vkt diff n_4x3x2_float32.raw m_4x3x2_float32.raw --json
    [[ "$output" == *'"differing": 1,'* ]]
    run -1 vkt diff i_4x3x2_int64.raw j_4x3x2_int64.raw --json
    [[ "$output" == *'"max_abs": 1,'* && "$output" == *'"first": [3, 2, 1]'* ]]
}

@test "64-bit integers against other types, exactly" {
    python_with numpy
    /usr/bin/python3 -c '
import numpy as np
w = np.full(8, 2**53 + 1, "i8"); w.tofile("i_2x2x2_int64.raw"); w.astype("u8").tofile("u_2x2x2_uint64.raw")
w.astype("f8").tofile("f_2x2x2_float64.raw")
v = np.array([0, -3, 2**62, 5, 6, 7, 8, 9]); v.tofile("k_2x2x2_int64.raw")
x = v.astype("f8"); x[:6] = [.25, -3, 2.**70, np.inf, np.nan, 7.5]; x.tofile("x_2x2x2_float64.raw")'
    vkt diff i_2x2x2_int64.raw u_2x2x2_uint64.raw
    for pair in "i_2x2x2_int64 f_2x2x2_float64" "f_2x2x2_float64 i_2x2x2_int64" "f_2x2x2_float64 u_2x2x2_uint64"; do
        run -1 vkt diff ${pair% *}.raw ${pair#* }.raw --json
        [[ "$output" == *'"max_abs": 1,'* && "$output" == *'"differing": 8,'* ]]
    done
    run -1 vkt diff k_2x2x2_int64.raw x_2x2x2_float64.raw --json
    [[ "$output" == *'"differing": 5,'* ]]
    run -1 vkt diff <(vkt set k_2x2x2_int64.raw --slope -2) <(vkt set x_2x2x2_float64.raw --slope -2) --json
    [[ "$output" == *'"differing": 5,'* ]]
}

@test "a truncated input is an error, not a difference" {
    vkt make noise --dims 40 40 40 | head -c 100000 >cut.vkt
    run vkt diff cut.vkt cut.vkt
    [ "$status" -eq 3 ]
}

@test "equal volumes have an infinite signal-to-noise ratio, constant ones too" {
    vkt make constant --value 3 --dims 4 3 2 -o constant.nrrd
    vkt diff constant.nrrd constant.nrrd | grep -Eq '^psnr +inf$'
    vkt make ramp --dims 4 3 2 -o ramp.nrrd
    vkt diff ramp.nrrd ramp.nrrd | grep -Eq '^psnr +inf$'
    vkt diff ramp.nrrd ramp.nrrd --json | grep -q '"psnr": null' # JSON has no infinity
}

@test "geometry is compared in one frame, as ITK has it" {
    vkt set a.vkt --origin 1,2,3 --spacing 0.5,1,2 --direction 0,1,0,1,0,0,0,0,-1 --attribute space=left-posterior-superior -o lps.nrrd
    # The same numbers in another frame are another place.
    vkt set lps.nrrd --attribute space=right-anterior-superior -o ras.nrrd
    run -1 vkt diff --geometry lps.nrrd ras.nrrd --json
    [[ "$output" == *'"max_abs": 0,'* && "$output" == *'"same_geometry": false'* ]]
    # The same place in other numbers.
    for brief in RAS right-anterior-superior-time; do
        vkt set lps.nrrd --origin=-1,-2,3 --direction=0,-1,0,-1,0,0,0,0,-1 --attribute space=$brief -o same.nrrd --force
        vkt diff --geometry lps.nrrd same.nrrd
    done
    vkt set lps.nrrd --origin 1,-2,3 --direction 0,-1,0,1,0,0,0,0,-1 --attribute space=LAS | vkt diff --geometry lps.nrrd
    # MetaImage turns into LPS what lies elsewhere.
    vkt write ras.nrrd ras.mha
    vkt diff --geometry ras.nrrd ras.mha
    run -1 vkt diff --geometry lps.nrrd ras.mha
    # Known and unknown cannot be compared.
    vkt set lps.nrrd --attribute space= -o unknown.nrrd
    run -1 vkt diff --geometry lps.nrrd unknown.nrrd
    vkt diff lps.nrrd unknown.nrrd
    vkt diff --geometry unknown.nrrd unknown.nrrd
    python_with SimpleITK
    /usr/bin/python3 - <<'END'
import SimpleITK
def place(name):
    image = SimpleITK.ReadImage(name)
    return image.GetOrigin() + image.GetSpacing() + image.GetDirection()
near = lambda a, b: max(abs(x - y) for x, y in zip(place(a), place(b))) < 1e-12
assert near("lps.nrrd", "same.nrrd") and near("ras.nrrd", "ras.mha") and not near("lps.nrrd", "ras.nrrd")
END
}

@test "a short frame name is turned in MetaImage, too" {
    vkt set a.vkt --origin 1,2,3 --attribute space=RAS -o short.nrrd
    vkt write short.nrrd short.mha
    grep -a '^Offset = -1 -2 3$' short.mha
    vkt diff --geometry short.nrrd short.mha
}

# Structural similarity and mutual information by SciPy and NumPy, as scikit-image defines them.
similarity_volumes() {
    python_with numpy scipy
    cat >similar.py <<'END'
import json, subprocess, sys
import numpy as np
from scipy.ndimage import gaussian_filter
def save(v, name):
    z, y, x = v.shape
    v.tofile(f"{name}_{x}x{y}x{z}_{v.dtype}.raw")
    return f"{name}_{x}x{y}x{z}_{v.dtype}.raw"
def diff(*words, code=(0, 1)):
    r = subprocess.run(["vkt", "diff", *words, "--json"], capture_output=True, text=True)
    assert r.returncode in code, r.stderr
    return json.loads(r.stdout)
def ssim(a, b, L):
    a, b = a.astype(np.longdouble), b.astype(np.longdouble)
    m = a.flat[0]  # covariances need no offset
    sigma = [1.5 if n > 1 else 0 for n in a.shape]
    f = lambda v: gaussian_filter(v.astype(float), sigma, truncate=3.5, mode="reflect")
    ux, uy, xx, yy, xy = f(a - m), f(b - m), f((a - m) ** 2), f((b - m) ** 2), f((a - m) * (b - m))
    vx, vy, vxy = xx - ux * ux, yy - uy * uy, xy - ux * uy
    ux, uy = ux + float(m), uy + float(m)
    C1, C2 = (.01 * L) ** 2, (.03 * L) ** 2
    s = ((2 * ux * uy + C1) * (2 * vxy + C2)) / ((ux ** 2 + uy ** 2 + C1) * (vx + vy + C2))
    return s[tuple(slice(5, -5) if n > 10 else slice(None) for n in s.shape)].mean()
def information(a, b, bins):
    h, _, _ = np.histogram2d(a.ravel().astype(float), b.ravel().astype(float), bins)
    e = lambda p: -(p[p > 0] / p.sum() * np.log(p[p > 0] / p.sum())).sum()
    x, y, xy = e(h.sum(1)), e(h.sum(0)), e(h)
    return x + y - xy, (x + y) / xy
END
}

@test "SSIM and mutual information are those of SciPy and NumPy" {
    similarity_volumes
    /usr/bin/python3 - <<'END'
from similar import *
r = np.random.default_rng(5)
for t in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    for dims in (23, 29, 31), (70, 13, 71), (11, 11, 11), (1, 40, 30), (7, 19, 1), (1, 1, 1):
        if t not in ("uint8", "float32") and dims != (23, 29, 31): continue
        a = gaussian_filter(r.normal(50, 30, dims), 1)
        a = (a + (1e6 if t == "float64" else 0)).astype(t)
        b = (a.astype(float) + r.normal(0, 3, dims)).astype(t)
        x, y = save(a, "a"), save(b, "b")
        L = float(a.max()) - float(a.min())
        d = diff(x, y, "--ssim", "--mutual-information")
        if L > 0:
            assert d["ssim_range"] == L and abs(d["ssim"] - ssim(a, b, L)) < 2e-9, (t, dims, d["ssim"], ssim(a, b, L))
            mi, nmi = information(a, b, 64)
            assert abs(d["mutual_information"] - mi) < 1e-12 and abs(d["normalized_mutual_information"] - nmi) < 1e-12, (t, dims)
        d = diff(x, y, "--ssim", "--ssim-range", "255", "--mutual-information", "--bins", "7")
        assert abs(d["ssim"] - ssim(a, b, 255)) < 2e-9 and abs(d["mutual_information"] - information(a, b, 7)[0]) < 1e-12
END
}

@test "SSIM and mutual information are the same for any threads, memory and transport, and 1 and 2 for equal volumes" {
    similarity_volumes
    /usr/bin/python3 - <<'END'
from similar import *
r = np.random.default_rng(6)
a = gaussian_filter(r.normal(0, 1, (45, 67, 130)), 1).astype("f4"); b = (a + .1 * r.normal(0, 1, a.shape)).astype("f4")
x, y = save(a, "a"), save(b, "b")
more = ["--ssim", "--mutual-information"]
want = diff(x, y, *more)
for options in ["--threads", "1"], ["--threads", "5"], ["--threads", "1", "--memory", "1M"]:
    assert diff(x, y, *more, *options) == want, options
for memory in "1M", "1G":
    for transport in "pipe", "shm":
        piped = subprocess.run(f"vkt read {y} --transport {transport} | vkt diff {x} - --ssim --mutual-information --json --memory {memory} -q",
                               shell=True, capture_output=True, text=True)
        assert json.loads(piped.stdout) == want, piped.stderr
same = diff(x, x, *more, code=[0])
assert same["ssim"] == 1 and abs(same["normalized_mutual_information"] - 2) < 1e-12
c = save(np.full_like(a, 3), "c")
assert diff(c, c, *more)["ssim"] == 1 and diff(c, x, *more)["mutual_information"] == 0
# Of a constant volume there is no range: differences take its place, so that constants are alike as far as they are.
e = save(np.full_like(a, 5), "e")
d = diff(c, e, "--ssim")
assert d["ssim_range"] == 2 and abs(d["ssim"] - (2 * 3 * 5 + 0.02**2) / (9 + 25 + 0.02**2)) < 1e-12, d
d, far = diff(c, x, "--ssim"), np.abs(a.astype(float) - 3).max()
assert d["ssim_range"] == far and abs(d["ssim"] - ssim(np.full(a.shape, 3.0), a.astype(float), far)) < 1e-9, d
a[3, 4, 5] = np.nan
n = save(a, "n")
d = diff(n, y, *more)
assert d["ssim"] is None and d["mutual_information"] > 0
# Physical values.
subprocess.run(["vkt", "set", x, "--slope", "-3", "--intercept", "7", "-o", "s.nrrd"], check=True)
subprocess.run(["vkt", "set", y, "--slope", "-3", "--intercept", "7", "-o", "t.nrrd"], check=True)
a = gaussian_filter(np.random.default_rng(6).normal(0, 1, (45, 67, 130)), 1).astype("f4").astype(float) * -3 + 7
b = b.astype(float) * -3 + 7
assert abs(diff("s.nrrd", "t.nrrd", "--ssim")["ssim"] - ssim(a, b, a.max() - a.min())) < 1e-9
END
    fails_with 2 "is for --ssim" vkt diff a.vkt a.vkt --ssim-range 3
    fails_with 2 "is not a positive number" vkt diff a.vkt a.vkt --ssim --ssim-range 0
    fails_with 2 "is not between 2 and 1024" vkt diff a.vkt a.vkt --mutual-information --bins 1
    fails_with 2 "is for --mutual-information" vkt diff a.vkt a.vkt --bins 10
    vkt make ramp --dims 4 4 4 -o small.vkt
    run -1 vkt diff a.vkt small.vkt --ssim --json
    [[ "$output" == *'"ssim": null'* ]]
}

@test "trees are compared cell by cell, if they are the same" {
    vkt make amr --blocks 40 --levels 3 -o t.vkt
    vkt diff t.vkt t.vkt --json >d
    vkt info t.vkt --json >i
    vkt arith add t.vkt 0.5 | vkt diff t.vkt --tolerance 0.6
    vkt arith add t.vkt 0.5 -o half.vkt
    run -1 vkt diff t.vkt half.vkt --json
    echo "$output" >e
    # One cell is another: its corner is told, and what it is off by.
    vkt fill t.vkt --roi 5:6,7:8,9:10 --value 1e6 -o other.vkt
    run -1 vkt diff t.vkt other.vkt --json
    [[ "$output" == *'"differing": 1'*'"first": [5, 7, 9]'* ]]
    python3 -c '
import json
d, e, i = (json.load(open(n)) for n in "dei")
assert d["max_abs"] == 0 and d["differing"] == 0 and d["same_tree"], d
assert d["count"] == i["cells"], (d, i)
assert abs(e["max_abs"] - 0.5) < 1e-6 and abs(e["rmse"] - 0.5) < 1e-6 and e["differing"] == d["count"], e'
    # Threads change nothing.
    cmp <(vkt arith mul t.vkt 1.7 | vkt diff t.vkt --json --threads 1) <(vkt arith mul t.vkt 1.7 | vkt diff t.vkt --json --threads 4)
    vkt make amr --blocks 80 --levels 3 -o u.vkt
    run -1 --separate-stderr vkt diff t.vkt u.vkt --json
    [[ "$output" == *'"max_abs": null'* ]]
    vkt resample t.vkt --cells 10k -o g.vkt
    fails_with 2 "one of the volumes is hierarchical and one is not" vkt diff t.vkt g.vkt
    fails_with 2 "--ssim compares grids" vkt diff t.vkt t.vkt --ssim
}

@test "of a region of trees the cells that reach into it are compared, and no others of their bricks" {
    vkt make noise --dims 40 30 20 | vkt refine --tolerance 0 -o whole.vkt 2>/dev/null
    vkt fill whole.vkt --roi 20:23,12:14,9:10 --value 7 -o other.vkt
    number() { vkt diff "$@" --json >out.json || true; jq -c "[.count, .differing, .first]" out.json; }
    [ "$(number whole.vkt other.vkt)" = '[24000,6,[20,12,9]]' ]
    [ "$(number whole.vkt other.vkt --roi 22:30,13:20,5:12)" = '[392,1,[22,13,9]]' ]
    vkt diff whole.vkt other.vkt --roi 23:30,13:20,5:12
    vkt diff whole.vkt other.vkt --roi 16:24,8:16,10:16
    # What a crop has cut off is no part of it, though bricks are kept whole.
    vkt diff <(vkt crop whole.vkt --roi 3:20,:,:) <(vkt crop other.vkt --roi 3:20,:,:) --json >out.json
    [ "$(jq .count out.json)" = 10200 ]
    # A coarse cell whose centre is elsewhere counts.
    vkt make constant --dims 32 32 32 | vkt refine --tolerance 0 --block-size 2 -o flat.vkt
    vkt arith add flat.vkt 1 -o one.vkt
    [ "$(number flat.vkt one.vkt --roi 0:1,0:1,0:1)" = '[1,1,[0,0,0]]' ]
}
