# vkt reorient: where SimpleITK says that voxels lie after turning; it is vkt permute.
load helper

@test "all 48 orientations of an oblique volume are those of SimpleITK" {
    python_with SimpleITK numpy
    /usr/bin/python3 - <<'END'
import itertools, subprocess, SimpleITK as itk, numpy as np
voxels = np.arange(4 * 3 * 5, dtype=np.int16).reshape(5, 3, 4)
image = itk.GetImageFromArray(voxels)
image.SetSpacing((0.5, 2, 3.25)); image.SetOrigin((-10, 5.5, 1e4))
a, b = np.radians((20, -15))
turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) @ \
    np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
image.SetDirection(turn[:, [2, 0, 1]].ravel()) # the axes in another order
itk.WriteImage(image, "v.nrrd")
names = ["".join(order) for pairs in itertools.permutations(("RL", "AP", "SI")) for order in itertools.product(*pairs)]
lines = " && ".join(f"vkt reorient --to {name if i % 2 else name.lower()} v.nrrd -o {name}.mha" for i, name in enumerate(names))
subprocess.run(lines, shell=True, check=True)
for name in names:
    want, got = itk.DICOMOrient(image, name), itk.ReadImage(name + ".mha")
    assert got.GetSize() == want.GetSize() and np.allclose(got.GetSpacing(), want.GetSpacing(), rtol=1e-15), name
    assert np.allclose(got.GetOrigin(), want.GetOrigin(), atol=1e-10), (name, got.GetOrigin(), want.GetOrigin())
    assert np.allclose(got.GetDirection(), want.GetDirection(), atol=1e-12), name
    assert (itk.GetArrayFromImage(got) == itk.GetArrayFromImage(want)).all(), name
END
}

@test "it is permute: same bytes, orders of axes too; what has no frame is refused by its name" {
    vkt make noise --dims 7 5 4 --dtype uint8 | vkt set --attribute space=LPS -o lps.nrrd
    for order in RAS lps zyx; do
        vkt reorient --to $order lps.nrrd --no-history | cmp - <(vkt permute $order lps.nrrd --no-history)
    done
    run ! cmp <(vkt reorient RAS lps.nrrd --format raw) <(vkt write lps.nrrd - --format raw)
    # There and back is the volume.
    vkt reorient ASR lps.nrrd | vkt reorient --to LPS | vkt diff - lps.nrrd --geometry
    vkt make noise --dims 7 5 4 -o bare.nrrd
    fails_with 2 'vkt reorient: the volume does not say' vkt reorient --to RAS bare.nrrd
    fails_with 2 'vkt reorient: ' vkt reorient --to RAX lps.nrrd
}
