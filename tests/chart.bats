# vkt chart: knobs varied, errors that a calculation of SciPy's confirms, bounds that hold, files and exit codes.
load helper

setup_more() {
    cp "$VKT_ROOT/examples/data/phantom.nrrd" .
    vkt make noise --seed 1 --dims 24 22 20 --dtype float32 -o noise.nrrd
}

@test "every tolerance of a Gaussian is tried, and each keeps its bound" {
    vkt chart 'filter gaussian --sigma 2' noise.nrrd --budget 0.5 --threads 1 --check --json >chart.json
    /usr/bin/python3 - <<'END'
import json
chart = json.load(open("chart.json"))
points = chart["points"]
assert chart["exceeded"] == 0
# As given, and six tolerances; the default one is among them, and a cascade is only cheaper beyond.
assert len({p["pipeline"].split("--tolerance ")[-1] for p in points}) == 6, points
assert sum(p["given"] for p in points) == 1
for p in points:
    assert p["bound"] >= p["own_error"] > 0, p
    assert p["max_error"] >= p["rms_error"] > 0 and p["seconds"] > 0 and p["repeats"] >= 3, p
errors = {p["pipeline"].split("--tolerance ")[-1]: p["max_error"] for p in points if "--tol" in p["pipeline"]}
assert errors["10%"] > errors["1%"] > errors["0.1%"] > errors["0.001%"] > errors["1e-04%"]
assert "--tolerance 1e-10%" in chart["reference"]
# The front: faster ones are less exact, and nothing is both faster and more exact.
front = [p for p in points if p["front"]]
assert front
assert min(points, key=lambda p: p["max_error"])["max_error"] == min(p["max_error"] for p in front)
for a in front:
    assert not any(p["seconds"] < a["seconds"] and p["max_error"] < a["max_error"] for p in points)
END
}

@test "the reference of a Gaussian is what its definition says, for every boundary rule" {
    for boundary in mirror clamp wrap border:0.3; do
        vkt chart "filter gaussian --sigma 3,1,0 --boundary $boundary" noise.nrrd --keep threads,method --budget 0.1 --check --json >chart.json
        /usr/bin/python3 -c '
import json
chart = json.load(open("chart.json"))
assert chart["checked_voxels"] == 27 and 0 < chart["check_error"] < 2e-12 * chart["range"], chart["check_error"]'
    done
    vkt chart 'filter gaussian --sigma 1' noise.nrrd --keep threads --budget 0.1 | grep -q ', at 27 voxels within .* of sums by definition$'
}

@test "where a cascade is cheaper, it and direct convolution are both tried, and the reference is the other path" {
    vkt filter gaussian phantom.nrrd --sigma 6 -n -o x.vkt 2>&1 | grep -q 'method B-spline cascade'
    vkt chart 'filter gaussian --sigma 6' phantom.nrrd --roi :,:,24:72 --keep threads --check --json >chart.json
    /usr/bin/python3 - <<'END'
import json
chart = json.load(open("chart.json"))
assert "--method fir" in chart["reference"] and "float64 input" in chart["reference"]
direct = [p for p in chart["points"] if "--method fir" in p["pipeline"]]
cascades = [p for p in chart["points"] if p not in direct] # as given: one of these
assert any(p["given"] for p in cascades) and len(direct) > 2, (cascades, direct)
assert all(0 < p["own_error"] <= p["bound"] and p["predicted_seconds"] > 0 for p in cascades + direct)
END
}

@test "clipped voxels keep the bound like the others, and the table says that files are not in its seconds" {
    vkt stress --volume extremes-int16 >extremes.vkt
    vkt chart 'resample --scale 1.3 --method cubic' extremes.vkt --roi :,:,: --keep threads,method --check --json >chart.json
    /usr/bin/python3 - <<'END'
import json
points = json.load(open("chart.json"))["points"]
clipped = [p for p in points if p["clipped"] and p["bound"] is not None]
assert clipped and all(0 < p["own_error"] <= p["bound"] < 1 < p["max_error"] for p in clipped), points
END
    vkt chart 'filter gaussian --sigma 1' noise.nrrd --keep threads --budget 0.1 >table
    grep -q 'reading and writing files is not in them' table
}

