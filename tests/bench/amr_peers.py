#!/usr/bin/python3
# Sampling a FLASH file with other programs, and reading it with HDF5: one number a line for tests/bench/amr.sh.
# SPDX-License-Identifier: MIT
#
#   amr_peers.py yt-arbitrary | yt-covering FILE X Y Z      samples per second, the file being open
#   amr_peers.py vtk-image | vtk-amr FILE X Y Z             the same
#   amr_peers.py hdf5 FILE                                  seconds of reading the variable
import sys
import time


def once(work):
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def yt_rate(file, dims, covering):
    import numpy
    import yt

    yt.set_log_level("error")
    data = yt.load(file)
    field = ("flash", "dens")

    def work():
        if covering:
            # Cells of the level whose width is next to that of the samples.
            level = max(0, int(numpy.floor(numpy.log2(min(dims / data.domain_dimensions)))))
            grid = data.covering_grid(level, data.domain_left_edge, data.domain_dimensions * 2**level)
        else:
            grid = data.arbitrary_grid(data.domain_left_edge, data.domain_right_edge, dims=dims)
        work.samples = grid[field].size

    data.index  # read before the clock starts, as for vkt
    seconds = once(work)
    return work.samples / seconds


def vtk_rate(file, dims, amr):
    import vtk

    vtk.vtkObject.GlobalWarningDisplayOff()
    reader = vtk.vtkAMRFlashReader()
    reader.SetFileName(file)
    reader.SetMaxLevel(32)
    reader.UpdateInformation()
    reader.SetCellArrayStatus("dens", 1)
    reader.Update()
    tree = reader.GetOutput()
    bounds = [0.0] * 6
    tree.GetBounds(bounds)
    if amr:
        sampler = vtk.vtkAMRResampleFilter()
        sampler.SetInputDataObject(tree)
        sampler.SetMin(bounds[0], bounds[2], bounds[4])
        sampler.SetMax(bounds[1], bounds[3], bounds[5])
        sampler.SetNumberOfSamples(*[int(n) for n in dims])
        sampler.SetTransferToNodes(1)
    else:
        sampler = vtk.vtkResampleToImage()
        sampler.SetInputDataObject(tree)
        sampler.SetSamplingDimensions(*[int(n) for n in dims])
    return float(dims.prod()) / once(sampler.Update)


def hdf5_seconds(file):
    import h5py
    import numpy

    def fresh(data):
        data.read_direct(numpy.empty(data.shape, data.dtype))

    with h5py.File(file, "r") as f:
        # Into memory that the system hands out, as every reader's is.
        return min(once(lambda: fresh(f["dens"])) for _ in range(5))


def main(words):
    if words[0] == "hdf5":
        return hdf5_seconds(words[1])
    import numpy

    dims = numpy.array([int(w) for w in words[2:5]])
    if words[0].startswith("yt"):
        return yt_rate(words[1], dims, words[0] == "yt-covering")
    return vtk_rate(words[1], dims, words[0] == "vtk-amr")


print(f"{main(sys.argv[1:]):.6g}")
