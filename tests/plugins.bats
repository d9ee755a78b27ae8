# Examples for other programs: the plugin for napari and the reader for ParaView, without their windows.
load helper
load python

@test "napari: npe2 takes the manifest, and finds the functions that it names" {
    with_peer npe2
    PYTHONPATH="$PYTHONPATH:$VKT_ROOT/examples/napari-vkt:$site"
    /usr/bin/python3 - "$VKT_ROOT/examples/napari-vkt" <<'EOF2'
import sys, tomllib
from npe2 import PluginManifest
folder = sys.argv[1]
project = tomllib.load(open(folder + "/pyproject.toml", "rb"))["project"]
module, file = project["entry-points"]["napari.manifest"]["napari-vkt"].split(":")
manifest = PluginManifest.from_file(f"{folder}/{module}/{file}")
assert manifest.name == project["name"]
manifest.validate_imports()
reader, = manifest.contributions.readers
assert "*.nrrd" in reader.filename_patterns and reader.accepts_directories
EOF2
}

# Pictures of one slice they show themselves.
@test "napari and ParaView: they are asked about files of every format that vkt reads" {
    vkt help formats | sed -nE 's/^  [a-z0-9]+ +(\..*[a-z0-9]) +r[w-] .*/\1/p' | tr -s ' ' '\n' | sed 's/^\.//' |
        { grep -vxE 'png|pgm|ppm|pfm|exr'; echo nii.gz; } | sort -u >read
    [ "$(wc -l <read)" -ge 25 ]
    sed -n '/filename_patterns/,/]/p' "$VKT_ROOT/examples/napari-vkt/napari_vkt/napari.yaml" |
        grep -oE '\*\.[a-z0-9.]+' | cut -c 3- | sort | diff read -
    sed -n '/^EXTENSIONS/,/^]/p' "$VKT_ROOT/examples/paraview-vkt.py" | grep -oE '"[a-z0-9.]+"' | tr -d '"' | sort |
        diff read -
}

@test "napari: folders of Zarr and of slices" {
    vkt write volume.nrrd volume.zarr
    vkt crop volume.nrrd --roi :,:,0:4 | vkt write - slices/ || mkdir slices
    vkt crop volume.nrrd --roi :,:,0:4 | vkt write - 'tiff%04d.tif'
    mkdir pictures other
    mv tiff*.tif pictures
    echo "no volume" >other/README
    PYTHONPATH="$VKT_ROOT/examples/napari-vkt" python <<'EOF2'
import napari_vkt, os
read = napari_vkt.get_reader("volume.zarr")
(data, properties, kind), = read("volume.zarr")
assert np.array_equal(data, volume.array) and properties["name"] == "volume.zarr"
(data, properties, kind), = napari_vkt.get_reader(["volume.zarr/"])(["volume.zarr/"])
assert properties["name"] == "volume.zarr"
assert napari_vkt.get_reader("other") is None and napari_vkt.get_reader("nowhere") is None
assert napari_vkt.get_reader(["volume.nrrd", "volume.nrrd"]) is None
for folder in "pictures", "slices":
    if os.listdir(folder):  # without a module for DICOM there are none of its slices
        (data, _, _), = napari_vkt.get_reader(folder)(folder)
        assert np.array_equal(data, volume.array[:4]), folder
EOF2
}