# The volumes of vkt stress: what a bound says of data that suit it says little.
@test "no error is above its bound, whatever the operation and the volume" {
    for volume in noise-uint8 extremes-int16 checkerboard-float16 offset-float32 denormal-float32 mapped flat-z; do
        vkt stress --volume $volume >$volume.vkt
    done
    while read -r volume pipeline; do
        vkt chart "$pipeline" $volume.vkt --roi :,:,: --keep threads --check --json >chart.json 2>error ||
            { echo "$pipeline on $volume: $(cat error)" >&2; cat chart.json >&2; return 1; }
        /usr/bin/python3 -c '
import json
points = json.load(open("chart.json"))["points"]
assert any(p["bound"] is not None and not p["clipped"] for p in points), points'
    done <<'END'
offset-float32 filter gaussian --sigma 1.3
denormal-float32 filter gaussian --sigma 1.3
extremes-int16 filter gradient
offset-float32 filter sobel
extremes-int16 filter log --sigma 1
checkerboard-float16 filter laplacian
denormal-float32 affine 0.9,0.1,0,0,-0.1,0.9,0,0,0,0,1,0
mapped affine 0.9,0.1,0,0,-0.1,0.9,0,0,0,0,1,0
extremes-int16 resample --scale 1.5
flat-z resample --scale 0.6
offset-float32 rotate --angle 30
noise-uint8 arith mul - 2.5
noise-uint8 convert --dtype float32
mapped flip x | filter gaussian --sigma 1
END
}

# What is as large as its type can be has sums that are no numbers in it: nothing is promised there, and said so.
@test "of sums beyond their type no bound is told" {
    vkt stress --volume extremes-float32 | vkt chart 'filter sobel' --roi :,:,: --keep threads --check --csv >chart.csv
    [ "$(cut -d, -f7 chart.csv | sort -u | tr '\n' ' ')" = " bound " ]
}

@test "errors are those that SciPy finds" {
    python_with numpy scipy
    vkt chart 'filter gaussian --sigma 2 --boundary clamp' noise.nrrd --roi :,:,: --threads 1 --csv >chart.csv
    vkt convert noise.nrrd --dtype float64 -o - | vkt write - --format raw >noise.raw
    for tolerance in 10% 1% 0.1%; do
        vkt filter gaussian noise.nrrd --sigma 2 --boundary clamp --tolerance $tolerance | vkt write - --format raw >"$tolerance.raw"
    done
    /usr/bin/python3 - <<'END'
import csv, numpy as np
from scipy.ndimage import gaussian_filter
exact = gaussian_filter(np.fromfile("noise.raw", "f8").reshape(20, 22, 24), 2, mode="nearest", truncate=12)
rows = list(csv.DictReader(open("chart.csv")))
for tolerance in ("10%", "1%", "0.1%"):
    found = np.fromfile(tolerance + ".raw", "f4").reshape(exact.shape)
    row, = [r for r in rows if r["pipeline"].endswith("--tolerance " + tolerance)]
    worst, rms = np.abs(found - exact).max(), np.sqrt(np.mean((found - exact) ** 2))
    assert abs(float(row["max_error"]) - worst) < 1e-9, (tolerance, row, worst)
    assert abs(float(row["rms_error"]) - rms) < 1e-9, (tolerance, row, rms)
END
}

@test "methods and types of a resampling are varied, those that do not fit are left out" {
    vkt chart 'resample --scale 1.5' phantom.nrrd --budget 0.5 --keep threads --check --json >chart.json
    /usr/bin/python3 - <<'END'
import json
points = json.load(open("chart.json"))["points"]
text = "\n".join(p["pipeline"] for p in points)
for word in ("--method nearest", "--method linear", "--method bspline5", "--dtype float32", "--dtype float16"):
    assert word in text, word
best = [p for p in points if "bspline5" in p["pipeline"] and "float16" not in p["pipeline"]]
nearest = [p for p in points if "nearest" in p["pipeline"]]
assert max(p["max_error"] for p in best) < min(p["max_error"] for p in nearest)
END
}

