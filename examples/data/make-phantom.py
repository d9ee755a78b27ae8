#!/usr/bin/python3
# make-phantom.py [DIRECTORY]: makes the two volumes that come with vkt.
#   phantom.nrrd  nested shells, a double helix and a vessel tree, 64 x 64 x 96 uint8
#   ct.nrrd       a CT of a made trunk with its noise: Hounsfield units, slices thicker than pixels, 72 x 60 x 40 int16
# SPDX-License-Identifier: MIT
#
# Every structure is a signed distance in millimetres, turned into a value over one voxel, so that edges are soft
# enough for gradients. The same voxels come out on every machine: noise is arithmetic of integers, no time stamps.
import gzip
import os
import sys

import numpy as np

DIMS = (64, 64, 96)
SPACING = 0.5  # mm
CT_DIMS = (72, 60, 40)
CT_SPACING = (1.5, 1.5, 2.4)  # mm


def cells(dims, spacing):
    """World positions of the voxel centres, centred on the volume: three arrays of shape (z, y, x)."""
    axes = [(np.arange(n) - (n - 1) / 2) * s for n, s in zip(dims, spacing)]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    return x, y, z


def soft(distance, width=SPACING):
    """1 inside, 0 outside, a smooth step of the given width around distance 0."""
    t = np.clip(0.5 - distance / width, 0, 1)
    return t * t * (3 - 2 * t)


def ellipsoid(x, y, z, a, b, c):
    """First-order distance to an ellipsoid with these half axes."""
    k = np.sqrt((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2)
    g = np.sqrt((x / a**2) ** 2 + (y / b**2) ** 2 + (z / c**2) ** 2)
    return np.where(g > 1e-9, k * (k - 1) / np.maximum(g, 1e-9), -min(a, b, c))


def polyline(x, y, z, points, radii):
    """Distance to tubes along consecutive points, the radius changing linearly."""
    best = np.full(x.shape, np.inf)
    for (p, q), (r, s) in zip(zip(points, points[1:]), zip(radii, radii[1:])):
        p, q = np.asarray(p), np.asarray(q)
        d = q - p
        t = ((x - p[0]) * d[0] + (y - p[1]) * d[1] + (z - p[2]) * d[2]) / np.dot(d, d)
        t = np.clip(t, 0, 1)
        length = np.sqrt((x - p[0] - t * d[0]) ** 2 + (y - p[1] - t * d[1]) ** 2 + (z - p[2] - t * d[2]) ** 2)
        best = np.minimum(best, length - (r + t * (s - r)))
    return best


def helix(phase, radius, pitch, turns, steps=160):
    t = np.linspace(-turns / 2, turns / 2, steps + 1)
    angle = 2 * np.pi * t + phase
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), pitch * t], axis=1)


def branch(start, direction, length, radius, depth):
    """Segments of a vessel that forks in two, each child turned by a fixed angle and 0.72 as long."""
    start, direction = np.asarray(start, float), np.asarray(direction, float)
    direction /= np.linalg.norm(direction)
    end = start + length * direction
    segments = [([start, end], [radius, 0.8 * radius])]
    if depth > 0:
        side = np.cross(direction, [0.3, 0.9, 0.31] if depth % 2 else [0.9, -0.2, 0.4])
        side /= np.linalg.norm(side)
        for sign in (-1, 1):
            segments += branch(end, direction + 0.62 * sign * side, 0.72 * length, 0.78 * radius, depth - 1)
    return segments


def phantom():
    x, y, z = cells(DIMS, 3 * (SPACING,))
    value = np.zeros(x.shape)

    def put(level, inside):
        nonlocal value
        value = value + inside * (level - value)

    outer = ellipsoid(x, y, z, 14.6, 14.6, 22.6)
    put(38, soft(outer))                                        # skin of the outer shell …
    put(22, soft(outer + 0.9))                                  # … and the haze within
    inner = ellipsoid(x, y, z, 9.4, 9.4, 16.4)
    put(84, soft(np.abs(inner) - 0.45) * soft(4.2 - np.hypot(x + 6, y + 5)))  # second shell with a window
    tree = np.full(x.shape, np.inf)
    for points, radii in branch((0.0, 0.0, -20.5), (0.08, 0.05, 1.0), 9.5, 1.25, 5):
        tree = np.minimum(tree, polyline(x, y, z, points, radii))
    put(210, soft(tree))
    for phase, level in ((0.0, 128), (np.pi, 160)):
        put(level, soft(polyline(x, y, z, helix(phase, 11.6, 15.0, 2.3), [0.75] * 161)))
    for i in range(7):                                          # beads on the axis, brighter upwards
        centre = -9.0 + 3.6 * i
        put(190 + 10 * i, soft(np.sqrt((x - 5.2) ** 2 + (y - 4.4) ** 2 + (z - centre) ** 2) - 1.3))
    return np.rint(np.clip(value, 0, 255)).astype(np.uint8)


def noise(count):
    """Integers of mean 0 and standard deviation 1 / sqrt(3) in units of 1: sums of four bytes of a hash of the index."""
    h = np.arange(count, dtype=np.uint64) + np.uint64(1)
    for shift, factor in ((33, 0xFF51AFD7ED558CCD), (33, 0xC4CEB9FE1A85EC53), (33, 1)):
        h = (h ^ (h >> np.uint64(shift))) * np.uint64(factor)
    parts = sum(((h >> np.uint64(16 * k)) & np.uint64(255)).astype(np.int64) for k in range(4))
    return (parts - 510) / 255


