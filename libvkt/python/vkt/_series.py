"""Several volumes in a file, such as times or channels: read one after another, written as one."""
# SPDX-License-Identifier: MIT
import ctypes
import os
import stat
from typing import Any, Iterable, Iterator, overload

import numpy as np

from ._library import Error, check, library, option_words, word_of, words_of
from ._volume import Volume, read


class Series:
    """The volumes of a file, or of the files that a pattern names, read when they are asked for; read_series() makes it.

    for volume in series reads the file once. series[3] reads that volume, series[2:10:2] is a series of some of them,
    len(series) counts them: by headers alone, but for files that are compressed and for streams, which are read for it.
    So is list(series), which asks for the length; [volume for volume in series] does not. A pipe has no length and can be
    read once."""

    def __init__(self, path: "str | os.PathLike[str]", options: "dict[str, Any]", numbers: "range | None" = None) -> None:
        self._path, self._options, self._numbers = path, options, numbers
        self._count = None  # of all of them

    def __repr__(self) -> str:
        return f"<vkt.Series {os.fspath(self._path)!r}{'' if self._numbers is None else f', {len(self._numbers)} volumes'}>"

    def __iter__(self) -> "Iterator[Volume]":
        numbers = self._numbers
        if numbers is None:
            return read_all(library.vkt_series_open, word_of(self._path), *words_of(option_words(self._options)))
        if len(numbers) > 1 and numbers.step > 0:
            index = f"{numbers.start}:{numbers.stop}:{numbers.step}"
            return read_all(library.vkt_series_open, word_of(self._path),
                            *words_of(option_words({**self._options, "index": index})))
        return (self._at(number) for number in numbers)

    def __len__(self) -> int:
        if self._numbers is not None:
            return len(self._numbers)
        if self._count is None:
            try:
                mode = os.stat(self._path).st_mode
                once = not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))
            except OSError:  # a pattern
                once = False
            if once:
                raise TypeError(f"'{os.fspath(self._path)}' can be read only once, and says how many volumes it holds by "
                                "that")
            count = ctypes.c_int64()
            check(library.vkt_count_volumes(word_of(self._path), *words_of(option_words(self._options)),
                                            ctypes.byref(count)))
            self._count = count.value
        return self._count

    @overload
    def __getitem__(self, which: int) -> Volume: ...

    @overload
    def __getitem__(self, which: slice) -> "Series": ...

    def __getitem__(self, which: Any) -> Any:
        numbers = self._numbers if self._numbers is not None else range(len(self))
        if isinstance(which, slice):
            return Series(self._path, self._options, numbers[which])
        try:
            return self._at(numbers[which])
        except IndexError:
            raise IndexError(f"volume {which}: there {'is 1' if len(numbers) == 1 else f'are {len(numbers)}'}") from None

    def _at(self, number):
        return read(self._path, **self._options, index=number)


def read_all(open_, *arguments):
    """The volumes of a reader that a function of the library opens, at once; what is wrong with that is said here."""
    reader = ctypes.c_void_p()
    check(open_(*arguments, ctypes.byref(reader)))
    return _volumes(reader)


def _volumes(reader):
    try:
        while True:
            handle = ctypes.c_void_p()
            check(library.vkt_series_next(reader, ctypes.byref(handle)))
            if not handle:
                return
            yield Volume._of(handle)
    finally:
        library.vkt_series_free_reader(reader)


def read_series(path: "str | os.PathLike[str]", **options: Any) -> Series:
    """The volumes of a file that holds several, such as times or channels, or of the files that a pattern names, each read
    when it is asked for: for volume in read_series("functional.nii.gz"), read_series(path)[3], read_series(path)[::2].
    Options are those of read(). What the header says of a volume's place in the series is among its attributes, volume
    .header["attributes"]: "sequence position", "sequence units", "channel"."""
    if "index" in options:
        raise Error("a series has all volumes", 2, 'read_series(path)[2:10] are some of them, read(path, index=2) is one')
    return Series(path, options)


def write_series(volumes: "Iterable[Volume | np.ndarray]", path: "str | os.PathLike[str]", **options: Any) -> None:
    """Writes volumes one after another into a file whose name tells the format, write_series(volumes, "out.nii.gz"), or
    each into one of its own, "out%03d.nrrd". They are taken as they come, so that a generator needs the memory of one.
    Options are those of `vkt write`: force, compress, format. The file appears when all are written; nothing remains of
    one whose volumes raise an error."""
    if isinstance(volumes, (Volume, np.ndarray, str, bytes)) or not hasattr(volumes, "__iter__"):
        raise TypeError(f"a series is several volumes, and this is {type(volumes).__name__}: [volume, volume], "
                        "volume.write(path)")
    writer = ctypes.c_void_p()
    check(library.vkt_series_create(word_of(path), *words_of(option_words(options)), ctypes.byref(writer)))
    try:
        for volume in volumes:
            if not isinstance(volume, (Volume, np.ndarray)):
                raise TypeError(f"a series is of volumes, and this is {type(volume).__name__}: vkt.Volume(array)")
            volume = volume if isinstance(volume, Volume) else Volume(volume)  # which must live until it is written
            check(library.vkt_series_put(writer, volume._handle))
        check(library.vkt_series_close(writer))
    finally:
        library.vkt_series_free_writer(writer)