@test "shorter steps make truer pictures, by as much as the pictures that vkt render writes" {
    python_with vtk numpy
    local look="--domain 0:200 --opacity 0,0.3 --shade none --no-skip --size 40x32"
    vkt chart "render $look" phantom.nrrd --keep threads,leave-out,exact --budget 1 --json >chart.json
    for step in 0.25 1 4; do
        # shellcheck disable=SC2086
        vkt render phantom.nrrd $look --step $step -o $step.png
    done
    vkt render phantom.nrrd --domain 0:200 --opacity 0,0.3 --size 40x32 --exact -o exact.png
    /usr/bin/python3 - <<'END'
import json, vtk, numpy as np
from vtk.util.numpy_support import vtk_to_numpy
def levels(name):
    reader = vtk.vtkPNGReader(); reader.SetFileName(name); reader.Update()
    return vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).astype(float)
chart = json.load(open("chart.json"))
points = {p["pipeline"].split("--step ")[-1].split()[0] if "--step" in p["pipeline"] else "0.5": p for p in chart["points"]}
assert sorted(points, key=float) == ["0.125", "0.25", "0.5", "1", "2", "4"], points
errors = [points[s]["max_error"] for s in sorted(points, key=float)]
assert errors == sorted(errors) and errors[0] < 1 < errors[-1], errors
assert chart["units"] == "display levels" and "--exact" in chart["reference"]
exact = levels("exact.png")
for step in ("0.25", "1", "4"):
    seen = np.abs(levels(step + ".png") - exact)
    # Files hold whole levels.
    assert abs(seen.max() - points[step]["max_error"]) <= 1.01, (step, seen.max(), points[step])
    assert points[step]["bound"] is None and points[step]["whole_seconds"] >= points[step]["seconds"]
END
}

@test "all pictures of an orbit are compared, and the largest error is told" {
    # A small ball behind a wall: the first camera does not see what long steps make of it.
    vkt make sphere --dims 32 32 32 --center 16,22,16 --radius 2 | vkt arith mul - 400 | vkt fill --value 900 --roi 4:28,6:9,4:28 -o hidden.nrrd
    local look="--domain 100:1000 --opacity 0,0.9 --shade none --no-skip --size 48 --view=-y --orbit 4"
    vkt chart "render $look --step 4" hidden.nrrd --keep threads,leave-out --budget 30 >chart
    grep -q '^measured on 4 pictures of 48x48' chart
    vkt chart "render $look --step 4" hidden.nrrd --keep threads,leave-out --budget 30 --json >chart.json
    # shellcheck disable=SC2086
    vkt render hidden.nrrd $look --step 4 -o long-%d.png
    # shellcheck disable=SC2086
    vkt render hidden.nrrd ${look/--shade none --no-skip/} --exact -o exact-%d.png
    for i in 0 1 2 3; do vkt image diff exact-$i.png long-$i.png --json >diff-$i || true; done
    /usr/bin/python3 - <<'END'
import json
levels = [json.load(open(f"diff-{i}"))["levels"] for i in range(4)]
given, = [p for p in json.load(open("chart.json"))["points"] if p["given"]]
assert max(levels) > levels[0] + 3, levels # or the first picture would do
assert abs(given["max_error"] - max(levels)) <= 1.01, (levels, given) # files hold whole levels
END
}

@test "pictures of a size that takes too long are measured smaller, after other stages, and made by the command" {
    vkt chart 'crop --roi :,:,20:60 | render --step 1 --size 1200x800' phantom.nrrd --keep threads,leave-out --budget 0.3 >chart
    grep -Eq '^measured on pictures of [0-9]+x[0-9]+, 1/[0-9.e+]+ of the pixels: all 6 settings' chart
    grep -q 'drawn with --step 0.03125; its values span [0-9.]* display levels' chart
    tail -1 chart | sed 's/-o OUT/-o out.png/' >again.sh
    sh again.sh
    head -c 24 out.png | tail -c 8 | cmp - <(printf '\0\0\004\260\0\0\003\040')
    fails_with 2 "nothing in the pipeline" vkt chart 'render --render-algo implicit-iso' phantom.nrrd --threads 1 --keep tolerance
    fails_with 2 "nothing comes after" vkt chart 'render | flip x' phantom.nrrd
    fails_with 2 "the report has one form" vkt chart 'filter gaussian --sigma 2' phantom.nrrd --csv --json
}

