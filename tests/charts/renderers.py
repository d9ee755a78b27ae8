#!/usr/bin/python3
# Error against seconds of renderers that are not vkt, on a volume and a camera that charts.py names: rows of CSV.
# SPDX-License-Identifier: MIT
#
#   renderers.py vtk-march VOLUME.npy REFERENCE.npy   VTK's fixed-point ray casting; needs a display (Xvfb does)
#   renderers.py mitsuba VOLUME.npy SIZE              Mitsuba 3, paths in a medium under a white sky
#
# Columns: variant, seconds of a frame with the data loaded, error: of marching the largest one, in levels of 255, from
# what march() gives; of paths the root mean square, in shares of the mean, from the renderer's own limit.
import sys
import time

import numpy as np

# The camera, in widths of the volume from its centre; 30 degrees from top to bottom, z upwards.
eye = np.array((1.1, -2.0, 0.8))
# Extinction a voxel where the value is 255, less in proportion: of white fog for marching, and for paths with an albedo.
thin, thick, albedo = 0.1, 0.25, 0.787


def march(v, size):
    """The opacity of each pixel, top row first, in float64: trilinear values every twentieth of a voxel, by SciPy."""
    from scipy import ndimage

    n = v.shape[0]
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    half = np.tan(np.radians(15))
    at = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(at * half, -at * half)
    rays = forward + x[..., None] * right + y[..., None] * up
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    centre, step = np.linalg.norm(eye) * n, 0.05
    v = v.astype(np.float64)
    depth = np.zeros((size, size))
    for t in np.arange(centre - 0.9 * n, centre + 0.9 * n, step):
        voxels = eye * n + t * rays + (n - 1) / 2
        inside = np.all(np.abs(voxels - (n - 1) / 2) <= n / 2, axis=-1)
        sample = ndimage.map_coordinates(v, voxels[inside][:, ::-1].T, order=1, mode="nearest")
        depth[inside] += step * thin / 255 * sample
    return -np.expm1(-depth)


def best_of(function, runs=3):
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - begin)
    return min(times), result


def vtk_march(v, reference):
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
    from vtkmodules.vtkRenderingCore import (vtkColorTransferFunction, vtkRenderer, vtkRenderWindow, vtkVolume,
                                             vtkVolumeProperty, vtkWindowToImageFilter)
    from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  a window is needed, if only to hold the picture
    import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401

    n, size = v.shape[0], reference.shape[0]
    image = vtkImageData()
    image.SetDimensions(n, n, n)
    image.SetOrigin(*[-(n - 1) / 2] * 3)
    image.GetPointData().SetScalars(numpy_to_vtk(v.reshape(-1), deep=True))
    colour, opacities = vtkColorTransferFunction(), vtkPiecewiseFunction()
    colour.AddRGBPoint(0, 1, 1, 1)
    for value in range(256):
        opacities.AddPoint(value, -np.expm1(-thin / 255 * value))
    look = vtkVolumeProperty()
    look.SetColor(colour)
    look.SetScalarOpacity(opacities)
    look.SetScalarOpacityUnitDistance(1)
    look.SetInterpolationTypeToLinear()
    mapper = vtkFixedPointVolumeRayCastMapper()
    mapper.SetInputData(image)
    mapper.AutoAdjustSampleDistancesOff()
    mapper.SetImageSampleDistance(1)
    volume = vtkVolume()
    volume.SetMapper(mapper)
    volume.SetProperty(look)
    renderer, window = vtkRenderer(), vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(size, size)
    window.AddRenderer(renderer)
    renderer.AddVolume(volume)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*(eye * n))
    camera.SetFocalPoint(0, 0, 0)
    camera.SetViewUp(0, 0, 1)
    camera.SetViewAngle(30)
    renderer.ResetCameraClippingRange()

    def frame(step):
        mapper.SetSampleDistance(step)
        window.Render()

    def picture():
        grab = vtkWindowToImageFilter()
        grab.SetInput(window)
        grab.ReadFrontBufferOff()
        grab.Update()
        return vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).astype(float)

    for step in (4, 2, 1, 0.5, 0.25):
        seconds, _ = best_of(lambda: frame(step))
        # Rows of the window come from below.
        yield f"step {step:g}", seconds, np.max(np.abs(picture().reshape(size, size, -1)[::-1, :, 0] - 255 * reference))


def mitsuba(v, size):
    import mitsuba as mi

    mi.set_variant("scalar_rgb")  # the LLVMs of Debian 12 cannot compile what the others need for AVX-512
    n = v.shape[0]
    grid = (thick / 255 * v.astype(np.float32))[..., None]
    to_world = mi.ScalarTransform4f().scale(n).translate([-0.5] * 3)
    scene = mi.load_dict({
        "type": "scene",
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
        "integrator": {"type": "volpath", "max_depth": -1, "rr_depth": 1000},
        "sensor": {
            "type": "perspective", "fov": 30, "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at((eye * n).tolist(), [0, 0, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        },
        "cube": {
            "type": "cube", "to_world": mi.ScalarTransform4f().scale(n / 2), "bsdf": {"type": "null"},
            "interior": {
                "type": "heterogeneous", "albedo": albedo, "scale": 1.0, "phase": {"type": "isotropic"},
                "sigma_t": {"type": "gridvolume", "grid": mi.VolumeGrid(grid), "to_world": to_world,
                            "use_grid_bbox": False, "filter_type": "trilinear"},
            },
        },
    })

    def draw(paths, seed):
        return np.array(mi.render(scene, spp=paths, seed=seed))[..., :3].mean(axis=-1)

    limit = np.mean([draw(256, 1000 + i) for i in range(2)], axis=0)
    for paths in (4, 16, 64):
        seconds, result = best_of(lambda: draw(paths, paths), 2)
        # The limit's own noise is that of 512 paths.
        noise = np.mean((result - limit) ** 2) / (1 + paths / 512)
        yield f"spp {paths}", seconds, np.sqrt(noise) / limit.mean()


if __name__ == "__main__":
    volume = np.load(sys.argv[2])
    rows = vtk_march(volume, np.load(sys.argv[3])) if sys.argv[1] == "vtk-march" else mitsuba(volume, int(sys.argv[3]))
    for variant, seconds, error in rows:
        print(f"{variant},{seconds},{error}", flush=True)
