# vkt stack and vkt split, against NumPy and tifffile.
load helper

setup_more() {
    python_with numpy
    /usr/bin/python3 -c "
import numpy as np
np.random.default_rng(3).integers(-900, 900, (6, 7, 9), dtype=np.int16).tofile('v_9x7x6_int16.raw')"
    vkt set v_9x7x6_int16.raw --spacing 0.5,0.7,0.3 --origin 10,20,30 -o v.nrrd
}

raw() { vkt write "${1:--}" - --format raw; }

@test "what is split into slices is stacked again: voxels and places, in any format" {
    for extension in nrrd mha nii.gz vkt; do
        vkt split v.nrrd -o "s%02d.$extension"
        [ "$(ls s??.$extension | wc -l)" -eq 6 ]
        vkt stack "s??.$extension" -o "again.$extension"
        vkt diff again.$extension v.nrrd
        vkt info again.$extension --json | tr -d ' \n' | grep -q '"dims":\[9,7,6\]'
    done
    vkt info s03.nrrd | grep -qx 'origin     10 20 30.9'
    # The slice itself, as NumPy cuts it.
    /usr/bin/python3 -c "
import numpy as np, subprocess
v = np.fromfile('v_9x7x6_int16.raw', np.int16).reshape(6, 7, 9)
for k in range(6): assert subprocess.check_output(['vkt', 'write', f's0{k}.nrrd', '-', '--format', 'raw']) == v[k].tobytes()"
    # Pipes on both sides, pieces of slices, and files that can only be read forward.
    vkt read v.nrrd | vkt split --along z | vkt flip x | vkt write 'f%d.nrrd.gz' --format nrrd
    vkt stack 'f?.nrrd.gz' --slab 1 | vkt flip x | vkt diff - v.nrrd
    vkt stack <(vkt read s00.nrrd) s01.nrrd <(vkt read s02.nrrd) | vkt diff - <(vkt crop v.nrrd --roi :,:,:3)
    vkt stack 's??.nrrd' | vkt crop --roi 2:5,1:,4:5 | vkt diff - <(vkt crop v.nrrd --roi 2:5,1:,4:5)
}

@test "volumes become a series, or one volume on another" {
    vkt flip x v.nrrd | vkt write f_9x7x6_int16.raw
    vkt set f_9x7x6_int16.raw --spacing 0.5,0.7,0.3 --origin 10,20,30 -o f.nrrd
    vkt stack v.nrrd f.nrrd v.nrrd -o series.npy
    /usr/bin/python3 -c "
import numpy as np
v = np.fromfile('v_9x7x6_int16.raw', np.int16).reshape(6, 7, 9)
s = np.load('series.npy')
assert s.shape == (3, 6, 7, 9) and (s[0] == v).all() and (s[1] == v[:, :, ::-1]).all() and (s[2] == v).all()"
    vkt stack v.nrrd f.nrrd -o two.nrrd
    vkt split two.nrrd -o 'part%d.nrrd'
    vkt diff part0.nrrd v.nrrd
    vkt diff part1.nrrd f.nrrd
    [ ! -e part2.nrrd ]
    vkt read two.nrrd | vkt split --along series | vkt diff - two.nrrd
    [ "$(vkt split two.nrrd --along z | vkt info | grep -c '^dims       9 7 1')" -eq 12 ]
    vkt crop v.nrrd --roi :,:,:2 -o a.nrrd
    vkt crop v.nrrd --roi :,:,2: -o b.nrrd
    vkt stack a.nrrd b.nrrd --along z | vkt diff - v.nrrd
    vkt stack v.nrrd v.nrrd --along z --force-uniform | vkt info | grep -qx 'dims       9 7 12'
    vkt stack a.nrrd - --along z <b.nrrd | vkt diff - v.nrrd
}

