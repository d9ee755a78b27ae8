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
