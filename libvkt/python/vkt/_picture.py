"""Pictures of volumes."""
# SPDX-License-Identifier: MIT
import ctypes
import struct
import warnings
import zlib
from typing import Any

import numpy as np

from ._library import Error, check, library, option_words, value_word, words_of


def png_of(pixels):
    """The bytes of a PNG file of an array of bytes: [row, column] of grey, or [row, column, channel] of RGB or RGBA."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    colours = {1: 0, 3: 2, 4: 6}[1 if pixels.ndim == 2 else pixels.shape[2]]
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    return (b"\x89PNG\r\n\x1a\n" +
            chunk(b"IHDR", struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, colours, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


class Picture(np.ndarray):
    """What render() gives: an array as any other, which notebooks show."""

    def _repr_png_(self) -> "bytes | None":
        """For notebooks; None where it is no picture any more, which they show as other arrays."""
        shown = self.dtype == np.uint8 and self.ndim == 3 and self.shape[2] in (3, 4) and self.size > 0
        return png_of(self) if shown else None


def render(volume: "Volume | np.ndarray", **options: Any) -> "np.ndarray | bytes":
    """A picture of a volume, or of an array [z, y, x]: an array [row, column, channel] of four bytes, red, green and blue in sRGB and alpha, rows
    from the top, which notebooks show: render(volume, view="x", size="640x480"),
    render(volume, render_algo="multi-scattering", noise=1).

    Options are those of `vkt render` (man vkt-render): size, background, camera, transfer function, algorithm,
    annotate and caption, but not those of files, windows and several pictures. `format`
    says what comes back: "uint8"; "float", linear light of the volume alone, premultiplied, and alpha, as float32;
    "png", the bytes of a file that says how it was made. What was lost is a warning."""
    return drawn(volume, options, 4)


def drawn(volume, options, level):
    from ._volume import Volume

    if isinstance(volume, np.ndarray):
        volume = Volume(volume)
    if not isinstance(volume, Volume):
        raise TypeError(f"render() takes a vkt.Volume or an array, and this is {type(volume).__name__}: vkt.read(path)")
    options = dict(options)
    form = options.pop("format", "uint8")
    if form not in ("uint8", "float", "png"):
        raise Error(f"format '{form}' is not one of uint8, float, png", 2)
    if isinstance(options.get("size"), (list, tuple)):
        options["size"] = "x".join(str(int(n)) for n in options["size"])
    words = []
    for name, value in options.items():  # lists of several values are words of their own
        several = name.rstrip("_") in ("iso", "iso_color", "iso_opacity", "rgba_lookup_table", "lut")
        if several and isinstance(value, (list, tuple, np.ndarray)):
            words += option_words({name: [value_word(part) for part in np.ravel(value).tolist()]})
        else:
            words += option_words({name: value})
    handle = ctypes.c_void_p()
    check(library.vkt_render(volume._handle, *words_of(words), ctypes.byref(handle)))
    try:
        for remark in filter(None, library.vkt_picture_remarks(handle).decode().split("; ")):
            warnings.warn(f"render: {remark}", RuntimeWarning, stacklevel=level - 1)
        if form == "png":
            data, size = ctypes.c_void_p(), ctypes.c_size_t()
            check(library.vkt_picture_png(handle, ctypes.byref(data), ctypes.byref(size)))
            return ctypes.string_at(data, size.value)
        shape = library.vkt_picture_height(handle), library.vkt_picture_width(handle), 4
        pixels = (library.vkt_picture_bytes if form == "uint8" else library.vkt_picture_light)(handle)
        return np.ctypeslib.as_array(pixels, shape).copy().view(Picture)
    finally:
        library.vkt_free_picture(handle)
