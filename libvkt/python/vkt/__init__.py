"""Volumes in Python: read, written, measured and worked on by the operations of the command vkt.

    import vkt
    volume = vkt.read("volume.nrrd")
    smooth = volume.apply("filter gaussian", sigma=2)
    smooth.array                      # numpy, [z, y, x], the voxels in place
    smooth.write("smooth.nrrd", force=True)

Operations, their options and the values these take are those of the command line: `vkt help`, `man vkt-filter`.
"""
# SPDX-License-Identifier: MIT
import base64 as _base64
import ctypes
import html as _html
import json as _json
import os as _os
import shlex as _shlex
import struct as _struct
import warnings as _warnings
import zlib as _zlib

import numpy as _np

__all__ = ["Error", "Volume", "apply", "operations", "read", "render", "transform", "trim"]

_library = ctypes.CDLL(_os.path.join(_os.path.dirname(_os.path.abspath(__file__)), "_vkt.so"))


class _Description(ctypes.Structure):
    _fields_ = [
        ("dims", ctypes.c_int64 * 3),
        ("dtype", ctypes.c_char_p),
        ("origin", ctypes.c_double * 3),
        ("spacing", ctypes.c_double * 3),
        ("direction", ctypes.c_double * 9),
        ("slope", ctypes.c_double),
        ("intercept", ctypes.c_double),
        ("units", ctypes.c_char_p),
        ("hierarchical", ctypes.c_int),
        ("space", ctypes.c_char_p),
    ]


_VoxelFunction = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_double,
                                  ctypes.c_void_p)


