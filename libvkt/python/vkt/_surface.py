"""Surfaces through volumes, as triangles."""
# SPDX-License-Identifier: MIT
import ctypes
import json
import os
import warnings
from typing import Any

import numpy as np

from ._library import check, library, option_words, word_of, words_of


class _View(ctypes.Structure):
    _fields_ = [("label", ctypes.c_int64), ("vertices", ctypes.c_int64), ("coordinates", ctypes.POINTER(ctypes.c_double)),
                ("triangles", ctypes.c_int64), ("corners", ctypes.POINTER(ctypes.c_uint32))]


class Surface:
    """Triangles of a value or of labels; surface() makes them. `report` is what `vkt mesh` prints: vertices, triangles,
    area and volume in world units, Euler characteristic; of labels a list."""

    report: Any

    def __init__(self, handle: Any) -> None:
        self._handle = handle
        self.report = json.loads(library.vkt_surface_report(handle))

    def __del__(self) -> None:
        if library is not None and getattr(self, "_handle", None):
            library.vkt_free_surface(self._handle)

    def __len__(self) -> int:
        """How many parts: one of a value, one of each label."""
        return int(library.vkt_surface_parts(self._handle))

    def _part(self, part):
        view = _View()
        check(library.vkt_surface_part(self._handle, part, ctypes.byref(view)))
        return view

    def vertices(self, part: int = 0) -> np.ndarray:
        """Their places in the world, [vertex, 3], float64."""
        view = self._part(part)
        shape = view.vertices, 3
        return np.ctypeslib.as_array(view.coordinates, shape).copy() if view.vertices else np.zeros(shape)

    def triangles(self, part: int = 0) -> np.ndarray:
        """Three vertices each, counterclockwise seen from outside, [triangle, 3], uint32."""
        view = self._part(part)
        shape = view.triangles, 3
        return np.ctypeslib.as_array(view.corners, shape).copy() if view.triangles else np.zeros(shape, np.uint32)

    def label(self, part: int = 0) -> int:
        """The label that a part is the surface of; 0 of a value."""
        return int(self._part(part).label)

    def write(self, path: "str | os.PathLike[str]", **options: Any) -> None:
        """A file .stl, .ply, .obj or .vtp. Options: format, ascii, normals, force."""
        check(library.vkt_surface_write(self._handle, word_of(path), *words_of(option_words(options))))


def surface(volume: "Volume", **options: Any) -> "Surface":
    """The closed surface at a physical value, surface(volume, iso=0.5), or around each label, surface(volume,
    labels=True), with the options of `vkt mesh` (man vkt-mesh). A value that is nowhere in the volume is a warning."""
    if not hasattr(volume, "_handle"):
        raise TypeError(f"surface() takes a vkt.Volume, and this is {type(volume).__name__}: vkt.Volume(array)")
    handle = ctypes.c_void_p()
    check(library.vkt_make_surface(volume._handle, *words_of(option_words(options)), ctypes.byref(handle)))
    result = Surface(handle)
    for remark in filter(None, library.vkt_surface_remarks(handle).decode().splitlines()):
        warnings.warn(f"surface: {remark}", RuntimeWarning, stacklevel=2)
    return result
