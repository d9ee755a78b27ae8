# Written by libvkt/python/stubs.py from the registry; do not edit.
# SPDX-License-Identifier: MIT
import builtins
import os
from typing import Any, Iterable, Iterator, Literal, Mapping, Sequence, SupportsFloat, SupportsIndex, overload

import numpy as np

from . import filter as filter, make as make

Array = np.ndarray[Any, np.dtype[Any]]
Numbers = Sequence[SupportsFloat] | Array
Integers = Sequence[SupportsIndex] | Array
Value = str | SupportsFloat | Numbers | os.PathLike[str]
DType = str | type | np.dtype[Any]
Region = str | Sequence[builtins.slice | SupportsIndex | Sequence[SupportsFloat | None]] | Array
__version__: str

class Error(Exception):
    exit_code: int
    hint: str
    def __init__(self, message: str, exit_code: int, hint: str = '') -> None: ...

class Series:
    def __init__(self, path: str | os.PathLike[str], options: dict[str, Any], numbers: range | None = None) -> None: ...
    def __iter__(self) -> Iterator[Volume]: ...
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, which: int) -> Volume: ...
    @overload
    def __getitem__(self, which: builtins.slice) -> Series: ...

class Surface:
    report: Any
    def __init__(self, handle: Any) -> None: ...
    def __len__(self) -> int: ...
    def vertices(self, part: int = 0) -> Array: ...
    def triangles(self, part: int = 0) -> Array: ...
    def label(self, part: int = 0) -> int: ...
    def write(self, path: str | os.PathLike[str], **options: Any) -> None: ...

class Volume:
    def __init__(
        self, array: Any, *, spacing: float | Sequence[float] | None = None, origin: Sequence[float] | None = None,
        direction: Any = None, slope: float | None = None, intercept: float | None = None, units: str | None = None,
        like: Volume | None = None, copy: bool = True,
    ) -> None: ...
    def __copy__(self) -> Volume: ...
    def __deepcopy__(self, memo: dict[int, Any]) -> Volume: ...
    @property
    def __array_interface__(self) -> dict[str, Any]: ...
    def __dlpack__(
        self, *, stream: Any = None, max_version: tuple[int, int] | None = None, dl_device: Any = None,
        copy: bool | None = None,
    ) -> Any: ...
    def __dlpack_device__(self) -> tuple[int, int]: ...
    @property
    def devices(self) -> tuple[str, ...]: ...
    def migrate(self, device: str) -> Volume: ...
    @property
    def array(self) -> Array: ...
    @property
    def dims(self) -> tuple[int, int, int]: ...
    @property
    def dtype(self) -> np.dtype[Any]: ...
    @property
    def spacing(self) -> tuple[float, float, float]: ...
    @property
    def origin(self) -> tuple[float, float, float]: ...
    @property
    def direction(self) -> Array: ...
    @property
    def slope(self) -> float: ...
    @property
    def intercept(self) -> float: ...
    @property
    def units(self) -> str: ...
    @property
    def space(self) -> str: ...
    @property
    def hierarchical(self) -> bool: ...
    @property
    def header(self) -> dict[str, Any]: ...
    @property
    def report(self) -> dict[str, Any] | None: ...
    def stats(self, **options: Any) -> dict[str, Any]: ...
    def write(self, path: str | os.PathLike[str], **options: Any) -> None: ...
    def apply(self, name: str, *arguments: Any, **options: Any) -> Any: ...
    @overload
    def render(self, *, format: Literal['uint8', 'float'] = 'uint8', **options: Any) -> Array: ...
    @overload
    def render(self, *, format: Literal['png'], **options: Any) -> bytes: ...
    def transform(self, what: Any, *others: Volume, **options: Any) -> Volume: ...
    def to_xarray(self, stored: bool = False) -> Any: ...
    def _repr_html_(self) -> str: ...

