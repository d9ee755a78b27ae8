# Several volumes: many files in, many files out, and every stage in between; pipelines as a whole.
load helper

setup_more() {
    # Ascending values, times 1, 9 and 10: numbers in names are compared as numbers.
    for n in 1 9 10; do
        /usr/bin/python3 -c "
import struct
open('step_$n.raw', 'wb').write(struct.pack('<120H', *(i * $n for i in range(120))))"
    done
}

series() { vkt read 'step_*.raw' --dims 6 5 4 --dtype uint16; }
one() { vkt read "step_$1.raw" --dims 6 5 4 --dtype uint16; }
values() { vkt write - --format raw; }

@test "files that match are read in the order of their numbers, and written one by one" {
    series | vkt write 'out_%04d.nrrd'
    [ "$(echo out_*)" = "out_0000.nrrd out_0001.nrrd out_0002.nrrd" ]
    vkt read out_0000.nrrd | values | cmp - step_1.raw
    vkt read out_0001.nrrd | values | cmp - step_9.raw
    vkt read out_0002.nrrd | values | cmp - step_10.raw
    # A name without a place for the number takes one volume, or all where the format holds several.
    series | vkt write all.vkt
    [ "$(vkt stats all.vkt --json | grep -c '"argmax"')" -eq 3 ]
    vkt read 'out_*.nrrd' | vkt diff - all.vkt
    # Existing files are kept.
    run -4 vkt read 'step_*.raw' --dims 6 5 4 --dtype uint16 -o 'out_%04d.nrrd'
    fails_with 4 "no file matches" vkt read 'stop_*.raw' --dims 6 5 4 --dtype uint16
}

@test "of several volumes those are read whose numbers are said" {
    series | vkt write all.vkt
    series | vkt write 'out_%d.nrrd'
    cat out_1.nrrd >single.nrrd
    for input in "'step_*.raw' --dims 6 5 4 --dtype uint16" all.vkt "'out_*.nrrd'" '- <all.vkt'; do
        eval "vkt read $input --index 1" | values | cmp - step_9.raw
        eval "vkt read $input --index 2" | values | cmp - step_10.raw
        eval "vkt read $input --index ::2" | vkt write 'some_%d.nrrd' --force
        vkt read some_0.nrrd | values | cmp - step_1.raw
        vkt read some_1.nrrd | values | cmp - step_10.raw
        [ ! -e some_2.nrrd ]
        eval "vkt read $input --index 1:" | vkt stats --json | grep -c '"argmax"' >count
        [ "$(cat count)" -eq 2 ]
        eval "vkt read $input --index 0:2 --roi 1:3,:,2:" | vkt info --json | grep -c '"dims"' >count
        [ "$(cat count)" -eq 2 ]
        eval "fails_with 2 'index 3: there are 3 volumes, counted from 0' vkt read $input --index 3 -o x.vkt"
        [ ! -e x.vkt ]
        eval "fails_with 2 'index 1:4: there are 3 volumes' vkt read $input --index 1:4 -o x.vkt"
        [ ! -e x.vkt ]
    done
    fails_with 2 'there is 1 volume' vkt read single.nrrd --index 1
    for wrong in -1 x 2:2 3:1 ::0 1:2:3:4 ''; do fails_with 2 index vkt read all.vkt "--index=$wrong"; done
    # What comes behind in a stream is looked at all the same, and the recipe says which one it was.
    head -c -20 all.vkt >cut.vkt
    fails_with 3 'ended early: its end is missing' vkt read - --index 0 <cut.vkt
    vkt read 'step_*.raw' --dims 6 5 4 --dtype uint16 --index 1 | vkt history - | grep -q -- '--index 1'
}