@test "rays that are left out and the exact integral stand beside steps" {
    local look="--domain 0:200 --opacity 0,0.3 --size 40x32"
    # Which region fits a budget depends on the load: of the whole, since pictures of the whole are compared.
    vkt chart "render $look" phantom.nrrd --roi :,:,: --keep threads,step --budget 30 --json >chart.json
    for levels in 0.5 2; do
        # shellcheck disable=SC2086
        vkt render phantom.nrrd $look --leave-out $levels -o left-$levels.png
    done
    # shellcheck disable=SC2086
    vkt render phantom.nrrd $look --exact -o exact.png
    for levels in 0.5 2; do vkt image diff exact.png left-$levels.png --json >diff-$levels || true; done
    /usr/bin/python3 - <<'END'
import json
points = {p["label"]: p for p in json.load(open("chart.json"))["points"]}
assert points["--exact on"]["max_error"] == 0 and points["--exact on"]["pipeline"].endswith("--exact"), points
assert points["as given"]["max_error"] > 0
for levels in ("0.5", "2"):
    seen, told = json.load(open(f"diff-{levels}"))["levels"], points[f"--leave-out {levels}"]
    assert abs(seen - told["max_error"]) <= 1.01, (seen, told)
END
    # Shading has no exact form, and nothing is exact beside a step that is given.
    vkt chart 'render --size 16 --shade 1' phantom.nrrd --keep threads,step --budget 0.1 --csv >chart.csv
    run ! grep -q -- '--exact' chart.csv
    vkt chart 'render --size 16 --shade none --step 1' phantom.nrrd --keep threads,leave-out --budget 0.1 |
        grep -q 'all 12 settings of the knobs, 6 of them refused'
}

@test "pictures with a tolerance, and surfaces, are compared with the mean over each pixel" {
    vkt make sphere --dims 20 18 16 --edge coverage | vkt filter gaussian --sigma 1 -o soft.nrrd
    for look in "--render-algo implicit-iso --iso 0.5" "--render-algo maximum" "--domain 0:1 --opacity 0,0.3 --tolerance 2"; do
        look="--size 8 $look"
        vkt chart "render $look" soft.nrrd --threads 1 --budget 3 --json >chart.json
        # shellcheck disable=SC2086
        vkt render soft.nrrd ${look/--tolerance 2/} --tolerance 0.25 -o all.png --force -q
        # shellcheck disable=SC2086
        vkt render soft.nrrd ${look/--tolerance 2/} --tolerance 16 -o few.png --force -q
        vkt image diff all.png few.png --json >diff || true
        /usr/bin/python3 - <<'END'
import json
chart = json.load(open("chart.json"))
assert "--tolerance 0.25" in chart["reference"], chart["reference"]
points = {p["pipeline"].split("--tolerance ")[-1].split()[0]: p for p in chart["points"] if "--tolerance" in p["pipeline"]}
assert sorted(points, key=float) == ["1", "2", "4", "8", "16"], points
assert points["16"]["rms_error"] > points["4"]["rms_error"] >= points["1"]["rms_error"], points # which may take all rays
seen = json.load(open("diff"))["levels"]
assert abs(seen - points["16"]["max_error"]) <= 1.5, (seen, points["16"]) # files hold whole levels
END
    done
}

@test "filters by weights are tried with smaller boxes, and refined volumes with other tolerances" {
    # told FILTER KNOB VALUE BEST: the error of a value is what vkt diff finds.
    told() {
        vkt chart "$1" noise.nrrd --keep threads --roi :,:,: --json >chart.json
        vkt pipe -q "read noise.nrrd | $1 --$2 $3 | write less.nrrd" --force
        vkt pipe -q "read noise.nrrd | $1 --$2 $4 | write best.nrrd" --force
        vkt diff best.nrrd less.nrrd --json >diff || true
        /usr/bin/python3 - "$2" "$3" <<'END'
import json, sys
points = json.load(open("chart.json"))["points"]
point, = [p for p in points if p["label"] == f"--{sys.argv[1]} {sys.argv[2]}"]
seen = json.load(open("diff"))["max_abs"]
assert seen > 0.01 and abs(point["max_error"] - seen) < 1e-5, (point, seen) # the reference is computed in float64
END
    }
    told 'filter nlmeans --strength 0.5' search 2 5
    told 'filter nlmeans --strength 0.5' patch 0 1
    told 'filter bilateral --sigma 1 --range-sigma 1' radius 1 5
    vkt chart 'refine --tolerance 0.2 --block-size 4 | resample --scale 1' noise.nrrd --keep threads,method,dtype --budget 1 --json >chart.json
    /usr/bin/python3 - <<'END'
import json
chart = json.load(open("chart.json"))
assert "refine --tolerance 0 " in chart["reference"], chart["reference"]
errors = {p["pipeline"].split("--tolerance ")[1].split()[0]: p["max_error"] for p in chart["points"]}
assert sorted(errors, key=float) == ["0.0125", "0.05", "0.2", "0.8", "3.2"], errors
assert all(error <= float(tolerance) * (1 + 1e-6) for tolerance, error in errors.items()), errors
assert errors["3.2"] > errors["0.2"] >= errors["0.05"], errors
END
}

