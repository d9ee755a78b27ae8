#!/usr/bin/python3
# What a stream of hierarchical volumes says, however it is cut into frames: tree_content.py FILE prints, of each volume,
# its header without counts of time and history, and hashes of its table of bricks and of its cells. Reads the stream as
# vkt-stream(5) says.
# SPDX-License-Identifier: MIT
import hashlib
import json
import sys

from frames import FRAME, MAGIC

HEAD = 16  # of TREE and BRIK


def contents(stream):
    at = 0
    while at < len(stream):
        if stream[at : at + len(MAGIC)] != MAGIC:
            raise SystemExit(f"no magic at byte {at}")
        at += len(MAGIC)
        header, table, cells = {}, hashlib.sha256(), hashlib.sha256()
        kind = b""
        while kind != b"END ":
            kind, _, length, _, _ = FRAME.unpack_from(stream, at)
            payload = stream[at + FRAME.size : at + FRAME.size + length]
            at += FRAME.size + length
            if kind == b"HEAD":
                header = json.loads(payload)
                header.pop("history", None)
            elif kind == b"TREE":
                table.update(payload[HEAD:])
            elif kind == b"BRIK":
                cells.update(payload[HEAD:])
        yield header, table.hexdigest(), cells.hexdigest()


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as file:
        for header, table, cells in contents(file.read()):
            print(json.dumps(header, sort_keys=True), table, cells)
