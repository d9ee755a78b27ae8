# vkt split: slices are those that SimpleITK extracts, where it says they lie; what was written stays, and no more.
load helper

setup_more() {
    vkt make noise --dims 9 7 6 --dtype int16 --spacing 0.5,2,3 --origin -1,2,1e4 |
        vkt set --direction 0,1,0,0.6,0,0.8,0.8,0,-0.6 -o v.mha
}

@test "slices have the voxels and the place that SimpleITK gives them" {
    python_with SimpleITK numpy
    vkt split v.mha -o 's%03d.mha'
    /usr/bin/python3 - <<'END'
import os, SimpleITK as itk, numpy as np
v = itk.ReadImage("v.mha")
assert sorted(n for n in os.listdir(".") if n[0] == "s") == [f"s{z:03d}.mha" for z in range(6)]
for z in range(6):
    want, got = v[:, :, z:z + 1], itk.ReadImage(f"s{z:03d}.mha")
    assert (itk.GetArrayFromImage(got) == itk.GetArrayFromImage(want)).all(), z
    for what in ("GetSpacing", "GetOrigin", "GetDirection"):
        assert np.allclose(getattr(got, what)(), getattr(want, what)(), rtol=1e-15, atol=1e-10), (what, z)
END
}

@test "numbers of any width, per cent signs, streams; names that are no place for one" {
    vkt split v.mha -o 'a%d%%.nrrd'
    [ -e a5%.nrrd ]
    vkt split v.mha -o 'b%5d.vkt'
    vkt stats 'b    5.vkt' >/dev/null
    vkt split v.mha -o all.vkt
    [ "$(vkt info all.vkt | grep -c '^dims')" -eq 6 ]
    for all in all.vkt -; do
        fails_with 3 "holds several volumes" eval "vkt split v.mha | vkt stack $all -o whole.nrrd"
    done
    [ ! -e whole.nrrd ]
    for name in 'x.nrrd' 'x%s.nrrd' 'x%.nrrd' 'x%99999999999d.nrrd' 'x%d-%d.nrrd'; do fails_with 2 "$name" vkt split v.mha -o "$name"; done
    fails_with 2 'can be read only once' vkt split - -o 'x%d.nrrd' <v.mha
    run ! compgen -G 'x*'
}

@test "a file in the way stops it at its place: those before are whole, none is replaced, nothing else is left" {
    echo mine >p2.nrrd
    fails_with 4 "'p2.nrrd'" vkt split v.mha -o 'p%d.nrrd'
    [ "$(cat p2.nrrd)" = mine ]
    [ ! -e p3.nrrd ]
    for z in 0 1; do [ ! -e p$z.nrrd ] || vkt crop v.mha --roi :,:,$z:+1 | vkt diff - p$z.nrrd --geometry; done
    vkt split v.mha -o 'p%d.nrrd' --force
    vkt stack 'p*.nrrd' | vkt diff - v.mha
    # Of a file that ends early no slice is made of what is missing.
    head -c -40 v.mha >cut.mha
    fails_with 3 'cut.mha' vkt split cut.mha -o 'q%d.nrrd'
    [ ! -e q5.nrrd ]
    [ -z "$(find . -name '.*.vkt-*')" ]
}