@test "more paths make less noise, against paths of their own" {
    local look="--render-algo multi-scattering --size 16x12 --opacity 0,0.02 --seed 5"
    vkt chart "render $look" phantom.nrrd --keep threads --budget 0.1 --json >chart.json
    /usr/bin/python3 - <<'END'
import json
chart = json.load(open("chart.json"))
assert "1024 other paths a pixel" in chart["reference"], chart["reference"]
points = {p["pipeline"].split("--spp ")[-1].split()[0]: p for p in chart["points"] if "--spp" in p["pipeline"]}
errors = [points[n]["rms_error"] for n in ("4", "16", "256")]
# As the root of their number, and of what the reference lacks: 1/4 + 1/1024 is to 1/256 + 1/1024 as 7.2^2.
assert errors[0] > errors[1] > errors[2] > 0 and 4 < errors[0] / errors[2] < 13, errors
END
}

@test "reconstructions of a tree are compared, all of it" {
    vkt make amr --blocks 60 --levels 3 -o tree.vkt
    vkt chart 'resample --cells 20k' tree.vkt --keep threads,dtype --check --json >chart.json
    /usr/bin/python3 - <<'END'
import json
chart = json.load(open("chart.json"))
points = {p["label"].split()[-1]: p for p in chart["points"]}
assert "--method basis" in chart["reference"]
assert points["nearest"]["max_error"] > points["average"]["max_error"] > points["given"]["max_error"]
END
    vkt resample tree.vkt --cells 20k -o basis.nrrd
    vkt resample tree.vkt --cells 20k --method nearest -o nearest.nrrd
    vkt diff basis.nrrd nearest.nrrd --json | /usr/bin/python3 -c '
import json, sys
found = json.load(sys.stdin)
points = {p["label"].split()[-1]: p for p in json.load(open("chart.json"))["points"]}
assert abs(found["max_abs"] - points["nearest"]["max_error"]) <= 1e-6 * found["max_abs"], (found, points)'
    fails_with 2 "a region of a hierarchical volume" vkt chart 'resample --cells 20k' tree.vkt --roi 0:3,:,:
    fails_with 2 "makes a hierarchical volume" vkt chart 'convert --dtype float64' tree.vkt
    fails_with 5 "the whole volume has to be measured" vkt chart 'render' noise.nrrd --memory 64K
}

@test "where a part would not stand for the volume, all of it is measured" {
    vkt make noise --dims 90 80 70 --dtype uint8 --high 255 -o whole.nrrd
    on() { vkt chart "$1" whole.nrrd --budget 0.01 | head -n 1; }
    # Voxels that are named, results of a fixed size, and what depends on all values.
    for pipeline in 'crop --roi 0:20,0:20,0:20 | filter gaussian --sigma 1' 'resample --dims 20 20 20' 'clahe'; do
        [[ "$(on "$pipeline")" == 'measured on 0:90,0:80,0:70 of 90 80 70: '* ]] || { on "$pipeline" >&2; false; }
    done
    for pipeline in 'filter gaussian --sigma 1' 'crop --roi 10%:90%,:,: | filter gaussian --sigma 1' 'resample --scale 0.5'; do
        [[ "$(on "$pipeline")" == *' of the voxels: '* ]] || { on "$pipeline" >&2; false; }
    done
    # A region that is named is the volume.
    vkt chart 'crop --roi 0:9,0:9,0:9 | filter gaussian --sigma 1' whole.nrrd --roi 9:30,9:30,9:30 | grep -q '^measured on 9:30,9:30,9:30 of'
    fails_with 5 'does something else to a part' vkt chart clahe whole.nrrd --memory 8M
}

