"""A reader of every format of vkt for ParaView: Tools, Manage Plugins, Load New, this file. In Python with VTK alone:

    reader = VktReader()
    reader.SetFileName("volume.nrrd")
    reader.Update()
    reader.GetOutputDataObject(0)     # vtkImageData with the array "voxels"
"""
# SPDX-License-Identifier: MIT
import numpy as np
import vkt
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

try:
    from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy
except ImportError:  # VTK without ParaView: the decorators say nothing
    class _Nothing:
        def __getattr__(self, name):
            return lambda *_, **__: lambda decorated: decorated

    smdomain = smhint = smproperty = smproxy = _Nothing()

EXTENSIONS = [  # what vkt help formats lists, but for PNG
    "nrrd", "nhdr", "mha", "mhd", "raw", "nii", "hdr", "img", "mrc", "mrcs", "map", "ccp4", "npy", "npz", "flash",
    "vdb", "tif", "tiff", "vti", "pvti", "vtk", "zarr", "zarr.zip", "dcm", "h5", "hdf5", "mat", "nc", "nii.gz",
    "raw.gz"
]


@smproxy.reader(name="VktReader", label="vkt volume", extensions=EXTENSIONS, file_description="Volumes that vkt reads")
class VktReader(VTKPythonAlgorithmBase):
    def __init__(self):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self._name = None
        self._volume = None
        self._cells = "50M"

    @smproperty.stringvector(name="FileName")
    @smdomain.filelist()
    @smhint.filechooser(extensions=EXTENSIONS, file_description="Volumes that vkt reads")
    def SetFileName(self, name):
        if name != self._name:
            self._name, self._volume = name, None
            self.Modified()

    @smproperty.stringvector(name="Cells", default_values="50M")
    def SetCells(self, cells):
        """Of adaptive meshes: about how many voxels the grid has that they become."""
        if cells != self._cells:
            self._cells, self._volume = cells, None
            self.Modified()

    def RequestInformation(self, request, inputs, outputs):
        volume = self._read()
        extent = [0, volume.dims[0] - 1, 0, volume.dims[1] - 1, 0, volume.dims[2] - 1]
        information = outputs.GetInformationObject(0)
        information.Set(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), extent, 6)
        information.Set(vtkImageData.SPACING(), volume.spacing, 3)
        information.Set(vtkImageData.ORIGIN(), volume.origin, 3)
        information.Set(vtkImageData.DIRECTION(), volume.direction.ravel().tolist(), 9)
        return 1

    def RequestData(self, request, inputs, outputs):
        volume = self._read()
        image = vtkImageData.GetData(outputs, 0)
        image.SetDimensions(volume.dims)
        image.SetSpacing(volume.spacing)
        image.SetOrigin(volume.origin)
        image.SetDirectionMatrix(volume.direction.ravel().tolist())
        voxels = volume.array
        if volume.slope != 1 or volume.intercept != 0:
            voxels = volume.slope * voxels.astype(float) + volume.intercept
        elif voxels.dtype == np.float16:  # which VTK does not have
            voxels = voxels.astype(np.float32)
        array = numpy_to_vtk(voxels.ravel())  # in place; the array keeps the voxels
        array.SetName("voxels")
        image.GetPointData().SetScalars(array)
        return 1

    def _read(self):
        if self._name is None:
            raise RuntimeError("SetFileName() says which file to read")
        if self._volume is None:
            self._volume = vkt.read(self._name)
            if self._volume.hierarchical:
                self._volume = vkt.resample(self._volume, cells=self._cells)
        return self._volume
