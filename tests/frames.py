#!/usr/bin/python3
# Offsets at which a frame of a volume stream ends, one a line: frames.py FILE. Reads the stream as vkt-stream(5) says.
# SPDX-License-Identifier: MIT
import struct
import sys

MAGIC = b"VKT1\r\n\x1a\n"
FRAME = struct.Struct("<4sIQQQ")  # type, flags, payload length, payload checksum, checksum of the 24 bytes before


def boundaries(stream):
    """Offsets after the magic of a volume and after each of its frames, and whether a volume is whole there."""
    at = 0
    while at < len(stream):
        if stream[at : at + 8] != MAGIC:
            raise SystemExit(f"no magic at byte {at}")
        at += 8
        yield at, False
        while True:
            kind, _, length, _, _ = FRAME.unpack_from(stream, at)
            at += FRAME.size + length
            yield at, kind == b"END "
            if kind == b"END ":
                break


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as file:
        for offset, whole in boundaries(file.read()):
            print(offset, "whole" if whole else "cut")
