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