@test "what does not fit is refused with its name" {
    vkt split v.nrrd -o 's%d.nrrd'
    fails_with 3 "'s3.nrrd' does not fit on 's0.nrrd': its origin" vkt stack s0.nrrd s1.nrrd s3.nrrd s4.nrrd -o x.nrrd
    fails_with 3 'ascending order' vkt stack s2.nrrd s1.nrrd s0.nrrd -o x.nrrd
    vkt stack s2.nrrd s1.nrrd s0.nrrd --force-uniform | raw | cmp - <(raw s2.nrrd && raw s1.nrrd && raw s0.nrrd)
    vkt convert s1.nrrd --dtype float32 -o float.nrrd
    fails_with 3 'its type is float32, not int16' vkt stack s0.nrrd float.nrrd -o x.nrrd
    vkt crop s1.nrrd --roi 1:,:,: -o small.nrrd
    fails_with 3 'its slices have 8 by 7' vkt stack s0.nrrd small.nrrd -o x.nrrd
    fails_with 3 'slope' vkt stack s0.nrrd <(vkt set s1.nrrd --voxel-mapping 0 3) -o x.nrrd
    fails_with 2 'several slices, others do not' vkt stack s0.nrrd v.nrrd -o x.nrrd
    fails_with 2 'names one file' vkt split v.nrrd -o x.nrrd
    fails_with 2 '--along z splits into slices' eval 'vkt read v.nrrd | vkt split -o "x%d.nrrd"'
    fails_with 4 "cannot open 'absent.nrrd'" vkt stack s0.nrrd absent.nrrd -o x.nrrd
    head -c 300 s1.nrrd >short.nrrd
    fails_with 3 'short.nrrd' vkt stack s0.nrrd short.nrrd -o x.nrrd
    [ ! -e x.nrrd ] && [ ! -e x0.nrrd ]
}

@test "slices as TIFF are what tifffile reads" {
    python_with tifffile
    vkt split v.nrrd -o 's%d.tif' 2>err || { grep -q 'without it' err && skip 'built without libtiff'; cat err >&2; false; }
    /usr/bin/python3 -c "
import numpy as np, tifffile
v = np.fromfile('v_9x7x6_int16.raw', np.int16).reshape(6, 7, 9)
for k in range(6): assert (tifffile.imread(f's{k}.tif') == v[k]).all()"
}

@test "info and stats tell of many files by their names" {
    vkt flip x v.nrrd -o f.mha
    vkt info v.nrrd f.mha >info
    [ "$(grep -c '^name ' info)" -eq 2 ]
    grep -q '^name  *f.mha$' info
    grep -q '^format  *metaimage$' info
    grep -q '^format  *nrrd$' info
    vkt info v.nrrd f.mha --json | /usr/bin/python3 -c "
import json, sys
a, b = json.load(sys.stdin)
assert (a['name'], a['format'], b['name'], b['format']) == ('v.nrrd', 'nrrd', 'f.mha', 'metaimage'), (a, b)
assert a['dims'] == b['dims'] == [9, 7, 6]"
    [ "$(vkt info v.nrrd | grep -c '^name')" -eq 0 ]
    vkt stats v.nrrd f.mha --csv | /usr/bin/python3 -c "
import csv, sys
rows = list(csv.DictReader(sys.stdin))
assert [r['name'] for r in rows] == ['v.nrrd', 'f.mha'] and rows[0]['mean'] == rows[1]['mean']"
    run -4 --separate-stderr vkt info v.nrrd absent.nrrd
    [[ "$stderr" == *"cannot open 'absent.nrrd'"* && "$output" == *v.nrrd* ]]
}

@test "the history of a stack makes it again" {
    for i in 1 2 3; do vkt make ramp --dims 4 4 1 -o made$i.nrrd; done
    vkt stack made1.nrrd <(vkt arith mul made2.nrrd 3) made3.nrrd --along z -o stacked.nrrd
    vkt history stacked.nrrd --as-shell >again.sh
    bash again.sh | vkt diff - stacked.nrrd
    vkt make ramp --dims 4 4 1 --no-history -o plain1.nrrd
    cp plain1.nrrd plain2.nrrd
    vkt stack 'plain*.nrrd' -o stacked.nrrd --force
    [ "$(vkt history stacked.nrrd --as-shell)" = 'vkt stack plain1.nrrd plain2.nrrd' ]
    vkt stack 'plain*.nrrd' --along series | vkt history --as-shell | grep -qx "vkt stack 'plain\*.nrrd' --along series"
}
