"""Volumes: voxels, where they lie in the world, what their values mean, and how they were made."""
# SPDX-License-Identifier: MIT
import ctypes
import itertools
import json
import os
import pickle
from typing import Any, Sequence

import numpy as np

from . import _cuda, _dlpack, _notebook, _operations, _picture
from ._library import Description, Error, ReleaseFunction, check, library, option_words, text_of, word_of, words_of

# Arrays whose voxels volumes use in place, until no volume uses them any more.
_kept = {}
_keys = itertools.count(1)


@ReleaseFunction
def _release(key, _kept=_kept):
    _kept.pop(key, None)


def _create(header, array, in_place):
    """The handle of a volume of these fields of a header and of this array, contiguous and in native order."""
    on_gpu = isinstance(array, _cuda.DeviceArray)
    make = library.vkt_create_on_device if on_gpu else library.vkt_create_from_header
    key = next(_keys)
    handle = ctypes.c_void_p()
    if in_place:
        _kept[key] = array
    try:
        check(make(header.encode(), array.pointer if on_gpu else array.ctypes.data, array.nbytes,
                   _release if in_place else ReleaseFunction(), key, ctypes.byref(handle)))
    except Error:
        _kept.pop(key, None)
        raise
    return handle


class Volume:
    """A volume: voxels, where they lie in the world, and what their values mean. It cannot be changed.

    Volume(array) takes a copy of an array [z, y, x], since whoever else has the array may change it, and a volume is what
    its history says; with copy=False it uses the array in place, if that is contiguous
    and in the byte order of the machine, and the array must not change as long as the volume and what was made of it
    exist. Geometry and values are given by name or taken from another volume, `like`. dims, spacing and origin are in the
    order x, y, z; the columns of the 3 x 3 matrix direction are the world directions in which x, y and z grow, so that
    world = origin + direction @ (spacing * index).

    A masked array is refused where something is masked: array.filled(value) says what that is to be.

    numpy.asarray(volume) and numpy.from_dlpack(volume), or that of any package for memory of the host, show the voxels in
    place. Volumes can be pickled, with geometry, value map, attributes, history and report.

    Arrays of a GPU, of CuPy, PyTorch, Numba, JAX, are taken as well: the voxels stay there, and operations on a GPU
    (device="gpu", or vkt.policy) leave their results there. Such volumes have __cuda_array_interface__ and hand DLPack the
    memory of the GPU; numpy.asarray(volume) brings the voxels to the host, migrate("gpu") to the GPU."""

    def __init__(self, array: Any, *, spacing: "float | Sequence[float] | None" = None,
                 origin: "Sequence[float] | None" = None, direction: Any = None, slope: "float | None" = None,
                 intercept: "float | None" = None, units: "str | None" = None, like: "Volume | None" = None,
                 copy: bool = True):
        if np.ma.is_masked(array):
            raise Error("a volume has no mask, and this array leaves values out by one", 2,
                        "say what they are to be: array.filled(0); the mask is a volume of its own: "
                        "vkt.Volume(numpy.ma.getmaskarray(array))")
        on_gpu = _cuda.array_of(array)
        array = np.asarray(array) if on_gpu is None else on_gpu
        if array.dtype == bool:
            array = array.view(np.uint8)
        if not 1 <= array.ndim <= 3 or array.size == 0:
            raise Error(f"an array of shape {array.shape} is no volume: it takes [z, y, x]", 2)
        if array.dtype.kind not in "iuf" or array.dtype.itemsize > 8:
            raise Error(f"voxels cannot be {array.dtype}: integers and floats of up to 64 bits can", 2)
        if on_gpu is not None and not (array.contiguous and array.dtype.isnative):
            raise Error("an array of a GPU is to be contiguous, [z, y, x]", 2, "make a contiguous copy of it")
        fits = on_gpu is not None or (array.flags.c_contiguous and array.flags.aligned and array.dtype.isnative)
        if not copy and not fits:
            raise Error("this array cannot be used in place", 2,
                        "it is to be contiguous, [z, y, x], and in the byte order of the machine; or say copy=True")
        if on_gpu is None:
            array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))
        told = like.header if like is not None else {}
        direction = (np.transpose(np.asarray(direction, float).reshape(3, 3)).tolist() if direction is not None
                     else told.get("direction", np.eye(3).tolist()))
        header = {
            "kind": "structured",
            "dims": ((1,) * (3 - array.ndim) + array.shape)[::-1],
            "dtype": array.dtype.name,
            "spacing": _three("spacing", spacing) if spacing is not None else told.get("spacing", [1, 1, 1]),
            "origin": _three("origin", origin) if origin is not None else told.get("origin", [0, 0, 0]),
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
            return _from_stream, (stream_bytes(self), self._reported())
        # From protocol 5 on whoever pickles may take the voxels without a copy.
        array = self.array
        return _from_voxels, (header, pickle.PickleBuffer(array) if protocol >= 5 else array.tobytes(), self._reported())

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
        device = self.__dlpack_device__() if dl_device is None else tuple(int(n) for n in dl_device)
        if device[0] != _dlpack.GPU:
            return _dlpack.capsule(self.array, stream, max_version, device, copy)
        if copy:
            raise BufferError("the voxels are not copied on the GPU: copy what you take")
        try:
            array = self._on_gpu()
        except Error as e:
            raise BufferError(str(e)) from None
        if device[1] != self._residence()[1]:
            raise BufferError(f"the voxels are on GPU {self._residence()[1]}")
        return _dlpack.capsule(array, None, max_version, device, False)  # all work on them is done, for any stream

    def __dlpack_device__(self) -> "tuple[int, int]":
        host, gpu = self._residence()
        return _dlpack.HOST if host or gpu < 0 else (_dlpack.GPU, gpu)

    def __getattr__(self, name):
        # An attribute of volumes on a GPU alone, since packages take its presence to mean that they are there.
        if name == "__cuda_array_interface__" and self._residence()[1] >= 0:
            array = self._on_gpu()
            return {"version": 3, "shape": array.shape, "typestr": array.dtype.str, "data": (array.pointer, True),
                    "strides": None, "stream": None}
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def _residence(self):
        """Whether the voxels are in memory of the host, and the index of the GPU that has them, or -1."""
        host, gpu = ctypes.c_int(), ctypes.c_int()
        check(library.vkt_residence(self._handle, ctypes.byref(host), ctypes.byref(gpu)))
        return bool(host.value), gpu.value

    def _on_gpu(self):
        """The voxels on a GPU, brought there if they are not."""
        pointer = ctypes.c_void_p()
        check(library.vkt_device_voxels(self._handle, ctypes.byref(pointer), None, None))
        return _cuda.DeviceArray(self, pointer.value, self.dims[::-1], self.dtype)

    @property
    def devices(self) -> "tuple[str, ...]":
        """Where the voxels are: ("cpu",), ("gpu:0",) or both. Operations move them just before use."""
        host, gpu = self._residence()
        return ("cpu",) * host + ((f"gpu:{gpu}",) if gpu >= 0 else ())

    def migrate(self, device: str) -> "Volume":
        """Brings the voxels to "cpu", "gpu" or "gpu:N" before use; what a GPU has already stays on that one. Returns the
        volume itself."""
        check(library.vkt_migrate(self._handle, device.encode()))
        return self

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
        text = self._reported()
        return json.loads(text) if text else None

    def _reported(self):
        kept = getattr(self, "_report", None)  # of a pickle; the library has it of operations only
        return library.vkt_report(self._handle).decode() if kept is None else kept

    def stats(self, **options: Any) -> "dict[str, Any]":
        """Count, extremes, mean and so on: apply("stats", **options) of this volume. None is not a number."""
        return self.apply("stats", **options)

    def write(self, path: "str | os.PathLike[str]", **options: Any) -> None:
        """Writes a file whose name tells the format. Options are those of `vkt write`: force, compress, format; into an
        HDF5 dataset or a Zarr array that is there, write("file.h5:/data", at=(x, y, z), force=True)."""
        check(library.vkt_write(self._handle, word_of(path), *words_of(option_words(options))))

    def apply(self, name: str, *arguments: Any, **options: Any) -> Any:
        """vkt.apply() with this volume as the first input: apply("flip x"), apply("diff", other)["rmse"]."""
        return _operations.apply_words(name, (self, *arguments), options)

    def render(self, **options: Any) -> Any:
        """vkt.render() of this volume."""
        return _picture.drawn(self, options, 4)

    def transform(self, what: Any, *others: "Volume", **options: Any) -> "Volume":
        """vkt.transform() of this volume."""
        return _operations.transformed(self, what, others, options)

    def to_xarray(self, stored: bool = False) -> Any:
        """vkt.to_xarray() of this volume."""
        from ._xarray import to_xarray
        return to_xarray(self, stored)

    def _repr_html_(self) -> str:
        """For notebooks: three slices through the middle, as grey from the 1st to the 99th percentile, and a
        picture."""
        return _notebook.html(self)


def _three(name, value):
    numbers = np.asarray(value, float)
    if numbers.size == 3:
        return numbers.reshape(3).tolist()
    if name == "spacing" and numbers.size == 1:  # of cubes
        return [float(numbers.reshape(()))] * 3
    raise Error(f"{name} is three numbers, for x, y and z, and these are {numbers.size}", 2)


def _from_voxels(header, voxels, report=None):
    """A volume again of what __reduce_ex__ gave; its voxels are those of the pickle."""
    array = np.frombuffer(voxels, np.dtype(json.loads(header)["dtype"]))
    volume = Volume._of(_create(header, array, array.flags.aligned))
    volume._report = report
    return volume


def _from_stream(data, report=None):
    from ._stream import volume_of
    volume = volume_of(data)
    volume._report = report
    return volume


def read(path: "str | os.PathLike[str]", **options: Any) -> Volume:
    """The volume of a file of any format that vkt knows, or of a segment of shared memory, "shm:NAME", which is mapped
    and not copied. Options are those of `vkt read`: dims, dtype, skip, endian, spacing, format, variable, roi,
    personal, and trust_paths=True for headers that may name files anywhere; and index, counted from 0, for a file that
    holds several volumes, which read_series() reads all. roi may be slices or pairs in the order x, y, z: roi=numpy.s_[0:10, :, 4:]."""
    handle = ctypes.c_void_p()
    check(library.vkt_read(word_of(path), *words_of(option_words(options)), ctypes.byref(handle)))
    return Volume._of(handle)


def write(volume: "Volume | np.ndarray", path: "str | os.PathLike[str]", **options: Any) -> None:
    """volume.write(path, **options); an array becomes a volume before, with the axes z, y, x."""
    (volume if isinstance(volume, Volume) else Volume(volume)).write(path, **options)


def from_dlpack(array: Any, *, copy: bool = False, **geometry: Any) -> Volume:
    """A volume of the memory of an array [z, y, x] of another package, of the host or of a GPU, used in place; it must not
    change as long as the volume and what was made of it exist. With copy=True a copy of it, in whatever order the array
    has its elements. Geometry is that of vkt.Volume()."""
    on_gpu = array.__dlpack_device__()[0] == _dlpack.GPU
    return Volume(_dlpack.taken(array) if on_gpu else np.from_dlpack(array), copy=copy, **geometry)