@test "napari: layers are the voxels, where they lie, and come back as they were" {
    vkt threshold volume.nrrd --otsu | vkt label --dtype uint8 | vkt set --attribute Segment0_LabelValue=1 Segment0_Name=shell -o labels.seg.nrrd
    PYTHONPATH="$VKT_ROOT/examples/napari-vkt" python <<'EOF2'
import napari_vkt
assert napari_vkt.get_reader("nowhere.nrrd") is None
read = napari_vkt.get_reader(["volume.nrrd"])
(data, properties, kind), = read("volume.nrrd")
assert kind == "image" and np.array_equal(data, volume.array)
# Voxel (z, y, x) lies where vkt says, in the order z, y, x.
at = np.array([5, 6, 7])
world = np.array(volume.origin) + volume.direction @ (np.array(volume.spacing) * at[::-1])
assert np.allclose((properties["affine"] @ [*at, 1])[:3], world[::-1])
(labels, more, kind), = read("labels.seg.nrrd")
assert kind == "labels" and more["features"]["name"][more["features"]["index"].index(1)] == "shell"
assert napari_vkt.write_layer("again.seg.nrrd", labels, more) == ["again.seg.nrrd"]
again = vkt.read("again.seg.nrrd")
assert np.array_equal(again.array, labels) and again.header["attributes"]["Segment0_Name"] == "shell"
angle = 0.3
turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
o = vkt.Volume(volume.array, spacing=(1, 2, 3), origin=(4, 5, 6), direction=turn, units="HU")
o.write("turned.nrrd")
(data, properties, _), = read("turned.nrrd")
napari_vkt.write_layer("turned2.nrrd", data, properties)
back = vkt.read("turned2.nrrd")
assert np.allclose(back.direction, turn) and np.allclose(back.spacing, o.spacing) and np.allclose(back.origin, o.origin)
assert back.units == "HU" and np.array_equal(back.array, o.array)
# As napari has it of a layer that was scaled, turned and moved by hand.
napari_vkt.write_layer("moved.nrrd", data, {"scale": [3, 2, 1], "translate": [6, 5, 4], "rotate": turn[::-1, ::-1],
                                            "shear": [0, 0, 0], "affine": np.eye(4)})
moved = vkt.read("moved.nrrd")
assert np.allclose(moved.direction, turn) and np.allclose(moved.spacing, (1, 2, 3)) and np.allclose(moved.origin, (4, 5, 6))
napari_vkt.write_layer("flat.nrrd", data[3], {"scale": [2, 1], "translate": [5, 4]})
assert vkt.read("flat.nrrd").dims[2] == 1 and vkt.read("flat.nrrd").spacing == (1, 2, 1)
try:
    napari_vkt.write_layer("sheared.nrrd", data, {"shear": [0.1, 0, 0]})
    raise SystemExit("taken")
except vkt.Error as e:
    assert "sheared" in str(e)
v = vkt.Volume(volume.array, slope=2, intercept=-1)
v.write("mapped.nrrd")
(data, properties, _), = read("mapped.nrrd")
assert np.array_equal(data, 2.0 * volume.array - 1) and data.dtype == np.float32
napari_vkt.write_layer("mapped2.nrrd", data, properties)
assert vkt.read("mapped2.nrrd").stats()["mean"] == v.stats()["mean"]
EOF2
}

@test "ParaView: the reader gives VTK an image, where vkt says that it lies" {
    python_with vtk
    vkt refine volume.nrrd --tolerance 20 -o tree.vdb 2>/dev/null || true
    cp "$VKT_ROOT/examples/paraview-vkt.py" paraview_vkt.py
    PYTHONPATH="$PWD" python <<'EOF2'
import paraview_vkt
from vtkmodules.util.numpy_support import vtk_to_numpy
angle = 0.3
turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
o = vkt.Volume(volume.array, spacing=(1, 2, 3), origin=(4, 5, 6), direction=turn)
o.write("turned.nrrd")
reader = paraview_vkt.VktReader()
reader.SetFileName("turned.nrrd")
reader.Update()
image = reader.GetOutputDataObject(0)
assert image.GetDimensions() == o.dims and image.GetExtent()[1] == o.dims[0] - 1
array = image.GetPointData().GetScalars()
assert array.GetName() == "voxels" and np.array_equal(vtk_to_numpy(array).reshape(o.dims[::-1]), o.array)
p = [0.0] * 3
image.TransformIndexToPhysicalPoint(7, 6, 5, p)
assert np.allclose(p, np.array(o.origin) + turn @ (np.array(o.spacing) * (7, 6, 5)))
vkt.Volume(volume.array, slope=2, intercept=-1).write("mapped.nrrd")
reader.SetFileName("mapped.nrrd")
reader.Update()
assert np.array_equal(vtk_to_numpy(reader.GetOutputDataObject(0).GetPointData().GetScalars()), 2.0 * volume.array.ravel() - 1)
total = vtk_to_numpy(reader.GetOutputDataObject(0).GetPointData().GetScalars()).sum()
del reader, array
assert total == (2.0 * volume.array - 1).sum()
EOF2
}

# A series of three times with a step of 2.5 s, made by another program; of two channels, one of three colours at two
# times.
make_series() {
    python_with nibabel
    python <<'EOF2'
import nibabel
data = np.random.default_rng(1).integers(-500, 500, (7, 6, 5, 3)).astype(np.int16)
image = nibabel.Nifti1Image(data, np.diag([2, 3, 4, 1]))
image.header.set_zooms((2, 3, 4, 2.5))
image.header.set_xyzt_units("mm", "sec")
image.header["toffset"] = 10
nibabel.save(image, "series.nii.gz")
np.save("series.npy", data.T)  # t, z, y, x
parts = [vkt.set(vkt.Volume(np.full((4, 5, 6), 10 * t + c, np.uint8), spacing=(1, 2, 3)),
                 attribute={"channel": name, "sequence kind": "time", "sequence position": 0.5 * t, "sequence step": 0.5})
         for t in range(2) for c, name in enumerate(["DAPI", "GFP"])]
vkt.write_series(parts, "channels.vkt")
EOF2
}

