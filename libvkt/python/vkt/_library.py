"""The C API (libvkt/c/vkt.h) through ctypes, which releases the interpreter lock during every call."""
# SPDX-License-Identifier: MIT
import ctypes
import os
import sys
import threading

import numpy as np


def _loaded():
    """The library. Its threads wait awake for no longer than waking them takes, unless the environment says otherwise:
    for milliseconds, as is usual, they would wait for threads whose processors do other work, a hundred times as long
    as the work takes. The run time reads such settings once, when it is loaded."""
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "_vkt.so")
    if "OMP_WAIT_POLICY" in os.environ or "GOMP_SPINCOUNT" in os.environ:
        return ctypes.CDLL(path)
    os.environ["GOMP_SPINCOUNT"] = "1000"
    try:
        return ctypes.CDLL(path)
    finally:
        del os.environ["GOMP_SPINCOUNT"]


library = _loaded()


class Policy(ctypes.Structure):
    _fields_ = [("device", ctypes.c_char_p), ("threads", ctypes.c_int), ("memory", ctypes.c_size_t)]


class Description(ctypes.Structure):
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


VoxelFunction = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_double,
                                 ctypes.c_void_p)
ReleaseFunction = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
ProgressFunction = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double)  # the user pointer that follows is none


def _declare():
    volume, size, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
    words, out = ctypes.POINTER(ctypes.c_char_p), ctypes.POINTER(ctypes.c_void_p)
    description = ctypes.POINTER(Description)
    signatures = {
        "vkt_version": (text, []),
        "vkt_error": (text, []),
        "vkt_error_hint": (text, []),
        "vkt_operations": (words, []),
        "vkt_read": (ctypes.c_int, [text, words, size, out]),
        "vkt_operation_help": (ctypes.c_int, [text, out]),
        "vkt_create_from_header": (ctypes.c_int, [text, ctypes.c_void_p, size, ReleaseFunction, ctypes.c_void_p, out]),
        "vkt_create_on_device": (ctypes.c_int, [text, ctypes.c_void_p, size, ReleaseFunction, ctypes.c_void_p, out]),
        "vkt_residence": (ctypes.c_int, [volume, ctypes.POINTER(ctypes.c_int), ctypes.POINTER(ctypes.c_int)]),
        "vkt_migrate": (ctypes.c_int, [volume, text]),
        "vkt_device_voxels": (ctypes.c_int, [volume, out, ctypes.POINTER(size), ctypes.POINTER(ctypes.c_int)]),
        "vkt_set_policy": (ctypes.c_int, [ctypes.POINTER(Policy)]),
        "vkt_get_policy": (ctypes.c_int, [ctypes.POINTER(Policy)]),
        "vkt_free": (None, [volume]),
        "vkt_describe": (ctypes.c_int, [volume, description]),
        "vkt_voxels": (ctypes.c_int, [volume, out, ctypes.POINTER(size)]),
        "vkt_header": (ctypes.c_int, [volume, out]),
        "vkt_write": (ctypes.c_int, [volume, text, words, size]),
        "vkt_apply": (ctypes.c_int, [words, size, ctypes.POINTER(volume), size, out]),
        "vkt_transform": (ctypes.c_int, [volume, VoxelFunction, ctypes.c_void_p, words, size, out]),
        "vkt_remarks": (text, [volume]),
        "vkt_report": (text, [volume]),
        "vkt_measure": (ctypes.c_int, [words, size, ctypes.POINTER(volume), size, out]),
        "vkt_count_volumes": (ctypes.c_int, [text, words, size, ctypes.POINTER(ctypes.c_int64)]),
        "vkt_series_open": (ctypes.c_int, [text, words, size, out]),
        "vkt_series_next": (ctypes.c_int, [ctypes.c_void_p, out]),
        "vkt_series_free_reader": (None, [ctypes.c_void_p]),
        "vkt_series_create": (ctypes.c_int, [text, words, size, out]),
        "vkt_series_put": (ctypes.c_int, [ctypes.c_void_p, volume]),
        "vkt_series_close": (ctypes.c_int, [ctypes.c_void_p]),
        "vkt_series_free_writer": (None, [ctypes.c_void_p]),
        "vkt_stack": (ctypes.c_int, [ctypes.POINTER(volume), size, words, size, out]),
        "vkt_split": (ctypes.c_int, [volume, out]),
        "vkt_brick": (ctypes.c_int, [volume, words, size, out]),
        "vkt_merge": (ctypes.c_int, [ctypes.POINTER(volume), size, out]),
        "vkt_stream_open": (ctypes.c_int, [ctypes.c_int, out]),
        "vkt_stream_next": (ctypes.c_int, [ctypes.c_void_p, out]),
        "vkt_stream_free_reader": (None, [ctypes.c_void_p]),
        "vkt_stream_create": (ctypes.c_int, [ctypes.c_int, words, size, out]),
        "vkt_stream_put": (ctypes.c_int, [ctypes.c_void_p, volume]),
        "vkt_stream_fail": (ctypes.c_int, [ctypes.c_void_p, text]),
        "vkt_stream_close": (ctypes.c_int, [ctypes.c_void_p]),
        "vkt_stream_free_writer": (None, [ctypes.c_void_p]),
        "vkt_render": (ctypes.c_int, [volume, words, size, out]),
        "vkt_picture_width": (ctypes.c_int, [volume]),
        "vkt_picture_height": (ctypes.c_int, [volume]),
        "vkt_picture_bytes": (ctypes.POINTER(ctypes.c_ubyte), [volume]),
        "vkt_picture_light": (ctypes.POINTER(ctypes.c_float), [volume]),
        "vkt_picture_remarks": (text, [volume]),
        "vkt_picture_png": (ctypes.c_int, [volume, out, ctypes.POINTER(size)]),
        "vkt_free_picture": (None, [volume]),
        "vkt_make_surface": (ctypes.c_int, [volume, words, size, out]),
        "vkt_surface_parts": (ctypes.c_int64, [volume]),
        "vkt_surface_part": (ctypes.c_int, [volume, ctypes.c_int64, volume]),
        "vkt_surface_report": (text, [volume]),
        "vkt_surface_remarks": (text, [volume]),
        "vkt_surface_write": (ctypes.c_int, [volume, text, words, size]),
        "vkt_free_surface": (None, [volume]),
        "vkt_set_progress": (None, [ProgressFunction, ctypes.c_void_p]),
        "vkt_trim": (size, []),
        "vkt_free_text": (None, [ctypes.c_void_p]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


_declare()
version = library.vkt_version().decode()


class Error(Exception):
    """What vkt refused or failed to do. exit_code is that of the command: 1 failure, 2 usage, 3 data, 4 files, 5 memory
    or device; hint says what to do instead and may be empty."""

    exit_code: int
    hint: str

    def __init__(self, message: str, exit_code: int, hint: str = ""):
        super().__init__(f"{message} ({hint})" if hint else message)
        self.exit_code = exit_code
        self.hint = hint
        self._arguments = message, exit_code, hint

    def __reduce__(self):  # from a process of a pool to the one that asked
        return Error, self._arguments


_raised: list = []  # by handlers of signals, while a call of the library was running


def _signals():
    """Handlers of signals run, Python's own for Ctrl-C among them, whenever a call says how far it is; what one raises ends
    the call and comes out of check(). It is a generator because the interpreter runs handlers when it enters a function,
    where no "try" of that function holds yet, but when it resumes a generator where that stands, inside of it."""
    answer = 0
    while True:
        try:
            while True:
                yield answer
                answer = 0
        except GeneratorExit:
            return
        except BaseException as error:
            _raised.append(error)
            answer = 1


def _interruptible():
    """Calls of the main thread, in which alone handlers of signals run, can be interrupted. Returns what must stay."""
    if threading.current_thread() is not threading.main_thread():
        return None
    watching = _signals()
    next(watching)
    function = ProgressFunction(watching.send)
    library.vkt_set_progress(function, None)
    return function


_watcher = _interruptible()


def check(status):
    if _raised and threading.current_thread() is threading.main_thread():
        error = _raised[0]
        _raised.clear()
        raise error
    if status != 0:
        message, hint = library.vkt_error().decode(), library.vkt_error_hint().decode()
        if hint:
            from ._hints import in_python  # which asks the library what it knows
            hint = in_python(hint)
        raise Error(message, status, hint)


def word_of(word):
    """A word or a path for C, where a NUL would end it."""
    encoded = os.fsencode(word)
    if b"\0" in encoded:
        raise Error(f"{word!r} holds a NUL, which no name and no word of a command may", 2)
    return encoded


def words_of(words):
    """A list of words for C, and how many they are."""
    return (ctypes.c_char_p * len(words))(*map(word_of, words)), len(words)


def value_word(value):
    """A Python value as one word: numbers as they are, three of them as X,Y,Z."""
    if isinstance(value, np.ndarray):
        if value.ndim > 2 or value.size > 64:  # not a vector, nor a matrix
            raise TypeError(f"an array of shape {value.shape} is no value of an option; a volume is vkt.Volume(array)")
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return ",".join(value_word(part) for part in value)
    if isinstance(value, (bool, np.bool_)):
        raise Error(f"{value} is no value; flags are given as name=True", 2)
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, (type, np.dtype)):
        if np.dtype(value).byteorder not in ("=", "|", "<" if sys.byteorder == "little" else ">"):
            raise Error(f"{np.dtype(value).str} is a type in another order of bytes", 2, "endian='big' reads such files")
        return np.dtype(value).name
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def _range_word(part):
    """A slice or a pair as FROM:TO, or FROM:TO:STEP; an index as it is. None is the edge."""
    if isinstance(part, slice):
        part = (part.start, part.stop) if part.step is None else (part.start, part.stop, part.step)
    if part is Ellipsis:
        return ":"
    if isinstance(part, (list, tuple, np.ndarray)):
        return ":".join("" if bound is None else value_word(bound) for bound in part)
    return value_word(part)


def option_words(options):
    """Keyword arguments as words: sigma=2 is --sigma=2, force=True is --force, None and False are left out. Regions, and
    what is added on each side, are slices or pairs for x, y and z, a range of values is a pair, and what KEY=VALUE sets
    is a dict as well."""
    words = []
    for name, value in options.items():
        name = "--" + name.rstrip("_").replace("_", "-")
        several = isinstance(value, (list, tuple, np.ndarray))
        if name in ("--roi", "--roi-world", "--by") and several:
            value = ",".join(_range_word(part) for part in value)
        elif name in ("--range", "--domain") and several:
            value = _range_word(value)
        elif isinstance(value, dict):
            value = [f"{key}={'' if part is None else value_word(part)}" for key, part in value.items()] or None
        if value is True:
            words.append(name)
        elif isinstance(value, (list, tuple)) and value and all(isinstance(part, str) for part in value):
            words += [name, *value]
        elif value is not None and value is not False:
            words.append(f"{name}={value_word(value)}")
    return words


def text_of(function, *arguments):
    """The text that a function hands out, freed."""
    pointer = ctypes.c_void_p()
    check(function(*arguments, ctypes.byref(pointer)))
    try:
        return ctypes.string_at(pointer).decode()
    finally:
        library.vkt_free_text(pointer)