def vertebra(x, y, z):
    """Distance to a vertebra around the origin: body, arch, one spinous and two transverse processes; y is backwards."""
    waist = 1 - 0.12 * np.cos(np.pi * np.clip(z / 14, -1, 1)) ** 2      # the body is slimmer half-way up
    body = np.maximum((np.hypot(x / 1.3, y) - 13 * waist) * 0.9, np.abs(z) - 13)
    body = np.maximum(body, -(np.hypot(x, y - 17.5) - 8))               # its back is hollow, for the spinal canal
    best = body
    for side in (-1, 1):
        best = np.minimum(best, polyline(x, y, z, [(9 * side, 8, 4), (10 * side, 17, 3), (0, 24, -2)], [4.2, 3.4, 3.0]))
        best = np.minimum(best, polyline(x, y, z, [(9 * side, 15, 3), (28 * side, 17, 5)], [3.4, 2.4]))
    return np.minimum(best, polyline(x, y, z, [(0, 23, -2), (0, 27.5, -9)], [3.2, 3.0]))


def ct():
    x, y, z = cells(CT_DIMS, CT_SPACING)
    value = np.full(x.shape, -1000.0)                                   # air

    def put(hounsfield, distance):
        nonlocal value
        value = value + soft(distance, 2.0) * (hounsfield - value)

    y = y + 4                                                           # room for the table behind the back
    trunk = (np.hypot(x / 51, y / 40) - 1) * 40 + 0.02 * np.abs(z)
    put(-105, trunk)                                                    # fat under the skin …
    put(55, trunk + 4)                                                  # … muscle …
    put(-95, np.maximum((np.hypot(x / 43, (y + 10) / 23) - 1) * 23, y - 6))  # … and fat of the belly
    put(62, ellipsoid(x - 20, y + 15, z - 22, 20, 14, 30))              # liver, with a spot that hardly differs
    put(38, ellipsoid(x - 22, y + 16, z - 12, 5, 5, 6))
    for side in (-1, 1):                                                # kidneys: cortex, darker within
        put(48, ellipsoid(x - 29 * side, y - 2, z + 14, 9, 7.5, 24))
        put(22, ellipsoid(x - 27 * side, y - 2, z + 14, 4.5, 4, 16))
    put(30, polyline(x, y, z, [(-28, -16, 44), (-18, -20, 20), (-6, -19, 4), (-22, -17, -16), (2, -20, -28), (18, -20, -46)],
                     [7] * 6))                                          # gut, with a bubble of gas
    put(-900, ellipsoid(x + 18, y + 22, z - 20, 4.5, 2.5, 5))
    put(120, np.hypot(x + 5.5, y + 10) - 4.5)                              # aorta and vena cava with some contrast agent
    put(85, np.hypot(x - 6, y + 10) - 4.5)
    put(20, np.hypot(x, y - 22) - 6)                                    # spinal canal
    for k in (-1, 0, 1):                                                # vertebrae: hard rind, spongy core; discs between
        put(75, np.maximum(np.hypot(x / 1.3, y - 8) - 12, np.abs(z - 39 * k - 19.5) - 8))
        bone = vertebra(x, y - 8, z - 39 * k)
        put(800, bone)
        put(330, bone + 2.2)
    table = np.hypot(x, y + 118) - 160
    put(-350, np.abs(table - 2) - 2)                                    # the table, and two rails in it
    for side in (-1, 1):
        put(900, np.hypot(x - 36 * side, y - 38.3) - 1.8)
    value = value + 14 * np.sqrt(3) * noise(value.size).reshape(value.shape)
    # Steps of 4 HU: far below the noise, and half the bytes in the file.
    return (4 * np.rint(np.clip(value, -1024, 2000) / 4)).astype(np.int16)


def write(path, voxels, spacing, about, space):
    dims = voxels.shape[::-1]
    origin = [-(n - 1) / 2 * s for n, s in zip(dims, spacing)]
    kind = {"uint8": "type: uint8\n", "int16": "type: int16\nendian: little\n"}[str(voxels.dtype)]
    header = (
        "NRRD0005\n"
        f"# {about}. MIT licence.\n"
        f"{kind}"
        "dimension: 3\n"
        f"{space}\n"
        f"sizes: {dims[0]} {dims[1]} {dims[2]}\n"
        f"space directions: ({spacing[0]},0,0) (0,{spacing[1]},0) (0,0,{spacing[2]})\n"
        "space units: \"mm\" \"mm\" \"mm\"\n"
        f"space origin: ({origin[0]},{origin[1]},{origin[2]})\n"
        "kinds: domain domain domain\n"
        "encoding: gzip\n"
        "\n"
    )
    with open(path, "wb") as out:
        out.write(header.encode())
        out.write(gzip.compress(voxels.astype(voxels.dtype.newbyteorder("<")).tobytes(), compresslevel=9, mtime=0))


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else "."
    write(os.path.join(folder, "phantom.nrrd"), phantom(), 3 * (SPACING,),
          "Phantom of vkt: nested shells, double helix, vessel tree", "space dimension: 3")
    write(os.path.join(folder, "ct.nrrd"), ct(), CT_SPACING,
          "Phantom of vkt: a made CT of a trunk, in Hounsfield units", "space: left-posterior-superior")


if __name__ == "__main__":
    main()
