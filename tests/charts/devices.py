#!/usr/bin/python3
"""Error against seconds on a GPU, beside the same machine's processor and CuPy: data resident, results left there.

devices.py [--build DIR] [--out DIR] [--size N] [--runs N]: writes gpu-*.csv, and pictures of them where gnuplot is;
charts.py --draw NAME... makes the pictures elsewhere. Needs a build with CUDA, NumPy, SciPy and CuPy."""
# SPDX-License-Identifier: MIT
import importlib
import math
import sys
import tempfile

import numpy as np

import charts


def on_gpu(cupy, function):
    """The function as a call that ends when the GPU is idle, with its result there."""

    def call():
        with charts.vkt.policy(device="gpu"):
            result = function()
        cupy.cuda.Device().synchronize()
        return result

    return call


class Judged:
    """One chart whose results are judged by a part of them only, so that large volumes need no large reference."""

    def __init__(self, chart, cupy, inner, error):
        self.chart, self.cupy, self.inner, self.error = chart, cupy, inner, error

    def add(self, tool, variant, function):
        def error_of(result):
            part = result[self.inner]
            return self.error(np.asarray(part.get() if hasattr(part, "get") else part, np.float64))

        seconds, result = charts.seconds_of(function, self.chart.options.runs)
        self.chart.point(tool, variant, seconds, error_of(result.array if hasattr(result, "array") else result))


def compare(judged, there, here, variants, words, peers):
    """vkt on both devices with each variant, and the peers on the GPU."""
    for variant, options in variants:
        judged.add("vkt, GPU", variant, on_gpu(judged.cupy, lambda: there.apply(*words, **options)))
    for variant, options in variants:
        judged.add("vkt", variant, lambda: here.apply(*words, **options))
    for variant, function in peers:
        judged.add("CuPy", variant, on_gpu(judged.cupy, function))


def largest(reference):
    return lambda result: np.max(np.abs(result - reference))


def gaussians(options, cupy):
    ndimage, theirs = importlib.import_module("scipy.ndimage"), importlib.import_module("cupyx.scipy.ndimage")
    n = options.size
    v = np.tile(charts.field(n // 2), (2, 2, 2))
    here, there, c = charts.vkt.Volume(v), charts.vkt.Volume(v).migrate("gpu"), cupy.asarray(v)
    for sigma in (2, 8):
        chart = charts.Chart(f"gpu-gaussian-{sigma}", f"Gaussian, sigma {sigma}, {n}^3 float32, resident",
                             "largest error, of the range", options)
        margin, middle = 8 * sigma + 1, n // 2
        block = (slice(middle - 16 - margin, middle + 16 + margin),) * 3
        reference = ndimage.gaussian_filter(v[block].astype(np.float64), sigma, truncate=8)[(slice(margin, -margin),) * 3]
        judged = Judged(chart, cupy, (slice(middle - 16, middle + 16),) * 3, largest(reference))
        compare(judged, there, here,
                [(t, dict(sigma=sigma, tolerance=t)) for t in ("3%", "1%", "0.1%", "0.01%", "0.001%")], ("filter gaussian",),
                [(f"cut at {cut}", lambda cut=cut: theirs.gaussian_filter(c, sigma, truncate=cut)) for cut in (2, 3, 4, 5)])
        yield chart


def smooth(n):
    """The smooth field of charts.waves on n^3 voxels, plane by plane."""
    line = (np.arange(n) + 0.5) / n * 2 - 1
    return np.stack([charts.waves((z, line[:, None], line[None, :])) for z in line]).astype(np.float32)


def transforms(options, cupy):
    theirs = importlib.import_module("cupyx.scipy.ndimage")
    n, m = options.size, options.size // 2
    v = smooth(n)
    here, there, c = charts.vkt.Volume(v), charts.vkt.Volume(v).migrate("gpu"), cupy.asarray(v)

    chart = charts.Chart("gpu-resample-half", f"{n}^3 to {m}^3, a smooth field, resident", "largest error, of the range",
                         options)
    part = slice(m // 10, m // 10 + 32)
    line = ((np.arange(m) + 0.5) / m * 2 - 1)[part]
    judged = Judged(chart, cupy, (part,) * 3, largest(charts.waves(np.meshgrid(line, line, line, indexing="ij"))))
    compare(judged, there, here, [(name, dict(dims=(m, m, m), method=name)) for name in ("nearest", "linear", "cubic", "lanczos3", "auto")],
            ("resample",),
            [(f"order {k}", lambda k=k: theirs.zoom(c, m / n, order=k, mode="nearest", grid_mode=True)) for k in (0, 1, 3)])
    yield chart

    chart = charts.Chart("gpu-rotate-1", f"a rotation by 30 degrees about z, {n}^3 float32, resident",
                         "largest error, of the range", options)
    part = slice(n // 3, n // 3 + 32)
    line = ((np.arange(n) + 0.5) / n * 2 - 1)[part]
    z, y, x = np.meshgrid(line, line, line, indexing="ij")
    cosine, sine = math.cos(math.radians(30)), math.sin(math.radians(30))
    both = [largest(charts.waves((z, y * cosine - way * x * sine, x * cosine + way * y * sine))) for way in (1, -1)]
    judged = Judged(chart, cupy, (part,) * 3, lambda result: min(way(result) for way in both))
    compare(judged, there, here,
            [(name, dict(axis="z", angle=30, method=name)) for name in ("nearest", "linear", "cubic", "lanczos3", "bspline3", "bspline5")],
            ("rotate",),
            [(f"order {k}", lambda k=k: theirs.rotate(c, 30, (1, 2), reshape=False, order=k, mode="constant")) for k in (0, 1, 3)])
    yield chart


def march(options, _):
    """Frames of fog, the data loaded; the referee is SciPy's interpolation in float64."""
    n, size = 128, 256
    v = charts.fog(n)
    other = importlib.import_module("renderers")
    reference = other.march(v, size)
    chart = charts.Chart("gpu-march-fog", f"Ray marching of fog, {size}x{size}, {n}^3 uint8", "largest error, levels of 255",
                         options)
    with tempfile.TemporaryDirectory() as folder:
        charts.vkt.Volume(v).write(f"{folder}/v.nrrd")
        for tool, device in (("vkt, GPU", "gpu"), ("vkt", "cpu")):
            for step in (4, 2, 1, 0.5, 0.25):
                seconds, picture = charts.frame(options.vkt, folder, n, "--device", device, "--size", f"{size}x{size}",
                                                *charts.fog_words(other), "--step", str(step))
                chart.point(tool, f"step {step:g}", seconds, 255 * np.max(np.abs(picture - reference)))
    yield chart


def main():
    options = charts.arguments()
    options.size = options.size or 512
    cupy = charts.module("cupy")
    if cupy is None:
        sys.exit("devices.py: CuPy is not installed")
    gpu = cupy.cuda.runtime.getDeviceProperties(0)["name"].decode()
    for make in (gaussians, transforms, march):
        for chart in make(options, cupy):
            chart.machine += f", {gpu}"
            chart.write(options.out)


if __name__ == "__main__":
    main()