@test "every stage does to each volume what it does to one" {
    while IFS= read -r line; do
        # shellcheck disable=SC2086
        series | eval "vkt $line" | vkt write 'got_%d.nrrd' --force
        number=0
        for n in 1 9 10; do
            one $n | eval "vkt $line" | vkt write want.nrrd --force
            vkt diff got_$number.nrrd want.nrrd --json >diff.json
            grep -q '"max_abs": 0' diff.json && grep -q '"same_geometry": true' diff.json ||
                { echo "$line, volume $number"; cat diff.json; false; } >&2
            number=$((number + 1))
        done
        [ ! -e got_3.nrrd ]
    done <<'EOF'
filter gaussian --sigma 1
resample --scale 2
resample --dims 3 4 5 --method area
flip x
flip z
flip z --memory 100
fill --value 7 --first 1 2 0 --last 3 4 2
set --spacing 1,2,3 --origin 4,5,6
crop --roi 1:5,:,50%:
convert --dtype uint8 --range minmax
arith mul - 2
EOF
}

@test "arith takes volumes of two series pair by pair" {
    series | vkt arith add - <(series | vkt arith mul - 2) -o 'thrice_%d.nrrd'
    vkt read 'step_*.raw' --dims 6 5 4 --dtype uint16 -o 'v_%d.nrrd'
    vkt arith add 'v_?.nrrd' 'v_?.nrrd' -o 'sum_%d.nrrd'
    number=0
    for n in 1 9 10; do
        one $n | vkt arith mul - 2 | vkt diff - sum_$number.nrrd
        one $n | vkt arith mul - 3 | vkt diff - thrice_$number.nrrd
        number=$((number + 1))
    done
    fails_with 3 "different numbers of volumes" vkt arith add 'v_?.nrrd' 'v_[01].nrrd' -o 'x_%d.nrrd'
    fails_with 3 "different numbers of volumes" vkt arith add 'v_[01].nrrd' 'v_?.nrrd' -o 'y_%d.nrrd'
}

@test "one volume in a file goes with each of a series" {
    one 9 | vkt arith mul - 5 -o five.nrrd
    series | vkt arith add - five.nrrd -o 'a_%d.nrrd'
    series | vkt arith sub five.nrrd - --dtype int32 -o 'b_%d.nrrd'
    vkt arith add five.nrrd <(series) --memory 100 -o 'd_%d.nrrd'
    number=0
    for n in 1 9 10; do
        one $n | vkt arith mul - 1 -o one.nrrd --force
        vkt arith add one.nrrd five.nrrd | vkt diff - a_$number.nrrd
        vkt arith sub five.nrrd one.nrrd --dtype int32 | vkt diff - b_$number.nrrd
        vkt arith add one.nrrd five.nrrd | vkt diff - d_$number.nrrd
        number=$((number + 1))
    done
    [ ! -e a_3.nrrd ]
    # Two of three are no single volume, and what came through a pipe is gone.
    vkt read 'step_[19].raw' --dims 6 5 4 --dtype uint16 -o two.vkt
    fails_with 3 "different numbers of volumes" eval "series | vkt arith add - two.vkt -o 'x_%d.nrrd'"
    fails_with 3 "single volume is used with each of a series if it is a file" \
        eval "series | vkt arith add - <(vkt read five.nrrd) -o 'y_%d.nrrd'"
}

@test "reports tell of each volume" {
    series >all.vkt
    vkt dump <all.vkt >dumped
    for n in 1 9 10; do one $n | vkt dump; done | cmp - dumped
    [ "$(vkt history <all.vkt | grep -c "vkt read 'step_\*.raw' --dims 6 5 4 --dtype uint16")" -eq 3 ]
    vkt flip x all.vkt | vkt history | grep -c 'vkt flip x' | grep -qx 3
    vkt stats all.vkt --json | /usr/bin/python3 -c '
import json, sys
assert [s["max"] for s in json.load(sys.stdin)] == [119, 1071, 1190]'
    vkt info all.vkt --json | /usr/bin/python3 -c '
import json, sys
assert [v["dims"] for v in json.load(sys.stdin)] == 3 * [[6, 5, 4]]'
}

@test "if a volume is bad the command fails, and files that were complete remain" {
    head -c 100 step_9.raw >short
    mv short step_9.raw
    set +e
    vkt read 'step_*.raw' --dims 6 5 4 --dtype uint16 -o 'out_%d.nrrd'
    code=$?
    vkt read 'step_*.raw' --dims 6 5 4 --dtype uint16 2>/dev/null | vkt flip x | vkt write 'piped_%d.nrrd'
    codes="${PIPESTATUS[*]}"
    set -e
    [ "$code" -eq 3 ]
    [ "$codes" = "3 3 3" ]
    vkt read out_0.nrrd | values | cmp - step_1.raw
    [ -e piped_0.nrrd ]
    [ ! -e out_1.nrrd ]
    [ ! -e piped_1.nrrd ]
    [ -z "$(ls -A | grep -F .vkt- || true)" ]
}

