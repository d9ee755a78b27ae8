"""Streams of vkt (vkt-stream(5)) over files, pipes of subprocesses and whatever reads or writes bytes."""
# SPDX-License-Identifier: MIT
import ctypes
import errno
import io
import os
import socket
import threading
from typing import Any, Iterable, Iterator

import numpy as np

from ._library import Error, check, library, option_words, words_of
from ._volume import Volume


def read_stream(file: Any) -> "Iterator[Volume]":
    """The volumes of a stream, one after another as they arrive: for volume in read_stream(process.stdout). The file is
    that of a pipe, of a socket or of a file on disk, a descriptor, or any object with read(), such as io.BytesIO. Of a
    pipe nothing may have been read before.

    A stream that is damaged or breaks off raises vkt.Error, and so does one whose writer failed, with what that said.
    What read() raises comes out here."""
    _check_file(file, "read")
    return _volumes(file)


def _volumes(file):
    descriptor = _descriptor(file)
    pump = None
    if descriptor is None:
        descriptor, into = os.pipe()
        pump = _Pump(_fill, file, open(into, "wb", buffering=0))
    reader = ctypes.c_void_p()
    try:
        try:
            check(library.vkt_stream_open(descriptor, ctypes.byref(reader)))
        finally:
            if pump:
                os.close(descriptor)
        while True:
            handle = ctypes.c_void_p()
            check(library.vkt_stream_next(reader, ctypes.byref(handle)))
            if not handle:
                break
            yield Volume._of(handle)
        if pump:
            pump.finish()
    except Error:
        if pump and pump.error is not None:  # the stream breaks off because of that
            raise pump.error from None
        raise
    finally:
        library.vkt_stream_free_reader(reader)


def write_stream(file: Any, volumes: "Volume | np.ndarray | Iterable[Volume | np.ndarray]", **options: Any) -> None:
    """Writes one volume or several as a stream: write_stream(process.stdin, volume). An array of NumPy is one volume,
    vkt.Volume(array). The file is that of a pipe, of a socket or of a file on disk, a descriptor, or any object with
    write(); it stays open, and who reads a pipe waits until it is closed. Options: transport="shm" gives voxels to a vkt at the other end of a pipe without copying them,
    transport="gpu" leaves them in GPU memory for one that works there, no_checksum=True. What iterating over the volumes
    raises is told to the reader, which fails as well; what write() raises comes out here."""
    _check_file(file, "write")
    if isinstance(volumes, (Volume, np.ndarray)):
        volumes = [_volume_of(volumes)]
    elif not hasattr(volumes, "__iter__") or isinstance(volumes, (str, bytes)):
        raise _no_volume(volumes)
    if hasattr(file, "flush"):
        file.flush()
    descriptor = _descriptor(file)
    pump = None
    if descriptor is None:
        source, descriptor = os.pipe()
        pump = _Pump(_empty, file, open(source, "rb", buffering=0))
    writer = ctypes.c_void_p()
    try:
        check(library.vkt_stream_create(descriptor, *words_of(option_words(options)), ctypes.byref(writer)))
        try:
            for volume in volumes:
                volume = _volume_of(volume)  # which must live until it is written
                check(library.vkt_stream_put(writer, volume._handle))
        except Exception as error:
            library.vkt_stream_fail(writer, str(error).encode())
            raise
        check(library.vkt_stream_close(writer))
    finally:
        library.vkt_stream_free_writer(writer)
        if pump:
            os.close(descriptor)
            pump.finish()


def _volume_of(item):
    if isinstance(item, Volume):
        return item
    if isinstance(item, np.ndarray):
        return Volume(item)
    raise _no_volume(item)


def _no_volume(item):
    return TypeError(f"a stream is of volumes, and this is {type(item).__name__}: vkt.Volume(array), vkt.read(path)")


def _check_file(file, method):
    """Who asks with something else hears of it at once, and not of a stream that broke off."""
    if isinstance(file, io.TextIOBase):
        raise TypeError(f"a stream is bytes, and this file is one of text ({type(file).__name__}): open(path, "
                        f"'{method[0]}b'), sys.{'stdin' if method == 'read' else 'stdout'}.buffer, io.BytesIO")
    if not isinstance(file, (int, socket.socket)) and not callable(getattr(file, method, None)):
        raise TypeError(f"{type(file).__name__} is no file: a stream takes one of bytes, a socket, a descriptor, or an "
                        f"object with {method}()")


def stream_bytes(volume):
    """A volume as the bytes of a stream."""
    descriptor = os.memfd_create("vkt")
    with open(descriptor, "r+b", buffering=0) as file:
        write_stream(file, volume)
        file.seek(0)
        return file.readall()


def volume_of(data):
    """The volume of stream_bytes()."""
    with open(os.memfd_create("vkt"), "w+b", buffering=0) as file:
        rest = memoryview(data)
        while rest:
            rest = rest[file.write(rest):]
        file.seek(0)
        return next(read_stream(file))


def _descriptor(file):
    """The descriptor of a file, at the position where Python's reading or writing stands; None of what has none of its
    own, as a file that is compressed on the way."""
    if isinstance(file, int):
        return file
    if isinstance(file, socket.socket):
        return file.fileno()
    plain = isinstance(file, (io.FileIO, io.BufferedReader, io.BufferedWriter, io.BufferedRandom))
    if not plain or not isinstance(getattr(file, "raw", file), (io.FileIO, socket.SocketIO)):
        return None
    if file.seekable():
        os.lseek(file.fileno(), file.tell(), os.SEEK_SET)
    return file.fileno()


class _Pump:
    """Carries bytes between a file and a pipe in a thread, and closes the pipe."""

    def __init__(self, carry, file, pipe):
        self.error = None  # what the file raised
        self._thread = threading.Thread(target=self._run, args=(carry, file, pipe), daemon=True)
        self._thread.start()

    def _run(self, carry, file, pipe):
        try:
            carry(file, pipe)
        except BaseException as error:  # of a thread nobody would see it
            self.error = error
        finally:
            pipe.close()

    def finish(self):
        self._thread.join()
        if self.error is not None:
            raise self.error


_PIECE = 1 << 20


def _fill(file, pipe):
    while True:
        data = file.read(_PIECE)
        if data is None:
            raise BlockingIOError(errno.EAGAIN, "the file does not wait for its bytes: make it blocking")
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise TypeError(f"a stream is bytes, and read() gave {type(data).__name__}")
        if not data:
            return
        try:
            _write_all(pipe, data)
        except BrokenPipeError:
            return  # the reader has what it wants


def _empty(file, pipe):
    while data := pipe.read(_PIECE):
        _write_all(file, data)


def _write_all(file, data):
    """A raw file may take less than it is given, and says how much. What is no file of Python's and says nothing has
    taken all."""
    while len(data) > 0:
        taken = file.write(data)
        if taken is None and not isinstance(file, io.RawIOBase):
            return
        if taken is None:
            raise BlockingIOError(errno.EAGAIN, "the file does not wait until it has room: make it blocking")
        if not 0 < taken <= len(data):
            raise OSError(errno.EIO, f"the file took {taken} of {len(data)} bytes")
        if taken == len(data):
            return
        data = memoryview(data)[taken:]
