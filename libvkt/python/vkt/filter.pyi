# Written by libvkt/python/stubs.py from the registry; do not edit.
# SPDX-License-Identifier: MIT
import os
from typing import Any, Literal, Sequence

import numpy as np

from . import DType, Value, Volume

def bilateral(
    volume: Volume, *, sigma: float | Sequence[float] = 1.0, range_sigma: float,
    unit: Literal['voxel', 'world'] = 'voxel', radius: int | None = None, boundary: str = 'mirror',
    roi: Value | None = None, device: Value = 'auto', threads: int | None = None, memory: Value | None = None,
    slab: int = 0,
) -> Volume: ...
def box(
    volume: Volume, *, radius: int = 1, boundary: str = 'mirror', roi: Value | None = None, device: Value = 'auto',
    threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def dog(
    volume: Volume, *, sigma: float | Sequence[float] = 1.0, unit: Literal['voxel', 'world'] = 'voxel',
    boundary: str = 'mirror', roi: Value | None = None, dtype: DType | None = None, ratio: float = 1.6,
    device: Value = 'auto', threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def gaussian(
    volume: Volume, *, sigma: float | Sequence[float] = 1.0, unit: Literal['voxel', 'world'] = 'voxel',
    boundary: str = 'mirror', tolerance: Value | None = None, method: Literal['auto', 'fir', 'cascade'] = 'auto',
    roi: Value | None = None, device: Value = 'auto', threads: int | None = None, memory: Value | None = None,
    slab: int = 0,
) -> Volume: ...
def gradient(
    volume: Volume, *, component: Literal['magnitude', 'x', 'y', 'z'] = 'magnitude', boundary: str = 'mirror',
    roi: Value | None = None, dtype: DType | None = None, device: Value = 'auto', threads: int | None = None,
    memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def kernel(
    volume: Volume, file: Value, *, convolve: bool = False,
    method: Literal['auto', 'direct', 'separable', 'fft'] = 'auto', tolerance: Value | None = None,
    boundary: str = 'mirror', roi: Value | None = None, dtype: DType | None = None, device: Value = 'auto',
    threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def laplacian(
    volume: Volume, *, boundary: str = 'mirror', roi: Value | None = None, dtype: DType | None = None,
    device: Value = 'auto', threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def log(
    volume: Volume, *, sigma: float | Sequence[float] = 1.0, unit: Literal['voxel', 'world'] = 'voxel',
    boundary: str = 'mirror', roi: Value | None = None, dtype: DType | None = None, device: Value = 'auto',
    threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def median(
    volume: Volume, *, radius: int = 1, boundary: str = 'mirror', roi: Value | None = None, device: Value = 'auto',
    threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def nlmeans(
    volume: Volume, *, patch: int = 1, search: int = 5, strength: float | None = None, noise: float | None = None,
    boundary: str = 'mirror', roi: Value | None = None, device: Value = 'auto', threads: int | None = None,
    memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def sharpen(
    volume: Volume, *, sigma: float | Sequence[float] = 1.0, unit: Literal['voxel', 'world'] = 'voxel',
    boundary: str = 'mirror', roi: Value | None = None, amount: float = 1.0, device: Value = 'auto',
    threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def sobel(
    volume: Volume, *, component: Literal['magnitude', 'x', 'y', 'z'] = 'magnitude', boundary: str = 'mirror',
    roi: Value | None = None, dtype: DType | None = None, device: Value = 'auto', threads: int | None = None,
    memory: Value | None = None, slab: int = 0,
) -> Volume: ...
