# Written by libvkt/python/stubs.py from the registry; do not edit.
# SPDX-License-Identifier: MIT
import os
from typing import Any, Literal, Mapping, Sequence, SupportsFloat, SupportsIndex

import numpy as np

from . import Array, DType, Integers, Numbers, Region, Value, Volume

def amr(
    *, blocks: SupportsIndex | None = None, levels: SupportsIndex | None = None,
    block_size: SupportsIndex | None = None, silcc: bool = False,
    field: Literal['constant', 'linear', 'disk'] = 'disk', dtype: DType = 'float32', device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def checkerboard(
    *, dims: Integers, dtype: DType = 'float32', spacing: SupportsFloat | Numbers = 1.0,
    origin: SupportsFloat | Numbers = 0.0, period: SupportsIndex = 1, low: SupportsFloat | None = None,
    high: SupportsFloat | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def constant(
    *, dims: Integers, dtype: DType = 'float32', spacing: SupportsFloat | Numbers = 1.0,
    origin: SupportsFloat | Numbers = 0.0, value: SupportsFloat = 0.0, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def marschner_lobb(
    *, dims: Integers, dtype: DType = 'float32', spacing: SupportsFloat | Numbers = 1.0,
    origin: SupportsFloat | Numbers = 0.0, frequency: SupportsFloat = 6.0, amplitude: SupportsFloat = 0.25,
    low: SupportsFloat | None = None, high: SupportsFloat | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def noise(
    *, dims: Integers, dtype: DType = 'float32', spacing: SupportsFloat | Numbers = 1.0,
    origin: SupportsFloat | Numbers = 0.0, seed: SupportsIndex = 0, low: SupportsFloat | None = None,
    high: SupportsFloat | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def ramp(
    *, dims: Integers, dtype: DType = 'float32', spacing: SupportsFloat | Numbers = 1.0,
    origin: SupportsFloat | Numbers = 0.0, axis: Literal['x', 'y', 'z'] = 'x', from_: SupportsFloat = 0.0,
    to: SupportsFloat | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def sphere(
    *, dims: Integers, dtype: DType = 'float32', spacing: SupportsFloat | Numbers = 1.0,
    origin: SupportsFloat | Numbers = 0.0, radius: SupportsFloat | None = None,
    center: SupportsFloat | Numbers | None = None, inside: SupportsFloat | None = None,
    outside: SupportsFloat | None = None, edge: Literal['hard', 'coverage', 'distance'] = 'hard',
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