@test "a pipeline from a file to a picture, word by word" {
    needs_data raw/stent_128x128x256_int16.raw
    python_with vtk numpy
    ln -s "$VKT_DATA/raw/stent_128x128x256_int16.raw" .
    vkt read stent_128x128x256_int16.raw | vkt crop --roi 10%:90%,10%:90%,: | vkt resample --scale 0.5 | vkt filter gaussian --sigma 1 | vkt render -o stent.png
    # Something bright before a dark ground.
    /usr/bin/python3 - <<'PY'
import vtk
from vtk.util.numpy_support import vtk_to_numpy
r = vtk.vtkPNGReader(); r.SetFileName('stent.png'); r.Update()
p = vtk_to_numpy(r.GetOutput().GetPointData().GetScalars()).astype(int)
assert r.GetOutput().GetDimensions() == (512, 512, 1)
bright, dark = (p.max(1) > 120).mean(), (p.max(1) < 40).mean()
print(bright, dark)
assert 0.002 < bright < 0.5 and 0.3 < dark < 0.98
PY
}

@test "what does not fit is spooled, and refused with 5 where that cannot be" {
    one 9 >v.vkt
    vkt flip z v.vkt | values >want
    vkt flip z --memory 100 <v.vkt 2>err | values | cmp - want
    grep -q "spooling 240 B" err
    vkt flip z v.vkt --memory 1k | values | cmp - want
    fails_with 5 "budget is 1.0 KiB" vkt render v.vkt --memory 1k -o v.png
    [ ! -e v.png ]
    fails_with 5 "budget" vkt render - --memory 100 -o v.png <v.vkt
}

@test "a GPU that is not there is refused with 5" {
    [ -z "$(ls /dev/nvidia* 2>/dev/null)" ] || skip "there is a GPU"
    one 1 >v.vkt
    fails_with 5 "" vkt flip x v.vkt --device gpu -o x.vkt
    [ ! -e x.vkt ]
    vkt flip x v.vkt --device auto | values | cmp - <(vkt flip x v.vkt --device cpu | values)
}

@test "--timing prints a row for every stage, with wall time, processor time, waits and bytes" {
    series | vkt flip x --timing | vkt filter gaussian --sigma 1 | vkt stats 2>table >/dev/null
    cat table
    head -n 1 table | grep -q '^stage  *wall s  *cpu s  *wait in  *wait out  *bytes in  *bytes out$'
    [ "$(sed 1d table | cut -d' ' -f1 | tr '\n' ' ')" = "flip filter stats " ]
    for stage in flip filter stats; do
        grep -Eq "^${stage}[a-z ]*( +[0-9]+\.[0-9]{3}){4}( +[0-9.]+ (B|KiB|MiB)){2}$" table ||
            { echo "no row of $stage" >&2; false; }
    done
    # The environment asks as well.
    series | VKT_TIMING=1 vkt flip x -o flipped.vkt 2>table
    [ "$(wc -l <table)" -eq 2 ]
}

# Volumes at these times, which say nothing of how far they lie apart.
at_times() {
    for time in "$@"; do
        vkt make constant --value "$time" --dims 4 3 2 --dtype float32 | vkt set --attribute "sequence position=$time"
    done
}
times_in() { vkt info "$1" --json | grep -o '"sequence position":"[^"]*"' | cut -d'"' -f4 | tr '\n' ' '; }

