"""Commands that are no operations of the library: the program vkt runs them, volumes go there and back as streams."""
# SPDX-License-Identifier: MIT
import contextlib
import io
import json
import os
import pathlib
import shlex
import shutil
import signal
import struct
import subprocess
import tempfile
import threading
import warnings
import zlib
from typing import Any

import numpy as np

from ._library import Error, option_words, value_word
from ._stream import read_stream, write_stream
from ._volume import Volume

_STREAM = b"VKT1"  # how streams begin (vkt-stream(5))


def command(name: str, *arguments: Any, **options: Any) -> Any:
    """What a command of the program vkt prints or makes: command("history", "volume.nrrd"), command("chart", volume,
    pipeline="filter gaussian --sigma 2"), command("pipe", "flip x | crop --roi :,:,4:8", volume). `vkt help` lists
    commands, and `vkt help COMMAND` their options.

    One argument may be a volume or an array, which is the standard input. Volumes that come back are a Volume, or a list
    of several; with json=True a report is what its JSON says; everything else is text. Notes are warnings; what the
    command refuses or fails to do is vkt.Error with its exit code.

    Operations are faster as functions, in this process: vkt.filter.gaussian(volume, sigma=2)."""
    output, notes = _run(shlex.split(name), arguments, options)
    for note in notes:
        warnings.warn(note, RuntimeWarning, stacklevel=2)
    if output.startswith(_STREAM):
        volumes = list(read_stream(io.BytesIO(output)))
        return volumes[0] if len(volumes) == 1 else volumes
    text = output.decode(errors="surrogateescape")
    return json.loads(text) if options.get("json") is True and text else text


def slim(volume: "Volume | np.ndarray", *, for_: str, within: float, told: "list[str] | None" = None,
         **options: Any) -> "Volume":
    """No more of a volume than a picture or a result needs: the smallest model of it that differs by at most `within`
    anywhere after the pipeline `for_`, slim(volume, for_="render --size 512 --domain 0:500", within=0.5) by display
    levels of 255, slim(volume, for_="filter gaussian --sigma 1", within=2) by physical values (man vkt-slim).

    What was saved and what it differs by is added to the list `told`, as lines. Options are those of every command:
    threads, memory, device. The program vkt computes it."""
    output, notes = _run(["slim"], [volume], {"for": for_, "within": within, **options})
    if told is not None:
        told += notes
    return next(read_stream(io.BytesIO(output)))


def view(volume: "Volume | np.ndarray | str | os.PathLike[str]", *, wait: bool = True,
         **options: Any) -> "subprocess.Popen[bytes] | None":
    """Shows a volume, or a file, in a window, with the options of `vkt view` (man vkt-view): view(volume, elevation=30). Returns
    when the window is closed; with wait=False at once, what was started. Without a display it is an error that says
    so."""
    words, source = _words(["view"], [volume], options)
    process, log, feeder = _started(words, source, None)
    if not wait:
        return process
    with _ended(process):
        feeder.join()
        _finished(process, log, words)
    return None


def image_diff(reference: "str | os.PathLike[str] | bytes | np.ndarray", other: "str | os.PathLike[str] | bytes | np.ndarray",
               **options: Any) -> "dict[str, Any]":
    """How two pictures differ, as `vkt image diff --json` prints it: image_diff("a.png", "b.png")["flip"]. Pictures are PNG,
    OpenEXR or PFM files, the bytes of a PNG file, or arrays of bytes as render() gives them. "equal" says whether no
    channel of a pixel differs by more than the option tolerance."""
    with contextlib.ExitStack() as files:
        output, _, status = _run_status(["image", "diff"], _pictures(files, (reference, other)), {**options, "json": True})
    return {**json.loads(output), "equal": status == 0}


def image_mean(*pictures: "str | os.PathLike[str] | bytes | np.ndarray", **options: Any) -> "bytes | None":
    """The mean of pictures of the same in linear light, of multiple scattering by their paths (man vkt-image): the bytes of
    a PNG file, image_mean("s1.png", "s2.png"), or the file that the option output names. Pictures are as for
    image_diff()."""
    return _combined("mean", pictures, options)


def image_join(*pictures: "str | os.PathLike[str] | bytes | np.ndarray", **options: Any) -> "bytes | None":
    """The picture of which these are the parts, bit for bit as without tiles (man vkt-image). Pictures and what comes back
    are those of image_mean()."""
    return _combined("join", pictures, options)


def _combined(verb, pictures, options):
    with contextlib.ExitStack() as files:
        named = _pictures(files, pictures)
        if options.get("output") is not None:
            _run(["image", verb], named, options)
            return None
        path = os.path.join(files.enter_context(tempfile.TemporaryDirectory()), f"{verb}.png")
        _run(["image", verb], named, {**options, "output": path})
        return pathlib.Path(path).read_bytes()


