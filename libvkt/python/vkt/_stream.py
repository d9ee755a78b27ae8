"""Streams of vkt (vkt-stream(5)) over files, pipes of subprocesses and whatever reads or writes bytes."""
# SPDX-License-Identifier: MIT
import ctypes
import io
import os
import shutil
import socket
import threading
from typing import Any, Iterable, Iterator

from ._library import check, library, option_words, words_of
from ._volume import Volume


def read_stream(file: Any) -> "Iterator[Volume]":
    """The volumes of a stream, one after another as they arrive: for volume in read_stream(process.stdout). The file is
    that of a pipe, of a socket or of a file on disk, a descriptor, or any object with read(), such as io.BytesIO. Of a
    pipe nothing may have been read before.

    A stream that is damaged or breaks off raises vkt.Error, and so does one whose writer failed, with what that said."""
    return _volumes(file)


def _volumes(file):
    descriptor = _descriptor(file)
    pump = None
    if descriptor is None:
        descriptor, into = os.pipe()
        pump = _Pump(file, open(into, "wb"))
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
    finally:
        library.vkt_stream_free_reader(reader)


def write_stream(file: Any, volumes: "Volume | Iterable[Volume]", **options: Any) -> None:
    """Writes one volume or several as a stream: write_stream(process.stdin, volume). The file is that of a pipe, of a
    socket or of a file on disk, a descriptor, or any object with write(); it stays open, and who reads a pipe waits until
    it is closed. Options: transport="shm" gives voxels to a vkt at the other end of a pipe without copying them,
    transport="gpu" leaves them in GPU memory for one that works there, no_checksum=True. What iterating over the volumes raises is told to the reader, which fails as well."""
    if isinstance(volumes, Volume):
        volumes = [volumes]
    if hasattr(file, "flush"):
        file.flush()
    descriptor = _descriptor(file)
    pump = None
    if descriptor is None:
        source, descriptor = os.pipe()
        pump = _Pump(open(source, "rb"), file)
    writer = ctypes.c_void_p()
    try:
        check(library.vkt_stream_create(descriptor, *words_of(option_words(options)), ctypes.byref(writer)))
        try:
            for volume in volumes:
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
    """Carries bytes from one file to another in a thread, and closes that of the two which is a pipe's."""

    def __init__(self, source, sink):
        self._error = None
        self._thread = threading.Thread(target=self._run, args=(source, sink), daemon=True)
        self._thread.start()

    def _run(self, source, sink):
        try:
            shutil.copyfileobj(source, sink, 1 << 20)
        except BrokenPipeError:
            pass  # the reader has what it wants
        except Exception as error:
            self._error = error
        finally:
            for file in source, sink:
                if isinstance(getattr(file, "name", None), int):  # opened by its descriptor
                    try:
                        file.close()
                    except OSError:
                        pass

    def finish(self):
        self._thread.join()
        if self._error is not None:
            raise self._error
