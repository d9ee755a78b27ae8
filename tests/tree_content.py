#!/usr/bin/python3
# What a stream of hierarchical volumes says, however it is cut into frames: tree_content.py FILE prints, of each volume,
# its header without counts of time and history, and hashes of its bricks and of its cells. Reads the stream as
# vkt-stream(5) says.
# SPDX-License-Identifier: MIT
import hashlib
import json
import struct
import sys

from frames import FRAME, MAGIC

HEAD = 16  # of TREE, PACK and BRIK


def recorded_bricks(payload):
    """Lower corner, dims and level of the bricks in a TREE payload."""
    return list(struct.iter_unpack("<3q4i", payload[HEAD:]))


def packed_bricks(header, payload):
    """The same of a PACK payload."""
    dims, levels = header["dims"], header["levels"]
    *block, words, doublings = struct.unpack_from("<3I2H", payload, HEAD)
    bits = [(levels - 1).bit_length(), doublings.bit_length()]
    bits += [((n - 1) // b).bit_length() for n, b in zip(dims, block)]
    if words != (1 if sum(bits) <= 32 else 2):
        raise SystemExit(f"{words} words for {bits} bits")
    bricks = []
    for (number,) in struct.iter_unpack("<I" if words == 1 else "<Q", payload[HEAD + 16 :]):
        fields = []
        for n in bits:
            fields.append(number & ((1 << n) - 1))
            number >>= n
        level, doubled, *at = fields
        lower = [i * b for i, b in zip(at, block)]
        own = [min(b << doubled, (n - l) >> level) if n > 1 else 1 for n, l, b in zip(dims, lower, block)]
        if number or level >= levels or doubled > doublings or min(own) < 1:
            raise SystemExit(f"no brick: {fields}")
        bricks.append((*lower, *own, level))
    return bricks


def contents(stream):
    """Header, bricks, cells and the kinds of frames of each volume."""
    at = 0
    while at < len(stream):
        if stream[at : at + len(MAGIC)] != MAGIC:
            raise SystemExit(f"no magic at byte {at}")
        at += len(MAGIC)
        header, bricks, cells, kinds = {}, [], [], []
        while not kinds or kinds[-1] != b"END ":
            kind, _, length, _, _ = FRAME.unpack_from(stream, at)
            payload = stream[at + FRAME.size : at + FRAME.size + length]
            at += FRAME.size + length
            kinds.append(kind)
            if kind == b"HEAD":
                header = json.loads(payload)
                header.pop("history", None)
            elif kind == b"TREE":
                bricks += recorded_bricks(payload)
            elif kind == b"PACK":
                bricks += packed_bricks(header, payload)
            elif kind == b"BRIK":
                cells.append(payload[HEAD:])
        yield header, bricks, b"".join(cells), kinds


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as file:
        for header, bricks, cells, _ in contents(file.read()):
            hashes = [hashlib.sha256(data).hexdigest() for data in (repr(bricks).encode(), cells)]
            print(json.dumps(header, sort_keys=True), *hashes)
