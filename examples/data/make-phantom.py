#!/usr/bin/python3
# Makes examples/data/phantom.nrrd: nested shells, a double helix and a vessel tree, 64 x 64 x 96 uint8.
# SPDX-License-Identifier: MIT
#
# Every structure is a signed distance in millimetres, turned into a value over one voxel, so that edges are soft
# enough for gradients. The same bytes come out on every machine: no random numbers, no time stamps.
import gzip
import sys

import numpy as np

DIMS = (64, 64, 96)
SPACING = 0.5  # mm


def cells():
    """World positions of the voxel centres, centred on the volume: three arrays of shape (z, y, x)."""
    axes = [(np.arange(n) - (n - 1) / 2) * SPACING for n in DIMS]
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
    x, y, z = cells()
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


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else "phantom.nrrd"
    voxels = phantom()
    origin = [-(n - 1) / 2 * SPACING for n in DIMS]
    header = (
        "NRRD0005\n"
        "# Phantom of vkt: nested shells, double helix, vessel tree. MIT licence.\n"
        "type: uint8\n"
        "dimension: 3\n"
        "space dimension: 3\n"
        f"sizes: {DIMS[0]} {DIMS[1]} {DIMS[2]}\n"
        f"space directions: ({SPACING},0,0) (0,{SPACING},0) (0,0,{SPACING})\n"
        "space units: \"mm\" \"mm\" \"mm\"\n"
        f"space origin: ({origin[0]},{origin[1]},{origin[2]})\n"
        "kinds: domain domain domain\n"
        "encoding: gzip\n"
        "\n"
    )
    with open(path, "wb") as out:
        out.write(header.encode())
        out.write(gzip.compress(voxels.tobytes(), compresslevel=9, mtime=0))


if __name__ == "__main__":
    main()
