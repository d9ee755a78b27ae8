"""Volumes in Python: read, written, measured and worked on by the operations of the command vkt.

    import vkt
    volume = vkt.read("volume.nrrd")
    smooth = vkt.filter.gaussian(volume, sigma=2)
    turned = vkt.rotate(smooth, axis="z", angle=30)
    turned.array                      # numpy, [z, y, x], the voxels in place
    turned.write("turned.nrrd", force=True)

Every operation is a function, whose help tells its options, their units and its accuracy: help(vkt.filter.gaussian).
vkt.apply() takes the words of the command line instead; vkt.operations() lists them. What only the program does, a window
among it, is vkt.view(), vkt.slim(), vkt.image_diff(), vkt.image_mean() and, of all others, vkt.command().
"""
# SPDX-License-Identifier: MIT
from . import _operations
from ._command import command, image_diff, image_join, image_mean, slim, view
from ._library import Error, version as __version__
from ._operations import apply, operations, transform, trim
from ._picture import render
from ._pieces import brick, merge, split, stack
from ._policy import policy
from ._series import Series, read_series, write_series
from ._stream import read_stream, write_stream
from ._surface import Surface, surface
from ._volume import Volume, from_dlpack, read, write
from ._xarray import from_xarray, to_xarray

for _public in Error, Series, Surface, Volume, policy:  # as messages and pickles name them
    _public.__module__ = __name__
globals().update(_operations.functions([], __name__))

from . import filter, make  # noqa: E402

__all__ = ["Error", "Series", "Surface", "Volume", "apply", "brick", "command", "filter", "from_dlpack", "from_xarray",
           "image_diff", "image_join", "image_mean", "make", "merge", "operations", "policy", "read", "read_series",
           "read_stream", "render", "slim", "split", "stack", "surface", "to_xarray", "transform", "trim", "view",
           "write", "write_series", "write_stream"]