@test "times at equal distances are kept where no step is said, and others refused or kept" {
    at_times 2 5 8 >even.vkt
    at_times 0 1 3 >uneven.vkt
    at_times 3 2 1 >falling.vkt
    for file in a.nii b.nii.gz a.nrrd d.nhdr a.mha e.mhd a.mrc; do
        vkt read even.vkt -o $file
        [ "$(times_in $file)" = "2 5 8 " ]
        fails_with 2 "volume 2 lies at 3, not 1 behind" vkt read uneven.vkt -o un$file
        [ ! -e un$file ]
        vkt read falling.vkt -o $file --force
        [ "$(times_in $file)" = "3 2 1 " ]
    done
    for file in a.h5:/d a.zarr a.vkt $(vkt --version | grep -q TIFF && echo a.tif); do
        vkt read uneven.vkt -o $file
        [ "$(times_in $file)" = "0 1 3 " ]
        vkt read $file | vkt diff - uneven.vkt
    done
}

@test "an output that exists is replaced with --force where the input is a part of a file" {
    vkt make ramp --dims 5 4 3 -o part.npz:w
    vkt write part.npz:w -o out.nrrd
    vkt write part.npz:w -o out.nrrd --force
    fails_with 4 "no such file" vkt write none.npz:w -o out.nrrd --force
}

@test "ITK's volumes over time lie where ITK has them" {
    python_has SimpleITK || skip "python3 has no SimpleITK"
    /usr/bin/python3 - <<'END'
import subprocess
import nibabel, numpy as np, SimpleITK as sitk
image = sitk.GetImageFromArray(np.zeros((5, 7, 9), "i2"))
image.SetOrigin((1, -2, 3))
image.SetSpacing((0.5, 0.6, 2))
sitk.WriteImage(sitk.JoinSeries([image, image, image]), "itk.mha")
sitk.WriteImage(sitk.ReadImage("itk.mha"), "itk.nii")
subprocess.run("vkt write itk.mha own.nii", shell=True, check=True, capture_output=True)
assert np.allclose(nibabel.load("itk.nii").affine, nibabel.load("own.nii").affine), nibabel.load("own.nii").affine
END
}

@test "a file of a series has the history that all of its volumes share, and no other" {
    vkt make noise --dims 6 5 4 --dtype uint16 --seed 1 -o one.nrrd
    vkt make noise --dims 6 5 4 --dtype uint16 --seed 2 -o two.nrrd
    for suffix in nrrd nii.gz mha tif h5 zarr npy; do
        vkt stack one.nrrd two.nrrd -o series.$suffix
        vkt read series.$suffix --index 1 -o second.nrrd --force
        vkt history second.nrrd --as-shell >line
        [ "$(cat line)" = "vkt read series.$suffix --index 1" ]
        bash line | vkt diff - two.nrrd
        [ $suffix != npy ] || continue
        vkt stack one.nrrd one.nrrd -o same.$suffix
        vkt read same.$suffix --index 1 -o second.nrrd --force
        vkt history second.nrrd --as-shell | bash | vkt diff - one.nrrd
    done
}

@test "volumes that store their values differently are told from those that lie elsewhere" {
    vkt make noise --dims 6 5 4 --dtype uint16 --seed 1 -o one.nrrd
    vkt make noise --dims 6 5 4 --dtype uint16 --seed 2 --high 900 -o two.nrrd
    vkt stack one.nrrd two.nrrd -o series.nii.gz
    for suffix in nii nrrd mha tif h5 npz zarr; do
        fails_with 2 "slopes and intercepts of their own" vkt convert series.nii.gz --dtype uint8 --range minmax -o out.$suffix -q
        [[ "$stderr" == *"vkt convert --range 0:1000"* ]]
    done
    vkt convert series.nii.gz --dtype uint8 --range 0:1000 -o out.nii -q
    vkt make ramp --dims 6 5 3 --dtype uint16 -o three.nrrd
    fails_with 2 "different dims, types or geometry" vkt write '[ot]*[eo].nrrd' out.nrrd
}

@test "every second volume of a series lies twice as far apart" {
    for i in 1 2 3 4; do vkt make noise --dims 5 4 3 --seed $i -o v$i.nrrd; done
    vkt stack v?.nrrd -o four.tif
    vkt read four.tif -o four.nii.gz
    for suffix in nrrd nii.gz mha h5 tif; do
        vkt read four.nii.gz --index ::2 -o two.$suffix
        vkt info two.$suffix --json | grep '"sequence step":"2"'
        vkt read two.$suffix --index 1 | vkt diff - v3.nrrd
    done
}