def _pictures(files, pictures):
    """Their paths; what lies in memory is written to temporary files."""
    folder, names = None, []
    for i, picture in enumerate(pictures):
        if isinstance(picture, (str, os.PathLike)):
            names.append(os.path.join(".", os.fspath(picture)) if os.fspath(picture).startswith("-") else picture)
            continue
        if isinstance(picture, np.ndarray):
            picture = _png(picture)
        elif not isinstance(picture, bytes):
            raise TypeError(f"a picture is a file, the bytes of one, or an array, and this is {type(picture).__name__}")
        folder = folder or files.enter_context(tempfile.TemporaryDirectory())
        names.append(os.path.join(folder, f"{i}.png"))
        pathlib.Path(names[-1]).write_bytes(picture)
    return names


def _png(pixels):
    """Bytes [row, column, channel] as a file."""
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] not in (3, 4):
        raise TypeError(f"an array is a picture if it is uint8 [row, column, channel] of 3 or 4 channels, and this is "
                        f"{pixels.dtype} {list(pixels.shape)}")
    height, width, channels = pixels.shape
    rows = np.zeros((height, 1 + width * channels), np.uint8)  # each begins with its filter, none
    rows[:, 1:] = pixels.reshape(height, -1)
    head = struct.pack(">IIBBBBB", width, height, 8, 6 if channels == 4 else 2, 0, 0, 0)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"sRGB", b"\0") +
            chunk(b"IDAT", zlib.compress(rows.tobytes())) + chunk(b"IEND", b""))


def _program():
    """The program of the same build or installation as this package, else the one that a shell would start."""
    for folder in pathlib.Path(__file__).resolve().parents[1:6]:
        for place in folder / "vkt", folder / "bin" / "vkt":
            if place.is_file() and os.access(place, os.X_OK):
                return str(place)
    found = shutil.which("vkt")
    if found is None:
        raise Error("the program vkt is not there, which does this", 1, "install it, or put its folder on PATH")
    return found


def _words(words, arguments, options):
    """The words of the command, and the volume that it reads."""
    source, words = None, list(words)
    for argument in arguments:
        if not isinstance(argument, (Volume, np.ndarray)):
            words.append(value_word(argument))
            continue
        if source is not None:
            raise Error(f"{words[0]}: one volume can be the standard input, and there are two", 2, "write one to a file")
        source = argument
        if words[0] != "pipe":  # whose words are stages
            words.append("-")
    return words + option_words(options), source


def _started(words, source, stdout):
    """The process, the file that takes what it says, and the thread that hands the volume over."""
    log = tempfile.TemporaryFile()
    process = subprocess.Popen([_program(), *words], stdin=subprocess.DEVNULL if source is None else subprocess.PIPE,
                               stdout=stdout, stderr=log)

    def feed():
        try:
            with process.stdin:
                write_stream(process.stdin, source)
        except (Error, OSError):  # who does not read to the end says why
            pass

    feeder = threading.Thread(target=feed if source is not None else lambda: None, daemon=True)
    feeder.start()
    return process, log, feeder


@contextlib.contextmanager
def _ended(process):
    """Who is interrupted here does not leave the program behind: a notebook interrupts the interpreter alone. As with
    Ctrl-C in a terminal, a picture that is being drawn is saved as it is; what does not end within seconds is killed."""
    try:
        yield
    except BaseException:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(5)
            except BaseException:
                process.kill()
                process.wait()
        raise


def _finished(process, log, words, good=(0,)):
    """What it noted, without the name in front."""
    status = process.wait()
    with log:
        log.seek(0)
        lines = log.read().decode(errors="replace").splitlines()
    said = [line.split(": ", 1)[1] if line.startswith("vkt") and ": " in line else line for line in lines]
    if status in good:
        return said
    hints = [line[len("hint: "):] for line in said if line.startswith("hint: ")]
    message = "; ".join(line for line in said if not line.startswith("hint: "))
    raise Error(message or f"vkt {words[0]} ended with status {status}", status if status > 0 else 1, "; ".join(hints))


def _run(words, arguments, options):
    output, notes, _ = _run_status(words, arguments, options, (0,))
    return output, notes


def _run_status(words, arguments, options, good=(0, 1)):
    words, source = _words(words, arguments, options)
    process, log, feeder = _started(words, source, subprocess.PIPE)
    with _ended(process):
        with process.stdout:
            output = process.stdout.read()
        feeder.join()
        status = process.wait()
        # A status that answers a question comes with an answer.
        notes = _finished(process, log, words, good if output else (0,))
    return output, notes, status