@test "knobs that are kept stay as they are given" {
    vkt chart 'resample --scale 1.5 --method cubic' phantom.nrrd --budget 0.3 --keep threads,method --csv >chart.csv
    [ "$(wc -l <chart.csv)" -ge 3 ]
    [ "$(grep -c -- '--method cubic' chart.csv)" -eq $(($(wc -l <chart.csv) - 1)) ]
    fails_with 2 "no such knob" vkt chart 'resample --scale 1.5' phantom.nrrd --keep sigma
}

@test "the command at the end does what was asked for" {
    vkt chart 'filter gaussian --sigma 2' noise.nrrd --budget 0.3 --within 0.5% >chart
    tail -1 chart | sed 's/-o OUT/-o fast.nrrd/' >again.sh
    sh again.sh
    vkt filter gaussian noise.nrrd --sigma 2 --tolerance 0.00001% -o exact.nrrd
    vkt diff fast.nrrd exact.nrrd --tolerance 0.005 >/dev/null
    vkt chart 'filter gaussian --sigma 2' noise.nrrd --budget 0.3 --in 1000 | tail -2 | grep -q 'most exact in 1000 s'
    run --separate-stderr vkt chart 'filter gaussian --sigma 2' noise.nrrd --budget 0.3 --within 1e-300
    [ "$status" -eq 1 ]
    [[ "$stderr" == *"as exact"* ]]
}

@test "a bound that is none is refused, by its name and with what it may be" {
    fails_with 2 "--within -1 is not a finite number >= 0" vkt chart 'filter gaussian --sigma 2' noise.nrrd --within=-1
    fails_with 2 "--within inf% is not a finite number >= 0" vkt chart 'filter gaussian --sigma 2' noise.nrrd --within inf%
    fails_with 2 "with % a share of their range" vkt chart 'filter gaussian --sigma 2' noise.nrrd --within inf
    fails_with 2 "--within: '5x' is not a number" vkt chart 'filter gaussian --sigma 2' noise.nrrd --within 5x
    fails_with 2 "--within: 'x' is not a number" vkt chart 'filter gaussian --sigma 2' noise.nrrd --within x%
}

# with_path_of PROGRAM…: a folder `only`, for a PATH that leads to nothing but vkt and these.
with_path_of() {
    mkdir -p only
    local program
    for program in vkt "$@"; do ln -sf "$(command -v "$program")" only/; done
}

@test "pictures and tables are written, whole or not at all" {
    command -v gnuplot >/dev/null || skip "gnuplot is not installed"
    for suffix in svg png csv; do
        vkt chart 'filter gaussian --sigma 1' noise.nrrd --budget 0.2 -o chart.$suffix >table
        [ -s chart.$suffix ]
        grep -q 'reference: float64' table
    done
    # One mark for each setting and each prediction, and the words that a reader needs.
    /usr/bin/python3 - <<'END'
import csv, re, xml.dom.minidom as m
text = open("chart.svg").read()
m.parseString(text)
assert len(re.findall("<use xlink:href='#gpPt", text)) >= 16, text
for words in ("filter gaussian --sigma 1, 24x22x20", "front", "predicted", "largest error"):
    assert words in text, words
END
    head -c 8 chart.png | cmp - <(printf '\211PNG\r\n\032\n')
    tail -c 12 chart.png | cmp - <(printf '\0\0\0\0IEND\256B`\202')
    head -1 chart.csv | grep -q '^seconds,'
    fails_with 4 "exists" vkt chart 'filter gaussian --sigma 1' noise.nrrd --budget 0.2 -o chart.svg
    fails_with 2 "not written" vkt chart 'filter gaussian --sigma 1' noise.nrrd -o chart.jpg
    [ ! -e chart.jpg ]
}

@test "words of the pipeline and of the volume are no words for gnuplot" {
    command -v gnuplot >/dev/null || skip "gnuplot is not installed"
    vkt chart "transform 'v*2 - (v > 1)' --dtype float64 | fill --value 1 --roi '0:1,:,:'" noise.nrrd --budget 0.2 -o chart.svg >table
    # shellcheck disable=SC2016
    vkt set noise.nrrd --units "'; system \"touch here\" #\`touch here\`" -o odd.nrrd
    vkt chart 'filter gaussian --sigma 1' odd.nrrd --budget 0.2 -o odd.svg >table
    [ ! -e here ]
    grep -q "largest error in '; system" odd.svg
}