def _declare():
    volume, size, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
    words, out = ctypes.POINTER(ctypes.c_char_p), ctypes.POINTER(ctypes.c_void_p)
    description = ctypes.POINTER(_Description)
    signatures = {
        "vkt_version": (text, []),
        "vkt_error": (text, []),
        "vkt_error_hint": (text, []),
        "vkt_operations": (words, []),
        "vkt_measures": (ctypes.c_int, [text]),
        "vkt_read": (ctypes.c_int, [text, words, size, out]),
        "vkt_default_description": (None, [description]),
        "vkt_create": (ctypes.c_int, [description, ctypes.c_void_p, out]),
        "vkt_free": (None, [volume]),
        "vkt_describe": (ctypes.c_int, [volume, description]),
        "vkt_voxels": (ctypes.c_int, [volume, out, ctypes.POINTER(size)]),
        "vkt_header": (ctypes.c_int, [volume, out]),
        "vkt_write": (ctypes.c_int, [volume, text, words, size]),
        "vkt_apply": (ctypes.c_int, [words, size, ctypes.POINTER(volume), size, out]),
        "vkt_transform": (ctypes.c_int, [volume, _VoxelFunction, ctypes.c_void_p, words, size, out]),
        "vkt_remarks": (text, [volume]),
        "vkt_report": (text, [volume]),
        "vkt_measure": (ctypes.c_int, [words, size, ctypes.POINTER(volume), size, out]),
        "vkt_render": (ctypes.c_int, [volume, words, size, out]),
        "vkt_picture_width": (ctypes.c_int, [volume]),
        "vkt_picture_height": (ctypes.c_int, [volume]),
        "vkt_picture_bytes": (ctypes.POINTER(ctypes.c_ubyte), [volume]),
        "vkt_picture_light": (ctypes.POINTER(ctypes.c_float), [volume]),
        "vkt_picture_remarks": (text, [volume]),
        "vkt_picture_png": (ctypes.c_int, [volume, out, ctypes.POINTER(size)]),
        "vkt_free_picture": (None, [volume]),
        "vkt_trim": (size, []),
        "vkt_free_text": (None, [ctypes.c_void_p]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(_library, name)
        function.restype, function.argtypes = result, arguments


_declare()
__version__ = _library.vkt_version().decode()


class Error(Exception):
    """What vkt refused or failed to do. exit_code is that of the command: 1 failure, 2 usage, 3 data, 4 files, 5 memory
    or device; hint says what to do instead and may be empty."""

    def __init__(self, message, exit_code, hint=""):
        super().__init__(f"{message} ({hint})" if hint else message)
        self.exit_code = exit_code
        self.hint = hint


def _check(status):
    if status != 0:
        raise Error(_library.vkt_error().decode(), status, _library.vkt_error_hint().decode())


def _words(words):
    """A list of words for C, and how many they are."""
    return (ctypes.c_char_p * len(words))(*(_os.fsencode(word) for word in words)), len(words)


def _value(value):
    """A Python value as one word: numbers as they are, three of them as X,Y,Z."""
    if isinstance(value, (list, tuple, _np.ndarray)):
        return ",".join(_value(part) for part in value)
    if isinstance(value, (bool, _np.bool_)):
        raise Error(f"{value} is no value; flags are given as name=True", 2)
    if isinstance(value, (float, _np.floating)):
        return repr(float(value))
    if isinstance(value, (type, _np.dtype)):
        return _np.dtype(value).name
    return _os.fspath(value) if isinstance(value, _os.PathLike) else str(value)


def _options(options):
    """Keyword arguments as words: sigma=2 is --sigma=2, force=True is --force, None and False are left out."""
    words = []
    for name, value in options.items():
        name = "--" + name.rstrip("_").replace("_", "-")
        if value is True:
            words.append(name)
        elif isinstance(value, (list, tuple)) and value and all(isinstance(part, str) for part in value):
            words += [name, *value]
        elif value is not None and value is not False:
            words.append(f"{name}={_value(value)}")
    return words


def _text(function, *arguments):
    """The text that a function hands out, freed."""
    pointer = ctypes.c_void_p()
    _check(function(*arguments, ctypes.byref(pointer)))
    try:
        return ctypes.string_at(pointer).decode()
    finally:
        _library.vkt_free_text(pointer)


class _Voxels:
    """Tells numpy where the voxels are. The array keeps this object, and this object the volume."""

    def __init__(self, volume):
        pointer = ctypes.c_void_p()
        _check(_library.vkt_voxels(volume._handle, ctypes.byref(pointer), None))
        self._volume = volume
        self.__array_interface__ = {
            "version": 3,
            "shape": volume.dims[::-1],
            "typestr": volume.dtype.str,
            "data": (pointer.value, True),
        }


class Volume:
    """A volume: voxels, where they lie in the world, and what their values mean.

    Volume(array) takes a copy of an array [z, y, x]; geometry and values are given by name or taken from another
    volume, `like`. dims, spacing and origin are in the order x, y, z; the columns of the 3 x 3 matrix direction are the
    world directions in which x, y and z grow, so that world = origin + direction @ (spacing * index)."""

    def __init__(self, array, *, spacing=None, origin=None, direction=None, slope=None, intercept=None, units=None,
                 like=None):
        array = _np.asarray(array)
        if array.dtype == bool:
            array = array.view(_np.uint8)
        if not 1 <= array.ndim <= 3 or array.size == 0:
            raise Error(f"an array of shape {array.shape} is no volume: it takes [z, y, x]", 2)
        if array.dtype.kind not in "iuf" or array.dtype.itemsize > 8:
            raise Error(f"voxels cannot be {array.dtype}: integers and floats of up to 64 bits can", 2)
        array = _np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))
        description = _Description()
        if like is None:
            _library.vkt_default_description(ctypes.byref(description))
        else:
            _check(_library.vkt_describe(like._handle, ctypes.byref(description)))
        description.dims[:] = ((1,) * (3 - array.ndim) + array.shape)[::-1]
        description.dtype = array.dtype.name.encode()
        if spacing is not None:
            description.spacing[:] = _np.broadcast_to(_np.asarray(spacing, float), 3)
        if origin is not None:
            description.origin[:] = origin
        if direction is not None:
            description.direction[:] = _np.asarray(direction, float).reshape(3, 3).T.ravel()
        if slope is not None:
            description.slope = slope
        if intercept is not None:
            description.intercept = intercept
        if units is not None:
            description.units = units.encode()
        handle = ctypes.c_void_p()
        _check(_library.vkt_create(ctypes.byref(description), array.ctypes.data, ctypes.byref(handle)))
        self._handle = handle

    @classmethod
    def _of(cls, handle):
        volume = cls.__new__(cls)
        volume._handle = handle
        return volume

    def __del__(self, _free=_library.vkt_free):
        if getattr(self, "_handle", None):
            _free(self._handle)

    # Volumes cannot be changed, so that one serves as its own copy; a second owner of the handle would free it again.
    def __copy__(self):
        return self

    def __deepcopy__(self, memo):
        return self

    def __reduce__(self):
        raise TypeError("a vkt.Volume cannot be pickled: write() it, or pass its array and header")

    def __repr__(self):
        dims = " x ".join(str(n) for n in self.dims)
        return f"<vkt.Volume {dims} {self.dtype.name}{', hierarchical' if self.hierarchical else ''}>"

    def __array__(self, dtype=None, copy=None):
        array = self.array if dtype is None else self.array.astype(dtype, copy=False)
        return array.copy() if copy else array

    @property
    def _description(self):
        description = _Description()
        _check(_library.vkt_describe(self._handle, ctypes.byref(description)))
        return description

    @property
    def array(self):
        """The stored values in place, [z, y, x]. Read-only, so that the history of the volume stays true; make a new
        volume of a changed copy: vkt.Volume(changed, like=volume)."""
        return _np.asarray(_Voxels(self))

    @property
    def dims(self):
        return tuple(self._description.dims)

    @property
    def dtype(self):
        return _np.dtype(self._description.dtype.decode())

    @property
    def spacing(self):
        return tuple(self._description.spacing)

    @property
    def origin(self):
        return tuple(self._description.origin)

    @property
    def direction(self):
        return _np.array(self._description.direction[:]).reshape(3, 3).T

    @property
    def slope(self):
        """Physical values are slope * array + intercept."""
        return self._description.slope

    @property
    def intercept(self):
        return self._description.intercept

    @property
    def units(self):
        return self._description.units.decode()

    @property
    def space(self):
        """What the axes of the world mean, for example left-posterior-superior; empty if unknown."""
        return self._description.space.decode()

    @property
    def hierarchical(self):
        """True for adaptive meshes, which have no array: apply("resample", cells="50M") makes a grid."""
        return bool(self._description.hierarchical)

    @property
    def header(self):
        """All that is known about the volume, its attributes and history too, as `vkt info --json` prints it."""
        return _json.loads(_text(_library.vkt_header, self._handle))

    @property
    def report(self):
        """What the operation that made this volume reported: a dict of the sizes that "label" found, of the threshold
        that "threshold" with otsu=True found. None if there is nothing to report."""
        text = _library.vkt_report(self._handle).decode()
        return _json.loads(text) if text else None

    def stats(self, **options):
        """Count, extremes, mean and so on: apply("stats", **options) of this volume. None is not a number."""
        return self.apply("stats", **options)

    def write(self, path, **options):
        """Writes a file whose name tells the format. Options are those of `vkt write`: force, compress, format."""
        _check(_library.vkt_write(self._handle, _os.fsencode(path), *_words(_options(options))))

    def apply(self, name, *arguments, **options):
        """vkt.apply() with this volume as the first input: apply("flip x"), apply("diff", other)["rmse"]."""
        return _apply(name, (self, *arguments), options)

    def render(self, **options):
        """vkt.render() of this volume."""
        return _render(self, options, 4)

    def _repr_html_(self):
        """For notebooks: three slices through the middle, as grey from the 1st to the 99th percentile, and a
        picture."""
        figures = [] if self.hierarchical else [self._slice(axis) for axis in (2, 1, 0)]
        volume = self
        if not self.hierarchical and self.array.size > 1 << 24:  # a look, not a study
            volume = self.apply("resample", scale=(2.0 ** 24 / self.array.size) ** (1 / 3))
        with _warnings.catch_warnings():
            _warnings.simplefilter("ignore")
            try:
                figures.append(("render", _render(volume, {"size": 256, "format": "png"}, 4), 256, 256))
            except Error as error:
                figures.append((str(error), None, 0, 0))
        cells = "".join(
            f'<figure style="display:inline-block;margin:4px"><img width="{w}" height="{h}" '
            f'src="data:image/png;base64,{_base64.b64encode(png).decode()}"/><figcaption>{name}</figcaption></figure>'
            if png else f"<p>{_html.escape(name)}</p>" for name, png, w, h in figures)
        return f"<div><code>{_html.escape(repr(self))}</code><br/>{cells}</div>"

    def _slice(self, axis):
        """Name, PNG and shown size of the middle slice across an axis of x, y, z; z points upwards."""
        array = self.array
        pixels = _np.take(array, array.shape[2 - axis] // 2, axis=2 - axis)
        if axis != 2:
            pixels = pixels[::-1]
        down, across = [a for a in (2, 1, 0) if a != axis]
        step = -(-max(pixels.shape) // 512)
        pixels = pixels[::step, ::step].astype(float)
        known = pixels[_np.isfinite(pixels)]
        low, high = _np.percentile(known, (1, 99)) if known.size else (0, 1)
        if not low < high:
            low, high = (known.min(), known.max() + 1) if known.size else (0, 1)
        share = _np.nan_to_num((pixels - low) / (high - low), nan=0, posinf=1, neginf=0)
        if self.slope < 0:
            share = 1 - share
        size = _np.array([self.dims[a] * self.spacing[a] for a in (across, down)])
        width, height = (max(1, round(256 * n / size.max())) for n in size)
        return ("xyz"[axis] + f" = {self.dims[axis] // 2}",
                _grey_png(_np.round(255 * _np.clip(share, 0, 1)).astype(_np.uint8)), width, height)

    def transform(self, what, *others, **options):
        """vkt.transform() of this volume."""
        return _transform(self, what, others, options)


def read(path, **options):
    """The volume of a file of any format that vkt knows, or of a segment of shared memory, "shm:NAME", which is mapped
    and not copied. Options are those of `vkt read`: dims, dtype, skip, endian, spacing, format, variable, roi, and
    trust_paths=True for headers that may name files anywhere; and index for a file that holds several volumes."""
    handle = ctypes.c_void_p()
    _check(_library.vkt_read(_os.fsencode(path), *_words(_options(options)), ctypes.byref(handle)))
    return Volume._of(handle)


def apply(name, *arguments, **options):
    """The result of an operation: apply("filter gaussian", volume, sigma=2), apply("flip x", volume),
    apply("arith sub", a, b), apply("make sphere", dims=(64, 64, 64)).

    Operations that make no volume return what they report, as the command prints it with --json: a dict, apply("stats",
    volume, percentiles=50)["p50"], apply("diff", a, b, ssim=True)["ssim"]; of several volumes a list of these. Options
    that name volumes are given as words and volumes: apply("stats", volume, "--labels", labels)["labels"].

    Arguments are volumes and words, in the order of the command line. What was lost on the way, such as values that
    were clipped, is a warning."""
    return _apply(name, arguments, options)


def _apply(name, arguments, options):
    words, inputs = _shlex.split(name), []
    for argument in arguments:
        if isinstance(argument, Volume):
            inputs.append(argument)
            words.append("-")
        else:
            words.append(_value(argument))
    words += _options(options)
    return _applied(name, words, inputs)


def _applied(name, words, inputs):
    handles = (ctypes.c_void_p * len(inputs))(*(volume._handle for volume in inputs))
    if any(_library.vkt_measures(_os.fsencode(" ".join(words[:n]))) for n in (1, 2)):
        return _json.loads(_text(_library.vkt_measure, *_words(words), handles, len(inputs)))
    handle = ctypes.c_void_p()
    _check(_library.vkt_apply(*_words(words), handles, len(inputs), ctypes.byref(handle)))
    return _result(name, handle)


def _result(name, handle, level=5):
    """The volume; what was lost is a warning for whoever called the package, so many calls up."""
    result = Volume._of(handle)
    for remark in _library.vkt_remarks(handle).decode().splitlines():
        _warnings.warn(f"{name}: {remark}", RuntimeWarning, stacklevel=level)
    return result


def transform(volume, what, *others, **options):
    """Every voxel computed: transform(volume, "v * 2 + sin(x / 10)"), transform(volume, "a > v ? a : v", other), or with
    a function of index and value, transform(volume, lambda x, y, z, value: value if z > 10 else 0).

    An expression is that of `vkt transform` (man vkt-transform); others are its volumes a, b, …; options: dtype, roi,
    boundary. A function is called once for every voxel, in the order of memory, and is slower by a factor of hundreds;
    its options are dtype and roi. What it raises stops it and comes out here."""
    return _transform(volume, what, others, options)


def _transform(volume, what, others, options):
    if not callable(what):
        # A blank keeps an expression that begins with a dash from being an option.
        return _applied("transform", ["transform", " " + what, *_options(options)], [volume, *others])
    if others:
        raise Error("a function of index and value takes one volume", 2, "an expression takes several")
    raised = []

    def called(x, y, z, value, _):
        if raised:
            return 0.0
        try:
            return float(what(x, y, z, value))
        except BaseException as error:  # C cannot hand it on
            raised.append(error)
            return 0.0

    handle = ctypes.c_void_p()
    status = _library.vkt_transform(volume._handle, _VoxelFunction(called), None, *_words(_options(options)),
                                    ctypes.byref(handle))
    if raised:
        if status == 0:
            _library.vkt_free(handle)
        raise raised[0]
    _check(status)
    return _result("transform", handle, 4)


def render(volume, **options):
    """A picture of a volume: an array [row, column, channel] of four bytes, red, green and blue in sRGB and alpha, rows
    from the top: render(volume, view="x", size="640x480"), render(volume, render_algo="multi-scattering", noise=1).

    Options are those of `vkt render` (man vkt-render): size, background, camera, transfer function, algorithm. `format`
    says what comes back: "uint8"; "float", linear light of the volume alone, premultiplied, and alpha, as float32;
    "png", the bytes of a file that says how it was made. What was lost is a warning."""
    return _render(volume, options, 4)


def _render(volume, options, level):
    options = dict(options)
    form = options.pop("format", "uint8")
    if form not in ("uint8", "float", "png"):
        raise Error(f"format '{form}' is not one of uint8, float, png", 2)
    if isinstance(options.get("size"), (list, tuple)):
        options["size"] = "x".join(str(int(n)) for n in options["size"])
    words = []
    for name, value in options.items():  # lists of several values are words of their own
        several = name.rstrip("_") in ("iso", "iso_color", "iso_opacity", "rgba_lookup_table", "lut")
        if several and isinstance(value, (list, tuple, _np.ndarray)):
            words += _options({name: [_value(part) for part in _np.ravel(value).tolist()]})
        else:
            words += _options({name: value})
    handle = ctypes.c_void_p()
    _check(_library.vkt_render(volume._handle, *_words(words), ctypes.byref(handle)))
    try:
        for remark in filter(None, _library.vkt_picture_remarks(handle).decode().split("; ")):
            _warnings.warn(f"render: {remark}", RuntimeWarning, stacklevel=level - 1)
        if form == "png":
            data, size = ctypes.c_void_p(), ctypes.c_size_t()
            _check(_library.vkt_picture_png(handle, ctypes.byref(data), ctypes.byref(size)))
            return ctypes.string_at(data, size.value)
        shape = _library.vkt_picture_height(handle), _library.vkt_picture_width(handle), 4
        pixels = (_library.vkt_picture_bytes if form == "uint8" else _library.vkt_picture_light)(handle)
        return _np.ctypeslib.as_array(pixels, shape).copy()
    finally:
        _library.vkt_free_picture(handle)


def _grey_png(pixels):
    """The bytes of a PNG file of an array [row, column] of bytes."""
    def chunk(kind, data):
        return _struct.pack(">I", len(data)) + kind + data + _struct.pack(">I", _zlib.crc32(kind + data))

    height, width = pixels.shape
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", _struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) +
            chunk(b"IDAT", _zlib.compress(rows)) + chunk(b"IEND", b""))


def operations():
    """Names of the operations that apply() knows."""
    list_, names = _library.vkt_operations(), []
    while list_[len(names)] is not None:
        names.append(list_[len(names)].decode())
    return sorted(names)


def trim():
    """Gives memory of volumes that are gone back to the system; returns how many bytes. Until then up to as much as a
    volume may take (VKT_MEMORY) is kept for the next results, since touching fresh memory can cost more than an
    operation. The system takes it back by itself when memory is short."""
    return _library.vkt_trim()