class policy:
    def __init__(self, device: str | None = None, threads: int | None = None, memory: int | None = None) -> None: ...
    def __enter__(self) -> policy: ...
    def __exit__(self, *raised: Any) -> None: ...
    @property
    def device(self) -> str: ...
    @property
    def threads(self) -> int: ...
    @property
    def memory(self) -> int: ...

def affine(
    volume: Volume, matrix: Value, *, unit: Literal['voxel', 'world'] = 'world', inverse: bool = False,
    expand: bool = False, like: Volume | Value | None = None, roi: Region | None = None,
    method: Literal['auto', 'nearest', 'linear', 'cubic', 'bspline3', 'bspline5', 'lanczos3'] | None = None,
    tolerance: SupportsFloat | None = None, boundary: str | None = None, background: SupportsFloat | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def apply(name: str, *arguments: Any, **options: Any) -> Any: ...
def arith(
    
    op: Literal['add', 'sub', 'mul', 'div', 'min', 'max', 'absdiff', 'pow', 'gt', 'ge', 'lt', 'le', 'eq', 'ne', 'and', 'or', 'not', 'abs', 'neg', 'sqrt', 'exp', 'log', 'clamp', 'where'],
    a: Volume | SupportsFloat | None = None, b: Volume | SupportsFloat | None = None,
    c: Volume | SupportsFloat | None = None, *, dtype: DType | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def brick(volume: Volume, **options: Any) -> list[Volume]: ...
def clahe(
    volume: Volume, *, clip: SupportsFloat | None = None,
    clip_as: Literal['opencv', 'skimage', 'volkit', 'pizer'] = 'opencv', bricks: Integers = (8, 8, 8),
    bins: SupportsIndex = 256, range: Value = 'minmax', roi: Region | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def convert(
    volume: Volume, *, dtype: DType | None = None, tolerance: SupportsFloat | None = None, range: Value | None = None,
    to: Value | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def copy(
    part: Volume, into: Volume | None = None, *, at: Integers | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def crop(
    volume: Volume, *, roi: Region | None = None, roi_world: Region | None = None, like: Volume | Value | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def declare_sv(
    *, dims: Integers, data_format: DType | None = None, bytes_per_voxel: SupportsIndex | None = None,
    dist: Numbers | None = None, voxel_mapping: Numbers | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def delete(
    volume: Volume, *, roi: Region, value: SupportsFloat | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def diff(
    volume: Volume, other: Volume, *, tolerance: SupportsFloat = 0.0, geometry: bool = False, ssim: bool = False,
    ssim_range: SupportsFloat | None = None, mutual_information: bool = False, bins: SupportsIndex | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> dict[str, Any]: ...
def distance(
    volume: Volume, *, signed: bool = False, unit: Literal['voxel', 'world'] = 'world', roi: Region | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def dump(
    volume: Volume, *, roi: Region | None = None, first: Integers | None = None, last: Integers | None = None,
    input: Volume | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> dict[str, Any]: ...
def dump_range(
    volume: Volume, *, roi: Region | None = None, first: Integers | None = None, last: Integers | None = None,
    input: Volume | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> dict[str, Any]: ...
def edit(
    volume: Volume, *, spacing: SupportsFloat | Numbers | None = None, dist: Numbers | None = None,
    origin: SupportsFloat | Numbers | None = None, direction: Value | None = None, units: Value | None = None,
    slope: SupportsFloat | None = None, intercept: SupportsFloat | None = None, voxel_mapping: Numbers | None = None,
    attribute: str | Sequence[str] | Mapping[str, Any] | None = None, dims: Integers | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def fill(
    volume: Volume, *, value: SupportsFloat = 0.0, roi: Region | None = None, first: Integers | None = None,
    last: Integers | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def fill_holes(
    volume: Volume, *, connectivity: SupportsIndex = 6, value: SupportsFloat | None = None,
    max_size: SupportsIndex | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def fill_range(
    volume: Volume, *, value: SupportsFloat = 0.0, roi: Region | None = None, first: Integers | None = None,
    last: Integers | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def flip(
    volume: Volume, axis: Literal['x', 'y', 'z'], *, roi: Region | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def flip_range(
    volume: Volume, *, axis: Literal['x', 'y', 'z'] = 'x', first: Integers, last: Integers, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def from_dlpack(array: Any, *, copy: bool = False, **geometry: Any) -> Volume: ...
def from_xarray(array: Any) -> Volume: ...
def histogram(
    volume: Volume, *, bins: SupportsIndex = 256, range: Value = 'minmax', roi: Region | None = None,
    mergeable: bool = False, merge: Value | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> dict[str, Any]: ...
def info(
    *volumes: Volume, head: bool = False, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> dict[str, Any]: ...
def label(
    volume: Volume, *, connectivity: SupportsIndex = 6, by_value: bool = False,
    keep_largest: SupportsIndex | None = None, min_size: SupportsIndex = 1, dtype: DType = 'uint32',
    roi: Region | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def merge(bricks: Iterable[Volume]) -> Volume: ...
def mesh(
    volume: Volume, *, iso: SupportsFloat | None = None, label: SupportsIndex | Integers | None = None,
    labels: bool = False, roi: Region | None = None, open: bool = False, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> dict[str, Any]: ...
def morphology(
    volume: Volume, what: Literal['erode', 'dilate', 'open', 'close', 'gradient', 'tophat'], *,
    radius: SupportsIndex = 1, shape: Literal['ball', 'box'] = 'ball', boundary: str = 'mirror',
    roi: Region | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def operations() -> list[str]: ...
def pad(
    volume: Volume, *, by: SupportsIndex, boundary: str = 'border:0', value: SupportsFloat | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
@overload
def permute(
    volume: Volume, order: Value, *, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
@overload
def permute(
    volume: Volume, *, to: Value, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def project(
    volume: Volume, what: Literal['max', 'min', 'mean', 'sum', 'std', 'median'], *,
    axis: Literal['x', 'y', 'z'] = 'z', roi: Region | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def read(path: str | os.PathLike[str], **options: Any) -> Volume: ...
def read_series(path: str | os.PathLike[str], **options: Any) -> Series: ...
def read_stream(file: Any) -> Iterator[Volume]: ...
def refine(
    volume: Volume, *, tolerance: SupportsFloat, metric: Literal['value', 'gradient', 'transfer'] = 'value',
    transfer: Value | None = None, block_size: SupportsIndex | None = None, levels: SupportsIndex = 8,
    method: Literal['basis', 'nearest', 'average', 'auto'] = 'basis', dtype: Literal['keep', 'auto'] | None = None,
    background: SupportsFloat | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
@overload
def render(volume: Volume, *, format: Literal['uint8', 'float'] = 'uint8', **options: Any) -> Array: ...
@overload
def render(volume: Volume, *, format: Literal['png'], **options: Any) -> bytes: ...
@overload
def reorient(
    volume: Volume, order: Value, *, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
@overload
def reorient(
    volume: Volume, *, to: Value, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def resample(
    volume: Volume, *, scale: SupportsFloat | Numbers | None = None, dims: Integers | None = None,
    spacing: SupportsFloat | Numbers | None = None, like: Volume | Value | None = None,
    cells: SupportsFloat | None = None,
    method: Literal['auto', 'nearest', 'linear', 'area', 'cubic', 'bspline3', 'bspline5', 'lanczos3', 'basis', 'average'] | None = None,
    tolerance: SupportsFloat | None = None, roi: Region | None = None, roi_world: Region | None = None,
    background: SupportsFloat | None = None, mask: bool = False, boundary: str | None = None,
    dtype: DType | None = None, bytes_per_voxel: SupportsIndex | None = None, dist: Numbers | None = None,
    voxel_mapping: Numbers | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def rotate(
    volume: Volume, *, axis: Value | None = None, angle: SupportsFloat | None = None,
    euler: SupportsFloat | Numbers | None = None, quaternion: Value | None = None,
    about: SupportsFloat | Numbers | None = None, expand: bool = False, like: Volume | Value | None = None,
    roi: Region | None = None,
    method: Literal['auto', 'nearest', 'linear', 'cubic', 'bspline3', 'bspline5', 'lanczos3'] | None = None,
    tolerance: SupportsFloat | None = None, boundary: str | None = None, background: SupportsFloat | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def scale(
    volume: Volume, *, factor: SupportsFloat | Numbers, about: SupportsFloat | Numbers | None = None,
    expand: bool = False, like: Volume | Value | None = None, roi: Region | None = None,
    method: Literal['auto', 'nearest', 'linear', 'cubic', 'bspline3', 'bspline5', 'lanczos3'] | None = None,
    tolerance: SupportsFloat | None = None, boundary: str | None = None, background: SupportsFloat | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def scan(
    volume: Volume, *, exclusive: bool = False, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def set(
    volume: Volume, *, spacing: SupportsFloat | Numbers | None = None, dist: Numbers | None = None,
    origin: SupportsFloat | Numbers | None = None, direction: Value | None = None, units: Value | None = None,
    slope: SupportsFloat | None = None, intercept: SupportsFloat | None = None, voxel_mapping: Numbers | None = None,
    attribute: str | Sequence[str] | Mapping[str, Any] | None = None, dims: Integers | None = None,
    device: Value = 'auto', threads: SupportsIndex | None = None, memory: Value | None = None,
    slab: SupportsIndex = 0,
) -> Volume: ...
def slice(
    volume: Volume, *, axis: Literal['x', 'y', 'z'] | None = None, x: SupportsIndex | None = None,
    y: SupportsIndex | None = None, z: SupportsIndex | None = None, range: Value | None = None,
    normal: SupportsFloat | Numbers | None = None, at: SupportsFloat | Numbers | None = None,
    up: SupportsFloat | Numbers | None = None, spacing: SupportsFloat | None = None,
    thickness: SupportsFloat | None = None, project: Literal['mean', 'max', 'min'] | None = None,
    method: Literal['auto', 'nearest', 'linear', 'cubic', 'bspline3', 'bspline5', 'lanczos3'] | None = None,
    background: SupportsFloat | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def split(volume: Volume) -> list[Volume]: ...
def stack(volumes: Iterable[Volume], *, force_uniform: bool = False) -> Volume: ...
def stats(
    *volumes: Volume, roi: Region | None = None, percentiles: SupportsFloat | Numbers | None = None,
    mask: Volume | None = None, labels: Volume | None = None, per: Literal['x', 'y', 'z'] | None = None,
    mergeable: bool = False, merge: Value | None = None, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> dict[str, Any]: ...
def surface(volume: Volume, **options: Any) -> Surface: ...
def threshold(
    volume: Volume, *, above: SupportsFloat | None = None, below: SupportsFloat | None = None,
    range: Value | None = None, otsu: bool = False, roi: Region | None = None, device: Value = 'auto',
    threads: SupportsIndex | None = None, memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def to_xarray(volume: Volume, stored: bool = False) -> Any: ...
def transform(volume: Volume, what: Any, *others: Volume, **options: Any) -> Volume: ...
def trim() -> int: ...
def watershed(
    volume: Volume, *, markers: Volume | None = None, depth: SupportsFloat = 0.0,
    on: Literal['value', 'gradient', 'distance'] = 'value', connectivity: SupportsIndex = 6,
    mask: Volume | None = None, line: bool = False, device: Value = 'auto', threads: SupportsIndex | None = None,
    memory: Value | None = None, slab: SupportsIndex = 0,
) -> Volume: ...
def write_series(volumes: Iterable[Volume | Array], path: str | os.PathLike[str], **options: Any) -> None: ...
def write_stream(file: Any, volumes: Volume | Array | Iterable[Volume | Array], **options: Any) -> None: ...
