#!/usr/bin/python3
# Frames of ray marching beside VTK's fixed-point ray caster: the same volume, transfer function, camera and step, data
# loaded, processor seconds of the best frame, the two in turn on one machine.
# SPDX-License-Identifier: MIT
#
#   march.py [--build DIR] [--size N] [--step S] [--runs R] [SCENE...]   needs python3-vtk9 and a display (xvfb-run)
#
# A scene is VOLUME:TYPE:LOOK: waves (smooth), cloud (turbulence) or scan (shells with noise of 2 %); uint8 or float32;
# fog, dense, and both with -shaded.
import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import (vtkColorTransferFunction, vtkRenderer, vtkRenderWindow, vtkVolume,
                                         vtkVolumeProperty)
from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  a window is needed, if only to hold the picture
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401

eye = np.array((1.1, -2.0, 0.8))
scenes = ["waves:uint8:fog", "waves:float32:fog-shaded", "waves:float32:dense", "waves:uint8:dense-shaded",
          "cloud:float32:fog", "cloud:uint8:fog-shaded", "cloud:uint8:dense", "cloud:float32:dense-shaded"]


def field(name, n):
    """Values from 0 to 1."""
    line = ((np.arange(n) + 0.5) / n * 2 - 1).astype(np.float32)
    z, y, x = np.meshgrid(line, line, line, indexing="ij", sparse=True)
    r2 = x * x + y * y + z * z
    if name == "waves":
        v = np.exp(-3 * r2) * (0.6 + 0.4 * np.cos(12 * x + 3 * y) * np.cos(11 * y - 2 * z) * np.cos(10 * z))
        v[[0, 1, 2, -3, -2, -1]] = v[:, [0, 1, 2, -3, -2, -1]] = v[:, :, [0, 1, 2, -3, -2, -1]] = 0
        return v.astype(np.float32)
    random = np.random.default_rng(1)
    if name == "cloud":
        m = min(n, 256)
        f, half = np.fft.fftfreq(m), np.fft.rfftfreq(m)
        k2 = f[:, None, None] ** 2 + f[None, :, None] ** 2 + half[None, None, :] ** 2
        k2[0, 0, 0] = 1
        v = np.fft.irfftn(np.fft.rfftn(random.standard_normal((m, m, m))) * k2 ** (-11 / 12), s=(m, m, m))
        v = np.tile((v - v.min()) / (v.max() - v.min()), (n // m,) * 3) * np.clip(1.3 - 1.3 * np.sqrt(r2), 0, 1)
        return (v / v.max()).astype(np.float32)
    r = np.sqrt(r2 * 1.5 + 0.05 * np.sin(9 * x) * np.sin(7 * y) * np.sin(8 * z))
    v = 0.45 * (r < 0.9) + 0.4 * ((r < 0.9) & (r > 0.8))
    v = v + (r < 0.4) * 0.15 * np.sin(20 * x) * np.sin(17 * y) * np.sin(15 * z)
    return (v + 0.02 * random.standard_normal((n, n, n), dtype=np.float32)).clip(0, 1).astype(np.float32)


def vtk_window(v, look, step):
    n, top = v.shape[0], 255 if v.dtype == np.uint8 else 1
    image = vtkImageData()
    image.SetDimensions(n, n, n)
    image.SetOrigin(*[-(n - 1) / 2] * 3)
    image.GetPointData().SetScalars(numpy_to_vtk(v.reshape(-1)))
    colours, opacities = vtkColorTransferFunction(), vtkPiecewiseFunction()
    dense = look.startswith("dense")
    for x in np.arange(256) / 255:
        extinction = max(0, 0.5 * (x - 0.3) / 0.7) if dense else 5.12 / n * x
        opacities.AddPoint(x * top, -np.expm1(-extinction))
        colours.AddRGBPoint(x * top, *((0.2 + 0.8 * x, abs(2 * x - 1), 1 - 0.7 * x) if dense else (1, 1, 1)))
    material = vtkVolumeProperty()
    material.SetColor(colours)
    material.SetScalarOpacity(opacities)
    material.SetScalarOpacityUnitDistance(1)
    material.SetInterpolationTypeToLinear()
    material.SetShade(look.endswith("shaded"))
    mapper = vtkFixedPointVolumeRayCastMapper()
    mapper.SetInputData(image)
    mapper.AutoAdjustSampleDistancesOff()
    mapper.SetImageSampleDistance(1)
    mapper.SetSampleDistance(step)
    mapper.SetNumberOfThreads(2)
    volume = vtkVolume()
    volume.SetMapper(mapper)
    volume.SetProperty(material)
    renderer, window = vtkRenderer(), vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(512, 512)
    window.AddRenderer(renderer)
    renderer.AddVolume(volume)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*(eye * n))
    camera.SetFocalPoint(0, 0, 0)
    camera.SetViewUp(0, 0, 1)
    camera.SetViewAngle(30)
    renderer.ResetCameraClippingRange()
    return window


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", default=str(Path(__file__).resolve().parent.parent.parent / "build"))
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--step", type=float, default=0.5)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("scenes", nargs="*", default=scenes)
    options = parser.parse_args()
    n = options.size
    print("processor ms of a frame: VTK, vkt with all rays and steps, vkt within half a level; VTK over both; "
          "largest difference of these two, levels")
    held = vtkRenderWindow()  # an X server that its last window leaves starts anew, and refuses the next one meanwhile
    held.SetOffScreenRendering(1)
    held.Render()
    with tempfile.TemporaryDirectory() as folder:
        for scene in options.scenes:
            name, kind, look = scene.split(":")
            v = field(name, n)
            v = (255 * v).clip(0, 255).astype(np.uint8) if kind == "uint8" else v
            v.tofile(f"{folder}/v.raw")
            window = vtk_window(v, look, options.step)
            window.Render()
            peer = np.inf
            for run in range(options.runs):
                begin = time.process_time()
                window.Render()
                peer = min(peer, time.process_time() - begin)
                if run == options.runs // 2:
                    said = subprocess.run(
                        [f"{options.build}/tests/vkt_march_bench", f"{folder}/v.raw", str(n), kind,
                         look.split("-")[0], "0.8" if look.endswith("shaded") else "0", str(options.step), "2",
                         str(options.runs)], capture_output=True, text=True, check=True,
                        env=dict(os.environ, OMP_WAIT_POLICY="passive")).stdout
            every, _, samples, few, _, fewer, off, _ = map(float, said.split())
            print(f"{scene:28} {1e3 * peer:6.0f} {1e3 * every:6.0f} {1e3 * few:6.0f} {peer / every:6.2f} "
                  f"{peer / few:6.2f} {off:6.3f}   samples {samples:.1f} M, {fewer:.1f} M", flush=True)


if __name__ == "__main__":
    sys.exit(main())
