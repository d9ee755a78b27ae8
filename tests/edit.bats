# vkt edit: what it changes in the header is what SimpleITK reads, and nothing else changes; it is vkt set.
load helper

setup_more() { vkt make noise --dims 9 7 5 --dtype int16 --spacing 0.5,2,3 --origin -1,2,1e4 -o v.nrrd; }

@test "geometry is what SimpleITK reads, voxels stay, bit for bit" {
    python_with SimpleITK numpy
    vkt edit v.nrrd --spacing 0.25,1.5,7 --origin -10,5.5,1e5 --direction 0,1,0,0.6,0,0.8,0.8,0,-0.6 -o e.mha
    vkt edit v.nrrd --dims 5 7 9 --spacing 2 -o d.mha
    /usr/bin/python3 - <<'END'
import SimpleITK as itk, numpy as np
v, e, d = (itk.ReadImage(name) for name in ("v.nrrd", "e.mha", "d.mha"))
voxels = itk.GetArrayFromImage(v)
assert itk.GetArrayFromImage(e).tobytes() == voxels.tobytes() == itk.GetArrayFromImage(d).tobytes()
assert e.GetSpacing() == (0.25, 1.5, 7) and e.GetOrigin() == (-10, 5.5, 1e5)
assert np.allclose(np.reshape(e.GetDirection(), (3, 3)).T, [[0, 1, 0], [0.6, 0, 0.8], [0.8, 0, -0.6]], atol=1e-15)
assert d.GetSize() == (5, 7, 9) and d.GetSpacing() == (2, 2, 2) and d.GetOrigin() == (-1, 2, 1e4)
END
}

@test "every option does what it does for vkt set, alone and in a pipeline; values follow the new map" {
    while read -r words; do
        # shellcheck disable=SC2086
        vkt edit v.nrrd $words --no-history | cmp - <(vkt set v.nrrd $words --no-history)
    done <<'END'
--spacing 2
--units HU --attribute modality=CT --attribute note=a=b
--slope 0.5 --intercept -1024
--voxel-mapping 0 1
--dims 35 9 1
END
    vkt edit v.nrrd --slope 0.5 --intercept -1024 | vkt diff - <(vkt transform 'v / 2 - 1024' v.nrrd --dtype float64)
    vkt pipe 'read v.nrrd | edit --slope 2 | edit --slope 1' | vkt diff - v.nrrd --geometry
    [ "$(vkt edit v.nrrd --attribute a=1 | vkt edit --attribute a= | vkt info --json | grep -c '"a"')" -eq 0 ]
    # What made it makes it again.
    vkt edit v.nrrd --units K --origin 1,2,3 -o e.vkt
    eval "$(vkt history e.vkt --as-shell)" | vkt diff - e.vkt --geometry
}

@test "a file may replace itself; what cannot be is refused by the command's name and changes nothing" {
    cp v.nrrd w.nrrd
    vkt edit w.nrrd --units K -o w.nrrd --force
    vkt diff v.nrrd w.nrrd --geometry
    vkt info w.nrrd | grep -q 'units.* K$'
    cp w.nrrd before.nrrd
    for words in '--spacing 0' '--spacing nan' '--origin inf,0,0' '--slope 0' '--dims 3 3 3' '--attribute =x' \
        '--direction 1,0,0,1,0,0,0,0,1' '--voxel-mapping 1 0'; do
        # shellcheck disable=SC2086
        fails_with 2 'vkt edit: ' vkt edit w.nrrd $words -o w.nrrd --force
    done
    cmp before.nrrd w.nrrd
}
