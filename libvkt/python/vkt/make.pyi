# Written by libvkt/python/stubs.py from the registry; do not edit.
# SPDX-License-Identifier: MIT
import os
from typing import Any, Literal, Sequence

import numpy as np

from . import DType, Value, Volume

def amr(
    *, blocks: int | None = None, levels: int | None = None, block_size: int | None = None, silcc: bool = False,
    field: Literal['constant', 'linear', 'disk'] = 'disk', dtype: DType = 'float32', device: Value = 'auto',
    threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def checkerboard(
    *, dims: Sequence[int], dtype: DType = 'float32', spacing: float | Sequence[float] = 1.0,
    origin: float | Sequence[float] = 0.0, period: int = 1, low: float | None = None, high: float | None = None,
    device: Value = 'auto', threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def constant(
    *, dims: Sequence[int], dtype: DType = 'float32', spacing: float | Sequence[float] = 1.0,
    origin: float | Sequence[float] = 0.0, value: float = 0.0, device: Value = 'auto', threads: int | None = None,
    memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def marschner_lobb(
    *, dims: Sequence[int], dtype: DType = 'float32', spacing: float | Sequence[float] = 1.0,
    origin: float | Sequence[float] = 0.0, frequency: float = 6.0, amplitude: float = 0.25, low: float | None = None,
    high: float | None = None, device: Value = 'auto', threads: int | None = None, memory: Value | None = None,
    slab: int = 0,
) -> Volume: ...
def noise(
    *, dims: Sequence[int], dtype: DType = 'float32', spacing: float | Sequence[float] = 1.0,
    origin: float | Sequence[float] = 0.0, seed: int = 0, low: float | None = None, high: float | None = None,
    device: Value = 'auto', threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
def ramp(
    *, dims: Sequence[int], dtype: DType = 'float32', spacing: float | Sequence[float] = 1.0,
    origin: float | Sequence[float] = 0.0, axis: Literal['x', 'y', 'z'] = 'x', from_: float = 0.0,
    to: float | None = None, device: Value = 'auto', threads: int | None = None, memory: Value | None = None,
    slab: int = 0,
) -> Volume: ...
def sphere(
    *, dims: Sequence[int], dtype: DType = 'float32', spacing: float | Sequence[float] = 1.0,
    origin: float | Sequence[float] = 0.0, radius: float | None = None, center: float | Sequence[float] | None = None,
    inside: float | None = None, outside: float | None = None, edge: Literal['hard', 'coverage', 'distance'] = 'hard',
    device: Value = 'auto', threads: int | None = None, memory: Value | None = None, slab: int = 0,
) -> Volume: ...