@test "on a terminal the front is drawn in letters" {
    command -v gnuplot >/dev/null || skip "gnuplot is not installed"
    command -v script >/dev/null || skip "script (bsdutils) is not installed"
    script -qec "vkt chart 'filter gaussian --sigma 1' noise.nrrd --budget 0.2" seen </dev/null >/dev/null
    grep -q 'front  \*' seen
    vkt chart 'filter gaussian --sigma 1' noise.nrrd --budget 0.2 >table
    run ! grep -q 'front  \*' table
}

@test "without gnuplot tables are written, and pictures refused before anything is measured" {
    with_path_of bash
    PATH=$PWD/only vkt chart 'filter gaussian --sigma 1' noise.nrrd --budget 0.2 -o chart.csv >table
    fails_with 5 "gnuplot, which draws charts, is not installed" env PATH="$PWD/only" vkt chart 'filter gaussian --sigma 1' none.nrrd -o chart.svg
    [ ! -e chart.svg ]
    printf '#!%s\necho "line 1: no memory" >&2; exit 3\n' "$(command -v bash)" >only/gnuplot
    chmod +x only/gnuplot
    fails_with 5 "gnuplot failed: line 1: no memory" env PATH="$PWD/only" vkt chart 'filter gaussian --sigma 1' noise.nrrd --budget 0.2 -o chart.svg
    [ ! -e chart.svg ]
}

@test "a volume may come from a pipe, and a broken one is an error" {
    vkt read noise.nrrd | vkt chart 'filter gaussian --sigma 1' --budget 0.2 | grep -q 'vkt pipe --threads [0-9]* .filter gaussian'
    vkt read noise.nrrd | head -c 9000 >cut.vkt
    fails_with 3 "ended early" vkt chart 'filter gaussian --sigma 1' cut.vkt --budget 0.2
}

@test "what cannot be charted is said" {
    fails_with 2 "no operation on voxels" vkt chart 'stats' noise.nrrd
    fails_with 2 "no operation on voxels" vkt chart 'read noise.nrrd' noise.nrrd
    fails_with 2 "does not make one volume of one" vkt chart 'arith add - noise.nrrd' noise.nrrd
    fails_with 2 "nothing in the pipeline" vkt chart 'flip x' noise.nrrd --threads 1
    fails_with 2 "decides no voxel" vkt chart 'flip x --threads 2' noise.nrrd
    fails_with 2 "" vkt chart 'filter gausian' noise.nrrd
}

@test "with a calibration, seconds are predicted by it, and the column says so" {
    vkt chart 'filter gaussian --sigma 2' noise.nrrd --budget 0.2 --threads 1 >table
    grep -q ' predicted ' table
    grep -q 'at the speed of what was given' table
    vkt chart 'filter gaussian --sigma 2' noise.nrrd --budget 0.2 --threads 1 --json >before.json
    vkt doctor --calibrate >/dev/null
    vkt chart 'filter gaussian --sigma 2' noise.nrrd --budget 0.2 --threads 1 >table
    grep -q ' calibrated ' table
    run ! grep -q ' predicted ' table
    grep -q 'vkt doctor --calibrate' table
    vkt chart 'filter gaussian --sigma 2' noise.nrrd --budget 0.2 --threads 1 --json >after.json
    vkt chart 'render --size 16' phantom.nrrd --budget 0.1 --keep threads --csv >picture.csv
    /usr/bin/python3 - <<'END'
import csv, json
before, after = (json.load(open(name)) for name in ("before.json", "after.json"))
assert before["predicted_by"] == "given setting" and after["predicted_by"] == "calibration"
given, = [p for p in before["points"] if p["given"]]
assert given["predicted_seconds"] == given["seconds"]
given, = [p for p in after["points"] if p["given"]]
assert given["predicted_seconds"] != given["seconds"] and all(p["predicted_seconds"] > 0 for p in after["points"])
# More multiply-adds by the same method take longer.
direct = sorted((p["operations"], p["predicted_seconds"]) for p in after["points"] if "--method fir" in p["label"] or p["given"])
assert [s for _, s in direct] == sorted(s for _, s in direct), direct
# Nothing was measured of drawing.
assert {row["predicted_by"] for row in csv.DictReader(open("picture.csv"))} == {"given setting"}
END
}
