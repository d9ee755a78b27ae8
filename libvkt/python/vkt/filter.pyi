# Written by libvkt/python/stubs.py from the registry; do not edit.
# SPDX-License-Identifier: MIT
import os
from typing import Any, Literal, Mapping, Sequence, SupportsFloat, SupportsIndex

import numpy as np

from . import Array, DType, Integers, Numbers, Region, Value, Volume

def bilateral(
    volume: Volume, *, sigma: SupportsFloat | Numbers = 1.0, range_sigma: SupportsFloat,
    unit: Literal['voxel', 'world'] = 'voxel', radius: SupportsIndex | None = None, boundary: str = 'mirror',
    roi: Region | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def box(
    volume: Volume, *, radius: SupportsIndex = 1, boundary: str = 'mirror', roi: Region | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def dog(
    volume: Volume, *, sigma: SupportsFloat | Numbers = 1.0, unit: Literal['voxel', 'world'] = 'voxel',
    boundary: str = 'mirror', roi: Region | None = None, dtype: DType | None = None, ratio: SupportsFloat = 1.6,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def gaussian(
    volume: Volume, *, sigma: SupportsFloat | Numbers = 1.0, unit: Literal['voxel', 'world'] = 'voxel',
    boundary: str = 'mirror', tolerance: Value | None = None, method: Literal['auto', 'fir', 'cascade'] = 'auto',
    roi: Region | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def gradient(
    volume: Volume, *, component: Literal['magnitude', 'x', 'y', 'z'] = 'magnitude', boundary: str = 'mirror',
    roi: Region | None = None, dtype: DType | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def kernel(
    volume: Volume, file: Volume | Array | Value, *, convolve: bool = False,
    method: Literal['auto', 'direct', 'separable', 'fft'] = 'auto', tolerance: Value | None = None,
    boundary: str = 'mirror', roi: Region | None = None, dtype: DType | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def laplacian(
    volume: Volume, *, boundary: str = 'mirror', roi: Region | None = None, dtype: DType | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def log(
    volume: Volume, *, sigma: SupportsFloat | Numbers = 1.0, unit: Literal['voxel', 'world'] = 'voxel',
    boundary: str = 'mirror', roi: Region | None = None, dtype: DType | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def median(
    volume: Volume, *, radius: SupportsIndex = 1, boundary: str = 'mirror', roi: Region | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def nlmeans(
    volume: Volume, *, patch: SupportsIndex = 1, search: SupportsIndex = 5, strength: SupportsFloat | None = None,
    noise: SupportsFloat | None = None, boundary: str = 'mirror', roi: Region | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def sharpen(
    volume: Volume, *, sigma: SupportsFloat | Numbers = 1.0, unit: Literal['voxel', 'world'] = 'voxel',
    boundary: str = 'mirror', roi: Region | None = None, amount: SupportsFloat = 1.0, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def sobel(
    volume: Volume, *, component: Literal['magnitude', 'x', 'y', 'z'] = 'magnitude', boundary: str = 'mirror',
    roi: Region | None = None, dtype: DType | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