@test "napari: a series is a layer with an axis of time, channels are layers" {
    make_series
    PYTHONPATH="$VKT_ROOT/examples/napari-vkt:$PYTHONPATH" python <<'EOF2'
import napari_vkt
want = np.load("series.npy")
(data, properties, kind), = napari_vkt.get_reader("series.nii.gz")("series.nii.gz")
assert kind == "image" and np.array_equal(data, want) and properties["name"] == "series.nii.gz"
affine = properties["affine"]
assert affine.shape == (5, 5) and properties["units"] == ("s", "mm", "mm", "mm")
# Time 2 at voxel z 4, y 5, x 6.
assert np.allclose(affine @ [2, 4, 5, 6, 1], [10 + 2 * 2.5, 16, 15, 12, 1]), affine
layers = napari_vkt.read("channels.vkt")
assert [(p["name"], d.shape, d[1, 0, 0, 0]) for d, p, _ in layers] == [
    ("channels.vkt DAPI", (2, 4, 5, 6), 10), ("channels.vkt GFP", (2, 4, 5, 6), 11)]
assert np.allclose(np.diag(layers[1][1]["affine"]), [0.5, 3, 2, 1, 1])
# Written again, it is the same.
assert napari_vkt.write_layer("again.nii.gz", data, properties) == ["again.nii.gz"]
import nibabel
image = nibabel.load("again.nii.gz")
assert np.array_equal(np.asarray(image.dataobj).T, want) and np.allclose(image.header.get_zooms(), (2, 3, 4, 2.5))
assert image.header.get_xyzt_units() == ("mm", "sec") and image.header["toffset"] == 10
assert np.allclose(image.affine, np.diag([2, 3, 4, 1]))
(again, same, _), = napari_vkt.read("again.nii.gz")
assert np.array_equal(again, data) and np.allclose(same["affine"], affine) and same["units"] == properties["units"]
# Of volumes that are not alike each has a layer.
vkt.write_series([volume, vkt.crop(volume, roi="1:,:,:")], "unlike.vkt")
assert [d.shape for d, _, _ in napari_vkt.read("unlike.vkt")] == [volume.array.shape, volume.array[:, :, 1:].shape]
for wrong in np.zeros((2, 2, 2, 2, 2)), np.zeros((2, 2, 2, 2)):
    try:
        napari_vkt.write_layer("wrong.nrrd", wrong, {"affine": np.eye(wrong.ndim + 1) + np.eye(wrong.ndim + 1, k=1)})
        raise SystemExit("taken")
    except vkt.Error as e:
        assert "time and space" in str(e)
EOF2
}

@test "ParaView: volumes of a series are time steps, channels arrays" {
    python_with vtk
    make_series
    cp "$VKT_ROOT/examples/paraview-vkt.py" paraview_vkt.py
    PYTHONPATH="$PWD:$PYTHONPATH" python <<'EOF2'
import paraview_vkt
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
want = np.load("series.npy")
reader = paraview_vkt.VktReader()
reader.SetFileName("series.nii.gz")
reader.UpdateInformation()
information = reader.GetOutputInformation(0)
assert list(information.Get(pipeline.TIME_STEPS())) == [10, 12.5, 15]
assert list(information.Get(pipeline.TIME_RANGE())) == [10, 15]
for time, step in (10, 0), (15, 2), (12.5, 1), (14, 1), (15, 2), (0, 0), (99, 2):
    reader.UpdateTimeStep(time)
    image = reader.GetOutputDataObject(0)
    assert image.GetDimensions() == (7, 6, 5) and np.allclose(image.GetSpacing(), (2, 3, 4))
    voxels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(5, 6, 7)
    assert np.array_equal(voxels, want[step]), (time, step)
    assert image.GetInformation().Get(image.DATA_TIME_STEP()) == 10 + 2.5 * step
reader.SetFileName("channels.vkt")
reader.UpdateInformation()
assert list(reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS())) == [0, 0.5]
reader.UpdateTimeStep(0.5)
points = reader.GetOutputDataObject(0).GetPointData()
assert [points.GetArrayName(i) for i in range(points.GetNumberOfArrays())] == ["DAPI", "GFP"]
assert points.GetArray("GFP").GetValue(0) == 11 and points.GetScalars().GetValue(0) == 10
reader.SetFileName("volume.nrrd")  # one volume has no times
reader.Update()
assert not reader.GetOutputInformation(0).Has(pipeline.TIME_STEPS())
assert np.array_equal(vtk_to_numpy(reader.GetOutputDataObject(0).GetPointData().GetScalars()), volume.array.ravel())
EOF2
}
