"""Checks that includes point down only: each room of the source sees the rooms below it. SPDX-License-Identifier: MIT"""
import pathlib
import re
import sys

# From the ground up; rooms of one row do not see one another.
FLOORS = [
    ["libvkt/core"],
    ["libvkt/kernel", "libvkt/io"],
    ["libvkt/amr"],
    ["libvkt/engine"],
    ["libvkt/formats"],
    ["libvkt/render"],
    ["libvkt/operations/common"],
    ["libvkt/operations/statistics"],
    ["libvkt/operations/voxels"],
    ["libvkt/operations/filter"],
    ["libvkt/operations/shape", "libvkt/operations/resample"],
    ["libvkt/operations/bricks", "libvkt/operations/trees"],
    ["libvkt/operations"],
    ["libvkt/c"],
    ["ipc"],
    ["shell"],
    ["shell/picture"],
    ["shell/machine", "shell/viewer"],
    ["shell/run"],
    ["shell/main.cpp", "shell/chart"],
    ["shell/stress"],
    ["commands"],
]
ROOMS = {room: (floor, room) for floor, rooms in enumerate(FLOORS) for room in rooms}
INCLUDE = re.compile(r'^\s*#include "((?:libvkt|ipc|shell|commands)/[^"]+)"')


def room_of(path):
    """The innermost room that a file lies in: its floor, and its name."""
    folder = path
    while folder and folder not in ROOMS:
        folder = folder.rpartition("/")[0]
    return ROOMS[folder]


def main(root):
    count, upwards = 0, []
    for top in ("libvkt", "ipc", "shell", "commands"):
        for path in sorted((root / top).rglob("*")):
            name = path.relative_to(root).as_posix()
            if path.suffix not in {".h", ".cpp", ".cu"}:
                continue
            if name.startswith("libvkt/cuda/"):
                continue  # the device parts of all rooms
            for line in path.read_text().splitlines():
                found = INCLUDE.match(line)
                if not found:
                    continue
                count += 1
                (floor, room), (other_floor, other) = room_of(name), room_of(found[1])
                if room != other and other_floor >= floor:
                    upwards.append(f"{name} includes {found[1]}")
    print("\n".join(upwards) if upwards else f"{count} includes, none upwards")
    return 1 if upwards else 0


sys.exit(main(pathlib.Path(sys.argv[1]).resolve()))
