"""A reader of every format of vkt for ParaView: Tools, Manage Plugins, Load New, this file. In Python with VTK alone:

    reader = VktReader()
    reader.SetFileName("volume.nrrd")
    reader.Update()
    reader.GetOutputDataObject(0)     # vtkImageData with the array "voxels"

Volumes of a series are its time steps; channels are arrays of one image, by their names.
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
    "vdb", "tif", "tiff", "vti", "pvti", "pvd", "vtk", "zarr", "zarr.zip", "dcm", "h5", "hdf5", "mat", "nc", "nii.gz",
    "raw.gz"
]


@smproxy.reader(name="VktReader", label="vkt volume", extensions=EXTENSIONS, file_description="Volumes that vkt reads")
class VktReader(VTKPythonAlgorithmBase):
    def __init__(self):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self._name = None
        self._forget()
        self._cells = "50M"

    @smproperty.stringvector(name="FileName")
    @smdomain.filelist()
    @smhint.filechooser(extensions=EXTENSIONS, file_description="Volumes that vkt reads")
    def SetFileName(self, name):
        if name != self._name:
            self._name = name
            self._forget()
            self.Modified()

    @smproperty.stringvector(name="Cells", default_values="50M")
    def SetCells(self, cells):
        """Of adaptive meshes: about how many voxels the grid has that they become."""
        if cells != self._cells:
            self._cells = cells
            self._forget()
            self.Modified()

    def _forget(self):
        self._times = None  # by channel, the number in the series of the volume of each time
        self._steps = []    # when they are
        self._volumes = {}  # those of the last time that was asked for, by channel
        self._ahead = None  # the series from volume self._next on: one that is compressed is read once
        self._next = -1

    def RequestInformation(self, request, inputs, outputs):
        volume = next(iter(self._read(0).values()))
        extent = [0, volume.dims[0] - 1, 0, volume.dims[1] - 1, 0, volume.dims[2] - 1]
        information = outputs.GetInformationObject(0)
        pipeline = vtkStreamingDemandDrivenPipeline
        information.Set(pipeline.WHOLE_EXTENT(), extent, 6)
        information.Set(vtkImageData.SPACING(), volume.spacing, 3)
        information.Set(vtkImageData.ORIGIN(), volume.origin, 3)
        information.Set(vtkImageData.DIRECTION(), volume.direction.ravel().tolist(), 9)
        information.Remove(pipeline.TIME_STEPS())
        information.Remove(pipeline.TIME_RANGE())
        if len(self._steps) > 1:
            information.Set(pipeline.TIME_STEPS(), self._steps, len(self._steps))
            information.Set(pipeline.TIME_RANGE(), [self._steps[0], self._steps[-1]], 2)
        return 1

    def RequestData(self, request, inputs, outputs):
        self._look()
        information = outputs.GetInformationObject(0)
        asked = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
        time = information.Get(asked) if information.Has(asked) else self._steps[0]
        # As VTK has it: the last step that is not after the time asked for.
        step = max(np.searchsorted(self._steps, time, side="right") - 1, 0) if len(self._steps) > 1 else 0
        volumes = self._read(int(step))
        first = next(iter(volumes.values()))
        image = vtkImageData.GetData(outputs, 0)
        image.SetDimensions(first.dims)
        image.SetSpacing(first.spacing)
        image.SetOrigin(first.origin)
        image.SetDirectionMatrix(first.direction.ravel().tolist())
        if len(self._steps) > 1:
            image.GetInformation().Set(image.DATA_TIME_STEP(), self._steps[step])
        for channel, volume in volumes.items():
            if volume.dims != first.dims:
                raise RuntimeError(f"'{self._name}' holds volumes of {first.dims} and {volume.dims} voxels: vkt split "
                                   "makes a file of each")
            voxels = volume.array
            if volume.slope != 1 or volume.intercept != 0:
                voxels = volume.slope * voxels.astype(float) + volume.intercept
            elif voxels.dtype == np.float16:  # which VTK does not have
                voxels = voxels.astype(np.float32)
            array = numpy_to_vtk(voxels.ravel())  # in place; the array keeps the voxels
            array.SetName(channel if len(volumes) > 1 else "voxels")
            if volume is first:
                image.GetPointData().SetScalars(array)
            else:
                image.GetPointData().AddArray(array)
        return 1

    def _look(self):
        """Which volumes there are, and when, from their headers."""
        if self._name is None:
            raise RuntimeError("SetFileName() says which file to read")
        if self._times is not None:
            return
        try:
            headers = [volume.header for volume in vkt.read_series(self._name, roi="0:1,0:1,0:1")]
        except vkt.Error:  # adaptive meshes are read whole
            headers = [volume.header for volume in vkt.read_series(self._name)]
        told = [header.get("attributes", {}) for header in headers]
        times = {}
        for number, attributes in enumerate(told):
            times.setdefault(attributes.get("channel", "voxels"), []).append(number)
        if len({len(numbers) for numbers in times.values()}) > 1:  # no channels of the same times
            times = {"voxels": list(range(len(told)))}
        numbers = next(iter(times.values()))
        steps = [float(told[number].get("sequence position", "nan")) for number in numbers]
        rising = all(a < b for a, b in zip(steps, steps[1:])) and (len(steps) == 1 or steps[0] == steps[0])
        self._steps = steps if rising else [float(i) for i in range(len(numbers))]
        self._times = times

    def _read(self, step):
        """The volumes of a time, by channel."""
        self._look()
        wanted = {channel: numbers[step] for channel, numbers in self._times.items()}
        if {channel: number for channel, (number, _) in self._volumes.items()} != wanted:
            self._volumes = {channel: (number, self._volume(number)) for channel, number in wanted.items()}
        return {channel: volume for channel, (_, volume) in self._volumes.items()}

    def _volume(self, number):
        if number != self._next:
            series = vkt.read_series(self._name)
            self._ahead, self._next = iter(series if number == 0 else series[number:]), number
        volume = next(self._ahead)
        self._next += 1
        return vkt.resample(volume, cells=self._cells) if volume.hierarchical else volume
