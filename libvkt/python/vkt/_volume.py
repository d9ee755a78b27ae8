"""Volumes: voxels, where they lie in the world, what their values mean, and how they were made."""
# SPDX-License-Identifier: MIT
import ctypes
import itertools
import json
import os
import pickle
from typing import Any, Sequence

import numpy as np

from . import _dlpack, _notebook, _operations, _picture
from ._library import Description, Error, ReleaseFunction, check, library, option_words, text_of, words_of

# Arrays whose voxels volumes use in place, until no volume uses them any more.
_kept = {}
_keys = itertools.count(1)


@ReleaseFunction
def _release(key, _kept=_kept):
    _kept.pop(key, None)


def _create(header, array, in_place):
    """The handle of a volume of these fields of a header and of this array, contiguous and in native order."""
    key = next(_keys)
    handle = ctypes.c_void_p()
    if in_place:
        _kept[key] = array
    try:
        check(library.vkt_create_from_header(header.encode(), array.ctypes.data, array.nbytes,
                                             _release if in_place else ReleaseFunction(), key, ctypes.byref(handle)))
    except Error:
        _kept.pop(key, None)
        raise
    return handle


class Volume:
    """A volume: voxels, where they lie in the world, and what their values mean. It cannot be changed.

    Volume(array) takes a copy of an array [z, y, x]; with copy=False it uses the array in place, if that is contiguous
    and in the byte order of the machine, and the array must not change as long as the volume and what was made of it
    exist. Geometry and values are given by name or taken from another volume, `like`. dims, spacing and origin are in the
    order x, y, z; the columns of the 3 x 3 matrix direction are the world directions in which x, y and z grow, so that
    world = origin + direction @ (spacing * index).

    numpy.asarray(volume) and numpy.from_dlpack(volume), or that of any package for memory of the host, show the voxels in
    place. Volumes can be pickled, with geometry, value map, attributes and history."""

    def __init__(self, array: Any, *, spacing: "float | Sequence[float] | None" = None,
                 origin: "Sequence[float] | None" = None, direction: Any = None, slope: "float | None" = None,
                 intercept: "float | None" = None, units: "str | None" = None, like: "Volume | None" = None,
                 copy: bool = True):
        array = np.asarray(array)
        if array.dtype == bool:
            array = array.view(np.uint8)
        if not 1 <= array.ndim <= 3 or array.size == 0:
            raise Error(f"an array of shape {array.shape} is no volume: it takes [z, y, x]", 2)
        if array.dtype.kind not in "iuf" or array.dtype.itemsize > 8:
            raise Error(f"voxels cannot be {array.dtype}: integers and floats of up to 64 bits can", 2)
        fits = array.flags.c_contiguous and array.flags.aligned and array.dtype.isnative
        if not copy and not fits:
            raise Error("this array cannot be used in place", 2,
                        "it is to be contiguous, [z, y, x], and in the byte order of the machine; or say copy=True")
        array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))
        told = like.header if like is not None else {}
        direction = (np.transpose(np.asarray(direction, float).reshape(3, 3)).tolist() if direction is not None
                     else told.get("direction", np.eye(3).tolist()))
        header = {
            "kind": "structured",
            "dims": ((1,) * (3 - array.ndim) + array.shape)[::-1],
            "dtype": array.dtype.name,
            "spacing": np.broadcast_to(np.asarray(spacing, float), 3).tolist() if spacing is not None
            else told.get("spacing", [1, 1, 1]),
            "origin": np.asarray(origin, float).reshape(3).tolist() if origin is not None
            else told.get("origin", [0, 0, 0]),
            "direction": direction,
            "slope": float(slope) if slope is not None else told.get("slope", 1),
            "intercept": float(intercept) if intercept is not None else told.get("intercept", 0),
            "units": units if units is not None else told.get("units", ""),
        }
        space = told.get("attributes", {}).get("space")
        if space:
            header["attributes"] = {"space": space}
        try:
            text = json.dumps(header, allow_nan=False)
        except ValueError:
            raise Error("spacing, origin, direction, slope and intercept are to be finite", 2) from None
        self._handle = _create(text, array, not copy)

    @classmethod
    def _of(cls, handle):
        volume = cls.__new__(cls)
        volume._handle = handle
        return volume

    def __del__(self, _free=library.vkt_free):
        if getattr(self, "_handle", None):
            _free(self._handle)

    # Volumes cannot be changed, so that one serves as its own copy; a second owner of the handle would free it again.
    def __copy__(self) -> "Volume":
        return self

    def __deepcopy__(self, memo: "dict[int, Any]") -> "Volume":
        return self

    def __reduce_ex__(self, protocol: Any) -> Any:
        header = text_of(library.vkt_header, self._handle)
        if self.hierarchical:
            from ._stream import stream_bytes
            return _from_stream, (stream_bytes(self),)
        # From protocol 5 on whoever pickles may take the voxels without a copy.
        array = self.array
        return _from_voxels, (header, pickle.PickleBuffer(array) if protocol >= 5 else array.tobytes())

    def __repr__(self) -> str:
        dims = " x ".join(str(n) for n in self.dims)
        return f"<vkt.Volume {dims} {self.dtype.name}{', hierarchical' if self.hierarchical else ''}>"

    @property
    def __array_interface__(self) -> "dict[str, Any]":
        pointer = ctypes.c_void_p()
        check(library.vkt_voxels(self._handle, ctypes.byref(pointer), None))
        return {"version": 3, "shape": self.dims[::-1], "typestr": self.dtype.str, "data": (pointer.value, True)}

    def __dlpack__(self, *, stream: Any = None, max_version: "tuple[int, int] | None" = None, dl_device: Any = None,
                   copy: "bool | None" = None) -> Any:
        return _dlpack.capsule(self.array, stream, max_version, dl_device, copy)

    def __dlpack_device__(self) -> "tuple[int, int]":
        return _dlpack.HOST

    @property
    def _description(self):
        description = Description()
        check(library.vkt_describe(self._handle, ctypes.byref(description)))
        return description

    @property
    def array(self) -> np.ndarray:
        """The stored values in place, [z, y, x]. Read-only, so that the history of the volume stays true; make a new
        volume of a changed copy: vkt.Volume(changed, like=volume)."""
        return np.asarray(self)

    @property
    def dims(self) -> "tuple[int, int, int]":
        """Voxels along x, y and z."""
        return tuple(self._description.dims)

    @property
    def dtype(self) -> np.dtype:
        return np.dtype(self._description.dtype.decode())

    @property
    def spacing(self) -> "tuple[float, float, float]":
        return tuple(self._description.spacing)

    @property
    def origin(self) -> "tuple[float, float, float]":
        """Where in the world the centre of the first voxel is."""
        return tuple(self._description.origin)

    @property
    def direction(self) -> np.ndarray:
        return np.array(self._description.direction[:]).reshape(3, 3).T

    @property
    def slope(self) -> float:
        """Physical values are slope * array + intercept."""
        return self._description.slope

    @property
    def intercept(self) -> float:
        return self._description.intercept

    @property
    def units(self) -> str:
        return self._description.units.decode()

    @property
    def space(self) -> str:
        """What the axes of the world mean, for example left-posterior-superior; empty if unknown."""
        return self._description.space.decode()

    @property
    def hierarchical(self) -> bool:
        """True for adaptive meshes, which have no array: apply("resample", cells="50M") makes a grid."""
        return bool(self._description.hierarchical)

    @property
    def header(self) -> "dict[str, Any]":
        """All that is known about the volume, its attributes and history too, as `vkt info --json` prints it."""
        return json.loads(text_of(library.vkt_header, self._handle))

    @property
    def report(self) -> "dict[str, Any] | None":
        """What the operation that made this volume reported: a dict of the sizes that "label" found, of the threshold
        that "threshold" with otsu=True found. None if there is nothing to report."""
        text = library.vkt_report(self._handle).decode()
        return json.loads(text) if text else None

    def stats(self, **options: Any) -> "dict[str, Any]":
        """Count, extremes, mean and so on: apply("stats", **options) of this volume. None is not a number."""
        return self.apply("stats", **options)

    def write(self, path: "str | os.PathLike[str]", **options: Any) -> None:
        """Writes a file whose name tells the format. Options are those of `vkt write`: force, compress, format."""
        check(library.vkt_write(self._handle, os.fsencode(path), *words_of(option_words(options))))

    def apply(self, name: str, *arguments: Any, **options: Any) -> Any:
        """vkt.apply() with this volume as the first input: apply("flip x"), apply("diff", other)["rmse"]."""
        return _operations.apply_words(name, (self, *arguments), options)

    def render(self, **options: Any) -> Any:
        """vkt.render() of this volume."""
        return _picture.drawn(self, options, 4)

    def transform(self, what: Any, *others: "Volume", **options: Any) -> "Volume":
        """vkt.transform() of this volume."""
        return _operations.transformed(self, what, others, options)

    def to_xarray(self) -> Any:
        """vkt.to_xarray() of this volume."""
        from ._xarray import to_xarray
        return to_xarray(self)

    def _repr_html_(self) -> str:
        """For notebooks: three slices through the middle, as grey from the 1st to the 99th percentile, and a
        picture."""
        return _notebook.html(self)


def _from_voxels(header, voxels):
    """A volume again of what __reduce_ex__ gave; its voxels are those of the pickle."""
    array = np.frombuffer(voxels, np.dtype(json.loads(header)["dtype"]))
    return Volume._of(_create(header, array, array.flags.aligned))


def _from_stream(data):
    from ._stream import volume_of
    return volume_of(data)


def read(path: "str | os.PathLike[str]", **options: Any) -> Volume:
    """The volume of a file of any format that vkt knows, or of a segment of shared memory, "shm:NAME", which is mapped
    and not copied. Options are those of `vkt read`: dims, dtype, skip, endian, spacing, format, variable, roi, and
    trust_paths=True for headers that may name files anywhere; and index for a file that holds several volumes."""
    handle = ctypes.c_void_p()
    check(library.vkt_read(os.fsencode(path), *words_of(option_words(options)), ctypes.byref(handle)))
    return Volume._of(handle)


def from_dlpack(array: Any, **geometry: Any) -> Volume:
    """A volume of the memory of an array [z, y, x] of another package, in the host's memory and used in place; it must not
    change as long as the volume and what was made of it exist. Geometry is that of vkt.Volume()."""
    return Volume(np.from_dlpack(array), copy=False, **geometry)
