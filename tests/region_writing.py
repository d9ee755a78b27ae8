# What tests of regions that are written into files that are there begin with: hdf5.bats and zarr.bats.
# SPDX-License-Identifier: MIT
import subprocess

import numpy


def whole_and_part(shape, seed):
    """A volume; a part, also in part.npy, and the volume with the part from voxel 20,3,8 on; the generator."""
    rng = numpy.random.default_rng(seed)
    whole = rng.integers(-999, 999, shape).astype("i2")
    part = rng.integers(-999, 999, (9, 11, 13)).astype("i2")
    numpy.save("part.npy", part)
    want = whole.copy()
    want[8:17, 3:14, 20:33] = part
    return whole, part, want, rng


def put(to, *options, source="part.npy"):
    return subprocess.run(["vkt", "write", source, to, *options], capture_output=True, text=True)


def put_into(volumes, part, number, to, x=20, y=3, z=8):
    """Writes the part, or a part for each of several volumes, from that number on; the volumes as they are then.

    Without a number that is refused, as when it is only planned.
    """
    numpy.save("p.npy", part)
    want = volumes.copy()
    for i, one in enumerate(part.reshape(-1, *part.shape[-3:])):
        want[number + i, z : z + one.shape[0], y : y + one.shape[1], x : x + one.shape[2]] = one
    place = ("--at", f"{x},{y},{z}", "--force")
    for more in (), ("-n",):
        run = put(to, *place, *more, source="p.npy")
        assert run.returncode == 2 and f"has {len(volumes)} volumes, and it is not said which" in run.stderr, run
        assert "say --index N" in run.stderr, run
    for more in ("-n",), ():
        run = put(to, *place, "--index", str(number), *more, source="p.npy")
        assert run.returncode == 0, run.stderr
    return want
