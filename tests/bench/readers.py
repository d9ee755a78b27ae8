#!/usr/bin/python3
# What reading formats costs beside others' tools, and surfaces beside VTK's, in one run, interleaved, the best of N.
# SPDX-License-Identifier: MIT
#
#   readers.py [--vkt PATH] [--runs N] [--mib N] [WORD…]
#
# WORD: raw, zstd, region, gzip, mesh; all of them without. Prints seconds of both, processor seconds of both, and the
# ratio of the bar, which is met from 1 on. What is not installed (zarr, VTK) is said and left out; PYTHONPATH names it.
import argparse
import glob
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time


def timed(work):
    before, begin = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)], time.perf_counter()
    work()
    wall = time.perf_counter() - begin
    after = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return wall, sum(a.ru_utime + a.ru_stime - b.ru_utime - b.ru_stime for a, b in zip(after, before))


def shell(line):
    return lambda: subprocess.run(line, shell=True, check=True, stdout=subprocess.DEVNULL)


def compare(name, bar, ours, theirs, runs):
    """bar: how many times as fast as theirs ours must be."""
    best = [[float("inf")] * 2, [float("inf")] * 2]
    for _ in range(runs):
        for k, work in enumerate((ours, theirs)):
            best[k] = [min(a, b) for a, b in zip(best[k], timed(work))]
    (wall, cpu), (their_wall, their_cpu) = best
    print(f"{name:28} {wall:8.3f} s, theirs {their_wall:8.3f} s; processor {cpu:7.3f} s, theirs {their_cpu:7.3f} s; "
          f"of the bar {their_wall / wall / bar:5.2f}, by processor {their_cpu / cpu / bar:5.2f}", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("words", nargs="*")
    parser.add_argument("--vkt", default=shutil.which("vkt"))
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--mib", type=int, default=256)
    options = parser.parse_args()
    words = options.words or ["raw", "zstd", "region", "gzip", "mesh"]
    os.environ["PATH"] = os.path.dirname(os.path.abspath(options.vkt)) + ":" + os.environ["PATH"]
    here = tempfile.mkdtemp(dir=os.environ.get("TMPDIR"))
    try:
        os.chdir(here)
        for word in words:
            {"raw": raw, "zstd": zstd, "region": region, "gzip": gzip, "mesh": mesh}[word](options)
    finally:
        os.chdir("/")
        shutil.rmtree(here)


def volume(options, name, dtype="uint16"):
    """Smooth with some noise, so that it compresses as images do."""
    slices = options.mib * 2**20 // (512 * 512 * (4 if dtype == "float32" else 2))
    shell(f"vkt make noise --dims 64 64 64 --low 0 --high 1500 | vkt resample --dims 512 512 {slices}"
          f" | vkt transform 'v + mod(x * 7 + y * 13 + z * 29, 8)' | vkt convert --dtype {dtype} -o {name}")()


def raw(options):
    """Through a pipe, since nobody keeps what goes nowhere."""
    volume(options, "a.vkt")
    for name, more in ("a.tif", ""), ("a.h5", ""), ("a.zarr", ""), ("a.zarr", "--chunk 512,512,16"):
        shell(f"vkt write a.vkt {name} {more}")()
        compare(f"{name} {more}, cat", 0.8, shell(f"vkt read {name} | cat"), shell(f"find {name} -type f | xargs cat | cat"), options.runs)
        shell(f"rm -r {name}")()
    os.remove("a.vkt")


def zstd(options):
    try:
        import zarr
    except ImportError as reason:
        print("zstd:", reason)
        return
    volume(options, "a.vkt")
    for version in 2, 3:
        shell(f"vkt write a.vkt z{version}.zarr --codec zstd --zarr-version {version}")()
        store = zarr.open(f"z{version}.zarr", mode="r")
        compare(f"Zarr {version}, zstd, zarr-python", 2, shell(f"vkt read z{version}.zarr"), lambda: store[:], options.runs)


def region(_):
    """Bytes that a 64th of a volume of 1 GiB takes, in chunks of 64."""
    shell("vkt make noise --dims 1024 1024 512 --dtype uint16 --low 1 --high 99 -o big.zarr")()
    whole = sum(os.path.getsize(os.path.join(folder, file)) for folder, _, files in os.walk("big.zarr") for file in files)
    # A file for each thread, whose calls are whole lines there.
    trace = subprocess.run(["strace", "-ff", "-y", "-e", "trace=read,pread64,preadv", "-o", "trace", "vkt", "read", "big.zarr", "--roi",
                            "128:384,128:384,128:256"], stdout=subprocess.DEVNULL)
    if trace.returncode != 0:
        print("region: strace", trace.returncode)
        return
    calls = [line for name in glob.glob("trace.*") for line in open(name, errors="replace") if "big.zarr/" in line and " = " in line]
    taken = sum(max(int(line.rsplit(" = ", 1)[1].split()[0]), 0) for line in calls if not line.rstrip().endswith("?"))
    print(f"a 64th of a Zarr array takes {taken} of {whole} bytes: one part in {whole / taken:.1f}; of the bar (32) {whole / taken / 32:.2f}")
    shutil.rmtree("big.zarr")


def gzip(options):
    volume(options, "a.nii.gz")
    compare("NIfTI.gz, zcat", 0.9, shell("vkt read a.nii.gz"), shell("zcat a.nii.gz"), options.runs)
    compare("the same on one thread", 0.9, shell("vkt read a.nii.gz --threads 1"), shell("zcat a.nii.gz"), options.runs)


def mesh(options):
    try:
        from vtkmodules.util.numpy_support import numpy_to_vtk
        from vtkmodules.vtkCommonDataModel import vtkImageData
        from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D
        import numpy
        import vkt
    except ImportError as reason:
        print("mesh:", reason)
        return
    for kind, more in ("marschner-lobb", ""), ("sphere", "--edge coverage"):
        shell(f"vkt make {kind} --dims 256 256 256 {more} -o {kind}.npy")()
        voxels = numpy.load(f"{kind}.npy")
        image = vtkImageData()
        image.SetDimensions(*voxels.shape[::-1])
        image.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel(), deep=1))
        own = vkt.Volume(voxels)

        def theirs():
            f = vtkFlyingEdges3D()
            f.SetInputData(image)
            f.SetValue(0, 0.5)
            f.ComputeNormalsOff(), f.ComputeGradientsOff(), f.ComputeScalarsOff()
            f.Update()

        compare(f"mesh of a {kind}, VTK", 1, lambda: own.apply("mesh", iso=0.5, threads=2), theirs, options.runs)


main()
